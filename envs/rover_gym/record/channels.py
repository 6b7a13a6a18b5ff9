"""The channels of a recording, and the sampler that reads their rows from a simulation."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from rover_gym.mechanics import RoverModel, Simulation
from rover_gym.validation import checked


@dataclass(frozen=True)
class Channel:
    """One data set with one row per sample.

    Attributes:
        name: Name of the data set.
        unit: SI unit of all columns, or "1" for a pure number.
        description: Content of a row, with frame and sign.
        shape: Shape of a row, `()` for a scalar.
        columns: Names along the first axis of a row, or empty.
        packed: Whether the data set is large: it is stored in single precision, compressed, in the group `frames`,
            and read by `read_frames`.
    """

    name: str
    unit: str
    description: str
    shape: tuple[int, ...] = ()
    columns: tuple[str, ...] = ()
    packed: bool = False


def state_channels(model: RoverModel) -> tuple[Channel, Channel]:
    """The channels `q` and `v` of every recording of a rover."""
    return (
        Channel(
            "q",
            "m, rad",
            "public coordinates: trunk x, y (up), z (m); roll, heading, pitch, joint angles (rad);"
            " trunk attitude R = Ry(heading) Rz(pitch) Rx(roll)",
            (model.nq,),
            tuple(model.dof_names),
        ),
        Channel(
            "v",
            "m/s, rad/s",
            "trunk origin's velocity, world (m/s); trunk's angular velocity, world (rad/s); joint rates (rad/s)",
            (model.nv,),
            ("v_x", "v_y", "v_z", "omega_x", "omega_y", "omega_z", *model.dof_names[6:]),
        ),
    )


class RoverSampler:
    """Samples rows from a simulation.

    Args:
        model: The model of the simulations to sample.
    """

    @checked(model="RoverModel")
    def __init__(self, model: RoverModel) -> None:
        wheels = tuple(model.wheel_names)
        n = len(wheels)
        self._wheel_solids = [wheel["solid"] for wheel in model.to_dict()["wheels"]]
        self.channels = (
            Channel("time", "s", "time since the run's start"),
            *state_channels(model),
            Channel("wheel_gaps", "m", "distance from wheel to ground, negative where they overlap", (n,), wheels),
            Channel(
                "wheel_forces",
                "N",
                "mean contact force of the last step along n (ground to wheel), t (rolling direction), b = t x n",
                (n, 3),
                wheels,
            ),
            Channel("wheel_centres", "m", "world: x forward, y up, z to the right", (n, 3), wheels),
            Channel("wheel_torques", "N m", "commanded driving torques, positive drives forward", (n,), wheels),
            Channel(
                "motor_torques",
                "N m",
                "mean torque that each drive gave in the last step, positive drives forward",
                (n,),
                wheels,
            ),
            Channel("steering_set_points", "rad", "set-points of the steering controllers", (n,), wheels),
            Channel("kinetic_energy", "J", "kinetic energy of the whole rover"),
            Channel("potential_energy", "J", "potential energy, zero with all mass centres at the world's origin"),
            Channel("solver_residual", "1", "largest residual of the contact solver since the last row"),
            Channel("solver_iterations", "1", "iterations of the contact solver since the last row"),
        )

    def row(self, sim: Simulation, *, residual: float = 0.0, iterations: int = 0) -> dict[str, npt.ArrayLike]:
        """Samples one row of `channels`.

        Args:
            sim: The simulation to sample; it is not changed.
            residual: Largest residual since the last row, from the step report.
            iterations: Iterations since the last row, from the step report.
        """
        energy = sim.energy()
        poses = sim.poses()
        return {
            "time": sim.time,
            "q": sim.q,
            "v": sim.v,
            "wheel_gaps": sim.wheel_gaps,
            "wheel_forces": sim.wheel_forces,
            "wheel_centres": np.array([poses[solid][0] for solid in self._wheel_solids]),
            "wheel_torques": sim.wheel_torques,
            "motor_torques": sim.motor_torques,
            "steering_set_points": sim.steering,
            "kinetic_energy": energy.kinetic,
            "potential_energy": energy.potential,
            "solver_residual": residual,
            "solver_iterations": iterations,
        }
