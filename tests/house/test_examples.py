"""The Python blocks of the README and of the manual run as they stand."""

import itertools
import re
import shlex
from pathlib import Path
from typing import Any

import pytest
from click.exceptions import Exit
from typer.main import get_command
from typer.testing import CliRunner

from rover_gym.cli import app
from rover_gym.cli.usage import UsageError

ROOT = Path(__file__).parents[2]
#: Pages whose blocks build on each other, or need a cluster or a file of measurements.
TOGETHER = {"cluster.md", "contact-problems.md", "sand.md"}
PAGES = ["README.md", *(f"docs/{page.name}" for page in (ROOT / "docs").glob("*.md") if page.name not in TOGETHER)]
#: Packages of extras that a block needs if it holds these words.
EXTRAS = {
    "McapWriter": "mcap",
    "from_urdf": "yourdfpy",
    "from_mjcf": "mujoco",
    "parallel_env": "pettingzoo",
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
    for page in sorted(PAGES):
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


def command_lines() -> list[pytest.param]:
    """Every call of `rover` in the pages, the tutorials and the decisions, in blocks and within lines."""
    found = []
    pages = [page for page in sorted((ROOT / "docs").rglob("*.md")) if not page.parts[-2].startswith("_")]
    for page in [ROOT / "README.md", *pages]:
        text = page.read_text(encoding="utf-8").replace("\\\n", " ")
        for block in re.findall(r"^```(?:console|bash|sh)\n(.*?)^```$", text, flags=re.MULTILINE | re.DOTALL):
            lines = [line.strip().removeprefix("$ ") for line in block.splitlines()]
            found += [(page, line) for line in lines if line.startswith("rover ")]
        found += [(page, line) for line in re.findall(r"`(rover [a-z][^`]*)`", text) if " -" in line]
    return [pytest.param(line, id=f"{page.relative_to(ROOT)}: {line}") for page, line in found]


@pytest.mark.parametrize("line", command_lines())
def test_a_command_line_of_the_manual_is_one(line: str) -> None:
    """`rover export onnx anywhere -o` stood there, and `-o` is no option."""
    line = re.sub(r"\$\{\w+:-(\w+)\}", r"\1", re.split(r" [|>] ", line)[0])  # a variable has its default
    words = shlex.split(re.sub(r"\[|\]| \.\.\.", "", line), comments=True)[1:]
    for choice in itertools.product(*(word.split("|") for word in words)):
        command: Any = get_command(app)
        rest = list(choice)
        while rest and hasattr(command, "commands"):
            command = command.commands[rest.pop(0)]
        try:
            command.make_context("rover", rest)
        except Exit:
            pass  # help or the version
        except UsageError as error:
            if "does not exist" not in str(error):  # of a file that the reader has
                raise
