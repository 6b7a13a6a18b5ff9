"""`rover live`: a rover that is driven in real time in the browser."""

import webbrowser
from pathlib import Path
from typing import Annotated

import typer

from rover_gym.cli.console import LARGEST_SEED, check_folder, plain_errors
from rover_gym.cli.drivers import DRIVERS_HELP, named_driver
from rover_gym.cli.scene_options import BUILT_IN, HeightRange, ModelName, Spacing, named_ground, named_model
from rover_gym.extras import require
from rover_gym.live import LiveChoices, LiveLoop, LiveRover, LiveScene, LiveServer
from rover_gym.live.live_scene import BY_HAND, DRAWN_GROUNDS
from rover_gym.mechanics import Terrain

#: How often the command looks whether the drive still runs, s.
LOOK = 0.2


@plain_errors
def live(
    *,
    terrain: Annotated[
        str, typer.Option(help="The ground: 'plane', 'rocks', 'hills', or the file of a map or a mesh.")
    ] = "plane",
    spacing: Spacing = None,
    height_range: HeightRange = None,
    model: ModelName = BUILT_IN,
    difficulty: Annotated[float, typer.Option(help="Difficulty of rocks and hills, from 0 to 2.")] = 0.5,
    goal_distance: Annotated[float, typer.Option(help="Distance of the goal from the start, m.")] = 8.0,
    policy: Annotated[str, typer.Option(help=f"'hand' for you, or {DRIVERS_HELP}")] = BY_HAND,
    friction: Annotated[float, typer.Option(help="Friction coefficient.")] = 0.7,
    gravity: Annotated[float, typer.Option(help="Gravity, m/s².")] = 9.81,
    seed: Annotated[int, typer.Option(min=0, max=LARGEST_SEED, help="Seed of ground, start and goal.")] = 0,
    output: Annotated[Path, typer.Option(file_okay=False, help="Folder of the recordings.")] = Path(),
    host: Annotated[
        str, typer.Option(help="Address to listen at. The default refuses other machines; 0.0.0.0 lets them in.")
    ] = "127.0.0.1",
    port: Annotated[int, typer.Option(help="Port to listen at; 0 takes any that is free.")] = 8765,
    fps: Annotated[
        float, typer.Option(help="Pictures a second, 1 to 60; fewer for a browser without a graphics card.")
    ] = 40.0,
    show: Annotated[bool, typer.Option("--open", help="Open the page in the browser.")] = False,
) -> None:
    """Drive a rover in real time behind a page in the browser, by keyboard, gamepad, sliders or a policy.

    Ctrl-C ends the drive; what was recorded is kept.
    """
    require("viser", "replay")
    check_folder("output", output)
    grounds: dict[str, str | Terrain] = dict(DRAWN_GROUNDS)
    known = {"sphere_field": "rocks"}.get(terrain, terrain)
    drivers, models = (*LiveChoices().drivers, "planner"), dict(LiveChoices().models)
    if known not in grounds:
        ground = named_ground(terrain, spacing, height_range)
        known = Path(terrain).name if ground is not None else terrain
        grounds |= {} if ground is None else {known: ground}
    if model not in models:
        models[Path(model).name] = named_model(model)
    drivers += () if policy in drivers else (policy,)
    choices = LiveChoices(grounds, models, drivers, named_driver)
    scene = LiveScene(
        ground=known,
        model=model if model in models else Path(model).name,
        driver=policy,
        difficulty=difficulty,
        goal_distance=goal_distance,
        friction=friction,
        gravity=gravity,
        seed=seed,
    )
    loop = LiveLoop(LiveRover(scene, choices), output)
    server = LiveServer(loop, choices, host=host, port=port, fps=fps)
    typer.echo(f"rover live: {server.address} (Ctrl-C ends it)")
    loop.start()
    try:
        if show:
            webbrowser.open(server.address)
        while not loop.wait(LOOK):
            pass
    finally:
        loop.stop()
        server.stop()
        if loop.state.notice.startswith("recorded"):
            typer.echo(loop.state.notice)
    if loop.failure is not None:
        raise loop.failure
