"""The variables of a unit: torques and set-points in, pose, joints, contacts and forces out."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

from rover_gym.exports.axes import pitch_sign, vector_components

if TYPE_CHECKING:
    from collections.abc import Iterator

    from rover_gym.exports.axes import Axes
    from rover_gym.mechanics import Simulation

#: What a variable is to the importer.
Causality = Literal["independent", "parameter", "input", "output"]


@dataclass(frozen=True)
class UnitVariable:
    """A variable of a unit.

    Attributes:
        reference: The importer's number of it.
        name: Its name.
        causality: What it is to the importer.
        channel: What it is to the unit, as `Channel` of `rust/fmu` names it.
        index: Which entry of the channel.
        unit: SI unit, or "1".
        description: In words.
        start: Value at the start, of parameters and inputs.
        sign: 1 or -1: of the variable, where that of the channel is positive.
    """

    reference: int
    name: str
    causality: Causality
    channel: str
    index: int
    unit: str
    description: str
    start: float | str | None = None
    sign: float = 1.0


def unit_variables(simulation: Simulation, axes: Axes = "world") -> tuple[UnitVariable, ...]:
    """The variables of a simulation, in the order of their references."""
    rows = enumerate(_rows(simulation, axes))
    return tuple(UnitVariable(reference, *row) for reference, row in rows)


Row = (
    tuple[str, Causality, str, int, str, str, float | str | None]
    | tuple[str, Causality, str, int, str, str, float | str | None, float]
)
#: The world's axis that points up.
UP = {"world": "y", "rep103": "z"}


def _rows(simulation: Simulation, axes: Axes) -> Iterator[Row]:
    model, settings = simulation.model, simulation.settings
    yield "time", "independent", "time", 0, "s", "time", None
    for name, unit, what in (
        ("friction", "1", "Coulomb's coefficient of contacts whose materials have none of their own"),
        ("restitution", "1", "Newton's coefficient of the same contacts"),
        ("time_step", "s", "time step of the unit; communication steps are whole multiples of it"),
    ):
        yield name, "parameter", name, 0, unit, what, settings[name]
    what = f"gravity, world, {UP[axes]} up"
    for axis, (i, sign) in zip("xyz", vector_components(axes), strict=True):
        yield f"gravity.{axis}", "parameter", "gravity", i, "m/s2", what, sign * settings["gravity"][i], sign
    what = "text of a model's file (TOML or JSON) with the same joints and wheels; empty for the exported one"
    yield "model", "parameter", "model", 0, "1", what, ""
    wheels = list(enumerate(zip(model.wheel_names, model.to_dict()["wheels"], strict=True)))
    for i, (name, _) in wheels:
        what = "driving torque, positive forward; saturates at the motor's limit"
        yield f"wheel_torque.{name}", "input", "wheel_torque", i, "N.m", what, float(simulation.wheel_torques[i])
    for i, (name, wheel) in wheels:
        if wheel.get("steering") in model.joint_names:
            what = "set-point of the steering"
            yield f"steering.{name}", "input", "steering", i, "rad", what, float(simulation.steering[i])
    yield from _motion(simulation, axes)
    yield from _outputs(simulation, axes)


def _motion(simulation: Simulation, axes: Axes) -> Iterator[Row]:
    """Pose and velocity."""
    joints = list(enumerate(simulation.model.dof_names[6:], 6))
    vector = list(zip("xyz", vector_components(axes), strict=True))
    for axis, (i, sign) in vector:
        yield f"q.{axis}", "output", "q", i, "m", "trunk's origin, world", None, sign
    for i, (name, sign) in enumerate((("roll", 1.0), ("heading", 1.0), ("pitch", pitch_sign(axes))), 3):
        yield f"q.{name}", "output", "q", i, "rad", "trunk's attitude", None, sign
    for i, name in joints:
        yield f"q.{name}", "output", "q", i, "rad", "joint", None
    for axis, (i, sign) in vector:
        yield f"v.v_{axis}", "output", "v", i, "m/s", "trunk's origin, world", None, sign
    for axis, (i, sign) in vector:
        yield f"v.omega_{axis}", "output", "v", 3 + i, "rad/s", "trunk's angular velocity, world", None, sign
    for i, name in joints:
        yield f"v.{name}", "output", "v", i, "rad/s", "joint", None
    what = "trunk to world, unit quaternion"
    yield "attitude.w", "output", "attitude", 0, "1", what, None
    for axis, (i, sign) in vector:
        yield f"attitude.{axis}", "output", "attitude", 1 + i, "1", what, None, sign


def _outputs(simulation: Simulation, axes: Axes) -> Iterator[Row]:
    """Contacts, forces, readings and what the steps took."""
    model = simulation.model
    for i, name in enumerate(model.wheel_names):
        yield f"wheel_gap.{name}", "output", "wheel_gap", i, "m", "to the ground, negative where they overlap", None
    for i, name in enumerate(model.wheel_names):
        for k, side in enumerate(("normal", "rolling", "lateral")):
            what = "mean contact force of the last time step"
            yield f"wheel_force.{name}.{side}", "output", "wheel_force", 3 * i + k, "N", what, None
    for i, name in enumerate(model.wheel_names):
        what = "mean torque that the drive gave in the last time step, positive forward"
        yield f"motor_torque.{name}", "output", "motor_torque", i, "N.m", what, None
    for i, name in enumerate(("specific_force", "angular_velocity")):
        what = "mean over the last communication step, at the trunk's origin, in its frame"
        for axis, (k, sign) in zip("xyz", vector_components(axes), strict=True):
            yield f"imu.{name}.{axis}", "output", "inertial", 3 * i + k, ("m/s2", "rad/s")[i], what, None, sign
    for name, unit, what in (
        ("trunk_force", "N", "mean normal force of the last time step on all that is no wheel"),
        ("kinetic_energy", "J", "of the whole rover"),
        ("potential_energy", "J", "zero with all mass centres at the world's origin"),
        ("contacts", "1", "most contacts of a time step in the last communication step"),
        ("solver_residual", "1", "largest residual of the contact solver in the last communication step"),
        ("solver_iterations", "1", "iterations of the contact solver in the last communication step"),
    ):
        yield name, "output", name, 0, unit, what, None
