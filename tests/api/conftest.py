"""Shared fixtures of the compiled module's tests."""

import json
from pathlib import Path
from typing import Any

import pytest
from rovers import placed

import rover_gym

GOLDEN = Path(__file__).parent.parent / "golden"


@pytest.fixture(scope="session")
def reference() -> dict[str, Any]:
    """The 20 random states of `rover_model.json`."""
    return json.loads((GOLDEN / "rover_model.json").read_text())


@pytest.fixture
def sim() -> rover_gym.Simulation:
    """The rover on flat ground, touching it."""
    return placed(rover_gym.Simulation(), y=0.35)
