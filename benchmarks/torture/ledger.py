"""What the cases of a regime came to: counts, extremes and findings."""

from __future__ import annotations

import zlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from time import thread_time
from typing import Any

import numpy as np

from rover_gym import StepError

#: Columns whose largest value counts, and with it the case that reached it.
EXTREMES = ("gained", "lifted", "deepest", "slowest", "reward")

#: Notes of a kind that are kept.
NOTES = 5


@dataclass
class Ledger:
    """Counts and extremes of one case, or of many.

    Attributes:
        steps: Taken, or problems solved, or inputs given.
        not_converged: Steps whose report says so.
        refused: Steps that ended in a `StepError`, or inputs that were refused.
        gained: Most energy gained in one step beyond the work of motors, over the energy at hand.
        lifted: Most energy that the projection of positions added in one step, over the energy at hand.
        deepest: Deepest overlap with the ground after a step, m.
        slowest: Longest CPU time of one call, s.
        reward: Largest reward of one step, either way.
        findings: What must never happen, in words.
        worst: Case in which each extreme was reached.
        notes: What happened when, a few of each kind: for those who look at one case.
        case: Number of the case.
    """

    steps: int = 0
    not_converged: int = 0
    refused: int = 0
    gained: float = 0.0
    lifted: float = 0.0
    deepest: float = 0.0
    slowest: float = 0.0
    reward: float = 0.0
    findings: list[str] = field(default_factory=list)
    worst: dict[str, int] = field(default_factory=dict)
    notes: dict[str, list[str]] = field(default_factory=dict)
    case: int = 0

    def note(self, kind: str, what: str) -> None:
        """Remembers the first few of a kind."""
        kept = self.notes.setdefault(kind, [])
        if len(kept) < NOTES:
            kept.append(what)

    def raise_to(self, column: str, value: float) -> None:
        """Keeps the larger value; what is no number is a finding."""
        if value != value:
            self.find(f"{column} is not a number")
        elif value > getattr(self, column):
            setattr(self, column, value)

    def find(self, what: str) -> None:
        """Enters a finding, once."""
        if what not in self.findings:
            self.findings.append(what)

    @contextmanager
    def timed(self) -> Iterator[None]:
        """Times a call by its thread's CPU clock, which other processes do not slow down."""
        start = thread_time()
        yield
        self.raise_to("slowest", thread_time() - start)

    def take(self, step: Callable[[], Any]) -> Any:
        """Takes one step, enters what its report says and returns that; None where the step was refused."""
        self.steps += 1
        try:
            with self.timed():
                report = step()
        except StepError as error:
            self.refused += 1
            self.note("refused", f"step {self.steps}: {error}")
            return None
        if not report.is_converged:
            self.not_converged += 1
            what = f"residual {report.residual:.1e}, {report.n_contacts} contacts"
            self.note("not converged", f"step {self.steps}: {what}")
        return report

    def is_finite(self, *arrays: np.ndarray) -> bool:
        """Whether a state has finite numbers only; if not, that is a finding."""
        if all(np.isfinite(array).all() for array in arrays):
            return True
        self.find("not finite")
        return False

    def merge(self, other: Ledger, case: int) -> None:
        """Adds what another case came to."""
        self.steps += other.steps
        self.not_converged += other.not_converged
        self.refused += other.refused
        for column in EXTREMES:
            value = getattr(other, column)
            if value > getattr(self, column) or (column not in self.worst and value > 0.0):
                setattr(self, column, value)
                self.worst[column] = case
        for finding in other.findings:
            self.find(f"case {case}: {finding}")
        for column in ("not_converged", "refused"):
            if getattr(other, column):
                self.worst.setdefault(column, case)


Case = Callable[[np.random.Generator, Ledger], None]


@dataclass(frozen=True)
class Bounds:
    """What a regime may come to; shares are of its steps, and one step more is let pass.

    Attributes:
        not_converged: Share of steps.
        refused: Share of steps.
        gained: Of the energy at hand in one step; None where the laws themselves may add energy.
        lifted: The same by the projection; None where a case starts deep in the ground.
        deepest: m; None for any depth.
        slowest: s; by default what the solver's budget for up to 200 contacts takes.
        reward: Either way.
    """

    not_converged: float = 1e-4
    refused: float = 0.0
    gained: float | None = 1e-9
    lifted: float | None = 1.0
    deepest: float | None = 1.0
    slowest: float = 2.0
    reward: float = 100.0


@dataclass(frozen=True)
class Regime:
    """A regime by name.

    Attributes:
        name: As in the table.
        run: Draws one case and enters it into a ledger.
        cases: How many make a round.
        bounds: Of the round.
        limit: Seconds after which a case counts as hanging.
    """

    name: str
    run: Case
    cases: int
    bounds: Bounds = field(default_factory=Bounds)
    limit: float = 120.0

    def play(self, case: int) -> Ledger:
        """One case: the same number gives the same case."""
        ledger = Ledger(case=case)
        random = np.random.default_rng([zlib.crc32(self.name.encode()), case])
        with np.errstate(all="ignore"):
            self.run(random, ledger)
        return ledger

    def broken(self, ledger: Ledger) -> Iterator[str]:
        """What is worse than its bound."""
        bounds = self.bounds
        for column in ("not_converged", "refused"):
            share, count = getattr(bounds, column), getattr(ledger, column)
            if share == 0.0 < count or count > share * ledger.steps + 1.0:
                yield f"{column} {count} of {ledger.steps}"
        for column in EXTREMES:
            most, value = getattr(bounds, column), getattr(ledger, column)
            if most is not None and value > most:
                yield f"{column} {value:.2g} > {most:g}"
        if ledger.findings:
            yield f"{len(ledger.findings)} findings"
