"""Hashes of trajectories, compared with the committed ones: `python -m comparison.bits` (`make bits`).

The hashes in `tests/golden/bits.json` hold on every machine. The trajectories that differ are named, and the command
ends with 1. `--save` writes the file after a change that is meant to change bits.
"""

import argparse
import hashlib
import json
import sys
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
from rich.console import Console

from comparison.exploring import GROUNDS, drives, scene as exploring_scene
from comparison.peers.ours import OurRunner
from comparison.scene import Array, RoverScene, steps_in
from comparison.scenes import flat_drive, parked, rocks, rug
from rover_gym import PDPolicy
from rover_gym.core import (
    BallSimulation,
    DiskSimulation,
    Line,
    Plane,
    Simulation,
    SimulationBatch,
    SoftGround,
    TwoWheelRoverSimulation,
    disk_packing,
)
from rover_gym.envs.sand_ground import sand_rover
from rover_gym.ground.sand import named_soil

COMMITTED = Path(__file__).parents[2] / "tests" / "golden" / "bits.json"
#: Simulated of each scene, s, and between two states that are hashed.
DURATION, SAMPLE = 3.0, 0.05
#: Steps of an environment.
ENV_STEPS = 60
Trajectory = Iterator[Any]


def rover(scene: RoverScene, step: float = 0.005, **options: Any) -> Trajectory:
    """Configuration and velocity of the start of a scene."""
    runner, left = OurRunner(scene, step, **options), DURATION
    for phase in scene.phases:
        runner.command(phase)
        for _ in range(steps_in(min(phase.duration, left), SAMPLE)):
            runner.advance(steps_in(SAMPLE, step))
            yield runner.simulation.q, runner.simulation.v
        left -= min(phase.duration, left)


def batch() -> Trajectory:
    """Readings of eight exploring rovers side by side, each of which has its own rocks."""
    scenes = [exploring_scene(drive, "rocks", 60.0) for drive in drives()]
    together = SimulationBatch([OurRunner(scene, 0.005).simulation for scene in scenes], threads=2)
    for phases in list(zip(*(scene.phases for scene in scenes), strict=True))[1:21]:
        torques, steering = ([getattr(phase, name) for phase in phases] for name in ("torques", "steering"))
        yield together.step(torques, steering, 10)[0]


def environment(**arguments: Any) -> Trajectory:
    """Observations and rewards under random actions."""
    env = gym.make("Rover-v0", **arguments)
    env.action_space.seed(3)
    yield env.reset(seed=3)[0]
    for _ in range(ENV_STEPS):
        observation, reward, terminated, truncated, _ = env.step(env.action_space.sample())
        yield observation, reward
        if terminated or truncated:
            yield env.reset()[0]


def baseline(**arguments: Any) -> Trajectory:
    """Observations under the PD baseline."""
    env = gym.make("Rover-v0", **arguments)
    policy = PDPolicy(env)
    observation, _ = env.reset(seed=4)
    for _ in range(ENV_STEPS):
        observation, reward, terminated, truncated, _ = env.step(policy.predict(observation)[0])
        yield observation, reward
        if terminated or truncated:
            return


def vector(**arguments: Any) -> Trajectory:
    """Observations and rewards of a batch, whose short episodes begin anew by themselves."""
    envs = gym.make_vec("Rover-v0", num_envs=6, max_episode_steps=25, **arguments)
    envs.action_space.seed(5)
    yield envs.reset(seed=5)[0]
    for _ in range(ENV_STEPS):
        yield envs.step(envs.action_space.sample())[:4]


def planar(simulation: Any, torques: Array | None = None) -> Trajectory:
    """Coordinates and velocity of a planar machine."""
    if torques is not None:
        simulation.set_torques(torques)
    for _ in range(20):
        simulation.step(20)
        yield simulation.q, simulation.v


def disks() -> Trajectory:
    """Disks that fall into a heap on a line."""
    radius, mass, position = disk_packing(60, width=0.6)
    simulation = DiskSimulation(radius, mass, position, ground=Line())
    for _ in range(20):
        simulation.step(20)
        yield simulation.position, simulation.velocity


