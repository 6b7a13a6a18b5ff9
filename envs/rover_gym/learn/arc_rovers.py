"""Groups of rovers that drive by arcs, spread over worker processes; no part of this needs PyTorch."""

import contextlib
import multiprocessing as mp
import os
import time
import traceback
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from rover_gym.core import RoverModel
from rover_gym.drive.arcs.arc_driver import N_ARCS, ArcObservation
from rover_gym.drive.arcs.arc_network import ArcNetwork
from rover_gym.drive.arcs.arc_network_policy import ArcNetworkPolicy
from rover_gym.drive.evaluation import EvaluatedEpisode, drive_all
from rover_gym.drive.forecast.rover_view import LARGEST
from rover_gym.drive.scan.scan_policy import ScanPolicy
from rover_gym.envs.tasks.arcs_env import RoverArcsVectorEnv
from rover_gym.learn.arc_config import ArcConfig, ArcScene
from rover_gym.learn.configuration import environment_arguments
from rover_gym.learn.varied_rover import varied
from rover_gym.models.lookup import open_model

#: Steps of a scan's byte for each unit of a feature.
STEPS = 127.0 / LARGEST

Labels = dict[str, npt.NDArray[Any]]
#: Labels of a group, and how many of its episodes ended, how many of them at the goal.
LabelledGroup = tuple[Labels, int, int]


class Group:
    """Rovers of one scene, with their teacher.

    Args:
        scene: The scene.
        n: Number of rovers.
        seed: Of the fields and of a varied model.
    """

    def __init__(self, scene: ArcScene, n: int, seed: int) -> None:
        self.random = np.random.default_rng(seed)
        arguments = environment_arguments(scene.environment)
        model = arguments.get("model")
        model = open_model(model) if isinstance(model, str) else model
        if scene.vary:
            model = varied(RoverModel() if model is None else model, self.random)
        self.env = RoverArcsVectorEnv(n, threads=1, autoreset_mode="SameStep", **{**arguments, "model": model})
        teaches = scene.teacher == "foresight"
        self.teacher = ScanPolicy(self.env.rovers.prototype, forecast=True) if teaches else self.env.driver.planner
        self.seed = seed
        self.seen: ArcObservation = {}
        self.returns, self.lengths = np.zeros(n), np.zeros(n, np.int64)

    def begin(self) -> ArcObservation:
        """Starts episodes on new fields."""
        fields = self.random.integers(0, 1_000_000, self.env.num_envs).tolist()
        self.seen, _ = self.env.reset(seed=fields)
        self.returns[:], self.lengths[:] = 0.0, 0
        return self.seen

    def label(self, decisions: int, network: ArcNetwork | None, labelled: float, stray: float) -> LabelledGroup:
        """Drives and labels decisions.

        Args:
            decisions: Labels wanted.
            network: Drives half of the rovers by its best arcs, half by drawn ones; None for the teacher.
            labelled: Share of the decisions that are labelled.
            stray: Share of the teacher's decisions that are replaced by a random arc.

        Returns:
            Observations and labels, and how many episodes ended, how many of them at the goal.
        """
        env, random, n = self.env, self.random, self.env.num_envs
        parts: list[Labels] = []
        seen, count, ended, reached = self.begin(), 0, 0, 0
        draws = np.arange(n) % 2 == 1
        while count < decisions:
            marked = random.uniform(size=n) < labelled
            labels = env.expert_actions(self.teacher, np.ones(n, np.bool_) if network is None else marked)
            if marked.any():
                parts.append(
                    {
                        "scan": np.rint(seen["scan"][marked] * STEPS).astype(np.int8),
                        **{name: part[marked] for name, part in seen.items() if name != "scan"},
                        "label": labels[marked].astype(np.uint8),
                    }
                )
                count += int(marked.sum())
            if network is None:
                strays = random.uniform(size=n) < stray
                actions = np.where(strays, random.integers(0, N_ARCS, n), labels)
            else:
                logits = network(seen)
                actions = (logits + draws[:, None] * random.gumbel(size=logits.shape)).argmax(axis=1)
            seen, _, terminated, truncated, infos = env.step(actions)
            over = terminated | truncated
            ended += int(over.sum())
            reached += int((infos["final_info"]["termination"][over] == "goal").sum()) if over.any() else 0
        return {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}, ended, reached

    def step(
        self, arcs: npt.NDArray[Any], scale: float
    ) -> tuple[ArcObservation, npt.NDArray[Any], npt.NDArray[Any], list[dict[str, Any]]]:
        """A decision of each rover, with what stable-baselines3 wants to know."""
        seen, rewards, terminated, truncated, infos = self.env.step(arcs)
        over = terminated | truncated
        self.returns += rewards
        self.lengths += 1
        reported: list[dict[str, Any]] = [{} for _ in range(len(over))]
        for i in np.flatnonzero(over).tolist():
            reported[i] = {
                "terminal_observation": infos["final_obs"][i],
                "TimeLimit.truncated": bool(truncated[i] and not terminated[i]),
                "episode": {"r": float(self.returns[i]), "l": int(self.lengths[i]), "t": time.process_time()},
                "is_success": bool(infos["final_info"]["termination"][i] == "goal"),
            }
            self.returns[i], self.lengths[i] = 0.0, 0
        return seen, (rewards * scale).astype(np.float32), over, reported


