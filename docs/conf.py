"""Sphinx: Markdown and notebooks, a theme without fonts or scripts from elsewhere; `build.py` makes warnings errors."""

from typing import Any

import notebooks
import widths

project = "rollover"
author = "The rollover authors"
project_copyright = author
extensions = ["myst_nb"]  # myst_parser, and cells that are run
myst_heading_anchors = 4  # links to headings, as repositories have them
html_theme = "furo"
html_static_path = ["static"]
html_css_files = ["site.css"]
html_title = "rollover"
html_show_sphinx = False
html_copy_source = False
nitpicky = True
nb_execution_mode = "force"  # what a page shows is what its cells answer today
nb_execution_in_temp = True
nb_execution_timeout = 1800  # s for each cell: the first one may have to compile the kernels, beside other work
nb_execution_raise_on_error = True
nb_merge_streams = True
nb_render_markdown_format = "myst"


def setup(app: Any) -> None:
    """Draw the cells of a shell as what a terminal takes, and let long names break."""
    app.connect("doctree-read", notebooks.shown)
    app.connect("html-page-context", widths.fold)
