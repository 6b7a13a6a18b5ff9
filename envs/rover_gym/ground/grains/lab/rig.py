"""A test rig on a bed: a tool on driven joints, the forces of the grains on it, and its checks.

Driven joints follow set-points that move, held by an implicit controller so stiff that they lag by micrometres. Its
stiffness goes with mass over the step squared, so a rig keeps its motion exactly where times are scaled.
"""

from __future__ import annotations

import csv
import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, fields, is_dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from rover_gym.core import GrainSimulation, OptionError, Plane, RoverGrainSimulation, RoverModel, Simulation
from rover_gym.core.files import written_whole
from rover_gym.core.validation import checked, number, refuse
from rover_gym.ground.grains import disk_bed
from rover_gym.ground.grains.ball_bed import BallBed

if TYPE_CHECKING:
    from _typeshed import DataclassInstance


Array = npt.NDArray[np.float64]

TIME_STEP = 2e-3  # s

#: Relative residual of the contacts: means over many steps do not need the tenth of it.
TOLERANCE = 3e-3

#: Stiffness of a driven joint, in masses (or inertias) over the step squared.
HOLD = 100.0

#: Distance at which a tool starts above the balls, in radii of the largest.
CLEARANCE = 1e-3

MOST_STEPS = 10_000_000  # of one run: more would not finish


class Rig:
    """A tool on a bed, moved joint by joint. The bed's floor bears the tool too.

    Args:
        bed: Balls at rest.
        machine: The machine, as `RoverModel.from_dict` takes it. Its last solid is the tool.
        start: Coordinates at which it starts, by joint, m and rad.
        tool_friction: Coulomb's coefficient between the tool and grains.
        **options: Options of `GrainSimulation`; `time_step` and `tolerance` are those of this module by default.

    Raises:
        OptionError: Gravity does not point down, or an option is out of its range.
        ModelError: The machine is not valid.
        StateError: The tool is in a ball.
    """

    def __init__(
        self, bed: BallBed, machine: dict[str, Any], start: Mapping[str, float], *, tool_friction: float, **options: Any
    ) -> None:
        grains = ground(bed, **options)
        model = RoverModel.from_dict(machine)
        tool = Simulation(
            model,
            Plane(),
            gravity=grains.settings["gravity"],
            friction=tool_friction,
            time_step=grains.time_step,
        )
        joints = model.dof_names
        tool.set_state([start.get(name, 0.0) for name in joints], np.zeros(len(joints)))
        self.both = RoverGrainSimulation(tool, grains, wheel_friction=tool_friction)
        self.time_step = float(grains.time_step)
        self.steps = self.unconverged = 0
        self._index = {name: i for i, name in enumerate(joints)}
        self._tool = model.solid_names[-1]
        # Diagonal of the mass matrix: what a joint moves.
        self._moved = np.diag(model.mass_matrix(tool.q))

    def place(self, joint: str) -> float:
        """Coordinate of a joint, m or rad."""
        return float(self.both.rover.q[self._index[joint]])

    def step(self, set_points: Mapping[str, float]) -> tuple[Array, Array]:
        """Takes a step with the driven joints at these set-points at its end.

        Returns:
            Mean force of the grains on the machine, (3,), N, and moment about the tool's origin, (3,), N m.
        """
        rover = self.both.rover
        for joint, place in set_points.items():
            stiffness = HOLD * float(self._moved[self._index[joint]]) / self.time_step**2
            rover.hold(joint, [place], stiffness=stiffness, damping=0.0)
        report = self.both.step()
        self.steps += 1
        self.unconverged += not report.is_converged
        contacts = rover.contacts
        if len(contacts) == 0:
            return np.zeros(3), np.zeros(3)
        forces = np.einsum("ci,cij->cj", contacts.impulses, contacts.frames) / self.time_step
        arms = contacts.points - rover.poses()[self._tool][0]
        return forces.sum(axis=0), np.cross(arms, forces).sum(axis=0)

    def lower(self, joint: str, speed: float, load: float, driven: Mapping[str, float]) -> None:
        """Lowers the tool along a joint until the grains bear the load, and lets go of that joint.

        A load that is let fall instead sinks in by twice as much.

        Args:
            joint: A joint whose coordinate grows upwards.
            speed: m/s.
            load: N.
            driven: Set-points of the other driven joints.
        """
        place, borne = self.place(joint), 0.0
        while borne < load:  # the floor bears any
            place -= speed * self.time_step
            force, _ = self.step({**driven, joint: place})
            borne = float(force[1])
        self.both.rover.release(joint)


def ground(bed: BallBed, **options: Any) -> GrainSimulation:
    """The bed as a simulation with the laboratory's options.

    Raises:
        OptionError: Gravity does not point down.
    """
    grains = bed.simulation(**{"time_step": TIME_STEP, "tolerance": TOLERANCE, **options})
    gravity = grains.settings["gravity"]
    if gravity[0] != 0.0 or gravity[2] != 0.0 or gravity[1] >= 0.0:
        refuse(OptionError, "gravity", tuple(gravity), "must point down")
    return grains


