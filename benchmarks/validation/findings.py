"""Reference values of the measurements, one row each."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from reports import table

from validation.ball_drum import GLASS, YIELD
from validation.ball_janssen import farthest

STARON = "Staron and Hinch 2005"
BEVERLOO = "Beverloo et al. 1961"


@dataclass(frozen=True)
class Finding:
    """One number.

    Attributes:
        what: Short.
        expected: In words.
        source: Of what is expected.
        number: What was measured.
        low: The finding holds from here,
        high: to here.
        unit: Of all three.
        digits: To print.
    """

    what: str
    expected: str
    source: str
    number: float
    low: float
    high: float
    unit: str = ""
    digits: str = ".2f"

    @property
    def holds(self) -> bool:
        """Whether the number is in its range; one that is not finite is not."""
        return bool(self.low <= self.number <= self.high)

    def cells(self) -> list[str]:
        """Of a line of a table."""
        number = f"{self.number:{self.digits}} {self.unit}".strip()
        return [self.what, self.expected, self.source, number if self.holds else f"**outside**: {number}"]


def collapse(data: dict[str, Any]) -> Iterator[Finding]:
    """Power laws of the run-out."""
    for fit, where in zip(data["fits"], ("a ≤ 2", "a ≥ 2"), strict=True):
        n, c, ratio = fit["paper_exponent"], fit["paper_prefactor"], fit["with_paper_exponent"]
        yield Finding(f"run-out, exponent, {where}", f"{n:g} ± 0.1", STARON, fit["exponent"], n - 0.1, n + 0.1)
        yield Finding(f"run-out / a^{n:g}, {where}", f"{c:g} ± 20%", STARON, ratio, 0.8 * c, 1.2 * c)
    small = data["limit"]
    what = f"run-out / a at a = 2, disks ever smaller, ± {small['error']:.2f}"
    yield Finding(what, "2.5 ± 20%", STARON, small["value"], 2.0, 3.0)


def packing(data: dict[str, Any]) -> Iterator[Finding]:
    """Packing fractions and contacts."""
    poured = data["poured"]

    def mean(name: str, friction: float, shakes: int = 0) -> float:
        runs = poured + data["shaken"]
        return float(np.mean([r[name] for r in runs if (r["friction"], r["shakes"]) == (friction, shakes)]))

    dense, what = mean("fraction", 0.0), "packing fraction, no friction"
    yield Finding(what, "0.84 ± 0.01", "random close packing", dense, 0.83, 0.85, digits=".3f")
    yield Finding("contacts of a disk, no friction", "4 ± 0.1", "isostatic, 2d", mean("coordination", 0.0), 3.9, 4.1)
    for shakes in (0, *sorted({r["shakes"] for r in data["shaken"] if r["friction"] == 0.5})):
        what = f"the same after {shakes} shakes" if shakes else "packing fraction, µ 0.5, poured"
        found = mean("fraction", 0.5, shakes)
        yield Finding(what, "0.81 to 0.84", "random packings of disks", found, 0.81, 0.84, digits=".3f")
    rough = mean("coordination", 1.0)
    yield Finding("contacts of a disk, µ 1", "3 to 3.3", "isostatic with friction, d + 1", rough, 2.95, 3.3)
    frictions = sorted({r["friction"] for r in poured})
    drops = np.diff([mean("coordination", mu) for mu in frictions])
    yield Finding("largest rise of the contacts with µ", "none", "", float(drops.max()), -10.0, 0.0, digits=".3f")


def repose(data: dict[str, Any]) -> Iterator[Finding]:
    """The slope's angle against friction."""
    for what, name, error in (
        ("angle of repose", "angle", "error"),
        ("share of a bed that stays", "stays", "stays_error"),
    ):
        values, errors = _columns(data["means"], name, error)
        yield _fall(what, values, errors)
        rise = float((values[-1] - values[0]) / np.hypot(errors[-1], errors[0]))
        yield Finding(f"{what}, rise from µ 0.05 to 0.7 in standard errors", "above 4", "", rise, 4.0, np.inf)


def janssen(data: dict[str, Any]) -> Iterator[Finding]:
    """Saturation of what a silo's bottom bears."""
    source = "Janssen 1895"
    for rows, name in (("samples", "determination"), ("means of a height", "determination_of_means")):
        what = f"silo, R² of Janssen's law, {rows}"
        yield Finding(what, "above 0.95", source, data[name], 0.95, 1.0, digits=".3f")
    what, worst = "silo, mean of a height farthest from the law", farthest(data["means"], data["saturation"])
    yield Finding(what, "0 ± 10%", "the fit", worst, -0.1, 0.1, digits=".3f")
    worst = max((abs(r["borne"] / r["filling"] - 1.0) for r in data["smooth"]), default=np.nan)
    yield Finding("smooth walls, error of the borne weight", "0", "balance of forces", worst, 0.0, 0.03, digits=".1e")


