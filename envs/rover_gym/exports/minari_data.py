"""Episodes of a policy as a Minari data set."""

from __future__ import annotations

import os
import re
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import gymnasium as gym
import numpy as np

from rover_gym.core import OptionError, __version__
from rover_gym.core.extras import require
from rover_gym.core.validation import checked, refuse, whole
from rover_gym.envs.registration import ENVIRONMENTS

if TYPE_CHECKING:
    from rover_gym.drive.commands.driven import Policy

#: Allowed names of data sets, which Minari takes as they are: a namespace has two characters or more.
NAME = re.compile(r"(?![A-Za-z]/[^/]*$)(?:[A-Za-z][A-Za-z0-9_-]*/)*[A-Za-z][A-Za-z0-9_-]*-v(?:0|[1-9]\d{0,5})")
#: Environment variable with Minari's folder of data sets.
PLACE = "MINARI_DATASETS_PATH"


@checked(
    name=str,
    environment=str,
    make_policy=callable,
    seeds=Iterable,
    arguments=(Mapping, None),
    folder=(Path, None),
    policy_name=str,
    progress=callable,
)
def write_dataset(
    name: str,
    environment: str,
    make_policy: Callable[[gym.Env[Any, Any]], Policy],
    seeds: Iterable[int],
    *,
    arguments: Mapping[str, Any] | None = None,
    folder: str | Path | None = None,
    policy_name: str = "",
    progress: Callable[[int], None] = lambda _done: None,
) -> Path:
    """Drives episodes and stores their observations, actions, rewards and ends.

    The data set contains the environment's arguments, from which `dataset.recover_environment()` makes it again, and
    the seed of every episode (`dataset.storage.get_episode_metadata`). Replaying the actions from the seed gives the
    same observations bit for bit. Each episode is written to the disk when it is over.

    Args:
        name: Name of the data set, such as `rover/rocks-pd-v0`.
        environment: A registered environment of this package.
        make_policy: Makes the policy for the environment.
        seeds: Of the episodes, all different.
        arguments: Of the environment: numbers, texts, flags and lists of them.
        folder: Where data sets are; Minari's own place by default.
        policy_name: For the data set's description.
        progress: Called with the number of episodes that are stored.

    Returns:
        The folder of the data set.

    Raises:
        OptionError: The environment does not belong to this package, an argument cannot be stored as text, a seed is
            not a whole number or is given twice, or the name is already used.
        MissingExtraError: Minari is not installed.
    """
    minari = require("minari", "data")
    if not NAME.fullmatch(name):
        reason = "must be NAME-vN or NAMESPACE/NAME-vN, of letters, digits, _ and -, the namespace of two or more"
        refuse(OptionError, "name", name, reason)
    if environment not in ENVIRONMENTS:
        refuse(OptionError, "environment", environment, f"must be one of {', '.join(ENVIRONMENTS)}")
    chosen = [whole("seeds", seed) for seed in seeds]
    if not chosen or len(set(chosen)) != len(chosen):
        refuse(OptionError, "seeds", chosen, "must be one or more, all different")
    with _datasets_in(folder) as place:
        target = place / name
        if target.exists():
            refuse(OptionError, "name", name, f"is already the name of a data set in {place}")
        env = gym.make(environment, **_plain(arguments or {}))
        policy, stored = make_policy(env), None
        for done, seed in enumerate(chosen, 1):
            episode = _driven(env, policy, seed)
            if stored is None:
                stored = _begun(minari, name, env, episode, policy_name)
            else:
                stored.storage.update_episodes([episode])
            progress(done)
        env.close()
    return target


def _driven(env: gym.Env[Any, Any], policy: Policy, seed: int) -> Any:
    """One episode to its end, as Minari stores it."""
    observation, _ = env.reset(seed=seed)
    observations, actions, steps = [observation], [], []
    state, over = None, False
    while not over:
        action, state = policy.predict(observation, state)
        observation, reward, terminated, truncated, _ = env.step(action)
        observations.append(observation)
        actions.append(action)
        steps.append((float(reward), terminated, truncated))
        over = terminated or truncated
    rewards, terminations, truncations = map(list, zip(*steps, strict=True))
    return require("minari.data_collector", "data").EpisodeBuffer(
        seed=seed,
        observations=_stacked(observations),
        actions=_stacked(actions),
        rewards=rewards,
        terminations=terminations,
        truncations=truncations,
        infos={},
    )


def _begun(minari: Any, name: str, env: gym.Env[Any, Any], episode: Any, policy_name: str) -> Any:
    """A data set with its first episode."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # that it names no author
        return minari.create_dataset_from_buffers(
            name,
            [episode],
            env=env,
            eval_env=env,
            algorithm_name=policy_name,
            description=f"episodes of {env.spec.id if env.spec else name} with {policy_name}",
            requirements=[f"rover-gym=={__version__}"],
        )


def _stacked(rows: list[Any]) -> Any:
    """Rows of a space as arrays; dictionaries stay dictionaries."""
    if isinstance(rows[0], dict):
        return {key: _stacked([row[key] for row in rows]) for key in rows[0]}
    return np.array(rows)


def _plain(arguments: Mapping[str, Any]) -> dict[str, Any]:
    """Arguments that a data set can store as text."""
    for name, value in arguments.items():
        if not isinstance(value, (bool, int, float, str, list, tuple, type(None))):
            refuse(
                OptionError, f"arguments.{name}", value, "must be a number, a string, a boolean or a list to be stored"
            )
    return dict(arguments)


@contextmanager
def _datasets_in(folder: str | Path | None) -> Iterator[Path]:
    """Sets Minari's folder, which Minari reads from an environment variable."""
    before = os.environ.get(PLACE)
    place = Path(folder or before or Path.home() / ".minari" / "datasets").resolve()
    os.environ[PLACE] = str(place)
    try:
        yield place
    finally:
        if before is None:
            del os.environ[PLACE]
        else:
            os.environ[PLACE] = before
