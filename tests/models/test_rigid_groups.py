"""Links that are fixed to each other: only together must they be a body."""

import math

import numpy as np
import pytest
from models.robot_files import body, joint, rover, write

from rover_gym import ModelError, RoverModel
from rover_gym.models import check_statics, open_model, read_urdf
from rover_gym.models.robot_tree import right_angle

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
    """ANYmal, HyQ, TALOS and TIAGo were refused, which Pinocchio takes: each link had to be a body by itself."""
    model, report = read_urdf(write(tmp_path, FILES[what]), wheels=[])
    mass, inertia = expected_inertia(FILES[what])
    assert model.mass == pytest.approx(10.0 + mass)
    assert model.nv == 7
    q = np.zeros(model.nq)
    assert model.mass_matrix(q)[6, 6] == pytest.approx(inertia[1, 1], rel=1e-12)
    joined = [entry for entry in report.assumed if "no body by itself" in entry]
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
    [('<link name="thigh"/>', "must have a mass"), (link("thigh", 2.0, IMPOSSIBLE), r"link\[thigh\]\.inertia: no body has")],
)  # fmt: skip
def test_a_group_that_is_no_body_is_refused(tmp_path, thigh, reason):
    with pytest.raises(ModelError, match=reason):
        RoverModel.from_urdf(write(tmp_path, leg(thigh)), wheels=[])


pytest.importorskip("yourdfpy")


@pytest.mark.parametrize(
    ("word", "count", "name"),
    [
        ("1.5708", 1, "pi/2"),
        ("1.5707", 1, "pi/2"),
        ("1.57", 1, "pi/2"),
        ("-1.571", -1, "-pi/2"),
        ("3.14159", 2, "pi"),
        ("3.1416", 2, "pi"),
        ("3.14", 2, "pi"),
        ("-3.1415926", -2, "-pi"),
        ("4.7124", 3, "3 pi/2"),
        ("-6.2832", -4, "-2 pi"),
        ("15708e-4", 1, "pi/2"),
    ],
)
def test_a_multiple_of_half_pi_has_all_its_digits(word, count, name):
    assert right_angle(word) == (count * math.pi / 2, name)


@pytest.mark.parametrize(
    "word",
    ["0", "0.00", "1.6", "2", "3", "3.1", "1.58", "1.5", "1.5712", "3.1420", "3.15", "0.7854", "1.0472", "1.5707963267948966", "1e9", "1.57e5", "1.5708000", "1e-400", "1.5708" + "0" * 40, "9" * 400],
)  # fmt: skip
def test_other_angles_stay_as_they_are(word):
    assert right_angle(word) is None


def test_wheels_turned_by_3_14159_stand_as_those_turned_by_pi(tmp_path):
    """AgileX's Limo: two of its wheels are turned by 3.14159, which left them 2.65e-6 rad askew and two without load."""
    models = []
    for turn in ("3.14159", repr(math.pi)):
        text = rover(
            extra=body("camera", mass=1.0) + joint("mount", "fixed", "chassis", "camera", turn=f"1.5708 0 {turn}")
        )
        models.append(RoverModel.from_urdf(write(tmp_path, text)))
    rounded, exact = models
    assert rounded == exact
    listed = "\n".join(rounded.import_report.assumed)
    assert "3.14159 rad is read as pi: line" in listed
    assert "1.5708 rad is read as pi/2: line" in listed
    assert "joint[mount].origin.rpy" in listed
    assert "read as pi:" not in "\n".join(exact.import_report.assumed)
    np.testing.assert_allclose(exact.poses(np.zeros(exact.nq))["camera"][1][1], [0.0, 0.0, -1.0], atol=1e-15)


RADIANS = """
<mujoco model="cart">
  <compiler angle="{unit}" autolimits="true"/>
  <default><default class="rim"><geom type="cylinder" size="0.15 0.04" euler="{quarter} 0 0"/></default></default>
  <worldbody>
    <body name="chassis" pos="0 0 1">
      <freejoint/>
      <geom type="box" size="0.5 0.3 0.1" mass="10"/>
      <body name="wheel_left" pos="0.3 0.4 -0.1"><joint axis="0 1 0"/><geom class="rim"/></body>
      <frame axisangle="0 0 1 {half}">
        <body name="wheel_right" pos="0.3 0.4 -0.1"><joint axis="0 -1 0"/><geom class="rim"/></body>
      </frame>
      <body name="tail" pos="-0.4 0 0" euler="0 {other} {half}">
        <inertial pos="0 0 0" axisangle="1 0 0 {quarter}" mass="1" diaginertia="0.1 0.2 0.25"/>
      </body>
    </body>
  </worldbody>
</mujoco>
"""


