"""`rover train`: a network learns to drive any rover by imitation of planners, then by PPO.

1. Imitation. The planners drive and label their choices; the network learns them, drives itself, and learns what the
   planners would have done in its place (dataset aggregation, Ross et al. 2011).
2. PPO goes on from there. A penalty on the divergence from the imitating network fades.

The run's folder receives `config.yaml`, `run.json`, `curve.csv`, TensorBoard's events, checkpoints, `arcs.npz`, and in
`best` the network that did best in the evaluations.
"""

import csv
import json
import time
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import torch
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.logger import configure
from torch.utils.tensorboard import SummaryWriter

from rover_gym.core import OptionError
from rover_gym.core.validation import refuse
from rover_gym.drive.arcs.arc_network import ArcNetwork
from rover_gym.drive.arcs.arc_network_policy import ARCS_FILE
from rover_gym.drive.evaluation import summarise
from rover_gym.learn.arc_config import ArcConfig, ArcPPOConfig, read_arc_config
from rover_gym.learn.arc_learner import (
    ArcVecEnv,
    begin_with,
    chosen_device,
    imitate,
    leash_at,
    make_model,
    network_of,
)
from rover_gym.learn.arc_rovers import Labels, Rovers
from rover_gym.learn.cluster import ClusterRovers
from rover_gym.learn.provenance import provenance

Say = Callable[[str], None]

#: What a run leaves in its folder: a training does not begin where one of them is.
RUN_FILES = ("state.json", "curve.csv", ARCS_FILE)

#: Seconds between two lines of progress.
SILENCE = 10.0


