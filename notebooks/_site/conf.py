"""Sphinx configuration of the documentation site; `make docs` builds it from `notebooks/`."""

import importlib
import sys
import time
from pathlib import Path

HERE = Path(__file__).parent
ROOT = HERE.parents[1]
sys.path[:0] = [str(ROOT), str(HERE)]

project = "stickslip"
version = release = importlib.import_module("stickslip").__version__
# The second brings MathJax with it, so that formulas need no network.
extensions = ["myst_nb", "sphinx-mathjax-offline"]
exclude_patterns = ["_site", "**.ipynb", "**/.ipynb_checkpoints", "jupyter_execute"]

# Notebooks are scripts with cells; their reader brings the outputs.
nb_custom_formats = {".py": ["execution.read", {}]}
nb_execution_mode = "off"
nb_merge_streams = True
nb_code_prompt_show = "Show the code"
nb_code_prompt_hide = "Hide the code"

myst_enable_extensions = ["dollarmath", "amsmath", "colon_fence"]
myst_heading_anchors = 3
# Of the file names in the pages, those outside of the site are links to the checkout's files.
suppress_warnings = ["myst.xref_missing"]

html_theme = "pydata_sphinx_theme"
html_title = f"stickslip {version}"
html_theme_options = {
    "navigation_with_keys": False,
    # More do not leave the search its place in the row.
    "header_links_before_dropdown": 4,
    "show_prev_next": True,
    "secondary_sidebar_items": ["page-toc"],
    "footer_start": [],
    "footer_end": [],
}
html_show_sourcelink = html_copy_source = False
html_static_path = ["static"]
html_css_files = ["site.css"]
# Pages without pages below them have nothing to show on the left, and take the room.
html_sidebars = {"*": []}
python_maximum_signature_line_length = 80


def setup(app):
    """Write the pages that follow from the packages and from the records; say what is being read."""
    from pages import write_pages

    began = {}

    def begin(app, page, source):
        began[page] = time.monotonic()
        notebook = Path(app.srcdir, page).with_suffix(".ipynb")
        if Path(app.srcdir, page).with_suffix(".py").exists():
            # A page is read again when its notebook has been executed.
            app.env.note_dependency(str(notebook))

    def end(app, tree):
        page = app.env.current_document.docname
        print(f"{page}: {time.monotonic() - began[page]:.1f} s", flush=True)

    def finish(app, error):
        # MathJax comes in ten bundles, of which the pages load one: half of the size of the site.
        for bundle in Path(app.outdir, "_static", "mathjax").glob("*.js"):
            if bundle.name != "tex-chtml.js":
                bundle.unlink()

    app.connect("config-inited", lambda app, config: write_pages(Path(app.srcdir)))
    app.connect("source-read", begin)
    app.connect("doctree-read", end)
    app.connect("build-finished", finish)
