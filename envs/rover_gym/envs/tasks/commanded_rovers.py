"""Drives several rovers by commands: PettingZoo's parallel interface with the actions of `RoverCommand-v0`."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from rover_gym.core import OptionError
from rover_gym.core.extras import MissingExtraError
from rover_gym.core.validation import refuse
from rover_gym.drive.commands.command import N_COMMANDS, command_space
from rover_gym.envs.observation import Observations
from rover_gym.envs.several.pettingzoo_env import RoverParallelEnv, Stepped
from rover_gym.envs.several.scene_snapshot import SceneSnapshot
from rover_gym.envs.tasks.command_env import HeldCommands, check_commands
from rover_gym.envs.time_limits import REPEAT

try:
    from pettingzoo.utils import BaseParallelWrapper
except ImportError as error:
    raise MissingExtraError("pettingzoo", "agents") from error


class DriveRoversByCommand(BaseParallelWrapper[str, Any, Observations]):  # type: ignore[misc]
    """Holds each agent's command for several control periods and sums its rewards.

    An action is speed, curvature and sideways direction, an observation the features that `RoverCommand-v0` has. An
    agent whose episode ends while its command is held brakes; the commands of the others go on.

    Args:
        env: The rovers, without sensors.
        repeat: Control periods that a command is held.
        pool: Height-scan points per pooling cell, lengthwise and crosswise.
        **limits: Fields of `CommandLimits`.

    Raises:
        OptionError: An argument is out of range, or `env` is another environment.
    """

    def __init__(self, env: RoverParallelEnv, repeat: int = REPEAT, *, pool: int = 1, **limits: float) -> None:
        given: object = env
        if not isinstance(given, RoverParallelEnv) or given.batch.has_sensors:
            refuse(OptionError, "env", given, "must be a RoverParallelEnv without sensors")
        super().__init__(env)
        self.repeat = repeat
        self._held = {}
        for k, agent in enumerate(env.possible_agents):
            self._held[agent] = HeldCommands(env.team.prototype(k), repeat=repeat, pool=pool, limits=limits)
        self._space = command_space()
        self._spaces = {agent: held.features.space for agent, held in self._held.items()}
        self._seen: dict[str, Observations] = {}

    def observation_space(self, agent: str) -> Any:
        """Space of an agent's features."""
        return self._spaces[agent]

    def action_space(self, agent: str) -> Any:  # noqa: ARG002 - equal for all
        """Space of the commands, (3,)."""
        return self._space

    def reset(
        self, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, Any], dict[str, dict[str, Any]]]:
        """Starts an episode of every rover, as `RoverParallelEnv.reset`."""
        self._seen, infos = self.env.reset(seed=seed, options=options)
        return self._features(self._seen), infos

    def step(self, actions: Mapping[str, Observations]) -> Stepped:
        """Holds the commands of all agents.

        Args:
            actions: A command of each agent in `agents`, (3,), clipped to [-1, 1].

        Raises:
            CommandError: An agent's command is missing or not three finite numbers; nothing has changed.
            ResetNeeded: The environment has not been reset.
        """
        commands = {agent: check_commands(command, (N_COMMANDS,))[None] for agent, command in actions.items()}
        seen, rewards = dict(self._seen), dict.fromkeys(commands, 0.0)
        terminated: dict[str, bool] = {}
        truncated: dict[str, bool] = {}
        infos: dict[str, dict[str, Any]] = {}
        for period in range(self.repeat):
            driven = commands if period == 0 else self.env.agents  # an ended agent's command is refused at first
            stepped = self.env.step({agent: self._act(agent, seen, commands) for agent in driven})
            seen |= stepped[0]
            terminated, truncated, infos = terminated | stepped[2], truncated | stepped[3], infos | stepped[4]
            for agent, reward in stepped[1].items():
                rewards[agent] += reward
            if not self.env.agents:
                break
        self._seen = {agent: seen[agent] for agent in self.env.agents}
        return self._features({agent: seen[agent] for agent in rewards}), rewards, terminated, truncated, infos

    def restore(self, snapshot: SceneSnapshot) -> None:
        """Goes on from a snapshot, as `RoverParallelEnv.restore`."""
        self.env.restore(snapshot)
        every = {agent: self.env.batch.observation(0, k) for k, agent in enumerate(self.env.possible_agents)}
        self._seen = {agent: every[agent] for agent in self.env.agents}

    def _act(self, agent: str, seen: Mapping[str, Observations], commands: Mapping[str, Any]) -> Observations:
        """The action of an agent; none is known of one whose episode has ended, and any is refused."""
        if agent not in seen:
            return np.zeros(0, np.float32)
        action: Observations = self._held[agent].controller.act(seen[agent][None], commands[agent])[0]
        return action

    def _features(self, seen: Mapping[str, Observations]) -> dict[str, Any]:
        return {agent: self._held[agent].features(one[None])[0] for agent, one in seen.items()}
