"""The page of `rover benchmark`: results of several policies beside each other, in Markdown."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from rover_gym.drive.benchmark import BenchmarkResult, ScoredEpisode, ScoredSet
from rover_gym.drive.benchmark_sets import BenchmarkSet, benchmark_sets
from rover_gym.drive.comparison import in_markdown, interval_cell
from rover_gym.drive.evaluation import SUCCESSES, mean_estimate, summarise, wilson_interval
from rover_gym.record.channels import outcome_words

Table = list[tuple[str, ...]]

#: What stands where a policy was not driven.
NOTHING = "-"


def benchmark_page(results: Sequence[BenchmarkResult]) -> str:
    """The page of results, the best first: success on all sets, the figures of each set, and what made them."""
    version, sets = benchmark_sets()
    results = sorted(results, key=_rank)
    parts = [f"# Benchmark, version {version}", WORDS, in_markdown(success_table(results))]
    for one in sets.values():
        table = set_table(one, results)
        if len(table) > 1:
            parts += [f"## {one.name}", _about(one), in_markdown(table)]
    notes = list(_notes(results))
    parts += ["## Made with", in_markdown(made_table(results)), *notes]
    return "\n\n".join(parts) + "\n"


#: What the columns mean.
WORDS = """Success in percent with Wilson's 95% interval; *mean* is the mean over all sets. The other intervals are 95%,
too. Time is that of the episodes that reached the goal, energy the work of the wheel motors over the way driven, slip
the mean over an episode. *Peak impulse* is the largest impulse of the ground on the rover in 0.05 s over that of its
weight: 1 at rest. *Decision* is processor time, median and 99%, each the median over the episodes."""


def success_table(results: Sequence[BenchmarkResult]) -> Table:
    """Success of each policy on each set, and the mean over the sets of those that have driven all."""
    _, sets = benchmark_sets()
    table: Table = [("policy", *sets, "mean")]
    for result in results:
        driven = [result.sets.get(name, ScoredSet()).episodes for name in sets]
        mean = mean_success(result)
        table.append((result.policy, *map(_success, driven), NOTHING if mean is None else f"{100.0 * mean:.1f}"))
    return table


def mean_success(result: BenchmarkResult) -> float | None:
    """Mean over the sets of the share of episodes that succeeded; None where a set was not driven."""
    _, sets = benchmark_sets()
    driven = [result.sets.get(name, ScoredSet()).episodes for name in sets]
    if not all(driven):
        return None
    return sum(sum(episode.success for episode in one) / len(one) for one in driven) / len(driven)


def _rank(result: BenchmarkResult) -> tuple[float, str]:
    """Sorts by the mean success, the best first, then by name."""
    mean = mean_success(result)
    return (1.0 if mean is None else -mean, result.policy)


def set_table(one: BenchmarkSet, results: Sequence[BenchmarkResult]) -> Table:
    """The figures of each policy that has driven a set."""
    heads = (
        "policy",
        "episodes",
        "time to goal, s",
        "energy, J/m",
        "slip",
        "peak impulse",
        "decision, ms",
        "other ends",
    )
    table: Table = [heads]
    for result in results:
        episodes = result.sets.get(one.name, ScoredSet()).episodes
        if not episodes:
            continue
        row = summarise(result.policy, episodes)
        decisions = (
            sorted(getattr(episode, name) for episode in episodes) for name in ("decision_median", "decision_99")
        )
        table.append(
            (
                result.policy,
                str(len(episodes)) if len(episodes) == one.episodes else f"{len(episodes)} of {one.episodes}",
                interval_cell(row.time, ".1f"),
                interval_cell(row.energy_per_metre, ".0f"),
                interval_cell(row.slip, ".3f"),
                interval_cell(mean_estimate([episode.peak_impulse for episode in episodes]), ".2f"),
                ", ".join(f"{1e3 * times[len(times) // 2]:.2g}" for times in decisions),
                ", ".join(f"{n} {outcome_words(end)}" for end, n in row.ends.items() if n and end not in SUCCESSES),
            )
        )
    return table


def made_table(results: Sequence[BenchmarkResult]) -> Table:
    """What made the results of each policy."""
    table: Table = [("policy", "given as", "environment", "rover-gym", "revision", "machine")]
    for result in results:
        made, key = result.made, result.key
        revision = str(made.get("revision") or NOTHING)[:10]
        cells = (
            key.get("policy"),
            _interface(key),
            made.get("versions", {}).get("rover-gym"),
            revision,
            made.get("machine"),
        )
        table.append((result.policy, *(str(cell or NOTHING) for cell in cells)))
    return table


def _interface(key: Mapping[str, Any]) -> str:
    """How a policy met the rover."""
    arguments = ", ".join(f"{name}={value}" for name, value in key.get("arguments", {}).items())
    return " ".join(filter(None, (key.get("environment"), arguments)))


def _success(episodes: Sequence[ScoredEpisode]) -> str:
    if not episodes:
        return NOTHING
    reached = sum(episode.success for episode in episodes)
    low, high = wilson_interval(reached, len(episodes))
    return f"{100.0 * reached / len(episodes):.0f} ({100.0 * low:.0f} to {100.0 * high:.0f})"


def _about(one: BenchmarkSet) -> str:
    """What a set consists of."""
    given = one.arguments
    rover = given.get("model") or one.model
    facts = [f"`{one.environment}`", *(f"{name} {_span(value)}" for name, value in given.items() if name != "model")]
    facts += [f"rover {str(rover).removesuffix('.toml')}"] if rover else []
    if one.maps is not None:
        facts += [f"{one.episodes // one.episodes_per_map} maps of {one.maps['size']:g} m with craters"]
    facts += [f"seeds {one.seed} to {one.seed + one.episodes - 1}", f"at most {one.seconds:g} s"]
    return ", ".join(facts) + "."


def _span(value: Any) -> str:
    return f"{value[0]:g} to {value[1]:g}" if isinstance(value, list) else str(value)


def _notes(results: Sequence[BenchmarkResult]) -> Iterator[str]:
    """A line for each set that a policy does not fit."""
    for result in results:
        for name, one in result.sets.items():
            if one.refused is not None:
                yield f"`{result.policy}` has not driven {name}: {one.refused}"
