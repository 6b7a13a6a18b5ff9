"""`GuidedPolicy`: the planner with a forecast, guided by the network that drives any rover."""

from typing import Any

import numpy as np
import numpy.typing as npt

from rover_gym.core.validation import number
from rover_gym.drive.arcs.arc_driver import ARCS, arc_of
from rover_gym.drive.arcs.arc_network import ArcNetwork
from rover_gym.drive.arcs.arc_network_policy import ARCS_FILE, ArcNetworkPolicy
from rover_gym.drive.commands.driven import find_rover_env
from rover_gym.drive.commands.features import ground_slope
from rover_gym.drive.forecast.network_files import ANYWHERE, FOLDER
from rover_gym.drive.scan.scan_policy import ScanPolicy

#: Cost of an arc, over the rover's reach, by which the network finds it e times less probable.
WEIGHT = 0.1


class GuidedPolicy(ArcNetworkPolicy):
    """`ScanPolicy` with a forecast, for which an arc costs more the less probable a network finds it.

    The cost is `weight` times the rover's reach times minus the logarithm of the arc's probability, that of the more
    probable of its two speeds. Whether to push is the network's choice.

    Args:
        env: A rover environment made with `ScanPolicy.arguments(model)`, wrapped or not, or a vector of them. It is
            read once.
        network: The network; the package's by default.
        weight: Cost of an arc, over the rover's reach, by which the network finds it e times less probable.
        seed: Of the noise on the logarithms with `deterministic=False`.

    Raises:
        OptionError: The environment has no height scan, or the weight is negative.
    """

    def __init__(self, env: Any, network: ArcNetwork | None = None, *, weight: float = WEIGHT, seed: int = 0) -> None:
        self.weight = number("weight", weight, at_least=0.0)
        planner = ScanPolicy(env, forecast=True)
        network = ArcNetwork.read(FOLDER / ANYWHERE / ARCS_FILE) if network is None else network
        super().__init__(env, network, planner=planner, seed=seed)
        self._layout = find_rover_env(env).observation_layout
        self._table = np.array([arc_of(command, pushes=False) for command in planner.commands])

    def _choice(
        self, logits: npt.NDArray[Any], rows: npt.NDArray[np.float32], which: npt.NDArray[np.intp]
    ) -> npt.NDArray[np.int64]:
        n, driver = len(ARCS), self._driver
        planner = driver.planner
        slow, fast = logits[:, :n].astype(np.float64), logits[:, n:].astype(np.float64)
        prices = -self.weight * planner.reach * np.maximum(slow, fast)[:, self._table]
        arcs = np.zeros(len(which), np.int64)
        for k, (i, slope) in enumerate(zip(which.tolist(), ground_slope(self._layout, rows[which]), strict=True)):
            arc, _ = planner.choose(rows[i].astype(np.float64), slope.tolist(), driver.memory, i, prices[k])
            chosen = self._table[arc]
            arcs[k] = chosen + n * bool(fast[k, chosen] > slow[k, chosen])
        return arcs
