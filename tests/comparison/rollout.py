"""Exploring rovers beside MuJoCo's rollout of the same: `python -m comparison.rollout [--rovers N] [--threads N]`."""

import argparse
from importlib import metadata
from typing import Any

import mujoco
import numpy as np
from mujoco import rollout

from comparison.mujoco_rover import rover_xml
from comparison.scene import Array
from rover_gym import Simulation
from rover_gym.vector.throughput import STEPS_A_COMMAND, TIME_STEP, Player, measure_exploring, processor

#: Names of MuJoCo's settings, with integrator, cone and impratio. The second has the friction of rigid contacts,
#: nearly; with it the integrator `discrete` is both the most accurate and the fastest.
MUJOCO = {
    "MuJoCo, defaults": ("mjINT_IMPLICITFAST", "mjCONE_PYRAMIDAL", 1.0),
    "MuJoCo, elliptic cone, impratio 100": ("mjINT_DISCRETE", "mjCONE_ELLIPTIC", 100.0),
}


def players(simulations: list[Simulation], threads: int) -> dict[str, Player]:
    """MuJoCo's rollout of the same rovers, by setting."""
    models = [mujoco.MjModel.from_xml_string(text) for text in _descriptions(simulations)]
    datas = [mujoco.MjData(models[0]) for _ in range(threads)]
    whole = mujoco.mjtState.mjSTATE_FULLPHYSICS.value
    start = np.stack([_state(model, one, whole) for model, one in zip(models, simulations, strict=True)])
    drives, holds, signs = _actuators(models[0], simulations[0])
    pool = rollout.Rollout(nthread=threads)

    def player(integrator: str, cone: str, impratio: float) -> Player:
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


def _state(model: Any, simulation: Simulation, whole: int) -> Array:
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


def main() -> None:
    """Measures and prints."""
    parser = argparse.ArgumentParser(description="Exploring rovers beside MuJoCo's rollout.")
    parser.add_argument("--rovers", type=int, default=64)
    parser.add_argument("--threads", type=int)
    given = parser.parse_args()
    print(f"{processor()}; rover-gym {metadata.version('rover-gym')}, MuJoCo {metadata.version('mujoco')}")  # noqa: T201
    for ground in ("plane", "rocks"):
        told = measure_exploring(given.rovers, given.threads, ground=ground, beside=players)
        for engine, rate in told.rover_steps.items():
            print(f"{ground:<6} {engine:<38}{rate:>12.0f} rover-steps/s")  # noqa: T201


if __name__ == "__main__":
    main()
