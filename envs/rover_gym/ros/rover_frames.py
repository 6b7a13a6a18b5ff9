"""The frames of a rover in ROS: axes of REP 103, names of REP 105.

`map` is the world with z up. `base_link` is the trunk. A solid's frame has its name and its parent as in the URDF file
of the model, whose links are the same frames. A sensor NAME has `NAME_link` with x forward and z up, and a camera also
`NAME_optical_frame` with z forward and y down.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from rover_gym.envs.sensors import Camera, Mount, Sensor
from rover_gym.exports.axes import MAP_FROM_WORLD

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rover_gym.core import RoverModel, Simulation

Array = npt.NDArray[np.float64]

MAP, ODOM, BASE = "map", "odom", "base_link"
#: From an optical frame (x right, y down, z forward) to one with x forward, y left, z up.
LINK_FROM_OPTICAL = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])

#: Parent and child, origin (3,), m, and rotation (3, 3) of the child in the parent.
Pose = tuple[tuple[str, str], Array, Array]


def ros_vector(values: Array) -> Array:
    """A vector of the world or of a solid, (..., 3), in the axes of REP 103."""
    turned: Array = values @ MAP_FROM_WORLD.T
    return turned


def ros_rotation(matrix: Array) -> Array:
    """A rotation between frames with y up, (..., 3, 3), between the same frames with z up."""
    turned: Array = MAP_FROM_WORLD @ matrix @ MAP_FROM_WORLD.T
    return turned


def base_pose(simulation: Simulation) -> tuple[Array, Array]:
    """Place (3,), m, and rotation (3, 3) of `base_link` in the map."""
    return ros_vector(simulation.q[:3]), ros_rotation(simulation.rotation)


def link_name(sensor: Sensor) -> str:
    """The frame of a sensor."""
    return f"{sensor.name}_link"


def optical_name(sensor: Sensor) -> str:
    """The optical frame of a camera."""
    return f"{sensor.name}_optical_frame"


class RoverFrames:
    """The frames of a rover's solids and sensors.

    Args:
        model: The rover.
        sensors: Its sensors.
    """

    def __init__(self, model: RoverModel, sensors: Sequence[Sensor]) -> None:
        self._names = model.solid_names
        parents = {solid["name"]: solid.get("parent") for solid in model.to_dict()["solids"]}
        self._children = [i for i, name in enumerate(self._names) if parents[name] is not None]
        self._parents = [self._names.index(parents[self._names[i]]) for i in self._children]
        self.pairs = [(self._names[p], self._names[c]) for p, c in zip(self._parents, self._children, strict=True)]
        self.fixed: list[Pose] = [((BASE, name), np.zeros(3), np.eye(3)) for name in self._names if not parents[name]]
        for sensor in sensors:
            mount = getattr(sensor, "mount", None)
            if isinstance(mount, Mount):
                place, turn = mount.pose_on(model)
                pair = (mount.solid_of(model), link_name(sensor))
                self.fixed.append((pair, ros_vector(place), ros_rotation(turn)))
            if isinstance(sensor, Camera):
                pair = (link_name(sensor), optical_name(sensor))
                self.fixed.append((pair, np.zeros(3), LINK_FROM_OPTICAL))

    def moving(self, simulation: Simulation) -> tuple[Array, Array]:
        """Places (n, 3), m, and rotations (n, 3, 3) of `pairs`, child in parent."""
        poses = simulation.poses()
        places = np.array([poses[name][0] for name in self._names])
        turns = np.array([poses[name][1] for name in self._names])
        back = turns[self._parents].transpose(0, 2, 1)
        apart = places[self._children] - places[self._parents]
        return ros_vector((back @ apart[:, :, None])[:, :, 0]), ros_rotation(back @ turns[self._children])
