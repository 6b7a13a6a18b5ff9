"""Impulses that the motion leaves open: one answer, whatever solver, start and order, and their count."""

from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from rovers import placed, standing, with_fields
from scipy.optimize import minimize

from rover_gym.core import HeightField, Plane, RoverModel, Simulation

Array = npt.NDArray[np.float64]

SOLVERS = ("auto", "nsgs", "newton", "proximal", "admm")


def slope(share: float, across: float = 0.0) -> Plane:
    normal = np.array([-share, 1.0, -across])
    return Plane(normal / np.linalg.norm(normal))


def box(**fields: Any) -> RoverModel:
    shape = {"kind": "box", "size": [0.4, 0.2, 0.6]}
    solid = {"name": "box", "joint": "free", "mass": 2.0, "shape": shape, "collides": True}
    return RoverModel.from_dict({"format": 1, "name": "box", "solids": [solid | fields]})


def table(places: Array) -> RoverModel:
    """A plate on balls: legs that touch in a point."""
    legs = [{"kind": "sphere", "radius": 0.05, "position": [x, -0.1, z], "collides": True} for x, z in places]
    plate = {"kind": "box", "size": [1.0, 0.05, 1.0]}
    solid = {"name": "table", "joint": "free", "mass": 10.0, "shapes": [plate, *legs]}
    return RoverModel.from_dict({"format": 1, "name": "table", "solids": [solid]})


LEGS = np.array([[0.4, 0.4], [0.4, -0.4], [-0.4, 0.4], [-0.4, -0.4], [0.1, 0.05]])


def lying(model: RoverModel, ground: Any, height: float, steps: int = 1, **options: Any) -> Simulation:
    sim = placed(Simulation(model, ground, **({"friction": 0.7} | options)), y=height)
    sim.step(steps)
    return sim


def on_slope(share: float, **options: Any) -> Simulation:
    """The box flat on a slope, at rest."""
    angle = np.arctan(share)
    sim = Simulation(box(), slope(share), **({"friction": 0.7} | options))
    placed(sim, x=-0.1 * np.sin(angle), y=0.1 * np.cos(angle), pitch=angle).step()
    return sim


def least(sim: Simulation) -> Array:
    """The least impulses within the cones with the motion of the last step, by another method."""
    W, _, mu = sim.last_problem()
    p = sim.contacts.impulses.ravel()
    values, vectors = np.linalg.eigh(W)
    null = vectors[:, values < 1e-12 * values.max()]
    scale = np.abs(p).max()

    def room(t: Array) -> Array:
        own = (p / scale + null @ t).reshape(-1, 3)
        return mu * own[:, 0] - np.sqrt((own[:, 1:] ** 2).sum(axis=1) + 1e-24)

    found = minimize(
        lambda t: 0.5 * ((p / scale + null @ t) ** 2).sum(),
        np.zeros(null.shape[1]),
        jac=lambda t: null.T @ (p / scale + null @ t),
        constraints={"type": "ineq", "fun": room},
        method="SLSQP",
        options={"ftol": 1e-15, "maxiter": 500},
    )
    return (p + scale * null @ found.x).reshape(-1, 3)


def rigid_on_slope(solver: str = "auto", **options: Any) -> tuple[Simulation, Any]:
    """Six rigid wheels parked across a slope."""
    ground = slope(0.1, 0.25)
    model = RoverModel().replace(wheel_stiffness=0.0)
    sim = standing(model, ground, heading=0.3, friction=0.8, solver=solver, **options)
    return sim, sim.step(20)


def test_every_solver_finds_the_same_loads_of_wheels_parked_across() -> None:
    """The lateral forces of six rigid wheels depended on the solver, by hundreds of newtons."""
    weight = 9.81 * RoverModel().mass
    first, report = rigid_on_slope()
    assert report.undetermined_loads == 6
    for solver in SOLVERS[1:]:
        sim, report = rigid_on_slope(solver)
        assert report.is_converged, solver
        assert report.undetermined_loads == 6
        assert np.abs(sim.wheel_forces - first.wheel_forces).max() < 1e-6 * weight, solver


