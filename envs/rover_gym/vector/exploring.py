"""Measures the physics of a batch of rovers whose policy explores, beside MuJoCo where it is installed.

Torques and set-points of the steering are redrawn every ten steps of 5 ms. Every engine gets the same rovers, grounds,
starts, commands and threads, in short rounds one after the other; the median round of each counts.
"""

import platform
import statistics
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from rover_gym.env.rover_env import RoverEnv
from rover_gym.env.start import tilted_plane
from rover_gym.mechanics import Simulation, SimulationBatch
from rover_gym.vector.mujoco_rover import rover_xml

Array = npt.NDArray[np.float64]
Ground = Literal["plane", "rocks"]

TIME_STEP = 0.005  # s
#: Steps from one command to the next, commands of a round, and rounds that are not measured.
STEPS_A_COMMAND, COMMANDS, WARM_UP = 10, 10, 1
#: Names of MuJoCo's settings, with integrator, cone and impratio. The second has the friction of rigid contacts,
#: nearly; with it the integrator `discrete` is both the most accurate and the fastest.
MUJOCO = {
    "MuJoCo, defaults": ("mjINT_IMPLICITFAST", "mjCONE_PYRAMIDAL", 1.0),
    "MuJoCo, elliptic cone, impratio 100": ("mjINT_DISCRETE", "mjCONE_ELLIPTIC", 100.0),
}
#: Height by which a rover is raised until nothing overlaps, m, and steps that it has to come to rest, braked.
LIFT, LANDING = 0.005, 200


@dataclass(frozen=True)
class ExploringSpeed:
    """How fast rovers explore on one ground.

    Attributes:
        ground: "plane" or "rocks".
        num_envs: Number of rovers.
        threads: Threads that step them.
        instruction_set: Of the processor, as far as the core uses it.
        torque: Largest torque, N m.
        rover_steps: Rover-steps per second, steps of `TIME_STEP` of one rover, by engine.
    """

    ground: Ground
    num_envs: int
    threads: int
    instruction_set: str
    torque: float
    rover_steps: dict[str, float]

    @property
    def simulated(self) -> dict[str, float]:
        """Simulated seconds per second, all rovers together, by engine."""
        return {engine: TIME_STEP * rate for engine, rate in self.rover_steps.items()}


def measure_exploring(
    num_envs: int = 64,
    threads: int | None = None,
    *,
    ground: Ground = "plane",
    torque: float = 60.0,
    rounds: int = 10,
    progress: Callable[[], object] = lambda: None,
) -> ExploringSpeed:
    """Times a batch of exploring rovers, and MuJoCo's rollout of the same.

    Among rocks each rover has its own field of difficulty 0.5, as `Rover-v0` draws it, and starts halfway to its goal:
    the clearing at the environment's start has no rocks.

    Args:
        num_envs: Number of rovers.
        threads: Threads; None for one per core.
        ground: What they drive on.
        torque: Largest torque, N m.
        rounds: Measured rounds, of 100 steps each.
        progress: Called after each round.
    """
    env = RoverEnv(terrain=ground)
    simulations = [_rover(env, seed) for seed in range(num_envs)]
    batch = SimulationBatch(simulations, threads=threads)
    engines: dict[str, Callable[[Array], None]] = {"rover-gym": _ours(batch)}
    engines |= _mujoco(simulations, batch.threads)
    limit = simulations[0].model.steering_limit
    rng = np.random.default_rng(0)
    seconds: dict[str, list[float]] = {name: [] for name in engines}
    for _ in range(rounds + WARM_UP):
        commands = rng.uniform(-1.0, 1.0, (COMMANDS, num_envs, 12)) * np.repeat([torque, limit], 6)
        for name, play in engines.items():
            start = time.perf_counter()
            play(commands)
            seconds[name].append(time.perf_counter() - start)
        progress()
    steps = num_envs * COMMANDS * STEPS_A_COMMAND
    return ExploringSpeed(
        ground=ground,
        num_envs=num_envs,
        threads=batch.threads,
        instruction_set=batch.instruction_set,
        torque=torque,
        rover_steps={name: steps / statistics.median(times[WARM_UP:]) for name, times in seconds.items()},
    )


