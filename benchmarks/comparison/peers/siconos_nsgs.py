"""Siconos' friction-contact solver (nonsmooth Gauss-Seidel) in a time-stepping loop, on flat ground.

Debian's python3-siconos needs NumPy 1, so it runs in the system's Python, as a process of its own. Mass matrix, bias
and contact Jacobians there are this project's, through the same compiled module; solver and step are not. Siconos' own
mechanics, which assembles the rover in Python too, is slower.
"""

import os
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from comparison.peers.base import LeftOut, Variant
from comparison.scene import Array, Phase, RoverScene
from comparison.worker import Worker, says
from rover_gym import _core

SYSTEM_PYTHON = "/usr/bin/python3"
COMMAND = [SYSTEM_PYTHON, str(Path(__file__).with_name("siconos_child.py")), str(_core.__file__)]

if reason := says([*COMMAND, "--probe"]):
    raise ImportError(f"Siconos in {SYSTEM_PYTHON}: {reason}")


class SiconosRunner:
    """The process behind the common interface."""

    def __init__(self, scene: RoverScene, time_step: float, *, tolerance: float) -> None:
        if len(scene.spheres):
            raise LeftOut("only one contact a wheel: no scenes of spheres")
        self.worker = Worker(COMMAND, env=os.environ | {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"})
        start = {
            "machine": scene.machine,
            "normal": scene.normal,
            "friction": scene.friction,
            "gravity": scene.gravity,
            "brake": scene.brake,
            "q": list(scene.q),
            "time_step": time_step,
            "tolerance": tolerance,
        }
        self.state = self._ask(start)

    def _ask(self, message: dict[str, Any]) -> dict[str, Any]:
        answer = self.worker.ask(message)
        if answer is None:
            raise RuntimeError(f"Siconos ended with {self.worker.child.wait()}")
        return answer

    def command(self, phase: Phase) -> None:
        self.state = self._ask({"steering": phase.steering, "torques": phase.torques})

    def advance(self, steps: int) -> None:
        self.state = self._ask({"steps": steps})

    def position(self) -> Array:
        return np.array(self.state["position"])

    def rotation(self) -> Array:
        return np.array(self.state["rotation"])

    def speed(self) -> float:
        return float(self.state["speed"])

    @property
    def cpu(self) -> float:
        """CPU time that the process has spent stepping, s."""
        return float(self.state["cpu"])

    def __del__(self) -> None:
        if hasattr(self, "worker"):
            self.worker.close()


VARIANTS = (
    Variant(
        "Siconos",
        "NSGS in a Python loop",
        partial(SiconosRunner, tolerance=1e-8),
        "Siconos 4.4 from Debian, fc3d_nsgs to 1e-8; the step around it Python, mass matrix and bias this project's",
        "nothing: the same law, contacts at the step's start",
    ),
)