def evaluate(network: ArcNetwork, arguments: Mapping[str, Any], seeds: Sequence[int]) -> list[EvaluatedEpisode]:
    """Drives a network over fields."""
    given = environment_arguments(arguments)
    model = given.get("model")
    model = open_model(model) if isinstance(model, str) else model
    scene = {**given, "model": model, **ScanPolicy.arguments(model)}
    return drive_all(lambda env: ArcNetworkPolicy(env, network), seeds, arguments=scene)


def join_labels(found: Sequence[LabelledGroup]) -> tuple[Labels, float]:
    """Labels of several groups, and the share of their episodes that reached the goal."""
    labels = {name: np.concatenate([one[0][name] for one in found]) for name in found[0][0]}
    return labels, sum(one[2] for one in found) / max(1, sum(one[1] for one in found))


class _Worker:
    """What a process holds: its groups of rovers."""

    def __init__(self, config: ArcConfig) -> None:
        self._scenes, self._n = config.parsed(), config.group
        self._groups: list[Group] = []

    def found(self, names: Sequence[str], seeds: Sequence[int]) -> None:
        self._groups = [Group(self._scenes[name], self._n, seed) for name, seed in zip(names, seeds, strict=True)]

    def label(self, arrays: Any, decisions: int, labelled: float, stray: float) -> Any:
        network = None if arrays is None else ArcNetwork(arrays)
        return [group.label(decisions, network, labelled, stray) for group in self._groups]

    def begin(self) -> Any:
        return _joined([group.begin() for group in self._groups])

    def step(self, arcs: npt.NDArray[Any], scale: float) -> Any:
        parts = np.split(arcs, len(self._groups)) if self._groups else []
        found = [group.step(part, scale) for group, part in zip(self._groups, parts, strict=True)]
        seen = _joined([one[0] for one in found])
        reported = [info for one in found for info in one[3]]
        return seen, np.concatenate([one[1] for one in found]), np.concatenate([one[2] for one in found]), reported

    def evaluate(self, arrays: Any, arguments: Mapping[str, Any], seeds: Sequence[int]) -> Any:
        return evaluate(ArcNetwork(arrays), arguments, seeds)

    def cpu_seconds(self) -> float:
        return time.process_time()


def _joined(parts: Sequence[ArcObservation]) -> ArcObservation:
    return {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}


def _serve(pipe: Any, config: ArcConfig) -> None:
    """Answers calls of methods of a `_Worker` until None comes."""
    worker = _Worker(config)
    while True:
        try:
            asked = pipe.recv()
        except (EOFError, KeyboardInterrupt):
            return
        if asked is None:
            return
        name, arguments = asked
        try:
            pipe.send((True, getattr(worker, name)(*arguments)))
        except Exception:
            pipe.send((False, traceback.format_exc()))


class WorkerError(RuntimeError):
    """A worker process has failed; the message is its traceback."""


