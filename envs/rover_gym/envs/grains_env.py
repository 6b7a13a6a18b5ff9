"""`RoverGrains-v0`: drive a rover through a pit of grains. The class docstring is the environment's card."""

from __future__ import annotations

import functools
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Unpack

import numpy as np
import numpy.typing as npt

from rover_gym.core import (
    DrawnEpisodes,
    EpisodeBatch,
    GrainSimulation,
    OptionError,
    RoverGrainSimulation,
    RoverModel,
    Simulation,
    Snapshot,
    StateError,
)
from rover_gym.core.validation import Range, flag, number, refuse, span, whole
from rover_gym.envs.arguments import RoverArguments
from rover_gym.envs.batch import Restored, RoverBatch
from rover_gym.envs.env_snapshot import EnvSnapshot
from rover_gym.envs.episode_scene import EpisodeScene, ResetOptions
from rover_gym.envs.generators import Rows, generator_at, row_of
from rover_gym.envs.rover_env import RoverEnv

if TYPE_CHECKING:
    from rover_gym.ground.grains.pit import Pit, PitFill
    from rover_gym.show.frames import FrameRenderer

#: The built-in rover's wheels: thin discs would cut into the grains.
WHEEL_RADIUS, WHEEL_WIDTH = 0.25, 0.2
#: Speed below which a grain may sleep, m/s: a twentieth of what a free one gains in a control period.
SLEEP_SPEED = 0.02
#: Arguments of `RoverEnv` with another default.
DEFAULTS = {
    "goal_distance": (4.5, 5.5),
    "heading_deg": (-5.0, 5.0),
    "goal_bearing_deg": (-5.0, 5.0),
    "gravity": (0.0, -3.71, 0.0),
}
#: A height far above all grains, m.
FAR = 1e4
#: Most beds that are settled.
MOST_BEDS = 1000


@dataclass(frozen=True)
class BedDraw:
    """The bed of an episode.

    Attributes:
        number: Which of the settled beds it is.
        along_x: Whether it is mirrored along x.
        along_z: Whether it is mirrored along z.
    """

    number: int
    along_x: bool
    along_z: bool


@dataclass(frozen=True, kw_only=True)
class GrainsEnvSnapshot(EnvSnapshot):
    """The state from which a `RoverGrainsEnv` continues bit for bit; picklable.

    Attributes:
        bed: The bed that was drawn.
        grains: The balls in the core.
    """

    bed: BedDraw
    grains: Snapshot


@dataclass(frozen=True)
class DrawnInBeds:
    """Drawn episodes, the bed of each, its grains, and the generators `(m, 4)` afterwards."""

    episodes: DrawnEpisodes
    beds: list[BedDraw]
    grains: list[GrainSimulation]
    rows: Rows


