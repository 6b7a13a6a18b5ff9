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


def make(*arguments: str) -> subprocess.CompletedProcess[str]:
    """Runs make as from a shell: under `make test` the outer make's settings would speak in."""
    environment = {
        name: value for name, value in os.environ.items() if name not in ("MAKEFLAGS", "MAKELEVEL", "MFLAGS")
    }
    command = ["make", *arguments]
    return subprocess.run(command, cwd=ROOT, env=environment, check=False, capture_output=True, text=True)


def test_plain_make_lists_every_target_with_one_line() -> None:
    output = make().stdout
    described = dict(re.findall(r"^make ([a-z-]+) +(\S.*)$", output, flags=re.MULTILINE))
    assert described.keys() == phony_targets()
    assert len(output.splitlines()) == len(described)


def test_a_part_of_test_all_that_fails_does_not_stop_the_others() -> None:
    """After one failure of the Python tests neither the campaign nor the bits had run."""
    done = make("test-all", "PARTS=no-such-target help")
    table = [line.split() for line in done.stdout.splitlines()[-2:]]
    assert [row[:2] for row in table] == [["no-such-target", "failed"], ["help", "passed"]]
    assert all(row[2].isdigit() for row in table)
    assert done.returncode != 0
    assert make("test-all", "PARTS=help help").returncode == 0


def test_test_all_has_every_part_of_what_ci_calls() -> None:
    (parts,) = re.findall(r"^PARTS = (.*)$", MAKEFILE, flags=re.MULTILINE)
    (recipe,) = re.findall(r"^test: .*\n((?:\t.*\n)+)", MAKEFILE, flags=re.MULTILINE)
    (checks,) = re.findall(r"^check: ([^#]*)", MAKEFILE, flags=re.MULTILINE)
    called = {word for word in f"{recipe} {checks} docs".split() if word in phony_targets()}
    assert called | {"torture", "same-bits", "train-rllib"} == set(parts.split())
    assert {"lint", "test-rust", "test-python"} <= called


def apt_get(folder: Path, script: str) -> subprocess.CompletedProcess[str]:
    """Installs a list of packages, as root, none of which is there, with an `apt-get` of our own."""
    programs = {"apt-get": script, "dpkg-query": "exit 1", "id": "echo 0"}
    for name, lines in programs.items():
        program = folder / name
        program.write_text(f"#!/bin/sh\n{lines}\n", encoding="utf-8")
        program.chmod(0o755)
    (folder / "list.txt").write_text("one\ntwo\n", encoding="utf-8")
    environment = {"PATH": f"{folder}{os.pathsep}{os.environ['PATH']}", "LIMIT": "0.3", "PAUSE": "0"}
    command = [ROOT / "packaging" / "debian-packages", folder / "list.txt"]
    return subprocess.run(command, env=environment, check=False, capture_output=True, text=True, timeout=20)


def test_a_mirror_that_does_not_answer_does_not_hang_make_test(tmp_path: Path) -> None:
    """`apt-get` waited for its mirror without end, and `make test` with it."""
    done = apt_get(tmp_path, "exec sleep 1000")
    assert done.returncode == 0
    assert done.stderr.count("longer than 0.3 s") == 3
    assert done.stderr.splitlines()[-1].endswith("sudo apt-get install one two")


def test_packages_are_installed_at_the_second_try(tmp_path: Path) -> None:
    log = tmp_path / "log"
    done = apt_get(tmp_path, f'echo "$@" >> {log}; [ "$(grep -c update {log})" = 2 ]')
    calls = [line.split() for line in log.read_text(encoding="utf-8").splitlines()]
    assert ["update" in call for call in calls] == [True, True, False, False]
    assert [call[-2:] for call in calls[2:]] == [["one", "two"]] * 2
    assert "--download-only" in calls[2]
    assert "--no-download" in calls[3]
    assert (done.returncode, done.stderr.count("try"), "NOT INSTALLED" in done.stderr) == (0, 1, False)


def test_ci_calls_commands_of_the_readme_and_nothing_else() -> None:
    script = ROOT / ".ci" / "run"
    assert script.stat().st_mode & 0o111, "not executable"
    lines = [line for line in script.read_text(encoding="utf-8").splitlines() if line and not line.startswith("#")]
    calls = [line for line in lines if "make" in line]
    assert calls == ["make test", "make check docs"]
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    for call in calls:
        assert re.search(rf"^{call} +#", readme, flags=re.MULTILINE), call


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
