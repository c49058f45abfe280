"""Files of the repository as pages of the site.

The guides link to sources beside them, for instance to ../../examples/solve_c.c. On the site such a link goes to a page
with that file, highlighted; a link to a folder goes to a list of its files. Only files that pages link to become pages.
"""
import os
import re
from html import escape
from pathlib import Path

from docutils import nodes
from pygments import highlight
from pygments.formatters import HtmlFormatter
from pygments.lexers import TextLexer, get_lexer_for_filename
from pygments.util import ClassNotFound

SCHEME = "repository"
LINK = re.compile(r"\]\(((?:\.\.?/)[^)\s#]+)(#[^)\s]*)?\)")
ANCHOR = re.compile(r'^<a (?:id|name)="([\w.-]+)"></a>\s*$', re.M)
REFERENCE = ("python", *(f"headers/{h}" for h in ("solver_hpp", "matrix_hpp", "types_hpp", "dynamics_hpp", "dae_hpp", "eigen_hpp",
                                                   "sundials_hpp", "espalier_h")), "help", "options", "model_keys")  # in this order
LARGEST = 400_000  # bytes; larger files are named, not shown


def source_read(app, docname, source):
    """Writes links that leave the documentation as SCHEME:path-from-the-root; missing files are left to Sphinx."""
    root, stage = Path(app.config.espalier_root), Path(app.srcdir)
    page = root / "docs" / docname

    def replace(match):
        target = Path(os.path.normpath(page.parent / match[1]))
        inside = target.is_relative_to(root / "docs") and (stage / target.relative_to(root / "docs")).exists()
        if inside and not target.is_dir() or not target.exists() or not target.is_relative_to(root):
            return match[0]
        return f"]({SCHEME}:{target.relative_to(root).as_posix()})"

    source[0] = ANCHOR.sub(r"(\1)=", LINK.sub(replace, source[0]))  # (name)= is what MyST calls such a place
    if "/" not in docname:  # Sphinx carries the pictures of <img> along; those of <source> are static files (conf.py)
        source[0] = source[0].replace('srcset="images/', 'srcset="_static/')
    if docname.endswith("/README") and docname != "guide/README":
        source[0] += toctree(app, docname)


def toctree(app, docname):
    """The pages of a folder below its README: those that it links to in their order, then the others."""
    folder = docname.rpartition("/")[0]
    text = (Path(app.srcdir) / (docname + ".md")).read_text()
    pages = [f"{folder}/{name}" for name in re.findall(r"\]\(([\w-]+)\.md\)", text)]
    if folder == "reference":
        pages += [f"reference/{p}" for p in REFERENCE]
    pages += sorted(d for d in app.env.found_docs if d.startswith(folder + "/") and d != docname)
    shown = "" if folder == "reference" else ":hidden:\n"
    return f"\n\n```{{toctree}}\n{shown}:maxdepth: 1\n\n" + "\n".join("/" + d for d in dict.fromkeys(pages)) + "\n```\n"


def resolved(app, doctree, docname):
    """Turns SCHEME links into links to the pages, and remembers what is to be written."""
    for node in doctree.findall(nodes.reference):
        uri = node.get("refuri", "")
        if uri.startswith(SCHEME + ":"):
            path = uri[len(SCHEME) + 1:]
            app.env.repository_files.setdefault(docname, set()).add(path)
            node["refuri"] = app.builder.get_relative_uri(docname, page_name(path))
            node["internal"] = True


def page_name(path):
    return "source/" + path


def listing(app, name, folder, prefix):
    """The files of a folder, each with a link to its page."""
    files = sorted(f for f in folder.iterdir() if f.is_file() and not f.name.startswith("."))
    items = "".join(f'<li><a href="{app.builder.get_relative_uri(name, page_name(prefix + "/" + f.name))}">'
                    f"{escape(f.name)}</a></li>" for f in files)
    return f"<ul>{items}</ul>", [prefix + "/" + f.name for f in files]


def shown(path):
    """The text of a file with colours."""
    try:
        text = path.read_text()
    except UnicodeDecodeError:
        return f"<p>{path.stat().st_size} bytes, not a text.</p>"
    if len(text) > LARGEST:
        return f"<p>{len(text)} characters: see the file in the repository.</p>"
    try:
        lexer = get_lexer_for_filename(path.name)
    except ClassNotFound:
        lexer = TextLexer()
    return highlight(text, lexer, HtmlFormatter(cssclass="highlight"))


def pages(app):
    root = Path(app.config.espalier_root)
    todo = sorted(set().union(*app.env.repository_files.values())) if app.env.repository_files else []
    done = set()
    while todo:
        path = todo.pop()
        if path in done:
            continue
        done.add(path)
        target = root / path
        if target.is_dir():
            body, more = listing(app, page_name(path), target, path)
            todo += more
        else:
            body = shown(target)
        yield page_name(path), {"title": path, "body": f"<h1><code>{escape(path)}</code></h1>{body}"}, "page.html"


def start(app, env, docnames):
    if not hasattr(env, "repository_files"):
        env.repository_files = {}


def setup(app):
    app.add_config_value("espalier_root", os.environ.get("ESPALIER_SITE_ROOT", ""), "env")
    app.connect("env-before-read-docs", start)
    app.connect("source-read", source_read)
    app.connect("doctree-resolved", resolved)
    app.connect("html-collect-pages", pages)
    return {"parallel_read_safe": True, "parallel_write_safe": False}
