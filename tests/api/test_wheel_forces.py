"""Forces of wheels along the surface: `docs/wheel-forces.md`."""

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rovers import placed, standing

from rover_gym.core import HeightField, Plane, RoverModel, Simulation, SphereField

RADIUS = 0.1

GAIN, DAMPING = 20.0, 0.2

NAMES = RoverModel.names()


def caster(ahead: float, **tread: float) -> RoverModel:
    """A steered wheel on a straight rail, whose point of contact runs ahead of the steering axis."""
    turned = float(np.arctan2(ahead, RADIUS))
    axis = [float(np.sin(turned)), float(np.cos(turned)), 0.0]
    place = {"position": [0.0, 0.0, 0.0], "inertia": [1e-3, 1e-3, 1e-3, 0.0, 0.0, 0.0]}
    solids: list[dict[str, Any]] = [
        place | {"name": "sled", "joint": "prismatic", "axis": [1.0, 0.0, 0.0], "mass": 5.0},
        place | {"name": "strut", "parent": "sled", "joint": "prismatic", "axis": [0.0, 1.0, 0.0], "mass": 1.0},
        place | {"name": "fork", "parent": "strut", "axis": axis, "mass": 0.2},
        {"name": "wheel", "parent": "fork", "position": [0.0, 0.0, 0.0], "axis": [0.0, 0.0, 1.0], "mass": 0.3},
    ]
    solids[2]["hold"] = {"stiffness": GAIN, "damping": DAMPING}
    solids[3]["shape"] = {"kind": "disc", "radius": RADIUS}
    wheel = {"name": "W", "solid": "wheel", "axle": [0.0, 0.0, 1.0], "radius": RADIUS}
    wheel |= {"torque_limit": 10.0, "drive_sign": -1.0, "steering": "fork", "steering_limit": 0.5}
    return RoverModel.from_dict({"name": "caster", "solids": solids, "wheels": [wheel | tread]})


def rolling(model: RoverModel, speed: float, step: float, turned: float = 0.0) -> Simulation:
    sim = Simulation(model, time_step=step, friction=0.8)
    sim.set_state([0.0, RADIUS, turned, 0.0], [speed, 0.0, 0.0, -speed / RADIUS])
    return sim


@pytest.mark.parametrize("step", [0.005, 0.001])
@pytest.mark.parametrize("ahead", [0.02, 0.005, -0.005, -0.001])
def test_a_rigid_wheel_turns_itself_at_the_rate_v_over_e(ahead: float, step: float) -> None:
    """Lateral forces over waves grew whatever the solver and the gain, and elsewhere changed sign in every step."""
    speed = 0.3
    sim = rolling(caster(ahead), speed, step)
    steering = np.array(sim.linearise().a)[np.ix_([2, 6], [2, 6])]
    found = np.sort(np.linalg.eigvals(steering).real)
    x = step * speed / ahead
    # u_T = v (delta + h delta') - e delta'+ = 0 at the predicted end of the step, and the midpoint rule for delta.
    np.testing.assert_allclose(found, np.sort(np.roots([1.0, -(1.0 + 1.5 * x), 0.5 * x]).real), rtol=1e-6)
    nearest = found[np.argmin(np.abs(found - np.exp(x)))]
    if abs(x) < 0.1:
        assert np.log(nearest) / step == pytest.approx(speed / ahead, rel=0.02)
    # A point that trails by less than h v is held by an impulse of the other sign in every step.
    assert (found[0] < -1.0) == (x < -1.0)


def test_a_rigid_wheel_that_trails_by_less_than_a_step_changes_sides_in_every_step() -> None:
    """Where the touching point trails by 1 mm at 0.3 m/s, forces changed sign in nine of ten steps."""
    for step, alternates in ((0.005, True), (0.001, False)):
        sim = rolling(caster(-0.001), 0.3, step, turned=1e-6)
        lateral = []
        for _ in range(20):
            sim.step()
            lateral.append(sim.wheel_forces[0, 2])
        changes = np.diff(np.sign(lateral[2:])) != 0
        assert changes.mean() > 0.8 if alternates else changes.mean() < 0.2


TREAD = {"stiffness": 1e5, "damping": 100.0, "relaxation_length": 0.01}


@pytest.mark.parametrize("step", [0.02, 0.005, 0.001])
@pytest.mark.parametrize("ahead", [0.015, 0.005, -0.001, -0.015])
def test_a_wheel_that_yields_is_held_by_its_steering(ahead: float, step: float) -> None:
    """k_T sigma e = 15 N m/rad at most, less than the gain of 20 N m/rad: whatever turns the wheel decays."""
    sim = rolling(caster(ahead, **TREAD), 0.3, step, turned=1e-3)
    sim.step(round(1.0 / step))
    first = abs(sim.wheel_forces[0, 2])
    sim.step(round(3.0 / step))
    assert abs(sim.wheel_forces[0, 2]) < 1e-3 * first + 1e-9


