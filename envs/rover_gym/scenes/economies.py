"""Measures the error and the saving of each economy of a plan, by the same drive with and without it."""

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from rover_gym.core import Simulation
from rover_gym.scenes.scene_plan import PlannedRover, ScenePlan

#: Interval between comparisons of the trunk's position, s.
SAMPLE = 0.1
#: PD gains nearly as stiff as a weld, N m/rad and N m s/rad.
RIGID = 1e9


@dataclass(frozen=True)
class Economy:
    """One economy of a plan, compared with the same drive without it.

    Attributes:
        name: The part that was left out or replaced by a cheaper one.
        before: CPU time without the economy, microseconds per step.
        after: CPU time with the economy, microseconds per step.
        error: Largest distance between the trunk positions of the two drives, m.
        bound: The plan's bound on the error, m; None without a bound.
    """

    name: str
    before: float
    after: float
    error: float
    bound: float | None

    @property
    def ratio(self) -> float:
        """Ratio of the CPU time with the economy to that without."""
        return self.after / self.before


def measure_economies(
    plan: ScenePlan,
    *,
    torque: float = 15.0,
    duration: float = 10.0,
    repeats: int = 5,
    progress: Callable[[float], None] = lambda _: None,
) -> list[Economy]:
    """Drives a plan's scene straight, with and without each economy that applies.

    The drives alternate, `repeats` times, and the least CPU time of each counts. Other load on the machine then
    affects them alike.

    Args:
        plan: The plan to measure.
        torque: Torque of every wheel, N m.
        duration: Simulated time of each drive, s.
        repeats: Runs of each drive.
        progress: Called with the fraction done.

    Raises:
        StepError: A step could not be taken.
    """
    variants, pairs = _pairs(plan)
    cost = dict.fromkeys(variants, np.inf)
    paths: dict[str, npt.NDArray[np.float64]] = {}
    for turn in range(repeats):
        for i, (name, make) in enumerate(variants.items()):
            spent, paths[name] = _drive(make(), torque, duration)
            cost[name] = min(cost[name], spent)
            progress((turn + (i + 1) / len(variants)) / repeats)

    def economy(name: str, before: str, after: str, bound: float | None) -> Economy:
        error = float(np.linalg.norm(paths[before] - paths[after], axis=1).max())
        return Economy(name, cost[before], cost[after], error, bound)

    return [economy(*pair) for pair in pairs]


def _pairs(
    plan: ScenePlan,
) -> tuple[Mapping[str, Callable[[], PlannedRover]], list[tuple[str, str, str, float | None]]]:
    """Returns rover factories by name, and for each economy its label, the two rovers to compare and its bound."""
    bounds = {decision.part: decision.error for decision in plan.decisions}
    full = replace(plan, kind="full", model=plan.scene.model)
    welded = replace(plan, kind="welded")
    variants: dict[str, Callable[[], PlannedRover]] = {"built": plan.rover}
    pairs: list[tuple[str, str, str, float | None]] = []
    if plan.kind != "full":
        variants["full"] = full.rover
        variants["rigid"] = lambda: _rigid(full)
        after = "built"
        if plan.kind == "planar":
            variants["welded"] = welded.rover
            after = "welded"
        pairs.append(("steering welded, against the PD", "full", after, bounds["steering"]))
        pairs.append(("steering welded, against a rigid PD", "rigid", after, bounds["steering"]))
    if plan.kind == "planar":
        pairs.append(("planar, against welded", "welded", "built", bounds["base"]))
    if plan.terrain is not plan.scene.terrain:
        variants["all spheres"] = replace(welded if plan.kind == "planar" else plan, terrain=plan.scene.terrain).rover
        pairs.append(
            ("spheres left out", "all spheres", "welded" if plan.kind == "planar" else "built", bounds["ground"])
        )
    if plan.options["variant"] == "linearised":
        variants["newton"] = replace(plan, options={**plan.options, "variant": "newton"}).rover
        pairs.append(("linearised, against Newton scheme", "newton", "built", bounds["scheme"]))
    variants["newton solver"] = replace(plan, options={**plan.options, "solver": "newton"}).rover
    pairs.append(("solver auto, against Newton always", "newton solver", "built", None))
    if plan.kind != "full":
        pairs.append(("all of the model's", "full", "built", plan.error))
    return variants, pairs


def _rigid(full: ScenePlan) -> PlannedRover:
    rover = full.rover()
    model = full.scene.model
    joints = [model.dof_names[i] for i in model.steering_joint_indices if i >= 0]
    if isinstance(rover.simulation, Simulation):
        rover.simulation.hold(joints, np.zeros(len(joints)), stiffness=RIGID, damping=RIGID)
    return rover


def _drive(rover: PlannedRover, torque: float, duration: float) -> tuple[float, npt.NDArray[np.float64]]:
    """Returns the CPU time, microseconds per step, and the trunk's positions `(n, 3)`, m."""
    rover.set_wheel_torques(np.full(len(rover.plan.scene.model.wheel_names), torque))
    stride = max(1, round(SAMPLE / rover.simulation.time_step))
    rows = max(1, round(duration / SAMPLE))
    path = np.empty((rows, 3))
    spent = 0.0
    for row in range(rows):
        begin = time.process_time()
        rover.step(stride)
        spent += time.process_time() - begin
        path[row] = rover.q[:3]
    return 1e6 * spent / (rows * stride), path
