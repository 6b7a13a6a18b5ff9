"""Where a rover may touch a bed: its wheels, and boxes and balls that hang low, as seen from above."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from rover_gym.models.file_axes import rotation_matrix

if TYPE_CHECKING:
    from rover_gym.mechanics import RoverModel, Simulation

Array = npt.NDArray[np.float64]

MAP = (0, 2)  # the axes x and z


@dataclass(frozen=True)
class Footprint:
    """Parts of a rover on the map, each as all points within a distance of a line.

    Attributes:
        names: Of the parts, with wheels first.
        ends: (n_parts, 2, 2) x and z of both ends of each line, m.
        margin: (n_parts,) distance from the line, m.
    """

    names: tuple[str, ...]
    ends: Array
    margin: Array

    def bounds(self) -> tuple[float, float]:
        """Least and largest x of the parts, m."""
        x = self.ends[:, :, 0]
        return float((x.min(axis=1) - self.margin).min()), float((x.max(axis=1) + self.margin).max())

    def distance(self, places: Array) -> Array:
        """Distance of places from the nearest part, negative within one.

        Args:
            places: (n, 2) x and z, m.

        Returns:
            (n,) m.
        """
        nearest = np.full(len(places), np.inf)
        for (a, b), margin in zip(self.ends, self.margin, strict=True):
            along = b - a
            share = np.clip((places - a) @ along / max(float(along @ along), 1e-300), 0.0, 1.0)
            away = places - a - share[:, None] * along
            np.minimum(nearest, np.hypot(away[:, 0], away[:, 1]) - margin, out=nearest)
        return nearest

    def has_moved(self, before: Footprint, distance: float) -> bool:
        """Whether a part is there that was not, or an end of one has moved farther than a distance, m."""
        known = {name: i for i, name in enumerate(before.names)}
        if not known.keys() >= set(self.names):
            return True
        moved = self.ends - before.ends[[known[name] for name in self.names]]
        return bool(np.hypot(moved[..., 0], moved[..., 1]).max() > distance)


class Parts:
    """Wheels, boxes and balls of a model, to see where they are.

    Args:
        model: The rover.
    """

    def __init__(self, model: RoverModel) -> None:
        described: dict[str, Any] = model.to_dict()
        self._wheels = [
            (wheel["solid"], np.asarray(wheel["axle"], dtype=np.float64), wheel["radius"], 0.5 * wheel["width"])
            for wheel in described["wheels"]
        ]
        on_wheels = {name for name, *_ in self._wheels}
        self._shapes: list[tuple[str, str, Array, Array, Array]] = []
        for solid in described["solids"]:
            shapes = list(solid.get("shapes") or ())
            if solid.get("shape"):
                place = solid.get("centre_of_mass") or (0.0, 0.0, 0.0)
                shapes.append(solid["shape"] | {"collides": solid.get("collides", False), "position": place})
            for k, shape in enumerate(shapes):
                if shape.get("collides") and solid["name"] not in on_wheels:
                    position = np.array(shape.get("position") or (0.0, 0.0, 0.0), dtype=np.float64)
                    turn = rotation_matrix(np.array(shape.get("rotation") or (0.0, 0.0, 0.0), dtype=np.float64))
                    size = shape["size"] if shape["kind"] == "box" else [2.0 * shape["radius"]] * 3
                    half = 0.5 * np.array(size, dtype=np.float64)
                    self._shapes.append((f"{solid['name']}/{k}", solid["name"], position, turn, half))

    def footprint(self, rover: Simulation, below: float) -> Footprint:
        """The wheels, and what else hangs lower than a height, m."""
        poses = rover.poses()
        names, ends, margins = [], [], []
        for name, own_axle, radius, half_width in self._wheels:
            centre, rotation = poses[name]
            axle = rotation @ own_axle
            heading = np.array([-axle[2], axle[0]])
            length = float(np.hypot(*heading))
            heading = heading / length if length > 0.0 else np.array([1.0, 0.0])
            middle = centre[list(MAP)]
            names.append(name)
            ends.append((middle - radius * heading, middle + radius * heading))
            margins.append(half_width * length + radius * abs(axle[1]))
        for name, solid, position, turn, half in self._shapes:
            origin, rotation = poses[solid]
            centre, rotation = origin + rotation @ position, rotation @ turn
            if centre[1] - np.abs(rotation[1]) @ half >= below:
                continue
            longest = int(half.argmax())
            line = rotation[list(MAP), longest] * half[longest]
            middle = centre[list(MAP)]
            names.append(name)
            ends.append((middle - line, middle + line))
            margins.append(float(np.linalg.norm(np.delete(half, longest))))
        return Footprint(tuple(names), np.array(ends), np.array(margins))
