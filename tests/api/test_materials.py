"""Friction and restitution by pair of materials, and wheels with a width, from Python."""

import json
import math
import pickle
from typing import Any

import numpy as np
import pytest
from refusals import refused
from rovers import goes_on_alike, placed, standing, with_fields

from rover_gym.core import (
    HeightField,
    ModelError,
    OptionError,
    Plane,
    RoverModel,
    Simulation,
    SphereField,
    TerrainError,
    TriangleMesh,
)

MATERIALS = {("wheel", "rock"): (0.5, 0.1), ("ground", "wheel"): (0.9, 0.0)}


def wide(**fields: Any) -> RoverModel:
    description = RoverModel().to_dict()
    for wheel in description["wheels"]:
        if "stiffness" in fields:
            del wheel["deflection"]
        wheel.update({name: value for name, value in fields.items() if value is not None})
    return RoverModel.from_dict(description)


def test_a_mapping_and_rows_say_the_same_and_survive() -> None:
    sim = Simulation(materials=MATERIALS)
    assert sim.materials == MATERIALS
    rows = json.loads(json.dumps(sim.settings["materials"]))
    assert Simulation(materials=rows).materials == MATERIALS
    assert pickle.loads(pickle.dumps(sim)).materials == MATERIALS  # noqa: S301 - our own bytes
    assert Simulation(**sim.settings).settings == sim.settings
    assert "materials" not in Simulation().settings
    assert Simulation().materials == {}


def test_a_pair_decides_and_the_rest_keeps_the_common_coefficients() -> None:
    sims = [
        Simulation(friction=0.2),
        Simulation(friction=0.9, materials={("wheel", "ground"): (0.2, 0.0)}),
        Simulation(friction=0.2, materials={("wheel", "rock"): (0.9, 0.0)}),
    ]
    paths = []
    for sim in sims:
        sim.set_state(sim.model.resting_pose(Plane(), (0.0, 0.0), 0.0))
        sim.set_steering([0.3, 0.3, 0.0, 0.0, 0.0, 0.0])
        sim.set_wheel_torques([30.0] * 6)
        sim.step(100)
        paths.append(sim.q)
    assert np.array_equal(paths[1], paths[2])
    assert paths[1] == pytest.approx(paths[0], abs=1e-3)


def test_a_snapshot_continues_with_materials() -> None:
    sim = Simulation(materials=MATERIALS)
    sim.set_wheel_torques([10.0] * 6)
    assert goes_on_alike(sim, 20)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({("wheel",): (0.5, 0.0)}, "materials: must be a mapping"),
        ({"wheel": (0.5, 0.0)}, "materials: must be a mapping"),
        ({("wheel", "rock"): 0.5}, "materials: must be a mapping"),
        ({("wheel", "rock"): (0.5, "low")}, "materials"),
        ({("wheel", 3): (0.5, 0.0)}, "materials"),
        (7, "materials: must be a mapping"),
        ([("wheel", "rock", 0.5)], "materials: must be a mapping"),
        ({("wheel", "rock"): (-0.5, 0.0)}, 'friction between "wheel" and "rock" must be finite and not negative'),
        ({("wheel", "rock"): (0.5, 2.0)}, 'restitution between "wheel" and "rock" must be in'),
        ({("wheel", "rock"): (0.5, 0.0), ("rock", "wheel"): (0.6, 0.0)}, "given twice"),
        ({("", "rock"): (0.5, 0.0)}, "1 to 100 characters"),
    ],
)
def test_bad_laws_are_refused_by_name(given: Any, message: str) -> None:
    with refused(OptionError, "materials") as caught:
        Simulation(materials=given)
    assert message in str(caught.value)


