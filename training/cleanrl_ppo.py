"""PPO on raw actions in one file, in the style of CleanRL: PyTorch and `gymnasium.make_vec`, no trainer's library.

    python training/cleanrl_ppo.py --task plane --seed 1

The hyperparameters are those of `training/configs/raw_ppo.yaml`. One vector steps all rovers in the compiled core. The
run's folder receives `curve.csv` (success, return and length of the last 200 episodes after each update), the network
and the statistics of its inputs (`agent.pt`), and the final evaluation (`evaluation.json`).
"""

import csv
import json
import time
from collections import deque
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Annotated, Any

import gymnasium as gym
import numpy as np
import numpy.typing as npt
import torch
import typer
from torch import nn

import rover_gym  # noqa: F401 - registers the environments
from rover_gym.cli.console import plain_errors, say_path
from rover_gym.mechanics import OptionError
from rover_gym.policy.evaluation import drive_all, summarise
from rover_gym.validation import refuse

Array = npt.NDArray[np.float32]

#: An action lasts 0.2 s, in evaluations too.
DECISIONS: dict[str, Any] = {"control_frequency": 5.0}

#: Coarser physics than in evaluations, which run at the defaults.
COARSE: dict[str, Any] = {"time_step": 0.02, "solver_options": {"tolerance": 1e-4, "max_iterations": 20}}

#: The environment, its arguments and the decisions of all rovers together, by task.
TASKS: dict[str, tuple[str, dict[str, Any], int]] = {
    "plane": ("Rover-v0", {}, 500_000),
    "rocks": ("RoverRocks-v0", {"difficulty": 0.5, "height_scan": True}, 1_000_000),
}


@dataclass(frozen=True)
class Hyperparameters:
    """PPO's, by the names of stable-baselines3."""

    num_envs: int = 64
    n_steps: int = 64
    batch_size: int = 1024
    n_epochs: int = 6
    learning_rate: float = 1e-3
    final_learning_rate: float = 2e-4
    gamma: float = 0.97
    gae_lambda: float = 0.95
    clip_range: float = 0.2
    vf_coef: float = 0.5
    max_grad_norm: float = 0.5
    log_std_init: float = -1.0
    max_episode_steps: int = 150
    width: int = 64


@dataclass
class RunningScale:
    """Mean and variance of all rows so far (Chan, Golub and LeVeque 1983)."""

    mean: npt.NDArray[np.float64]
    variance: npt.NDArray[np.float64] = field(init=False)
    count: float = 1e-4

    def __post_init__(self) -> None:
        self.variance = np.ones_like(self.mean)

    def update(self, rows: npt.NDArray[Any]) -> None:
        """Takes `(n, size)` further rows."""
        total = self.count + len(rows)
        step = rows.mean(axis=0) - self.mean
        squares = self.variance * self.count + rows.var(axis=0) * len(rows) + step**2 * self.count * len(rows) / total
        self.mean, self.variance, self.count = self.mean + step * len(rows) / total, squares / total, total


class Agent(nn.Module):
    """Two networks with two hidden layers each: the mean of a Gaussian over actions, and the value."""

    def __init__(self, n_seen: int, n_actions: int, given: Hyperparameters) -> None:
        super().__init__()
        self.actor = network(n_seen, given.width, n_actions, 0.01)
        self.critic = network(n_seen, given.width, 1, 1.0)
        self.log_std = nn.Parameter(torch.full((n_actions,), given.log_std_init))
        self.scale = RunningScale(np.zeros(n_seen))

    def normalise(self, observations: Array) -> torch.Tensor:
        """Observations `(n, size)` as the networks see them."""
        scaled = (observations - self.scale.mean) / np.sqrt(self.scale.variance + 1e-8)
        return torch.as_tensor(scaled.clip(-5.0, 5.0), dtype=torch.float32)

    def sample(self, seen: torch.Tensor) -> torch.Tensor:
        """Actions `(n, n_actions)` with exploration."""
        mean: torch.Tensor = self.actor(seen)
        return mean + self.log_std.exp() * torch.randn_like(mean)

    def log_probability(self, seen: torch.Tensor, acted: torch.Tensor) -> torch.Tensor:
        """Logarithm of the density `(n,)` of actions, up to a constant."""
        away = (acted - self.actor(seen)) / self.log_std.exp()
        density: torch.Tensor = -(0.5 * away.square() + self.log_std).sum(-1)
        return density

    def value(self, seen: torch.Tensor) -> torch.Tensor:
        """The values `(n,)`."""
        values: torch.Tensor = self.critic(seen).squeeze(-1)
        return values

    def predict(self, observation: Array, state: Any = None, _start: Any = None) -> tuple[Array, Any]:
        """The mean action, as evaluations take it."""
        with torch.no_grad():
            return self.actor(self.normalise(observation)).clamp(-1.0, 1.0).numpy(), state


