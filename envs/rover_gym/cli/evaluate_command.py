"""`rover evaluate`: policies beside each other on the same seeded episodes."""

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.progress import Progress, TaskID
from rich.text import Text

from rover_gym.cli.console import (
    INTERRUPTED,
    MOST_EPISODES,
    AsJson,
    Results,
    plain_errors,
    plain_table,
    progress_bar,
)
from rover_gym.cli.options import (
    BUILT_IN,
    Arguments,
    EnvironmentName,
    ModelName,
    RayAddress,
    complete_policy,
    complete_terrain,
    given_arguments,
    is_model_file,
    known_environment,
    named_driver,
    named_model,
    warn_of_slope,
)
from rover_gym.cli.paths import Into, check_paths
from rover_gym.core import OptionError, RoverModel
from rover_gym.core.extras import MissingExtraError, require
from rover_gym.core.files import write_whole
from rover_gym.core.validation import number, refuse
from rover_gym.drive.benchmark_sets import check_training_seeds
from rover_gym.drive.comparison import (
    ComparedScene,
    Contender,
    comparison_report,
    comparison_table,
    drive_or_reuse,
    film_episode,
    in_markdown,
    named_contender,
    other_ends,
    policy_name,
    short_tables,
)
from rover_gym.drive.evaluation import EvaluatedEpisode, PolicySummary, drive_all, summarise
from rover_gym.drive.named_policy import NAMES, NAMES_HELP
from rover_gym.envs.arguments import MAX_SLOPE_DEG, terrain_name
from rover_gym.envs.start import DEFAULT_DIFFICULTY, MAX_DIFFICULTY
from rover_gym.show.figures.policy_figure import draw_policies


@plain_errors
def evaluate(
    policies: Annotated[
        list[str] | None,
        typer.Argument(help=f"Who drives: {NAMES_HELP[:-1]}. Default: pd.", autocompletion=complete_policy),
    ] = None,
    terrain: Annotated[
        str | None,
        typer.Option(
            help="'plane', 'rocks', 'hills', 'sand', or the file of a map or a mesh. Default: rocks.",
            autocompletion=complete_terrain,
        ),
    ] = None,
    environment: EnvironmentName = None,
    argument: Arguments = None,
    model: ModelName = BUILT_IN,
    difficulty: Annotated[
        list[float] | None, typer.Option(help="Difficulty of the ground, from 0 to 2; repeat it for several.")
    ] = None,
    slope: Annotated[float | None, typer.Option(help="Slope of the ground, degrees.")] = None,
    episodes: Annotated[
        int, typer.Option(min=1, max=MOST_EPISODES, help="Episodes of each policy at each difficulty.")
    ] = 500,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the first episode; the others count up from it.")] = (
        1_000_000
    ),
    output: Annotated[Path, typer.Option(file_okay=False, help="Folder of table, data and plot.")] = Path(
        "runs/evaluation"
    ),
    films: Annotated[int, typer.Option(min=0, help="Number of fields that are also filmed (extra render).")] = 0,
    threads: Annotated[int, typer.Option(min=1, help="Threads that step the rovers.")] = 1,
    ray: RayAddress = None,
    as_json: AsJson = False,
) -> None:
    """Drive policies over the same fields and compare success, time, energy and slip.

    Writes evaluation.json, evaluation.md, with matplotlib evaluation.png, and every policy's episodes. A later
    evaluation into the same folder reuses those episodes if scene, seeds, the policy's files, the package's policies
    and its compiled core are the same. Intervals are 95%: Wilson's for success. Time is that of the episodes that
    reached the goal; energy is the work through the wheel motors over the way driven. The default seeds are never
    used in training. Ctrl-C ends the evaluation: the policies that are done are printed and kept.
    """
    arguments = given_arguments(argument)
    if environment is None or terrain is not None:
        arguments["terrain"] = terrain_name(terrain or "rocks")
    if slope is not None:
        warn_of_slope(number("slope", slope, at_least=0.0, at_most=MAX_SLOPE_DEG))
    levels = [number("difficulty", level, at_least=0.0, at_most=MAX_DIFFICULTY) for level in difficulty or ()]
    arguments |= ({} if model == BUILT_IN else {"model": model}) | ({} if slope is None else {"slope_deg": slope})
    scenes: list[tuple[float | None, dict[str, Any]]] = [(None, arguments)]
    if len(levels) == 1:
        arguments["difficulty"] = levels[0]
    elif levels:
        scenes = [(level, {**arguments, "difficulty": level}) for level in levels]
    for package in ("imageio_ffmpeg", "vtkmodules") if films else ():
        require(package, "render")
    drive = _driver(ray, threads)
    contenders = _contenders(policies or ["pd"], model, environment)
    seeds = range(seed, seed + episodes)
    check_training_seeds(seeds)
    evaluation = _Evaluation(contenders, seeds, output, drive)
    reads = {"the ground": terrain, "the model": model, "the policy": [one.files for one in contenders]}
    check_paths(reads, output=Into(output, evaluation.names([level for level, _ in scenes], films)))
    output.mkdir(parents=True, exist_ok=True)
    with Results(as_json=as_json) as results:
        interrupted = not evaluation.drive_through(scenes)
        place = _scene(arguments, environment, model, seeds, levels)
        report = comparison_report(evaluation.rows, arguments, place)
        results.add(**report)
        if evaluation.rows:
            _show_rows(results, evaluation.rows, report, output, place)
        if interrupted:
            typer.echo(
                f"interrupted: {len(evaluation.drives)} of {len(contenders) * len(scenes)} rows are done", err=True
            )
            raise typer.Exit(INTERRUPTED)
        for level, scene in scenes:
            for path in evaluation.film(scene, level, films):
                results.path("written", path)