def test_terrains_name_their_material() -> None:
    heights = np.zeros((3, 3))
    corners, triangle = [[0, 0, 0], [0, 0, 1], [1, 0, 0]], [[0, 1, 2]]
    default = (HeightField(heights, 1.0), TriangleMesh(corners, triangle), SphereField([[0, 0, 0]], [1.0], Plane()))
    assert [terrain.material for terrain in default] == ["ground", "ground", "rock"]
    given = (
        HeightField(heights, 1.0, material="sand"),
        TriangleMesh(corners, triangle, material="sand"),
        SphereField([[0, 0, 0]], [1.0], material="sand"),
        SphereField.rocks(0.1, [0, 0, 5, 5], 1, material="sand"),
        HeightField.fractal(4.0, 0.5, 0.1, material="sand"),
    )
    for terrain in given:
        assert terrain.material == "sand"
        assert pickle.loads(pickle.dumps(terrain)).material == "sand"  # noqa: S301 - our own bytes
    with pytest.raises(TerrainError, match="material: a name has 1 to 100 characters"):
        HeightField(heights, 1.0, material="")
    with pytest.raises(TerrainError, match="material"):
        SphereField([[0, 0, 0]], [1.0], material=3)  # type: ignore[arg-type]


def test_a_rover_on_wide_wheels_stands_on_two_points_a_wheel() -> None:
    sim = Simulation(wide(width=0.15, rounding=0.02))
    sim.step(200)
    wheels = [kind for kind in sim.contacts.kinds if kind == "wheel"]
    assert len(wheels) == 12
    assert sim.wheel_forces[:, 0].sum() == pytest.approx(sim.model.mass * 9.81, rel=1e-2)


def test_cylinders_yield_by_a_hair_unless_they_are_said_to_be_rigid() -> None:
    model = wide(width=0.15, stiffness=None)
    assert model.to_dict()["wheels"][0]["deflection"] == 3e-4
    assert model.wheel_stiffnesses == pytest.approx(np.full(6, model.mass * 9.81 / 6 / 3e-5))
    assert wide(width=0.15, stiffness=0.0).wheel_stiffnesses.tolist() == [0.0] * 6
    description = RoverModel().replace(wheel_stiffness=0.0).to_dict()
    for wheel in description["wheels"]:
        wheel |= {"width": 0.15, "rounding": 0.075}
        del wheel["stiffness"]
    assert RoverModel.from_dict(description).wheel_stiffnesses.tolist() == [0.0] * 6


@pytest.mark.parametrize(
    ("fields", "path"), [({"width": -1.0}, "width"), ({"width": 0.1, "rounding": 0.2}, "rounding")]
)
def test_bad_widths_are_refused_by_name(fields: dict[str, float], path: str) -> None:
    with refused(ModelError, f"wheels[0].{path}"):
        wide(**fields)


SLOPES = (0.13, 0.21)

SLOPE = Plane((-SLOPES[0], 1.0, -SLOPES[1]))

FOUR = ("four-steered", "skid-steered")


def rigid(name: str) -> RoverModel:
    return RoverModel.named(name).replace(wheel_stiffness=0.0)


def yielding(name: str, width: float = 0.08) -> RoverModel:
    return with_fields(RoverModel.named(name), wheels={"width": width})


def tilted_map() -> HeightField:
    """The slope as a map, in single precision."""
    place = np.linspace(-40.0, 40.0, 321)
    x, z = np.meshgrid(place, place)
    return HeightField(SLOPES[0] * x + SLOPES[1] * z, 0.25, (-40.0, -40.0))


def driven(model: RoverModel, ground, time_step: float, seed: int = 1, duration: float = 3.0) -> Simulation:
    """A drive with torques and steering that are drawn anew every half second."""
    sim = Simulation(model, ground, time_step=time_step)
    sim.set_state(model.resting_pose(SLOPE if ground is not None else Plane(), (0.0, 0.0), 0.3))
    draw = np.random.default_rng(seed)
    n, is_steered = len(model.wheel_names), max(model.steering_joint_indices) >= 0
    for _ in range(round(duration / 0.5)):
        sim.set_wheel_torques(np.array(model.wheel_torque_limits) * draw.uniform(0.2, 0.6) * np.ones(n))
        angles = draw.uniform(-0.2, 0.2, n) * np.array([index >= 0 for index in model.steering_joint_indices])
        if is_steered:
            sim.set_steering(angles)
        assert sim.step(round(0.5 / time_step)).is_converged
    return sim