def sand() -> Trajectory:
    """A rover that drops onto sand and then drives by torques that jump."""
    simulation = Simulation(sand_rover(), terrain=SoftGround(Plane(), named_soil("cmu-sand")), time_step=0.005)
    q = simulation.q
    q[1] = 0.245
    simulation.set_state(q)
    for k in range(60):
        simulation.step(2)
        yield simulation.q, simulation.v
        if k >= 30:
            simulation.set_wheel_torques([1.0 - 2.0 * ((3 * k + i) % 4 == 0) for i in range(6)])


def trajectories() -> dict[str, Callable[[], Trajectory]]:
    """All of them by name."""
    found: dict[str, Callable[[], Trajectory]] = {}
    for ground in GROUNDS:
        for torque in (20.0, 150.0):
            scene = exploring_scene(drives()[0], ground, torque)
            found[f"exploring, {scene.name}"] = partial(rover, scene)
    exploring = exploring_scene(drives()[1], "rocks", 60.0)
    found["exploring, rocks, tolerance 1e-6"] = partial(rover, exploring, tolerance=1e-6)
    found["exploring, rocks, newton variant"] = partial(rover, exploring, variant="newton")
    for scene in (flat_drive.scene(), rug.scene(), rocks.scene(), parked.scene()):
        found[scene.name] = partial(rover, scene)
    found["flat_drive, newton variant"] = partial(rover, flat_drive.scene(), variant="newton")
    found["flat_drive, 25 ms"] = partial(rover, flat_drive.scene(), step=0.025)
    found["batch of eight among rocks"] = batch
    for name, arguments in {
        "plane": {},
        "rocks": {"terrain": "rocks", "height_scan": True},
        "hills": {"terrain": "hills"},
        "sand": {"terrain": "sand"},
        "slope, randomised": {"slope_deg": 8.0, "friction": (0.4, 0.9), "mass_scale": (0.8, 1.2)},
    }.items():
        found[f"environment, {name}"] = partial(environment, **arguments)
        found[f"vector environment, {name}"] = partial(vector, **arguments)
    found["PD baseline, plane"] = baseline
    found["PD baseline, rocks"] = partial(baseline, terrain="rocks")
    found["ball on a line"] = lambda: planar(BallSimulation(Line(slope=-0.2)))
    found["two-wheel rover"] = lambda: planar(TwoWheelRoverSimulation(Line()), np.array([20.0, 20.0]))
    found["disks"] = disks
    found["sand"] = sand
    return found


def digest(trajectory: Trajectory) -> str:
    """Hash of all numbers of a trajectory, bit by bit."""
    total = hashlib.sha256()
    for row in trajectory:
        for numbers in row if isinstance(row, tuple) else (row,):
            total.update(np.ascontiguousarray(numbers, dtype=float).tobytes())
    return total.hexdigest()[:16]


def differences(before: dict[str, str], now: dict[str, str]) -> list[str]:
    """Names of the trajectories that are not the same, or not in both."""
    return sorted(name for name in before.keys() | now.keys() if before.get(name) != now.get(name))


def main() -> None:
    """Hashes, and compares or saves."""
    parser = argparse.ArgumentParser(description="Hashes of trajectories: do their bits stay?")
    parser.add_argument("--save", action="store_true", help=f"write the hashes to {COMMITTED.name}")
    arguments = parser.parse_args()
    console = Console(width=120, highlight=False)
    now = {}
    for name, trajectory in trajectories().items():
        now[name] = digest(trajectory())
        console.print(f"{now[name]}  {name}")
    if arguments.save:
        COMMITTED.write_text(json.dumps(now, indent=1) + "\n", encoding="utf-8")
        return
    changed = differences(json.loads(COMMITTED.read_text(encoding="utf-8")), now)
    console.print(f"{len(changed)} of {len(now)} differ" + "".join(f"\n  {name}" for name in changed))
    sys.exit(bool(changed))


if __name__ == "__main__":
    main()
