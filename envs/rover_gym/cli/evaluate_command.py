"""`rover evaluate` and `rover baseline`: policies beside each other on the same seeded episodes."""

import json
import math
from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.progress import Progress, TaskID
from rich.table import Table

from rover_gym.cli.console import (
    INTERRUPTED,
    LARGEST_SEED,
    MOST_EPISODES,
    AsJson,
    Results,
    check_folder,
    plain_errors,
    progress_bar,
)
from rover_gym.cli.options import (
    BUILT_IN,
    ModelName,
    complete_model,
    complete_policy,
    complete_terrain,
    named_model,
    warn_of_slope,
)
from rover_gym.env.arguments import MAX_SLOPE_DEG, terrain_name
from rover_gym.extras import MissingExtraError, require
from rover_gym.figures.policy_figure import draw_policies
from rover_gym.mechanics import OptionError
from rover_gym.policy.comparison import (
    BASELINE,
    Contender,
    comparison_report,
    comparison_table,
    drive_or_reuse,
    film_episode,
    guide_contender,
    planner_contender,
    trained_contender,
)
from rover_gym.policy.evaluation import (
    DIFFICULTIES,
    ENVIRONMENTS,
    BaselineInterrupt,
    BaselineRow,
    EvaluatedEpisode,
    PolicySummary,
    measure_baseline,
    summarise,
)
from rover_gym.policy.named_policy import NAMES_HELP, policy_title
from rover_gym.policy.pd_policy import PDPolicy
from rover_gym.validation import number, refuse


@plain_errors
def evaluate(
    policies: Annotated[
        list[str],
        typer.Argument(
            help="Folders of runs or of policies, or 'trained' for the package's.", autocompletion=complete_policy
        ),
    ],
    terrain: Annotated[
        str,
        typer.Option(
            help="'plane', 'rocks', 'hills', or the file of a map or a mesh.", autocompletion=complete_terrain
        ),
    ] = "rocks",
    model: ModelName = BUILT_IN,
    difficulty: Annotated[float | None, typer.Option(help="Of the rocks, from 0 to 2.")] = None,
    slope: Annotated[float | None, typer.Option(help="Of the plane, degrees.")] = None,
    episodes: Annotated[int, typer.Option(min=1, max=MOST_EPISODES, help="Of each policy.")] = 500,
    seed: Annotated[
        int, typer.Option(min=0, max=LARGEST_SEED, help="Of the first episode; the next ones count up.")
    ] = 1_000_000,
    output: Annotated[Path, typer.Option(file_okay=False, help="Folder of table, data and plot.")] = Path(
        "runs/evaluation"
    ),
    guide: Annotated[
        bool, typer.Option(help="Also drive the guide alone, that the first policy's actions offset.")
    ] = True,
    planner: Annotated[bool, typer.Option(help="Also drive the scan planner.")] = True,
    films: Annotated[int, typer.Option(min=0, help="Number of fields that are also filmed (extra render).")] = 0,
    threads: Annotated[int, typer.Option(min=1, help="That step the rovers.")] = 1,
    as_json: AsJson = False,
) -> None:
    """Drive every policy, the baseline and the planner over the same fields, and print success and energy.

    Writes evaluation.json, evaluation.md, with matplotlib evaluation.png, and every policy's episodes. A later
    evaluation into the same folder reuses those episodes if scene, seeds, the policy's files, the package's policies
    and its compiled core are the same. Intervals are 95%. The seeds differ from those of training, so the policies
    have not seen the fields.
    """
    terrain = terrain_name(terrain)
    if slope is not None:
        warn_of_slope(number("slope", slope, at_least=0.0, at_most=MAX_SLOPE_DEG))
    arguments: dict[str, Any] = {"terrain": terrain}
    arguments |= {} if model == BUILT_IN else {"model": model}
    arguments |= {} if difficulty is None else {"difficulty": difficulty}
    arguments |= {} if slope is None else {"slope_deg": slope}
    if films:
        for package in ("imageio_ffmpeg", "vtkmodules"):
            require(package, "render")
    trained = [trained_contender(policy, terrain) for policy in policies]
    contenders = _contenders(trained, model, guide=guide, planner=planner)
    check_folder("output", output)
    output.mkdir(parents=True, exist_ok=True)

    seeds = range(seed, seed + episodes)
    drives = _drives(contenders, seeds, arguments, output, threads)
    rows = [summarise(name, found) for name, found in drives.items()]
    if len(trained) > 1:
        together = [drive for contender in trained for drive in drives[contender.name]]
        rows.append(summarise(f"all {len(trained)} together", together))

    report = comparison_report(rows, arguments, seeds)
    written = _write(rows, report, output, is_printed=not as_json)
    for contender in contenders:
        for now in seeds[:films]:
            written.append(output / "films" / f"{contender.name.replace(' ', '-')}-seed{now}.mp4")
            film_episode(written[-1], contender.make, {**arguments, **contender.arguments}, now)
    with Results(as_json=as_json) as results:
        results.add(**report)
        for path in written:
            results.path("written", path)


def _drives(
    contenders: Sequence[Contender], seeds: range, arguments: Mapping[str, Any], output: Path, threads: int
) -> dict[str, list[EvaluatedEpisode]]:
    """The episodes of each contender by its name, read from the folder where they are still valid."""
    grounds = [Path(str(value)) for value in arguments.values() if Path(str(value)).is_file()]
    drives: dict[str, list[EvaluatedEpisode]] = {}
    with progress_bar() as bar:
        for contender in contenders:
            task = bar.add_task(contender.name, total=len(seeds), state="")
            drives[contender.name] = drive_or_reuse(
                contender,
                output / f"episodes-{contender.name.replace(' ', '-')}.json",
                seeds,
                arguments=arguments,
                files=grounds,
                threads=threads,
                progress=partial(_show, bar, task, len(seeds)),
            )
    return drives


