"""The largest errors of `docs/economy.md`, over many drives: `python -m comparison.economy_bounds` (two minutes).

Largest distance of the trunk (m) between the rover as a plan builds it and without one of its economies.
"""

import itertools
import math
from collections.abc import Callable

import numpy as np
import numpy.typing as npt
from rich.console import Console

from rover_gym import Plane, RoverModel, Simulation, SphereField
from rover_gym.scenes import Scene, measure_economies, plan

Array = npt.NDArray[np.float64]
SLOPES = (0.0, 5.0, -10.0, -20.0)  # degrees, along the heading
ACROSS = ((10.0, 90.0), (20.0, 90.0), (10.0, 45.0))  # slope and heading, degrees
TORQUES = (15.0, 45.0)  # N m
SEEDS = (1, 2)
WAY = 15.0  # m driven over rocks


def planes(accuracy: str) -> dict[str, float]:
    """Largest error of each economy over slopes and torques, 10 s each."""
    worst: dict[str, float] = {}
    cases = [(slope, 0.0) for slope in SLOPES] + list(ACROSS)
    for (slope, heading), torque in itertools.product(cases, TORQUES):
        plane = Plane.tilted(math.radians(slope), 0.0)
        scene = Scene(plane, heading=math.radians(heading), steered=False, equal_torques=True)
        for economy in measure_economies(plan(scene, accuracy), torque=torque, repeats=1):  # type: ignore[arg-type]
            worst[economy.name] = max(worst.get(economy.name, 0.0), economy.error)
    return worst


def _welded(model: RoverModel) -> RoverModel:
    return model.weld([model.dof_names[i] for i in model.steering_joint_indices if i >= 0])


def _simulation(model: RoverModel, ground: Plane | SphereField, q: Array, **options: str) -> Simulation:
    """A rover of a model, or of it with fewer joints, at public coordinates (21,) of the full one."""
    simulation = Simulation(model, ground, **options)  # type: ignore[arg-type]
    names = RoverModel().dof_names
    simulation.set_state(q[[names.index(name) for name in model.dof_names]])
    return simulation


def _path(simulation: Simulation, torque: float, stop: Callable[[Array], bool]) -> tuple[Array, float]:
    """(n, 3) places every 0.1 s, and the largest angle of a steering joint, rad."""
    simulation.set_wheel_torques([torque] * 6)
    joints = [i for i in simulation.model.steering_joint_indices if i >= 0]
    path, widest = [simulation.q[:3]], 0.0
    while not stop(simulation.q) and simulation.time < 60.0:
        simulation.step(round(0.1 / simulation.time_step))
        path.append(simulation.q[:3])
        widest = max(widest, float(np.abs(simulation.q[joints]).max(initial=0.0)))
    return np.array(path), widest


def _apart(path: Array, other: Array) -> float:
    n = min(len(path), len(other))
    return float(np.linalg.norm(path[:n] - other[:n], axis=1).max())


def rocks(console: Console) -> None:
    """Steering welded, and the Newton scheme, over rocks."""
    model = RoverModel()
    for seed in SEEDS:
        clear = np.array([(0.0, 0.0, 4.5)])
        field = SphereField.rocks(0.1, (-4.0, -4.0, 26.0, 4.0), seed, max_diameter=0.2, ground=Plane(), clear=clear)
        q = model.resting_pose(Plane(), (0.0, 0.0), 0.0)
        runs = {
            "": _simulation(model, field, q),
            "steering welded": _simulation(_welded(model), field, q),
            "Newton scheme": _simulation(model, field, q, variant="newton"),
        }
        paths = {name: _path(run, 15.0, lambda q: q[0] > WAY) for name, run in runs.items()}
        for name in ("steering welded", "Newton scheme"):
            found = _apart(paths[""][0], paths[name][0])
            angle = paths[""][1]
            console.print(
                f"rocks, seed {seed}, {WAY:g} m: {name}: {found:.2g} m (steering turns by up to {angle:.2f} rad)"
            )


def landing(console: Console) -> None:
    """Steering welded, dropped on one side from 0.45 m."""
    model = RoverModel()
    q = np.zeros(21)
    q[1], q[3] = 0.35 + 0.45, 0.2
    paths = [_path(_simulation(m, Plane(), q), 0.0, lambda _: False)[0][:50] for m in (model, _welded(model))]
    console.print(f"landing on one side from 0.45 m: steering welded: {_apart(*paths):.2g} m")


def main() -> None:
    """Prints all of them."""
    console = Console(width=160, highlight=False)
    for accuracy in ("balanced", "fast"):
        for name, error in planes(accuracy).items():
            console.print(f"planes, {accuracy}: {name}: {error:.1e} m")
    rocks(console)
    landing(console)


if __name__ == "__main__":
    main()