def distance(a: Simulation, b: Simulation) -> float:
    return float(np.linalg.norm(a.q[:3] - b.q[:3]))


@pytest.mark.parametrize("name", RoverModel.names())
def test_a_map_that_is_a_tilted_plane_is_the_plane(name: str) -> None:
    """Rigid wheels end 0.1 to 0.6 m apart on four wheels: single precision errs by 0.2 um."""
    model = RoverModel.named(name)
    plane, field = (driven(model, ground, 0.005) for ground in (SLOPE, tilted_map()))
    assert distance(plane, field) < 1e-3
    np.testing.assert_allclose(plane.wheel_forces[:, 0], field.wheel_forces[:, 0], rtol=0.01, atol=1.0)


def test_rigid_wheels_on_four_points_depend_on_micrometres() -> None:
    """The problem that the stiffness solves. If this fails, rigid wheels no longer need it."""
    ends = [driven(rigid("four-steered"), ground, 0.005) for ground in (SLOPE, tilted_map())]
    assert distance(*ends) > 0.1


@pytest.mark.parametrize("name", FOUR)
def test_two_wheels_turned_by_a_rounded_pi_change_nothing(name: str) -> None:
    """3.14159 for pi in a robot's file left two of four wheels without load."""
    model, turn = RoverModel.named(name), {"rotation": [2.65e-6, 0.0, 0.0]}
    tilted = with_fields(model, {"wheel_FL": turn, "wheel_BR": turn})
    turned, plain = (driven(one, None, 0.005) for one in (tilted, model))
    assert distance(turned, plain) < 1e-3


@pytest.mark.parametrize("name", FOUR)
def test_the_loads_do_not_depend_on_the_step(name: str) -> None:
    """A rover on a rigid chassis parked itself on two wheels at 0.2 ms and on four at 20 ms."""
    found = []
    for step in (0.02, 0.005, 0.001):
        sim = standing(RoverModel.named(name), SLOPE, heading=0.3, time_step=step)
        sim.brake()
        sim.step(round(1.0 / step))
        found.append(sim.wheel_forces[:, 0])
    # While it settles, wheels that bear little slip by micrometres, which depends on the step.
    np.testing.assert_allclose(found, np.tile(found[-1], (3, 1)), rtol=0.05)
    assert np.min(found) > 20.0


def test_wide_wheels_converge() -> None:
    """Two contacts per wheel, as after an import. With rigid wheels, paths at 5 and 1 ms end 0.3 to 0.7 m apart."""
    for name in FOUR:
        ends = [driven(yielding(name), SLOPE, step, seed=3) for step in (0.01, 0.005, 0.001)]
        coarse, fine = distance(ends[0], ends[2]), distance(ends[1], ends[2])
        assert fine < 0.01
        assert fine < 0.7 * coarse + 1e-4


def braced(stiffness: float) -> RoverModel:
    """Six yielding wheels on a pitched body with two bogies: four supports of a rigid body."""
    description = RoverModel.named("open-rover").to_dict()
    for solid in description["solids"]:
        if solid["name"].endswith("_rocker"):
            solid["joint"] = "fixed"
            for option in ("coupled", "limits", "axis"):
                solid.pop(option, None)
        if solid["name"].startswith("steering_F"):
            solid["position"][1] -= 0.006
    for wheel in description["wheels"]:
        wheel |= {"width": 0.06, "stiffness": stiffness, "damping": 0.003 * stiffness}
    return RoverModel.from_dict(description)


