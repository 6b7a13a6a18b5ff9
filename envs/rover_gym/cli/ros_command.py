"""`rover ros`: a rover as a ROS 2 node."""

import json
import signal
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any

import typer

from rover_gym.cli.console import plain_errors
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
    TerrainName,
    chosen_terrain,
    complete_policy,
    complete_recording,
    named_driver,
    named_model,
    takes,
)
from rover_gym.core import OptionError, Terrain
from rover_gym.core.validation import refuse
from rover_gym.envs.sensors import ColourCamera, DepthCamera, InertialUnit, LaserScanner, Sensor
from rover_gym.record import read_run
from rover_gym.ros.bag import BagTransport
from rover_gym.ros.middleware import MIDDLEWARES, open_transport
from rover_gym.ros.node import NodeOptions, RosNode
from rover_gym.ros.node_rovers import DrivenRover, NodeRover, RecordedRover
from rover_gym.show.live import LiveChoices, LiveRover, LiveScene
from rover_gym.show.live.live_scene import BY_HAND

#: Control frequency, Hz, where no policy drives: policies have their own.
RATE = 50.0
#: Sensors by the names of the option.
SENSORS: dict[str, Callable[[], Sensor]] = {
    "imu": InertialUnit,
    "scan": LaserScanner,
    "depth": DepthCamera,
    "colour": ColourCamera,
}


@plain_errors
@takes(MapFile)
def ros(
    map_file: MapFile,
    *,
    recording: Annotated[
        Path | None,
        typer.Argument(help="A recorded run to play; without, a rover drives.", autocompletion=complete_recording),
    ] = None,
    terrain: TerrainName = None,
    model: ModelName = BUILT_IN,
    difficulty: LiveDifficulty = None,
    goal_distance: LiveGoalDistance = 8.0,
    policy: Annotated[
        str,
        typer.Option(
            help=f"'hand' for the commands of ROS alone, or {DRIVERS_HELP} Commands go before a policy.",
            autocompletion=complete_policy,
        ),
    ] = BY_HAND,
    friction: LiveFriction = FRICTION,
    gravity: LiveGravity = 9.81,
    seed: LiveSeed = 0,
    rate: Annotated[
        float | None, typer.Option(help="Steps and messages per simulated second, Hz. Default: 50; with a policy, 20.")
    ] = None,
    sensors: Annotated[
        list[str] | None,
        typer.Option(
            "--sensor",
            metavar="NAME|JSON",
            help="A sensor: imu, scan, depth, colour, or a class with its fields, such as "
            """'{"LaserScanner": {"rays": 360}}'. Repeat it for several. Default: imu and scan; none for none.""",
        ),
    ] = None,
    pace: Annotated[float, typer.Option(help="Simulated over wall time; 0 for as fast as it goes.")] = 1.0,
    paused: Annotated[bool, typer.Option("--paused", help="Wait for the services step or pause.")] = False,
    localise: Annotated[
        bool, typer.Option("--localise/--no-localise", help="Publish the true transform from map to odom.")
    ] = True,
    middleware: Annotated[
        str, typer.Option(help=f"What carries messages: {', '.join(MIDDLEWARES)}. auto takes rclpy if it is there.")
    ] = "auto",
    name: Annotated[str, typer.Option(help="Name of the node.")] = "rover",
    namespace: Annotated[str, typer.Option(help="Namespace of node and topics.")] = "/",
    bag: Annotated[
        Path | None, typer.Option(file_okay=False, help="Folder of a bag (MCAP) to record all messages into.")
    ] = None,
) -> None:
    """Run a rover as a ROS 2 node, without a ROS installation (extra ros).

    Ctrl-C ends it.
    """
    hard = LiveScene.difficulty if difficulty is None else difficulty
    options = NodeOptions(_sensors(sensors), pace, paused, localise, seed, hard)
    scene = LiveScene(
        ground=chosen_terrain(terrain, difficulty),
        model=model,
        driver=policy,
        difficulty=hard,
        goal_distance=goal_distance,
        friction=friction,
        gravity=gravity,
        seed=seed,
    )
    source: NodeRover = (
        DrivenRover(_rover(scene, map_file, rate)) if recording is None else RecordedRover(read_run(recording))
    )
    transport = open_transport(middleware, name, namespace)
    if bag is not None:
        transport = BagTransport(transport, bag)
    node = RosNode(source, transport, name=name, namespace=namespace, options=options, tell=_tell)
    typer.echo(f"ros: node {namespace.rstrip('/')}/{name}, a step every {source.dt:g} s (Ctrl-C ends it)")
    _run(node)


def _run(node: RosNode) -> None:
    """Runs a node until a signal ends it."""
    for ending in (signal.SIGINT, signal.SIGTERM):
        signal.signal(ending, lambda *_: node.stop())
    try:
        node.run()
    finally:
        node.close()


def _tell(text: str) -> None:
    typer.echo(text, err=True)


def _rover(scene: LiveScene, map_file: MapFile, rate: float | None) -> LiveRover:
    """The rover of a scene, whose ground and model may be files."""
    ground: str | Terrain | None = map_file.open(scene.ground)
    frequency = rate if rate is not None else RATE if scene.driver == BY_HAND else None
    choices = LiveChoices(
        {scene.ground: scene.ground if ground is None else ground},
        {scene.model: named_model(scene.model)},
        (scene.driver,),
        named_driver,
        {} if frequency is None else {"control_frequency": frequency},
    )
    return LiveRover(scene, choices)


def _sensors(given: list[str] | None) -> list[Any]:
    """The sensors of the options.

    Raises:
        OptionError: One is no name and no JSON object.
    """
    if given is None:
        given = ["imu", "scan"]
    if given == ["none"]:
        return []
    return [SENSORS[one]() if one in SENSORS else _described(one) for one in given]


def _described(text: str) -> Any:
    try:
        found = json.loads(text)
    except ValueError:
        found = None
    if not isinstance(found, dict):
        refuse(OptionError, "sensor", text, f"must be one of {', '.join(SENSORS)}, none, or a JSON object")
    return found
