"""Plans: omit what a scene excludes, within the stated error, and refuse commands that need it."""

import math
from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pytest
from refusals import refused
from rovers import with_fields

from rover_gym import (
    CommandError,
    HeightField,
    OptionError,
    Plane,
    RoverModel,
    Simulation,
    SphereField,
    StateError,
    StepError,
    TerrainError,
    Union,
)
from rover_gym.core import MirroredRoverSimulation, SimulationBatch
from rover_gym.scenes import Scene, ScenePlan, measure_economies, plan
from rover_gym.scenes.scene_plan import Accuracy

PARTS = ["ground", "steering", "base", "scheme", "contact solver", "step", "steps", "in a batch"]


RIGID = RoverModel().replace(wheel_stiffness=0.0)


def straight(terrain: Plane | SphereField | None = None, **facts: object) -> Scene:
    facts.setdefault("model", RIGID)
    return Scene(terrain or Plane(), steered=False, equal_torques=True, **facts)  # type: ignore[arg-type]


def path(made: ScenePlan, *, torque: float = 15.0, duration: float = 10.0) -> npt.NDArray[np.float64]:
    """(n, 21) coordinates every 0.1 s of a drive straight ahead."""
    rover = made.rover()
    rover.set_wheel_torques(np.full(6, torque))
    rows = []
    for _ in range(round(duration / 0.1)):
        assert rover.step(round(0.1 / rover.simulation.time_step)).is_converged
        rows.append(rover.q)
    return np.array(rows)


def full(made: ScenePlan) -> ScenePlan:
    return replace(made, kind="full", model=made.scene.model)


def test_a_scene_that_excludes_nothing_gets_the_whole_model() -> None:
    made = plan(Scene())
    assert made.kind == "full"
    assert made.model.nv == 21
    assert [row["part"] for row in made.explain()] == PARTS
    assert all(row["built"] and row["reason"] for row in made.explain())


@pytest.mark.parametrize(
    ("facts", "kind"),
    [
        ({"steered": False}, "welded"),
        ({"steered": False, "equal_torques": True}, "planar"),
        ({"steered": True, "equal_torques": True}, "full"),
        ({"steered": False, "equal_torques": True, "held": True}, "welded"),
        ({"steered": False, "equal_torques": True, "tumbles": True}, "welded"),
        ({"steered": False, "equal_torques": True, "terrain": Plane.tilted(0.1, 0.5)}, "welded"),
        ({"steered": False, "equal_torques": True, "terrain": Plane.tilted(0.1, 0.5), "heading": 0.5}, "planar"),
        ({"steered": False, "equal_torques": True, "terrain": SphereField.rocks(0.1, (-3, -3, 3, 3), 1)}, "full"),
    ],
)
def test_only_what_is_excluded_is_left_out(facts: dict[str, object], kind: str) -> None:
    made = plan(Scene(model=RIGID, **facts))  # type: ignore[arg-type]
    assert made.kind == kind
    assert [row["part"] for row in made.explain()] == PARTS
    simulation = made.simulation()
    assert isinstance(simulation, MirroredRoverSimulation) == (kind == "planar")
    assert len(simulation.v) == {"full": 21, "welded": 15, "planar": 7}[kind]


def test_any_ground_is_planned() -> None:
    hills = HeightField.fractal(12.0, 0.25, 0.05, seed=1)
    rocks = SphereField.rocks(0.05, hills.bounds, 1, ground=hills, clear=[[0.0, 0.0, 2.0]])
    for terrain, built in (
        (hills, "map of 49 x 49 heights"),
        (Union([hills, rocks]), f"map of 49 x 49 heights and {len(rocks)} spheres in a ball tree"),
    ):
        made = plan(Scene(terrain, steered=False, equal_torques=True))
        assert made.kind == "full"
        assert made.decisions[0].built == built
        assert made.decisions[-1].built == "RoverVectorEnv with this terrain"
        gaps = made.model.wheel_gaps(made.start, terrain)
        assert gaps.min() > -1e-9
        assert made.rover().step(20).is_converged


def test_a_rover_that_cannot_steer_is_not_said_to() -> None:
    made = plan(Scene(model=RoverModel.named("skid-steered"), steered=False, equal_torques=True))
    assert made.kind == "full"
    assert "no mirror image" in made.decisions[2].reason


