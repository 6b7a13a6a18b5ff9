"""`rover dataset`: episodes of a policy as a Minari data set."""

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import gymnasium as gym
import typer

from rover_gym.cli.console import LARGEST_SEED, MOST_EPISODES, plain_errors, progress_bar, say_path
from rover_gym.cli.options import BUILT_IN, DRIVERS_HELP, ModelName, driver_title, named_driver, named_model
from rover_gym.exports.minari_data import write_dataset
from rover_gym.extras import require
from rover_gym.mechanics import OptionError
from rover_gym.policy.episodes import Policy
from rover_gym.policy.pd_policy import find_rover_env
from rover_gym.policy.trained_policy import RandomPolicy
from rover_gym.registration import ENVIRONMENTS
from rover_gym.validation import refuse

RANDOM = "random"


@plain_errors
def dataset(
    *,
    name: Annotated[str, typer.Argument(help="Name of the data set, such as rover/rocks-pd-v0.")],
    environment: Annotated[str, typer.Option(help=f"One of {', '.join(ENVIRONMENTS)}.")] = "Rover-v0",
    policy: Annotated[str, typer.Option(help=f"'random' for any environment, or {DRIVERS_HELP}")] = "pd",
    terrain: Annotated[
        str | None, typer.Option(help="'plane', 'rocks', 'hills', or a file. Default: the environment's.")
    ] = None,
    model: ModelName = BUILT_IN,
    difficulty: Annotated[float | None, typer.Option(help="Difficulty of the rocks, from 0 to 2.")] = None,
    episodes: Annotated[int, typer.Option(min=1, max=MOST_EPISODES, help="Number of episodes.")] = 10,
    seed: Annotated[
        int, typer.Option(min=0, max=LARGEST_SEED, help="Seed of the first episode; the others count up from it.")
    ] = 0,
    folder: Annotated[
        Path | None, typer.Option(file_okay=False, help="Where data sets are. Default: Minari's own place.")
    ] = None,
) -> None:
    """Drive episodes and write them as a Minari data set, which its actions replay bit for bit.

    Ctrl-C keeps the episodes that are done.
    """
    require("minari", "data")
    if environment not in ENVIRONMENTS:
        refuse(OptionError, "environment", environment, f"must be one of {', '.join(ENVIRONMENTS)}")
    given = {"terrain": terrain, "difficulty": difficulty, "model": None if model == BUILT_IN else model}
    arguments: dict[str, Any] = {key: value for key, value in given.items() if value is not None}
    make: Callable[[gym.Env[Any, Any]], Policy] = partial(RandomPolicy, seed=seed)
    if policy != RANDOM:
        ground = arguments.get("terrain", ENVIRONMENTS[environment].arguments.get("terrain", "plane"))
        chosen = named_driver(policy, ground, named_model(model))
        arguments |= chosen.arguments
        make = partial(_made, chosen.make)
    with progress_bar() as bar:
        task = bar.add_task("episodes", total=episodes, state="")
        path = write_dataset(
            name,
            environment,
            make,
            range(seed, seed + episodes),
            arguments=arguments,
            folder=folder,
            policy_name="random actions" if policy == RANDOM else driver_title(policy),
            progress=lambda done: bar.update(task, completed=done),
        )
    say_path("data set", path)


def _made(make: Any, env: gym.Env[Any, Any]) -> Policy:
    """A policy for torques and set-points, refused where actions are something else."""
    own, taken = find_rover_env(env).action_space, env.action_space
    if own.shape != taken.shape or not isinstance(env.observation_space, gym.spaces.Box):
        reason = f"must be '{RANDOM}' for this environment, whose actions or observations are not Rover-v0's"
        refuse(OptionError, "policy", taken, reason)
    driver: Policy = make(env)
    return driver
