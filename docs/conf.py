"""Sphinx configuration.

Some pages are made from the code itself: cards of the environments, command line, public names, gallery.
"""

import sys
from pathlib import Path

from sphinx.application import Sphinx

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE))

from extensions import cards, command_line, gallery, public_names, rooms  # noqa: E402 - they are found beside this file
from extensions.compiled import use_stub  # noqa: E402

from rover_gym import __version__  # noqa: E402

project = "rover-gym"
author = "The rover-gym contributors"
copyright = f"2026, {author}"  # noqa: A001 - Sphinx's name for it
version = release = __version__

extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "extensions.contents",
    "extensions.docstrings",
    "extensions.gallery",
]
exclude_patterns = ["_build", "_generated/names.md", "_generated/other-rooms.md", "_generated/pages", "extensions"]
html_theme = "furo"
html_title = f"rover-gym {release}"
html_static_path = ["_static"]
html_extra_path = ["_generated/pages"]  # the gallery's frames and pages
(HERE / "_generated" / "pages").mkdir(parents=True, exist_ok=True)
html_css_files = ["manual.css"]
default_role = "literal"  # docstrings write `code` as Markdown does
nitpicky = False
myst_heading_anchors = 3
myst_enable_extensions = ["colon_fence", "deflist"]

napoleon_use_ivar = True  # attributes in a class docstring document the fields, once
autodoc_member_order = "bysource"
autodoc_typehints = "signature"
maximum_signature_line_length = 80
python_use_unqualified_type_names = True
autodoc_default_options = {"members": True, "undoc-members": True}


def _write_generated(_app: Sphinx) -> None:
    folder = HERE / "_generated"
    gallery.write_gallery(folder / "pages")
    pages = {
        **cards.pages(),
        "command-line.md": command_line.page(),
        "names.md": public_names.table(),
        "other-rooms.md": rooms.sections(),
    }
    for name, text in pages.items():
        path = folder / name
        if not path.exists() or path.read_text(encoding="utf-8") != text:  # what is unchanged is not read again
            path.write_text(text, encoding="utf-8")


def setup(app: Sphinx) -> None:
    """Called by Sphinx."""
    use_stub()
    app.connect("builder-inited", _write_generated)
