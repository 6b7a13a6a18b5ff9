"""Derivatives of machines with closed loops and of several machines, against differences of real steps."""

import copy
import math

import numpy as np
import pytest
from machines import RADIUS
from machines.test_rollers import platform
from machines.test_several import cart, on_slope
from rovers import standing

from rover_gym import Plane, RoverModel, Simulation, StateError
from rover_gym.core import Linearisation
from rover_gym.derivatives import rollout

from .test_derivatives import best_difference, relative, state_of

#: Lengths of crank, coupler, rocker and base, m.
BARS = (0.3, 0.9, 0.7, 1.0)
HEIGHT = 2.0


def bar(name: str, parent: str | None, place: list[float], centre: list[float], mass: float = 1.0) -> dict:
    own = {"name": name, "position": place, "axis": [0.0, 0.0, 1.0], "mass": mass, "centre_of_mass": centre}
    own |= {"inertia": [0.01, 0.02, 0.03, 0.0, 0.0, 0.0], "joint": "revolute"}
    return own | ({} if parent is None else {"parent": parent})


def four_bar(friction: float = 0.0) -> RoverModel:
    """A four-bar in the plane of x and y, with a pendulum across it on the rocker; `friction` in the crank's joint."""
    a, b, c, d = BARS
    along = ((d - a) ** 2 + b**2 - c**2) / (2.0 * (d - a))
    x, y = a + along, math.sqrt(b**2 - along**2)
    crank = bar("crank", None, [0.0, HEIGHT, 0.0], [0.5 * a, 0.0, 0.0]) | {"friction": friction}
    coupler = bar("coupler", "crank", [a, 0.0, 0.0], [0.5 * along, 0.5 * y, 0.0], 2.0)
    rocker = bar("rocker", None, [d, HEIGHT, 0.0], [0.5 * (x - d), 0.5 * y, 0.0], 1.5)
    bob = bar("bob", "rocker", [0.1, 0.2, 0.1], [0.0, -0.4, 0.2], 0.7) | {"axis": [1.0, 0.0, 0.0]}
    pin = {"name": "pin", "kind": "connect", "solid": "coupler", "other": "rocker", "position": [along, y, 0.0]}
    return RoverModel.from_dict({"name": "four-bar", "solids": [crank, coupler, rocker, bob], "loops": [pin]})


def slider_crank() -> RoverModel:
    """A crank that a motor drives, a rod, and a slider with a damper."""
    r, long = 0.2, 0.6
    crank = bar("crank", None, [0.0, HEIGHT, 0.0], [0.5 * r, 0.0, 0.0])
    rod = bar("rod", "crank", [r, 0.0, 0.0], [0.5 * long, 0.0, 0.0])
    slider = bar("slider", None, [r + long, HEIGHT, 0.0], [0.0, 0.0, 0.0], 3.0)
    slider |= {"joint": "prismatic", "axis": [1.0, 0.0, 0.0], "damping": 4.0}
    motor = {"stall_torque": 30.0, "no_load_speed": 12.0}
    wheel = {"name": "crank", "solid": "crank", "axle": [0, 0, 1], "radius": 0.1, "torque_limit": 40.0}
    wheel |= {"drive_sign": 1.0, "motor": motor}
    pin = {"name": "pin", "kind": "connect", "solid": "slider", "other": "rod"}
    described = {"name": "slider-crank", "solids": [crank, rod, slider], "wheels": [wheel], "loops": [pin]}
    return RoverModel.from_dict(described)


def with_a_bar() -> RoverModel:
    """The open-source rover with a bar differential: a bar on the body, and a rod from either end to a rocker."""
    described = copy.deepcopy(RoverModel.named("open-rover").to_dict())
    height, arm, rod = 0.1, 0.12, 0.15
    for solid in described["solids"]:
        if solid["name"] == "right_rocker":
            del solid["coupled"]
    light = {"mass": 0.05, "inertia": [1e-4, 1e-4, 1e-4, 0.0, 0.0, 0.0], "parent": "trunk"}
    described["solids"].append(light | {"name": "bar", "position": [0.0, height - 0.03, 0.0], "axis": [0.0, 1.0, 0.0]})
    described["loops"] = []
    for side, sign in (("left", -1.0), ("right", 1.0)):
        own = {"name": f"{side}_rod", "parent": "bar", "joint": "spherical", "position": [0.0, 0.0, sign * arm]}
        described["solids"].append(light | own)
        joint = {"name": f"{side}_joint", "kind": "connect", "solid": f"{side}_rod", "other": f"{side}_rocker"}
        joint |= {"position": [-sign * rod, 0.0, 0.0], "other_position": [-sign * rod, height, 0.0]}
        described["loops"].append(joint)
    return RoverModel.from_dict(described)


