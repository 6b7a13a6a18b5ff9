"""What `to_urdf` and `to_mjcf` write is read back as the same machine."""

import re
from pathlib import Path

import numpy as np
import pytest
from models.robot_files import rover, write
from refusals import refused

from rover_gym import ModelError, Motor, RoverModel

KINDS = {"urdf": "yourdfpy", "mjcf": "mujoco"}


def machine(**changes):
    """A cart on a slide with a pendulum: what has no free base, no wheels and every passive element."""
    solids = [
        {"name": "cart", "joint": "prismatic", "position": [0.1, 0.2, 0.3], "axis": [1.0, 0.0, 0.2], "mass": 2.0, "damping": 0.3,
         "limits": {"lower": -1.0, "upper": 2.0}, "shape": {"kind": "box", "size": [0.3, 0.2, 0.1]}},
        {"name": "pendulum", "parent": "cart", "position": [0.0, 0.1, 0.0], "rotation": [0.4, -0.5, 0.6], "axis": [0.0, 0.3, 1.0],
         "mass": 1.0, "shapes": [{"kind": "cylinder", "radius": 0.05, "height": 0.4, "position": [0.0, -0.2, 0.0], "rotation": [0.1, 0.2, 0.3]},
                                 {"kind": "sphere", "radius": 0.1, "position": [0.0, -0.4, 0.0], "mass": 0.4}]},
        {"name": "follower", "parent": "cart", "position": [0.0, -0.1, 0.0], "axis": [0.0, 0.0, 1.0], "mass": 0.5,
         "shape": {"kind": "disc", "radius": 0.1}, "coupled": {"joint": "pendulum", "ratio": -0.5, "offset": 0.1}},
        {"name": "locked", "parent": "pendulum", "position": [0.0, -0.4, 0.0], "axis": [1.0, 0.0, 0.0], "mass": 0.5, "locked": 0.7,
         "centre_of_mass": [0.01, 0.02, 0.03], "inertia": [0.02, 0.03, 0.04, 0.001, 0.002, -0.003]},
    ]  # fmt: skip
    solids[1] |= changes
    return RoverModel.from_dict({"name": "cart", "solids": solids})


def assert_same_machine(model, back):
    """Mass matrix, bias and poses agree at random states, whatever the order of the coordinates."""
    order = [back.dof_names.index(name) for name in model.dof_names]
    rng = np.random.default_rng(1)
    for _ in range(5):
        q, v = rng.normal(size=(2, model.nv))
        other_q, other_v = np.empty(model.nv), np.empty(model.nv)
        other_q[order], other_v[order] = q, v
        M, other_M = model.mass_matrix(q), back.mass_matrix(other_q)[np.ix_(order, order)]
        np.testing.assert_allclose(other_M, M, atol=1e-12 * np.abs(M).max())
        bias, other_bias = model.bias(q, v), back.bias(other_q, other_v)[order]
        np.testing.assert_allclose(other_bias, bias, atol=1e-12 * np.abs(bias).max())
        for name, (origin, rotation) in model.poses(q).items():
            np.testing.assert_allclose(back.poses(other_q)[name][0], origin, atol=1e-12)
            np.testing.assert_allclose(back.poses(other_q)[name][1], rotation, atol=1e-12)


def written_and_read(model, folder, kind, **options):
    path = folder / f"robot.{kind}"
    getattr(model, f"to_{kind}")(path)
    return getattr(RoverModel, f"from_{kind}")(path, **options)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("name", RoverModel.names())
def test_every_rover_of_the_gallery_comes_back(tmp_path, kind, name):
    pytest.importorskip(KINDS[kind])
    model = RoverModel.named(name)
    back = written_and_read(model, tmp_path, kind)
    assert_same_machine(model, back)
    fields = ("radius", "width", "torque_limit", "steering")
    told, again = (
        {wheel["solid"]: {field: wheel.get(field) for field in fields} for wheel in one.to_dict()["wheels"]}
        for one in (model, back)
    )
    assert told == again


@pytest.mark.parametrize("kind", KINDS)
def test_a_machine_on_a_rail_comes_back_with_its_passive_elements(tmp_path, kind):
    pytest.importorskip(KINDS[kind])
    model = machine()
    options = {"free_base": False} if kind == "urdf" else {}
    back = written_and_read(model, tmp_path, kind, wheels=[], **options)
    assert_same_machine(model, back)
    solids = {solid["name"]: solid for solid in back.to_dict()["solids"]}
    assert solids["cart"]["damping"] == 0.3
    assert solids["cart"]["limits"] == {"lower": -1.0, "upper": 2.0}
    assert solids["follower"]["coupled"] == {"joint": "pendulum", "ratio": -0.5, "offset": 0.1}


