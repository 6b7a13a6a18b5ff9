"""`rover drive`: episodes of `Rover-v0` and its like with the PD baseline, the scan planner or a trained policy."""

import json
import math
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Annotated, Any

import gymnasium as gym
import numpy as np
import typer
from rich.progress import Progress
from rich.table import Table

from rover_gym.cli.console import (
    INTERRUPTED,
    MOST_EPISODES,
    AsJson,
    Results,
    plain_errors,
    progress_bar,
)
from rover_gym.cli.newest import recording_folder, say_how_to_watch
from rover_gym.cli.options import (
    BUILT_IN,
    DRIVERS_HELP,
    Arguments,
    EnvironmentName,
    FilmAntialiasing,
    FilmCamera,
    FilmForces,
    FilmSize,
    MapFile,
    ModelName,
    OnMap,
    Start,
    TerrainName,
    chosen_terrain,
    complete_policy,
    driver_title,
    environment_of,
    environment_title,
    film_options,
    given_arguments,
    known_environment,
    named_driver,
    named_model,
    places_on,
    takes,
    warn_of_slope,
)
from rover_gym.cli.paths import Into, check_paths
from rover_gym.core import OptionError
from rover_gym.core.files import write_whole
from rover_gym.core.validation import number, refuse
from rover_gym.drive.comparison import EpisodeFilm
from rover_gym.drive.evaluation import Episode, run_episode, timed
from rover_gym.envs.rover_env import RoverEnv
from rover_gym.record.channels import outcome_words
from rover_gym.show.replay.overlays import SENSORS
from rover_gym.show.replay.tape import Tape, Watched

CONTROL_PERIOD = 0.05  # s, of Rover-v0
FOLDER = Path("runs/drive")  # of the recordings
SHORTEST_STEP = 1e-5  # s: a shorter one makes no episode end


Difficulty = Annotated[
    float | None,
    typer.Option(help="Difficulty of the rocks, from 0 to 2. Default: 0.5. It implies rocks."),
]
Slope = Annotated[
    float | None, typer.Option(help="Slope of the ground, degrees. Default: 0; on rocks, by the difficulty.")
]
Uphill = Annotated[
    float | None, typer.Option(help="Direction of steepest ascent, degrees to the left of x. Default: random.")
]
Heading = Annotated[float | None, typer.Option(help="Start heading, degrees to the left of x. Default: random.")]
Goal = Annotated[tuple[float, float] | None, typer.Option(metavar="X Z", help="Goal on the map, m. Default: random.")]
Driver = Annotated[str, typer.Option(help=DRIVERS_HELP, autocompletion=complete_policy)]
Friction = Annotated[float, typer.Option(help="Friction coefficient.")]
TimeStep = Annotated[float, typer.Option(help="Time step of the physics, s.")]
TimeLimit = Annotated[float, typer.Option(min=CONTROL_PERIOD, max=1e6, help="Time limit of an episode, s.")]
Episodes = Annotated[int, typer.Option(min=1, max=MOST_EPISODES, help="Number of episodes.")]
Seed = Annotated[int, typer.Option(min=0, help="Seed of the first episode; the others count up from it.")]
Output = Annotated[
    Path | None,
    typer.Option(
        file_okay=False,
        help="Folder for trajectories (HDF5) and summary.json, without those of another run. "
        "Default: runs/drive, or the next of runs/drive-2, runs/drive-3, ... without a run.",
    ),
]
Record = Annotated[bool, typer.Option("--record/--no-record", help="Record the episodes.")]
Sensors = Annotated[
    list[str] | None,
    typer.Option(
        help="Record a sensor, too: 'laser' or 'depth'; repeat it for both.", autocompletion=lambda: list(SENSORS)
    ),
]
Film = Annotated[
    Path | None, typer.Option(dir_okay=False, metavar="FILE.mp4", help="Film the episodes one after the other.")
]


