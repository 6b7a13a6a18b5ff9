"""A policy on the actions and observations of `RoverEnv` themselves, as stable-baselines3 trained it."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import yaml
from stable_baselines3 import PPO, SAC
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.vec_env import VecNormalize

from rover_gym.core import OptionError
from rover_gym.core.validation import refuse
from rover_gym.drive.commands.driven import check_observed
from rover_gym.envs.vector.sb3 import RoverVecEnv
from rover_gym.learn.configuration import environment_arguments
from rover_gym.learn.provenance import provenance

#: The algorithms of stable-baselines3, by name.
ALGORITHMS: Mapping[str, type[BaseAlgorithm]] = {"PPO": PPO, "SAC": SAC}


class RawPolicy:
    """A trained model and the normalisation of its observations, without exploration.

    Args:
        model: The model.
        normalisation: The statistics that it was trained with.
        environment: Arguments of the `RoverEnv` that it drives.
    """

    def __init__(
        self, model: BaseAlgorithm, normalisation: VecNormalize, environment: dict[str, Any] | None = None
    ) -> None:
        self.environment = {} if environment is None else environment
        self._model = model
        self._normalisation = normalisation

    @property
    def model(self) -> BaseAlgorithm:
        """The model."""
        return self._model

    @property
    def normalisation(self) -> VecNormalize:
        """The statistics that it was trained with."""
        return self._normalisation

    def save(self, folder: str | Path) -> None:
        """Writes the model, its statistics and the environment's arguments, for `load`.

        Raises:
            OSError: The folder cannot be written.
        """
        folder = Path(folder)
        folder.mkdir(parents=True, exist_ok=True)
        self.model.save(folder / "model.zip")
        self.normalisation.save(str(folder / "normalisation.pkl"))
        described = {"algorithm": type(self.model).__name__, "environment": self.environment, **provenance()}
        (folder / "run.json").write_text(json.dumps(described, indent=2) + "\n", encoding="utf-8")

    @classmethod
    def load(cls, folder: str | Path) -> "RawPolicy":
        """Loads a policy that `save` wrote. The files are pickles: load only what you trust.

        Raises:
            OptionError: The run is of an unknown algorithm.
            OSError: The folder lacks a file.
        """
        folder = Path(folder)
        described = json.loads((folder / "run.json").read_text(encoding="utf-8"))
        algorithm = str(described["algorithm"]).split()[-1]
        if algorithm not in ALGORITHMS:
            refuse(OptionError, "algorithm", algorithm, f"must be one of {', '.join(ALGORITHMS)}")
        environment = environment_arguments(
            described["environment"] if "environment" in described else _earlier_environment(folder, described["task"])
        )
        rovers = RoverVecEnv(1, threads=1, **environment)
        normalisation = VecNormalize.load(str(folder / "normalisation.pkl"), rovers)
        return cls(ALGORITHMS[algorithm].load(folder / "model.zip", device="cpu"), normalisation, environment)

    def predict(
        self,
        observation: npt.NDArray[np.float32],
        state: Any = None,
        episode_start: Any = None,  # noqa: ARG002 - as stable-baselines3's
    ) -> tuple[npt.NDArray[np.float32], Any]:
        """The action `(n_actions,)` for an observation `(size,)`, or `(n, n_actions)` for `(n, size)`.

        Raises:
            StateError: The observation has a wrong shape or an entry that is not finite.
        """
        check_observed(observation, int(self._model.observation_space.shape[0]))  # type: ignore[index]
        seen = self._normalisation.normalize_obs(observation)
        actions, _ = self._model.predict(seen, deterministic=True)
        return actions.astype(np.float32), state


def _earlier_environment(folder: Path, task: str) -> dict[str, Any]:
    """The arguments of a run whose configuration is a file beside it, without its coarser physics."""
    config = yaml.safe_load((folder / "config.yaml").read_text(encoding="utf-8"))
    given = {**config["environment"], **config["tasks"][task].get("environment", {})}
    return {name: value for name, value in given.items() if name not in ("time_step", "solver_options")}
