"""The Makefile lists its targets, and continuous integration and workflows run the commands of the README."""

import os
import re
import subprocess
from pathlib import Path

ROOT = Path(__file__).parents[2]
MAKEFILE = (ROOT / "Makefile").read_text(encoding="utf-8")
WORKFLOWS = {path.name: path.read_text(encoding="utf-8") for path in (ROOT / ".github" / "workflows").glob("*.yml")}


def phony_targets() -> set[str]:
    (line,) = re.findall(r"^\.PHONY: (.*)$", MAKEFILE, flags=re.MULTILINE)
    return set(line.split())


def test_plain_make_lists_every_target_with_one_line() -> None:
    # As from a shell: under `make test` the outer make's settings would speak in.
    environment = {
        name: value for name, value in os.environ.items() if name not in ("MAKEFLAGS", "MAKELEVEL", "MFLAGS")
    }
    output = subprocess.run(["make"], cwd=ROOT, env=environment, check=True, capture_output=True, text=True).stdout  # noqa: S607
    described = dict(re.findall(r"^make ([a-z-]+) +(\S.*)$", output, flags=re.MULTILINE))
    assert described.keys() == phony_targets()
    assert len(output.splitlines()) == len(described)


def test_ci_calls_the_readmes_test_command_and_nothing_else() -> None:
    script = ROOT / ".ci" / "run"
    assert script.stat().st_mode & 0o111, "not executable"
    lines = [line for line in script.read_text(encoding="utf-8").splitlines() if line and not line.startswith("#")]
    assert [line for line in lines if "make" in line] == ["exec make test"]
    assert re.search(r"^make test\b", (ROOT / "README.md").read_text(encoding="utf-8"), flags=re.MULTILINE)


def test_the_commit_hooks_call_make_targets() -> None:
    hooks = (ROOT / ".pre-commit-config.yaml").read_text(encoding="utf-8")
    entries = re.findall(r"^ +entry: (.*)$", hooks, flags=re.MULTILINE)
    assert entries
    assert {entry.split()[0] for entry in entries} == {"make"}
    assert {entry.split()[1] for entry in entries} <= phony_targets()


def test_workflows_pin_actions_by_their_commits_and_run_make_targets() -> None:
    assert {"tests.yml", "wheels.yml", "documentation.yml"} <= WORKFLOWS.keys()
    for name, text in WORKFLOWS.items():
        used = re.findall(r"uses: (.*)$", text, flags=re.MULTILINE)
        assert used
        loose = [one for one in used if not re.fullmatch(r"[\w.-]+/[\w.-]+@[0-9a-f]{40} # v\d+\.\d+\.\d+", one)]
        assert not loose, name
        targets = re.findall(r"(?:\bmake|matrix\.make \}\}|\"\$MAKE\") ([a-z]\S*)", text)
        assert set(targets) <= phony_targets(), name
        assert "\npermissions:\n  contents: read\n" in text, f"{name}: a token that may write"


def test_only_the_step_that_publishes_may_identify_itself() -> None:
    writes = {name: re.findall(r"^ +(\S+): write", text, flags=re.MULTILINE) for name, text in WORKFLOWS.items()}
    assert writes.pop("documentation.yml") == ["pages", "id-token"]
    assert writes.pop("wheels.yml") == ["id-token"]
    assert not any(writes.values())
    (publish,) = re.findall(r"^  publish:\n(.*)\Z", WORKFLOWS["wheels.yml"], flags=re.MULTILINE | re.DOTALL)
    assert "environment: release" in publish
    assert "id-token: write" in publish
