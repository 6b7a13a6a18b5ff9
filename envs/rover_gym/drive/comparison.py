"""Compares policies on the same seeded episodes: who drives, episodes that are kept, and the table."""

import hashlib
import json
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, Self

import gymnasium as gym
import numpy as np
import numpy.typing as npt

from rover_gym.core.files import write_whole
from rover_gym.drive.arcs.arc_network_policy import ARCS_FILE
from rover_gym.drive.commands.driven import Policy
from rover_gym.drive.evaluation import (
    SUCCESSES,
    Episode,
    EvaluatedEpisode,
    IntervalEstimate,
    PolicySummary,
    drive_all,
    drive_each,
    run_episode,
    timed,
)
from rover_gym.drive.named_policy import NAMES, named_policy
from rover_gym.envs.rover_env import RoverEnv
from rover_gym.envs.time_limits import MAX_EPISODE_STEPS
from rover_gym.models.lookup import ModelLike
from rover_gym.record.channels import outcome_words
from rover_gym.show.frames.caption import captioned
from rover_gym.show.frames.render_options import VideoWriter

#: Longest episode of a comparison, s.
EPISODE_SECONDS = MAX_EPISODE_STEPS * 0.05


@dataclass(frozen=True)
class Contender:
    """A policy of a comparison.

    Attributes:
        name: Name of its row.
        make: Makes it from an environment.
        arguments: Arguments of `RoverEnv` that it needs.
        files: Files that it is read from.
        environment: The registered environment that it drives, one episode after the other; None for `Rover-v0`, many
            at a time.
    """

    name: str
    make: Callable[[Any], Policy]
    arguments: Mapping[str, Any] = field(default_factory=dict)
    files: tuple[Path, ...] = ()
    environment: str | None = None

    @property
    def is_trained(self) -> bool:
        """Whether the policy is a network of a run of `rover train`."""
        return self.name not in NAMES and any(path.name == ARCS_FILE for path in self.files)


def named_contender(policy: str, model: ModelLike | None = None) -> Contender:
    """A policy by its name or folder, as `named_policy` takes it.

    Raises:
        PolicyError: There is none.
        OSError: Its files may not be read.
    """
    chosen = named_policy(policy, model)
    return Contender(policy_name(policy), chosen.make, chosen.arguments, chosen.files)


def policy_name(policy: str) -> str:
    """Name of a policy's row: its own, its folder's or its file's, of `module:name` with a dot."""
    path = Path(policy.replace(":", "."))
    if path.suffix not in (".zip", ".onnx"):
        return path.name
    return path.parent.name if path.stem == "model" and path.parent.name else path.stem


def drive_or_reuse(
    contender: Contender,
    path: Path,
    seeds: range,
    *,
    arguments: Mapping[str, Any],
    files: Sequence[Path] = (),
    drive: Callable[..., list[EvaluatedEpisode]] = drive_all,
    progress: Callable[[int], None] = lambda _done: None,
) -> list[EvaluatedEpisode]:
    """Drives one episode per seed, or reuses the episodes of an earlier call if nothing has changed.

    Args:
        contender: Who drives.
        path: The JSON file of the episodes. They are reused if arguments, seeds, the content of all files, the
            package's policies and its compiled core are the same.
        seeds: Seeds of the resets.
        arguments: Arguments of `RoverEnv`.
        files: Files that the arguments name: maps, models.
        drive: Drives one episode per seed, with the parameters of `drive_all`.
        progress: Called with the number of episodes done.

    Raises:
        OptionError: An argument is out of range.
        OSError: The file cannot be written.
    """
    environment = {**arguments, **contender.arguments}
    key = {
        "id": contender.environment,
        "environment": environment,
        "seeds": [seeds.start, len(seeds)],
        "files": digest([*files, *contender.files]),
    }
    plain_key = json.loads(json.dumps(key))
    kept = _kept(path, plain_key)
    if kept is not None:
        return kept
    if contender.environment is None:
        drives = drive(contender.make, seeds, arguments=environment, progress=progress)
    else:
        env = timed(gym.make(contender.environment, max_episode_steps=-1, **environment), EPISODE_SECONDS)
        drives = drive_each(env, contender.make(env), seeds, progress=progress)
        env.close()
    plain = {"key": plain_key, "drives": [asdict(drive) for drive in drives]}
    write_whole(path, json.dumps(plain) + "\n")
    return drives


