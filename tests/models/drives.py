"""A drive of about ten metres for every rover of the gallery, on level ground: straight ahead and through a turn.

Torques are given, speeds are not, so that errors of masses, contacts or steering show in the path. Rovers that steer
point their wheels about a common centre; the skid-steered one drives its sides against each other and slides.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from rover_gym import Plane, RoverModel

FRICTION = 0.7
#: Between two samples of the path, s.
SAMPLE = 0.1
#: Time in which set-points move from one part's to the next one's, s.
RAMP = 1.0


@dataclass(frozen=True)
class Part:
    """A part of a drive.

    Attributes:
        time: Duration, s.
        left: Torque of each wheel on the left, N m.
        right: Torque of each wheel on the right, N m.
        radius: Distance of the turning centre to the left of the middle, m; infinite straight ahead.
    """

    time: float
    left: float
    right: float
    radius: float = np.inf


DRIVES = {
    "rover": (Part(5.0, 5.0, 5.0), Part(5.0, 1.0, 1.0, 4.0)),
    "mars-rover": (Part(6.0, 7.0, 7.0), Part(6.0, 2.0, 2.0, 5.0)),
    "open-rover": (Part(15.0, 0.5, 0.5), Part(30.0, 0.5, 0.5, 1.5)),
    "skid-steered": (Part(5.0, 6.0, 6.0), Part(1.5, -10.0, 15.0), Part(5.0, 6.0, 6.0)),
    "four-steered": (Part(5.0, 0.4, 0.4), Part(6.0, 0.0, 0.0, 3.0)),
}


def start(model: RoverModel) -> np.ndarray:
    """Coordinates at rest on the plane, heading along x."""
    return np.array(model.resting_pose(Plane(), (0.0, 0.0), 0.0))


def commands(model: RoverModel, parts: tuple[Part, ...]) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """For every sample in turn the torques (n_wheels,), N m, and the set-points (n_wheels,), rad, that hold until it."""
    poses, wheels = model.poses(np.zeros(model.nv)), model.to_dict()["wheels"]
    places = np.array([poses[wheel["solid"]][0] for wheel in wheels])
    is_steered = np.array([bool(wheel.get("steering")) for wheel in wheels])
    axle = 0.0 if is_steered.all() else places[~is_steered, 0].mean()
    before = np.zeros(len(wheels))
    for part in parts:
        torques = np.where(places[:, 2] < 0.0, part.left, part.right)
        after = np.where(is_steered, np.arctan2(places[:, 0] - axle, part.radius + places[:, 2]), 0.0)
        for k in range(1, round(part.time / SAMPLE) + 1):
            share = min(1.0, k * SAMPLE / RAMP)
            yield torques, (1.0 - share) * before + share * after
        before = after
