"""PPO on raw actions in one file, in the style of CleanRL: PyTorch and `gymnasium.make_vec`, no trainer's library.

python training/examples/single_file.py --steps 500000 --seed 1
"""

from typing import Any

import gymnasium as gym
import numpy as np
import torch
import typer
from torch import nn

import rover_gym  # noqa: F401 - registers the environments

N, LENGTH, GAMMA, LAMBDA = 64, 64, 0.97, 0.95  # rovers, decisions of each in a rollout
SOLVER = {"tolerance": 1e-4, "max_iterations": 20}
ROVERS: dict[str, Any] = {"control_frequency": 5.0, "time_step": 0.02, "solver_options": SOLVER, "threads": 1}


def network(n_in: int, n_out: int, gain: float) -> nn.Sequential:
    """Two hidden layers with orthogonal weights."""
    layers = [nn.Linear(n_in, 64), nn.Linear(64, 64), nn.Linear(64, n_out)]
    for layer, size in zip(layers, (2**0.5, 2**0.5, gain), strict=True):
        nn.init.orthogonal_(layer.weight, size)
        nn.init.zeros_(layer.bias)
    return nn.Sequential(layers[0], nn.Tanh(), layers[1], nn.Tanh(), layers[2])


def train(steps: int = 500_000, seed: int = 1) -> None:
    """Train, and print the success of the last episodes after each rollout."""
    torch.manual_seed(seed)
    torch.set_num_threads(1)
    envs = gym.make_vec("Rover-v0", N, max_episode_steps=150, autoreset_mode="SameStep", **ROVERS)
    n_seen, n_actions = envs.single_observation_space.shape[0], envs.single_action_space.shape[0]  # type: ignore[index]
    actor, critic = network(n_seen, n_actions, 0.01), network(n_seen, 1, 1.0)
    log_std = nn.Parameter(torch.full((n_actions,), -1.0))
    parameters = [*actor.parameters(), *critic.parameters(), log_std]
    optimizer = torch.optim.Adam(parameters, lr=1e-3, eps=1e-5)
    # `NormalizeObservation` and `NormalizeReward` of Gymnasium do this for a vector, too.
    seen = gym.wrappers.utils.RunningMeanStd(shape=(n_seen,))
    returns, spread = np.zeros(N), gym.wrappers.utils.RunningMeanStd()

    def normal(observation: Any) -> torch.Tensor:
        scaled = (observation - seen.mean) / np.sqrt(seen.var + 1e-8)
        return torch.as_tensor(scaled.clip(-5.0, 5.0), dtype=torch.float32)

    def density(x: torch.Tensor, action: torch.Tensor) -> torch.Tensor:
        likelihood: torch.Tensor = torch.distributions.Normal(actor(x), log_std.exp()).log_prob(action).sum(-1)
        return likelihood

    observation, _ = envs.reset(seed=seed)
    recent: list[bool] = []
    rollouts = -(-steps // (N * LENGTH))
    for k in range(rollouts):
        optimizer.param_groups[0]["lr"] = 1e-3 - 8e-4 * k / rollouts
        x, acted = torch.zeros(LENGTH, N, n_seen), torch.zeros(LENGTH, N, n_actions)
        rewards, ended, values = torch.zeros(3, LENGTH, N)
        with torch.no_grad():
            for t in range(LENGTH):
                seen.update(observation)
                x[t] = normal(observation)
                values[t] = critic(x[t])[:, 0]
                acted[t] = actor(x[t]) + log_std.exp() * torch.randn(N, n_actions)
                observation, reward, stopped, cut, infos = envs.step(acted[t].clamp(-1.0, 1.0).numpy())
                returns = returns * GAMMA + reward
                spread.update(returns)
                scaled = (reward / np.sqrt(spread.var + 1e-8)).clip(-10.0, 10.0)
                for i in np.flatnonzero(stopped | cut):
                    recent.append(bool(infos["final_info"]["is_success"][i]))
                    if not stopped[i]:  # the time limit cuts an episode that would have gone on
                        scaled[i] += GAMMA * critic(normal(infos["final_obs"][i])).item()
                returns[stopped | cut] = 0.0
                rewards[t], ended[t] = torch.as_tensor(scaled), torch.as_tensor(stopped | cut)
            following, advantage, advantages = critic(normal(observation))[:, 0], torch.zeros(N), torch.zeros(LENGTH, N)
            for t in reversed(range(LENGTH)):
                error = rewards[t] + GAMMA * following * (1.0 - ended[t]) - values[t]
                advantages[t] = advantage = error + GAMMA * LAMBDA * (1.0 - ended[t]) * advantage
                following = values[t]
            old = density(x, acted)
        flat = [part.flatten(0, 1) for part in (x, acted, old, advantages, advantages + values)]
        for _ in range(6):
            for batch in torch.randperm(N * LENGTH).reshape(-1, 1024):
                bx, action, before, gain, aim = (part[batch] for part in flat)
                gain = (gain - gain.mean()) / (gain.std() + 1e-8)
                ratio = (density(bx, action) - before).exp()
                loss = -torch.min(gain * ratio, gain * ratio.clamp(0.8, 1.2)).mean()
                loss = loss + 0.5 * (critic(bx)[:, 0] - aim).square().mean()
                optimizer.zero_grad()
                loss.backward()
                nn.utils.clip_grad_norm_(parameters, 0.5)
                optimizer.step()
        if recent:
            typer.echo(f"{(k + 1) * N * LENGTH} decisions: {np.mean(recent[-200:]):.0%} of the last episodes")
    envs.close()


if __name__ == "__main__":
    typer.run(train)
