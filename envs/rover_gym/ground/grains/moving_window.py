"""A moving window of grains: a rover drives over a long bed, of which only the balls about it are simulated."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar

import numpy as np
import numpy.typing as npt

from rover_gym.core import GrainSimulation, OptionError, RoverGrainSimulation, Simulation, StateError
from rover_gym.core.validation import checked, number, refuse, whole
from rover_gym.ground.grains.grain_surface import MAP, Footprint, Parts

if TYPE_CHECKING:
    from rover_gym.core import Drum, Silo, Snapshot, StepReport

Array = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]
Numbers = npt.NDArray[np.int64]
T = TypeVar("T", np.float64, np.bool_)

#: Thickness of the border, in diameters of the largest ball: what it carries lies on balls and never beside them.
BORDER = 3.0
#: How far a ball may run out over the border before it gets one of its own, in the same diameters.
STRAY = 1.5
#: Least reach, in the same diameters.
LEAST_REACH = 2.0


class BedEnergy(NamedTuple):
    """Energy of all balls of a bed, J.

    Attributes:
        kinetic: Of those in the window; the others rest.
        potential: In gravity, zero with all centres at the world's origin.
    """

    kinetic: float
    potential: float


@dataclass(frozen=True, eq=False)
class WindowSnapshot:
    """Everything that a `MovingWindow` needs to continue bit for bit.

    Attributes:
        position: (n, 3) centres of all balls when the window was last set, m.
        velocity: (n, 3) of the centres, m/s.
        spin: (n, 3) angular velocities, rad/s.
        inside: Increasing numbers of the window's balls.
        kinematic: Which of them do not move.
        footprint: The rover when the window was last set.
        low: Height below which parts of the rover may meet a ball that rests, m.
        frozen_momentum: N s.
        moves: How often the window moved.
        both: The rover among the window's balls.
    """

    position: Array
    velocity: Array
    spin: Array
    inside: Numbers
    kinematic: Flags
    footprint: Footprint
    low: float
    frozen_momentum: float
    moves: int
    both: Snapshot


class MovingWindow:
    """A rover on a bed of which only the balls about the rover's wheels are simulated.

    Balls within `reach` of a wheel, seen from above, are simulated, and so are those near a box of the rover that hangs
    low. The balls around them, three diameters of the largest wide, are kinematic: they keep their place and hold
    the others. Those beyond keep their place too and cost nothing. Once a wheel has moved by `stride` the window is set
    anew, so a ball that rests is never closer to a wheel than `reach - stride`. A ball that is left behind faster
    than `freeze_speed` stays in the simulation, with a border of its own, until it is slower. What is frozen loses
    its velocity; `frozen_momentum` adds up how much.

    Time, the rover and its commands run on. Balls that stay in the window keep the impulses of their contacts.

    Args:
        rover: The rover.
        grains: All balls of the bed. From here on this simulation has those of the window alone.
        wheel_friction: Coulomb's coefficient between the rover and balls.
        reach: Distance from a wheel within which balls are simulated, m; at least two diameters of the largest.
        stride: How far a wheel moves before the window follows, m; at most half of `reach`.
        freeze_speed: Speed of its fastest point below which a ball outside of the window is frozen, m/s.

    Raises:
        OptionError: An argument is out of its range, or the time steps or gravities of rover and balls differ.
        StateError: A part of the rover is in a ball.
    """

    @checked(rover="Simulation", grains="GrainSimulation")
    def __init__(
        self,
        rover: Simulation,
        grains: GrainSimulation,
        *,
        wheel_friction: float = 0.9,
        reach: float = 0.3,
        stride: float = 0.1,
        freeze_speed: float = 0.02,
    ) -> None:
        both = RoverGrainSimulation(rover, grains, wheel_friction=wheel_friction)
        radius = grains.radius
        self._diameter = 2.0 * float(radius.max())
        self._reach = number("reach", reach, at_least=LEAST_REACH * self._diameter)
        self._stride = number("stride", stride, above=0.0, at_most=0.5 * self._reach)
        self._freeze_speed = number("freeze_speed", freeze_speed, above=0.0)
        if grains.velocity[grains.kinematic].any():
            refuse(
                OptionError, "grains", "a moving ball with prescribed velocity", "must have zero prescribed velocities"
            )
        self._both, self._rover, self._grains = both, rover, grains
        self._parts = Parts(rover.model)
        self._radius, self._mass, self._glued = radius, grains.mass, grains.kinematic
        self._position, self._velocity, self._spin = grains.position, grains.velocity, grains.spin
        self._inside: Numbers = np.arange(len(radius))
        self._kinematic = self._glued
        self._frozen_momentum, self._moves = 0.0, 0
        self._low = self._top(self._inside)
        self._set(self._parts.footprint(rover, self._low))

    @property
    def rover(self) -> Simulation:
        """The rover's simulation."""
        return self._rover

    @property
    def grains(self) -> GrainSimulation:
        """The simulation of the window's balls, in the order of `inside`."""
        return self._grains

    @property
    def inside(self) -> Numbers:
        """Increasing numbers of the window's balls, with its border, (n_inside,)."""
        return self._inside.copy()

    @property
    def radius(self) -> Array:
        """Radii of all balls, (n,), m."""
        return self._radius.copy()

    @property
    def mass(self) -> Array:
        """Masses of all balls, (n,), kg."""
        return self._mass.copy()

    @property
    def position(self) -> Array:
        """Centres of all balls, (n, 3), m."""
        return self._whole(self._position, self._grains.position)

    @property
    def velocity(self) -> Array:
        """Velocities of the centres of all balls, (n, 3), m/s."""
        return self._whole(self._velocity, self._grains.velocity)

    @property
    def spin(self) -> Array:
        """Angular velocities of all balls, world frame, (n, 3), rad/s."""
        return self._whole(self._spin, self._grains.spin)

    @property
    def kinematic(self) -> Flags:
        """Which balls were kinematic in the bed, (n,)."""
        return self._glued.copy()

    @property
    def asleep(self) -> Flags:
        """Which balls sleep or are outside of the window, (n,)."""
        return self._whole(np.ones(len(self._radius), dtype=bool), self._grains.asleep)

    @property
    def walls(self) -> Array:
        """A point of each wall and the normal to its free side, (m, 6), m."""
        return self._grains.walls

    @property
    def terrain(self) -> Any:
        """The terrain below the balls, or None."""
        return self._grains.terrain

    @property
    def vessel(self) -> Drum | Silo | None:
        """The vessel around the balls, or None."""
        return self._grains.vessel

    @property
    def settings(self) -> dict[str, Any]:
        """The options of contacts, gravity and solver, by the names of the arguments of `GrainSimulation`."""
        return self._grains.settings

    @property
    def time(self) -> float:
        """Time of the balls, s."""
        return self._grains.time

    @property
    def time_step(self) -> float:
        """Time step, s."""
        return self._grains.time_step

    @property
    def wheel_friction(self) -> float:
        """Coulomb's coefficient between the rover and balls."""
        return self._both.wheel_friction

    @property
    def wheel_gaps(self) -> Array:
        """Gap of each wheel now to the nearest ball or the terrain, (n_wheels,), m."""
        return self._both.wheel_gaps

    @property
    def frozen_momentum(self) -> float:
        """Momentum that balls lost as they were frozen, sum of its magnitudes, N s."""
        return self._frozen_momentum

    @property
    def moves(self) -> int:
        """How often the window was set anew."""
        return self._moves

    def energy(self) -> BedEnergy:
        """Energy of all balls that are not kinematic in the bed."""
        gravity = np.asarray(self.settings["gravity"])
        free = ~self._glued
        potential = -float(self._mass[free] @ (self.position[free] @ gravity))
        return BedEnergy(self._grains.energy().kinetic, potential)

    def penetration(self) -> float:
        """Deepest overlap now in the window, m."""
        return self._both.penetration()

    def step(self, n: int = 1) -> StepReport:
        """Takes n steps; the window follows the rover before each of them, if it must.

        Args:
            n: Number of steps.

        Returns:
            How the steps went.

        Raises:
            StepError: A step could not be taken; the state before it stays.
            OptionError: `n` is not a count.
        """
        report = self._both.step(0)
        for _ in range(whole("n", n, error=OptionError)):
            self._follow()
            report = report.followed_by(self._both.step())
        return report

    def snapshot(self) -> WindowSnapshot:
        """Everything that is needed to continue bit for bit."""
        return WindowSnapshot(
            self._position.copy(),
            self._velocity.copy(),
            self._spin.copy(),
            self._inside.copy(),
            self._kinematic.copy(),
            self._footprint,
            self._low,
            self._frozen_momentum,
            self._moves,
            self._both.snapshot(),
        )

    def restore(self, snapshot: WindowSnapshot) -> None:
        """Goes back to a snapshot.

        Args:
            snapshot: A snapshot of the same rover on the same bed.

        Raises:
            StateError: The snapshot belongs to another rover or another bed, or is damaged. Nothing has changed.
        """
        if not isinstance(snapshot, WindowSnapshot):
            refuse(StateError, "snapshot", snapshot, "must be a WindowSnapshot")
        if snapshot.position.shape != self._position.shape:
            refuse(StateError, "snapshot", len(snapshot.position), f"must be of {len(self._radius)} balls")
        before = self.snapshot()
        try:
            self._load(snapshot)
        except BaseException:
            self._load(before)
            raise

    def _load(self, snapshot: WindowSnapshot) -> None:
        self._position, self._velocity = snapshot.position.copy(), snapshot.velocity.copy()
        self._spin = snapshot.spin.copy()
        self._exchange(snapshot.inside, snapshot.kinematic)
        self._footprint, self._low = snapshot.footprint, snapshot.low
        self._frozen_momentum, self._moves = snapshot.frozen_momentum, snapshot.moves
        self._both.restore(snapshot.both)

    def _whole(self, all_balls: npt.NDArray[T], own: npt.NDArray[T]) -> npt.NDArray[T]:
        """The values of all balls, with those of the window as they are."""
        result = all_balls.copy()
        result[self._inside] = own
        return result

    def _top(self, balls: Numbers) -> float:
        """Height below which a part of the rover may meet one of these balls, m."""
        return float((self._position[balls, 1] + self._radius[balls]).max(initial=-np.inf)) + self._diameter

    def _follow(self) -> None:
        """Sets the window anew, if the rover or a ball has gone too far for it."""
        footprint = self._parts.footprint(self._rover, self._low)
        if footprint.has_moved(self._footprint, self._stride) or self._has_strayed():
            self._position[self._inside] = self._grains.position
            self._velocity[self._inside] = self._grains.velocity
            self._spin[self._inside] = self._grains.spin
            self._set(footprint)
            self._moves += 1

    def _has_strayed(self) -> bool:
        """Whether a ball has run so far out over the border that it needs one of its own."""
        free = ~self._kinematic
        place, start = self._grains.position[free], self._position[self._inside[free]]
        allowed = STRAY * self._diameter
        far = place[((place - start) ** 2).sum(axis=1) > allowed**2]
        return bool((self._footprint.distance(far[:, MAP]) > self._reach + allowed).any())

    def _set(self, footprint: Footprint) -> None:
        """Chooses the balls of the window for a place of the rover, from the state of all balls."""
        border = BORDER * self._diameter
        moved = self._inside[~self._kinematic]
        rim = np.linalg.norm(self._velocity[moved], axis=1)
        rim += self._radius[moved] * np.linalg.norm(self._spin[moved], axis=1)
        fast = moved[rim > self._freeze_speed]
        # Of a long bed, what is far along x is left out at once.
        x = self._position[:, 0]
        low, high = footprint.bounds()
        low = min(low - self._reach, float(x[fast].min(initial=low))) - border
        high = max(high + self._reach, float(x[fast].max(initial=high))) + border
        near = np.flatnonzero((x > low) & (x < high))
        if not len(near):
            near = np.array([footprint.distance(self._position[:, MAP]).argmin()])
        places = self._position[near][:, MAP]
        distance = footprint.distance(places)
        is_free, is_inside = distance < self._reach, distance < self._reach + border
        is_stray = np.isin(near, fast) & ~is_free
        for stray in places[is_stray]:
            is_inside |= np.hypot(*(places - stray).T) < border
        is_free |= is_stray
        is_free &= ~self._glued[near]
        if not is_inside.any():
            is_inside[distance.argmin()] = True
        frozen = np.setdiff1d(moved, near[is_free], assume_unique=True)
        self._frozen_momentum += float(self._mass[frozen] @ np.linalg.norm(self._velocity[frozen], axis=1))
        self._velocity[frozen] = self._spin[frozen] = 0.0
        self._low = max(self._low, self._top(frozen))
        self._footprint = footprint
        self._exchange(near[is_inside], ~is_free[is_inside])

    def _exchange(self, inside: Numbers, kinematic: Flags) -> None:
        """Puts these balls into the simulation."""
        numbers = np.searchsorted(self._inside, inside)
        numbers[numbers == len(self._inside)] = 0
        before = np.where(self._inside[numbers] == inside, numbers, -1)
        self._grains.exchange(
            self._radius[inside],
            self._mass[inside],
            self._position[inside],
            before.tolist(),
            kinematic=kinematic,
            velocity=self._velocity[inside],
            spin=self._spin[inside],
        )
        self._inside, self._kinematic = inside, kinematic

    def __repr__(self) -> str:
        """Tells the rover and the numbers of balls."""
        counts = f"{len(self._inside)} of {len(self._radius)} balls"
        return f"MovingWindow({self._rover.model.name!r} among {counts}, time={self.time} s)"