def network(n_in: int, width: int, n_out: int, last_gain: float) -> nn.Sequential:
    """Two hidden layers with orthogonal weights."""
    layers = [nn.Linear(n_in, width), nn.Linear(width, width), nn.Linear(width, n_out)]
    for layer, gain in zip(layers, (2**0.5, 2**0.5, last_gain), strict=True):
        nn.init.orthogonal_(layer.weight, gain)
        nn.init.zeros_(layer.bias)
    return nn.Sequential(layers[0], nn.Tanh(), layers[1], nn.Tanh(), layers[2])


class Rollouts:
    """Rovers that drive, and the last `n_steps` decisions of each.

    Attributes:
        recent: Success, return and length of the last 200 episodes.
        seen: Normalised observations `(n_steps, num_envs, size)`; likewise actions, and `(n_steps, num_envs)`
            logarithms of their probabilities, values, scaled rewards and whether the episode ended.
    """

    def __init__(self, task: str, given: Hyperparameters, seed: int) -> None:
        name, arguments, _ = TASKS[task]
        n, length = given.num_envs, given.n_steps
        self.given = given
        self.envs = gym.make_vec(
            name,
            n,
            threads=1,
            max_episode_steps=given.max_episode_steps,
            autoreset_mode="SameStep",
            **DECISIONS,
            **COARSE,
            **arguments,
        )
        self.n_seen: int = self.envs.single_observation_space.shape[0]  # type: ignore[index]
        self.n_actions: int = self.envs.single_action_space.shape[0]  # type: ignore[index]
        self.recent: deque[tuple[bool, float, float]] = deque(maxlen=200)
        self.returns, self.return_scale = np.zeros(n), RunningScale(np.zeros(1))
        self.earned, self.lasted = np.zeros(n), np.zeros(n)
        self.seen = torch.zeros(length, n, self.n_seen)
        self.acted = torch.zeros(length, n, self.n_actions)
        self.log_probabilities, self.values, self.rewards, self.ended = (torch.zeros(length, n) for _ in range(4))
        self.observation, _ = self.envs.reset(seed=seed)

    def collect(self, agent: Agent) -> None:
        """Drives `n_steps` decisions."""
        given = self.given
        for t in range(given.n_steps):
            agent.scale.update(self.observation)
            with torch.no_grad():
                self.seen[t] = agent.normalise(self.observation)
                self.acted[t] = agent.sample(self.seen[t])
                self.log_probabilities[t] = agent.log_probability(self.seen[t], self.acted[t])
                self.values[t] = agent.value(self.seen[t])
            actions = self.acted[t].clamp(-1.0, 1.0).numpy()
            self.observation, reward, terminated, truncated, infos = self.envs.step(actions)
            over = terminated | truncated
            # Rewards are divided by the deviation of the discounted return, as VecNormalize does.
            self.returns = self.returns * given.gamma + reward
            self.return_scale.update(self.returns[:, None])
            scaled = (reward / np.sqrt(self.return_scale.variance[0] + 1e-8)).clip(-10.0, 10.0)
            self.earned, self.lasted = self.earned + reward, self.lasted + 1.0
            for i in np.flatnonzero(over):
                if not terminated[i]:  # the time limit cuts an episode that would have gone on
                    with torch.no_grad():
                        scaled[i] += given.gamma * agent.value(agent.normalise(infos["final_obs"][i][None])).item()
                self.recent.append((bool(infos["final_info"]["is_success"][i]), self.earned[i], self.lasted[i]))
            self.rewards[t], self.ended[t] = torch.as_tensor(scaled), torch.as_tensor(over)
            self.returns[over] = self.earned[over] = self.lasted[over] = 0.0

    def advantages(self, agent: Agent) -> torch.Tensor:
        """Generalised advantage estimates `(n_steps, num_envs)`."""
        given, advantages = self.given, torch.zeros_like(self.values)
        with torch.no_grad():
            following, advantage = agent.value(agent.normalise(self.observation)), torch.zeros(given.num_envs)
            for t in reversed(range(given.n_steps)):
                going_on = 1.0 - self.ended[t]
                error = self.rewards[t] + given.gamma * following * going_on - self.values[t]
                advantage = error + given.gamma * given.gae_lambda * going_on * advantage
                advantages[t], following = advantage, self.values[t]
        return advantages


