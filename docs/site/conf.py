"""Sphinx configuration of the documentation site; docs/build.sh runs it over the tree that stage.py puts together."""
import importlib.util
import os
import re
import sys
from pathlib import Path

from pygments.lexers import TextLexer
from sphinx.highlighting import lexers

sys.path.insert(0, str(Path(__file__).parent))
import repository_pages  # noqa: E402 (a module beside this file)

STAGE = Path(os.environ["ESPALIER_SITE_STAGE"])  # the source folder of Sphinx, made by stage.py
ROOT = Path(os.environ["ESPALIER_SITE_ROOT"])    # the checkout

project = "Espalier"
author = "the authors of Espalier"
project_copyright = author
version = release = re.search(r"VERSION (\d+\.\d+\.\d+)", (ROOT / "CMakeLists.txt").read_text()).group(1)
root_doc = "index"
exclude_patterns = ["site/**", "downloads/**", "README.md"]

extensions = ["myst_nb", "sphinx.ext.autodoc", "sphinx.ext.autosummary", "sphinx_copybutton",
              "sphinx_design", "breathe", "mathml", "plain_docstrings", "repository_pages"]
nitpicky = False
suppress_warnings = ["myst.header", "mystnb.unknown_mime_type"]

myst_enable_extensions = ["colon_fence", "deflist", "dollarmath", "attrs_block", "attrs_inline", "html_image"]
myst_heading_anchors = 4
myst_url_schemes = ["http", "https", "mailto", repository_pages.SCHEME]
highlight_language = "none"

# Notebooks are executed once and kept until they change.
nb_execution_mode = os.environ.get("ESPALIER_SITE_NOTEBOOKS", "cache")
nb_execution_cache_path = os.environ.get("ESPALIER_SITE_CACHE", str(STAGE.parent / "notebooks"))
nb_execution_timeout = 300
nb_execution_raise_on_error = True
nb_merge_streams = True

autodoc_typehints = "signature"
autodoc_member_order = "bysource"
autodoc_default_options = {"members": True, "undoc-members": False}
# Adapters of packages that are not here are described all the same.
autodoc_mock_imports = [m for m in ("torch", "ngsolve", "sfepy", "jax", "scipy") if importlib.util.find_spec(m) is None]
autosummary_generate = False
python_display_short_literal_types = True

breathe_projects = {"espalier": str(STAGE.parent / "doxygen" / "xml")}
breathe_default_project = "espalier"
breathe_domain_by_extension = {"h": "c", "hpp": "cpp"}
breathe_show_include = False

html_theme = "furo"
html_title = f"Espalier {release}"
html_static_path = ["static", str(STAGE / "images/engine_motion.png")]
html_css_files = ["espalier.css"]
html_favicon = "static/espalier.svg"
html_extra_path = [str(STAGE.parent / "extra")]  # report.html, by stage.py
html_copy_source = False
html_show_sourcelink = False
html_show_sphinx = False
html_math_renderer = "mathml"
html_theme_options = {
    "sidebar_hide_name": False,
    "light_logo": "espalier.svg",
    "dark_logo": "espalier.svg",
    "light_css_variables": {"color-brand-primary": "#1f6b45", "color-brand-content": "#1f6b45"},
    "dark_css_variables": {"color-brand-primary": "#7cc9a0", "color-brand-content": "#7cc9a0"},
    "footer_icons": [],
}
lexers["csv"] = TextLexer()
pygments_style = "friendly"
pygments_dark_style = "github-dark"
copybutton_exclude = ".linenos, .gp, .go"
