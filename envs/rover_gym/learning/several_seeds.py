"""What the trainings of one configuration with several seeds came to: a table with mean and interval."""

import json
import math
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

from rover_gym.learning.training_evaluation import TrainingEvaluation, read_evaluations
from rover_gym.mechanics import OptionError
from rover_gym.policy.comparison import in_markdown
from rover_gym.policy.evaluation import IntervalEstimate
from rover_gym.validation import refuse, whole


@dataclass(frozen=True)
class SeedResult:
    """The training of one seed, by its evaluations.

    Attributes:
        run: Name of the run's folder.
        seed: The seed.
        last: The evaluation at the end.
        best: The best evaluation: most successes, then least energy.
        cpu_seconds: CPU time of the training, s.
    """

    run: str
    seed: int
    last: TrainingEvaluation
    best: TrainingEvaluation
    cpu_seconds: float


def read_seed(folder: Path) -> SeedResult:
    """Reads what a training left.

    Raises:
        OptionError: Its files are damaged, or hold no evaluation.
        OSError: They cannot be read.
    """
    try:
        report = json.loads((folder / "run.json").read_text(encoding="utf-8"))
        seed, cpu_seconds = int(report["seed"]), float(report["cpu_seconds"])
    except (ValueError, LookupError, TypeError) as error:
        refuse(OptionError, "run", str(folder), f"has a damaged run.json ({error})")
    evaluations = read_evaluations(folder / "evaluations.csv")
    if not evaluations:
        refuse(OptionError, "run", str(folder), "contains no evaluation")
    best = evaluations[0]
    for evaluation in evaluations[1:]:
        best = evaluation if evaluation.is_better_than(best) else best
    return SeedResult(folder.name, seed, evaluations[-1], best, cpu_seconds)


def seed_estimate(values: Sequence[float]) -> IntervalEstimate:
    """Mean over seeds with its 95% interval by Student's t, `mean +- t s / sqrt(n)`; NaN if there are too few."""
    n = len(values)
    mean = math.fsum(values) / n if n else math.nan
    if n < 2:
        return IntervalEstimate(mean, (math.nan, math.nan))
    deviation = math.sqrt(math.fsum((value - mean) ** 2 for value in values) / (n - 1))
    half = student_quantile(n - 1) * deviation / math.sqrt(n)
    return IntervalEstimate(mean, (mean - half, mean + half))


def student_quantile(freedom: int) -> float:
    """The 97.5% quantile of Student's t distribution, by bisection of its distribution function.

    Args:
        freedom: Degrees of freedom, one or more.

    Raises:
        OptionError: `freedom` is no whole number or less than one.
    """
    freedom = whole("freedom", freedom, at_least=1)
    low, high = 1.0, 13.0  # of one degree of freedom: 12.706
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if _within(middle, freedom) < 0.95 else (low, middle)
    return 0.5 * (low + high)


def _within(t: float, freedom: int) -> float:
    """Probability of `[-t, t]`: a finite series in the cosine of `atan(t / sqrt(freedom))`."""
    angle = math.atan2(t, math.sqrt(freedom))
    sine, cosine = math.sin(angle), math.cos(angle)
    odd = freedom % 2
    term, total = (cosine if odd else 1.0), 0.0
    for k in range(odd, freedom - 1, 2):
        total += term
        term *= cosine * cosine * (k + 1) / (k + 2)
    return 2.0 / math.pi * (angle + sine * total) if odd else sine * total


def write_seeds(results: Sequence[SeedResult], stem: Path) -> list[tuple[str, ...]]:
    """Writes the summary of several seeds as JSON and Markdown, `stem` with these endings.

    Returns:
        The rows of the table, the headings first.
    """
    quantities: dict[str, Callable[[SeedResult], float]] = {
        "success": lambda result: result.last.success,
        "best_success": lambda result: result.best.success,
        "energy_per_metre": lambda result: result.last.energy_per_metre,
        "cpu_seconds": lambda result: result.cpu_seconds,
    }
    means = {name: seed_estimate([value(result) for result in results]) for name, value in quantities.items()}
    report = {
        "seeds": [asdict(result) for result in results],
        "means": {name: _without_nan(estimate) for name, estimate in means.items()},
    }
    stem.parent.mkdir(parents=True, exist_ok=True)
    text = json.dumps(report, indent=2) + "\n"
    stem.with_name(f"{stem.name}.json").write_text(text, encoding="utf-8")
    table = _table(results, means)
    stem.with_name(f"{stem.name}.md").write_text(in_markdown(table) + "\n", encoding="utf-8")
    return table


def _table(results: Sequence[SeedResult], means: dict[str, IntervalEstimate]) -> list[tuple[str, ...]]:
    lines: list[tuple[str, ...]] = [
        ("run", "success at the end", "best success", "at decisions", "energy, J/m", "CPU time, s")
    ]
    for result in results:
        last, best = result.last, result.best
        cells = (
            result.run,
            f"{last.success:.1%} ({100.0 * last.low:.1f} to {last.high:.1%})",
            f"{best.success:.1%}",
            str(best.decisions),
            f"{last.energy_per_metre:.0f}",
            f"{result.cpu_seconds:.0f}",
        )
        lines.append(cells)
    cells = (
        f"mean of {len(results)} seeds",
        _cell(means["success"], 100.0, ".1f", "%"),
        _cell(means["best_success"], 100.0, ".1f", "%"),
        "",
        _cell(means["energy_per_metre"], 1.0, ".0f"),
        _cell(means["cpu_seconds"], 1.0, ".0f"),
    )
    lines.append(cells)
    return lines


def _cell(estimate: IntervalEstimate, factor: float, form: str, unit: str = "") -> str:
    low, high = estimate.interval
    half = "" if math.isnan(low) else f" ± {0.5 * factor * (high - low):{form}}"
    return f"{factor * estimate.value:{form}}{half}{unit}"


def _without_nan(estimate: IntervalEstimate) -> dict[str, object]:
    """The estimate for JSON, which lacks NaN."""
    low, high = estimate.interval
    interval = None if math.isnan(low) else [low, high]
    return {"value": None if math.isnan(estimate.value) else estimate.value, "interval": interval}
