"""A short round of `make torture`, and that it notices what it must."""

import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from torture import doors, on_purpose
from torture.audit import Audit
from torture.drives import MODEL
from torture.law import violation
from torture.ledger import Bounds, Ledger, Regime
from torture.pool import play, side_by_side
from torture.regimes import BY_NAME, REGIMES
from torture.sizes import FINDS, Row, write

from rover_gym import Simulation, SphereField


def complaints(tasks: list[tuple[str, int]]) -> list[str]:
    """Of cases, each by its regime's bounds, played by two processes with a limit to their memory."""
    rows = {name: Row(BY_NAME[name], Ledger()) for name, _ in tasks}
    for (name, case), ledger in side_by_side(tasks, 2):
        rows[name].ledger.merge(ledger, case)
    return [line for row in rows.values() for line in row.complaints()]


def played(name: str, cases: int) -> Row:
    """The first cases of a regime, of which nothing may break."""
    row = Row(BY_NAME[name], Ledger())
    for case in range(cases):
        row.ledger.merge(play(name, case), case)
    broken = list(row.complaints())
    assert not broken, "\n".join(broken)
    return row


@pytest.mark.takes_long("the campaign, cut to ten seconds")
def test_a_short_round_of_every_regime_holds(whole: bool) -> None:
    """Of every other one in `make test`."""
    broken = complaints([(regime.name, 0) for regime in REGIMES[:: 1 if whole else 2]])
    assert not broken, "\n".join(broken)


def test_sizes_and_places_that_hung_or_aborted_are_refused_or_done_in_time() -> None:
    broken = complaints([("sizes and places", case) for case in range(len(FINDS))])
    assert not broken, "\n".join(broken)


@pytest.mark.parametrize("name", ["damaged runs", "damaged policies"])
def test_damaged_recordings_and_policies_are_refused_or_sound(name: str) -> None:
    """KeyError, RecursionError and others came out; some files were read for ever, one asked for 186 GiB."""
    row = played(name, BY_NAME[name].cases)
    assert row.ledger.steps >= 150
    assert row.ledger.refused > row.ledger.steps // 2, "or nothing was damaged"


@pytest.mark.parametrize("regime", doors.REGIMES, ids=lambda regime: regime.name)
def test_doors_to_other_programs_refuse_what_is_wrong(regime: Regime, whole: bool) -> None:
    for package in ("fmpy", "websockets"):
        pytest.importorskip(package)
    assert played(regime.name, min(4 if whole else 1, regime.cases)).ledger.steps


def test_a_case_is_the_same_twice() -> None:
    first, second = (play("upside down", 3) for _ in range(2))
    first.slowest = second.slowest = 0.0
    assert first == second


@pytest.mark.skipif(sys.platform == "win32", reason="signals are POSIX's")
def test_hangs_aborts_and_segmentation_faults_are_findings_and_the_next_case_is_played() -> None:
    tasks = [(regime.name, 0) for regime in on_purpose.REGIMES]
    found = {name: " ".join(ledger.findings) for (name, _), ledger in side_by_side(tasks, 1)}
    assert "hangs" in found["on purpose: hangs"]
    assert "exit code -6" in found["on purpose: aborts"]
    assert "exit code -11" in found["on purpose: segmentation fault"]
    assert "foreign KeyError" in found["on purpose: foreign exception"]
    assert found["on purpose: sound"] == ""


def at_height(height: float, **options: Any) -> Simulation:
    """The rover with its trunk's origin at a height, m."""
    sim = Simulation(**options)
    q = np.zeros(MODEL.nq)
    q[1] = height
    sim.set_state(q)
    return sim


def test_energy_from_nowhere_is_noticed_and_a_motors_work_is_not_taken_for_it() -> None:
    sim, ledger = at_height(5.0, gravity=(0.0, 0.0, 0.0)), Ledger()
    sim.set_wheel_torques(np.full(6, 100.0))
    audit = Audit(sim, ledger)
    assert audit.run(3)
    assert ledger.gained < 1e-9
    # A push that the audit hears nothing of: 20 N m more on a wheel, whose forward is negative.
    push = np.zeros(MODEL.nv - 6)
    push[-1] = -20.0
    sim.set_joint_torques(push)
    audit.step()
    assert ledger.gained > 1e-3


def test_what_the_projection_lifts_is_counted_apart() -> None:
    ledger = Ledger()
    assert Audit(at_height(0.3), ledger, deep=True).run(5)
    # 5 cm of the 1 m that energies are measured by
    assert 0.02 < ledger.lifted < 0.055
    assert ledger.gained < 1e-9


def test_overlap_counts_once_the_rover_is_out_of_what_it_started_in() -> None:
    terrain = SphereField([[0.0, -10.0, 0.0]], [10.0])
    for deep in (True, False):
        ledger = Ledger()
        Audit(at_height(0.3, terrain=terrain, stabilisation="none"), ledger, deep=deep).run(3)
        assert (ledger.deepest > 0.01) is not deep


@pytest.mark.parametrize(
    ("p", "law"),
    [
        ([1.0, -0.3, 0.0], True),
        ([0.0, 0.0, 0.0], False),  # goes into the ground
        ([1.0, -0.6, 0.0], False),  # more friction than there is
        ([1.0, 0.3, 0.0], False),  # pushes along
        ([2.0, -0.6, 0.0], False),  # presses on what leaves
        ([1.0, -0.1, 0.0], False),  # slides with less than all friction
    ],
)
def test_the_law_is_checked_without_the_solver(p: list[float], law: bool) -> None:
    worst = violation(np.eye(3), np.array([-1.0, 1.0, 0.0]), np.array([0.3]), np.array(p))
    assert (worst < 1e-12) is law


def test_a_regime_worse_than_its_bound_complains_with_the_case_that_shows_it() -> None:
    regime = Regime("scene", on_purpose.REGIMES[-1].run, 1, Bounds(not_converged=0.01, gained=1e-9, slowest=0.5))
    ledger = Ledger()
    ledger.merge(Ledger(steps=1000, not_converged=11, gained=1e-10, slowest=0.1), 4)
    assert not list(Row(regime, ledger).complaints())
    ledger.merge(Ledger(steps=10, refused=1, not_converged=3, gained=1e-8, slowest=0.7, findings=["a panic"]), 7)
    text = "\n".join(Row(regime, ledger).complaints())
    for word in ("not_converged 14", "refused 1", "gained 1e-08 > 1e-09", "slowest 0.7", "a panic", "--case 7"):
        assert word in text


def test_the_table_is_written_between_its_marks_and_nothing_else_changes(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    marks = "<!-- campaign: made by `make torture`, not by hand -->\nold\n<!-- end of campaign -->"
    page.write_text(f"before\n{marks}\nafter\n", encoding="utf-8")
    ledger = Ledger()
    ledger.merge(Ledger(steps=12, gained=2e-10), 0)
    write([Row(REGIMES[0], ledger)], page)
    text = page.read_text(encoding="utf-8")
    assert text.startswith("before\n")
    assert text.endswith("after\n")
    assert "old" not in text
    assert f"| {REGIMES[0].name} | 12 |" in text
    assert "**" not in text
    ledger.merge(Ledger(gained=3.0, findings=["a panic"]), 1)
    write([Row(REGIMES[0], ledger)], page)
    text = page.read_text(encoding="utf-8")
    assert f"| **{REGIMES[0].name}** | 12 |" in text
    assert "| **3e+00** |" in text
