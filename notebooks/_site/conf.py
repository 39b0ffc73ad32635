"""Sphinx configuration of the documentation site; `make docs` builds it from `notebooks/`."""

import importlib
import os
import sys
from pathlib import Path

HERE = Path(__file__).parent
ROOT = HERE.parents[1]
sys.path[:0] = [str(ROOT), str(HERE)]
# Notebooks are executed at quick size, unless the environment asks for the long one.
os.environ.setdefault("NOTEBOOK_QUICK", "1")

project = "stickslip"
version = release = importlib.import_module("stickslip").__version__
# The second brings MathJax with it, so that formulas need no network.
extensions = ["myst_nb", "sphinx-mathjax-offline"]
exclude_patterns = ["_site", "**.ipynb", "**/.ipynb_checkpoints", "jupyter_execute"]

# Notebooks are scripts with cells.
nb_custom_formats = {".py": ["jupytext.reads", {"fmt": "py:percent"}]}
nb_execution_mode = "cache"
nb_execution_timeout = 600
nb_execution_raise_on_error = True
nb_merge_streams = True
# What an executed cell writes to stderr is progress and warnings of the machine, not a result.
nb_output_stderr = "remove"

myst_enable_extensions = ["dollarmath", "amsmath", "colon_fence"]
myst_heading_anchors = 3
# Of the file names in the pages, those outside of the site are links to the checkout's files.
suppress_warnings = ["myst.xref_missing"]

html_theme = "pydata_sphinx_theme"
html_title = f"stickslip {version}"
html_theme_options = {
    "navigation_with_keys": False,
    "show_prev_next": True,
    "secondary_sidebar_items": ["page-toc"],
    "footer_start": [],
    "footer_end": [],
}
html_show_sourcelink = False
# Pages without pages below them have nothing to show on the left, and take the room.
html_sidebars = {"*": []}
python_maximum_signature_line_length = 80


def setup(app):
    """Write the pages that follow from the packages and from the records."""
    from pages import write_pages

    app.connect("config-inited", lambda app, config: write_pages(Path(app.srcdir)))
