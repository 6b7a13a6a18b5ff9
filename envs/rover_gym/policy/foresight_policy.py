"""`ScanPolicy` that foresees, by a learned forecast, what becomes of the rover on each arc."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from rover_gym.mechanics import OptionError
from rover_gym.policy.arc_forecast import ArcFeatures, ArcForecast, Outcomes
from rover_gym.policy.arc_search import PathCosts
from rover_gym.policy.ground_map import MapOptions
from rover_gym.policy.network import Network
from rover_gym.policy.pd_policy import find_rover_env
from rover_gym.policy.policy_files import PolicyError, is_there
from rover_gym.policy.scan_policy import ScanGains, ScanPolicy
from rover_gym.policy.shipped import forecast_folder
from rover_gym.validation import number, refuse

Array = npt.NDArray[np.float64]

#: The file of a forecast's network in its folder.
FORECAST_FILE = "forecast.npz"

#: Share of the way at cruising speed that a rover makes on open ground, where it first has to steer.
OPEN_WAY = 0.85

#: Way at cruising speed within the horizon for which the costs are meant, m; other rovers' costs are in proportion.
USUAL_WAY = 1.2


@dataclass(frozen=True)
class ForesightCosts:
    """What foreseen outcomes cost, in metres of way at 1.2 m/s; less in proportion for a slower rover.

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


class ForesightPolicy(ScanPolicy):
    """Drives as `ScanPolicy`, and foresees what becomes of the rover on each arc that it may drive next.

    A network that was trained in the simulator foretells for each arc, slow and fast, how far the rover comes within a
    second and whether its trunk gets caught (`rover_gym.policy.arc_forecast`). The policy adds what that costs, and
    drives an arc fast where it is cheaper so.

    Example:
        >>> env = gym.make("RoverRocks-v0", difficulty=2.0, **ForesightPolicy.arguments())
        >>> policy = ForesightPolicy(env)

    Args:
        env: A rover environment with a height scan, wrapped or not, or a vector of them. It is read once, for layout
            and rover constants.
        forecast: Folder of a trained forecast; None for the package's: one for the built-in rover on hills, one for it
            on other ground, one for `open-rover`.
        gains: Speed and times.
        costs: What a path costs.
        foresight: What foreseen outcomes cost.
        map: A map of what the scans have shown; see `ScanPolicy`.

    Raises:
        OptionError: The environment has no height scan, or the rover's wheels stand in a line.
        PolicyError: The folder holds no forecast, or one for another rover.
    """

    def __init__(
        self,
        env: Any,
        forecast: str | Path | None = None,
        *,
        gains: ScanGains | None = None,
        costs: PathCosts | None = None,
        foresight: ForesightCosts | None = None,
        map: MapOptions | None = None,  # noqa: A002 - what it is
    ) -> None:
        if foresight is not None and not isinstance(foresight, ForesightCosts):
            refuse(OptionError, "foresight", foresight, "must be ForesightCosts")
        super().__init__(env, gains, costs, map=map)
        self.foresight = ForesightCosts() if foresight is None else foresight
        rover = find_rover_env(env)
        folder = forecast_folder(rover.model, hills=rover.task.on_hills) if forecast is None else Path(forecast)
        path = folder / FORECAST_FILE
        if not is_there(path):
            refuse(PolicyError, "forecast", str(path), "is not there")
        features = ArcFeatures(rover, self)
        self._length, self._forecast = features.length, ArcForecast(features, Network.read(path))
        self._caution = self.foresight.caution

    def foresee(self, row: Array) -> Outcomes:
        """What becomes of the rover on each arc, for an observation `(size,)`, scaled as the environment returns it."""
        return self._forecast(row, *self.ground(row))

    def _outlook(
        self, row: Array, slope: list[float], heights: Array, boldness: float
    ) -> tuple[Array | None, npt.NDArray[np.bool_]]:
        costs, outcomes = self.foresight, self._forecast(row, slope, heights)
        lost = USUAL_WAY * np.maximum(0.0, OPEN_WAY - outcomes.way)
        by_speed = costs.lost * lost + costs.stuck * outcomes.stuck + costs.failed * outcomes.failed
        slow, fast = by_speed[0], by_speed[1] + boldness * costs.push
        return self._length / USUAL_WAY * np.minimum(slow, fast), fast < slow
