"""The user's reward terms in a batch of rovers, and where its rewards and infos tell them."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from rover_gym.env.quantities import Array, Mask, Observations
from rover_gym.env.reward_terms import earn, total
from rover_gym.env.rover_env import STEP_FAILED
from rover_gym.env.task import Task
from rover_gym.mechanics import EpisodeBatch

#: What the core returns: observations, rewards, which episodes ended or reached the time limit, and which are over.
Stepped = tuple[Observations, Array, Mask, Mask, list[int]]
Finals = dict[int, tuple[Observations, dict[str, Any]]]


class BatchTerms:
    """What the functions of `reward_terms` gave in the last control period of each rover; without functions, nothing.

    Args:
        task: The task, which has the functions.
        episodes: The rovers' episodes.
    """

    def __init__(self, task: Task, episodes: EpisodeBatch) -> None:
        self._task, self._episodes = task, episodes
        self._now: dict[str, Array] = {name: np.zeros(len(episodes)) for name in task.reward_terms}
        #: Those of the episodes that the last step has ended and followed by others.
        self._finals: dict[int, dict[str, float]] = {}

    def before(self) -> Observations | None:
        """The observations that a period begins with; None without functions."""
        return self._episodes.observations() if self._now else None

    def earn(
        self,
        before: Observations,
        actions: Any,
        stepped: Stepped,
        moved: Mask,
        infos: dict[str, Any],
        finals: Finals | None = None,
    ) -> None:
        """Calls the functions and adds what they give to the rewards.

        Args:
            before: Observations before the period.
            actions: The actions.
            stepped: What the core returned; its rewards are changed.
            moved: Which rovers have moved; the others keep what they have.
            infos: Infos of the period.
            finals: Last observations and infos of the episodes that it has ended and followed by others.
        """
        observation, rewards = stepped[:2]
        ended = finals or {}
        after = observation.copy() if ended else observation
        for i, (last, info) in ended.items():
            after[i] = last
            _put(infos, i, info)
        counts = moved & (infos["termination"] != STEP_FAILED)
        own = earn(self._task.reward_terms, self._task.layout, before, actions, after, infos, counts)
        rewards += np.where(moved, total(own.values()), 0.0)
        self._finals = {i: {name: float(term[i]) for name, term in own.items()} for i in ended}
        begun = np.isin(np.arange(len(moved)), list(ended)) | (~moved & (self._zero_steps()))
        for name, term in own.items():
            self._now[name] = np.where(begun, 0.0, np.where(moved, term, self._now[name]))

    def _zero_steps(self) -> Mask:
        """Which episodes have only begun."""
        return np.array([self._episodes.steps(i) == 0 for i in range(len(self._episodes))])

    def clear(self, chosen: Sequence[int]) -> None:
        """The rovers' episodes have begun and have earned nothing."""
        for term in self._now.values():
            term[list(chosen)] = 0.0

    def add_to_info(self, i: int, info: dict[str, Any]) -> dict[str, Any]:
        """Adds the terms to the info of a rover."""
        info["reward_terms"] |= {name: float(term[i]) for name, term in self._now.items()}
        return info

    def add_to_infos(self, infos: dict[str, Any]) -> dict[str, Any]:
        """Adds the terms to the infos of all rovers."""
        terms = infos["reward_terms"]
        for name, term in self._now.items():
            terms[name], terms[f"_{name}"] = term.copy(), np.ones(len(term), np.bool_)
        return infos

    def add_to_finals(self, finals: Finals) -> Finals:
        """Adds the terms to the infos of episodes that have ended."""
        if self._now:
            for i, (_, info) in finals.items():
                info["reward_terms"] |= self._finals[i]
        return finals

    def state(self) -> dict[str, Array]:
        """The terms of the last period, `(n,)` each."""
        return {name: term.copy() for name, term in self._now.items()}

    def set_state(self, state: Mapping[str, Array]) -> None:
        """Sets the terms of the last period."""
        self._now = {name: np.array(state[name], np.float64) for name in self._now}


def _put(infos: dict[str, Any], i: int, info: Mapping[str, Any]) -> None:
    """Puts the info of a rover into the infos of all."""
    for key, value in info.items():
        if isinstance(value, Mapping):
            _put(infos[key], i, value)
        else:
            infos[key][i] = value