def hourglass(data: dict[str, Any]) -> Iterator[Finding]:
    """Beverloo's law of the discharge in the plane."""
    yield Finding("hourglass, exponent of D - k d", "1.5 ± 0.1", BEVERLOO, data["free"]["n"], 1.4, 1.6)
    yield Finding("hourglass, k with the exponent 1.5", "1 to 2", "Nedderman 1992", data["fixed"]["k"], 1.0, 2.0)
    what = "hourglass, R² of a line through W^(2/3)"
    yield Finding(what, "above 0.99", BEVERLOO, data["straight"], 0.99, 1.0, digits=".4f")
    halves = [[np.mean(half) for half in np.array_split(run["blocks"], 2)] for run in data["runs"]]
    drifts = [abs(late - early) / (2.0 * r["error"]) for (early, late), r in zip(halves, data["runs"], strict=True)]
    what = "hourglass, rate of a run's halves, largest difference in standard errors"
    yield Finding(what, "below 3: steady", "", float(max(drifts)), 0.0, 3.0)
    same = next(r for r in data["runs"] if r["opening"] == data["lower"]["opening"])
    for how, run, other in (
        ("half as much filling", data["lower"], same),
        ("half the time step", data["finer"], data["lower"]),
    ):
        share = run["rate"] / other["rate"]
        yield Finding(f"hourglass, rate with {how}", "the same, 5%", "", share, 0.95, 1.05, "of the other")


def balance(data: dict[str, Any]) -> Iterator[Finding]:
    """Energy and momentum of the runs made for them."""
    rigid = [r for r in data["boxes"] if r["restitution"] == 0.0]
    smooth = [r for r in data["boxes"] if r["friction"] == 0.0 and r["restitution"] > 0.0]
    for name, chosen in (("e = 0, any µ", rigid), ("µ = 0, e = 0.5 and 0.9", smooth)):
        worst, what = max(r["grown"] for r in chosen), f"growth of the energy in a box, {name}"
        yield Finding(what, "0", "proof in the manual", worst, 0.0, 1e-12, "of the start's", ".1e")
    worst = max(r["momentum_error"] for r in data["clouds"])
    yield Finding("momentum of two clouds that meet", "0", "exact", worst, 0.0, 1e-12, digits=".1e")
    kept = [r["kept"] for r in data["cooling"] if r["restitution"] == 0.9]
    error = abs(kept[0] / kept[-1] - 1.0)
    yield Finding("energy kept at e = 0.9, step 1 against 0.02 ms", "the same, 5%", "", error, 0.0, 0.05, digits=".3f")


LUBE = "Lube et al. 2004"


def ball_packing(data: dict[str, Any]) -> Iterator[Finding]:
    """Packing fractions and contacts of balls."""
    means = {row["friction"]: row for row in data["means"]}
    smooth, rough = means[0.0], means[max(means)]
    for quantity, row, name, expected, low, high, source in (
        ("packing fraction, no friction", smooth, "fraction", "0.64 ± 0.01", 0.63, 0.65, "random close packing"),
        ("contacts, no friction", smooth, "coordination", "6 ± 0.1", 5.9, 6.1, "isostatic, 3d"),
        ("packing fraction, µ 1", rough, "fraction", "0.55 to 0.60", 0.55, 0.60, "Jaeger and Nagel 1992"),
        ("contacts, µ 1", rough, "coordination", "towards 4", 4.0, 4.7, "Silbert 2010"),
    ):
        what = f"balls: {quantity}, ± {row[name + '_error']:.3f}"
        yield Finding(what, expected, source, row[name], low, high, digits=".3f")
    rises = np.diff([[row["fraction"], row["coordination"]] for row in data["means"]], axis=0)
    yield Finding("balls: largest rise of both with µ", "none", "", float(rises.max()), -10.0, 0.0, digits=".3f")


def ball_balance(data: dict[str, Any]) -> Iterator[Finding]:
    """Energy, momentum and similarity of balls."""
    grown = max(row["grown"] for row in data["boxes"])
    yield Finding("balls: growth of the energy in a box, e = 0, any µ", "0", "proof in the manual", grown, 0.0, 1e-12)
    error = max(row["momentum_error"] for row in data["clouds"])
    yield Finding("balls: momentum of two clouds that meet", "0", "exact", error, 0.0, 1e-12, digits=".1e")
    apart = max(row["difference"] for row in data["froude"])
    what = "balls: places under 1/4 and 1/16 of the gravity, times doubled and quadrupled"
    yield Finding(what, "the same bits", "Froude", apart, 0.0, 0.0, digits=".0f")


