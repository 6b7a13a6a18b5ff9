"""`rover baseline`: success of the PD baseline or another policy among rocks, by difficulty."""

import math
from collections.abc import Sequence
from typing import Annotated

import typer
from rich.box import SIMPLE_HEAD
from rich.table import Table

from rover_gym.cli.completion import complete_model, complete_policy
from rover_gym.cli.console import INTERRUPTED, LARGEST_SEED, MOST_EPISODES, plain_errors, progress_bar
from rover_gym.cli.results import AsJson, Results
from rover_gym.env.argument_checks import terrain_name
from rover_gym.policy.baseline import DIFFICULTIES, ENVIRONMENTS, BaselineInterrupt, BaselineRow, measure_baseline
from rover_gym.policy.named_policy import NAMES_HELP, policy_title

CAUSES = {"time": "time limit", "high_centred": "high centred", "roll_over": "roll over", "step_failed": "step failed"}


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
