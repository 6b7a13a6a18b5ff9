"""`RoverVectorEnv`: the Gymnasium vector environment that `gymnasium.make_vec` creates."""

from collections.abc import Sequence
from typing import Any, ClassVar, Unpack

import numpy as np
import numpy.typing as npt
from gymnasium.envs.registration import EnvSpec
from gymnasium.error import ResetNeeded
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space

from rover_gym.core import OptionError
from rover_gym.core.validation import Range, mapping, refuse, whole
from rover_gym.envs.arguments import RoverArguments, takes_arguments
from rover_gym.envs.batch import BatchSnapshot
from rover_gym.envs.episode_scene import ResetOptions
from rover_gym.envs.generators import spread_seeds
from rover_gym.envs.observation import Array, Mask, Observations
from rover_gym.envs.rover_env import RoverEnv
from rover_gym.envs.spec_json import RoverSpec, rover_spec
from rover_gym.envs.task import check_actions
from rover_gym.envs.time_limits import MAX_EPISODE_STEPS

_Info = dict[str, Any]


class RoverVectorEnv(VectorEnv[Observations, npt.NDArray[np.float32], Any]):
    """A vector of rovers that the compiled core steps on several threads.

    Observations, rewards and infos equal, bit for bit, those of a `SyncVectorEnv` of `RoverEnv`s with a `TimeLimit` and
    the same arguments and seeds; this class is faster.

    Args:
        num_envs: Number of rovers.
        threads: Threads that step the rovers; None for one per core.
        max_episode_steps: Steps until truncation; None for `own_limit`, -1 for no limit, as in `gymnasium.make`.
        autoreset_mode: `"NextStep"`, `"SameStep"` or `"Disabled"`, as Gymnasium defines them.
        **arguments: Arguments of `RoverEnv`.

    Attributes:
        batch: The rovers.
        envs: Each rover as an environment.
    """

    #: The class of one rover.
    env_class: ClassVar[type[RoverEnv]] = RoverEnv

    #: Steps until truncation unless others are given.
    own_limit: ClassVar[int] = MAX_EPISODE_STEPS

    _spec: RoverSpec | None = None

    @takes_arguments
    def __init__(
        self,
        num_envs: int = 1,
        *,
        threads: int | None = None,
        max_episode_steps: int | None = None,
        autoreset_mode: str | AutoresetMode = AutoresetMode.NEXT_STEP,
        **arguments: Unpack[RoverArguments],
    ) -> None:
        super().__init__()
        self.autoreset_mode = _check_mode(autoreset_mode)
        limit = episode_limit(max_episode_steps, self.own_limit)
        self.batch = self.env_class.make_batch(num_envs, threads=threads, max_episode_steps=limit, **arguments)
        self.num_envs = self.batch.n
        self.envs = tuple(self.env_class.row(self.batch, i) for i in range(self.num_envs))
        self.metadata = {**self.prototype.metadata, "autoreset_mode": self.autoreset_mode}
        self.render_mode = self.prototype.render_mode
        self.single_observation_space = self.prototype.observation_space
        self.single_action_space = self.prototype.action_space
        self.observation_space = batch_space(self.single_observation_space, self.num_envs)
        self.action_space = batch_space(self.single_action_space, self.num_envs)

    @property
    def spec(self) -> RoverSpec | None:
        """The specification that `gymnasium.make_vec` has made the vector from; its `to_json` writes objects, too."""
        return self._spec

    @spec.setter
    def spec(self, value: EnvSpec | None) -> None:
        self._spec = rover_spec(value)

    @property
    def prototype(self) -> RoverEnv:
        """The first rover, which gives layout, model and limits."""
        return self.envs[0]

    @property  # type: ignore[override] # as SyncVectorEnv's
    def np_random(self) -> tuple[np.random.Generator, ...]:
        """The rovers' random generators."""
        return self.get_attr("np_random")

    @np_random.setter
    def np_random(self, value: object) -> None:  # noqa: ARG002 - a setter must take it
        raise AttributeError("the rovers have random generators of their own: reset(seed=...) makes them anew")

    @property
    def np_random_seed(self) -> tuple[int, ...]:  # type: ignore[override]
        """The seeds of the rovers' random generators."""
        return self.get_attr("np_random_seed")

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: _Info | None = None
    ) -> tuple[Observations, _Info]:
        """Starts episodes.

        Args:
            seed: Seed of the first rover, which increases by one per rover; or one seed per rover.
            options: Options of `RoverEnv.reset`, for every rover; `rovers`, a list of further options for each rover, a
                mapping or None, which go before those for all; and `reset_mask`, `(num_envs,)` bool: the rovers to
                reset, by default all; the others continue.

        A refused reset changes nothing for any rover.

        Raises:
            OptionError: A seed is no whole number from 0, or an option is unknown or out of range.
            StateError: As `RoverEnv.reset`.
            TerrainError: As `RoverEnv.reset`.
        """
        seeds = spread_seeds(seed, self.num_envs)
        given = dict(mapping("options", options))
        chosen = self._check_mask(given.pop("reset_mask")) if "reset_mask" in given else list(range(self.num_envs))
        fixed = self._check_options(given, chosen)
        self.batch.begin(self.batch.draw(chosen, [seeds[i] for i in chosen], fixed))
        if len(chosen) == self.num_envs:
            return self.batch.observation, self.batch.infos()
        infos: _Info = {}
        for i in chosen:
            infos = self._add_info(infos, self.batch.info(i), i)
        return self.batch.observation, infos

    def step(self, actions: npt.NDArray[np.float32]) -> tuple[Observations, Array, Mask, Mask, _Info]:
        """Applies actions `(num_envs, n_actions)` for one control period.

        An episode that cannot begin is refused before any rover moves. With autoreset in the same step, the following
        step refuses it.

        Raises:
            CommandError: The actions have a wrong shape or an entry that is not finite; nothing has changed. Finite
                entries outside [-1, 1] are clipped.
            TerrainError: A rover's next episode cannot begin (see `RoverEnv.reset`); nothing has changed. Reset with
                another seed or other options.
            ResetNeeded: A rover has not been reset, or autoreset is disabled and its episode has ended.
        """
        mode = self.autoreset_mode
        if mode == AutoresetMode.DISABLED:
            if over := self.batch.over:
                check_actions(actions, (self.num_envs, self.batch.task.n_actions))
                raise ResetNeeded(f"rovers {over}: call reset() with reset_mask first")
            return self.batch.step(actions, info="all")
        same_step = mode == AutoresetMode.SAME_STEP
        stepped, finals = self.batch.step_on(actions, same_step=same_step, info="all")
        observation, reward, terminated, truncated, infos = stepped
        for i, (last, info) in finals.items():
            infos = self._add_info(infos, {"final_obs": last, "final_info": info}, i)
        return observation, reward, terminated, truncated, infos

    def set_difficulties(self, difficulties: Sequence[float | Range | None]) -> None:
        """Sets each rover's difficulty of the rocks, or the range it is drawn from, from its next reset on.

        Args:
            difficulties: One a rover; None for the argument `difficulty`.

        Raises:
            OptionError: There are not as many as rovers, one is not within 0 to 2, or there are no rocks; nothing has
                changed.
        """
        self.batch.set_difficulties(difficulties)

    def snapshot(self) -> BatchSnapshot:
        """Returns the state of all rovers, of their episodes and random generators, for `restore`; picklable.

        Raises:
            ResetNeeded: A rover has not been reset.
        """
        return self.batch.snapshot()

    def restore(self, snapshot: BatchSnapshot) -> None:
        """Restores a snapshot of a vector of as many rovers with the same arguments, which continues bit for bit.

        Episodes that had ended in the snapshot are followed by the next ones as `autoreset_mode` says.

        Raises:
            StateError: The value is no snapshot, is damaged, or comes from other arguments; nothing has changed.
        """
        self.batch.restore(snapshot)

    def render(self) -> tuple[npt.NDArray[np.uint8], ...] | None:
        """One frame per rover with `render_mode="rgb_array"`; None without a render mode."""
        if self.render_mode is None:
            return None
        return tuple(frame for rover in self.envs if (frame := rover.render()) is not None)

    def close_extras(self, **kwargs: Any) -> None:  # noqa: ARG002 - Gymnasium's signature
        """Frees the renderers, if there are any."""
        for rover in self.envs:
            rover.close()

    def call(self, name: str, *args: Any, **kwargs: Any) -> tuple[Any, ...]:
        """Calls a method of every rover, such as `set_difficulty`, or reads an attribute."""
        found = [getattr(rover, name) for rover in self.envs]
        return tuple(each(*args, **kwargs) if callable(each) else each for each in found)

    def get_attr(self, name: str) -> tuple[Any, ...]:
        """Reads an attribute of every rover, by its name in `RoverEnv`."""
        return tuple(getattr(rover, name) for rover in self.envs)

    def _check_options(self, given: _Info, chosen: Sequence[int]) -> ResetOptions | list[ResetOptions]:
        """The options of all chosen rovers, or of each."""
        if "rovers" not in given:
            return self.batch.check_options(given)
        own = given.pop("rovers")
        if not isinstance(own, (list, tuple)) or len(own) != self.num_envs:
            refuse(OptionError, "options.rovers", own, f"must be a list of {self.num_envs} mappings, one a rover")
        fixed = []
        for i, one in enumerate(own):
            field = f"options.rovers[{i}]"
            checked = self.batch.check_options({**given, **mapping(field, one)}, field)
            if i in chosen:
                fixed.append(checked)
        return fixed

    def _check_mask(self, mask: object) -> list[int]:
        if not isinstance(mask, np.ndarray) or mask.dtype != np.bool_ or mask.shape != (self.num_envs,):
            refuse(OptionError, "options.reset_mask", mask, f"must be an array of {self.num_envs} bool")
        return [int(i) for i in np.flatnonzero(mask)]


def episode_limit(given: object, own: int) -> int | None:
    """Steps until truncation, or None for no limit, from an argument with the meaning it has in `gymnasium.make`.

    Args:
        given: None for the environment's own limit, -1 for no limit, or a number of steps.
        own: The environment's own limit.

    Raises:
        OptionError: `given` is none of these.
    """
    if given is None:
        return own
    if (
        isinstance(given, (bool, np.timedelta64))
        or not isinstance(given, (int, np.integer))
        or given < -1
        or given == 0
    ):
        refuse(OptionError, "max_episode_steps", given, "must be a whole number from 1, -1 for no limit, or None")
    return None if given == -1 else whole("max_episode_steps", given, at_least=1)


def _check_mode(mode: object) -> AutoresetMode:
    if isinstance(mode, AutoresetMode):
        return mode
    modes = {known.value: known for known in AutoresetMode}
    if not (isinstance(mode, str) and mode in modes):
        refuse(OptionError, "autoreset_mode", mode, f"must be one of {', '.join(modes)}")
    return modes[mode]