def improve(agent: Agent, optimizer: torch.optim.Optimizer, rollouts: Rollouts) -> None:
    """Makes one update: `n_epochs` passes over the decisions with the clipped loss."""
    given, advantages = rollouts.given, rollouts.advantages(agent)
    n = given.num_envs * given.n_steps
    parts = (rollouts.seen, rollouts.acted, rollouts.log_probabilities, advantages, advantages + rollouts.values)
    flat = [part.reshape(n, *part.shape[2:]) for part in parts]
    for _ in range(given.n_epochs):
        for batch in torch.randperm(n).reshape(-1, given.batch_size):
            seen, acted, old, gains, aims = (part[batch] for part in flat)
            gains = (gains - gains.mean()) / (gains.std() + 1e-8)
            ratio = (agent.log_probability(seen, acted) - old).exp()
            clipped = ratio.clamp(1.0 - given.clip_range, 1.0 + given.clip_range)
            policy_loss = -torch.min(gains * ratio, gains * clipped).mean()
            loss = policy_loss + given.vf_coef * (agent.value(seen) - aims).square().mean()
            optimizer.zero_grad()
            loss.backward()  # type: ignore[no-untyped-call] # PyTorch gives it no types
            nn.utils.clip_grad_norm_(agent.parameters(), given.max_grad_norm)
            optimizer.step()


def evaluate(agent: Agent, task: str, episodes: int, folder: Path) -> None:
    """Drives the agent over fields that the training has not seen, and writes and prints how often it succeeds."""
    ground = {} if task == "plane" else {"terrain": "rocks"}
    arguments = {**DECISIONS, **ground, **TASKS[task][1]}
    drives = drive_all(lambda _env: agent, range(1_000_000, 1_000_000 + episodes), arguments=arguments)
    summary = summarise("cleanrl_ppo", drives)
    (folder / "evaluation.json").write_text(json.dumps(asdict(summary), indent=2) + "\n", encoding="utf-8")
    low, high = summary.success.interval
    typer.echo(f"held-back fields: {summary.successes} of {episodes} ({100 * low:.1f} to {100 * high:.1f}%)")


@plain_errors
def train(
    task: Annotated[str, typer.Option(help="plane or rocks.")] = "plane",
    seed: Annotated[int, typer.Option(min=0, max=998, help="Seed of network, exploration and fields.")] = 1,
    output: Annotated[
        Path | None, typer.Option(file_okay=False, help="The run's folder; runs/cleanrl/TASK-seedN if not given.")
    ] = None,
    steps: Annotated[int | None, typer.Option(min=1, help="Decisions in total, instead of the task's.")] = None,
    episodes: Annotated[int, typer.Option(min=1, help="Fields of the final evaluation.")] = 200,
) -> None:
    """Train and evaluate."""
    if task not in TASKS:
        refuse(OptionError, "task", task, f"must be one of {', '.join(TASKS)}")
    given = Hyperparameters()
    folder = output or Path("runs") / "cleanrl" / f"{task}-seed{seed}"
    folder.mkdir(parents=True, exist_ok=True)
    torch.manual_seed(1000 * seed)
    torch.set_num_threads(1)
    start = time.perf_counter()

    rollouts = Rollouts(task, given, 1000 * seed)
    agent = Agent(rollouts.n_seen, rollouts.n_actions, given)
    optimizer = torch.optim.Adam(agent.parameters(), lr=given.learning_rate, eps=1e-5)
    rows: list[tuple[float, ...]] = []
    decisions_per_update = given.num_envs * given.n_steps
    n_updates = -(-(TASKS[task][2] if steps is None else steps) // decisions_per_update)
    for update in range(n_updates):
        fraction = update / n_updates
        optimizer.param_groups[0]["lr"] = given.learning_rate + fraction * (
            given.final_learning_rate - given.learning_rate
        )
        rollouts.collect(agent)
        improve(agent, optimizer, rollouts)
        if rollouts.recent:
            decisions = (update + 1) * decisions_per_update
            success, mean_return, mean_length = np.array(rollouts.recent, np.float64).mean(axis=0)
            rows.append((decisions, success, mean_return, mean_length, time.perf_counter() - start))
            typer.echo(f"{decisions} decisions: {100 * success:.0f}% of the last episodes, return {mean_return:.1f}")

    rollouts.envs.close()
    with (folder / "curve.csv").open("w", encoding="utf-8", newline="") as file:
        csv.writer(file).writerows([("decisions", "success", "return", "length", "wall_seconds"), *rows])
    scale = {"mean": agent.scale.mean, "variance": agent.scale.variance}
    torch.save({"agent": agent.state_dict(), "scale": scale}, folder / "agent.pt")
    evaluate(agent, task, episodes, folder)
    say_path("policy", folder)


if __name__ == "__main__":
    typer.run(train)