def test_nothing_is_welded_where_wheels_may_turn_by_themselves() -> None:
    start = RoverModel().resting_pose(Plane(), (2.0, 1.0), 0.3)
    assert plan(straight(start=start)).kind == "planar"
    dropped = start.copy()
    dropped[1] += 0.01
    assert plan(straight(start=dropped)).kind == "full"
    lopsided = start.copy()
    lopsided[11] = 0.1  # the left bogie alone
    assert plan(straight(start=lopsided)).kind == "full"
    trailing = plan(straight(model=with_fields(RIGID, {"wheel_ML": {"position": [0.02, -0.15, 0.0]}})))
    assert trailing.kind == "full"
    assert "beside their steering axes" in trailing.decisions[1].reason


def decided(scene: Scene, part: str) -> tuple[str, str]:
    return next((row["built"], row["reason"]) for row in plan(scene).explain() if row["part"] == part)


def test_a_plan_says_which_steps_are_fast() -> None:
    width = SimulationBatch([Simulation()])
    lanes = Simulation().lanes
    for scene in (Scene(), Scene(SphereField.rug(), start=np.zeros(21)), Scene(steered=False)):
        built, _ = decided(scene, "steps")
        assert built.startswith("fast: in lanes")
        assert width.instruction_set in built
        assert lanes == 1 or f"{lanes} rovers to a register" in built
    for scene, why in (
        (Scene(tumbles=True), 'variant is "newton"'),
        (straight(), "planar"),
    ):
        built, reason = decided(scene, "steps")
        assert built.startswith("general")
        assert why in reason


def test_a_plan_says_what_a_batch_leaves_out() -> None:
    assert decided(Scene(), "in a batch")[0] == "RoverVectorEnv with its defaults"
    assert decided(Scene(steered=False), "in a batch")[0] == "RoverVectorEnv with steered False"
    rocks = SphereField(np.array([(3.0, 0.0, 0.0)]), np.array([0.1]), Plane())
    assert "rocks" in decided(Scene(rocks), "in a batch")[0]
    assert decided(Scene(rocks, reach=0.5), "in a batch")[0] == "RoverVectorEnv with its defaults"


@pytest.mark.parametrize("slope", [0.0, 5.0, -10.0])
@pytest.mark.parametrize("planar", [False, True])
@pytest.mark.parametrize(("accuracy", "most"), [("balanced", 2e-6), ("fast", 1e-5)])
def test_a_straight_drive_is_the_full_models_within_the_stated_error(
    slope: float, planar: bool, accuracy: Accuracy, most: float
) -> None:
    made = plan(straight(Plane.tilted(math.radians(slope), 0.0)), accuracy, planar=planar)
    assert made.kind == ("planar" if planar else "welded")
    ours, whole = path(made), path(full(made))
    assert np.linalg.norm(whole[-1, :3] - whole[0, :3]) > 1.0
    distance = np.linalg.norm(ours[:, :3] - whole[:, :3], axis=1).max()
    assert distance < made.error < most


def test_the_planar_image_is_put_where_the_full_rover_is_on_a_diagonal() -> None:
    scene = straight(Plane.tilted(0.1, -0.7), heading=-0.7)
    planar, welded = plan(scene), plan(scene, planar=False)
    assert (planar.kind, welded.kind) == ("planar", "welded")
    ours, whole = path(planar, duration=5.0, torque=25.0), path(welded, duration=5.0, torque=25.0)
    assert whole[-1, 2] > 1.0
    assert np.abs(ours - whole).max() < 1e-6


def test_what_was_left_out_is_refused() -> None:
    rover = plan(straight()).rover()
    rover.set_steering(np.zeros(6))
    with refused(CommandError, "steering", "without steering"):
        rover.set_steering([0.1, 0.1, 0.0, 0.0, 0.0, 0.0])
    with refused(CommandError, "torques", "equal torques"):
        rover.set_wheel_torques([10.0, 11.0, 10.0, 10.0, 10.0, 10.0])
    with pytest.raises(CommandError, match="6 numbers"):
        rover.set_wheel_torques([10.0] * 3)
    welded = plan(straight(), planar=False).rover()
    welded.set_wheel_torques([10.0, 11.0, 10.0, 10.0, 10.0, 10.0])
    with pytest.raises(CommandError, match="without steering"):
        welded.set_steering(np.full(6, 0.1))
    whole = plan(Scene()).rover()
    whole.set_steering(np.full(6, 0.1))
    assert isinstance(whole.simulation, Simulation)
    assert whole.simulation.steering == pytest.approx(0.1)


def test_a_planar_rover_that_tips_over_says_so() -> None:
    made = plan(straight(model=RIGID.replace(motor=None)))
    start = made.start.copy()
    start[1] += 2.0
    rover = replace(made, start=start).rover()
    rover.set_wheel_torques(np.full(6, 150.0))  # in the air, the motors turn the trunk
    with refused(StepError, "pitch", "planar model does not include"):
        tuple(rover.step(10) for _ in range(40))


