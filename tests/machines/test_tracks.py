"""Tracks drive, turn in place and climb as closed forms say."""

import math

import gymnasium as gym
import numpy as np
import pytest
from rovers import standing
from scipy.optimize import brentq

from rover_gym import PDPolicy, Plane, RoverModel, Simulation, SphereField, TriangleMesh
from rover_gym.core import ModelError

HULL, BELT = 200.0, 20.0
LENGTH, TRACK, RADIUS = 1.2, 0.8, 0.15
GRAVITY, FRICTION = 9.81, 0.7


def description(wheels: int = 9, **changes):
    hull = {"name": "hull", "mass": HULL, "shape": {"kind": "box", "size": [1.0, 0.2, 0.5]}, "collides": True}
    track = {
        "solid": "hull",
        "from": [LENGTH / 2, -0.05, 0.0],
        "to": [-LENGTH / 2, -0.05, 0.0],
        "wheels": wheels,
        "radius": RADIUS,
        "mass": BELT,
        "torque_limit": 400.0,
        "drive_sign": -1.0,
    }
    tracks = [
        track | {"name": name, "from": [LENGTH / 2, -0.05, z], "to": [-LENGTH / 2, -0.05, z]} | changes
        for name, z in (("left", -TRACK / 2), ("right", TRACK / 2))
    ]
    return {"name": "tracked", "solids": [hull], "tracks": tracks}


def tracked(wheels: int = 9, **changes) -> RoverModel:
    return RoverModel.from_dict(description(wheels, **changes))


def settled(model: RoverModel, **options) -> Simulation:
    sim = standing(model, Plane(), friction=FRICTION, **options)
    sim.step(40)
    return sim


def torques(model: RoverModel, left: float, right: float) -> np.ndarray:
    """Torques of the two tracks, in equal shares of their wheels."""
    n = len(model.wheel_names) // 2
    return np.r_[np.full(n, left / n), np.full(n, right / n)]


def test_a_track_is_a_row_of_wheels_that_turn_together():
    model = tracked()
    assert model.joint_names == ["left", "right"]
    assert model.nv == 8
    assert model.wheel_names[:3] == ["left", "left_2", "left_3"]
    assert model.mass == pytest.approx(HULL + 2 * BELT)
    assert RoverModel.from_dict(model.to_dict()) == model
    assert "tracks" not in model.to_dict()
    tags = model.tags(np.zeros(8))
    np.testing.assert_allclose(tags["right_5"], [0.0, -0.05, 0.4], atol=1e-12)
    sim = settled(model)
    # The ends have half of the stiffness, so that the load is that of a uniform belt.
    loads = sim.wheel_forces[:9, 0] / (model.mass * GRAVITY / 2)
    np.testing.assert_allclose(loads, [1 / 16, *[1 / 8] * 7, 1 / 16], rtol=1e-3)


def test_a_track_drives_straight_with_the_mass_of_its_belt():
    sim, torque = settled(tracked()), 30.0
    v = sim.v
    sim.set_wheel_torques(torques(sim.model, torque, torque))
    sim.step(100)
    # Belts move on the ground with the speed of the hull against it.
    expected = 2 * torque / RADIUS / (HULL + 4 * BELT) * 0.5
    assert sim.v[0] - v[0] == pytest.approx(expected, rel=1e-4)
    assert sim.v[2] == pytest.approx(0.0, abs=1e-9)
    np.testing.assert_allclose(sim.motor_torques, torque / 9, rtol=1e-12)
    alone = settled(tracked(torque_limit=9 * torque))
    alone.set_wheel_torques(np.eye(18)[3] * torque + np.eye(18)[9] * torque)
    alone.step(100)
    np.testing.assert_allclose(alone.q, sim.q, atol=1e-12)