def test_loads_do_not_depend_on_the_last_step() -> None:
    """A rover that had turned on the spot kept its squeeze when it was placed again as it stood."""
    ground = Plane()
    model = RoverModel()
    sim = standing(model, ground, friction=0.7)
    sim.set_wheel_torques([60.0, -60.0, 60.0, -60.0, 60.0, -60.0])
    sim.step(100)
    sim.set_wheel_torques([0.0] * 6)
    sim.step(400)
    other = Simulation(model, ground, friction=0.7)
    other.set_state(sim.q, np.zeros_like(sim.v))
    sim.set_state(sim.q, np.zeros_like(sim.v))
    for one in (sim, other):
        one.step(1)
    assert np.abs(sim.wheel_forces - other.wheel_forces).max() < 1e-6 * 9.81 * model.mass


def test_straight_over_waves_the_count_is_that_of_the_rank() -> None:
    """Over waves the report said 0 where six wheels could push sideways against each other."""
    x, _ = np.meshgrid(np.arange(-2, 8, 0.05), np.arange(-2, 2, 0.05))
    ground = HeightField(0.05 * np.sin(x / 1.2), spacing=0.05, origin=(-2.0, -2.0))
    model = RoverModel.named("open-rover").replace(wheel_stiffness=0.0)
    counts = []
    for surface in (Plane(), ground):
        sim = standing(model, surface, friction=0.7, gravity=(0, -3.71, 0))
        sim.set_wheel_torques(0.05 * 3.71 * model.mass * model.wheel_radii / 6)
        for _ in range(60):
            count = sim.step().undetermined_loads
            W, q, _ = sim.last_problem()
            p = sim.contacts.impulses
            u = (W @ p.ravel() + q).reshape(-1, 3)
            if (np.abs(u) < 1e-12 * np.linalg.norm(q)).all():
                values, vectors = np.linalg.eigh(W)
                null = vectors[:, values < 1e-14 * values.max()]
                concerned = np.linalg.norm(null.reshape(-1, 3 * null.shape[1]), axis=1) > 1e-5
                assert count == concerned.sum()
            counts.append(count)
    assert set(counts[:60]) == {6}


def test_a_box_shares_its_weight_like_four_equal_springs() -> None:
    sim = lying(box(), Plane(), 0.1)
    W, _, _ = sim.last_problem()
    assert len(W) == 12
    assert np.linalg.matrix_rank(W) == 6
    assert sim.step().undetermined_loads == 4
    forces = sim.contacts.impulses / sim.time_step
    np.testing.assert_allclose(forces[:, 0], 0.5 * 9.81, rtol=1e-9)
    assert np.abs(forces[:, 1:]).max() < 1e-9 * 9.81


@pytest.mark.parametrize("share", [0.2, 0.55, 0.65, 0.69])
def test_a_box_on_a_slope_has_the_least_impulses_within_the_cones(share: float) -> None:
    """Near the limit of friction four equal tangential forces leave the cones of the upper corners."""
    sim = on_slope(share)
    expected = least(sim)
    impulses = sim.contacts.impulses
    scale = np.abs(impulses).max()
    assert np.abs(impulses - expected).max() < 1e-6 * scale
    room = 0.7 * impulses[:, 0] - np.linalg.norm(impulses[:, 1:], axis=1)
    assert room.min() > -1e-12 * scale
    if share > 0.6:
        assert room.min() < 1e-9 * scale  # the cones do bind
    for solver in SOLVERS[1:]:
        other = on_slope(share, solver=solver)
        assert np.abs(other.contacts.impulses - impulses).max() < 1e-6 * 2.0 * 9.81 * sim.time_step, solver


