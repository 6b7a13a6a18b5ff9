"""Wheels as rigid groups: what is fixed to a turning link, what follows another wheel, and what reaches the ground."""

import numpy as np
import pytest
from models.robot_files import write
from rovers import slid, standing

from rover_gym import CommandError, ModelError, RoverModel, Simulation
from rover_gym.models import RobotFileWarning, check_statics, read_robot
from rover_gym.models.import_report import solid_rows

pytest.importorskip("yourdfpy")

INERTIA = '<inertia ixx=".01" iyy=".01" izz=".01" ixy="0" ixz="0" iyz="0"/>'
ABOUT_Y, ABOUT_X = "1.5707963267948966 0 0", "0 1.5707963267948966 0"


def round_shape(radius, *, y=0.0, length=0.04, rpy=ABOUT_Y, role="collision"):
    geometry = f'<geometry><cylinder radius="{radius}" length="{length}"/></geometry>'
    return f'<{role}><origin xyz="0 {y} 0" rpy="{rpy}"/>{geometry}</{role}>'


def link(name, shapes="", mass=1.0):
    return f'<link name="{name}"><inertial><mass value="{mass}"/>{INERTIA}</inertial>{shapes}</link>'


def fixed(parent, child, at="0 0 0"):
    return f'<joint name="{child}_fix" type="fixed"><parent link="{parent}"/><child link="{child}"/><origin xyz="{at}"/></joint>'


def turning(child, x, y, *, z=0.0, axis="0 1 0", more="", name=None):
    at = f'<origin xyz="{x} {y} {z}"/><axis xyz="{axis}"/>{more}'
    return f'<joint name="{name or child + "_joint"}" type="continuous"><parent link="base"/><child link="{child}"/>{at}</joint>'


PLACES = {"fl": (0.2, 0.2), "fr": (0.2, -0.2), "rl": (-0.2, 0.2), "rr": (-0.2, -0.2)}


def robot(*parts, base=""):
    return f'<robot name="r">{link("base", base, mass=20.0)}{"".join(parts)}</robot>'


def four(rear=None, axis="0 1 0", rpy=ABOUT_Y, more=""):
    """A robot on four wheels; `rear`: what the joints of the rear wheels hold besides, by side."""
    extra = {name: (rear or {}).get(name, "") + more for name in PLACES}
    links = [link(f"{name}_wheel", round_shape(0.1, rpy=rpy)) for name in PLACES]
    return robot(*links, *(turning(f"{name}_wheel", *at, axis=axis, more=extra[name]) for name, at in PLACES.items()))


def settled(model):
    sim = standing(model)
    sim.step(200)
    return sim


@pytest.mark.parametrize("ratio", [1.0, -1.0])
def test_wheels_that_mimic_others_are_wheels_and_carry_their_share(tmp_path, ratio):
    """The rear wheels of a robot whose motors are mirrored were lost without a word, and half its weight lay on the trunk."""
    rear = {f"r{s}": f'<mimic joint="f{s}_wheel_joint" multiplier="{ratio}"/>' for s in "lr"}
    text = four(rear)
    if ratio < 0.0:  # axes that point to the other side
        text = text.replace('<axis xyz="0 1 0"/><mimic', '<axis xyz="0 -1 0"/><mimic')
    model = RoverModel.from_urdf(write(tmp_path, text))
    assert sorted(model.wheel_names) == sorted(f"{name}_wheel" for name in PLACES)
    sim = settled(model)
    np.testing.assert_allclose(sim.wheel_forces[:, 0], 24.0 * 9.81 / 4.0, rtol=1e-3)
    assert sim.trunk_force == 0.0
    assert "shares the drive" in str(model.import_report)
    # All four drive forward together, the rear ones through the joints that they follow.
    assert [wheel["drive_sign"] for wheel in model.to_dict()["wheels"]] == [1.0] * 4
    sim.set_wheel_torques([0.5] * 4)
    sim.step(200)
    plain = settled(RoverModel.from_urdf(write(tmp_path, four())))
    plain.set_wheel_torques([0.5] * 4)
    plain.step(200)
    assert sim.q[0] == pytest.approx(plain.q[0], rel=1e-3)