def test_a_wheel_that_yields_turns_itself_beyond_its_gain_at_the_rate_of_the_manual() -> None:
    """(v/e) (1 - K/(k_T sigma e)): with a lead of 4 cm the gain is no longer enough."""
    ahead, speed, step = 0.04, 0.3, 0.001
    sim = rolling(caster(ahead, **TREAD), speed, step)
    found = np.linalg.eigvals(np.array(sim.linearise().a)[np.ix_([2, 6], [2, 6])])
    cornering = TREAD["stiffness"] * TREAD["relaxation_length"]
    # The axis is tilted: the lever is e cos(tilt), and the wheel turns by cos(tilt) about the vertical.
    moment = cornering * ahead * np.cos(np.arctan2(ahead, RADIUS)) ** 2
    rate = speed / ahead * (1.0 - GAIN / moment) / (1.0 + speed / ahead * DAMPING / moment)
    assert np.log(np.abs(found).max()) / step == pytest.approx(rate, rel=0.02)


def test_a_steady_side_force_needs_its_slip_angle_and_a_parked_wheel_none() -> None:
    """Side force = k_T sigma times the angle between the motion and the wheel's plane, at every step."""
    model = caster(0.0, **TREAD).replace(wheel_damping=1000.0)
    for step in (0.02, 0.005, 0.001):
        angle = 2e-3
        sim = rolling(model, 0.3, step, turned=angle)
        sim.set_steering([angle])
        sim.step(round(1.0 / step))
        slip, lateral = sim.q[2], sim.wheel_forces[0, 2]
        assert abs(slip) == pytest.approx(angle, rel=0.01)
        assert abs(lateral) == pytest.approx(TREAD["stiffness"] * TREAD["relaxation_length"] * abs(slip), rel=0.01)


def waves() -> HeightField:
    x, _ = np.meshgrid(np.arange(-2.0, 8.0, 0.05), np.arange(-2.0, 2.0, 0.05))
    return HeightField(0.05 * np.sin(x / 1.2), spacing=0.05, origin=(-2.0, -2.0))


def straight(
    model: RoverModel, gravity: float, step: float, duration: float, **options: Any
) -> tuple[np.ndarray, np.ndarray]:
    """Wheel forces (n, wheels, 3) and jolts |a|/g of a drive straight over waves that run across its way."""
    sim = standing(model, waves(), friction=0.7, time_step=step, gravity=(0.0, -gravity, 0.0), **options)
    sim.set_wheel_torques(0.05 * gravity * model.mass * model.wheel_radii / len(model.wheel_radii))
    forces, jolts = [], []
    for _ in range(round(duration / step)):
        v = sim.v[:3].copy()
        assert sim.step().is_converged
        forces.append(sim.wheel_forces)
        jolts.append(np.abs(sim.v[:3] - v).max() / step / gravity)
    return np.array(forces), np.array(jolts)


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize(("gravity", "step"), [(1.62, 0.02), (3.71, 0.005), (9.81, 0.005), (9.81, 0.001)])
def test_nothing_pushes_sideways_on_a_straight_way_over_waves(name: str, gravity: float, step: float) -> None:
    """Lateral forces of 0.55 to 0.67 of the load, at the limit of friction, where by symmetry there are none."""
    forces, _ = straight(RoverModel.named(name), gravity, step, 4.0 if step > 0.001 else 1.5)
    normal, lateral = forces[..., 0], forces[..., 2]
    assert np.abs(lateral).max() < 0.01 * normal.mean()


@pytest.mark.parametrize("name", ["rover", "mars-rover", "open-rover"])
def test_no_jolt_over_waves_is_missing_at_a_tenth_of_the_step(name: str) -> None:
    """When the squeeze of rigid wheels let go, the trunk jolted by 0.5 to 0.7 g."""
    model, steps = RoverModel.named(name), (0.01, 0.001)
    most = [float(straight(model, 3.71, step, 1.5)[1][round(0.2 / step) :].max()) for step in steps]
    assert most[0] < 0.2
    assert most[0] <= most[1] + 0.01


def mirrored(model: RoverModel) -> list[int]:
    """Of each wheel, the one on the other side."""
    other = str.maketrans("LR", "RL")
    return [model.wheel_names.index(name.translate(other)) for name in model.wheel_names]


