"""`rover train`: policies by reinforcement learning, one seed or several."""

import os
import re
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import typer
from typer.core import TyperCommand

from rover_gym.cli.console import AsJson, Results, check_folder, plain_errors, plain_table
from rover_gym.extras import require

LARGEST = 498  # the largest seed: the fields of all seeds stay below the evaluations'


SEEDS = ("--seeds", "--seed")


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
        str, typer.Argument(help="A configuration of the package, 'anywhere', 'plane' or 'rocks', or a YAML file.")
    ],
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
    steps: Annotated[
        int | None, typer.Option(min=1, help="Decisions in total, instead of the configuration's.")
    ] = None,
    films: Annotated[
        int, typer.Option(min=0, help="Number of fields of each evaluation that are also filmed (extra render).")
    ] = 0,
    workers: Annotated[
        int | None,
        typer.Option(min=1, help="Processes that drive the rovers of 'anywhere'. Default: one per core."),
    ] = None,
    progress: Annotated[bool, typer.Option(help="Show a progress bar.")] = True,
    show: Annotated[bool, typer.Option("--show", help="Print the configuration as YAML and end.")] = False,
    as_json: AsJson = False,
) -> None:
    """Train a policy with stable-baselines3 and print its figures.

    'anywhere' imitates the planners and goes on with PPO: one network for all rovers and grounds. 'plane' and 'rocks'
    are PPO alone, for one rover.

    Needs the extra `train`.

    Checkpoints, TensorBoard's log (`tensorboard --logdir runs/train`), evaluations, the policy
    at the end (`policy`) and the one that did best in the evaluations (`best`) are in the run's folder. Several seeds
    end with a table: mean over the seeds with its 95% interval.
    """
    for package in ("yaml", "stable_baselines3", "tensorboard"):
        require(package, "train")
    if films:
        for package in ("imageio_ffmpeg", "vtkmodules"):
            require(package, "render")
    from rover_gym.learning.arc_config import is_arc_config  # noqa: PLC0415 - needs the extra
    from rover_gym.learning.training_config import find_configuration, read_config  # noqa: PLC0415

    path = find_configuration(config)
    settings = None if is_arc_config(path) else read_config(path)
    if show:
        typer.echo(path.read_text(encoding="utf-8"), nl=False)
        return
    check_folder("output", output)
    if settings is None:
        _train_arcs(path, seeds, output, resume=resume, steps=steps, workers=workers, as_json=as_json)
        return
    folders, parent = _run_folders(list(dict.fromkeys(seeds or [1])), output, path.stem)
    options = {"resume": resume, "total_steps": steps}
    _train_ppo(settings, path, folders, parent, options, progress=progress, films=films, as_json=as_json)


def _train_ppo(
    settings: Any,
    path: Path,
    folders: dict[int, Path],
    parent: Path,
    options: dict[str, Any],
    *,
    progress: bool,
    films: int,
    as_json: bool,
) -> None:
    """Trains a policy of commands for each seed."""
    from rover_gym.learning.ppo import Reporting, train_ppo  # noqa: PLC0415 - needs the extra, and slow to load
    from rover_gym.learning.several_seeds import read_seed, write_seeds  # noqa: PLC0415

    is_alone = len(folders) == 1
    say = partial(typer.echo, err=as_json)
    reporting = Reporting(say=say, progress=progress, films=films)
    with Results(as_json=as_json) as results:
        for seed, folder in folders.items():
            if not is_alone:
                say(f"seed {seed}:")
            resume = options["resume"] and (is_alone or (folder / "checkpoints" / "latest.json").exists())
            given = {**options, "resume": resume}
            policy = train_ppo(settings, folder, name=path.name, seed=seed, reporting=reporting, **given)
            results.path("policy", policy)
            results.path("best policy in the evaluations", folder / "best")
        done = [read_seed(folder) for folder in folders.values()] if as_json or not is_alone else []
        results.add(seeds=done)
        if not is_alone:
            stem = parent / f"{path.stem}-seeds"
            results.show(plain_table(write_seeds(done, stem)))
            for ending in ("md", "json"):
                results.path("written", stem.with_name(f"{stem.name}.{ending}"))


def _train_arcs(
    path: Path,
    seeds: list[int] | None,
    output: Path | None,
    *,
    resume: bool,
    steps: int | None,
    workers: int | None,
    as_json: bool,
) -> None:
    """Trains a network that drives by arcs; `steps` are PPO's decisions."""
    from rover_gym.learning.arc_config import read_arc_config  # noqa: PLC0415 - needs the extra
    from rover_gym.learning.arc_recipe import train_arcs  # noqa: PLC0415

    settings = read_arc_config(path)
    if steps is not None and settings.ppo is not None:
        settings = replace(settings, ppo=replace(settings.ppo, decisions=steps))
    with Results(as_json=as_json) as results:
        for seed, folder in _run_folders(list(dict.fromkeys(seeds or [1])), output, path.stem)[0].items():
            train_arcs(
                settings,
                folder,
                seed=seed,
                workers=workers or len(os.sched_getaffinity(0)),
                resume=resume,
                say=partial(typer.echo, err=as_json),
            )
            results.path("policy", folder)
            results.path("best policy in the evaluations", folder / "best")


def _run_folders(seeds: list[int], output: Path | None, name: str) -> tuple[dict[int, Path], Path]:
    """The run's folder by seed, and the folder of their summary: the output is a single run's own folder."""
    if output is not None and len(seeds) == 1:
        return {seeds[0]: output}, output.parent
    parent = Path("runs") / "train" if output is None else output
    return {seed: parent / f"{name}-seed{seed}" for seed in seeds}, parent
