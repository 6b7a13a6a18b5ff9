"""What the manual is made from is complete: chapters and pages are in the contents, every command has its rows."""

import importlib
import re
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
import typer

import rover_gym
from rover_gym.cli import app
from rover_gym.envs.registration import ENVIRONMENTS

DOCS = Path(__file__).parents[2] / "docs"


@pytest.fixture
def extension(monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[[str], ModuleType]]:
    """Imports a module of the manual's own extensions."""
    monkeypatch.syspath_prepend(str(DOCS))
    yield lambda name: importlib.import_module(f"extensions.{name}")
    for name in [name for name in sys.modules if name.partition(".")[0] == "extensions"]:
        del sys.modules[name]


def test_every_chapter_is_in_the_contents() -> None:
    contents = (DOCS / "api.md").read_text(encoding="utf-8")
    assert not [page.stem for page in (DOCS / "api").glob("*.md") if f"\napi/{page.stem}\n" not in contents]


def test_a_room_without_a_chapter_is_documented(
    extension: Callable[[str], ModuleType], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    rooms = extension("rooms")
    assert "rover_gym.drive" not in rooms.without_chapter()
    monkeypatch.setattr(rooms, "CHAPTERS", tmp_path)
    assert ".. automodule:: rover_gym.drive\n" in rooms.sections()


def test_a_page_that_no_list_names_is_listed(extension: Callable[[str], ModuleType]) -> None:
    contents = extension("contents")
    text = (DOCS / "index.md").read_text(encoding="utf-8")
    assert contents.MARK in text
    pages = {"index", "installing", "glossary", "something-new", "tutorials/train-a-policy"}
    assert contents.unlisted(text, pages) == ["something-new"]


def test_signatures_name_nothing_private(extension: Callable[[str], ModuleType]) -> None:
    """The stub's aliases are unfolded."""
    stub = Path(rover_gym.__file__).with_name("_core.pyi").read_text(encoding="utf-8")
    assert re.search(r"\b_[A-Z]", stub)
    assert not re.search(r"\b_[A-Z]", extension("compiled").in_print(stub))


def test_a_class_hands_its_fields_their_descriptions(extension: Callable[[str], ModuleType]) -> None:
    lines = [
        "A thing.",
        "",
        "Attributes:",
        "    size: How large,",
        "        in m.",
        "    name: Its name.",
        "",
        "Raises:",
        "    X: y",
    ]
    rest, fields = extension("docstrings").split_attributes(lines)
    assert rest == ["A thing.", "", "Raises:", "    X: y"]
    assert fields["size"] == ["How large,", "in m."]
    assert fields["name"] == ["Its name.", ""]


def test_every_command_and_option_has_its_row(extension: Callable[[str], ModuleType]) -> None:
    command_line = extension("command_line")
    page = command_line.page()
    commands = list(command_line.commands(typer.main.get_command(app), ("rover",)))
    assert len(commands) > 20
    for path, command in commands:
        _, found, rest = page.partition(f"# `{' '.join(path)}`\n")
        assert found
        section = rest.partition("\n## ")[0].partition("\n### ")[0] if len(path) > 1 else rest
        rows = [line for line in section.splitlines() if line.startswith("| `")]
        shown = [one for one in command.params if not getattr(one, "hidden", False)]
        names = [one.opts[0] if one.opts[0].startswith("-") else one.metavar or one.opts[0] for one in shown]
        assert [name for name in names if not any(name in row for row in rows)] == []


PAGES = [*(path for path in DOCS.rglob("*.md") if "_generated" not in path.parts), *DOCS.parent.glob("*.md")]

FILE = re.compile(r"`((?:\.github|docs|envs|packaging|rust|tests|training)/[\w./-]+)`")


def test_a_page_names_files_that_exist() -> None:
    """A page went on naming a test file that had been merged into another."""
    named = [(page.name, name) for page in PAGES for name in FILE.findall(page.read_text(encoding="utf-8"))]
    assert len(named) > 50
    assert not [
        (page, name) for page, name in named if not re.search("NAME|FILE", name) and not (DOCS.parent / name).exists()
    ]


def test_the_rule_of_a_table_has_a_line_of_its_own() -> None:
    """A table was printed as running text, since its rule stood at the end of its header."""
    assert [
        page.name for page in PAGES if re.search(r"^\|.*[^|\s-].*\|---", page.read_text(encoding="utf-8"), re.M)
    ] == []


def test_every_environment_has_a_card_and_is_named_in_gallery_and_contents(
    extension: Callable[[str], ModuleType],
) -> None:
    """Five of the registered environments had no card."""
    told = extension("cards").pages()
    names = {name: f"{name.lower()}.md" for name in ENVIRONMENTS}
    assert {*names.values(), "rovers_v0.md"} == told.keys()  # PettingZoo's is not registered with Gymnasium
    assert all(told[file].startswith(f"# {name}\n") for name, file in names.items())
    contents, gallery = ((DOCS / name).read_text(encoding="utf-8") for name in ("index.md", "gallery.md"))
    assert [name for name in names if f"_generated/{name.lower()}\n" not in contents] == []
    assert [name for name, file in names.items() if f"[`{name}`](_generated/{file})" not in gallery] == []
    assert "`charge`" in told["roverbattery-v0.md"]
    assert "| registered as | `RoverEnv(terrain='hills')` |" in told["roverhills-v0.md"]


def test_frames_of_the_gallery_show_rover_and_goal_from_different_sides(
    extension: Callable[[str], ModuleType],
) -> None:
    """Frames looked along the drive: four showed the same rover on the same plane, and none its goal."""
    gallery = extension("gallery")
    place, goal = np.array([1.0, 0.4, 2.0]), np.array([8.0, 0.4, 5.0])
    seen = {}
    for name in ENVIRONMENTS:
        eye, target = (np.array(point) for point in gallery.camera_of(name, (place, goal, np.zeros(0), 1.0)))
        way = (target - eye) / np.linalg.norm(target - eye)
        for end in (place, goal):
            away = (end - eye) / np.linalg.norm(end - eye)
            assert np.degrees(np.arccos(way @ away)) < 25.0, name  # the picture is 50 degrees wide
        seen[name] = tuple(eye)
    assert len(set(seen.values())) == len(ENVIRONMENTS)
