"""`rover export` and `rover dataset`: runs, policies and episodes in the formats of other programs."""

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import gymnasium as gym
import typer

from rover_gym.cli.console import MOST_EPISODES, plain_errors, progress_bar, say_path
from rover_gym.cli.options import (
    BUILT_IN,
    DRIVERS_HELP,
    FRICTION,
    MapFile,
    ModelName,
    OnMap,
    Start,
    TerrainName,
    chosen_terrain,
    driver_title,
    named_driver,
    named_model,
    places_on,
    takes,
    warn_of_slope,
)
from rover_gym.cli.paths import Into, check_paths
from rover_gym.cli.usage import group
from rover_gym.core import OptionError
from rover_gym.core.extras import require
from rover_gym.core.validation import refuse
from rover_gym.drive.commands.driven import Policy, find_rover_env
from rover_gym.drive.pd.random_policy import RandomPolicy
from rover_gym.envs.registration import ENVIRONMENTS
from rover_gym.envs.sensors import ColourCamera
from rover_gym.exports.fmu import fmu_library, write_fmu
from rover_gym.exports.mcap_writer import FPS, write_mcap
from rover_gym.exports.minari_data import write_dataset
from rover_gym.exports.onnx_policy import write_onnx
from rover_gym.record.rover_run import read_run
from rover_gym.show.replay.overlays import sensor_of

export = group("Runs, policies and rovers in other formats.")


@export.command()
@plain_errors
def mcap(
    *,
    run: Annotated[Path, typer.Argument(help="What `rover drive` or `rover report` saved.")],
    output: Annotated[
        Path | None, typer.Option(dir_okay=False, help="File to write; beside the run by default.")
    ] = None,
    images: Annotated[bool, typer.Option("--images", help="Also render images (extra render).")] = False,
    camera: Annotated[
        bool, typer.Option("--camera", help="Also take the pictures of a camera on the rover, which needs no renderer.")
    ] = False,
    fps: Annotated[float, typer.Option(help="Images a second.")] = FPS,
) -> None:
    """Write a saved run as an MCAP log, which robotics viewers open without ROS."""
    require("mcap.writer", "logs")
    path = run.with_suffix(".mcap") if output is None else output
    saved = read_run(run)
    check_paths({"the run": run}, output=path)
    with progress_bar() as bar:
        task = bar.add_task("rows", total=saved.n_frames, state="")
        cameras = [ColourCamera(mount=sensor_of("depth", saved.model).mount, width=320, height=240)] if camera else []
        write_mcap(
            saved, path, images=images, cameras=cameras, fps=fps, progress=lambda n: bar.update(task, completed=n)
        )
    say_path("MCAP", path)


@export.command()
@plain_errors
def onnx(
    *,
    policy: Annotated[
        str,
        typer.Argument(help="'anywhere', 'foresight', or the folder of a run, a forecast or a raw run."),
    ],
    output: Annotated[Path, typer.Option(dir_okay=False, help="File to write.")],
) -> None:
    """Write a policy's network as ONNX, with the normalisation of its inputs."""
    require("onnx", "onnx")
    check_paths({"the policy": policy}, output=output)
    say_path("ONNX", write_onnx(policy, output))


@export.command()
@plain_errors
@takes(MapFile)
def fmu(
    map_file: MapFile,
    *,
    output: Annotated[Path, typer.Option(dir_okay=False, help="File to write, usually .fmu.")],
    terrain: TerrainName = None,
    model: ModelName = BUILT_IN,
    difficulty: Annotated[
        float | None, typer.Option(help="Difficulty of rocks and hills, from 0 to 2. It implies rocks.")
    ] = None,
    slope: Annotated[float | None, typer.Option(help="Slope of the ground, degrees.")] = None,
    heading: Annotated[float | None, typer.Option(help="Start heading, degrees to the left of x.")] = None,
    start: Start = None,
    map_coordinates: OnMap = False,
    friction: Annotated[float, typer.Option(help="Friction coefficient.")] = FRICTION,
    time_step: Annotated[float, typer.Option(help="Time step of the physics, s.")] = 0.005,
    seed: Annotated[int, typer.Option(min=0, help="Seed of ground and start.")] = 0,
    axes: Annotated[
        str, typer.Option(help="Of vectors and poses: 'world' (y up) or 'rep103' (x forward, y left, z up).")
    ] = "world",
) -> None:
    """Write a rover at the start of an episode as an FMI 3.0 co-simulation unit."""
    fmu_library()
    check_paths({"the ground": terrain, "the model": model}, output=output)
    terrain = chosen_terrain(terrain, difficulty)
    warn_of_slope(slope, friction)
    arguments: dict[str, Any] = {"terrain": terrain, "friction": friction, "time_step": time_step}
    arguments |= {} if difficulty is None else {"difficulty": difficulty}
    arguments |= {} if slope is None else {"slope_deg": slope}
    arguments |= {} if heading is None else {"heading_deg": heading}
    if (rover := named_model(model)) is not None:
        arguments["model"] = rover
    if (ground := map_file.open(terrain)) is not None:
        arguments["terrain"] = ground
    options = places_on(ground, {"position": start}, map_coordinates=map_coordinates)
    env = gym.make("Rover-v0", **arguments)
    env.reset(seed=seed, options=options)
    simulation = env.unwrapped.simulation  # type: ignore[attr-defined]
    say_path("FMU", write_fmu(simulation, output, name=simulation.model.name, axes=axes))  # type: ignore[arg-type]
    env.close()


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
    seed: Annotated[int, typer.Option(min=0, help="Seed of the first episode; the others count up from it.")] = 0,
    output: Annotated[
        Path | None, typer.Option(file_okay=False, help="Folder of the data sets. Default: Minari's own place.")
    ] = None,
) -> None:
    """Drive episodes and write them as a Minari data set.

    Its actions replay them bit for bit.

    Ctrl-C keeps the episodes that are done.
    """
    require("minari", "data")
    if environment not in ENVIRONMENTS:
        refuse(OptionError, "environment", environment, f"must be one of {', '.join(ENVIRONMENTS)}")
    check_paths(output=Into(output))
    given = {"terrain": terrain, "difficulty": difficulty, "model": None if model == BUILT_IN else model}
    arguments: dict[str, Any] = {key: value for key, value in given.items() if value is not None}
    make: Callable[[gym.Env[Any, Any]], Policy] = partial(RandomPolicy, seed=seed)
    if policy != RANDOM:
        chosen = named_driver(policy, named_model(model))
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
            folder=output,
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