class ArcTraining:
    """A training that goes on from its folder's last checkpoint.

    Args:
        config: The configuration.
        folder: The run's folder.
        seed: Of network, exploration and fields.
        workers: Processes that drive.
        cluster: Address of a Ray cluster that labels and evaluates; None for the workers.
        threads: Threads of PyTorch; None for its own choice.
        device: Of PyTorch: "auto", "cpu", "cuda".
        resume: Whether to go on.
        begin: The network that the training begins with; None for a new one.
        until: Time of `time.monotonic` at which PPO ends early; None without such an end.
        say: Takes each line of figures.

    Raises:
        OptionError: The checkpoint is of other scenes or another network, or there is none; or without `resume` the
            folder has a run.
    """

    def __init__(
        self,
        config: ArcConfig,
        folder: Path,
        *,
        seed: int = 1,
        workers: int = 1,
        cluster: str | None = None,
        threads: int | None = None,
        device: str = "auto",
        resume: bool = False,
        begin: ArcNetwork | None = None,
        until: float | None = None,
        say: Say = print,
    ) -> None:
        self.config, self.folder, self.seed, self.say, self.until = config, folder, seed, say, until
        self.begin, self.resume = begin, resume
        state_file = folder / "state.json"
        if not resume and (held := next((folder / name for name in RUN_FILES if (folder / name).exists()), None)):
            refuse(OptionError, "folder", str(folder), f"has a run ({held.name}): resume it, or choose another folder")
        self.state: dict[str, Any] = {"rounds": 0, "decisions": 0, "cpu_seconds": 0.0, "best": -1.0}
        if resume:
            if not state_file.is_file():
                refuse(OptionError, "resume", str(folder), "no round has ended there: train without resuming")
            before = read_arc_config(folder / "config.yaml")
            if before.parsed() != config.parsed():
                refuse(OptionError, "scenes", sorted(config.scenes), "must be those of the training that is to go on")
            self.state = json.loads(state_file.read_text(encoding="utf-8"))
        folder.mkdir(parents=True, exist_ok=True)
        (folder / "config.yaml").write_text(config.to_yaml(), encoding="utf-8")
        if threads is not None:
            torch.set_num_threads(threads)
        self.device = chosen_device(device)
        #: TensorBoard's events, in the run's folder.
        self._events = SummaryWriter(str(folder / "tensorboard"))
        self.rovers = Rovers(config, workers) if cluster is None else ClusterRovers(config, workers, cluster)
        self._begun, self._before = time.process_time(), self.state["cpu_seconds"]

    def run(self) -> Path:
        """Trains and returns the run's folder."""
        try:
            model = self._imitation()
            if self.config.ppo is not None:
                model = self._reinforcement(model)
            self._end(model)
        finally:
            self.rovers.close()
            self._events.close()
        return self.folder

    def cpu_seconds(self) -> float:
        """CPU time so far, with the worker processes', s."""
        return float(self._before + time.process_time() - self._begun + self.rovers.cpu_seconds())

    # -- imitation

    def _imitation(self) -> PPO:
        """The learner after the last round of imitation, or from a later checkpoint."""
        config, folder = self.config, self.folder
        settings = config.imitation
        n, ppo = len(config.groups()) * config.group, config.ppo or ArcPPOConfig()
        ppo = replace(ppo, batch_size=n * ppo.n_steps)  # nothing is drawn from this learner's buffer
        model = make_model(ppo, ArcVecEnv(None, n), self.seed, self.device)
        done, kept = self.state["rounds"], folder / "imitation.pt"
        if self.resume and kept.is_file():
            model.policy.load_state_dict(torch.load(kept, map_location=self.device, weights_only=True))
        else:
            if self.begin is not None:
                begin_with(model.policy, self.begin)
            torch.save(model.policy.state_dict(), kept)
        if done >= settings.rounds:
            return model
        rounds: list[Labels] = [dict(np.load(folder / f"labels-{k}.npz")) for k in range(done)]
        for k in range(done, settings.rounds):
            self.rovers.found(self.seed * 100 + k, (k + 0.5) / settings.rounds)
            network = None if k == 0 and self.begin is None else network_of(model.policy)
            clock = time.monotonic()
            labels, success = self.rovers.label(network, settings.decisions, settings.labelled, settings.stray)
            drove = time.monotonic() - clock
            np.savez(folder / f"labels-{k}.npz", **labels)  # type: ignore[arg-type]
            rounds.append(labels)
            loss, hits = imitate(model.policy, rounds, settings, 100 * self.seed + k)
            figures = {"loss": loss, "agreement": hits, "success": success}
            self._log({f"imitation/{name}": value for name, value in figures.items()}, k + 1)
            torch.save(model.policy.state_dict(), kept)
            self.state |= {"rounds": k + 1, "cpu_seconds": self.cpu_seconds()}
            self._keep()
            driver = "the teachers" if network is None else "the network"
            self.say(
                f"round {k + 1} of {settings.rounds}: {sum(len(part['label']) for part in rounds)} labels, "
                f"{driver} reached {success:.0%} of the goals in {drove:.0f} s; then loss {loss:.3f}, "
                f"{hits:.0%} of the labels, {self.state['cpu_seconds'] / 60.0:.1f} CPU min"
            )
        self._evaluate(model, "imitation", 0)
        return model

    # -- reinforcement

    def _reinforcement(self, imitated: PPO) -> PPO:
        """Goes on with PPO."""
        settings = self.config.ppo
        assert settings is not None  # noqa: S101 - the caller has looked
        n = self.rovers.found(self.seed * 100 + 50 + self.state["decisions"] % 37, 0.5)
        venv = ArcVecEnv(self.rovers, n, settings.reward_scale)
        model = make_model(settings, venv, self.seed + self.state["decisions"], self.device)
        model.policy.load_state_dict(imitated.policy.state_dict())
        policy: Any = model.policy
        policy.tie()
        if self.state["decisions"]:
            saved = torch.load(self.folder / "ppo.pt", map_location=self.device, weights_only=True)
            model.policy.load_state_dict(saved["policy"])
            model.policy.optimizer.load_state_dict(saved["optimizer"])
            model.num_timesteps = self.state["decisions"]
        left = settings.decisions - model.num_timesteps
        if left > 0:
            model.set_logger(configure(str(self.folder / "tensorboard"), ["tensorboard"]))
            model.learn(left, callback=_Progress(self), reset_num_timesteps=False)
            self._checkpoint(model)
            self._evaluate(model, "ppo", model.num_timesteps)
        return model

    def _checkpoint(self, model: PPO) -> None:
        saved = {"policy": model.policy.state_dict(), "optimizer": model.policy.optimizer.state_dict()}
        torch.save(saved, self.folder / "ppo.pt")
        self.state |= {"decisions": model.num_timesteps, "cpu_seconds": self.cpu_seconds()}
        self._keep()

    # -- figures

    def _evaluate(self, model: PPO, stage: str, decisions: int) -> None:
        """Evaluates the network, writes it, and keeps it if it is the best so far."""
        network = network_of(model.policy)
        network.save(self.folder / ARCS_FILE)
        found = {name: summarise(name, drives) for name, drives in self.rovers.evaluate(network).items()}
        success = float(np.mean([row.success.value for row in found.values()])) if found else 0.0
        row: dict[str, Any] = {
            "stage": stage,
            "decisions": decisions,
            "cpu_minutes": round(self.cpu_seconds() / 60.0, 2),
        }
        for name, summary in found.items():
            row[name], row[f"{name} J/m"] = summary.success.value, round(summary.energy_per_metre.value)
        is_first = not (self.folder / "curve.csv").exists()
        with (self.folder / "curve.csv").open("a", newline="", encoding="utf-8") as file:
            writer = csv.DictWriter(file, list(row))
            if is_first:
                writer.writeheader()
            writer.writerow(row)
        is_best = success > self.state["best"]
        if is_best:
            (self.folder / "best").mkdir(exist_ok=True)
            network.save(self.folder / "best" / ARCS_FILE)
            self.state["best"] = success
            self._keep()
        figures = ", ".join(
            f"{name} {100.0 * one.success.value:.0f}% {one.energy_per_metre.value:.0f} J/m"
            for name, one in found.items()
        )
        self.say(f"{stage}, {decisions} decisions: {figures}{' (best)' if is_best else ''}")
        rates = {f"evaluation/{name}": summary.success.value for name, summary in found.items()}
        self._log({"evaluation/success": success, **rates}, decisions)

    def _log(self, figures: Mapping[str, float], step: int) -> None:
        """Writes figures as TensorBoard events."""
        for name, value in figures.items():
            self._events.add_scalar(name, value, step)
        self._events.flush()

    def _keep(self) -> None:
        """Writes the state, last of all files of a checkpoint."""
        (self.folder / "state.json").write_text(json.dumps(self.state) + "\n", encoding="utf-8")

    def _end(self, model: PPO) -> None:
        network_of(model.policy).save(self.folder / ARCS_FILE)
        facts = {
            "algorithm": "imitation, then stable-baselines3 PPO",
            "seed": self.seed,
            "rounds": self.state["rounds"],
            "decisions": self.state["decisions"],
            "cpu_seconds": round(self.cpu_seconds(), 1),
            **provenance(),
        }
        (self.folder / "run.json").write_text(json.dumps(facts, indent=2) + "\n", encoding="utf-8")


