"""Rovers on the machines of a Ray cluster: the episodes of an evaluation, the labels of a training.

Each task makes its own rovers from seeds and returns what they did. Ray repeats the tasks of a machine that is lost.
"""

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

from rover_gym.core import OptionError
from rover_gym.core.extras import require
from rover_gym.core.validation import refuse
from rover_gym.drive.arcs.arc_network import ArcNetwork
from rover_gym.drive.commands.driven import Policy
from rover_gym.drive.evaluation import EvaluatedEpisode, drive_all
from rover_gym.learn.arc_config import ArcConfig
from rover_gym.learn.arc_rovers import Group, LabelledGroup, Labels, Rovers, evaluate, join_labels

#: Episodes of a task: as many as `drive_all` runs at a time.
EPISODES = 32
#: How often a task is tried whose machine or process is lost.
TRIES = 5


def connect(address: str) -> Any:
    """Joins a cluster, unless this process has joined one; returns the module `ray`.

    Args:
        address: "auto" for the cluster that this machine belongs to, or HOST:PORT of its first machine.

    Raises:
        MissingExtraError: The extra `rllib` is not installed.
        OptionError: There is no cluster.
    """
    ray = require("ray", "rllib")
    if not ray.is_initialized():
        try:
            ray.init(address=address, log_to_driver=False, logging_level="error")
        except (ConnectionError, ValueError, RuntimeError) as error:
            refuse(OptionError, "ray", address, f"is not the address of a Ray cluster ({str(error).splitlines()[0]})")
    return ray


def drive_on_cluster(
    address: str,
    make_policy: Callable[[Any], Policy],
    seeds: Sequence[int],
    *,
    arguments: Mapping[str, Any],
    progress: Callable[[int], None] = lambda _done: None,
) -> list[EvaluatedEpisode]:
    """Runs one episode per seed, as `drive_all`, on all cores of a cluster.

    Args:
        address: Of the cluster, as `connect` takes it.
        make_policy: Makes a policy from an environment.
        seeds: Seeds of the resets.
        arguments: Arguments of `RoverEnv`; files that they name must be on every machine.
        progress: Called with the number of episodes done.

    Raises:
        MissingExtraError: The extra `rllib` is not installed.
        OptionError: There is no cluster, or an argument is out of range.
    """
    ray = connect(address)
    drive = _task(ray, _drive)
    parts = [list(seeds[k : k + EPISODES]) for k in range(0, len(seeds), EPISODES)]
    make, given = ray.put(make_policy), ray.put(dict(arguments))
    found: dict[int, EvaluatedEpisode] = {}
    for episodes in _as_they_end(ray, [drive.remote(make, part, given) for part in parts]):
        found |= {episode.seed: episode for episode in episodes}
        progress(len(found))
    return [found[seed] for seed in seeds]


class ClusterRovers(Rovers):
    """Rovers that label and are evaluated on a cluster; for PPO they drive in processes of this machine.

    The labels are, bit for bit, those of `Rovers` with one worker.

    Args:
        config: The configuration.
        workers: Number of processes of this machine.
        address: Of the cluster, as `connect` takes it.

    Raises:
        MissingExtraError: The extra `rllib` is not installed.
        OptionError: There is no cluster.
    """

    def __init__(self, config: ArcConfig, workers: int, address: str) -> None:
        self._ray = connect(address)
        super().__init__(config, workers)
        self._founded = (0, 0.5)
        self._spent = 0.0

    def found(self, seed: int, offset: float) -> int:
        """Notes how the groups are made; returns the number of rovers."""
        self._founded = (seed, offset)
        return self.n_groups * self.config.group

    def begin(self) -> Any:
        """Makes the groups in the processes of this machine, and starts their episodes."""
        super().found(*self._founded)
        return super().begin()

    def label(self, network: ArcNetwork | None, decisions: int, labelled: float, stray: float) -> tuple[Labels, float]:
        """Labelled decisions of all groups, and the share of the episodes that reached the goal."""
        seed, offset = self._founded
        label, config, driver = _task(self._ray, _label), self._ray.put(self.config), self._ray.put(network)
        each = -(-decisions // self.n_groups)
        tasks = [
            label.remote(config, name, 1000 * seed + k, driver, each, labelled, stray)
            for k, name in enumerate(self.config.groups(offset))
        ]
        found = self._ray.get(tasks)
        self._spent += sum(seconds for _, seconds in found)
        return join_labels([one for one, _ in found])

    def evaluate(self, network: ArcNetwork) -> dict[str, list[EvaluatedEpisode]]:
        """Drives a network over the fields of the evaluation, by scene."""
        settings, drive = self.config.evaluation, _task(self._ray, _evaluate)
        driver, last = self._ray.put(network), settings.seed + settings.fields
        parts = [list(range(k, min(k + EPISODES, last))) for k in range(settings.seed, last, EPISODES)]
        asked = {
            name: [drive.remote(driver, arguments, part) for part in parts]
            for name, arguments in settings.scenes.items()
        }
        found = {name: self._ray.get(tasks) for name, tasks in asked.items()}
        self._spent += sum(seconds for done in found.values() for _, seconds in done)
        return {name: [episode for episodes, _ in done for episode in episodes] for name, done in found.items()}

    def cpu_seconds(self) -> float:
        """CPU time of the tasks and of the processes so far, s."""
        return self._spent + super().cpu_seconds()


def _task(ray: Any, function: Callable[..., Any]) -> Any:
    """A function as a task on one core."""
    return ray.remote(num_cpus=1, max_retries=TRIES)(function)


def _as_they_end(ray: Any, tasks: list[Any]) -> Iterator[Any]:
    """Results in the order in which they come."""
    while tasks:
        done, tasks = ray.wait(tasks)
        yield from ray.get(done)


def _drive(make: Callable[[Any], Policy], seeds: list[int], arguments: Mapping[str, Any]) -> list[EvaluatedEpisode]:
    return drive_all(make, seeds, arguments=arguments)


def _label(
    config: ArcConfig, name: str, seed: int, network: ArcNetwork | None, decisions: int, labelled: float, stray: float
) -> tuple[LabelledGroup, float]:
    begun = time.process_time()
    group = Group(config.parsed()[name], config.group, seed)
    return group.label(decisions, network, labelled, stray), time.process_time() - begun


def _evaluate(
    network: ArcNetwork, arguments: Mapping[str, Any], seeds: list[int]
) -> tuple[list[EvaluatedEpisode], float]:
    begun = time.process_time()
    return evaluate(network, arguments, seeds), time.process_time() - begun