@plain_errors
@takes(MapFile)
def drive(
    map_file: MapFile,
    *,
    terrain: TerrainName = None,
    model: ModelName = BUILT_IN,
    difficulty: Difficulty = None,
    slope: Slope = None,
    uphill: Uphill = None,
    heading: Heading = None,
    start: Start = None,
    map_coordinates: OnMap = False,
    goal: Goal = None,
    policy: Driver = "pd",
    environment: EnvironmentName = None,
    argument: Arguments = None,
    friction: Friction = 0.7,
    time_step: TimeStep = 0.005,
    time_limit: TimeLimit = 60.0,
    episodes: Episodes = 1,
    seed: Seed = 0,
    output: Output = None,
    record: Record = True,
    sensor: Sensors = None,
    film: Film = None,
    size: FilmSize = "640x480",
    camera: FilmCamera = "follow",
    forces: FilmForces = False,
    antialiasing: FilmAntialiasing = True,
    as_json: AsJson = False,
) -> None:
    """Drive a rover to its goal, record the drive and report the outcome.

    The environment is Rover-v0, among rocks RoverRocks-v0, on hills RoverHills-v0.
    Ctrl-C ends the drive: finished episodes are printed, and what was recorded and filmed is kept.
    """
    _check_time_step(time_step)
    for name in sensor or ():
        if name not in SENSORS:
            refuse(OptionError, "sensor", name, f"must be one of {', '.join(SENSORS)}")
    own = given_arguments(argument)
    is_free = environment is not None and terrain is None
    terrain = chosen_terrain(terrain, difficulty)
    folder = recording_folder(output, FOLDER, wanted=record)
    _check_paths(folder, film, range(seed, seed + episodes), {"ground": terrain, "model": model, "policy": policy})
    scene = {"terrain": terrain, "friction": friction, "time_step": time_step}
    if is_free:
        del scene["terrain"]
    scene |= _given({"difficulty": difficulty, "slope_deg": slope, "uphill_deg": uphill, "heading_deg": heading})
    named = _given({"model": None if model == BUILT_IN else model, **vars(map_file)})
    named |= {"nodata": str(named["nodata"])} if "nodata" in named else {}
    rover, ground = named_model(model), map_file.open(terrain)
    options = places_on(ground, {"position": start, "goal": goal}, map_coordinates=map_coordinates)
    chosen = named_driver(policy, rover)
    as_given = {**scene, **named, **chosen.arguments, **own}
    arguments = {**scene, **_given({"model": rover, "terrain": ground}), **chosen.arguments, **own}
    if film is not None:
        look = film_options(size, camera, forces=forces, antialiasing=antialiasing)
        arguments |= {"render_mode": "rgb_array", "render_options": look}
    name = environment_of(terrain) if environment is None else known_environment(environment)
    env = timed(gym.make(name, max_episode_steps=-1, **arguments), time_limit)
    warn_of_slope(slope, friction)
    place = environment_title(terrain) if environment is None else name
    title = f"{place} with {driver_title(policy)}"
    drives = _Drives(env, Watched(chosen.make(env)), title, as_given, options, list(dict.fromkeys(sensor or ())))
    drives.run(range(seed, seed + episodes), folder, film)
    summary = {
        "environment": name,
        "policy": policy,
        "arguments": as_given | options,
        "episodes": [asdict(episode) for episode in drives.results],
    }
    _tell(drives, summary, folder, film, episodes, as_json=as_json)


def _tell(
    drives: "_Drives", summary: dict[str, Any], folder: Path | None, film: Path | None, episodes: int, *, as_json: bool
) -> None:
    """Says how the drives went, and writes the summary into their folder."""
    with Results(as_json=as_json) as said:
        said.add(**summary)
        if drives.results:
            said.show(_table(drives.results, drives.title))
        if folder is not None:
            drives.paths.append(folder / "summary.json")
            write_whole(drives.paths[-1], json.dumps(summary, indent=2) + "\n")
        for path in [*drives.paths, *([] if film is None else [film])]:
            if path.exists():
                said.path("written", path)
        if folder is not None and not as_json and drives.paths[0].exists():
            say_how_to_watch(drives.paths[0])
        if drives.interrupted:
            typer.echo(f"interrupted: {len(drives.results)} of {episodes} episodes are done", err=True)
            raise typer.Exit(INTERRUPTED)


def _check_paths(folder: Path | None, film: Path | None, seeds: Sequence[int], read: Mapping[str, str]) -> None:
    """Refuses places that cannot be written, or at which an episode would replace another file of the command."""
    names = (*(f"episode-{seed}.h5" for seed in seeds), "summary.json")
    check_paths({f"the {what}": path for what, path in read.items()}, film=film, output=Into(folder, names))


def _given(options: Mapping[str, Any]) -> dict[str, Any]:
    """The options that have a value."""
    return {name: value for name, value in options.items() if value is not None}


