"""Planar runs, recorded and read back: a ball, a two-wheel rover or the straight-driving rover over its ground.

run = open_run("rover.h5").resample(25.0)
run.discs[-1, 0, :2]
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from rover_gym.core import (
    Line,
    PlanarGround,
    PlanarSimulation,
    Polyline,
    RoverModel,
    Sine,
    Spline,
)
from rover_gym.core.validation import checked, refuse
from rover_gym.record.channels import (
    RESIDUAL,
    TIME,
    Channel,
    RecordingError,
    Sampler,
    energy_channels,
    sound,
)
from rover_gym.record.run import LARGEST, Array, Run, are_sizes, check_rows, rim_slip, width_of

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from rover_gym.record.trajectory import Trajectory

COORDINATES = {
    3: ("x", "y", "theta"),
    5: ("x", "y", "theta", "theta_a", "theta_b"),
    7: ("x", "y", "theta", "front_wheels", "bogies", "middle_wheels", "back_wheels"),
}

#: The grounds and the properties that make them.
GROUNDS: dict[str, tuple[type[PlanarGround], tuple[str, ...]]] = {
    "line": (Line, ("slope", "offset")),
    "sine": (Sine, ("amplitude", "wavelength", "phase", "offset")),
    "spline": (Spline, ("x", "y")),
    "polyline": (Polyline, ("x", "y")),
}

DISCS = {1: ("ball",), 2: ("wheel A", "wheel B"), 3: ("front wheels", "middle wheels", "back wheels")}


#: Channel of the impulses in the world frame, which earlier recordings lack.
IN_WORLD = "world_impulses"


def planar_channels(coordinates: int, discs: int) -> tuple[Channel, ...]:
    """The channels of a machine with so many coordinates and discs."""
    names, of_discs = COORDINATES[coordinates], DISCS[discs]
    impulses = (
        "impulses of a step along the normal (out of the ground) and the tangent (forward), summed over the contacts"
        " of a disc, mean over the steps since the last row"
    )
    rates = tuple(f"{name}_rate" for name in names)
    gaps = "distance from disc to ground, negative where they overlap"
    return (
        TIME,
        Channel("q", "m, rad", "coordinates, angles turn to the left", (coordinates,), names, read="sim.q"),
        Channel("v", "m/s, rad/s", "their rates", (coordinates,), rates, read="sim.v"),
        Channel("centres", "m", "centres of the discs: x forward, y up", (discs, 2), of_discs, read="sim.centres"),
        Channel("gaps", "m", gaps, (discs,), of_discs, read="sim.gaps"),
        Channel("impulses", "N s", impulses, (discs, 2), of_discs, read="impulses"),
        Channel(
            IN_WORLD,
            "N s",
            "impulses along x and y, mean over the steps since the last row",
            (discs, 2),
            of_discs,
            read=IN_WORLD,
        ),
        Channel("torques", "N m", "driving torques, positive drives forward", (discs,), of_discs, read="sim.torques"),
        *energy_channels("", "the mass centre at height 0"),
        RESIDUAL,
    )


class PlanarSampler(Sampler):
    """Makes rows of a planar simulation for a `Recorder`.

    Args:
        sim: The simulation.

    Attributes:
        impulses: (n_discs, 2) impulses of a step along normal and tangent, mean since the last row, N s.
        world_impulses: (n_discs, 2) along x and y.
    """

    title = "a machine in the plane"
    without_seed = "none: the scene has no randomness"

    @checked(sim="PlanarSimulation")
    def __init__(self, sim: PlanarSimulation) -> None:
        super().__init__(sim)
        self.channels = planar_channels(len(sim.q), len(sim.centres))

    def clear(self) -> None:
        """Resets what is gathered from row to row."""
        super().clear()
        self._impulses, self._in_world = np.zeros((2, len(self.sim.centres), 2))

    def gather(self, report: Any) -> None:  # noqa: ARG002 - the impulses are the simulation's
        """Adds the impulses of the last step."""
        contacts = self.sim.contacts
        impulses, normals = contacts.impulses, contacts.normals
        tangents = np.column_stack((normals[:, 1], -normals[:, 0]))
        np.add.at(self._impulses, contacts.discs, impulses)
        np.add.at(self._in_world, contacts.discs, impulses[:, :1] * normals + impulses[:, 1:] * tangents)

    def measure(self) -> None:
        """Measures what several channels read."""
        super().measure()
        steps = max(1, self.steps)
        self.impulses, self.world_impulses = self._impulses / steps, self._in_world / steps

    def scene(self) -> dict[str, Any]:
        """The ground, the machine and the start."""
        sim, ground = self.sim, self.sim.ground
        kind = type(ground).__name__.lower()
        machine = {
            name: value.to_dict() if isinstance(value, RoverModel) else value for name, value in sim.parameters.items()
        }
        return {
            "kind": type(sim).__name__,
            "ground": {"kind": kind, **{name: getattr(ground, name) for name in GROUNDS[kind][1]}},
            "machine": machine,
            "q": sim.q,
            "v": sim.v,
            "torques": sim.torques,
        }


#: Coordinates that are the discs' angles, by the number of coordinates.
ANGLES = {3: (2,), 5: (3, 4), 7: (3, 5, 6)}


@dataclass(frozen=True)
class PlanarRun(Run):
    """A recorded planar run.

    Attributes:
        trajectory: The data sets and attributes of the file.
        ground: The line that the machine moved on.
        radius: (n_discs,) m.
    """

    MISSING = "contains no planar machine; `rover planar` records such runs"
    NEEDED = ("centres", "q")

    ground: PlanarGround
    radius: Array

    @classmethod
    def is_scene(cls, scene: Mapping[str, Any]) -> bool:
        """Whether a file with this scene is a planar run on a line."""
        return isinstance(scene.get("ground"), dict) and isinstance(scene.get("machine"), dict)

    @classmethod
    def _checked(cls, trajectory: Trajectory, path: str | Path) -> Self:
        discs, coordinates = width_of(trajectory, "centres", 3), width_of(trajectory, "q", 2)
        if discs not in DISCS or coordinates not in COORDINATES or len(ANGLES[coordinates]) != discs:
            refuse(RecordingError, f"{path}: centres", discs, "must be one, two or three discs with their coordinates")
        channels = [
            one for one in planar_channels(coordinates, discs) if one.name != IN_WORLD or IN_WORLD in trajectory.data
        ]
        check_rows(trajectory, path, channels, bounded=("q", "v", "centres"), needed=True)
        with sound(path, "scene"):
            plain = dict(trajectory.scene["ground"])
            ground = GROUNDS[plain.pop("kind")][0](**plain)
            radius = _radii(trajectory.scene["machine"], discs)
            step = float(trajectory.attributes["solver"]["time_step"])
        if not are_sizes(radius) or not 0.0 < step <= LARGEST:
            refuse(
                RecordingError, f"{path}: scene.machine", radius.tolist(), "must have radii above 0, and a time step"
            )
        return cls(trajectory, ground, radius)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the discs, back to front for two wheels."""
        names = DISCS[len(self.radius)]
        return ("back wheel", "front wheel") if len(names) == 2 else names

    @property
    def discs(self) -> Array:
        """(n, n_discs, 3) x and y of the discs' centres, m, and their angles, rad, counter-clockwise positive."""
        q = self.trajectory["q"]
        angles = q[:, ANGLES[q.shape[1]]]
        return np.concatenate((self.trajectory["centres"], angles[..., None]), axis=2)

    @property
    def loads(self) -> Array:
        """(n, n_discs) force of the ground on each disc along its normal, mean since the previous sample, N."""
        return self.trajectory["impulses"][..., 0] / self.time_step

    @property
    def time_step(self) -> float:
        """Time step of the simulation, s."""
        return float(self.trajectory.attributes["solver"]["time_step"])

    @property
    def forces(self) -> Array | None:
        """(n, n_discs, 2) force of the ground on each disc along x and y, mean since the previous sample, N.

        None for recordings of earlier versions, which do not hold it.
        """
        impulses = self.trajectory.data.get(IN_WORLD)
        return None if impulses is None else impulses / self.time_step

    @property
    def speed(self) -> Array:
        """(n,) speed of the first body's centre, m/s."""
        result: Array = np.linalg.norm(self.trajectory["v"][:, :2], axis=1)
        return result

    @property
    def slip_speeds(self) -> Array:
        """(n, n_discs) rim speed minus travel speed, m/s."""
        v = self.trajectory["v"]
        return rim_slip(v, ANGLES[v.shape[1]], self.radius)


def _radii(machine: dict[str, Any], discs: int) -> Array:
    """Radii of the discs from the machine's parameters, (n_discs,), m."""
    if "model" in machine:
        model = RoverModel.from_dict(machine["model"])
        return np.full(discs, float(np.mean(model.wheel_radii)))
    radius = machine["radius"] if "radius" in machine else machine["wheel_radius"]
    return np.broadcast_to(np.asarray(radius, dtype=np.float64), (discs,)).copy()