class GrainsBatch(RoverBatch):
    """Rovers that drive through pits of grains.

    Args:
        n: Number of rovers.
        pit: As of `RoverGrainsEnv`, as the next six.
        grain_radius: See there.
        grain_density: See there.
        grain_friction: See there.
        grain_tolerance: See there.
        n_beds: See there.
        sleep: See there.
        **arguments: Arguments of `RoverBatch`.

    Attributes:
        beds: The beds of the episodes, which the core does not know.
    """

    not_kept = (*RoverBatch.not_kept, "_among", "beds")

    def __init__(
        self,
        n: int,
        *,
        pit: Pit | None = None,
        grain_radius: float | tuple[float, float] = (0.03, 0.04),
        grain_density: float = 2600.0,
        grain_friction: float = 0.5,
        grain_tolerance: float = 1e-3,
        n_beds: int = 2,
        sleep: bool = True,
        **arguments: Any,
    ) -> None:
        from rover_gym.ground.grains.bed_scenes import with_wheel_width  # noqa: PLC0415 - other environments need no grains
        from rover_gym.ground.grains.pit import Pit  # noqa: PLC0415

        for name in ("terrain", "difficulty", "rock_abundance", "max_rock_radius", "slope_deg", "hill_slope_deg"):
            if arguments.get(name) is not None:
                refuse(
                    OptionError, name, arguments.get(name), "is not available: the ground of RoverGrainsEnv is its pit"
                )
        if arguments.get("height_scan") not in (None, False):
            refuse(
                OptionError,
                "height_scan",
                arguments.get("height_scan"),
                "is not available: a height scan does not see grains",
            )
        if pit is None:
            pit = Pit()
        elif not isinstance(pit, Pit):
            refuse(OptionError, "pit", pit, "must be a rover_gym.ground.grains.Pit")
        self.pit = pit
        self.grain_radius = span("grain_radius", grain_radius, above=0.0)
        self.grain_density = number("grain_density", grain_density, above=0.0)
        self.grain_friction = number("grain_friction", grain_friction, at_least=0.0)
        self.grain_tolerance = number("grain_tolerance", grain_tolerance, above=0.0, at_most=1.0)
        self.n_beds = whole("n_beds", n_beds, at_least=1, at_most=MOST_BEDS, error=OptionError)
        self.sleep = flag("sleep", sleep)
        if arguments.get("model") is None:
            arguments["model"] = with_wheel_width(RoverModel().replace(wheel_radius=WHEEL_RADIUS), WHEEL_WIDTH)
        super().__init__(n, **{**DEFAULTS, **arguments, "terrain": pit.terrain})

    def make_episodes(self) -> EpisodeBatch:
        """The rovers in the core, without grains until their episodes begin."""
        self._among: list[RoverGrainSimulation | None] = [None] * self.n
        self.beds: list[BedDraw | None] = [None] * self.n
        return super().make_episodes()

    @property
    def movers(self) -> list[RoverGrainSimulation | None]:
        """Each rover among its grains."""
        return self._among

    def draw_rows(
        self, rows: Rows, difficulties: Sequence[Range | None], fixed: ResetOptions | Sequence[ResetOptions]
    ) -> DrawnInBeds:
        """Draws episodes and their beds.

        Raises:
            StateError: As `RoverEnv.reset`, or a part of the rover is in a grain.
            TerrainError: As `RoverEnv.reset`.
        """
        episodes = super().draw_rows(rows, difficulties, fixed)
        drawn = DrawnInBeds(episodes, [], [], episodes.generators)
        for k, row in enumerate(drawn.rows):
            generator = generator_at(row)
            number, along_x, along_z = generator.integers(0, (self.n_beds, 2, 2)).tolist()
            drawn.rows[k] = row_of(generator)
            bed, rover = BedDraw(number, bool(along_x), bool(along_z)), episodes.simulation(k)
            drawn.beds.append(bed)
            drawn.grains.append(self._grains(rover, bed))
            _together(rover, drawn.grains[k])  # refuses a rover in a grain before anything changes
        return drawn

    def begin_drawn(self, chosen: Sequence[int], drawn: Any) -> None:
        """Starts drawn episodes, each in its bed."""
        super().begin_drawn(chosen, drawn.episodes)
        self.episodes.set_generators(chosen, drawn.rows)
        for i, bed, grains in zip(chosen, drawn.beds, drawn.grains, strict=True):
            self.beds[i], self._among[i] = bed, _together(self.episodes.simulation(i), grains)

    def _grains(self, rover: Simulation, bed: BedDraw) -> GrainSimulation:
        """The grains of a bed, in the steps of a rover."""
        fill = _settled(self.pit, self.grain_radius, self.grain_density, self.grain_friction, bed.number)
        return fill.mirrored(along_x=bed.along_x, along_z=bed.along_z).simulation(
            friction=self.grain_friction,
            wall_friction=self.grain_friction,
            gravity=rover.gravity,
            time_step=rover.time_step,
            tolerance=self.grain_tolerance,
            sleep=self.sleep,
            sleep_speed=SLEEP_SPEED,
        )

    def snapshot_of(self, i: int) -> GrainsEnvSnapshot:
        """The state of rover i and its grains."""
        known, among, bed = super().snapshot_of(i), self._among[i], self.beds[i]
        assert among is not None and bed is not None  # noqa: S101, PT018 - `begin_drawn` has set them
        return GrainsEnvSnapshot(**vars(known), bed=bed, grains=among.grains.snapshot())

    def check_snapshot(self, snapshot: EnvSnapshot) -> Restored:
        """Checks a snapshot of a rover and its grains.

        Raises:
            StateError: The snapshot is of an environment without grains or with other beds, or as of `RoverBatch`.
        """
        checked = super().check_snapshot(snapshot)
        if not isinstance(snapshot, GrainsEnvSnapshot):
            refuse(StateError, "snapshot", snapshot, "must come from RoverGrainsEnv.snapshot()")
        if not snapshot.bed.number < self.n_beds:
            refuse(StateError, "snapshot.bed", snapshot.bed, f"must be one of this environment's {self.n_beds} beds")
        grains = self._grains(checked.simulation, snapshot.bed)
        grains.restore(snapshot.grains)
        return replace(checked, grains=grains)

    def adopt(self, i: int, checked: Restored) -> None:
        """Goes on from a checked snapshot."""
        super().adopt(i, checked)
        snapshot, rover = checked.snapshot, self.episodes.simulation(i)
        assert isinstance(snapshot, GrainsEnvSnapshot)  # noqa: S101 - checked
        # Together while the rover is far away: what runs may overlap more than what starts.
        at, away = rover.snapshot(), np.zeros(self.task.model.nq)
        away[1] = FAR
        rover.set_state(away)
        self.beds[i], self._among[i] = snapshot.bed, _together(rover, checked.grains)
        rover.restore(at)


def _together(rover: Simulation, grains: Any) -> RoverGrainSimulation:
    return RoverGrainSimulation(rover, grains, wheel_friction=rover.friction)