def fall(grains: GrainSimulation) -> float:
    """Gravity, m/s², positive."""
    return -float(grains.settings["gravity"][1])


def step_count(field: str, duration: float, time_step: float) -> int:
    """Number of steps in a time, at least one; raises an OptionError naming `field` above the limit."""
    return max(1, disk_bed.step_count(field, duration, time_step, MOST_STEPS))


def larger_than_grains(field: str, value: object, bed: BallBed) -> float:
    """A radius or width of a tool, m, at least the diameter of the largest ball."""
    length = number(field, value, above=0.0)
    largest = 2.0 * float(bed.radius.max())
    if length < largest:
        refuse(OptionError, field, value, f"must be at least the largest ball's diameter, {largest:g} m")
    return length


def clear_height(bed: BallBed, x: float, z: float, reach: float) -> float:
    """Height above which an upright tool clears the balls within a distance, m."""
    near = np.hypot(bed.position[:, 0] - x, bed.position[:, 2] - z) < reach + bed.radius
    heights = (bed.position[:, 1] + bed.radius)[near]
    return float(heights.max(initial=0.0)) + CLEARANCE * float(bed.radius.max())


#: Rounding of the disc's edges, in thicknesses.
ROUNDING = 0.05

#: Thickness of a vane, in its height.
VANE_THICKNESS = 0.25


def describe_disc(
    bed: BallBed, radius: float, thickness: float, mass: float, *, vanes: int = 0, vane_height: float = 0.0
) -> dict[str, Any]:
    """The tool as a model: `press` along y over the middle of the bed, and `disc`, which turns about y.

    The origin of both is the middle of the disc's lower face. The disc is a wheel that lies.

    Args:
        bed: Over which it hangs.
        radius: Of the disc, m.
        thickness: Of the disc, m.
        mass: Of all, kg.
        vanes: Number of radial vanes below the disc, from its centre to its edge.
        vane_height: Of the vanes, m.
    """
    point = {"inertia": [mass * radius**2] * 3 + [0.0] * 3, "centre_of_mass": [0.0] * 3}
    shapes = []
    for k in range(vanes):
        angle = 2.0 * math.pi * k / vanes
        shapes.append(
            {
                "kind": "box",
                "size": [radius, vane_height, VANE_THICKNESS * vane_height],
                "position": [
                    0.5 * radius * math.cos(angle),
                    -0.5 * (thickness + vane_height),
                    -0.5 * radius * math.sin(angle),
                ],
                "rotation": [0.0, angle, 0.0],
                "collides": True,
            }
        )
    disc = {
        "name": "disc",
        "parent": "press",
        "joint": "revolute",
        "axis": [0, 1, 0],
        "position": [0, 0.5 * thickness, 0],
        "mass": 0.5 * mass,
        **point,
    }
    if shapes:
        disc["shapes"] = shapes
    return {
        "format": 1,
        "name": "disc on a press",
        "solids": [
            {
                "name": "press",
                "joint": "prismatic",
                "axis": [0, 1, 0],
                "position": [0.5 * bed.width, 0, 0.5 * bed.depth],
                "mass": 0.5 * mass,
                **point,
            },
            disc,
        ],
        "wheels": [
            {
                "name": "D",
                "solid": "disc",
                "axle": [0, 1, 0],
                "radius": radius,
                "width": thickness,
                "rounding": ROUNDING * thickness,
                "stiffness": 0.0,
                "torque_limit": 1.0,
                "drive_sign": 1,
            }
        ],
    }


def check_room(bed: BallBed, radius: float) -> None:
    """Refuses a disc that leaves less than the largest ball to the nearest wall."""
    most = 0.5 * min(bed.width, bed.depth) - 2.0 * float(np.max(bed.radius))
    if radius > most:
        refuse(
            OptionError,
            "radius",
            radius,
            f"must be at most {most:.3g} m on a bed {bed.width:.3g} m long and "
            f"{bed.depth:.3g} m wide, to leave a ball to the walls",
        )


@checked(points=Sequence, path=Path)
def write_table(points: Sequence[DataclassInstance], path: str | Path) -> Path:
    """Writes points of one test, a line each under the names of their fields; numbers keep all their digits.

    Args:
        points: Points of one kind, at least one.
        path: File to write.

    Raises:
        OptionError: There is no point.
        OSError: The file cannot be written.
    """
    rows: list[Any] = list(points)
    if not rows or not all(is_dataclass(point) and not isinstance(point, type) for point in rows):
        refuse(OptionError, "points", points, "must be points of one test, one or more")
    with written_whole(path) as draft, draft.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, [field.name for field in fields(rows[0])], lineterminator="\n")
        writer.writeheader()
        writer.writerows(asdict(point) for point in rows)
    return Path(path)
