"""Sphinx configuration.

Some pages are made from the code itself: the cards of the environments and the help of the command line. The compiled
module is documented from its stub, which has the types beside the module's own docstrings.
"""

import __future__

import inspect
import operator
import sys
from functools import reduce
from pathlib import Path
from types import ModuleType

from sphinx.application import Sphinx
from typer.testing import CliRunner

import rover_gym
from rover_gym import RoverEnv, __version__, mechanics
from rover_gym.cli import app as rover
from rover_gym.policy import RoverCommandEnv, RoverGoalEnv, RoverTrapEnv

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
python_use_unqualified_type_names = True
autodoc_default_options = {"members": True, "undoc-members": True}


def _use_stub() -> None:
    """Puts the stub's classes where Sphinx looks for the compiled ones, in `rover_gym.mechanics`."""
    name = mechanics.__name__
    stub = ModuleType(name, mechanics.__doc__)
    source = Path(mechanics.__file__).with_name("_core.pyi")
    text = source.read_text(encoding="utf-8")
    for alias, name_in_print in (("npt.ArrayLike", "ArrayLike"), ("npt.NDArray[np.float64]", "np.ndarray")):
        text = text.replace(alias, name_in_print)  # unfolded, they fill half a page
    stub.ArrayLike = type("ArrayLike", (), {"__module__": "numpy.typing"})
    # A stub may name a class before it is there, so its annotations stay unevaluated.
    code = compile(text, source, "exec", __future__.annotations.compiler_flag)
    exec(code, stub.__dict__)  # noqa: S102 - our own stub
    kinds = (stub.Plane, stub.SphereField, stub.HeightField, stub.TriangleMesh, stub.Union)  # type: ignore[attr-defined]
    stub.Terrain = reduce(operator.or_, kinds)  # type: ignore[attr-defined]
    sys.modules[name] = rover_gym.mechanics = stub


#: Environments whose docstring is a card in Markdown, by name; each has a page of its own.
CARDS = {
    "Rover-v0": RoverEnv,
    "RoverCommand-v0": RoverCommandEnv,
    "RoverGoal-v0": RoverGoalEnv,
    "RoverTrap-v0": RoverTrapEnv,
}


def _card(name: str) -> str:
    """An environment's card."""
    return f"# {name}\n\n{inspect.getdoc(CARDS[name])}\n"


def _command_line() -> str:
    """The help of every command."""
    parts = ["# The command line\n"]
    runner = CliRunner(env={"TERMINAL_WIDTH": "100", "COLUMNS": "100", "NO_COLOR": "1"})
    models = [["model", name] for name in ("import", "show", "check")]
    names = ("drive", "train", "evaluate", "baseline", "report", "plot", "replay", "scene")
    for command in ([], *([name] for name in names), *models):
        text = runner.invoke(rover, [*command, "--help"], prog_name="rover").output
        parts.append(f"```text\n$ {' '.join(['rover', *command, '--help'])}\n{text.rstrip()}\n```\n")
    return "\n".join(parts)


def _write_generated(_app: Sphinx) -> None:
    GENERATED.mkdir(exist_ok=True)
    pages = {f"{name.lower()}.md": _card(name) for name in CARDS}
    for name, text in (pages | {"command-line.md": _command_line()}).items():
        (GENERATED / name).write_text(text, encoding="utf-8")


def _mend_docstring(_app: Sphinx, _what: str, _name: str, obj: object, _options: object, lines: list[str]) -> None:
    """The card appears as its first line, since the whole has its own page; a bar is a norm, no substitution."""
    if any(obj is environment for environment in CARDS.values()):
        lines[1:] = ["", "The environment's card has a page of its own."]
    lines[:] = [line.replace("|", r"\|") for line in lines]


def setup(app: Sphinx) -> None:
    """Called by Sphinx."""
    _use_stub()
    app.connect("builder-inited", _write_generated)
    app.connect("autodoc-process-docstring", _mend_docstring)