def geared(name, x, y, radii):
    """A rotor with a hub and a tyre fixed to it, of which only the joint is called a wheel."""
    rotor, hub, tyre = (round_shape(radius) for radius in radii)
    parts = link(f"{name}_rotor", rotor) + link(f"{name}_hub", hub) + link(f"{name}_tire", tyre)
    parts += turning(f"{name}_rotor", x, y, name=f"{name}_wheel")
    return parts + fixed(f"{name}_rotor", f"{name}_hub", "0 0.01 0") + fixed(f"{name}_hub", f"{name}_tire", "0 0.02 0")


def test_a_tyre_on_a_hub_on_a_rotor_is_one_wheel_of_the_tyres_radius(tmp_path):
    """The rotor became the wheel, with its own radius, and the tyres bore the weight as parts of the trunk."""
    parts = [geared(name, x, y, (0.034, 0.03, 0.05)) for name, (x, y) in PLACES.items()]
    model = RoverModel.from_urdf(write(tmp_path, robot(*parts)))
    assert model.wheel_radii.tolist() == [0.05] * 4
    assert model.solid_names == ["base", *(f"{name}_rotor" for name in PLACES)]
    zero = np.zeros(model.nq)
    assert {"fl_tire", "fl_hub"} <= set(model.tags(zero))
    np.testing.assert_allclose(model.poses(zero)["fl_rotor"][0], (0.2, 0.0, -0.23), atol=1e-15)
    sim = settled(model)
    assert sim.wheel_forces[:, 0].sum() == pytest.approx(32.0 * 9.81, rel=1e-3)
    assert sim.trunk_force == 0.0
    chosen = RoverModel.from_urdf(write(tmp_path, robot(*parts)), wheels=[f"{name}_tire" for name in PLACES])
    assert chosen == model


def test_a_tyre_of_a_mesh_on_a_rotor_of_a_cylinder_gives_its_radius(tmp_path):
    trimesh = pytest.importorskip("trimesh")
    trimesh.creation.cylinder(radius=0.05, height=0.02, sections=64).export(tmp_path / "tyre.stl")
    mesh = f'<collision><origin rpy="{ABOUT_Y}"/><geometry><mesh filename="tyre.stl"/></geometry></collision>'
    cylinder = round_shape(0.05)
    text = robot(*(geared(name, x, y, (0.034, 0.03, 0.05)) for name, (x, y) in PLACES.items())).replace(cylinder, mesh)
    model = RoverModel.from_urdf(write(tmp_path, text))
    assert model.wheel_radii == pytest.approx([0.05] * 4, rel=1e-6)
    (tmp_path / "tyre.stl").unlink()
    with pytest.warns(RobotFileWarning, match=r"radius of 0\.034 m is that of another shape.*tyre\.stl"):
        RoverModel.from_urdf(tmp_path / "robot.urdf")


@pytest.mark.parametrize("size", ["0 0 0", "0.1 0 0.1"])
def test_a_drawn_box_of_size_0_does_not_refuse_a_robot(tmp_path, size):
    drawn = f'<visual><geometry><box size="{size}"/></geometry></visual>'
    model = RoverModel.from_urdf(write(tmp_path, four().replace('<link name="base">', f'<link name="base">{drawn}')))
    assert f"a box of size {size}: link[base]" in model.import_report.left_out


def test_one_axle_with_two_round_shapes_is_two_wheels_on_one_joint(tmp_path):
    """Half of an axle's wheels were lost, and the robot stood on three points."""
    axle = round_shape(0.1, y=0.2) + round_shape(0.1, y=-0.2) + round_shape(0.02, length=0.4)
    ends = {"front_axle": 0.2, "rear_axle": -0.2}
    parts = (link(end, axle, mass=2.0) + turning(end, x, 0.0) for end, x in ends.items())
    model = RoverModel.from_urdf(write(tmp_path, robot(*parts)), torque_limit=5.0)
    assert model.wheel_names == ["front_axle", "rear_axle", "front_axle_2", "rear_axle_2"]
    assert model.mass == pytest.approx(24.0)
    assert model.nv == 8
    sim = settled(model)
    np.testing.assert_allclose(sim.wheel_forces[:, 0], 6.0 * 9.81, rtol=1e-3)
    places = np.array([pose[0][2] for name, pose in model.poses(np.zeros(model.nq)).items() if name != "base"])
    assert sorted(places.round(3)) == [-0.2, -0.2, 0.2, 0.2]
    sim.set_wheel_torques([0.5, 0.5, 0.0, 0.0])
    sim.step(100)
    assert sim.q[0] > 0.01


