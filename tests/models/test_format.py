"""The format of model files: its version, its page, and errors that name line, field and value."""

import re
from pathlib import Path

import pytest

from rover_gym import ModelError, RoverModel

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "models.md").read_text(encoding="utf-8")
SOURCES = ROOT / "rust" / "core" / "src" / "multibody"
#: Structures that are written to a file, and their variants' fields.
STRUCTURES = ("description/mod.rs", "description/joint.rs", "description/shape.rs", "motor.rs")


def fields() -> set[str]:
    found = set()
    for name in STRUCTURES:
        text = (SOURCES / name).read_text(encoding="utf-8").partition("#[cfg(test)]")[0]
        for body in re.findall(r"Deserialize\)\]\n(?:#\[[^\n]*\n)*pub struct \w+ \{\n(.*?)\n\}", text, re.DOTALL):
            found |= set(re.findall(r"^    pub (\w+):", body, re.MULTILINE))
    return found - {"shape"} | {"shape", "size", "radius", "height", "kind"}


def test_the_page_lists_every_field() -> None:
    assert {"format", "solids", "wheels", "steering_limit", "stall_torque", "coupled", "visible"} <= fields()
    assert not [name for name in sorted(fields()) if not re.search(rf"`[^`]*\b{name}\b[^`]*`", PAGE)]


def test_a_model_file_says_its_format_and_may_leave_it_out() -> None:
    text = RoverModel().to_text()
    assert text.startswith("format = 1\n")
    assert RoverModel.from_text(text) == RoverModel.from_text(text.replace("format = 1\n", "")) == RoverModel()
    assert RoverModel.from_dict(RoverModel().to_dict() | {"format": 1}) == RoverModel()
    for text in ("format = 2\nlegs = 4", "format = 0\nname = ''\nsolids = []", "format = -1"):
        with pytest.raises(ModelError, match="format") as caught:
            RoverModel.from_text(text)
        assert caught.value.field == "format"
        assert caught.value.value == float(text.split()[2])


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ("mass = 600.0", 'mass = "much"', r'line 6, column 8[^#]*mass = "much"[^#]*expected f64'),
        ("mass = 600.0", "weight = 600.0", r"line 6, column 1[^#]*unknown field `weight`"),
        ("mass = 600.0", "mass = ", r"line 6, column 8"),
        ("mass = 600.0", "mass = -600.0", r"solids\[0\]\.mass: must be positive, is -600"),
        ('steering = "steering_FL"', 'steering = "rudder"', r'wheels\[0\]\.steering: .*"rudder"'),
    ],
)
def test_errors_name_line_field_and_value(tmp_path: Path, old: str, new: str, expected: str) -> None:
    lines = ['name = "small"', "", "# one solid", "[[solids]]", 'name = "trunk"', "mass = 600.0"]
    text = (
        RoverModel().to_text()
        if "steering" in old
        else "\n".join([*lines, 'shape = { kind = "sphere", radius = 1.0 }'])
    )
    path = tmp_path / "small.toml"
    path.write_text(text.replace(old, new, 1), encoding="utf-8")
    with pytest.raises(ModelError, match=expected) as caught:
        RoverModel.from_file(path)
    assert str(path) in str(caught.value)


def test_the_gallery_has_what_its_names_promise() -> None:
    shapes = {
        name: (len(model.wheel_names), sum(i >= 0 for i in model.steering_joint_indices))
        for name, model in ((name, RoverModel.named(name)) for name in RoverModel.names())
    }
    assert shapes == {
        "rover": (6, 6),
        "mars-rover": (6, 4),
        "open-rover": (6, 4),
        "skid-steered": (4, 0),
        "four-steered": (4, 4),
    }
    for name in ("mars-rover", "open-rover"):
        solids = {solid["name"]: solid for solid in RoverModel.named(name).to_dict()["solids"]}
        assert solids["right_rocker"]["coupled"]["ratio"] == -1.0
    page = (ROOT / "docs" / "your-rover.md").read_text(encoding="utf-8")
    assert not [name for name in RoverModel.names() if f"| `{name}` |" not in page]
