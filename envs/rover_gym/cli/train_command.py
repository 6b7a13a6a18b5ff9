"""`rover train`: networks that drive by arcs, one seed or several."""

import csv
import os
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from statistics import mean
from typing import Annotated, Any

import typer
from typer.core import TyperCommand

from rover_gym.cli.console import AsJson, Results, plain_errors, plain_table
from rover_gym.cli.options import RayAddress
from rover_gym.cli.paths import Into, check_paths
from rover_gym.core import OptionError
from rover_gym.core.extras import require
from rover_gym.core.validation import refuse
from rover_gym.drive.arcs.arc_network import ArcNetwork
from rover_gym.drive.arcs.arc_network_policy import ARCS_FILE
from rover_gym.drive.forecast.network_files import PolicyError
from rover_gym.drive.named_policy import network_folder

LARGEST = 498  # the largest seed: the fields of all seeds stay below the evaluations'

SEEDS = ("--seeds", "--seed")

#: Optional packages that a training imports, from the extra `train` or, on a cluster, from `rllib`.
NEEDED = ("yaml", "stable_baselines3", "tensorboard")

#: Files of a run that a user may have named as an input.
WRITTEN = (ARCS_FILE, f"best/{ARCS_FILE}", "config.yaml")


class ManySeeds(TyperCommand):
    """A command whose `--seeds` takes several numbers: `--seeds 1 2 3`."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Repeats the option before each number that follows it."""
        given: list[str] = []
        is_seed = False
        for argument in args:
            if is_seed and re.fullmatch(r"\d+", argument):
                if given[-1] not in SEEDS:
                    given.append(SEEDS[0])
            else:
                is_seed = argument in SEEDS
            given.append(argument)
        return super().parse_args(ctx, given)


@plain_errors
def train(
    config: Annotated[
        str, typer.Argument(help="A configuration of the package, 'anywhere', 'longer' or 'rocks', or a YAML file.")
    ] = "anywhere",
    seeds: Annotated[
        list[int] | None,
        typer.Option(
            *SEEDS,
            min=0,
            max=LARGEST,
            help="Seeds of network, exploration and fields, trained one after the other. Default: 1.",
        ),
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option(
            file_okay=False,
            help="Folder of the run, with several seeds of their runs. Default: runs/train/NAME-seedN, runs/train.",
        ),
    ] = None,
    resume: Annotated[
        bool, typer.Option("--resume", help="Go on from the latest checkpoint; of several seeds, where there is one.")
    ] = False,
    begin: Annotated[
        str | None, typer.Option("--from", help="Begin with a network: 'anywhere', or the folder of a run.")
    ] = None,
    steps: Annotated[int | None, typer.Option(min=1, help="Decisions of PPO, instead of the configuration's.")] = None,
    workers: Annotated[
        int | None, typer.Option(min=1, help="Processes that drive the rovers. Default: one per core.")
    ] = None,
    ray: RayAddress = None,
    show: Annotated[bool, typer.Option("--show", help="Print the configuration as YAML and end.")] = False,
    as_json: AsJson = False,
) -> None:
    """Train a network that drives by arcs: imitation of the planners, then PPO.

    'anywhere' trains for all rovers and grounds, 'longer' goes on with four million decisions, 'rocks' trains for the
    built-in rover among rocks in two CPU minutes.

    Needs the extra `train`, with `--ray` the extra `rllib`.

    Checkpoints, the learning curve (`curve.csv`), TensorBoard's events (`tensorboard`), the network at the end
    (`arcs.npz`) and the one that did best in the evaluations (`best`) are in the run's folder. A run is never
    overwritten. Several seeds end with a table.
    """
    for package in NEEDED:
        require(package, "train" if ray is None else "rllib")
    if ray is not None:
        require("ray", "rllib")
    from rover_gym.learn.arc_config import read_arc_config  # noqa: PLC0415 - needs the extra
    from rover_gym.learn.arc_recipe import train_arcs  # noqa: PLC0415
    from rover_gym.learn.configuration import find_configuration  # noqa: PLC0415

    path = find_configuration(config)
    settings = read_arc_config(path)
    if show:
        typer.echo(path.read_text(encoding="utf-8"), nl=False)
        return
    check_paths(output=Into(output))
    if steps is not None and settings.ppo is not None:
        settings = replace(settings, ppo=replace(settings.ppo, decisions=steps))
    network = None if begin is None else _network(begin)
    folders = _run_folders(list(dict.fromkeys(seeds or [1])), output, path.stem)
    if not resume:
        _check_unused(folders.values(), {"the configuration": path, "the network": begin})
    with Results(as_json=as_json) as results:
        for seed, folder in folders.items():
            train_arcs(
                settings,
                folder,
                seed=seed,
                cluster=ray,
                workers=workers or len(os.sched_getaffinity(0)),
                resume=resume and (len(folders) == 1 or (folder / "state.json").exists()),
                begin=network,
                say=partial(typer.echo, err=as_json),
            )
            results.path("policy", folder)
            results.path("best policy in the evaluations", folder / "best")
        _show_seeds(results, folders)


def _show_seeds(results: Results, folders: Mapping[int, Path]) -> None:
    """The last row of every seed's curve, of several seeds as a table."""
    rows = [_last_row(folder) for folder in folders.values()]
    results.add(seeds=[{"seed": seed, **row} for seed, row in zip(folders, rows, strict=True)])
    if len(folders) > 1:
        results.show(plain_table(_seed_table(list(folders), rows)))


def _check_unused(folders: Iterable[Path], reads: Mapping[str, object]) -> None:
    """Refuses folders that have a run, and those whose files the training `reads`, before it begins.

    Raises:
        OptionError: One has a run, or a file that is read.
    """
    from rover_gym.learn.arc_recipe import RUN_FILES  # noqa: PLC0415 - needs the extra

    for folder in folders:
        if any((folder / name).exists() for name in RUN_FILES):
            reason = "has a run, which is never overwritten: go on with it by --resume, or name another --output"
            refuse(OptionError, "output", str(folder), reason)
        check_paths(reads, output=Into(folder, WRITTEN))


def _network(policy: str) -> ArcNetwork:
    """The network of a name or a run's folder.

    Raises:
        PolicyError: There is none.
    """
    folder = network_folder(policy)
    if folder is None:
        refuse(PolicyError, "begin", policy, "must be 'anywhere' or the folder of a run")
    return ArcNetwork.read(folder / ARCS_FILE)


def _last_row(folder: Path) -> dict[str, str]:
    """The last row of a run's learning curve."""
    with (folder / "curve.csv").open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))[-1]


def _seed_table(seeds: Sequence[int], rows: Sequence[Mapping[str, str]]) -> list[list[str]]:
    """The last evaluations of several seeds and their mean."""
    heads = [name for name in rows[0] if name not in ("stage", "decisions")]
    table = [["seed", *heads]]
    table += [[str(seed), *(row[name] for name in heads)] for seed, row in zip(seeds, rows, strict=True)]
    return [*table, ["mean", *(f"{mean(float(row[name]) for row in rows):.3g}" for name in heads)]]


def _run_folders(seeds: list[int], output: Path | None, name: str) -> dict[int, Path]:
    """The run's folder by seed: the output is a single run's own folder."""
    if output is not None and len(seeds) == 1:
        return {seeds[0]: output}
    parent = Path("runs") / "train" if output is None else output
    return {seed: parent / f"{name}-seed{seed}" for seed in seeds}