def test_a_chosen_wheel_that_cannot_touch_level_ground_is_refused(tmp_path):
    spare = link("spare_wheel", round_shape(0.1)) + turning("spare_wheel", 0.0, 0.0, z=0.3)
    text = four().replace("</robot>", spare + "</robot>")
    reason = r"link\[spare_wheel\]: this wheel cannot touch level ground: .* 0\.3 m farther down"
    with pytest.raises(ModelError, match=reason):
        RoverModel.from_urdf(write(tmp_path, text))
    given = [f"{name}_wheel" for name in PLACES]
    assert RoverModel.from_urdf(tmp_path / "robot.urdf", wheels=given).wheel_names == given
    keel = '<collision><origin xyz="0 0 -0.2"/><geometry><box size="0.6 0.1 0.1"/></geometry></collision>'
    with pytest.raises(ModelError, match="cannot touch level ground: base reaches"):
        RoverModel.from_urdf(write(tmp_path, four().replace('<link name="base">', f'<link name="base">{keel}')))


def test_wheels_touch_beside_a_skid_that_reaches_a_little_lower(tmp_path):
    """A robot on two wheels and a skid tilts until all three touch."""
    skid = '<collision><origin xyz="-0.2 0 -0.07"/><geometry><sphere radius="0.05"/></geometry></collision>'
    text = robot(*(link(f"{n}_wheel", round_shape(0.1)) + turning(f"{n}_wheel", *PLACES[n]) for n in ("fl", "fr")))
    model = RoverModel.from_urdf(write(tmp_path, text.replace('<link name="base">', f'<link name="base">{skid}')))
    assert model.wheel_names == ["fl_wheel", "fr_wheel"]


def test_a_round_part_without_a_name_that_hangs_above_the_ground_is_no_wheel(tmp_path):
    text = four().replace("_wheel", "_a")
    pulley = link("pulley", round_shape(0.05)) + turning("pulley", 0.0, 0.0, z=0.3)
    model = RoverModel.from_urdf(write(tmp_path, text.replace("</robot>", pulley + "</robot>")))
    assert "pulley" not in model.wheel_names
    assert len(model.wheel_names) == 4


@pytest.mark.parametrize("forward", ["x", "-x"])
def test_axles_along_the_driving_direction_are_refused_with_the_axis_that_fits(tmp_path, forward):
    """Drive signs came from rounding, and the robot drove sideways."""
    path = write(tmp_path, four(axis="1 0 0", rpy=ABOUT_X))
    with pytest.raises(ModelError, match=r'drives along its y axis, so give forward="y", or "-y"') as caught:
        RoverModel.from_urdf(path, forward=forward)
    assert (caught.value.field, caught.value.value) == ("forward", "x")
    for name in ("y", "-y"):
        model = RoverModel.from_urdf(path, forward=name)
        sim = settled(model)
        sim.set_wheel_torques([0.5] * 4)
        sim.step(100)
        assert sim.q[0] > 0.02
        assert abs(sim.q[2]) < 1e-3


def test_a_stated_effort_of_0_is_a_motor_without_torque_and_is_warned_of(tmp_path):
    """It was read as not stated, and the wheel got its load times its radius."""
    path = write(tmp_path, four(more='<limit effort="0" velocity="3"/>'))
    with pytest.warns(RobotFileWarning, match="largest torque of 0") as caught:
        model = RoverModel.from_urdf(path)
    assert len(caught) == 4
    assert model.wheel_torque_limits.tolist() == [0.0] * 4
    assert any("whose largest torque the file states as 0" in entry for entry in model.import_report.left_out)
    assert RoverModel.from_urdf(path, torque_limit=3.0).wheel_torque_limits.tolist() == [3.0] * 4


def test_an_imported_robot_stands_braked_on_a_slope(tmp_path):
    """It rolled 19 m down 10 degrees in 5 s: wheels had no gains to be held with, and nothing said so."""
    RoverModel.named("open-rover").to_urdf(tmp_path / "o.urdf")
    model = RoverModel.from_urdf(tmp_path / "o.urdf")
    assert slid(model, 10.0) < 0.01
    assert "a brake holds it with" in str(model.import_report)


