"""One machine of a joined simulation, as its own model sees it: what sensors, observations and rewards read."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from rover_gym.core import Machine, PictureLook, RoverModel, Simulation, Terrain
from rover_gym.envs.observation import Array
from rover_gym.envs.sensors.picture import picture_look
from rover_gym.envs.start import scan_points

#: Parts of a reading that depend on contacts, and entries of each wheel.
WHEEL_ENTRIES = {"wheel_gaps": 1, "wheel_contacts": 1, "normal_forces": 1, "tangential_forces": 2}

#: Rays of the height scan start this far above the trunk's origin, m.
SCAN_HEIGHT = 10.0

#: A ray hits another rover where it ends this far above the ground, m.
ABOVE_GROUND = 1e-6


class MachineView:
    """One machine of a joined simulation, with the names and arrays of its own model.

    It has what sensors read of a `Simulation`. Its rays always see the other machines.

    Args:
        joined: The simulation of all machines, which must not move while the view is used.
        machine: The machine.
        model: Its own model.
    """

    def __init__(self, joined: Simulation, machine: Machine, model: RoverModel) -> None:
        self.joined, self.machine, self.model = joined, machine, model

    @property
    def terrain(self) -> Terrain:
        """The ground."""
        return self.joined.terrain

    @property
    def time(self) -> float:
        """Time of the episode, s."""
        return self.joined.time

    @property
    def gravity(self) -> Array:
        """Gravity, world frame, (3,), m/s2."""
        return self.joined.gravity

    @cached_property
    def q(self) -> Array:
        """Coordinates, (nq,)."""
        return self.joined.q[self.machine.coordinates]

    @cached_property
    def v(self) -> Array:
        """Velocities, (nv,)."""
        return self.joined.v[self.machine.coordinates]

    @property
    def rotation(self) -> Array:
        """Rotation matrix of the trunk, (3, 3)."""
        return self.poses()[self.model.solid_names[0]][1]

    @property
    def motor_torques(self) -> Array:
        """Mean torques of the wheels' drives over the last step, (n_wheels,), N m."""
        return self.joined.motor_torques[self.machine.wheels]

    def poses(self) -> dict[str, tuple[Array, Array]]:
        """Origin (3,), m, and rotation matrix (3, 3) of every solid, world frame."""
        found = self.joined.poses()
        return {own: found[name] for own, name in zip(self.model.solid_names, self.machine.solids, strict=True)}

    def cast_rays(
        self,
        origins: Array,
        directions: Array,
        max_range: float | None = None,
        *,
        parts: bool = False,  # noqa: ARG002 - the other machines are always seen
        without: str | Sequence[str] = (),
    ) -> tuple[Array, Array]:
        """Finds the first point at which each ray hits the ground or a machine, as `Simulation.cast_rays`.

        Args:
            origins: World frame, (n, 3) or (3,), m.
            directions: World frame, (n, 3).
            max_range: Largest distance, m.
            parts: Without effect: the others are always seen, and of the own solids all but those in `without`.
            without: Own solids that are not seen.
        """
        return self.joined.cast_rays(origins, directions, max_range, parts=True, without=self._own(without))

    def take_picture(
        self, look: PictureLook, *view: Array, without: Sequence[str] = (), **options: Any
    ) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.uint8], Array]:
        """Takes a picture of the ground and the machines, as `Simulation.take_picture`.

        Args:
            look: How this machine looks; the others are seen with theirs. One without a rover hides this machine.
            view: Place and directions.
            without: Own solids that are not seen.
            options: The other arguments.
        """
        unseen = self.machine.solids if look is picture_look(None) else self._own(without)
        return self.joined.take_picture(picture_look(self.joined.model), *view, without=unseen, **options)

    def _own(self, names: str | Sequence[str]) -> list[str]:
        """Names of own solids in the joined model."""
        return [f"{self.machine.name}/{name}" for name in ([names] if isinstance(names, str) else names)]

    def heights(self, offsets: Array) -> Array:
        """Heights of ground and other machines at the points of a height scan, over the trunk's origin, (n,), m.

        Args:
            offsets: Points ahead and to the right of the trunk's origin in the heading frame, (n, 2), m.
        """
        x, y, z, _, heading = self.q[:5]
        places = scan_points(offsets, (x, z), heading)
        origins = np.column_stack((places[:, 0], np.full(len(places), y + SCAN_HEIGHT), places[:, 1]))
        down = np.tile([0.0, -1.0, 0.0], (len(places), 1))
        found, _ = self.joined.cast_rays(origins, down, 2.0 * SCAN_HEIGHT, parts=True, without=self.machine.solids)
        return SCAN_HEIGHT - found


@dataclass(frozen=True)
class MachineContact:
    """Sums over a machine's contacts of the last step.

    Attributes:
        slip_ratio: Mean slip ratio of the wheels in contact, 0 to 2.
        trunk_force: Mean normal force of the ground on all but the wheels, N.
    """

    slip_ratio: float
    trunk_force: float


@dataclass(frozen=True)
class MachineReading:
    """What an episode takes from a machine at the end of a control period.

    Attributes:
        shared: The entries with which observations begin, SI units.
        heights: Heights of the scan, m; (0,) without one.
        cos_tilt: Cosine of the trunk's tilt from the vertical.
        speed: Horizontal speed of the trunk's origin, m/s.
        contact: What the machine's contacts of the last step sum up to.
        time: Time of the episode, s.
    """

    shared: Array
    heights: Array
    cos_tilt: float
    speed: float
    contact: MachineContact
    time: float


class MachineReader:
    """Reads a machine of a joined simulation as `Simulation.reading` does a machine that is alone.

    Args:
        alone: A simulation of the machine alone on the same ground, which takes its state; it never steps.
        machine: The machine.
        scan: Points of the height scan, (n, 2), m; None without one.
        whole: Layout of the reading of all machines.
    """

    def __init__(self, alone: Simulation, machine: Machine, scan: Array | None, whole: Mapping[str, slice]) -> None:
        self.alone, self.machine, self.scan, self._whole = alone, machine, scan, whole
        self._layout = alone.reading_layout(0 if scan is None else len(scan))
        self._n_shared = self._layout["target"].stop

    def view(self, joined: Simulation) -> MachineView:
        """The machine in a joined simulation."""
        return MachineView(joined, self.machine, self.alone.model)

    def read(
        self, view: MachineView, whole: Array, contact: MachineContact, goal: Sequence[float], *, near: bool
    ) -> MachineReading:
        """Reads the machine.

        Args:
            view: The machine, as `view` returns it.
            whole: The reading of all machines, as `Simulation.reading` returns it.
            contact: What the machine's contacts sum up to.
            goal: The present goal (x, z), m.
            near: Whether another machine may be within the height scan.
        """
        self.alone.set_state(view.q, view.v)
        row = self.alone.reading(goal, self.scan)
        for name, entries in WHEEL_ENTRIES.items():
            wheels = slice(entries * self.machine.wheels.start, entries * self.machine.wheels.stop)
            row[self._layout[name]] = whole[self._whole[name]][wheels]
        heights = row[self._layout["heights"]]
        if near and self.scan is not None:
            seen = view.heights(self.scan)
            heights = np.where(seen > heights + ABOVE_GROUND, seen, heights)
        return MachineReading(
            shared=row[: self._n_shared],
            heights=heights,
            cos_tilt=float(row[self._layout["cos_tilt"]][0]),
            speed=float(row[self._layout["speed"]][0]),
            contact=contact,
            time=view.time,
        )