@pytest.mark.parametrize("name", [name for name in NAMES if name != "skid-steered"])  # its mass centre is to one side
def test_mirrored_states_have_mirrored_forces(name: str) -> None:
    """On rigid wheels the sign of a rounding error decided which way they squeezed."""
    model, ground = RoverModel.named(name), waves()
    swap = mirrored(model)
    rng = np.random.default_rng(7)
    torques = 0.2 * model.wheel_radii * model.mass * rng.uniform(0.5, 1.0, (40, len(swap)))
    steered = [float("steering" in wheel) for wheel in model.to_dict()["wheels"]]
    angles = rng.uniform(-0.2, 0.2, (40, len(swap))) * steered
    found = []
    for sign in (1.0, -1.0):
        sim = standing(model, ground, friction=0.7)
        forces = []
        for torque, angle in zip(torques, angles, strict=True):
            order = slice(None) if sign > 0.0 else swap
            sim.set_commands(torque[order], sign * angle[order])
            sim.step(5)
            forces.append(sim.wheel_forces[order] * [1.0, 1.0, sign])
        found.append(forces)
    np.testing.assert_allclose(found[0], found[1], atol=1e-9 * 9.81 * model.mass)


@pytest.mark.parametrize("name", NAMES)
def test_loads_are_the_same_whatever_solver_and_warm_start(name: str) -> None:
    model = RoverModel.named(name)
    found = []
    for solver, warm_start in (("auto", True), ("auto", False), ("newton", True), ("proximal", False), ("nsgs", True)):
        options = {"solver": solver, "warm_start": warm_start, "max_iterations": 20000}
        forces, _ = straight(model, 9.81, 0.005, 0.5, **options)
        found.append(forces)
    for forces in found[1:]:
        np.testing.assert_allclose(forces, found[0], atol=1e-6 * 9.81 * model.mass)


def test_readings_across_a_rover_that_turns_over_waves_seldom_stand_at_the_limit() -> None:
    """In registered environments two thirds of the lateral readings stood at the limit of friction."""
    sim = standing(RoverModel.named("rover"), waves(), friction=0.7)
    rng, at_limit = np.random.default_rng(0), []
    for _ in range(40):
        sim.set_commands(np.full(6, rng.uniform(10.0, 40.0)), rng.uniform(-0.1, 0.1) * np.array([1, 1, 0, -1, 0, -1]))
        for _ in range(10):
            sim.step()
            normal, along, across = sim.wheel_forces.T
            at_limit.append(np.hypot(along, across) > 0.699 * normal)
    assert np.mean(at_limit) < 0.2


@pytest.mark.parametrize("variant", ["linearised", "newton"])
@pytest.mark.parametrize("restitution", [0.0, 0.7])
def test_wheels_that_are_thrown_onto_rocks_give_off_no_more_than_they_took(restitution: float, variant: str) -> None:
    """A rebound's impulse became a deflection, and wheels gave off a sixth of the energy of a tumbling rover."""
    rng = np.random.default_rng(5)
    for _ in range(6):
        rocks = SphereField(rng.uniform((-2, -0.3, -2), (2, 0.1, 2), (40, 3)), rng.uniform(0.05, 0.3, 40), Plane())
        step = float(rng.choice([2e-3, 5e-3, 2e-2]))
        sim = Simulation(terrain=rocks, restitution=restitution, time_step=step, variant=variant)
        v = np.concatenate([rng.normal(0.0, 3.0, 6), np.zeros(sim.model.nv - 6)])
        v[1] = -1.0
        placed(sim, v, y=1.0)
        most = sim.energy().total
        given = np.cumsum([sim.step().energy_released for _ in range(int(1.0 / step))])
        assert given.max() <= 1e-12 * most
        # A wheel that bounces does not yield.
        assert restitution > 0.0 or given.min() < -1e-3


@pytest.mark.parametrize("name", NAMES)
def test_the_page_states_the_numbers_of_the_gallery(name: str) -> None:
    page = (Path(__file__).parents[2] / "docs" / "wheel-forces.md").read_text()
    (row,) = re.findall(rf"^\| `{name}` \| (.*) \|$", page, re.MULTILINE)
    stated = [float(re.sub(r"[^\d.e]", "", cell)) for cell in row.split("|")]
    model = RoverModel.named(name)
    deflection = 0.0033 * model.wheel_radii[0]
    stiffness, share = model.wheel_stiffnesses[0], model.mass * 9.81 / len(model.wheel_radii)
    damping = 2.0 * np.sqrt(stiffness * share / 9.81)
    length = np.sqrt(2.0 * model.wheel_radii[0] * deflection)
    slip = np.degrees(0.5 * share / (stiffness * length))
    assert stated == pytest.approx([1e3 * deflection, stiffness, damping, 1e3 * length, slip], rel=0.04)
