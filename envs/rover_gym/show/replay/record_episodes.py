"""A wrapper that records the episodes of any environment of this package."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import gymnasium as gym
from gymnasium.utils import RecordConstructorArgs

from rover_gym.core import OptionError
from rover_gym.core.validation import checked, known_keys, refuse
from rover_gym.envs.rover_env import RoverEnv
from rover_gym.envs.spec_json import as_json
from rover_gym.show.replay.overlays import SENSORS
from rover_gym.show.replay.tape import Tape, Watched


class RecordEpisodes(gym.Wrapper[Any, Any, Any, Any], RecordConstructorArgs):
    """Records each episode as a file that `rover replay`, `rover plot` and `rover export mcap` take.

    The files are `episode-0.h5`, `episode-1.h5`, ... Each control period is a row, also where a step of the environment
    holds a command for several. Needs the extra of recordings, h5py.

    Example:
        >>> env = RecordEpisodes(gym.make("RoverCommand-v0"), "runs/mine")

    Args:
        env: An environment of this package, wrapped or not.
        folder: The folder of the files, without the episodes of another run.
        sensors: "laser" and "depth": sensors that are recorded, too.

    Raises:
        OptionError: The environment is another one, a sensor is unknown, or the folder has recorded episodes.
    """

    @checked(folder=Path, sensors=[str])
    def __init__(self, env: gym.Env[Any, Any], folder: str | Path, *, sensors: tuple[str, ...] = ()) -> None:
        rover: object = getattr(env, "unwrapped", None)
        if not isinstance(rover, RoverEnv):
            refuse(OptionError, "env", env, "must be an environment of rover_gym")
        known_keys("sensors", sensors, SENSORS)
        self._folder = Path(folder)
        if any(self._folder.glob("episode-*.h5")):
            refuse(OptionError, "folder", str(folder), "has the episodes of a run: name another folder")
        RecordConstructorArgs.__init__(self, folder=str(folder), sensors=sensors)
        super().__init__(env)
        self._rover: RoverEnv = rover
        self._sensors, self._count = tuple(sensors), 0
        self._tape: Tape | None = None
        self._begins = False
        rover.on_period = self._record

    @property
    def path(self) -> Path:
        """The file of the present episode, or of the next before the first reset."""
        return self._folder / f"episode-{max(0, self._count - 1)}.h5"

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        """Ends the recording of the running episode, and begins that of the next."""
        self._begins = True
        try:
            return self.env.reset(seed=seed, options=options)
        finally:
            self._begins = False

    def step(self, action: Any) -> tuple[Any, Any, bool, bool, dict[str, Any]]:
        """Steps the environment; an episode that is over is written with its outcome."""
        observation, reward, terminated, truncated, info = self.env.step(action)
        if terminated or truncated:
            self._end(info["termination"] or "time")
        return observation, reward, terminated, truncated, info

    def close(self) -> None:
        """Ends the recording and closes the environment."""
        self._end(None)
        self._rover.on_period = None
        super().close()

    def _record(self, rover: RoverEnv, info: Any) -> None:
        if self._begins:
            self._end(None)
            self._folder.mkdir(parents=True, exist_ok=True)
            self._count += 1
            spec = self.env.spec
            title = "an environment" if spec is None else spec.id
            arguments = {} if spec is None else _writable(spec.kwargs)
            driver, seed = Watched(None), rover.np_random_seed
            self._tape = Tape(self.path, rover, title, seed, arguments, driver, self._sensors)
            self._begins = False
        if self._tape is not None:
            self._tape.append(rover, info)

    def _end(self, outcome: str | None) -> None:
        if self._tape is not None:
            tape, self._tape = self._tape, None
            if outcome is not None:
                tape.recorder.note(outcome=outcome)
            tape.recorder.close()


def _writable(arguments: dict[str, Any]) -> dict[str, Any]:
    """The arguments that can be written."""
    found: dict[str, Any] = {}
    for name, value in arguments.items():
        try:
            found[name] = as_json(name, value)
        except OptionError:
            continue
    return found