@pytest.mark.parametrize("share", [0.97, 1.05])
def test_turning_with_free_belts_takes_a_quarter_of_mu_w_l(share):
    sim = settled(tracked())
    weight = sim.model.mass * GRAVITY
    resistance = FRICTION * weight * LENGTH / 4
    sim.apply_wrench("hull", moment=[0.0, share * resistance, 0.0])
    assert sim.step(100).is_converged
    belts = 2 * BELT * (TRACK / 2) ** 2
    inertia = sim.model.mass_matrix(np.zeros(8))[4, 4] + belts
    expected = max(share - 1.0, 0.0) * resistance / inertia * 0.5
    assert sim.v[4] == pytest.approx(expected, rel=0.05, abs=2e-3)


def test_turning_in_place_is_as_fast_as_slip_along_and_across_allow():
    """Forces against the slip (σ, ψ' x) of each wheel, whose moments balance, give ψ' = v / (B/2 + σ/ψ')."""
    motor = {"stall_torque": 1e5, "no_load_speed": 4.0}
    sim = settled(tracked(motor=motor, torque_limit=1e5), time_step=2e-3)
    sim.set_wheel_torques(torques(sim.model, -1e5, 1e5))
    sim.step(1000)
    before = sim.q[4]
    sim.step(500)
    rate = (sim.q[4] - before) / 1.0
    x = np.linspace(-LENGTH / 2, LENGTH / 2, 9)
    share = np.array([0.5, *[1.0] * 7, 0.5]) / 8

    def moment(d):
        slip = np.sqrt(d * d + x * x)
        return (share * (TRACK / 2 * d - x * x) / slip).sum()

    d = brentq(moment, 1e-6, 10.0)
    belt = np.abs(sim.v[6:8]).mean() * RADIUS
    assert belt == pytest.approx(4.0 * RADIUS, rel=0.02)
    assert rate == pytest.approx(belt / (TRACK / 2 + d), rel=0.02)
    assert np.hypot(sim.q[0], sim.q[2]) < 0.05


def step_of(height: float) -> TriangleMesh:
    """Level ground that rises by a step at x = 1.5 m."""
    profile = [(-4.0, 0.0), (1.5, 0.0), (1.5 + 1e-4, height), (8.0, height)]
    vertices = [(x, y, z) for x, y in profile for z in (-3.0, 3.0)]
    faces = []
    for k in range(3):
        a, b, c, d = 2 * k, 2 * k + 1, 2 * k + 2, 2 * k + 3
        faces += [(a, b, c), (b, d, c)]
    return TriangleMesh(vertices, faces)


@pytest.mark.parametrize(("wheels", "climbs"), [(17, True), (2, False)])
def test_tracks_climb_a_step_on_which_end_wheels_alone_are_high_centred(wheels, climbs):
    height, motor = 0.12, {"stall_torque": 150.0, "no_load_speed": 4.0}
    low = description(wheels, motor=motor)
    low["solids"][0]["shape"]["size"][1] = 0.32  # 4 cm over the ground
    model = RoverModel.from_dict(low)
    sim = standing(model, step_of(height), friction=0.9)
    sim.set_wheel_torques(torques(model, 150.0, 150.0))
    start = sim.q[1]
    sim.step(1200)
    assert (sim.q[0] > 2.5) == climbs, sim.q[:6]
    if climbs:
        assert sim.q[1] - start == pytest.approx(height, abs=2e-3)
        assert abs(sim.q[5]) < 0.02


#: Two commercial vehicles come as one link without wheels: a mass, an inertia and a mesh that is elsewhere.
LUMP = """<robot name="lump"><link name="base_link">
  <inertial><origin xyz="0.003 0 -0.1"/><mass value="41"/>
    <inertia ixx="0.43" ixy="0" ixz="-0.03" iyy="1.23" iyz="0" izz="1.38"/></inertial>
  <collision><geometry><mesh filename="package://lump/meshes/base_link.STL"/></geometry></collision>
</link></robot>"""