def turning(model: RoverModel, q: list[float], v: list[float], steps: int = 3, **options) -> Simulation:
    """A machine that moves, with its loops closed."""
    sim = Simulation(model, **options)
    sim.set_state(*model.close_loops(q, v))
    sim.step(steps)
    return sim


def moving_four_bar(**options) -> Simulation:
    return turning(four_bar(options.pop("friction", 0.0)), [0.4, 0.0, 0.0, 0.3], [2.0, 0.0, 0.0, 1.0], **options)


def moving_slider_crank() -> Simulation:
    sim = turning(slider_crank(), [0.5, 0.0, 0.0], [3.0, 0.0, 0.0])
    sim.set_wheel_torques([35.0])
    sim.step(2)
    return sim


def rolling_with_a_bar(**options) -> Simulation:
    model = with_a_bar().replace(wheel_stiffness=0.0)
    sim = Simulation(model, **options)
    q, v = model.resting_pose(Plane(), (0.0, 0.0), 0.0), np.zeros(model.nv)
    v[0] = 0.05
    v[model.wheel_joint_indices] = -0.05 / np.asarray(model.wheel_radii)
    sim.set_state(*model.close_loops(q, v))
    sim.set_wheel_torques(np.full(6, 0.1))
    sim.step(20)
    return sim


def difference(sim: Simulation, column: int, step: float) -> np.ndarray:
    """Central difference of a real step from a state whose loops are closed."""
    nv, n = sim.model.nv, len(sim.model.wheel_names)
    other = Simulation(sim.model, sim.terrain, **{**sim.settings, "tolerance": 1e-15})
    ends = []
    for sign in (1.0, -1.0):
        point = np.concatenate([sim.q, sim.v, sim.wheel_torques, sim.steering])
        point[column] += sign * step
        other.set_state(*sim.model.close_loops(point[:nv], point[nv : 2 * nv]))
        other.set_commands(point[2 * nv : 2 * nv + n], point[2 * nv + n :])
        other.step()
        ends.append(state_of(other))
    return (ends[0] - ends[1]) / (2.0 * step)


def worst_column(sim: Simulation, linear: Linearisation, columns: np.ndarray) -> float:
    """Largest relative error of the columns, each against the best of four steps of the differences.

    A column that the loops make small, such as that of a rod's turn, is compared with 0.1.
    """
    ab = np.column_stack([linear.a, linear.b])
    worst, torques = 0.0, range(2 * sim.model.nv, 2 * sim.model.nv + len(sim.model.wheel_names))
    for k in columns:
        column, scale = ab[:, k], 100.0 if k in torques else 1.0
        if not column.any():
            continue  # an axle that is not steered
        tried = [difference(sim, k, scale * h) for h in (3e-7, 3e-6, 3e-5, 3e-4)]
        worst = max(worst, min(np.abs(column - one).max() for one in tried) / max(np.abs(column).max(), 0.1))
    return worst


@pytest.mark.parametrize("time_step", [1e-3, 5e-3, 0.02])
def test_every_column_of_a_four_bar_is_a_difference(time_step):
    """Also of those that open the loop, which `set_state` closes."""
    sim = moving_four_bar(time_step=time_step)
    linear = sim.linearise(check=True)
    assert linear.holds.all()
    assert worst_column(sim, linear, np.arange(2 * sim.model.nv)) < 1e-6
    # One coordinate of the linkage and one of the pendulum are free.
    assert np.linalg.matrix_rank(linear.a[:4], tol=1e-8) <= 4
    assert np.linalg.matrix_rank(linear.a, tol=1e-8) == 4


def test_a_linkage_at_rest_is_differentiated():
    """Its end is closed without a projection, its neighbours' ends are not."""
    sim = Simulation(four_bar(), gravity=(0, 0, 0))
    linear = sim.linearise(check=True)
    assert linear.holds.all()
    assert worst_column(sim, linear, np.arange(8)) < 1e-6