def _show_rows(
    results: Results, rows: Sequence[PolicySummary], report: Mapping[str, Any], output: Path, place: ComparedScene
) -> None:
    """Prints the tables, and writes table, data and plot."""
    table = comparison_table(rows)
    for level, short in short_tables(rows):
        here = place if level is None else replace(place, difficulties=(level,))
        results.show(Text(here.words, overflow="fold"))
        results.show(plain_table(short))
    for line in other_ends(rows):
        results.show(Text(line))
    for path in _write(rows, table, report, output, place.words):
        results.path("written", path)


@dataclass
class _Evaluation:
    """The episodes of all contenders, driven or reused.

    Attributes:
        contenders: Who drives, in the order of the table.
        seeds: Seeds of the episodes.
        output: Folder of the episodes' files.
        drive_seeds: Drives one episode per seed, as `drive_all`.
    """

    contenders: Sequence[Contender]
    seeds: range
    output: Path
    drive_seeds: Callable[..., list[EvaluatedEpisode]]

    def __post_init__(self) -> None:
        self.drives: list[PolicySummary] = []
        self.rows: list[PolicySummary] = []

    def names(self, difficulties: Sequence[float | None], films: int) -> list[str]:
        """The files that are written into the folder."""
        stems = [_stem(one.name, difficulty) for one in self.contenders for difficulty in difficulties]
        of_films = [f"films/{stem}-seed{seed}.mp4" for stem in stems for seed in self.seeds[:films]]
        tables = [f"evaluation.{ending}" for ending in ("md", "json", "png")]
        return [*tables, *(f"episodes-{stem}.json" for stem in stems), *of_films]

    def drive_through(self, scenes: Sequence[tuple[float | None, dict[str, Any]]]) -> bool:
        """Drives in all scenes, until Ctrl-C; whether it was not interrupted."""
        try:
            for level, scene in scenes:
                self.drive(scene, level)
        except KeyboardInterrupt:
            return False
        return True

    def drive(self, arguments: Mapping[str, Any], difficulty: float | None) -> None:
        """Adds a row for each contender on one ground, and one for all seeds of a trained policy together."""
        files = [Path(str(value)) for value in arguments.values() if Path(str(value)).is_file()]
        trained = []
        with progress_bar() as bar:
            for contender in self.contenders:
                task = bar.add_task(contender.name, total=len(self.seeds), state="")
                found = drive_or_reuse(
                    contender,
                    self.output / f"episodes-{_stem(contender.name, difficulty)}.json",
                    self.seeds,
                    arguments=arguments,
                    files=files,
                    drive=self.drive_seeds,
                    progress=partial(_show, bar, task, len(self.seeds)),
                )
                self.drives.append(summarise(contender.name, found, difficulty))
                self.rows.append(self.drives[-1])
                trained += [found] if contender.is_trained else []
        if len(trained) > 1:
            together = [drive for found in trained for drive in found]
            self.rows.append(summarise(f"all {len(trained)} together", together, difficulty))

    def film(self, arguments: Mapping[str, Any], difficulty: float | None, films: int) -> Iterator[Path]:
        """Films each contender on the first fields of a ground."""
        for contender in self.contenders:
            for seed in self.seeds[:films]:
                path = self.output / "films" / f"{_stem(contender.name, difficulty)}-seed{seed}.mp4"
                given = {**arguments, **contender.arguments}
                film_episode(path, contender.make, given, seed, contender.environment)
                yield path


