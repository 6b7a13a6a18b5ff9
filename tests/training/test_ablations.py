"""`training/ablations.py`: what is hidden is not seen, and a run without labels is refused."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from rover_gym.drive.arcs.arc_driver import SIZES
from rover_gym.drive.scan.scan_policy import SCAN


def test_networks_are_fitted_without_what_is_hidden(ablations: Callable[..., Any], tmp_path: Path) -> None:
    n, random = 600, np.random.default_rng(1)
    parts = {name: random.normal(size=(n, size)).astype(np.float32) for name, size in SIZES.items()}
    scan = random.integers(-60, 60, (n, *SCAN[:2])).astype(np.int8)
    np.savez(tmp_path / "labels-0.npz", scan=scan, label=np.full(n, 4, np.uint8), **parts)
    result = ablations(tmp_path, "--fields", 1, "--difficulty", 0.0, "--epochs", 1)
    assert result.exit_code == 0, result.output
    for name in ("everything", "no clocks", "no scan", "no command"):
        assert name in result.output
    refused = ablations(tmp_path / "nowhere")
    assert refused.exit_code != 0
    assert "has no labels" in refused.output