def _check_time_step(time_step: float) -> None:
    """Refuses a time step that does not divide the control period."""
    number("time_step", time_step, at_least=SHORTEST_STEP)
    steps = CONTROL_PERIOD / time_step
    if not (round(steps) >= 1 and math.isclose(steps, round(steps), rel_tol=1e-9)):
        reason = f"must divide the control period of {CONTROL_PERIOD:g} s into a whole number of steps"
        refuse(OptionError, "time_step", time_step, reason)


@dataclass
class _Drives:
    """The episodes of one command.

    Attributes:
        env: The environment.
        policy: The policy that drives.
        sensors: Names of sensors that are recorded, too.
        title: Title of results, recordings and film.
        arguments: Arguments of the environment, for the recordings.
        options: Options of each reset.
        results: The finished episodes.
        paths: The recordings, that of an interrupted episode included.
        interrupted: Whether Ctrl-C ended the drive.
    """

    env: gym.Env[Any, Any]
    policy: Watched
    title: str
    arguments: Mapping[str, Any]
    options: Mapping[str, Any]
    sensors: Sequence[str] = ()
    results: list[Episode] = field(default_factory=list)
    paths: list[Path] = field(default_factory=list)
    interrupted: bool = False

    @property
    def rover(self) -> RoverEnv:
        """The rover inside the environment."""
        inner = self.env.unwrapped
        assert isinstance(inner, RoverEnv)  # noqa: S101 - `timed` has checked it
        return inner

    def run(self, seeds: Sequence[int], output: Path | None, film: Path | None) -> None:
        """Drives an episode per seed, records it if there is a folder, and closes the environment."""
        with progress_bar() as bar, ExitStack() as stack:
            stack.callback(self.env.close)
            reel = None
            if film is not None:
                reel = stack.enter_context(EpisodeFilm(film, self.env.metadata["render_fps"], self.title))
            try:
                for seed in seeds:
                    path = None if output is None else output / f"episode-{seed}.h5"
                    self.paths += [path] if path else []
                    self.results.append(self._episode(seed, path, bar, reel))
            except KeyboardInterrupt:
                self.interrupted = True

    def _episode(self, seed: int, path: Path | None, bar: Progress, reel: EpisodeFilm | None) -> Episode:
        """Drives one episode, recorded if there is a path, filmed if there is a film."""
        task = bar.add_task(f"seed {seed}", total=None, state="")
        with ExitStack() as stack:
            tape: Tape | None = None
            self.policy.begin()

            def on_step(rover: RoverEnv, info: Mapping[str, Any]) -> None:
                nonlocal tape
                bar.update(task, state=f"{info['time']:.1f} s, {info['distance_to_goal']:.1f} m to go")
                if path is not None:
                    if tape is None:  # after the reset, when the start is known
                        tape = Tape(path, rover, self.title, seed, self.arguments, self.policy, self.sensors)
                        stack.enter_context(tape.recorder)
                    tape.append(rover, info)
                if reel is not None:
                    reel.show(rover, seed, info["time"])

            self.rover.on_period = on_step
            stack.callback(setattr, self.rover, "on_period", None)
            episode = run_episode(self.env, self.policy, seed, options=self.options)
            if reel is not None:
                reel.end(episode)
            if tape is not None:
                tape.recorder.note(outcome=episode.end)
        bar.remove_task(task)
        return episode


def _times(factor: float) -> str:
    """A real-time factor in a table; below 10 with two digits, since a planner is slower than time."""
    return f"{factor:.0f} x" if factor >= 9.5 else f"{factor:.2g} x"


def _table(results: Sequence[Episode], title: str) -> Table:
    table = Table(title=title, title_justify="left")
    for heading in ("seed", "success", "distance", "time", "energy", "slip", "real time"):
        table.add_column(heading, justify="right")
    for episode in results:
        table.add_row(
            str(episode.seed),
            "yes" if episode.success else f"no: {outcome_words(episode.end)}",
            f"{episode.distance:.2f} m",
            f"{episode.time:.2f} s",
            f"{episode.energy:.0f} J",
            f"{episode.slip:.2%}",
            _times(episode.real_time_factor),
        )
    if len(results) > 1:
        table.add_section()
        table.add_row(
            "mean",
            f"{sum(episode.success for episode in results)} of {len(results)}",
            *(
                form(np.mean([getattr(episode, name) for episode in results]))
                for name, form in (
                    ("distance", "{:.2f} m".format),
                    ("time", "{:.2f} s".format),
                    ("energy", "{:.0f} J".format),
                    ("slip", "{:.2%}".format),
                    ("real_time_factor", _times),
                )
            ),
        )
    return table
