"""Pages of runs: in notebooks, in browsers, in files."""

import os


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
    """A page. A notebook shows it in the cell, in a frame of its own; elsewhere a browser is asked to open it."""

    def __init__(self, text: str, height: int) -> None:
        self.text = text
        self.height = height
        self.path = ""
        if _in_notebook():
            return
        from tempfile import mkstemp
        from webbrowser import open_new_tab

        handle, self.path = mkstemp(prefix="espalier-", suffix=".html")
        with open(handle, "w", encoding="utf-8") as file:
            file.write(text)
        self.opened = os.environ.get("ESPALIER_NO_BROWSER") is None and open_new_tab(f"file://{self.path}")

    def _repr_html_(self) -> str:
        from html import escape

        return (f'<iframe srcdoc="{escape(self.text, quote=True)}" style="width:100%;height:{self.height}px;border:0" '
                'title="The page of a run" allowfullscreen></iframe>')

    def __repr__(self) -> str:
        return f"<page of a run, {len(self.text) // 1000} kB{f': file://{self.path}' if self.path else ''}>"