def test_springs_and_rotors_pass_through_mjcf_and_are_refused_by_urdf(tmp_path):
    model = machine(spring={"stiffness": 3.0, "rest": 0.2}, armature=0.01)
    with pytest.raises(ModelError, match=r"solids\[1\]\.spring.*to_mjcf.*pendulum"):
        model.to_urdf(tmp_path / "robot.urdf")
    assert not (tmp_path / "robot.urdf").exists()
    model.to_urdf(tmp_path / "robot.urdf", ignore=["springs", "armature"])
    pytest.importorskip("mujoco")
    pendulum = written_and_read(model, tmp_path, "mjcf", wheels=[]).to_dict()["solids"][1]
    assert pendulum["spring"] == {"stiffness": 3.0, "rest": 0.2}
    assert pendulum["armature"] == 0.01


def test_a_urdf_has_one_tree_and_no_ball_joints(tmp_path):
    solids = machine().to_dict()["solids"]
    kept = {key: solids[1][key] for key in ("name", "parent", "position", "mass", "shapes")}
    ball = [solids[0], kept | {"joint": "spherical"}]
    with pytest.raises(ModelError, match=r"solids\[1\]\.joint"):
        RoverModel.from_dict({"name": "x", "solids": ball}).to_urdf(tmp_path / "x.urdf")
    two = [solids[0], solids[0] | {"name": "other"}]
    with pytest.raises(ModelError, match="one tree"):
        RoverModel.from_dict({"name": "x", "solids": two}).to_urdf(tmp_path / "x.urdf")
    assert not list(tmp_path.iterdir())


def test_an_imported_rover_goes_through_both_formats(tmp_path):
    for package in KINDS.values():
        pytest.importorskip(package)
    model = RoverModel.from_urdf(write(tmp_path, rover()))
    assert_same_machine(model, written_and_read(model, tmp_path, "urdf"))
    assert_same_machine(model, written_and_read(model, tmp_path, "mjcf"))


@pytest.mark.parametrize("kind", KINDS)
def test_wide_wheels_come_back_as_wide_and_thin_ones_as_thin(tmp_path, kind):
    pytest.importorskip(KINDS[kind])
    description = RoverModel.named("skid-steered").to_dict()
    for wheel, width in zip(description["wheels"], (0.125, 0.0, 0.0177, 1.0), strict=True):
        wheel["width"] = width
    model = RoverModel.from_dict(description)
    back = written_and_read(model, tmp_path, kind)
    again = written_and_read(back, tmp_path, kind)
    for read in (back, again):
        assert [wheel.get("width", 0.0) for wheel in read.to_dict()["wheels"]] == [0.125, 0.0, 0.0177, 1.0]
        kinds = [[shape["kind"] for shape in solid["shapes"]] for solid in read.to_dict()["solids"][1:]]
        assert kinds == [["cylinder", "disc"], ["disc"], ["cylinder", "disc"], ["cylinder", "disc"]]


@pytest.mark.parametrize("kind", KINDS)
def test_a_motor_without_a_largest_speed_is_written(tmp_path, kind):
    pytest.importorskip(KINDS[kind])
    model = RoverModel.named("skid-steered").replace(motor=Motor(50.0, float("inf")))
    assert_same_machine(model, written_and_read(model, tmp_path, kind))


@pytest.mark.parametrize("path", [3, None, b"robot.urdf"])
def test_what_is_no_path_is_refused(tmp_path, monkeypatch, path):
    monkeypatch.chdir(tmp_path)
    for write_to in (RoverModel().to_urdf, RoverModel().to_mjcf):
        with pytest.raises(ModelError, match="path: must be a path"):
            write_to(path)
    assert not list(tmp_path.iterdir())


ROOT = Path(__file__).parents[2]

PAGE = (ROOT / "docs" / "models.md").read_text(encoding="utf-8")

SOURCES = ROOT / "rust" / "core" / "src" / "multibody"

#: Structures that are written to a file, and their variants' fields.
STRUCTURES = (*(f"description/{name}.rs" for name in ("mod", "closure", "joint", "shape")), "motor.rs")


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
        with refused(ModelError, "format", "format") as caught:
            RoverModel.from_text(text)
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
    lines += ['shape = { kind = "sphere", radius = 1.0 }']
    text = RoverModel().to_text() if "steering" in old else "\n".join(lines)
    path = tmp_path / "small.toml"
    path.write_text(text.replace(old, new, 1), encoding="utf-8")
    with pytest.raises(ModelError, match=expected) as caught:
        RoverModel.from_file(path)
    assert str(path) in str(caught.value)


def test_the_gallery_has_what_its_names_promise() -> None:
    models = {name: RoverModel.named(name) for name in RoverModel.names()}
    steered = [(len(model.wheel_names), sum(i >= 0 for i in model.steering_joint_indices)) for model in models.values()]
    expected = {
        "rover": (6, 6),
        "mars-rover": (6, 4),
        "open-rover": (6, 4),
        "skid-steered": (4, 0),
        "four-steered": (4, 4),
    }
    assert dict(zip(models, steered, strict=True)) == expected
    for name in ("mars-rover", "open-rover"):
        solids = {solid["name"]: solid for solid in RoverModel.named(name).to_dict()["solids"]}
        assert solids["right_rocker"]["coupled"]["ratio"] == -1.0
    page = (ROOT / "docs" / "your-rover.md").read_text(encoding="utf-8")
    assert not [name for name in RoverModel.names() if f"| `{name}` |" not in page]
