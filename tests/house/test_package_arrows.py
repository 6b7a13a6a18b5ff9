"""The subpackages import only those before them, and every public name has one meaning."""

import ast
import re
from collections import defaultdict
from pathlib import Path

import rover_gym

PACKAGE = Path(rover_gym.__file__).parent

#: In the order of the package's docstring: a room may use those before it.
ROOMS = re.findall(r"^    ([\w.]+)  +\S", rover_gym.__doc__ or "", flags=re.MULTILINE)

#: Folders that only hold rooms.
HALLS = {room.partition(".")[0] for room in ROOMS} - set(ROOMS)

FILES = sorted(PACKAGE.rglob("*.py"))


def room_of(module: str) -> str:
    """The room of a dotted name: the longest that it begins with; its first part if there is none."""
    inside = [room for room in ROOMS if f"{module}.".startswith(f"{room}.")]
    return max(inside, key=len, default=module.partition(".")[0])


def module_of(path: Path) -> str:
    return ".".join(path.relative_to(PACKAGE).with_suffix("").parts).removesuffix(".__init__")


def used_modules(text: str) -> set[str]:
    """What of the package a file imports, wherever in the file: `env.task`, `_core`, and `RoverEnv` of the package."""
    found = set()
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, "an import from a dot says less than its full name"
            found |= {f"{node.module}.{alias.name}" for alias in node.names}
    return {name.removeprefix("rover_gym.") for name in found if name.startswith("rover_gym.")}


def used_rooms(text: str) -> set[str]:
    return {room_of(name) for name in used_modules(text)}


def test_every_room_stands_in_the_order() -> None:
    found = {room_of(module_of(path)) for path in FILES} - {"__init__"}
    assert len(ROOMS) == len(set(ROOMS))
    assert found - HALLS == set(ROOMS)


def test_no_room_knows_a_later_one() -> None:
    upward = []
    for path in FILES:
        if path == PACKAGE / "__init__.py":
            continue
        room = room_of(module_of(path))
        if room in HALLS:
            continue
        allowed = {*ROOMS[: ROOMS.index(room) + 1], "_core"}
        found = used_rooms(path.read_text(encoding="utf-8")) - allowed
        upward += [f"{path.relative_to(PACKAGE)} uses {name}" for name in sorted(found)]
    assert not upward


def test_only_the_core_knows_the_compiled_module() -> None:
    users = [module_of(path) for path in FILES if "_core" in used_rooms(path.read_text(encoding="utf-8"))]
    assert users == ["core"]


def test_the_modules_of_a_room_import_one_another_one_way() -> None:
    """Between modules, too, the arrows run one way: none reaches itself, whether at once or when it is called."""
    modules = {".".join(path.relative_to(PACKAGE).with_suffix("").parts): path for path in FILES}
    modules = {name: path for name, path in modules.items() if not name.endswith("__init__")}
    arrows = {}
    for name, path in modules.items():
        used = used_modules(path.read_text(encoding="utf-8"))
        arrows[name] = {other for other in modules if any(one == other or one.startswith(f"{other}.") for one in used)}
    while leaves := {name for name, used in arrows.items() if not used & arrows.keys()}:
        arrows = {name: used for name, used in arrows.items() if name not in leaves}
    assert not arrows, "these stand in a circle, or above one"


def test_the_reading_finds_all_forms_of_an_import() -> None:
    text = """
from rover_gym.envs.task import Task
from rover_gym import RoverEnv
import rover_gym.envs.vector.sb3
import numpy

def draw():
    from rover_gym.show.figures import draw_run
"""
    assert used_modules(text) == {"envs.task.Task", "RoverEnv", "envs.vector.sb3", "show.figures.draw_run"}
    assert used_rooms(text) == {"envs", "RoverEnv", "show.figures"}


def test_a_public_class_has_a_name_of_its_own() -> None:
    classes = defaultdict(list)
    for path in FILES:
        for node in ast.parse(path.read_text(encoding="utf-8")).body:
            if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
                classes[node.name].append(str(path.relative_to(PACKAGE)))
    for name in rover_gym.core.__all__:
        classes[name].append("core")
    assert not {name: places for name, places in classes.items() if len(places) > 1}


def test_a_module_has_a_name_of_its_own() -> None:
    modules = defaultdict(list)
    for path in FILES:
        name = path.parent.name if path.name == "__init__.py" else path.stem
        modules[name].append(str(path.relative_to(PACKAGE)))
    assert not {name: places for name, places in modules.items() if len(places) > 1}


def test_a_room_says_what_is_public() -> None:
    """A room names what it re-exports: `__all__`, or a stub; a room without, such as the command's, offers modules.

    What the rooms of `drive` offer, `drive` itself names.
    """
    for path in PACKAGE.glob("*/**/__init__.py"):
        page = ast.parse(path.read_text(encoding="utf-8"))
        assert ast.get_docstring(page), path
        if module_of(path) in {*HALLS, "ground", "cli", "core", "learn"} or path.parents[1].name == "drive":
            continue
        stub = path.with_suffix(".pyi")
        is_lazy = stub.exists()
        tree = ast.parse(stub.read_text(encoding="utf-8")) if is_lazy else page
        aliases = [
            alias
            for node in ast.walk(tree)
            if isinstance(node, ast.ImportFrom) and (node.level or (node.module or "").startswith("rover_gym"))
            for alias in node.names
        ]
        if is_lazy:
            assert all(alias.asname == alias.name for alias in aliases), stub
            continue
        exported = [node for node in tree.body if isinstance(node, ast.Assign) and node.targets[0].id == "__all__"]
        names = set(ast.literal_eval(exported[0].value))
        assert {alias.asname or alias.name for alias in aliases} - {"MissingExtraError"} == names, path
