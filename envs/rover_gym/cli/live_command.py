"""`rover live`: a rover that is driven in real time in the browser."""

import sys
import webbrowser
from pathlib import Path
from typing import Annotated

import typer

from rover_gym.cli.console import plain_errors
from rover_gym.cli.newest import say_how_to_watch
from rover_gym.cli.options import (
    BUILT_IN,
    DRIVERS_HELP,
    FRICTION,
    LiveDifficulty,
    LiveFriction,
    LiveGoalDistance,
    LiveGravity,
    LiveSeed,
    MapFile,
    ModelName,
    OpenIt,
    TerrainName,
    chosen_terrain,
    complete_policy,
    named_driver,
    named_model,
    takes,
)
from rover_gym.cli.paths import Into, check_paths
from rover_gym.core import Terrain
from rover_gym.core.extras import require
from rover_gym.show.live import LiveChoices, LiveLoop, LiveRover, LiveScene, LiveServer
from rover_gym.show.live.live_scene import BY_HAND

FOLDER = Path("runs/live")  # of the recordings
#: How often the command looks whether the drive still runs, s.
LOOK = 0.2


@plain_errors
@takes(MapFile)
def live(
    map_file: MapFile,
    *,
    terrain: TerrainName = None,
    model: ModelName = BUILT_IN,
    difficulty: LiveDifficulty = None,
    goal_distance: LiveGoalDistance = 8.0,
    policy: Annotated[
        str, typer.Option(help=f"'hand' for you, or {DRIVERS_HELP}", autocompletion=complete_policy)
    ] = BY_HAND,
    friction: LiveFriction = FRICTION,
    gravity: LiveGravity = 9.81,
    seed: LiveSeed = 0,
    output: Annotated[
        Path, typer.Option(file_okay=False, help="Folder of the recordings that the page asks for.")
    ] = FOLDER,
    mcap: Annotated[
        bool, typer.Option("--mcap", help="Write each recording as an MCAP log, too (extra logs).")
    ] = False,
    host: Annotated[
        str, typer.Option(help="Address to listen at. The default refuses other machines; 0.0.0.0 lets them in.")
    ] = "127.0.0.1",
    port: Annotated[int, typer.Option(help="Port to listen at; 0 takes any that is free.")] = 8765,
    show: OpenIt = None,
) -> None:
    """Drive a rover in real time in the browser, by hand or with a policy.

    By keyboard, gamepad, stick or sliders.
    Ctrl-C ends the drive; what was recorded is kept.
    """
    require("websockets", "replay")
    if mcap:
        require("mcap", "logs")
    check_paths(output=Into(output))
    choices, scene = LiveChoices(), LiveScene()
    named = chosen_terrain(terrain, difficulty)
    grounds: dict[str, str | Terrain] = dict(choices.grounds)
    if (ground := map_file.open(named)) is not None:
        named = Path(named).name
        grounds[named] = ground
    models, rover = dict(choices.models), model
    if model not in models:
        rover = Path(model).name
        models[rover] = named_model(model)
    drivers = dict.fromkeys((*choices.drivers, "planner", policy))
    choices = LiveChoices(grounds, models, tuple(drivers), named_driver)
    scene = LiveScene(
        ground=named,
        model=rover,
        driver=policy,
        difficulty=scene.difficulty if difficulty is None else difficulty,
        goal_distance=goal_distance,
        friction=friction,
        gravity=gravity,
        seed=seed,
    )
    loop = LiveLoop(LiveRover(scene, choices), output, mcap=mcap)
    server = LiveServer(loop, choices, host=host, port=port)
    typer.echo(f"live: {server.address} (Ctrl-C ends the drive)")
    loop.start()
    try:
        if sys.stdout.isatty() if show is None else show:
            webbrowser.open(server.address)
        while not loop.wait(LOOK):
            pass
    except KeyboardInterrupt:
        pass  # the end that is meant
    finally:
        loop.stop()
        server.stop()
    if loop.recorded:
        typer.echo(f"recorded: {', '.join(map(str, loop.recorded))}")
        say_how_to_watch([path for path in loop.recorded if path.suffix == ".h5"][-1])
    if loop.failure is not None:
        raise loop.failure