def _driver(ray: str | None, threads: int) -> Callable[..., list[EvaluatedEpisode]]:
    """Drives episodes, as `drive_all`: on a cluster, or on this machine."""
    if ray is None:
        return partial(drive_all, threads=threads)
    require("ray", "rllib")
    from rover_gym.learn.cluster import connect, drive_on_cluster  # noqa: PLC0415 - needs the extra

    connect(ray)
    return partial(drive_on_cluster, ray)


def _stem(name: str, difficulty: float | None) -> str:
    """Part of the names of a row's files."""
    return name.replace(" ", "-") + ("" if difficulty is None else f"-{difficulty:g}")


def _write(
    rows: Sequence[PolicySummary],
    table: Sequence[Sequence[str]],
    report: Mapping[str, Any],
    output: Path,
    scene: str,
) -> list[Path]:
    """Writes table, data and plot, and returns the files."""
    write_whole(output / "evaluation.md", f"{scene}\n\n{in_markdown(table)}\n")
    write_whole(output / "evaluation.json", json.dumps(report, indent=2) + "\n")
    written = [output / "evaluation.md", output / "evaluation.json"]
    try:
        draw_policies(rows, output / "evaluation.png", scene)
        written.append(output / "evaluation.png")
    except MissingExtraError as error:
        typer.echo(f"no picture: {error}", err=True)
    return written


def _scene(
    arguments: Mapping[str, Any], environment: str | None, model: str, seeds: range, levels: Sequence[float]
) -> ComparedScene:
    """Where the policies drive, with the difficulty that is the default."""
    ground = str(arguments.get("terrain", environment))
    difficulties = tuple(levels)
    if not levels and ground in ("rocks", "hills", "sand"):
        difficulties = (DEFAULT_DIFFICULTY,)
    ground = ground if environment in (None, ground) else f"{environment} on {ground}"
    return ComparedScene(ground, "the built-in rover" if model == BUILT_IN else model, seeds, difficulties)


def _contender(policy: str, rover: RoverModel | None, environment: str | None) -> Contender:
    """A policy by its name, its folder or its file."""
    if is_model_file(policy):
        chosen = named_driver(policy, rover)
        name = policy_name(policy)
        return Contender(name, chosen.make, chosen.arguments, chosen.files, environment or "Rover-v0")
    return replace(named_contender(policy, rover), environment=environment)


def _contenders(policies: Sequence[str], model: str, environment: str | None = None) -> list[Contender]:
    """All who drive, in the order of the table: the package's policies, trained networks.

    Raises:
        OptionError: Two policies have the same name.
    """
    rover = named_model(model)
    name = None if environment is None else known_environment(environment)
    contenders = [_contender(policy, rover, name) for policy in policies]
    contenders.sort(key=lambda contender: contender.is_trained)
    names = [contender.name for contender in contenders]
    for i, name in enumerate(names):
        if name in names[:i]:
            what = "must be named once" if name in NAMES else "must be folders of different names, which name the rows"
            refuse(OptionError, "policies", name, what)
    return contenders


def _show(bar: Progress, task: TaskID, episodes: int, done: int) -> None:
    bar.update(task, completed=done, state=f"{done} of {episodes}")