def test_a_lump_from_a_urdf_drives_on_tracks(tmp_path):
    pytest.importorskip("yourdfpy")
    path = tmp_path / "lump.urdf"
    path.write_text(LUMP)
    lump = RoverModel.from_urdf(path, wheels=[]).to_dict()
    track = {"solid": "base_link", "wheels": 9, "radius": 0.1, "mass": 15.0, "torque_limit": 90.0, "drive_sign": -1.0}
    track |= {"motor": {"stall_torque": 90.0, "no_load_speed": 15.0}}
    tracks = [
        track | {"name": name, "from": [0.22, -0.1, z], "to": [-0.22, -0.1, z]}
        for name, z in (("left", -0.24), ("right", 0.24))
    ]
    rover = RoverModel.from_dict(lump | {"tracks": tracks})
    env = gym.make("Rover-v0", model=rover)
    assert env.action_space.shape == (18,)
    observation, info = env.reset(seed=0)
    start, policy = info["distance_to_goal"], PDPolicy(env)
    for _ in range(60):
        observation, _, terminated, _, info = env.step(policy.predict(observation)[0])
        if terminated:
            break
    assert info["distance_to_goal"] < start - 1.0


#: Two commercial vehicles: mass, kg, centre and moments of the lump in the file's axes; then what the file does not
#: say: mass of a belt, gauge, contact length, radius and number of wheels.
VEHICLES = {
    "small": ((41.0, (0.003, 0.0, -0.1), (0.43, 1.23, 1.38)), (7.0, 0.46, 0.42, 0.10, 9)),
    "large": ((117.1, (-0.05, 0.0, -0.17), (2.44, 8.5, 8.85)), (20.0, 0.68, 0.70, 0.12, 13)),
}
TOP_SPEED = 1.5


def vehicle(name: str, folder) -> RoverModel:
    (mass, centre, moments), (belt, gauge, length, radius, wheels) = VEHICLES[name]
    text = LUMP.replace("0.003 0 -0.1", " ".join(map(str, centre))).replace('mass value="41"', f'mass value="{mass}"')
    for old, new in zip(("0.43", "1.23", "1.38"), moments, strict=True):
        text = text.replace(f'"{old}"', f'"{new}"')
    (folder / "lump.urdf").write_text(text.replace('ixz="-0.03"', 'ixz="0"'))
    lump = RoverModel.from_urdf(folder / "lump.urdf", wheels=[]).to_dict()
    stall = 0.9 * (mass + 2 * belt) * GRAVITY * radius  # of a track
    track = {"solid": "base_link", "wheels": wheels, "radius": radius, "mass": belt, "drive_sign": -1.0}
    track |= {"torque_limit": stall, "motor": {"stall_torque": stall, "no_load_speed": TOP_SPEED / radius}}
    height = centre[2] - 0.02
    ends = {"from": [length / 2, height], "to": [-length / 2, height]}
    tracks = [
        track | {"name": side} | {end: [*at, z] for end, at in ends.items()}
        for side, z in (("left", -gauge / 2), ("right", gauge / 2))
    ]
    return RoverModel.from_dict(lump | {"tracks": tracks})


@pytest.mark.parametrize("name", VEHICLES)
@pytest.mark.parametrize("degrees", [0.0, 10.0, 20.0, 30.0])
def test_a_commercial_vehicle_climbs_at_the_speed_of_its_motors(tmp_path, name, degrees):
    """On the motors' line at the torque that the slope takes, v = v_top (1 - W sin α R / τ)."""
    pytest.importorskip("yourdfpy")
    model, slope = vehicle(name, tmp_path), math.radians(degrees)
    sim = standing(model, Plane([-math.sin(slope), math.cos(slope), 0.0], 0.0), friction=FRICTION)
    sim.set_wheel_torques(torques(model, 1e4, 1e4))
    assert sim.step(1000).is_converged
    assert np.hypot(*sim.v[:2]) == pytest.approx(TOP_SPEED * (1.0 - math.sin(slope) / 1.8), rel=1e-3)
    assert abs(sim.q[2]) < 1e-3


