"""Success, time and energy of the package's policies: `make policies`, which writes `docs/comparison/policies.json`.

The groups of scenes below are the tables of `docs/policy-results.md`. The episodes of a scene that have been driven
before, under `runs/policies`, are not driven again unless a policy or the core has changed.
"""

import argparse
import json
import math
from collections.abc import Iterator, Mapping
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from reports import ROOT, table as table_of, write_json
from rich.console import Console

from comparison.machine import versions
from comparison.output import CHART
from rover_gym.drive.comparison import Contender, drive_or_reuse, named_contender
from rover_gym.drive.evaluation import SUCCESSES, EvaluatedEpisode, summarise
from rover_gym.record.channels import outcome_words

EPISODES = ROOT / "runs" / "policies"
FILE = "policies.json"
ALL = ("pd", "scan", "foresight", "anywhere", "guided")
#: The policy over whose energy that of the others is given.
YARDSTICK = "scan"


@dataclass(frozen=True)
class Group:
    """Policies on some scenes, which a table shows.

    Attributes:
        scenes: What is driven, by its name in the table: arguments of `RoverEnv`; `environment` may be among them.
        policies: Who drives.
        episodes: Of each policy on each scene.
        seed: Of the first episode.
    """

    scenes: Mapping[str, Mapping[str, Any]]
    policies: tuple[str, ...] = ALL
    episodes: int = 200
    seed: int = 1_000_000


def _fields(terrain: str, *levels: float) -> dict[str, dict[str, Any]]:
    return {f"{terrain}, {level:g}": {"terrain": terrain, "difficulty": level} for level in levels}


def _rover(model: str, level: float) -> tuple[str, dict[str, Any]]:
    return f"`{model}`, {level:g}", {"terrain": "rocks", "model": model, "difficulty": level}


def _course(terrain: str, level: float | None) -> tuple[str, dict[str, Any]]:
    arguments = {"environment": "RoverWaypoints-v0", "terrain": terrain}
    if level is None:
        return f"five goals, {terrain}", arguments
    return f"five goals, {terrain} {level:g}", {**arguments, "difficulty": level}


GROUPS: Mapping[str, Group] = {
    "rocks": Group(_fields("rocks", 1.0, 1.5, 2.0)),
    "hills": Group(_fields("hills", 1.0, 1.5)),
    "steep": Group(_fields("hills", 2.0), episodes=50),
    "rovers": Group(
        dict(
            [
                *(_rover("open-rover", level) for level in (1.0, 2.0)),
                *(_rover(name, 1.0) for name in ("skid-steered", "four-steered", "mars-rover")),
            ]
        ),
        policies=("scan", "anywhere", "guided"),
        episodes=50,
    ),
    "courses": Group(
        dict([_course("plane", None), _course("rocks", 0.5), _course("rocks", 1.0), _course("hills", 0.5)])
        | {"battery of 7000 J": {"environment": "RoverBattery-v0"}},
        policies=("pd", "scan", "guided"),
        episodes=50,
    ),
    "trap": Group({"trap": {"environment": "RoverTrap-v0"}}, episodes=50),
    "sand": Group(
        {"sand, 0.5": {"terrain": "sand", "difficulty": 0.5}}, policies=("pd", "scan", "anywhere", "sand"), episodes=50
    ),
}


@cache
def contender(policy: str, environment: str | None, model: str | None) -> Contender:
    """Who drives an environment with a model."""
    found = named_contender(policy, model)
    return Contender(found.name, found.make, found.arguments, found.files, environment)


def driven(group: str, scene: str, policy: str) -> list[EvaluatedEpisode]:
    """The episodes of a policy on a scene, driven unless they were."""
    own = GROUPS[group]
    arguments = dict(own.scenes[scene])
    who = contender(policy, arguments.pop("environment", None), arguments.get("model"))
    stem = "".join(letter if letter.isalnum() else "-" for letter in f"{group} {scene} {policy}")
    seeds = range(own.seed, own.seed + own.episodes)
    return drive_or_reuse(who, EPISODES / f"{stem}.json", seeds, arguments=arguments)


