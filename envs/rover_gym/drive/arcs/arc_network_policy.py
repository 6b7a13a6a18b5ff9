"""`ArcNetworkPolicy`: a trained network that drives any rover by the planner's arcs, with NumPy alone."""

from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from rover_gym.core.validation import refuse
from rover_gym.drive.arcs.arc_driver import ArcDriver
from rover_gym.drive.arcs.arc_network import ArcNetwork
from rover_gym.drive.commands.driven import Actions, ObservingPolicy, State, driven_rover
from rover_gym.drive.forecast.network_files import PolicyError, is_there
from rover_gym.drive.scan.scan_policy import ScanMemory, ScanPolicy
from rover_gym.envs.observation import Array, Mask

#: The file of a network in its folder.
ARCS_FILE = "arcs.npz"


class ArcNetworkPolicy(ObservingPolicy):
    """Drives a rover by a network of `rover train anywhere`, with the `predict` of `ObservingPolicy`.

    Args:
        env: A rover environment made with `ScanPolicy.arguments(model)`, wrapped or not, or a vector of them. It is
            read once.
        network: The network.
        planner: A planner for the rover, whose limits and memory it shares; a new `ScanPolicy` by default.
        seed: Of the arcs that are drawn with `deterministic=False`.

    Raises:
        OptionError: The environment has no height scan.
    """

    def __init__(self, env: Any, network: ArcNetwork, *, planner: ScanPolicy | None = None, seed: int = 0) -> None:
        rover = driven_rover(env, type(self).__name__)
        super().__init__(rover)
        self._driver = ArcDriver(rover, 1, planner)
        self._network = network
        self._random = np.random.default_rng(seed)

    @property
    def hold_periods(self) -> int:
        """Control periods that an arc is held."""
        return self._driver.hold

    @classmethod
    def load(cls, env: Any, folder: str | Path) -> "ArcNetworkPolicy":
        """Loads the network of a folder.

        Raises:
            PolicyError: The folder holds no valid network.
            OSError: A file may not be read.
        """
        path = Path(folder) / ARCS_FILE
        if not is_there(path):
            refuse(PolicyError, "policy", str(path), "is not there")
        return cls(env, ArcNetwork.read(path))

    def act(self, rows: Array, state: State, starts: Mask, deterministic: bool) -> tuple[Actions, State]:
        """Actions along the arcs, each held for 0.2 s, and the memory with the arcs."""
        seen = rows.astype(np.float32)
        kept, since = (None, np.zeros(len(rows), np.int64)) if state is None else (state[:-1], state[-1].copy())
        driver = self._driver
        driver.memory = memory = ScanMemory.of(kept, len(rows))
        memory.forget(starts)
        since[starts] = 0
        due = since % driver.hold == 0
        if due.any():
            driver.notice(seen, due)
            observed = {name: part[due] for name, part in driver.observe(seen).items()}
            logits: npt.NDArray[Any] = self._network(observed)
            if not deterministic:
                logits = logits + self._random.gumbel(size=logits.shape)
            arcs = np.zeros(len(rows), np.int64)
            arcs[due] = self._choice(logits, seen, np.flatnonzero(due))
            driver.choose(seen, arcs, due)
        actions = driver.controller.act(seen, memory.command)
        return actions, (*memory.state, since + 1)

    def _choice(
        self,
        logits: npt.NDArray[Any],
        rows: npt.NDArray[np.float32],  # noqa: ARG002 - for policies that plan
        which: npt.NDArray[np.intp],  # noqa: ARG002
    ) -> npt.NDArray[np.int64]:
        """The arcs `(m,)` of some rovers, from the network's outputs for them `(m, 64)`.

        Args:
            logits: The outputs.
            rows: Observations of all rovers.
            which: `(m,)` numbers of the rovers.
        """
        best: npt.NDArray[np.int64] = logits.argmax(axis=1)
        return best
