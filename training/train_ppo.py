"""Trains a policy for Rover-v0 with stable-baselines3's PPO, as `rover train` does for one seed.

    python training/train_ppo.py --config rocks --seed 1

`rover_gym.learning.ppo` says what the run's folder receives and what `--resume` takes over.
"""

from pathlib import Path
from typing import Annotated

import typer

from rover_gym.cli.console import plain_errors, say_path
from rover_gym.learning.ppo import LARGEST_TRAINING_SEED, Reporting, train_ppo
from rover_gym.learning.training_config import find_configuration, read_config


@plain_errors
def train(
    config: Annotated[str, typer.Option(help="A configuration of the package, 'plane' or 'rocks', or a YAML file.")],
    seed: Annotated[
        int, typer.Option(min=0, max=LARGEST_TRAINING_SEED, help="Seed of network, exploration and fields.")
    ] = 1,
    output: Annotated[
        Path | None, typer.Option(file_okay=False, help="The run's folder; runs/train/NAME-seedN if not given.")
    ] = None,
    resume: Annotated[bool, typer.Option("--resume", help="Go on from the folder's latest checkpoint.")] = False,
    steps: Annotated[int | None, typer.Option(min=1, help="Decisions in total, instead of the file's.")] = None,
    progress: Annotated[bool, typer.Option(help="Show a progress bar.")] = True,
) -> None:
    """Train a policy and write it."""
    path = find_configuration(config)
    folder = output or Path("runs") / "train" / f"{path.stem}-seed{seed}"
    policy = train_ppo(
        read_config(path),
        folder,
        name=path.name,
        seed=seed,
        resume=resume,
        total_steps=steps,
        reporting=Reporting(say=typer.echo, progress=progress),
    )
    say_path("policy", policy)


if __name__ == "__main__":
    typer.run(train)
