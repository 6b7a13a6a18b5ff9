"""Shows or records a trained policy.

    python training/enjoy.py runs/train/rocks-seed1 --film runs/enjoy
    python training/enjoy.py runs/train/rocks-seed1 --human

Trajectories in HDF5, for replays and plots, come from `rover drive --policy FOLDER --output runs/drive`.
"""

from pathlib import Path
from typing import Annotated, Any

import gymnasium as gym
import typer
from gymnasium.wrappers import RecordVideo

from rover_gym.cli.console import plain_errors, say_path
from rover_gym.cli.options import BUILT_IN, ModelName
from rover_gym.policy import TrainedPolicy, policy_arguments, run_episode


@plain_errors
def enjoy(
    policy: Annotated[Path, typer.Argument(exists=True, help="Folder of a run or of a policy.")],
    terrain: Annotated[str, typer.Option(help="'plane', 'rocks', 'hills', or the file of a map or a mesh.")] = "rocks",
    model: ModelName = BUILT_IN,
    difficulty: Annotated[float | None, typer.Option(help="Of the rocks, from 0 to 2.")] = None,
    episodes: Annotated[int, typer.Option(min=1, help="How many.")] = 1,
    seed: Annotated[int, typer.Option(min=0, help="Of the first episode; the next ones count up.")] = 1_000_000,
    film: Annotated[Path | None, typer.Option(file_okay=False, help="Folder for one mp4 an episode.")] = None,
    human: Annotated[bool, typer.Option("--human", help="Show a window.")] = False,
) -> None:
    """Drive episodes and say what they came to."""
    folder = policy if (policy / "policy.npz").exists() else policy / "policy"
    arguments: dict[str, Any] = {"terrain": terrain, **policy_arguments(folder)}
    arguments |= {} if model == BUILT_IN else {"model": model}
    arguments |= {} if difficulty is None else {"difficulty": difficulty}
    arguments |= {"render_mode": "human"} if human else {"render_mode": "rgb_array"} if film else {}
    env: gym.Env[Any, Any] = gym.make("Rover-v0", **arguments)
    if film is not None:
        env = RecordVideo(env, str(film), episode_trigger=lambda _: True, name_prefix=folder.resolve().parent.name)
    driver = TrainedPolicy.load(env, folder)
    for number in range(seed, seed + episodes):
        episode = run_episode(env, driver, number)
        typer.echo(f"seed {number}: {episode.end} after {episode.time:.1f} s, {episode.distance:.1f} m driven")
    env.close()
    if film is not None:
        say_path("written", film)


if __name__ == "__main__":
    typer.run(enjoy)
