"""A learned one-second prediction of the rover on each arc that `ScanPolicy` may drive next.

For each arc, at cruising speed and fast, a network predicts the rover's state after `HORIZON` seconds from

- what lies under wheels and underside on the way, from the height scan;
- the command;
- the rover in its own measure (`rover_gym.drive.forecast.rover_view`), without the goal.

These inputs have the same entries for every rover, so that one network serves all of them.
`rover_gym.learn.fit_forecast` trains it on copies of rovers in the simulator.
"""

from dataclasses import dataclass
from typing import Protocol

import numpy as np
import numpy.typing as npt

from rover_gym.core.validation import number, refuse
from rover_gym.drive.commands.command import N_COMMANDS
from rover_gym.drive.forecast.network_files import Network, PolicyError
from rover_gym.drive.forecast.rover_view import GOAL, N_FEATURES, PLACES, Planner, RoverView
from rover_gym.drive.search.arc_search import Arcs, ArcSearch
from rover_gym.envs.rover_env import RoverEnv

Array = npt.NDArray[np.float64]

Features = npt.NDArray[np.float32]

#: Time that the forecast looks ahead, s, and poses of an arc at which it looks at the ground.
HORIZON, POSES = 1.0, 8

#: Largest height in wheel radii that the network is given.
LARGEST_HEIGHT = 4.0

#: What the network's outputs are multiplied by: way, stuck, failed.
OUTPUTS = np.array([2.0, 1.0, 1.0], np.float32)


@dataclass(frozen=True)
class Outcomes:
    """What becomes of the rover on each arc; arrays `(2, n_arcs)`, at cruising speed and fast.

    Attributes:
        way: Way along the arc's chord, over the way at cruising speed.
        stuck: For how much of the time that ends an episode the trunk has been held at the end, 0 to 1.
        failed: How likely the episode has ended without its goal, 0 to 1.
    """

    way: Array
    stuck: Array
    failed: Array


class ArcPolicy(Planner, Protocol):
    """A policy that chooses among arcs: `ScanPolicy`, whose attributes these are."""

    arcs: Arcs
    commands: Array
    search: ArcSearch


#: What is given of each pose: the ground under the wheels at six places, and three measures of the underside.
OF_A_POSE = PLACES + 3


class ArcFeatures:
    """The network's inputs for each arc of a policy.

    Args:
        rover: The environment, read once for the layout.
        policy: The policy, a `ScanPolicy`.

    Attributes:
        size: Number of features.
        length: Way at cruising speed within the horizon, m.
        poses: `(n_arcs, POSES, 3)` on the way, see `Arcs.poses`.
    """

    size = (POSES + 1) * OF_A_POSE + N_COMMANDS + N_FEATURES - (GOAL.stop - GOAL.start)

    def __init__(self, rover: RoverEnv, policy: ArcPolicy) -> None:
        self.length = HORIZON * policy.cruise_speed
        self.poses = policy.arcs.poses(self.length, POSES)
        self._commands, self._search = policy.commands.astype(np.float32), policy.search
        self._looked_at = np.concatenate((np.zeros((1, 3)), self.poses.reshape(-1, 3)))
        self._view, self._n_wheels = RoverView(rover, policy), len(rover.model.wheel_radii)

    def __call__(self, row: Array, slope: list[float], heights: Array) -> Features:
        """`(n_arcs, size)` features, for an observation, the ground plane's slope, and heights over that plane."""
        n, n_wheels = len(self._commands), self._n_wheels
        under = np.clip(self._search.under(heights, self._looked_at), -LARGEST_HEIGHT, LARGEST_HEIGHT)
        seen = np.concatenate((self._view.at_places(under[:, :n_wheels]), under[:, n_wheels:]), axis=1)
        rover = self._view(row[None], np.array([slope]))[0]
        shared = np.concatenate((seen[0], rover[: GOAL.start], rover[GOAL.stop :]))
        along = seen[1:].reshape(n, -1)
        return np.concatenate(
            (along, self._commands, np.broadcast_to(shared, (n, len(shared)))), axis=1, dtype=np.float32
        )


class ArcForecast:
    """Predicts the outcome of each arc.

    Args:
        features: What the network is given, and after it whether the arc is driven fast.
        network: The network; its outputs are way, stuck and failed over `OUTPUTS`.

    Raises:
        PolicyError: The network is for other features or outputs.
    """

    def __init__(self, features: ArcFeatures, network: Network) -> None:
        inputs, outputs = network.weights[0].shape[1], network.weights[-1].shape[0]
        if inputs != features.size + 1:
            refuse(PolicyError, "forecast", inputs, f"must have {features.size + 1} inputs")
        if outputs != len(OUTPUTS):
            refuse(PolicyError, "forecast", outputs, f"must have {len(OUTPUTS)} outputs")
        self._features, self._network = features, network

    def __call__(self, row: Array, slope: list[float], heights: Array) -> Outcomes:
        """The outcomes, for an observation, the ground plane's slope, and heights over that plane."""
        seen = self._features(row, slope, heights)
        n = len(seen)
        both = np.concatenate((with_speed(seen, np.zeros(n)), with_speed(seen, np.ones(n))))
        way, stuck, failed = np.moveaxis((self._network(both) * OUTPUTS).reshape(2, n, -1), -1, 0).astype(np.float64)
        return Outcomes(way, stuck.clip(0.0, 1.0), failed.clip(0.0, 1.0))


def with_speed(features: Features, is_fast: npt.ArrayLike) -> Features:
    """`(n, size + 1)` features of arcs, each with whether it is driven fast, 0 or 1."""
    column = np.asarray(is_fast, dtype=np.float32)[:, None]
    return np.concatenate((features, column), axis=1)


#: The file of a forecast's network in its folder.
FORECAST_FILE = "forecast.npz"

#: Share of the way at cruising speed that a rover makes on open ground, where it first has to steer.
OPEN_WAY = 0.85

#: Way at cruising speed within the horizon for which the costs are meant, m; other rovers' costs are in proportion.
USUAL_WAY = 1.2


@dataclass(frozen=True)
class ForesightCosts:
    """What predicted outcomes cost, in metres of way at 1.2 m/s; less in proportion for a slower rover.

    Attributes:
        lost: Of a metre that is not made.
        stuck: Of a trunk that has been held for as long as ends an episode.
        failed: Of an episode that has ended.
        push: Of driving fast; less the longer the rover makes no progress, as the costs of risks.
        caution: Factor on the costs of belly, climb and lean that `PathCosts` gives.
    """

    lost: float = 2.0
    stuck: float = 10.0
    failed: float = 3.0
    push: float = 1.0
    caution: float = 0.5

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            number(f"foresight.{name}", value, at_least=0.0, at_most=1e3)

    def price(self, outcomes: Outcomes, boldness: float) -> tuple[Array, npt.NDArray[np.bool_]]:
        """`(n_arcs,)` costs of the arcs, in metres at 1.2 m/s, and whether each is cheaper if driven fast."""
        lost = USUAL_WAY * np.maximum(0.0, OPEN_WAY - outcomes.way)
        by_speed = self.lost * lost + self.stuck * outcomes.stuck + self.failed * outcomes.failed
        slow, fast = by_speed[0], by_speed[1] + boldness * self.push
        return np.minimum(slow, fast), fast < slow
