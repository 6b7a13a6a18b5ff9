"""Siconos' friction-contact solver (nonsmooth Gauss-Seidel) in a time-stepping loop, on flat ground.

Debian's python3-siconos needs NumPy 1, so it runs in the system's Python, as a process of its own. Mass matrix, bias
and contact Jacobians there are this project's, through the same compiled module; solver and step are not. Siconos' own
mechanics, which assembles the rover in Python too, is slower.
"""

import json
import os
import subprocess
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from comparison.peers.base import LeftOut, Variant
from comparison.scene import Array, Phase, RoverScene
from rover_gym import _core

SYSTEM_PYTHON = "/usr/bin/python3"
CHILD = Path(__file__).with_name("siconos_child.py")


def _check() -> None:
    try:
        probe = subprocess.run(
            [SYSTEM_PYTHON, str(CHILD), str(_core.__file__), "--probe"], capture_output=True, text=True, check=False
        )
    except OSError as error:
        raise ImportError(str(error)) from None
    if probe.returncode != 0:
        lines = probe.stderr.strip().splitlines() or ["it ended without a word"]
        raise ImportError(f"Siconos in {SYSTEM_PYTHON}: {lines[-1]}")


_check()


class SiconosRunner:
    """The process behind the common interface."""

    def __init__(self, scene: RoverScene, time_step: float, *, tolerance: float) -> None:
        if len(scene.spheres):
            raise LeftOut("only one contact a wheel: no scenes of spheres")
        self.child = subprocess.Popen(
            [SYSTEM_PYTHON, str(CHILD), str(_core.__file__)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            env=os.environ | {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"},
        )
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
        if self.child.stdin is None or self.child.stdout is None:
            raise RuntimeError("no pipe to Siconos")
        self.child.stdin.write(json.dumps(message) + "\n")
        self.child.stdin.flush()
        line = self.child.stdout.readline()
        if not line:
            raise RuntimeError(f"Siconos ended with {self.child.wait()}")
        answer: dict[str, Any] = json.loads(line)
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
        child = getattr(self, "child", None)
        if child is not None and child.stdin is not None and child.stdout is not None:
            child.stdin.close()
            child.stdout.close()
            child.wait()


VARIANTS = (
    Variant(
        "Siconos",
        "NSGS in a Python loop",
        partial(SiconosRunner, tolerance=1e-8),
        "Siconos 4.4 from Debian, fc3d_nsgs to 1e-8; the step around it Python, mass matrix and bias this project's",
        "nothing: the same law, contacts at the step's start",
    ),
)