def row(found: list[EvaluatedEpisode], yardstick: list[EvaluatedEpisode]) -> dict[str, Any]:
    """The figures of a policy on a scene.

    Args:
        found: Its episodes.
        yardstick: Those of `YARDSTICK`, on the same seeds; energies are compared where both have reached the goal.
    """
    summary = summarise("", found)
    ratios = [
        math.log(one.energy / other.energy)
        for one, other in zip(found, yardstick, strict=True)
        if one.success and other.success
    ]
    spread = 1.96 * float(np.std(ratios, ddof=1)) / math.sqrt(len(ratios)) if len(ratios) > 1 else math.nan
    mean = float(np.mean(ratios)) if ratios else math.nan
    figures = {
        "episodes": summary.episodes,
        "successes": summary.successes,
        "interval": summary.success.interval,
        "time": summary.time.value,
        "energy_per_metre": summary.energy_per_metre.value,
        "energy_ratio": [math.exp(mean + k * spread) for k in (-1.0, 0.0, 1.0)],
        "ends": {end: n for end, n in summary.ends.items() if n and end not in SUCCESSES},
    }
    return json.loads(json.dumps(figures).replace("NaN", "null"))  # type: ignore[no-any-return]


def measured(name: str) -> Iterator[dict[str, Any]]:
    """The rows of a group."""
    for scene in GROUPS[name].scenes:
        episodes = {policy: driven(name, scene, policy) for policy in GROUPS[name].policies}
        for policy, found in episodes.items():
            yield {"group": name, "scene": scene, "policy": policy, **row(found, episodes[YARDSTICK])}


def _jobs() -> list[tuple[str, str, str]]:
    return [
        (name, scene, policy) for name, group in GROUPS.items() for scene in group.scenes for policy in group.policies
    ]


def _drive(job: tuple[str, str, str]) -> str:
    driven(*job)
    return ", ".join(job)


def _percent(one: Mapping[str, Any]) -> str:
    return f"{100.0 * one['successes'] / one['episodes']:.1f}".removesuffix(".0")


def table(data: Mapping[str, Any], name: str) -> str:
    """The table of a group, in Markdown."""
    over = f"over `{YARDSTICK}`"
    heads = ("scene", "policy", "success", "95% interval", "time to goal", "energy", over, "other ends")
    lines = []
    last = ""
    for one in data["rows"]:
        if one["group"] != name:
            continue
        low, high = (100.0 * bound for bound in one["interval"])
        ratio = one["energy_ratio"]
        lines.append(
            (
                "" if one["scene"] == last else one["scene"],
                f"`{one['policy']}`",
                f"{_percent(one)}%",
                f"{low:.1f} to {high:.1f}%",
                "" if one["time"] is None else f"{one['time']:.1f} s",
                f"{one['energy_per_metre']:.0f} J/m",
                "" if ratio[0] is None or one["policy"] == YARDSTICK else "{1:.2f}, {0:.2f} to {2:.2f}".format(*ratio),
                ", ".join(f"{n} {outcome_words(end)}" for end, n in one["ends"].items()),
            )
        )
        last = one["scene"]
    return table_of(heads, lines)


def short_table(data: Mapping[str, Any]) -> str:
    """Success among rocks, a column a policy, in Markdown."""
    lines = []
    for scene, arguments in GROUPS["rocks"].scenes.items():
        own = {one["policy"]: one for one in data["rows"] if one["scene"] == scene}
        cells = []
        for policy in ALL:
            low, high = (100.0 * bound for bound in own[policy]["interval"])
            cells.append(f"{success(data, scene, policy)}%, {low:.1f} to {high:.1f}")
        lines.append([f"{arguments['difficulty']:g}", *cells])
    return table_of(["difficulty", *(f"`{policy}`" for policy in ALL)], lines)


def success(data: Mapping[str, Any], scene: str, policy: str) -> str:
    """The success of a policy on a scene, in percent.

    Raises:
        LookupError: It was not measured.
    """
    for one in data["rows"]:
        if (one["scene"], one["policy"]) == (scene, policy):
            return _percent(one)
    raise LookupError(f"{FILE}: no {policy} on {scene}")


def main() -> None:
    """Drives what has not been driven, and writes the file."""
    parser = argparse.ArgumentParser(description="Success, time and energy of the package's policies.")
    parser.add_argument("--workers", type=int, default=2, help="processes that drive")
    workers = parser.parse_args().workers
    console = Console(width=100)
    EPISODES.mkdir(parents=True, exist_ok=True)
    with ProcessPoolExecutor(workers) as pool:
        for done in pool.map(_drive, _jobs()):
            console.print(done)
    groups = {
        name: {"episodes": group.episodes, "seed": group.seed, "scenes": dict(group.scenes)}
        for name, group in GROUPS.items()
    }
    rows = [one for name in GROUPS for one in measured(name)]
    meta = {"command": "make policies", "packages": versions(), "groups": groups}
    write_json(CHART / FILE, {"meta": meta, "rows": rows}, a_line_each="group")


if __name__ == "__main__":
    main()
