"""Configuration of Sphinx. build.py stages the pages and calls Sphinx with it."""

import os
import sys

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))

project = "hamelin"
author = "the authors of hamelin"
copyright = author
release = os.environ["HAMELIN_SITE_VERSION"]
root_doc = "docs/index"
extensions = ["myst_parser", "sphinx_copybutton", "equations"]
source_suffix = {".md": "markdown"}
myst_heading_anchors = 6
highlight_language = "none"
html_theme = "furo"
html_title = f"hamelin {release}"
html_static_path = ["_static"]
html_css_files = ["style.css"]
html_copy_source = False
html_show_sourcelink = False
html_show_sphinx = False
html_show_copyright = False
html_use_index = False
# The prompt is not shown in console blocks; comments behind commands are kept.
copybutton_only_copy_prompt_lines = False
html_theme_options = {
    "light_css_variables": {"font-stack--monospace": "'DejaVu Sans Mono', Menlo, Consolas, monospace"},
    "dark_css_variables": {"font-stack--monospace": "'DejaVu Sans Mono', Menlo, Consolas, monospace"},
}
