"""Every tutorial runs from its first block to its last, and leaves what it says."""

from pathlib import Path

import matplotlib as mpl
import numpy as np
import pytest

from tutorials.pages import TUTORIALS, run

PAGES = sorted(page.name for page in TUTORIALS.glob("*.md"))


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    mpl.use("Agg")
    return tmp_path


def test_every_tutorial_has_its_test() -> None:
    source = Path(__file__).read_text(encoding="utf-8")
    assert PAGES
    assert not [page for page in PAGES if f'TUTORIALS / "{page}"' not in source]


def test_a_ball_a_wheel_a_rover(folder: Path) -> None:
    names = run(TUTORIALS / "ball-wheel-rover.md")
    assert (folder / "plane.png").stat().st_size > 10_000
    assert names["last"] == pytest.approx(names["at_rest"], abs=0.1)
    assert [bool(path[-1, 2] > 0.3) for path in names["paths"].values()] == [False, True, True]


def test_a_contact_problem(folder: Path) -> None:
    names = run(TUTORIALS / "a-contact-problem.md")
    assert (folder / "block.png").stat().st_size > 10_000
    assert np.linalg.matrix_rank(names["W"]) < len(names["W"])


def test_the_page_about_contact_problems(folder: Path) -> None:
    """No tutorial, but its blocks follow from one another as a tutorial's do."""
    names = run(TUTORIALS.parent / "contact-problems.md")
    by_hand = names["violation"](names["W"], names["free"], names["mu"], names["answer"].impulses.ravel())
    assert by_hand == pytest.approx(names["answer"].report.velocity_error, rel=1e-6)
    assert (folder / "stack.npz").is_file()


@pytest.mark.takes_long("imports, drives, plots and replays, as the tutorial does")
def test_a_rover_over_a_map(folder: Path) -> None:
    for package in ("yourdfpy", "h5py"):
        pytest.importorskip(package)
    names = run(TUTORIALS / "a-rover-over-a-map.md")
    assert (folder / "crater.html").stat().st_size > 100_000
    assert (folder / "runs" / "crater" / "plots" / "path.png").is_file()
    assert names["simulation"].q[0] > -3.9


@pytest.mark.nightly("tests/training/test_rover_train.py::test_a_run_is_never_overwritten_and_its_figures_are_events")
@pytest.mark.timeout(900)
def test_train_a_policy(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """With the page's own variables for a rehearsal."""
    for package in ("stable_baselines3", "vtkmodules"):
        pytest.importorskip(package)
    scene = "scenes: {rocks: {environment: {terrain: rocks, difficulty: 0.5}}}"
    small = "imitation: {rounds: 1, decisions: 200, epochs: 1}"
    (folder / "small.yaml").write_text(f"{scene}\nrovers: 8\n{small}\nppo: null\n", encoding="utf-8")
    monkeypatch.setenv("CONFIG", "small.yaml")
    monkeypatch.setenv("EPISODES", "3")
    run(TUTORIALS / "train-a-policy.md")
    for written in ("watch.html", "watch.png", "runs/evaluation/evaluation.md"):
        assert (folder / written).stat().st_size > 0