def test_a_slider_crank_is_differentiated_by_the_torque_of_its_motor():
    sim = moving_slider_crank()
    assert sim.motor_torques[0] < 30.0, "on the motor's line"
    linear = sim.linearise(check=True)
    assert linear.holds.all()
    assert worst_column(sim, linear, np.arange(6)) < 1e-6
    sim.set_wheel_torques([5.0])
    linear = sim.linearise(check=True)
    assert linear.b[3, 0] > 0.0
    assert worst_column(sim, linear, np.arange(8)) < 1e-6


@pytest.mark.parametrize("name", ["damping:slider", "mass:rod", "mass"])
def test_a_slider_crank_is_differentiated_by_its_parameters(name):
    sim = moving_slider_crank()
    start, commands = state_of(sim), np.tile([5.0, 0.0], (20, 1))
    found = rollout(sim, start, commands, (name,))

    def along(amount: float) -> np.ndarray:
        described = copy.deepcopy(sim.model.to_dict())
        for solid in described["solids"]:
            if name == "damping:slider":
                solid["damping"] = 4.0 + amount if solid["name"] == "slider" else 0.0
            elif name in ("mass", f"mass:{solid['name']}"):
                solid["mass"] *= 1.0 + amount
                solid["inertia"] = [(1.0 + amount) * moment for moment in solid["inertia"]]
        other = Simulation(RoverModel.from_dict(described), **{**sim.settings, "tolerance": 1e-15})
        return rollout(other, start, commands).states

    assert best_difference(along, found.jvp(parameters=[1.0])) < 1e-6


def test_trajectories_of_a_linkage_are_differentiated_both_ways():
    sim = moving_four_bar()
    start, commands = state_of(sim), np.zeros((40, 0))
    _, rates = sim.model.close_loops(sim.q, [1.0, 0.0, 0.0, 0.5])
    direction = np.concatenate([rates, np.zeros(4)])
    found = rollout(sim, start, commands)

    def along(amount: float) -> np.ndarray:
        q, v = sim.model.close_loops(*np.split(start + amount * direction, 2))
        return rollout(sim, np.concatenate([q, v]), commands).states[1:]

    changed = found.jvp(direction)
    assert best_difference(along, changed[1:]) < 1e-6
    costate = np.random.default_rng(1).normal(size=changed.shape)
    assert found.vjp(costate).state @ direction == pytest.approx((costate * changed).sum(), rel=1e-10)


