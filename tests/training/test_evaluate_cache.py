"""An evaluation reuses its episodes only while everything that they depend on is the same."""

import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rover_gym.drive.arcs.arc_network_policy import ARCS_FILE
from rover_gym.drive.forecast.network_files import ANYWHERE, FOLDER


@pytest.fixture
def policy(tmp_path: Path) -> Path:
    """A copy of the shipped network."""
    folder = tmp_path / "mine"
    folder.mkdir()
    shutil.copy(FOLDER / ANYWHERE / ARCS_FILE, folder)
    return folder


def test_episodes_are_reused_until_the_policy_or_the_arguments_change(
    policy: Path, evaluate: Callable[..., Any], tmp_path: Path
) -> None:
    """A cached result was used although the policy had been retrained."""
    output = tmp_path / "evaluation"

    def evaluated(*arguments: Any) -> tuple[str, str]:
        result = evaluate(policy, "pd", "--terrain", "plane", "--episodes", 1, "--output", output, *arguments)
        assert result.exit_code == 0, result.output
        mine, baseline = (output / f"episodes-{name}.json" for name in ("mine", "pd"))
        found = mine.read_text(encoding="utf-8"), baseline.read_text(encoding="utf-8")
        for path, text in zip((mine, baseline), found, strict=True):  # marks what is reused
            path.write_text(text + " ", encoding="utf-8")
        return found

    def is_reused(text: str) -> bool:
        return text.endswith(" ")

    assert not any(map(is_reused, evaluated()))
    assert all(map(is_reused, evaluated()))
    # Other weights: this policy drives anew, the baseline does not.
    with np.load(policy / ARCS_FILE) as arrays:
        changed = {name: array * np.float16(0.5 if name == "dense_bias_0" else 1.0) for name, array in arrays.items()}
    np.savez_compressed(policy / ARCS_FILE, **changed)
    mine, baseline = evaluated()
    assert not is_reused(mine)
    assert is_reused(baseline)
    assert not any(map(is_reused, evaluated("--slope", 2)))