def test_a_rigid_body_on_two_bogies_turns_alike_at_every_step() -> None:
    """JPL's Open Source Rover ended 15 mm from Drake's path at 5 ms, and 0.45 m at 0.2 ms with one wheel unloaded."""
    ends, loads = [], []
    for step in (0.02, 0.005, 0.001):
        sim = standing(braced(1e7), time_step=step)
        for k in range(30):
            share = min(1.0, (k + 1) / 10.0)
            angles = [0.2 * share if name.endswith(("FL", "FR")) else 0.0 for name in sim.model.wheel_names]
            sim.set_commands(0.1 * np.ones(6), angles)
            assert sim.step(round(0.1 / step)).is_converged
        ends.append(sim.q[:3])
        loads.append(sim.wheel_forces[:, 0])
    np.testing.assert_allclose(ends, np.tile(ends[-1], (3, 1)), atol=1e-3)
    np.testing.assert_allclose(loads, np.tile(loads[-1], (3, 1)), atol=0.2)
    assert np.linalg.norm(ends[-1][[0, 2]]) > 0.3


@pytest.mark.parametrize("name", FOUR)
def test_a_wheel_yields_by_its_load_over_its_stiffness(name: str) -> None:
    model = RoverModel.named(name)
    sim = standing(model)
    sim.step(400)
    np.testing.assert_allclose(-sim.wheel_gaps, sim.wheel_forces[:, 0] / model.wheel_stiffnesses, rtol=1e-4)
    assert sim.wheel_forces[:, 0].sum() == pytest.approx(9.81 * model.mass, rel=1e-9)
    share = 0.0033 * model.wheel_radii
    assert ((sim.wheel_gaps < -0.3 * share) & (sim.wheel_gaps > -2.0 * share)).all()


@pytest.mark.parametrize("step", [0.005, 0.02])
@pytest.mark.parametrize("stiffness", [1e4, 1e6, 1e8, 1e10, 1e11])
def test_every_stiffness_is_stable_at_every_step(stiffness: float, step: float) -> None:
    """Dropped by 0.1 m: comes to rest, and never has more energy than at the start."""
    model = RoverModel.named("four-steered").replace(wheel_stiffness=stiffness, wheel_damping=0.02 * stiffness)
    sim = standing(model, lift=0.1, time_step=step)
    sim.brake()
    most = sim.energy().total
    for _ in range(round(3.0 / step)):
        report = sim.step()
        assert report.is_converged
        assert sim.energy().total <= most + 1e-6
    assert float(np.abs(sim.v).max()) < 1e-3
    np.testing.assert_allclose(sim.wheel_forces[:, 0].sum(), 9.81 * model.mass, rtol=1e-3)


def test_a_stiff_contact_does_not_bounce_and_a_soft_one_swings_at_its_frequency() -> None:
    def dropped(stiffness: float, step: float, n: int) -> np.ndarray:
        model = RoverModel.named("four-steered").replace(wheel_stiffness=stiffness, wheel_damping=0.0)
        sim = standing(model, lift=0.01 if stiffness > 1e6 else 0.0, time_step=step)
        sim.brake()
        heights = []
        for _ in range(n):
            sim.step()
            heights.append(sim.q[1])
        return np.array(heights)

    stiff = dropped(1e9, 0.005, 60)
    landed = int(np.argmin(stiff))
    assert np.ptp(stiff[landed:]) < 1e-3
    # Set down unloaded it swings about the depth of rest: the first minimum after half a period.
    stiffness = 2e4
    model = RoverModel.named("four-steered")
    soft = dropped(stiffness, 1e-4, 2000)
    omega = math.sqrt(4.0 * stiffness / model.mass)
    assert 1e-4 * (1 + int(np.argmin(soft))) == pytest.approx(math.pi / omega, rel=0.02)
    assert soft[0] - soft.min() == pytest.approx(2.0 * model.mass * 9.81 / (4.0 * stiffness), rel=0.02)