@pytest.mark.parametrize("depth", [0.0, 1e-4])
def test_a_rover_with_a_bar_differential_is_differentiated(depth):
    """Its wheels roll; in the second case the step moves them out of the ground."""
    sim = rolling_with_a_bar(stabilisation="projection" if depth else "none")
    q = sim.q
    q[1] -= depth
    sim.set_state(q, sim.v)
    linear = sim.linearise(check=True)
    assert set(linear.modes) == {"stick"}
    assert linear.is_projected == (depth > 0.0)
    names = sim.model.dof_names
    held = dict(zip([*names, *(f"rate of {name}" for name in names)], linear.holds, strict=False))
    assert all(held[name] for name in ("x", "z", "heading", "rate of roll"))
    assert linear.holds.mean() > 0.5
    columns = np.flatnonzero(linear.holds)
    # The differences' own error: with light rods the solver's rounding counts, and modes change beyond 1e-5.
    assert worst_column(sim, linear, columns[:: max(1, len(columns) // 12)]) < 5e-6
    b = linear.b[sim.model.nv, :6]
    assert (b > 0.0).all(), "every wheel pushes"


def test_a_rover_with_a_bar_differential_is_that_with_coupled_rockers():
    """The forward speed that a torque gives, through loops and through a coupled joint."""
    coupled, model = RoverModel.named("open-rover"), with_a_bar()
    found = []
    for one in (coupled, model):
        sim = standing(one)
        sim.set_wheel_torques(np.full(6, 0.5))
        sim.step(20)
        commands = np.tile(np.repeat([0.5, 0.0], 6), (30, 1))
        pushed = np.tile(np.repeat([1.0, 0.0], 6), (30, 1))
        found.append(rollout(sim, state_of(sim), commands).jvp(commands=pushed)[-1, one.nv] * one.mass)
    assert found[1] == pytest.approx(found[0], rel=0.02)


@pytest.mark.parametrize(("friction", "mode"), [(0.5, "slip"), (60.0, "stick")])
def test_loops_are_differentiated_together_with_dry_friction(friction, mode):
    sim = moving_four_bar(friction=friction)
    if mode == "stick":
        sim.step(200)
    linear = sim.linearise(check=True)
    assert linear.modes == [mode]
    columns = np.flatnonzero(linear.holds)
    assert len(columns) >= (8 if mode == "slip" else 4)
    assert worst_column(sim, linear, columns) < 1e-6
    if mode == "stick":
        assert np.abs(linear.a[4:7]).max() < 1e-9, "the linkage stays at rest"


def test_machines_in_tow_are_differentiated():
    pin = {"name": "pin", "kind": "connect", "solid": "tug/trunk", "position": [-0.6, 0.0, 0.0]}
    pin |= {"other": "load/trunk", "other_position": [0.6, 0.0, 0.0]}
    models = {"tug": cart(), "load": cart()}
    sim = on_slope(models, [0.0, -1.2], 0.1, join={"loops": [pin]}, friction=0.9, stabilisation="none")
    sim.set_wheel_torques([6.0] * 4 + [0.0] * 4)
    sim.step(40)
    start, commands = state_of(sim), np.tile(np.concatenate([sim.wheel_torques, sim.steering]), (20, 1))
    pushed = np.zeros_like(commands)
    pushed[:, :4] = 1.0
    found = rollout(sim, start, commands, ("mass:load/trunk",))

    def along(amount: float) -> np.ndarray:
        return rollout(sim, start, commands + amount * pushed).states

    changed = found.jvp(commands=pushed)
    assert best_difference(along, changed, 10.0) < 1e-6
    both = [sim.model.machines[name].coordinates.start + sim.model.nv for name in models]
    assert changed[-1, both[0]] == pytest.approx(changed[-1, both[1]], rel=1e-6)
    assert found.jvp(parameters=[1.0])[-1, both[0]] < 0.0, "a heavier load slows both"


def test_machines_that_push_each_other_are_differentiated():
    laws = {("skate", "ground"): (0.0, 0.0), ("body", "body"): (0.0, 0.0)}
    sim = on_slope({"tug": cart(), "sledge": cart("skate")}, [0.0, 1.0 + 1e-9], materials=laws, stabilisation="none")
    sim.set_wheel_torques([4.0] * 4 + [0.0] * 4)
    sim.step(20)
    linear = sim.linearise(check=True)
    assert any(other is not None for other in sim.contacts.others)
    assert linear.holds.mean() > 0.5
    assert linear.errors[linear.holds].max() < 1e-5
    push = 2 * sim.model.nv  # the first torque
    ab = np.column_stack([linear.a, linear.b])
    assert relative(ab[:, push], difference(sim, push, 1e-3)) < 1e-6
    assert ab[sim.model.nv + 10, push] == pytest.approx(1.0 / RADIUS / (2 * 48.0 + 4.0) * 0.005, rel=1e-6)


def test_machines_that_fly_apart_are_differentiated():
    """In free flight the energy audit scales the motion relative to the common mass centre, of all machines."""
    pair = RoverModel.join({"a": RoverModel.named("skid-steered"), "b": cart()})
    sim = Simulation(pair)
    q, v = np.zeros(pair.nv), 0.5 * np.random.default_rng(2).normal(size=pair.nv)
    q[[1, pair.machines["b"].coordinates.start + 1]] = 2.0, 5.0
    sim.set_state(q, v)
    linear = sim.linearise(check=True)
    assert linear.holds.mean() > 0.9
    columns = np.flatnonzero(linear.holds)[::3]
    assert worst_column(sim, linear, columns) < 2e-6


def test_a_platform_on_rollers_is_differentiated_along_a_drive():
    sim = standing(platform(), stabilisation="none")
    sim.set_wheel_torques([3.0, -2.0, 1.0, 3.0])
    sim.step(50)
    start, commands = state_of(sim), np.tile(np.concatenate([sim.wheel_torques, sim.steering]), (30, 1))
    pushed = np.zeros_like(commands)
    pushed[:, :4] = [1.0, -1.0, -1.0, 1.0]
    direction = np.zeros_like(start)
    direction[[0, 2, 4]] = 1.0, -0.5, 0.3

    def along(amount: float) -> np.ndarray:
        return rollout(sim, start + amount * direction, commands + amount * pushed).states

    assert best_difference(along, rollout(sim, start, commands).jvp(direction, pushed)) < 1e-6


def test_a_start_with_open_loops_is_refused_by_name():
    sim = moving_four_bar()
    start = state_of(sim)
    start[0] += 0.1
    with pytest.raises(StateError, match=r"trajectory 0, step 0: .*loop .pin. is open by"):
        rollout(sim, start, np.zeros((2, 0)))
