"""Pages of runs: in notebooks, in browsers, in files."""

import os
from typing import Any, Callable


def write_page(text: str, path: str) -> None:
    """All of it or nothing: under another name first."""
    part = f"{path}.espalier.part"
    try:
        with open(part, "w", encoding="utf-8") as file:
            file.write(text)
        os.replace(part, path)
    except OSError:
        if os.path.exists(part):
            os.remove(part)
        raise


def _in_notebook() -> bool:
    from sys import modules

    shell = modules["IPython"].get_ipython() if "IPython" in modules else None
    return shell is not None and hasattr(shell, "kernel")


class Shown:
    """A page. A notebook shows it in the cell, in a frame of its own, and keeps a picture for where pages do not run;
    elsewhere a browser is asked to open it."""

    def __init__(self, text: str, height: int, picture: "Callable[[], bytes | None]" = lambda: None) -> None:
        self.text = text
        self.height = height
        self.path = ""
        self._picture = picture
        if _in_notebook():
            return
        from tempfile import mkstemp
        from webbrowser import open_new_tab

        handle, self.path = mkstemp(prefix="espalier-", suffix=".html")
        with open(handle, "w", encoding="utf-8") as file:
            file.write(text)
        self.opened = os.environ.get("ESPALIER_NO_BROWSER") is None and open_new_tab(f"file://{self.path}")

    def _html(self, letters: str) -> str:
        """The page over its picture: where frames are taken out of notebooks (GitHub), that is left."""
        from html import escape

        over = "position:absolute;inset:0;width:100%;height:100%;border:0"
        still = f'<img alt="The scene of the page" style="max-width:100%" src="data:image/png;base64,{letters}">' if letters else ""
        return (f'<div style="position:relative;height:{self.height}px;overflow:hidden">{still}<iframe '
                f'srcdoc="{escape(self.text, quote=True)}" style="{over}" title="The page of a run" allowfullscreen></iframe></div>')

    def _repr_html_(self) -> str:
        return self._html("")

    def _repr_mimebundle_(self, include: Any = None, exclude: Any = None) -> "dict[str, str]":
        from base64 import b64encode

        letters = b64encode(self._picture() or b"").decode()
        bundle = {"text/html": self._html(letters), "text/plain": repr(self)}
        return {**bundle, "image/png": letters} if letters else bundle

    def __repr__(self) -> str:
        return f"<page of a run, {len(self.text) // 1000} kB{f': file://{self.path}' if self.path else ''}>"
