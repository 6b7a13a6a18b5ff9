"""Sphinx configuration. Two pages are made from the code itself: the environment's card and the command line's help."""

import inspect
from pathlib import Path

from sphinx.application import Sphinx
from typer.testing import CliRunner

from rover_gym import RoverEnv, __version__
from rover_gym.cli import app as rover

HERE = Path(__file__).parent
GENERATED = HERE / "_generated"

project = "rover-gym"
author = "The rover-gym contributors"
copyright = f"2026, {author}"  # noqa: A001 - Sphinx's name for it
version = release = __version__

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon"]
exclude_patterns = ["_build"]
html_theme = "furo"
html_title = f"rover-gym {release}"
default_role = "literal"  # docstrings write `code` as Markdown does
nitpicky = False
myst_heading_anchors = 3

napoleon_use_ivar = True  # attributes in a class docstring document the fields, once
autodoc_member_order = "bysource"
autodoc_typehints = "signature"
autodoc_default_options = {"members": True, "undoc-members": True}


def _card() -> str:
    """The environment's docstring, which is Markdown."""
    return f"# Rover-v0\n\n{inspect.getdoc(RoverEnv)}\n"


def _command_line() -> str:
    """The help of every command."""
    parts = ["# The command line\n"]
    runner = CliRunner(env={"TERMINAL_WIDTH": "100", "COLUMNS": "100", "NO_COLOR": "1"})
    for command in ([], ["drive"], ["report"]):
        text = runner.invoke(rover, [*command, "--help"], prog_name="rover").output
        parts.append(f"```text\n$ {' '.join(['rover', *command, '--help'])}\n{text.rstrip()}\n```\n")
    return "\n".join(parts)


def _write_generated(_app: Sphinx) -> None:
    GENERATED.mkdir(exist_ok=True)
    for name, text in (("rover-v0.md", _card()), ("command-line.md", _command_line())):
        (GENERATED / name).write_text(text, encoding="utf-8")


def _shorten_card(_app: Sphinx, _what: str, name: str, _obj: object, _options: object, lines: list[str]) -> None:
    """In the API page the card is its first line; the whole has a page of its own."""
    if name == "rover_gym.RoverEnv":
        lines[1:] = ["", "The environment's card has a page of its own."]


def setup(app: Sphinx) -> None:
    """Called by Sphinx."""
    app.connect("builder-inited", _write_generated)
    app.connect("autodoc-process-docstring", _shorten_card)
