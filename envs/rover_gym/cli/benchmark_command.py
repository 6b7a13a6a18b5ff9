"""`rover benchmark`: scores policies on fixed sets, and puts them beside this package's policies."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.progress import Progress

from rover_gym.cli.console import INTERRUPTED, AsJson, Results, plain_errors, plain_table, progress_bar
from rover_gym.cli.options import (
    DRIVERS_HELP,
    Arguments,
    EnvironmentName,
    complete_policy,
    given_arguments,
    known_environment,
    named_driver,
)
from rover_gym.cli.paths import Into, check_paths
from rover_gym.core import OptionError
from rover_gym.core.files import write_whole
from rover_gym.core.validation import refuse
from rover_gym.drive.benchmark import ROVER, BenchmarkResult, Interface, baselines, score
from rover_gym.drive.benchmark_page import benchmark_page, success_table
from rover_gym.drive.benchmark_sets import benchmark_sets
from rover_gym.drive.comparison import digest, policy_name
from rover_gym.learn.provenance import provenance


@plain_errors
def benchmark(
    policies: Annotated[
        list[str],
        typer.Argument(
            help=f"Who drives: {DRIVERS_HELP[:-1]}. Or a file of an earlier benchmark (.json), which is only shown.",
            autocompletion=complete_policy,
        ),
    ],
    sets: Annotated[
        list[str] | None,
        typer.Option(
            "--set",
            help="A set; repeat it for several. Default: all.",
            autocompletion=lambda: list(benchmark_sets()[1]),
        ),
    ] = None,
    episodes: Annotated[
        int | None, typer.Option(min=1, help="Only the first so many episodes of each set, for a first look.")
    ] = None,
    environment: EnvironmentName = None,
    argument: Arguments = None,
    output: Annotated[Path, typer.Option(file_okay=False, help="Folder of the results, a file a policy.")] = Path(
        "runs/benchmark"
    ),
    page: Annotated[
        Path | None, typer.Option(dir_okay=False, help="The page. Default: benchmark.md in the folder of the results.")
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Score policies on fixed sets: rocks, hills, sand, traps, maps, three rovers.

    Writes NAME.json with every episode for each policy, and a page that has the policies of this package beside them.
    A later call into the same folder drives only the episodes that are missing, unless the policy's files, the
    package's policies or its compiled core have changed. Episodes are driven one after the other, on one core.

    The environment and its arguments are those that the policy observes and acts by, such as height_scan=true; ground,
    rover and time limit belong to the sets. `rover train` refuses the seeds of the sets, and one of the rovers.
    """
    interface = Interface(known_environment(environment or ROVER), given_arguments(argument))
    page = page or output / "benchmark.md"
    results = [BenchmarkResult.read(policy) for policy in policies if policy.endswith(".json")]
    to_drive = [policy for policy in policies if not policy.endswith(".json")]
    names = [*(one.policy for one in results), *map(policy_name, to_drive)]
    for i, name in enumerate(names):
        if name in names[:i]:
            refuse(OptionError, "policies", name, "must be named once")
    files = Into(output, [f"{policy_name(policy)}.json" for policy in to_drive])
    check_paths({"the policy": policies}, output=files, page=page)
    with Results(as_json=as_json) as said:
        try:
            for policy in to_drive:
                path = output / f"{policy_name(policy)}.json"
                results.append(_scored(policy, path, interface, tuple(sets or ()), episodes))
                said.path("results", path)
        except KeyboardInterrupt:
            typer.echo("interrupted: the next call goes on after the sets that are done", err=True)
            raise typer.Exit(INTERRUPTED) from None
        shown = [*results, *(one for one in baselines() if one.policy not in names)]
        write_whole(page, benchmark_page(shown))
        table = success_table(shown)
        said.add(version=benchmark_sets()[0], success=[dict(zip(table[0], row, strict=True)) for row in table[1:]])
        said.show(plain_table(table))
        said.path("page", page)


def _scored(
    policy: str, path: Path, interface: Interface, sets: tuple[str, ...], episodes: int | None
) -> BenchmarkResult:
    """The results of a policy: those of its file if it is of the same policy and package, and what they lack."""
    named = named_driver(policy)
    key: Mapping[str, Any] = {
        "policy": policy,
        "environment": interface.environment,
        "arguments": dict(interface.arguments),
        "digest": digest(named.files),
    }
    result = BenchmarkResult(policy_name(policy), key, provenance(), _kept(path, key))
    with _shown(result.policy) as show:
        score(result, path, partial(named_driver, policy), interface, names=sets, episodes=episodes, progress=show)
    return BenchmarkResult.read(path)  # as the file rounds them


def _kept(path: Path, key: Mapping[str, Any]) -> dict[str, Any]:
    """The sets of an earlier file if it depends on the same; none if there is no such file."""
    try:
        before = BenchmarkResult.read(path)
    except (OSError, OptionError):
        return {}
    return dict(before.sets) if before.key == key else {}


@contextmanager
def _shown(policy: str) -> Iterator[Any]:
    """A progress bar with a line for each set."""
    with progress_bar() as bar:
        yield partial(_show, bar, policy, {})


def _show(bar: Progress, policy: str, tasks: dict[str, Any], name: str, of: int, done: int) -> None:
    if name not in tasks:
        tasks[name] = bar.add_task(f"{policy}, {name}", total=of, state="")
    bar.update(tasks[name], completed=done, state=f"{done} of {of}")