def test_a_brake_or_a_hold_without_gains_is_refused_by_the_field_that_lacks_them(tmp_path):
    """Neither did anything, in silence."""
    source = RoverModel.from_urdf(write(tmp_path, four())).to_dict()
    for solid in source["solids"]:
        solid.pop("hold", None)
    sim = Simulation(RoverModel.from_dict(source))
    for hold in (sim.brake, lambda: sim.hold("fl_wheel"), lambda: sim.hold("fl_wheel", stiffness=0.0, damping=0.0)):
        with pytest.raises(CommandError, match=r'solids\[1\]\.hold: the joint "fl_wheel" has no gains') as caught:
            hold()
        assert (caught.value.field, caught.value.value) == ("solids[1].hold", "fl_wheel")
    sim.hold("fl_wheel", damping=1.0)
    sim.hold("fl_wheel", stiffness=1.0)


def test_masses_make_a_body_of_what_is_only_drawn(tmp_path):
    drawn = '<link name="base"><visual><geometry><box size="0.6 0.4 0.2"/></geometry></visual></link>'
    round_one = round_shape(0.1, role="visual")
    names = {f"{name}_wheel": at for name, at in PLACES.items()}
    wheels = "".join(f'<link name="{n}">{round_one}</link>' + turning(n, *at) for n, at in names.items())
    path = write(tmp_path, f'<robot name="r">{drawn}{wheels}</robot>')
    with pytest.raises(ModelError, match="must have a mass"):
        RoverModel.from_urdf(path)
    model, report = read_robot(path, masses={"base": 10.0} | dict.fromkeys(names, 0.5))
    assert model.mass == pytest.approx(12.0)
    assert "centre and inertia of its shapes" in str(report)
    inertia = 10.0 / 12.0 * np.array([0.2**2 + 0.4**2, 0.6**2 + 0.4**2, 0.6**2 + 0.2**2])
    np.testing.assert_allclose(model.to_dict()["solids"][0]["inertia"][:3], inertia)
    np.testing.assert_allclose(check_statics(model).loads, 3.0 * 9.81, rtol=1e-3)
    bad = (({"nothing": 1.0}, "there is no such link"), ({"base": 0.0}, r"masses\[base\]"), (3, "must be a mapping"))
    for wrong, reason in bad:
        with pytest.raises(ModelError, match=reason):
            read_robot(path, masses=wrong)
    heavier, _ = read_robot(write(tmp_path, four()), masses={"base": 40.0})
    np.testing.assert_allclose(heavier.to_dict()["solids"][0]["inertia"][:3], 0.02)


def test_a_robot_with_a_caster_brakes_by_its_driven_wheels(tmp_path):
    """A caster, which nothing can hold, kept the other wheels from being braked."""
    source = RoverModel.from_urdf(write(tmp_path, four())).to_dict()
    caster = source["wheels"][-1]
    caster["torque_limit"] = 0.0
    next(solid for solid in source["solids"] if solid["name"] == caster["solid"]).pop("hold")
    assert slid(RoverModel.from_dict(source), 10.0) < 0.01


def test_the_rows_of_a_model_with_two_wheels_on_one_solid_name_it_once() -> None:
    ball = {"kind": "sphere", "radius": 0.1}
    body = {"name": "body", "mass": 5.0, "shape": ball}
    axle = {"name": "axle", "parent": "body", "position": [0.0, -0.1, 0.0], "axis": [0, 0, 1]}
    axle |= {"mass": 1.0, "shape": ball}
    wheel = {"solid": "axle", "axle": [0, 0, 1], "radius": 0.1, "torque_limit": 1.0, "drive_sign": -1.0}
    wheels = [{"name": name, "deflection": 1e-3, **wheel} for name in ("left", "right")]
    model = RoverModel.from_dict({"format": 1, "name": "m", "solids": [body, axle], "wheels": wheels})
    stiffness = 6.0 * 9.81 / 2 / 1e-4
    assert model.wheel_stiffnesses == pytest.approx([stiffness] * 2)
    assert solid_rows(model)[1][4] == f"wheel of radius 0.1 m, {stiffness:.2g} N/m, 1 N m"