def digest(files: Sequence[Path]) -> str:
    """SHA-256 of a policy's files, the package's policies and the compiled core: what episodes depend on."""
    package = Path(__file__).parents[1]
    digest = hashlib.sha256()
    for path in (*files, *sorted(package.glob("drive/**/*.py")), *sorted(package.glob("_core.*[!i]"))):
        digest.update(path.name.encode() + hashlib.sha256(path.read_bytes()).digest())
    return digest.hexdigest()


def _kept(path: Path, key: Any) -> list[EvaluatedEpisode] | None:
    """The episodes of an earlier evaluation; None if it does not match or its file is damaged."""
    try:
        kept = json.loads(path.read_text(encoding="utf-8"))
        return [EvaluatedEpisode(**drive) for drive in kept["drives"]] if kept["key"] == key else None
    except (OSError, ValueError, LookupError, TypeError, RecursionError):
        return None


def comparison_table(rows: Sequence[PolicySummary]) -> list[tuple[str, ...]]:
    """The figures of policies as the rows of a table, the headings first."""
    heads = ("policy", "difficulty", "success", "95% interval", "time to goal, s", "energy, J/m", "slip", "tilt, °")
    table = [(*heads, "other ends")]
    for row in rows:
        low, high = row.success.interval
        table.append(
            (
                row.policy,
                "" if row.difficulty is None else f"{row.difficulty:g}",
                f"{row.successes} of {row.episodes}, {row.success.value:.1%}",
                f"{100.0 * low:.1f} to {high:.1%}",
                interval_cell(row.time, ".1f"),
                interval_cell(row.energy_per_metre, ".0f"),
                interval_cell(row.slip, ".3f"),
                interval_cell(row.tilt, ".2f"),
                ", ".join(f"{n} {outcome_words(end)}" for end, n in row.ends.items() if n and end not in SUCCESSES),
            )
        )
    kept = [i for i in range(len(table[0])) if i != 1 or any(row[1] for row in table[1:])]
    return [tuple(row[i] for i in kept) for row in table]


def short_tables(rows: Sequence[PolicySummary]) -> list[tuple[float | None, list[tuple[str, ...]]]]:
    """The figures of policies for a terminal of 80 columns: for each difficulty a table, the headings first."""
    tables = []
    for level in dict.fromkeys(row.difficulty for row in rows):
        table: list[tuple[str, ...]] = [("policy", "success", "95%", "time, s", "J/m", "slip, %", "tilt, °")]
        for row in rows:
            if row.difficulty == level:
                low, high = row.success.interval
                cells = (
                    interval_cell(row.time, ".1f"),
                    interval_cell(row.energy_per_metre, ".0f"),
                    interval_cell(row.slip, ".1f", 100.0),
                    interval_cell(row.tilt, ".1f"),
                )
                table.append(
                    (row.policy, f"{row.success.value:.1%}", f"{100.0 * low:.0f} to {100.0 * high:.0f}", *cells)
                )
        tables.append((level, table))
    return tables


def other_ends(rows: Sequence[PolicySummary]) -> list[str]:
    """A line for each policy that missed goals: how its other episodes ended."""
    lines = []
    for row in rows:
        found = ", ".join(f"{n} {outcome_words(end)}" for end, n in row.ends.items() if n and end not in SUCCESSES)
        where = "" if row.difficulty is None else f" at difficulty {row.difficulty:g}"
        lines += [f"{row.policy}{where}, other ends: {found}"] if found else []
    return lines


@dataclass(frozen=True)
class ComparedScene:
    """Where policies are compared.

    Attributes:
        ground: The ground, or the environment where none is given.
        model: The rover.
        seeds: Seeds of the episodes.
        difficulties: The difficulties; none where the ground has no rocks.
    """

    ground: str
    model: str
    seeds: range
    difficulties: tuple[float, ...] = ()

    @property
    def words(self) -> str:
        """The scene in one line."""
        levels = ", ".join(f"{level:g}" for level in self.difficulties)
        difficulty = f", difficulty {levels}" if levels else ""
        return f"{self.ground}{difficulty}, {self.model}, seeds {self.seeds.start} to {self.seeds.stop - 1}"

    def report(self) -> dict[str, Any]:
        """The scene for JSON."""
        seeds = [self.seeds.start, self.seeds.stop - 1]
        return {**vars(self), "difficulties": list(self.difficulties), "seeds": seeds}


