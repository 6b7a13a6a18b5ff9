"""Links that are fixed to each other: only together must they be a body."""

import numpy as np
import pytest
from models.robot_files import joint, write

from rover_gym import ModelError, RoverModel
from rover_gym.models import read_urdf

pytest.importorskip("yourdfpy")
etree = pytest.importorskip("lxml.etree")

ZERO, ROUND, ROD, IMPOSSIBLE = (0.0, 0.0, 0.0), (0.02, 0.02, 0.02), (0.02, 0.02, 0.0), (0.01, 0.01, 0.03)


def link(name, mass, inertia, centre="0 0 0"):
    x, y, z = inertia
    return f'''<link name="{name}"><inertial><origin xyz="{centre}"/><mass value="{mass}"/>
      <inertia ixx="{x}" ixy="0" ixz="0" iyy="{y}" iyz="0" izz="{z}"/></inertial></link>'''


BASE = link("base", 10.0, (0.3, 0.3, 0.3))


def leg(*parts):
    """A base with a thigh that turns, and what else is given."""
    stops = '<limit lower="-1" upper="1" effort="40" velocity="9"/>'
    text = f'<robot name="walker">{BASE}' + "".join(parts)
    return text + joint("hip", "revolute", "base", "thigh", at="0.3 0 0", more=stops) + "</robot>"


#: What files of legged robots state: by what of it is no body by itself.
FILES = {
    "a massless moving link with a massive fixed child": leg(
        '<link name="thigh"/>', link("cover", 2.0, ROUND), joint("glue", "fixed", "thigh", "cover", at="0 0 -0.1")
    ),
    "a point mass for a foot": leg(
        link("thigh", 2.0, ROUND), link("foot", 0.1, ZERO), joint("ankle", "fixed", "thigh", "foot", at="0 0 -0.3")
    ),
    "a rod without inertia about itself": leg(
        link("thigh", 2.0, ROUND), link("rod", 0.5, ROD), joint("ankle", "fixed", "thigh", "rod", at="0 0 -0.3")
    ),
    "a sensor with an impossible inertia": leg(
        link("thigh", 2.0, ROUND), link("imu", 0.1, IMPOSSIBLE), joint("screw", "fixed", "thigh", "imu", at="0 0.1 0")
    ),
    "a thigh with an impossible inertia": leg(
        link("thigh", 0.5, IMPOSSIBLE), link("motor", 2.0, ROUND), joint("screw", "fixed", "thigh", "motor", at="0.1 0 0")
    ),
    "a massless thigh two links above its mass": leg(
        '<link name="thigh"/><link name="plate"/>',
        link("motor", 2.0, ROUND),
        joint("screw", "fixed", "thigh", "plate"),
        joint("bolt", "fixed", "plate", "motor", at="0 0 -0.1"),
    ),
}  # fmt: skip


def expected_inertia(text):
    """Mass and inertia about the hip of all that turns with it, by the parallel-axis theorem over the stated links."""
    root = etree.fromstring(text)
    at = {one.find("child").get("link"): one for one in root.iter("joint")}
    mass, inertia = 0.0, np.zeros((3, 3))
    for one in root.findall("link"):
        body, place, name = one.find("inertial"), np.zeros(3), one.get("name")
        if body is None or name == "base":
            continue
        while name != "thigh":
            place += [float(x) for x in at[name].find("origin").get("xyz").split()]
            name = at[name].find("parent").get("link")
        m = float(body.find("mass").get("value"))
        mass += m
        inertia += np.diag([float(body.find("inertia").get(k)) for k in ("ixx", "iyy", "izz")])
        inertia += m * (place @ place * np.eye(3) - np.outer(place, place))
    return mass, inertia


@pytest.mark.parametrize("what", FILES)
def test_links_that_only_together_are_a_body_come_in(tmp_path, what):
    """ANYmal, HyQ, TALOS and TIAGo were refused, which Pinocchio accepts, because each link had to be a physical body on its own."""
    model, report = read_urdf(write(tmp_path, FILES[what]), wheels=[])
    mass, inertia = expected_inertia(FILES[what])
    assert model.mass == pytest.approx(10.0 + mass)
    assert model.nv == 7
    q = np.zeros(model.nq)
    assert model.mass_matrix(q)[6, 6] == pytest.approx(inertia[1, 1], rel=1e-12)
    joined = [entry for entry in report.assumed if "no physical mass" in entry]
    assert len(joined) == 1
    for name in ("cover", "foot", "rod", "imu", "motor"):
        if f'"{name}"' in FILES[what]:
            assert name in joined[0]
            assert name in model.tags(q)


def test_links_that_are_bodies_stay_solids(tmp_path):
    text = leg(link("thigh", 2.0, ROUND), link("motor", 1.0, ROUND), joint("screw", "fixed", "thigh", "motor"))
    model, report = read_urdf(write(tmp_path, text), wheels=[])
    assert model.solid_names == ["base", "thigh", "motor"]
    assert not any("by itself" in entry for entry in report.assumed)


@pytest.mark.parametrize(
    ("thigh", "reason"),
    [('<link name="thigh"/>', "must have a mass"), (link("thigh", 2.0, IMPOSSIBLE), r"link\[thigh\]\.inertia: the principal inertias")],
)  # fmt: skip
def test_a_group_that_is_no_body_is_refused(tmp_path, thigh, reason):
    with pytest.raises(ModelError, match=reason):
        RoverModel.from_urdf(write(tmp_path, leg(thigh)), wheels=[])
