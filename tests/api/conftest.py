"""Shared fixtures of the compiled module's tests."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import rover_gym

GOLDEN = Path(__file__).parent.parent / "golden"


@pytest.fixture(scope="session")
def reference() -> dict[str, Any]:
    """The 20 random states of `rover_model.json`."""
    return json.loads((GOLDEN / "rover_model.json").read_text())


@pytest.fixture
def sim() -> rover_gym.Simulation:
    """The rover on flat ground, touching it."""
    sim = rover_gym.Simulation()
    q = np.zeros(21)
    q[1] = 0.35
    sim.set_state(q)
    return sim
