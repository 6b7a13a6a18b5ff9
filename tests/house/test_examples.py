"""The Python blocks of the README and of the manual run as they stand."""

import re
from pathlib import Path

import pytest
from typer.testing import CliRunner

from rover_gym.cli import app

ROOT = Path(__file__).parents[2]
PAGES = (
    "README.md",
    "docs/accuracy.md",
    "docs/derivatives.md",
    "docs/economy.md",
    "docs/exchange.md",
    "docs/first-steps.md",
    "docs/grains.md",
    "docs/identification.md",
    "docs/models.md",
    "docs/planar.md",
    "docs/policies.md",
    "docs/recording.md",
    "docs/sensors.md",
    "docs/solvers.md",
    "docs/tasks.md",
    "docs/training.md",
    "docs/vector.md",
    "docs/watching.md",
    "docs/wheel-forces.md",
    "docs/your-map.md",
    "docs/several-machines.md",
    "docs/your-rover.md",
)
#: Packages of extras that a block needs if it holds these words.
EXTRAS = {
    "McapWriter": "mcap",
    "from_urdf": "yourdfpy",
    "from_mjcf": "mujoco",
    "scipy": "scipy",
    "stable_baselines3": "stable_baselines3",
    "torch_rollout": "torch",
}


#: Blocks of the manual, not of the README or a tutorial, that take long.
NIGHTLY = {
    "docs/identification.md-1": pytest.mark.nightly("tests/api/test_identification.py::test_the_stated_noise_is_taken"),
    "docs/grains.md-3": pytest.mark.nightly("tests/api/test_grains_lab.py"),
    "docs/training.md-2": pytest.mark.nightly("tests/training/test_raw_actions.py"),
    "docs/vector.md-5": pytest.mark.nightly("tests/envs/test_vector.py"),
    "docs/tasks.md-5": pytest.mark.nightly("tests/envs/test_reward_terms.py"),
}


def blocks() -> list[pytest.param]:
    found = []
    for page in PAGES:
        text = (ROOT / page).read_text(encoding="utf-8")
        for number, code in enumerate(re.findall(r"^```python\n(.*?)^```$", text, flags=re.MULTILINE | re.DOTALL), 1):
            name = f"{page}-{number}"
            found.append(pytest.param(code, id=name, marks=NIGHTLY.get(name, ())))
    return found


@pytest.mark.parametrize("code", blocks())
def test_example_runs(code: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for word, package in EXTRAS.items():
        if word in code:
            pytest.importorskip(package)
    monkeypatch.chdir(tmp_path)
    exec(compile(code, "example", "exec"), {"__name__": "__main__"})  # noqa: S102 - that is the test


def test_the_commands_of_the_readme_are_known() -> None:
    text = "".join((ROOT / page).read_text(encoding="utf-8") for page in ("README.md", "docs/first-steps.md"))
    commands = re.findall(r"^rover (\w+)", text, flags=re.MULTILINE)
    assert commands
    for command in commands:
        assert CliRunner().invoke(app, [command, "--help"]).exit_code == 0