class Rovers:
    """Rovers in worker processes; with one worker they drive in this process.

    Args:
        config: The configuration.
        workers: Number of processes; at most one a group.
    """

    def __init__(self, config: ArcConfig, workers: int = 1) -> None:
        self.config = config
        self.n_groups = len(config.groups())
        self.workers = max(1, min(workers, self.n_groups))
        self._here = _Worker(config) if self.workers == 1 else None
        self._pipes, self._processes = [], []
        if self._here is None:
            context = mp.get_context("spawn")
            # Each process computes on one core.
            before = {name: os.environ.get(name) for name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS")}
            os.environ |= dict.fromkeys(before, "1")
            for _ in range(self.workers):
                own, other = context.Pipe()
                process = context.Process(target=_serve, args=(other, config), daemon=True)
                process.start()
                other.close()
                self._pipes.append(own)
                self._processes.append(process)
            for name, value in before.items():
                if value is None:
                    del os.environ[name]
                else:
                    os.environ[name] = value

    def found(self, seed: int, offset: float) -> int:
        """Makes the groups anew; returns the number of rovers."""
        names, w = self.config.groups(offset), self.workers
        seeds = [1000 * seed + k for k in range(len(names))]
        self._call("found", [(names[i::w], seeds[i::w]) for i in range(w)])
        return len(names) * self.config.group

    def label(self, network: ArcNetwork | None, decisions: int, labelled: float, stray: float) -> tuple[Labels, float]:
        """Labelled decisions of all groups, and the share of the episodes that reached the goal."""
        each = -(-decisions // self.n_groups)
        arrays = None if network is None else dict(network.arrays)
        found = [one for part in self._call("label", [(arrays, each, labelled, stray)] * self.workers) for one in part]
        return join_labels(found)

    def begin(self) -> ArcObservation:
        """Starts the episodes of all rovers."""
        return _joined(self._call("begin", [()] * self.workers))

    def send(self, arcs: npt.NDArray[Any], scale: float) -> None:
        """Asks for a decision of each rover."""
        counts = [len(range(i, self.n_groups, self.workers)) * self.config.group for i in range(self.workers)]
        self._parts = [(part, scale) for part in np.split(arcs, np.cumsum(counts)[:-1])]
        for pipe, part in zip(self._pipes, self._parts, strict=False):
            pipe.send(("step", part))

    def receive(self) -> tuple[ArcObservation, npt.NDArray[Any], npt.NDArray[Any], list[dict[str, Any]]]:
        """What came of it."""
        found = [self._here.step(*self._parts[0])] if self._here is not None else [_got(pipe) for pipe in self._pipes]
        reported = [info for one in found for info in one[3]]
        return (
            _joined([one[0] for one in found]),
            np.concatenate([one[1] for one in found]),
            np.concatenate([one[2] for one in found]),
            reported,
        )

    def evaluate(self, network: ArcNetwork) -> dict[str, list[EvaluatedEpisode]]:
        """Drives a network over the fields of the evaluation, by scene."""
        settings, w = self.config.evaluation, self.workers
        found: dict[str, list[EvaluatedEpisode]] = {}
        seeds = range(settings.seed, settings.seed + settings.fields)
        for name, arguments in settings.scenes.items():
            asked = [(dict(network.arrays), arguments, list(seeds[i::w])) for i in range(w)]
            found[name] = [episode for part in self._call("evaluate", asked) for episode in part]
        return found

    def cpu_seconds(self) -> float:
        """CPU time of the worker processes so far; 0 where there are none."""
        return 0.0 if self._here is not None else sum(self._call("cpu_seconds", [()] * self.workers))

    def close(self) -> None:
        """Ends the processes."""
        for pipe in self._pipes:
            with contextlib.suppress(OSError):
                pipe.send(None)
        for process in self._processes:
            process.join(5.0)
        self._pipes, self._processes = [], []

    def _call(self, name: str, arguments: Sequence[tuple[Any, ...]]) -> list[Any]:
        """Calls a method in each worker at the same time."""
        if self._here is not None:
            return [getattr(self._here, name)(*arguments[0])]
        for pipe, given in zip(self._pipes, arguments, strict=True):
            pipe.send((name, given))
        return [_got(pipe) for pipe in self._pipes]


def _got(pipe: Any) -> Any:
    is_good, answer = pipe.recv()
    if not is_good:
        raise WorkerError(answer)
    return answer