class RoverGrainsEnv(RoverEnv):
    """Drive the rover of `Rover-v0` through a pit of grains to a goal beyond it.

    Action, observation, reward, end and info are those of `Rover-v0`, whose card describes them. What differs:

    ## Ground

    Level solid ground with a pit, 2.4 m long, 2.0 m wide and 0.09 m deep, 0.9 m ahead of the start, filled to the
    brim with some 1170 balls of 30 to 40 mm radius, which roll, slide and are pushed aside. Grains meet one another,
    the ground and the rover with exact contact and Coulomb friction, and forces go both ways within the step.

    The built-in rover weighs 960 kg: on its wheels of 0.10 m it would sink into loose grains down to its trunk. Here it
    has wheels of 0.25 m radius and 0.20 m width unless `model` says otherwise. Gravity is that of Mars, 3.71 m/s². On
    Earth the rover digs itself in before the far bank.

    ## Observation

    `wheel_gap` and `wheel_contact` count grains as ground. The forces of a wheel are sums over all grains and ground
    that it touches. There is no height scan. With `gymnasium.make(..., sensors=[...])` cameras and scanners see the
    grains.

    ## Start

    The rover starts at the origin. Goal, heading and bearing are drawn as in `Rover-v0`, by default 4.5 to 5.5 m away,
    straight ahead within 5 degrees. Each reset draws one of `n_beds` beds and mirrors it at random along and across the
    pit, so that there are four times as many. Beds are settled when they are first drawn, some ten seconds each, and
    shared by all environments of a process.

    ## Arguments

    Those of `Rover-v0`, but for `terrain`, `difficulty`, `rock_abundance`, `max_rock_radius`, `slope_deg`,
    `hill_slope_deg` and `height_scan`, and in addition:

    | name            | default        | unit  | meaning                                                        |
    |-----------------|----------------|-------|----------------------------------------------------------------|
    | pit             | `Pit()`        |       | the pit, a `rover_gym.ground.grains.Pit`                              |
    | grain_radius    | (0.03, 0.04) | m     | range of the grains' radii                                     |
    | grain_density   | 2600           | kg/m³ | density of the grains                                          |
    | grain_friction  | 0.5            |       | Coulomb's coefficient between grains, and of grains on ground  |
    | grain_tolerance | 0.001          |       | relative residual to which a step's contact problem is solved  |
    | n_beds          | 2              |       | how many beds episodes are drawn from                          |
    | sleep           | True           |       | whether grains at rest far from the rover are left out         |

    `friction` is that of the rover on ground and grains.

    ## Version history

    - v0: numbers may change until the first release.
    """

    def __init__(
        self,
        *,
        pit: Pit | None = None,
        grain_radius: float | tuple[float, float] = (0.03, 0.04),
        grain_density: float = 2600.0,
        grain_friction: float = 0.5,
        grain_tolerance: float = 1e-3,
        n_beds: int = 2,
        sleep: bool = True,
        **arguments: Unpack[RoverArguments],
    ) -> None:
        own = {name: value for name, value in locals().items() if name not in ("self", "arguments", "__class__")}
        super().__init__(**own, **arguments)

    @classmethod
    def make_batch(cls, n: int, **arguments: Any) -> GrainsBatch:
        """A batch of rovers for environments of this class."""
        return GrainsBatch(n, **arguments)

    @property
    def grains(self) -> GrainSimulation:
        """The grains of the episode; read them, but do not step them.

        Raises:
            ResetNeeded: The environment has not been reset.
        """
        self.batch.check_begun(self.i)
        assert self.mover is not None  # noqa: S101 - the episode has begun
        return self.mover.grains

    @property
    def bed(self) -> BedDraw:
        """The bed of the episode as it was drawn.

        Raises:
            ResetNeeded: The environment has not been reset.
        """
        self.batch.check_begun(self.i)
        assert isinstance(self.batch, GrainsBatch)  # noqa: S101 - `make_batch` makes no other
        bed = self.batch.beds[self.i]
        assert bed is not None  # noqa: S101 - the episode has begun
        return bed

    def make_renderer(self, scene: EpisodeScene) -> FrameRenderer:
        """Creates a renderer with this environment's `render_options`; the caller must close it."""
        from rover_gym.show.frames.scenery_actors import BallsActor  # noqa: PLC0415 - only rendering needs it

        renderer = super().make_renderer(scene)
        self._balls = BallsActor(self.grains.radius)
        renderer.shade(self._balls)
        self._drawn = self.bed.number
        return renderer

    def render(self) -> npt.NDArray[np.uint8] | None:
        """Renders the present state as `RoverEnv.render` does, with the grains."""
        if self._renderer is not None and self._drawn != self.bed.number:
            self._renderer.close()
            self._renderer = None
        if self.render_mode is not None:
            scene = self.scene
            if self._renderer is None:
                self._renderer, self._drawn_scene = self.make_renderer(scene), None
            self._balls.place(self.grains.position)
        return super().render()


@functools.lru_cache(maxsize=8)
def _settled(pit: Pit, radius: tuple[float, float], density: float, friction: float, number: int) -> PitFill:
    """Bed number k of all environments of a process with this pit and these grains."""
    frictions = {"friction": friction, "wall_friction": friction}
    return pit.fill(*radius, density=density, seed=number, time_step=4e-3, **frictions)