def ball_impact(data: dict[str, Any]) -> Iterator[Finding]:
    """Depth of a sphere in a bed."""
    source, found = "Uehara et al. 2003", data["exponent"]
    ratio = np.array([run["depth"] / run["law"] for run in data["runs"]])
    what = f"balls: depth of a sphere over the law, mean, ± {ratio.std(ddof=1) / np.sqrt(len(ratio)):.2f}"
    yield Finding(what, "1 ± 25%", source, float(ratio.mean()), 0.75, 1.25)
    what = f"balls: exponent of the whole drop, ± {found['error']:.2f}"
    yield Finding(what, "1/3 ± 0.1", source, found["value"], 0.23, 0.43)


def ball_collapse(data: dict[str, Any]) -> Iterator[Finding]:
    """Run-out of columns."""
    limit = data["limit"]
    what = f"balls: run-out over the law at a = 1, balls ever smaller, ± {limit['error']:.2f}"
    yield Finding(what, "1 ± 20%", LUBE, limit["value"], 0.8, 1.2)
    tall = [run for run in data["runs"] if run["aspect"] > 1.7]
    ratio = float(np.mean([run["run_out"] / np.sqrt(run["aspect"]) for run in tall]))
    yield Finding("balls: run-out / a^0.5, a ≥ 1.7, 700 balls", "1.6 ± 25%", LUBE, ratio, 1.2, 2.0)


def ball_silo(data: dict[str, Any]) -> Iterator[Finding]:
    """Discharge of a silo."""
    fit = data["fit"]
    what = f"balls: exponent of D - 1.4 d, ± {fit['error']:.2f}"
    yield Finding(what, "2.5 ± 0.25", BEVERLOO, fit["exponent"], 2.25, 2.75)
    yield Finding("balls: Beverloo's C", "0.58 ± 0.1", BEVERLOO, fit["C"], 0.48, 0.68)
    yield Finding("balls: Beverloo's k", "1.4 ± 0.5", BEVERLOO, fit["k"], 0.9, 1.9)


def ball_janssen(data: dict[str, Any]) -> Iterator[Finding]:
    """Load on the bottom of a tube of balls."""
    source = "Janssen 1895"
    what = "balls: tube, R² of Janssen's law, means of a height"
    yield Finding(what, "above 0.95", source, data["determination"], 0.95, 1.0, digits=".3f")
    worst = farthest(data["means"], data["saturation"])
    yield Finding("balls: tube, mean of a height farthest from the law", "0 ± 10%", "the fit", worst, -0.1, 0.1)
    what = f"balls: tube, K with the wall's coefficient of friction, ± {data['K_error']:.2f}"
    yield Finding(what, "0.3 to 0.8", "Nedderman 1992", data["K_of_coulomb"], 0.3, 0.8)
    what = "balls: tube, K with the friction that the wall mobilises"
    yield Finding(what, "0.3 to 0.8", "Nedderman 1992", data["K"], 0.3, 0.8)
    smooth = abs(data["smooth"]["borne"] / data["smooth"]["filling"] - 1.0)
    what = "balls: smooth tube, error of the borne weight"
    yield Finding(what, "0", "balance of forces", smooth, 0.0, 0.03, digits=".1e")
    same = next(row for row in data["means"] if row["count"] == data["slower"]["count"])
    share = data["slower"]["borne"] / same["borne"]
    yield Finding("balls: tube, load at half the speed", "the same, 10%", "", share, 0.9, 1.1, "of the other")


def ball_drum(data: dict[str, Any]) -> Iterator[Finding]:
    """Slope in a drum against friction."""
    level = max((run["angle"] for run in data["smooth"]), key=abs)
    what, limit = "balls: drum with a smooth wall, steepest slope without friction", YIELD[0.0]
    yield Finding(what, f"0 ± {limit:.1f}", "Peyneau and Roux 2008", level, -limit, limit, "°", ".1f")
    rows = {row["friction"]: row for row in data["means"]}
    for mu, angle in YIELD.items():
        row, source = rows[mu], "Peyneau and Roux 2008" if mu == 0.0 else "Chialvo et al. 2012"
        what = f"balls: drum, slope, µ {mu:g}, ± {row['error']:.1f}"
        yield Finding(what, f"{angle:.1f} ± 3: slow shear", source, row["angle"], angle - 3.0, angle + 3.0, "°", ".1f")
    low, high = GLASS
    what = f"balls: drum, slope, µ 0.5, ± {rows[0.5]['error']:.1f}"
    beads, source = f"{low:g} to {high:g}: glass beads", "Jop et al. 2006"
    yield Finding(what, beads, source, rows[0.5]["angle"], low, high, "°", ".1f")
    yield from _rising("balls: drum, slope", data["means"], "angle", "error")
    change = data["finer"]["angle"] - rows[0.5]["angle"]
    yield Finding("balls: drum, slope with half the time step", "the same, 2", "", change, -2.0, 2.0, "° more", ".1f")
    end, angle = data["limit"], YIELD[0.5]
    what = f"balls: drum, slope, µ 0.5, balls ever smaller, ± {end['error']:.1f}"
    expected = f"{angle:.1f} ± 3: slow shear"
    yield Finding(what, expected, "Chialvo et al. 2012", end["value"], angle - 3.0, angle + 3.0, "°", ".1f")