def loads_of_table(places: Array, order: Any = None, height: float = 0.15, **options: Any) -> Array:
    order = np.arange(len(places)) if order is None else np.asarray(order)
    sim = lying(table(places[order]), Plane(), height, **options)
    points = sim.contacts.points[:, [0, 2]]
    impulses = sim.contacts.impulses
    assert len(impulses) == len(places)
    nearest = [int(np.argmin(np.linalg.norm(points - place, axis=1))) for place in places]
    return np.asarray(impulses[nearest] / sim.time_step)


def test_a_table_of_five_legs_has_the_loads_of_equal_springs_in_any_order() -> None:
    found = loads_of_table(LEGS)
    # Equal springs: affine in the place, with sum and moments of the weight.
    ones = np.column_stack((np.ones(5), LEGS))
    model = table(LEGS)
    x, _, z = model.tags(np.zeros(model.nq))["centre_of_mass"]
    expected = ones @ np.linalg.solve(ones.T @ ones, 98.1 * np.array([1.0, x, z]))
    np.testing.assert_allclose(found[:, 0], expected, rtol=1e-8)
    for order in ([4, 3, 2, 1, 0], [2, 0, 4, 1, 3]):
        assert np.abs(loads_of_table(LEGS, order) - found).max() < 1e-9 * 98.1
    mirrored = loads_of_table(LEGS * [1.0, -1.0])
    np.testing.assert_allclose(mirrored * [1.0, 1.0, -1.0], found, atol=1e-9 * 98.1)
    assert lying(table(LEGS), Plane(), 0.15).step().undetermined_loads == 5
    for solver in SOLVERS[1:]:
        assert np.abs(loads_of_table(LEGS, solver=solver) - found).max() < 1e-6 * 98.1


def test_the_loads_of_a_table_change_as_little_as_its_legs() -> None:
    before = loads_of_table(LEGS)
    for size in (1e-3, 1e-5, 1e-7):
        moved = LEGS.copy()
        moved[4] += size
        change = np.abs(loads_of_table(moved) - before).max()
        assert change < 200.0 * size


def cylinders() -> RoverModel:
    return with_fields(RoverModel().replace(wheel_stiffness=0.0), wheels={"width": 0.08, "stiffness": 0.0})


def test_both_ends_of_a_rigid_cylinder_share_its_load() -> None:
    model = cylinders()
    sim = standing(model, Plane(), friction=0.7)
    report = sim.step(20)
    forces = sim.contacts.impulses[:, 0] / sim.time_step
    assert len(forces) == 12
    assert report.undetermined_loads == 12
    weight = 9.81 * model.mass
    ends = forces.reshape(-1, 2)
    assert np.abs(ends[:, 0] - ends[:, 1]).max() < 1e-6 * weight or ends.min() > 0.0
    other = Simulation(model, Plane(), friction=0.7, solver="newton")
    other.set_state(sim.q, np.zeros_like(sim.v))
    sim.set_state(sim.q, np.zeros_like(sim.v))
    for one in (sim, other):
        one.step()
    assert np.abs(sim.wheel_forces - other.wheel_forces).max() < 1e-6 * weight


def test_cylinders_that_fell_on_a_slope_bear_the_same_whatever_the_solver() -> None:
    """From the impact on, some solvers kept an answer with wheels wedged against each other that slipped aside."""
    model, ground = cylinders(), slope(0.1, 0.25)
    forces = []
    for solver in SOLVERS:
        sim = standing(model, ground, heading=0.3, lift=0.01, friction=0.8, solver=solver)
        report = sim.step(40)
        assert report.status == "converged"
        assert report.undetermined_loads == 12
        forces.append(sim.wheel_forces)
    assert np.ptp(forces, axis=0).max() < 1e-6 * 9.81 * model.mass


def test_contacts_that_yield_are_determined() -> None:
    model = RoverModel.named("skid-steered")
    sim = standing(model)
    assert sim.step(50).undetermined_loads == 0