def test_radians_of_an_mjcf_are_completed_as_those_of_a_urdf_are(tmp_path):
    """1.5708 in radians left the wheels of an MJCF askew, while a URDF's were not."""
    pytest.importorskip("mujoco")
    given = {
        "rounded": {"unit": "radian", "quarter": "1.5708", "half": "3.14159", "other": "0.3"},
        "exact": {"unit": "radian", "quarter": repr(math.pi / 2), "half": repr(math.pi), "other": "0.3"},
    }
    models = {
        name: RoverModel.from_mjcf(write(tmp_path, RADIANS.format(**words), f"{name}.xml"))
        for name, words in given.items()
    }
    assert models["rounded"] == models["exact"]
    listed = "\n".join(models["rounded"].import_report.assumed)
    assert listed.count("1.5708 rad is read as pi/2: line") == 1
    for place in ("geom[]", "body[tail].inertial"):
        assert place in listed
    assert "3.14159 rad is read as pi" in listed
    assert "frame[]" in listed
    assert "body[tail]" in listed
    assert "read as pi" not in "\n".join(models["exact"].import_report.assumed)


def test_degrees_of_an_mjcf_stay_as_they_are(tmp_path):
    """1.57 degrees are no right angle."""
    pytest.importorskip("mujoco")
    words = {"unit": "degree", "quarter": "90", "half": "180", "other": "1.57"}
    model = RoverModel.from_mjcf(write(tmp_path, RADIANS.format(**words), "degrees.xml"))
    assert "read as" not in "\n".join(model.import_report.assumed)


@pytest.mark.parametrize("name", RoverModel.names())
def test_the_wheels_carry_the_weight_and_nothing_moves(name):
    model = RoverModel.named(name)
    statics = check_statics(model)
    assert statics.loads.sum() == pytest.approx(9.81 * model.mass, rel=1e-9)
    assert statics.rest_speed < 1e-7
    assert (statics.loads > 0.0).all()


def test_a_rigid_rover_on_four_wheels_has_the_loads_of_a_lever():
    model = RoverModel.named("skid-steered").replace(wheel_stiffness=0.0)
    front, back = check_statics(model).loads[:2].sum(), check_statics(model).loads[2:].sum()
    centre = model.tags(np.zeros(model.nq))["centre_of_mass"][0]
    assert (front - back) * 0.256 == pytest.approx(9.81 * model.mass * centre, rel=1e-6)


def test_steering_geometry_is_that_of_the_published_figures():
    mars = check_statics(RoverModel.named("mars-rover"))
    assert (mars.wheelbase, mars.track) == (pytest.approx(2.2), pytest.approx(2.3))
    assert mars.turning_radius == 0.0
    skid = check_statics(RoverModel.named("skid-steered"))
    assert "skid" in skid.turning_centre
    # The built-in rover: 0.66 m from the middle line to an axle, 0.53 m to its side, 0.7 rad of steering.
    ours = check_statics(RoverModel())
    assert ours.turning_radius == pytest.approx(0.53 + 0.66 / math.tan(0.7), rel=1e-6)


def test_unsteered_wheels_on_two_lines_have_no_turning_centre():
    description = RoverModel().to_dict()
    for wheel in description["wheels"][2:4]:
        del wheel["steering"], wheel["steering_limit"]
    statics = check_statics(RoverModel.from_dict(description))
    assert math.isinf(statics.turning_radius)
    assert "0.6 m from one axle line" in statics.turning_centre


def test_the_climbable_step_is_the_closed_form():
    model = RoverModel.named("four-steered")
    # Loads are equal: the angle is phi + atan(mu).
    angle = 2.0 * math.atan(0.7)
    assert check_statics(model).step_height == pytest.approx(0.09 * (1.0 - math.cos(angle)), rel=1e-6)
    assert check_statics(model, friction=1.2).climbs_wall
    weak = model.replace(wheel_torque_limit=0.0)
    assert check_statics(weak).step_height == 0.0


def test_a_model_is_found_by_name_or_file(tmp_path):
    assert open_model("rover") == RoverModel()
    RoverModel.named("open-rover").to_file(tmp_path / "own.toml")
    assert open_model(tmp_path / "own.toml") == RoverModel.named("open-rover")
    for wrong in ("open rover", 3, None, "own.txt"):
        with pytest.raises(ModelError, match="model"):
            open_model(wrong)
    with pytest.raises(OSError, match=r"none\.toml"):
        open_model("none.toml")