def ball_repose(data: dict[str, Any]) -> Iterator[Finding]:
    """Angle of repose against friction."""
    rows = {row["friction"]: row for row in data["means"]}
    what = f"balls: angle of repose, µ 0.5, ± {rows[0.5]['error']:.1f}"
    low, high = GLASS
    beads, source = f"{low:g} to {high:g}: glass beads", "Jop et al. 2006"
    yield Finding(what, beads, source, rows[0.5]["angle"], low, high, "°", ".1f")
    yield from _rising("balls: angle of repose", data["means"], "angle", "error")
    yield from _rising("balls: share of a bed that stays", data["means"], "stays", "stays_error")


def _columns(rows: list[dict[str, float]], *names: str) -> list[npt.NDArray[np.float64]]:
    return [np.array([row[name] for row in rows]) for name in names]


def _fall(what: str, values: npt.NDArray[np.float64], errors: npt.NDArray[np.float64]) -> Finding:
    """That a quantity does not fall with friction."""
    fall = float((-np.diff(values) / np.hypot(errors[1:], errors[:-1])).max())
    return Finding(f"{what}, largest fall with µ in standard errors", "below 2: monotone", "", fall, -90.0, 2.0)


def _rising(what: str, rows: list[dict[str, float]], name: str, error: str) -> Iterator[Finding]:
    """That a quantity rises with friction, and less and less."""
    values, errors, friction = _columns(rows, name, error, "friction")
    yield _fall(what, values, errors)
    middle = float(np.interp(0.3, friction, values))
    share = (values[-1] - middle) / (values[-1] - values[0])
    text = f"{what}, share of the rise from µ {friction[0]:g} to 0.8 that lies above 0.3"
    yield Finding(text, "below a half: saturation", "", float(share), -np.inf, 0.5)


def wheel_on_balls(data: dict[str, Any]) -> Iterator[Finding]:
    """RMS errors against measurements beside those of the measurements' authors' tuned model."""
    source = "wheel on sand, 3D terramechanics 2022"
    for name, unit, factor, authors in (
        ("pull", "N", 1.0, 6.8),
        ("lateral", "N", 1.0, 7.3),
        ("sinkage", "mm", 1e3, 7.5),
    ):
        for size in ("coarse", "fine", "extrapolated"):
            error = factor * data["rms"][size][name]
            what = f"RMS error of a wheel's {name}, {size} balls"
            yield Finding(what, f"{authors:g} {unit}: the authors' model", source, error, 0.0, authors, unit, ".1f")


def plate_on_balls(data: dict[str, Any]) -> Iterator[Finding]:
    """Whether the finest balls agree with the next."""
    coarse, fine = data["means"][-2:]
    change = abs(fine["pressure"] / coarse["pressure"] - 1.0)
    what = "pressure under a plate, change from the next to the finest balls"
    yield Finding(what, "below a quarter", "", change, 0.0, 0.25)


def everywhere(ledgers: dict[str, dict[str, float]]) -> Iterator[Finding]:
    """What must hold in every step of all parts."""
    for part, ledger in ledgers.items():
        deepest = 100.0 * ledger["overlap"]
        yield Finding(f"{part}: deepest overlap", "below 1% of a radius", "", deepest, 0.0, 1.0, "%", ".2g")
        error, what = ledger["momentum"], f"{part}: momentum balance of a step"
        yield Finding(what, "rounding", "exact", error, 0.0, 1e-12, "", ".1e")
        if ledger["spent"] > 0.0:
            back, source = ledger["regained"], "proof in the manual"
            yield Finding(f"{part}: energy regained", "0", source, back, 0.0, 1e-6, "of what was lost", ".1e")


#: What each part must have found, by the name of its module.
PARTS = {
    part.__name__: part
    for part in (
        collapse,
        packing,
        repose,
        janssen,
        hourglass,
        balance,
        ball_packing,
        ball_balance,
        ball_impact,
        ball_collapse,
        ball_silo,
        ball_drum,
        ball_repose,
        ball_janssen,
        wheel_on_balls,
        plate_on_balls,
    )
}


def table_of(found: list[Finding]) -> str:
    """All rows."""
    return table(["what", "expected", "source", "measured"], [f.cells() for f in found])
