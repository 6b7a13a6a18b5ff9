"""The rover at one moment, as sensors look at it."""

from functools import cached_property

import numpy as np
import numpy.typing as npt

from rover_gym.mechanics import GrainSimulation, RoverModel, Simulation, SphereField
from rover_gym.sensors.mount import Mount

Array = npt.NDArray[np.float64]


class Moment:
    """The state of a simulation, computed where a sensor asks.

    Args:
        simulation: The rover, which must not move while the moment is looked at.
        time: Of the episode, s.
        grains: Balls around it, which rays meet too.
    """

    def __init__(self, simulation: Simulation, time: float, grains: GrainSimulation | None = None) -> None:
        self.simulation, self.time, self._grains = simulation, time, grains

    @property
    def model(self) -> RoverModel:
        """The rover's model."""
        return self.simulation.model

    @cached_property
    def q(self) -> Array:
        """Coordinates, (nq,), as `Simulation.q`."""
        return self.simulation.q

    @cached_property
    def v(self) -> Array:
        """Velocities, (nv,), as `Simulation.v`."""
        return self.simulation.v

    @cached_property
    def poses(self) -> dict[str, tuple[Array, Array]]:
        """Origin (3,), m, and rotation matrix (3, 3) of every solid, world frame."""
        return self.simulation.poses()

    @cached_property
    def _balls(self) -> SphereField | None:
        if self._grains is None or not len(self._grains.radius):
            return None
        return SphereField(self._grains.position, self._grains.radius)

    def frame(self, mount: Mount) -> tuple[Array, Array]:
        """Place (3,), m, and rotation matrix (3, 3) of a sensor, world frame."""
        origin, rotation = self.poses[mount.solid_of(self.model)]
        return origin + rotation @ np.asarray(mount.position), rotation @ mount.rotation

    def distances(self, mount: Mount, directions: Array, max_range: float, *, sees_rover: bool) -> Array:
        """Distances (n,), m, at which rays from a sensor meet something first; infinite where they meet nothing.

        Args:
            mount: The sensor, whose solid is not seen.
            directions: In the sensor's frame, (n, 3).
            max_range: Distance to which the rays are followed, m.
            sees_rover: Whether they meet the rover's other solids.
        """
        place, rotation = self.frame(mount)
        along = directions @ rotation.T
        without = mount.solid_of(self.model)
        found, _ = self.simulation.cast_rays(place, along, max_range, parts=sees_rover, without=without)
        if self._balls is not None:
            found = np.minimum(found, self._balls.cast_rays(place, along, max_range)[0])
        return found