class _Progress(BaseCallback):
    """Frees the actor, lengthens the leash, evaluates, writes checkpoints, and ends a training whose time is over."""

    def __init__(self, training: ArcTraining) -> None:
        super().__init__()
        self._training = training
        self._next = 0
        self._clock = self._said = time.monotonic()

    def _on_training_start(self) -> None:
        settings = self._training.config.ppo
        assert settings is not None  # noqa: S101
        self._settings = settings
        self._next = self.num_timesteps + settings.every
        self._hold_actor()

    def _hold_actor(self) -> None:
        policy: Any = self.model.policy
        policy.hold_actor(self.num_timesteps <= self._settings.warm_up)

    def _on_rollout_end(self) -> None:
        training, settings = self._training, self._settings
        self._hold_actor()
        passed = self.num_timesteps / settings.decisions
        if training.until is not None:
            now = time.monotonic()
            passed = max(passed, (now - self._clock) / max(1.0, training.until - self._clock))
            self.model._current_progress_remaining = max(0.0, 1.0 - passed)
        model: Any = self.model
        model.ent_coef = leash_at(settings, passed)
        if self.num_timesteps >= self._next:
            self._next += settings.every
            training._checkpoint(model)
            training._evaluate(model, "ppo", self.num_timesteps)
            logged, ends = model.logger.name_to_value, model.ep_success_buffer
            training.say(
                f"  leash {model.ent_coef:.3f}, divergence {logged.get('train/entropy_loss', np.nan):.3f}, "
                f"success while exploring {np.mean(ends or [0]):.0%}"
            )
            self._said = time.monotonic()
        elif time.monotonic() - self._said >= SILENCE:
            self._said = time.monotonic()
            training.say(f"  {self.num_timesteps} of {settings.decisions} decisions, {passed:.0%}")

    def _on_step(self) -> bool:
        until = self._training.until
        return until is None or time.monotonic() < until


def train_arcs(config: ArcConfig, folder: Path, **options: Any) -> Path:
    """Trains as `ArcTraining` does; returns the folder."""
    return ArcTraining(config, folder, **options).run()
