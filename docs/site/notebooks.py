"""Pages that are notebooks, as .ipynb files for Jupyter: what a reader may download."""
import json
import re


def is_notebook(text):
    return text.startswith("---") and "\nkernelspec:" in text.partition("\n---\n")[0]


def to_ipynb(text):
    """A page of MyST with {code-cell} blocks as the JSON of a notebook, without outputs."""
    body = text.partition("\n---\n")[2]
    body = re.sub(r"^<!--.*?-->\n", "", body, flags=re.M | re.S)
    cells = []
    for k, part in enumerate(re.split(r"^```\{code-cell\}[^\n]*\n(.*?)^```$", body, flags=re.M | re.S)):
        if not part.strip():
            continue
        cell = {"cell_type": "code" if k % 2 else "markdown", "id": f"cell-{k}", "metadata": {},
                "source": part.strip("\n").splitlines(keepends=True)}
        if k % 2:
            cell.update(execution_count=None, outputs=[])
        cells.append(cell)
    kernel = {"display_name": "Python 3", "language": "python", "name": "python3"}
    return json.dumps({"cells": cells, "metadata": {"kernelspec": kernel}, "nbformat": 4, "nbformat_minor": 5}, indent=1) + "\n"


def with_download(text, name):
    """The page with a link to its notebook below the title."""
    return re.sub(r"^(# .*)$", rf"\1\n\n{{download}}`As a notebook for Jupyter <../downloads/{name}.ipynb>`", text, count=1, flags=re.M)
