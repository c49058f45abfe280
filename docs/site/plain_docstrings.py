"""Docstrings of the package are plain text: marks of reStructuredText in them mean nothing, and what is indented is set as it stands."""
import re


def plain(text):
    """Words between `marks` are code; the rest has no marks."""
    parts = re.split(r"`([^`]+)`", text)
    for k, part in enumerate(parts):
        parts[k] = f"``{part}``" if k % 2 else re.sub(r"([*|`\\]|_(?=\W|$))", r"\\\1", part)
    return "".join(parts)


def process(app, what, name, obj, options, lines):
    out, literal = [], False
    for k, line in enumerate(lines):
        indented = line.startswith("    ") and bool(line.strip())
        if indented and not literal and (k == 0 or not lines[k - 1].strip()):
            out += [".. code-block:: text", ""]
            literal = True
        elif line.strip() and not indented:
            literal = False
        out.append(line if literal else plain(line.strip()))
    lines[:] = out


def setup(app):
    app.connect("autodoc-process-docstring", process)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