def test_spheres_that_cannot_be_met_are_left_out() -> None:
    centres = np.array([[0.5, -0.3, 0.0], [2.0, 0.0, 0.0], [30.0, 0.0, 0.0]])
    field = SphereField(centres, [0.2, 0.1, 0.3], Plane())
    assert len(plan(Scene(field)).terrain) == 2  # type: ignore[arg-type]
    near = plan(Scene(field, reach=5.0)).terrain
    assert len(near) == 1
    flat = plan(Scene(field, reach=0.2))
    assert isinstance(flat.terrain, Plane)
    assert "1 are under the plane, 2 out of reach" in flat.decisions[0].reason
    # Nothing was met, so nothing changes: bit for bit.
    ours, whole = (path(replace(flat, terrain=terrain), duration=0.5) for terrain in (flat.terrain, flat.scene.terrain))
    assert np.array_equal(ours, whole)
    everything = SphereField.rocks(0.1, (-3, -3, 3, 3), 1)
    assert len(plan(Scene(everything)).terrain) == len(everything)  # type: ignore[arg-type]


def test_a_rover_that_leaves_the_reach_it_was_planned_with_says_so() -> None:
    rover = plan(straight(reach=0.5)).rover()
    rover.set_wheel_torques(np.full(6, 30.0))
    rover.step(100)
    with refused(StepError, "reach", "left the planned reach"):
        rover.step(400)


def test_newton_is_built_where_it_pays() -> None:
    assert plan(straight(), "reference").options["variant"] == "linearised"
    assert plan(Scene(tumbles=True), "fast").options["variant"] == "newton"
    assert plan(Scene(), "fast").options["time_step"] == 0.02


@pytest.mark.parametrize(
    ("scene", "accuracy", "error", "field"),
    [
        (Scene(reach=-1.0), "balanced", OptionError, "reach"),
        (Scene(heading=math.nan), "balanced", OptionError, "heading"),
        (Scene(options={"friction": -1.0}), "balanced", OptionError, "friction"),
        (Scene(), "best", OptionError, "accuracy"),
        (Scene(start=np.zeros(20)), "balanced", StateError, "start"),
        (Scene(start=np.full(21, np.nan)), "balanced", StateError, "start[0]"),
        (Scene(SphereField.rug()), "balanced", TerrainError, "terrain"),
        (Scene(SphereField.rug(), start=np.zeros(21), reach=0.1), "balanced", None, None),
        (Scene(SphereField.rug(), start=np.full(21, 50.0), reach=0.1), "balanced", OptionError, "reach"),
        (Scene(Plane((1.0, 0.0, 0.0))), "balanced", TerrainError, "terrain"),
    ],
)
def test_a_scene_that_cannot_be_is_refused(
    scene: Scene, accuracy: str, error: type[Exception] | None, field: str | None
) -> None:
    if error is None:
        assert plan(scene, accuracy).kind == "full"  # type: ignore[arg-type]
        return
    with refused(error, field):
        plan(scene, accuracy)  # type: ignore[arg-type]


def test_turned_wheels_at_the_start_contradict_a_scene_without_steering() -> None:
    start = np.zeros(21)
    start[7] = 0.1
    with refused(OptionError, "steered", "wheels are turned at the start"):
        plan(straight(start=start))


def test_a_rover_that_is_not_its_mirror_image_is_no_planar_one() -> None:
    model = RIGID.replace(masses={"left_bogie": 60.0})
    made = plan(straight(model=model))
    assert made.kind == "welded"
    assert "left_bogie" in next(d.reason for d in made.decisions if d.part == "base")


def test_wheels_that_yield_have_no_planar_image() -> None:
    """The planar image has rigid wheels: a straight drive ended 3 mm from that of the gallery's rover."""
    made = plan(straight(model=RoverModel()))
    assert made.kind == "welded"
    assert "yield" in next(d.reason for d in made.decisions if d.part == "base")


def test_every_economy_is_measured_against_its_bound() -> None:
    economies = {e.name: e for e in measure_economies(plan(straight()), duration=2.0, repeats=1)}
    for name in ("steering welded, against the PD", "planar, against welded", "all of the model's"):
        economy = economies[name]
        assert economy.error < economy.bound
        assert economy.before > 0.0
        assert economy.after > 0.0
        assert economy.ratio == economy.after / economy.before