def processor() -> str:
    """What the machine calls its processor."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
        return next(line.split(":", 1)[1].strip() for line in lines if line.startswith("model name"))
    except (OSError, StopIteration):
        return platform.processor() or platform.machine()


def _rover(env: RoverEnv, seed: int) -> Simulation:
    """A rover at rest on the ground of an episode, its wheels braked until the first command."""
    env.reset(seed=seed)
    terrain, start = env.simulation.terrain, env.start
    place, plane = start.position, tilted_plane(start.slope, start.uphill)
    if env.rocks is not None:
        place = (0.5 * (place[0] + env.goal[0]), 0.5 * (place[1] + env.goal[1]))
    q = env.model.resting_pose(plane, place, start.heading)
    simulation = Simulation(env.model, terrain, time_step=TIME_STEP)
    simulation.set_state(q)
    while simulation.deepest_overlap < -LIFT:
        q[1] += LIFT
        simulation.set_state(q)
    simulation.brake()
    simulation.step(LANDING)
    return simulation


def _ours(batch: SimulationBatch) -> Callable[[Array], None]:
    def play(commands: Array) -> None:
        for command in commands:
            batch.step(command[:, :6], command[:, 6:], STEPS_A_COMMAND)

    return play


def _mujoco(simulations: list[Simulation], threads: int) -> dict[str, Callable[[Array], None]]:
    """MuJoCo's rollout of the same rovers, by setting; empty where MuJoCo is not installed."""
    try:
        import mujoco  # noqa: PLC0415 - not a dependency
        from mujoco import rollout  # noqa: PLC0415
    except ImportError:
        return {}
    models = [mujoco.MjModel.from_xml_string(text) for text in _descriptions(simulations)]
    datas = [mujoco.MjData(models[0]) for _ in range(threads)]
    whole = mujoco.mjtState.mjSTATE_FULLPHYSICS.value
    start = np.stack([_state(mujoco, model, one, whole) for model, one in zip(models, simulations, strict=True)])
    drives, holds, signs = _actuators(models[0], simulations[0])
    pool = rollout.Rollout(nthread=threads)

    def player(integrator: str, cone: str, impratio: float) -> Callable[[Array], None]:
        states = start.copy()

        def play(commands: Array) -> None:
            for model in models:
                model.opt.integrator = getattr(mujoco.mjtIntegrator, integrator)
                model.opt.cone, model.opt.impratio = getattr(mujoco.mjtCone, cone), impratio
            control = np.empty((len(models), len(commands), models[0].nu))
            control[:, :, drives] = signs * commands[:, :, :6].transpose(1, 0, 2)
            control[:, :, holds] = commands[:, :, 6:].transpose(1, 0, 2)
            control = np.repeat(control, STEPS_A_COMMAND, axis=1)
            after, _ = pool.rollout(models, datas, states, control)
            states[:] = after[:, -1]

        return play

    return {name: player(*setting) for name, setting in MUJOCO.items()}


def _descriptions(simulations: list[Simulation]) -> list[str]:
    """The rovers in MuJoCo's XML. A rollout wants equally large models: fields of fewer rocks get some far below."""
    machine = simulations[0].model.to_dict()
    grounds = []
    for simulation in simulations:
        terrain: Any = simulation.terrain
        has_rocks = hasattr(terrain, "centres")
        spheres = np.column_stack([terrain.centres, terrain.radii]) if has_rocks else np.zeros((0, 4))
        grounds.append((tuple((terrain.ground if has_rocks else terrain).normal), spheres))
    most = max(len(spheres) for _, spheres in grounds)
    texts = []
    for normal, spheres in grounds:
        below = np.tile([0.0, -100.0, 0.0, 0.1], (most - len(spheres), 1))
        texts.append(
            rover_xml(
                machine,
                time_step=TIME_STEP,
                normal=normal,
                spheres=np.concatenate([spheres, below]),
                thin_wheels=most > 0,
            )
        )
    return texts


def _state(mujoco: Any, model: Any, simulation: Simulation, whole: int) -> Array:
    """The rover's start as MuJoCo's state."""
    data = mujoco.MjData(model)
    data.qpos[:3] = simulation.q[:3]
    mujoco.mju_mat2Quat(data.qpos[3:7], simulation.rotation.ravel())
    for i, solid in enumerate(simulation.model.to_dict()["solids"][1:]):
        data.qpos[model.joint(solid["name"]).qposadr[0]] = simulation.q[6 + i]
    state = np.empty(mujoco.mj_stateSize(model, whole))
    mujoco.mj_getState(model, data, state, whole)
    return state


def _actuators(model: Any, simulation: Simulation) -> tuple[list[int], list[int], Array]:
    """Places of the drives and of the steering in the control, and the signs of the drives, by wheel."""
    wheels = simulation.model.to_dict()["wheels"]
    drives = [model.actuator(f"drive{i}").id for i in range(len(wheels))]
    holds = [model.actuator(f"hold_{wheel['steering']}").id for wheel in wheels]
    return drives, holds, np.array([wheel["drive_sign"] for wheel in wheels])