@pytest.mark.parametrize("name", VEHICLES)
@pytest.mark.parametrize("speeds", [(-0.4, 0.4), (0.0, 0.4), (0.2, 0.4)])
def test_a_commercial_vehicle_turns_as_slip_along_and_across_allow(tmp_path, name, speeds):
    """Slow belts slip by the same σ along: ψ' = (v_r - v_l) / (B + 2 σ / ψ'), whatever their mean speed."""
    pytest.importorskip("yourdfpy")
    _, (_, gauge, length, radius, wheels) = VEHICLES[name]
    sim = settled(vehicle(name, tmp_path), time_step=2e-3)
    gain = 50.0 * sim.model.mass * radius**2
    x = np.linspace(-length / 2, length / 2, wheels)
    rates = []
    for k in range(1500):
        belts = -sim.v[6:8] * radius
        sim.set_wheel_torques(torques(sim.model, *(gain * (np.array(speeds) - belts) / radius)))
        sim.step()
        if k >= 1000:
            rates.append((sim.v[4], *belts))
    rate, left, right = np.mean(rates, axis=0)
    share = sim.wheel_forces[:wheels, 0] + sim.wheel_forces[wheels:, 0]
    middle = (share * x).sum() / share.sum()  # turns about the centre of the load, nearly

    def moment(d):
        slip = np.sqrt(d * d + (x - middle) ** 2)
        return (share * (gauge / 2 * d - (x - middle) ** 2) / slip).sum()

    d = brentq(moment, 1e-6, 10.0)
    assert rate == pytest.approx((right - left) / (gauge + 2 * d), rel=0.03)
    assert np.abs(np.array([left, right]) - speeds).max() < 0.1


@pytest.mark.parametrize("name", VEHICLES)
def test_a_commercial_vehicle_drives_and_turns_over_rocks(tmp_path, name):
    pytest.importorskip("yourdfpy")
    model, rng = vehicle(name, tmp_path), np.random.default_rng(1)
    centres, radii = np.zeros((600, 3)), rng.uniform(0.03, 0.1, 600)
    centres[:, 0], centres[:, 2] = rng.uniform(0.8, 6.0, 600), rng.uniform(-1.5, 1.5, 600)
    centres[:, 1] = -0.5 * radii
    sim = standing(model, SphereField(centres, radii, Plane()), friction=0.8)
    sim.set_wheel_torques(torques(model, 1e4, 1e4))
    assert sim.step(600).is_converged
    assert sim.q[0] > 3.5
    heading = sim.q[4]
    sim.set_wheel_torques(torques(model, -1e4, 1e4))
    assert sim.step(200).is_converged
    assert sim.q[4] - heading > 0.7  # it stands on a few rocks: how fast it turns depends on which
    assert sim.deepest_overlap > -2e-3


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"solid": "turret"}, r"tracks\[0\].solid: there is no solid or joint named .turret."),
        ({"wheels": 1}, r"tracks\[0\].wheels: must be from 2 to 100"),
        ({"wheels": 101}, r"tracks\[0\].wheels: must be from 2 to 100"),
        ({"mass": 0.0}, r"tracks\[0\].mass: must be positive"),
        ({"radius": -0.1}, r"tracks\[0\].radius: must be positive"),
        ({"axle": [0.0, 0.0, 0.0]}, r"tracks\[0\].axle: an axis must have a direction"),
        ({"damping": 10.0}, r"tracks\[0\].stiffness: is missing"),
        ({"name": "hull"}, r"tracks\[0\].name: the name .hull. is used twice"),
        ({"name": "both"}, "the name .both. is used twice"),
        ({"drive_sign": 0.5}, "drive_sign: must be 1 or -1"),
        ({"from": [math.nan, 0.0, 0.0]}, r"tracks\[0\].from"),
        ({"belt": 1.0}, "unknown field `belt`"),
    ],
)
def test_wrong_tracks_are_refused(changes, message):
    with pytest.raises(ModelError, match=message):
        tracked(**changes)
