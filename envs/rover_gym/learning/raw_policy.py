"""A policy on the actions and observations of `RoverEnv` themselves, as stable-baselines3 trained it."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.vec_env import VecNormalize

from rover_gym.learning.raw_config import ALGORITHMS, read_raw_config
from rover_gym.learning.training_config import environment_arguments
from rover_gym.policy.observed import check_observed
from rover_gym.vector.sb3 import RoverVecEnv


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

    @classmethod
    def load(cls, folder: str | Path) -> "RawPolicy":
        """Loads the policy of a run of `training/train_raw.py`. The files are pickles: load only what you trust.

        Raises:
            OSError: The folder lacks a file.
        """
        folder = Path(folder)
        config = read_raw_config(folder / "config.yaml")
        task = json.loads((folder / "run.json").read_text(encoding="utf-8"))["task"]
        environment = environment_arguments(config.evaluated_environment_of(task))
        rovers = RoverVecEnv(1, threads=1, **environment)
        normalisation = VecNormalize.load(str(folder / "normalisation.pkl"), rovers)
        model = ALGORITHMS[config.algorithm].load(folder / "model.zip", device="cpu")
        return cls(model, normalisation, environment)

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