def in_markdown(table: Sequence[Sequence[str]]) -> str:
    """A table, whose first row are its headings, in Markdown."""
    lines = ["| " + " | ".join(row) + " |" for row in table]
    return "\n".join([lines[0], "|" + "---|" * len(table[0]), *lines[1:]])


def interval_cell(estimate: IntervalEstimate, form: str, factor: float = 1.0) -> str:
    """An estimate as a cell of a table, with half its interval."""
    if math.isnan(estimate.value):
        return "-"
    value, half = factor * estimate.value, 0.5 * factor * (estimate.interval[1] - estimate.interval[0])
    return f"{value:{form}}" if math.isnan(half) else f"{value:{form}} ± {half:{form}}"


def comparison_report(
    rows: Sequence[PolicySummary], arguments: Mapping[str, Any], scene: ComparedScene
) -> dict[str, Any]:
    """The figures of policies for JSON, which lacks NaN."""
    return {
        "environment": dict(arguments),
        **scene.report(),
        "episodes": len(scene.seeds),
        "seed": scene.seeds.start,
        "rows": [_without_nan(asdict(row)) for row in rows],
    }


def _without_nan(value: Any) -> Any:
    """Replaces NaN by None."""
    if isinstance(value, dict):
        return {key: _without_nan(entry) for key, entry in value.items()}
    if isinstance(value, (list, tuple)):
        return [_without_nan(entry) for entry in value]
    return None if isinstance(value, float) and math.isnan(value) else value


ENDING = 20  # frames for which the outcome stands, 1 s


class EpisodeFilm:
    """Films episodes one after the other, each with its time and, at its end, its outcome; a context manager.

    Args:
        path: The file, `.mp4`; its folder is made.
        fps: Frames per second.
        title: What drives where, in the first line of every frame.

    Raises:
        OptionError: The file name has another extension.
        MissingExtraError: The extra `render` is not installed.
    """

    def __init__(self, path: str | Path, fps: float, title: str) -> None:
        self._writer, self._title = VideoWriter(path, fps), title
        self._last: npt.NDArray[np.uint8] | None = None

    def show(self, rover: RoverEnv, seed: int, time: float) -> None:
        """Adds the environment's current picture, at a time, s."""
        if (frame := rover.render()) is not None:
            self._last = frame
            self._writer.append(captioned(frame, (f"{self._title}, seed {seed}", f"{time:.2f} s")))

    def end(self, episode: Episode) -> None:
        """Holds the last picture with the outcome."""
        if self._last is not None:
            outcome = f"{outcome_words(episode.end)} after {episode.time:.2f} s"
            frame = captioned(self._last, (f"{self._title}, seed {episode.seed}", outcome))
            for _ in range(ENDING):
                self._writer.append(frame)
            self._last = None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._writer.close()


def film_episode(
    path: Path,
    make_policy: Callable[[Any], Policy],
    arguments: Mapping[str, Any],
    seed: int,
    environment: str | None = None,
) -> Episode:
    """Drives one episode of at most 60 s and films it.

    Args:
        path: The file, `.mp4`; its folder is made.
        make_policy: Makes the policy from an environment.
        arguments: Arguments of `RoverEnv`.
        seed: Seed of the reset.
        environment: The registered environment; `Rover-v0` by default.

    Raises:
        MissingExtraError: The extra `render` is not installed.
        RoverGymError: An argument is out of range.
    """
    rendering: dict[str, Any] = {"render_mode": "rgb_array", "render_options": {}}
    made = gym.make(environment or "Rover-v0", max_episode_steps=-1, **arguments, **rendering)
    env = timed(made, EPISODE_SECONDS)
    try:
        with EpisodeFilm(path, env.metadata["render_fps"], path.stem) as film:

            def on_step(rover: RoverEnv, info: Mapping[str, Any]) -> None:
                film.show(rover, seed, info["time"])

            rover: RoverEnv = env.unwrapped  # type: ignore[assignment] # `timed` has checked it
            rover.on_period = on_step
            episode = run_episode(env, make_policy(env), seed)
            film.end(episode)
            return episode
    finally:
        env.close()