def _write(rows: Sequence[PolicySummary], report: Mapping[str, Any], output: Path, *, is_printed: bool) -> list[Path]:
    """Writes table, data and plot, prints the table if asked, and returns the files."""
    table = comparison_table(rows)
    if is_printed:
        Console(highlight=False, soft_wrap=True).print(table, markup=False)
    (output / "evaluation.md").write_text(table + "\n", encoding="utf-8")
    (output / "evaluation.json").write_text(json.dumps(report, indent=2) + "\n", encoding="utf-8")
    written = [output / "evaluation.md", output / "evaluation.json"]
    try:
        draw_policies(rows, output / "evaluation.png")
        written.append(output / "evaluation.png")
    except MissingExtraError as error:
        typer.echo(f"no picture: {error}", err=True)
    return written


def _contenders(trained: list[Contender], model: str, *, guide: bool, planner: bool) -> list[Contender]:
    """All who drive, in the order of the table.

    Raises:
        OptionError: Two policies have the same name.
    """
    contenders = [Contender(BASELINE, PDPolicy)]
    if planner:
        contenders.append(planner_contender(named_model(model)))
    alone = guide_contender(trained[0]) if guide else None
    contenders += [*([] if alone is None else [alone]), *trained]
    names = [contender.name for contender in contenders]
    for i, name in enumerate(names):
        if name in names[:i]:
            refuse(OptionError, "policies", name, "must be folders of different names, which the rows are called by")
    return contenders


def _show(bar: Progress, task: TaskID, episodes: int, done: int) -> None:
    bar.update(task, completed=done, state=f"{done} of {episodes}")


CAUSES = {
    "time": "time limit",
    "high_centred": "high centred",
    "roll_over": "roll over",
    "left_field": "left the field",
    "step_failed": "step failed",
}


@plain_errors
def baseline(
    difficulty: Annotated[
        list[float] | None,
        typer.Option(help="Difficulty from 0 to 2; repeat for several. Default: five of them."),
    ] = None,
    episodes: Annotated[int, typer.Option(min=1, max=MOST_EPISODES, help="Episodes at each difficulty.")] = 200,
    seed: Annotated[
        int, typer.Option(min=0, max=LARGEST_SEED, help="Seed of the first episode; the others count up from it.")
    ] = 0,
    policy: Annotated[
        str,
        typer.Option(help=NAMES_HELP, autocompletion=complete_policy),
    ] = "pd",
    terrain: Annotated[
        str,
        typer.Option(help="The ground: 'rocks' on a plane, or 'hills'.", autocompletion=lambda: list(ENVIRONMENTS)),
    ] = "rocks",
    model: Annotated[
        str | None,
        typer.Option(
            help="The rover: a name of the gallery, or a model's file. Default: the built-in one.",
            autocompletion=complete_model,
        ),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Drive RoverRocks-v0 or RoverHills-v0 with a policy and print how often it reached the goal.

    The interval is Wilson's, 95%. Time is the mean of the episodes that reached the goal; energy the work through
    the wheel motors over the way driven. Ctrl-C ends the measurement: what is finished is printed.
    """
    terrain = terrain_name(terrain)
    difficulties = tuple(difficulty) if difficulty else DIFFICULTIES
    with progress_bar() as bar:
        task = bar.add_task("baseline", total=episodes * len(difficulties), state="")
        interrupted = False
        try:
            rows = measure_baseline(
                difficulties,
                episodes=episodes,
                seed=seed,
                policy=policy,
                terrain=terrain,
                model=model,
                progress=lambda level, done: bar.update(
                    task, advance=1, state=f"difficulty {level:g}, {done} of {episodes}"
                ),
            )
        except BaselineInterrupt as interrupt:
            interrupted, rows = True, interrupt.rows
    with Results(as_json=as_json) as results:
        results.add(environment=ENVIRONMENTS[terrain], model=model, policy=policy, seed=seed, rows=rows)
        if rows:
            results.show(_table(rows, seed, policy, ENVIRONMENTS[terrain]))
        if interrupted:
            done = sum(row.episodes for row in rows)
            typer.echo(f"interrupted: {done} of {episodes * len(difficulties)} episodes are done", err=True)
            raise typer.Exit(INTERRUPTED)


def _table(rows: Sequence[BaselineRow], seed: int, policy: str, environment: str) -> Table:
    last = seed + rows[0].episodes - 1
    title = f"{environment} with {policy_title(policy)}, {rows[0].episodes} episodes a row, seeds {seed} to {last}"
    table = Table(title=title, title_justify="left", box=SIMPLE_HEAD, pad_edge=False)
    for heading in ("difficulty", "success", "95% interval", "time to goal", "energy"):
        table.add_column(heading, justify="right")
    table.add_column("other ends")
    for row in rows:
        low, high = row.interval
        others = [f"{CAUSES[end]} {n}" for end, n in row.ends.items() if n and end != "goal"]
        table.add_row(
            f"{row.difficulty:g}",
            f"{row.success_rate:.1%}",
            f"{100.0 * low:.0f} to {high:.0%}",
            "-" if math.isnan(row.time_to_goal) else f"{row.time_to_goal:.1f} s",
            "-" if math.isnan(row.energy_per_metre) else f"{row.energy_per_metre:.0f} J/m",
            ", ".join(others),
        )
    return table
