"""The table, regime by regime: on the console and between the marks of `docs/tables/torture.md`."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

from rich.table import Table

from torture.ledger import Ledger
from torture.regime import Regime

PAGE = Path(__file__).parents[2] / "docs" / "tables" / "torture.md"
BEGIN = "<!-- campaign: made by `make torture`, not by hand -->"
END = "<!-- end of the campaign's table -->"
COLUMNS = {
    "steps": "steps",
    "not_converged": "not converged",
    "refused": "refused",
    "gained": "energy gained",
    "lifted": "lifted",
    "deepest": "deepest, m",
    "slowest": "slowest, ms",
    "reward": "reward",
}


@dataclass(frozen=True)
class Row:
    """A regime and what its cases came to."""

    regime: Regime
    ledger: Ledger

    def cells(self) -> list[str]:
        """In the order of `COLUMNS`."""
        own = self.ledger
        numbers = (own.gained, own.lifted, own.deepest)
        return [
            str(own.steps),
            str(own.not_converged or ""),
            str(own.refused or ""),
            *(f"{value:.0e}" if value else "" for value in numbers),
            f"{1e3 * own.slowest:.1f}",
            f"{own.reward:.1f}" if own.reward else "",
        ]

    def complaints(self) -> Iterator[str]:
        """What broke, with the case that shows it again."""
        for finding in self.ledger.findings:
            yield f"{self.regime.name}, {finding}"
        for what in self.regime.broken(self.ledger):
            case = self.ledger.worst.get(what.split()[0])
            again = "" if case is None else f': python -m torture --regime "{self.regime.name}" --case {case}'
            yield f"{self.regime.name}: {what}{again}"


def console_table(rows: Iterable[Row]) -> Table:
    """For people at a terminal."""
    table = Table("regime", *COLUMNS.values())
    for row in rows:
        broken = any(True for _ in row.regime.broken(row.ledger))
        table.add_row(row.regime.name, *row.cells(), style="red" if broken else None)
    return table


def markdown(rows: Iterable[Row]) -> str:
    """For the page; what is beyond its bound is bold, and so is a regime with findings."""
    lines = ["| regime | " + " | ".join(COLUMNS.values()) + " |", "|---" * (1 + len(COLUMNS)) + "|"]
    for row in rows:
        complaints = [what.split()[0] for what in row.regime.broken(row.ledger)]
        cells = [f"**{cell}**" if name in complaints else cell for name, cell in zip(COLUMNS, row.cells(), strict=True)]
        name = f"**{row.regime.name}**" if row.ledger.findings else row.regime.name
        lines.append(f"| {name} | " + " | ".join(cells) + " |")
    return "\n".join(lines)


def write(rows: Iterable[Row], page: Path = PAGE) -> None:
    """Replaces the table of the page."""
    text = page.read_text(encoding="utf-8")
    head, rest = text.split(BEGIN)
    _, tail = rest.split(END)
    page.write_text(f"{head}{BEGIN}\n\n{markdown(rows)}\n\n{END}{tail}", encoding="utf-8")
