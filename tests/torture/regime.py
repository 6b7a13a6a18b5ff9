"""A regime: cases drawn from a seed, and how bad they may come out."""

from __future__ import annotations

import zlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

import numpy as np

from torture.ledger import Ledger

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
        slowest: s.
        reward: Either way.
    """

    not_converged: float = 1e-4
    refused: float = 0.0
    gained: float | None = 1e-9
    lifted: float | None = 1.0
    deepest: float | None = 1.0
    slowest: float = 0.5
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
        for column in ("gained", "lifted", "deepest", "slowest", "reward"):
            most, value = getattr(bounds, column), getattr(ledger, column)
            if most is not None and value > most:
                yield f"{column} {value:.2g} > {most:g}"
        if ledger.findings:
            yield f"{len(ledger.findings)} findings"
