"""Sphinx: plain Markdown, a theme without fonts or scripts from elsewhere; `build.py` makes every warning an error."""

project = "rollover"
author = "The rollover authors"
extensions = ["myst_parser"]
myst_heading_anchors = 4  # links to headings, as repositories have them
html_theme = "furo"
html_title = "rollover"
html_show_sphinx = False
html_copy_source = False
nitpicky = True
