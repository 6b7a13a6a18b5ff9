"""Measures how much of a training's time its environments take."""

import time

from stable_baselines3.common.vec_env import VecEnvWrapper
from stable_baselines3.common.vec_env.base_vec_env import VecEnvObs, VecEnvStepReturn


class Stopwatch(VecEnvWrapper):
    """Sums the CPU time of all threads while the wrapped environments step and reset.

    Attributes:
        cpu_seconds: CPU time so far, s.
    """

    cpu_seconds = 0.0

    def reset(self) -> VecEnvObs:
        """Resets all environments."""
        start = time.process_time()
        seen = self.venv.reset()
        self.cpu_seconds += time.process_time() - start
        return seen

    def step_wait(self) -> VecEnvStepReturn:
        """Steps all environments."""
        start = time.process_time()
        result = self.venv.step_wait()
        self.cpu_seconds += time.process_time() - start
        return result