def test_its_limit_is_the_rigid_wheel() -> None:
    """Where equilibrium determines the loads, as on six wheels with rockers, a stiff wheel is a rigid one."""
    stiff = RoverModel().replace(wheel_stiffness=1e11)
    ends = [driven(model, SLOPE, 0.005, duration=2.0) for model in (rigid("rover"), stiff)]
    assert distance(*ends) < 1e-4
    np.testing.assert_allclose(ends[0].wheel_forces[:, 0], ends[1].wheel_forces[:, 0], rtol=1e-3)


def test_parked_on_a_slope_it_does_not_creep() -> None:
    model = RoverModel.named("skid-steered")
    sim = standing(model, SLOPE, heading=0.3)
    sim.brake()
    sim.step(400)
    start = sim.q
    sim.step(2000)
    assert float(np.abs(sim.q - start).max()) < 1e-9


@pytest.mark.parametrize("name", FOUR)
@pytest.mark.parametrize("depth", [0.0, 0.02])
def test_what_no_force_has_pressed_in_is_not_given_back(name: str, depth: float) -> None:
    """A rover set 2 cm into the ground was shot up by 2 kJ; landings gave 100 J."""
    model = RoverModel.named(name)
    sim = standing(model, lift=-depth if depth else 0.3, stabilisation="none")
    start, given = sim.energy().total, 0.0
    for _ in range(300):
        before = sim.energy().total
        report = sim.step()
        given += report.energy_released
        change = report.energy_released - report.energy_dissipated - report.energy_lost - report.energy_removed
        assert sim.energy().total - before == pytest.approx(change, abs=1e-9 * model.mass)
        assert sim.energy().total < start + 1.0
        # What each wheel holds that bears all of the weight, no more.
        load = 9.81 * model.mass
        assert given < 1.01 * (0.5 * load**2 / model.wheel_stiffnesses).sum()
    assert given != 0.0


def test_the_report_says_when_loads_are_undetermined() -> None:
    def count(model: RoverModel) -> int:
        sim = standing(model)
        return sim.step(50).undetermined_loads

    assert count(rigid("rover")) == 6
    assert count(RoverModel()) == 0
    for name in FOUR:
        assert count(rigid(name)) == 4
        assert count(RoverModel.named(name)) == 0
    assert count(yielding("four-steered").replace(wheel_stiffness=0.0)) == 8
    assert count(yielding("four-steered")) == 0


def test_a_step_that_is_split_counts_the_loads_of_its_last_part() -> None:
    """The list of contacts is longer than the last problem if two parts of the step touched different rocks."""
    draw = np.random.default_rng(0)
    n = 300
    centres = np.column_stack((draw.uniform(-2.0, 6.0, n), np.full(n, -0.06), draw.uniform(-1.0, 1.0, n)))
    sim = placed(Simulation(RoverModel(), SphereField(centres, [0.1] * n, Plane())), y=0.3)
    sim.step(100)
    longer = 0
    for k in range(100):
        v = sim.v
        v[[0, 3, 5]] = 3.0, 130.0 * (-1) ** k, 100.0
        sim.set_state(sim.q, v)
        assert sim.step().undetermined_loads >= 0
        longer += len(sim.contacts.impulses) > len(sim.last_problem()[2])
    assert longer > 0


@pytest.mark.parametrize(
    ("change", "field"),
    [
        ({"wheel_stiffness": -1.0}, r"wheels\[0\].stiffness"),
        ({"wheel_stiffness": math.nan}, r"wheels\[0\].stiffness"),
        ({"wheel_stiffness": 1e13}, r"wheels\[0\].stiffness"),
        ({"wheel_damping": -1.0}, r"wheels\[0\].damping"),
        ({"wheel_stiffness": 0.0, "wheel_damping": 1.0}, r"wheels\[0\].damping"),
    ],
)
def test_a_wrong_stiffness_or_damping_is_refused(change: dict[str, float], field: str) -> None:
    with pytest.raises(ModelError, match=field):
        RoverModel.named("four-steered").replace(**change)
