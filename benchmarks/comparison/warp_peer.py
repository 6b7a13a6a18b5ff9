"""MuJoCo Warp: MuJoCo's contacts for many rovers at once on a graphics card, in single precision.

It gets the model of `MuJoCoRunner` with spheres as wheels. A round is one CUDA graph of a command of ten steps.
"""

import time
from typing import Any

import mujoco
import mujoco_warp
import numpy as np
import warp

from comparison.peers.mujoco_engine import MuJoCoRunner
from comparison.scene import Array, Phase, RoverScene

#: Rows of constraints and contacts of a rover: six wheels and what its pyramids need.
ROWS, CONTACTS = 40, 10
#: Steps of a command, seconds of a measurement.
STEPS_A_COMMAND, SECONDS = 10, 2.5


class WarpRunner(MuJoCoRunner):
    """`mujoco_warp.step` behind the common interface: all rovers do the same; the first is reported."""

    def __init__(self, scene: RoverScene, time_step: float, rovers: int = 1, **settings: Any) -> None:
        super().__init__(scene, time_step, **settings)
        self.rovers = rovers
        self.of_card = mujoco_warp.put_model(self.model)
        self.on_card = mujoco_warp.put_data(self.model, self.data, nworld=rovers, njmax=ROWS, nconmax=CONTACTS)
        self.graphs: dict[int, Any] = {}

    def command(self, phase: Phase) -> None:
        super().command(phase)
        self.give(np.tile(self.data.ctrl, (self.rovers, 1)))

    def give(self, controls: Array) -> None:
        """Gives every rover its own controls, (rovers, n)."""
        self.on_card.ctrl.assign(controls.astype(np.float32))

    def advance(self, steps: int) -> None:
        if steps not in self.graphs:
            with warp.ScopedCapture() as captured:
                for _ in range(steps):
                    mujoco_warp.step(self.of_card, self.on_card)
            self.graphs[steps] = captured.graph
        warp.capture_launch(self.graphs[steps])

    def position(self) -> Array:
        return np.array(self.on_card.qpos.numpy()[0, :3], dtype=float)


SETTINGS = {
    "defaults": {"integrator": "implicitfast"},
    "elliptic, impratio 100": {"integrator": "discrete", "cone": "elliptic", "impratio": 100.0},
}


def card() -> str | None:
    """Name of the graphics card, if there is one."""
    warp.init()
    device = warp.get_device()
    return str(device.name) if device.is_cuda else None


def throughput(scene: RoverScene, rovers: int, settings: dict[str, Any], limits: Array, seed: int = 0) -> float:
    """Rover-steps a second under commands that are drawn anew every ten steps, the median of rounds.

    Raises:
        FloatingPointError: A state is not finite, or a buffer of contacts ran over: then steps are left out.
    """
    runner = WarpRunner(scene, 0.005, rovers, **settings)
    rng, rates = np.random.default_rng(seed), []
    draws = [rng.uniform(-1.0, 1.0, (rovers, runner.model.nu)) * limits for _ in range(8)]
    begin = time.perf_counter()
    while time.perf_counter() - begin < SECONDS or len(rates) < 4:
        runner.give(draws[len(rates) % len(draws)])
        warp.synchronize()
        start = time.perf_counter()
        runner.advance(STEPS_A_COMMAND)
        warp.synchronize()
        rates.append(rovers * STEPS_A_COMMAND / (time.perf_counter() - start))
    if not np.isfinite(runner.on_card.qpos.numpy()).all():
        raise FloatingPointError("a state is not finite")
    if runner.on_card.overflow.numpy().any():
        raise FloatingPointError("a buffer ran over")
    return float(np.median(rates[2:]))


def limits_of(model: mujoco.MjModel, torque: float, angle: float) -> Array:
    """Largest controls: torques of the drives, set-points of the rest."""
    names = [model.actuator(i).name for i in range(model.nu)]
    return np.array([torque if name.startswith("drive") else angle for name in names])
