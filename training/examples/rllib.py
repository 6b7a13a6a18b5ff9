"""Trains Rover-v0 by commands with Ray RLlib's PPO, each env runner with several rovers in one vector of the core.

    python training/examples/rllib.py --workers 2                       # a Ray of its own on this machine
    python training/examples/rllib.py --workers 32 --address auto       # the cluster that this machine belongs to
    python training/examples/rllib.py --resume --iterations 40          # go on from the checkpoint
    python training/examples/rllib.py --rovers 3                        # three in each scene, which share a policy

Needs the extra `rllib`, which pins its own Gymnasium: use a separate virtual environment (`make train-rllib`).
"""

import math
import shutil
from pathlib import Path
from typing import Any

import gymnasium as gym
import ray
import typer
from ray.rllib.algorithms.ppo import PPOConfig
from ray.rllib.env.multi_agent_env import MultiAgentEnv
from ray.rllib.utils.metrics import ENV_RUNNER_RESULTS, EPISODE_RETURN_MEAN
from ray.tune.registry import register_env


def make_rovers(config: dict[str, Any]) -> gym.Env[Any, Any] | gym.vector.VectorEnv[Any, Any, Any]:
    """Makes an env runner's rovers: RLlib gives `num_envs` where `gym_env_vectorize_mode` is "vector_entry_point".

    Ray sends this function to processes that have not imported the package, so the id names the module to import.
    """
    arguments = dict(config)
    n = arguments.pop("num_envs", None)
    name = "rover_gym:RoverCommand-v0"
    return gym.make(name, **arguments) if n is None else gym.make_vec(name, n, **arguments)


class Scene(MultiAgentEnv):  # type: ignore[misc]
    """Several rovers in one scene, driven by commands, as RLlib takes them."""

    def __init__(self, config: dict[str, Any]) -> None:
        super().__init__()
        from rover_gym import parallel_env  # noqa: PLC0415 - Ray sends this class to processes without the package
        from rover_gym.envs.tasks.commanded_rovers import DriveRoversByCommand  # noqa: PLC0415

        self.scene = DriveRoversByCommand(parallel_env(**config))
        self.possible_agents = self.agents = list(self.scene.possible_agents)
        self.observation_spaces = {agent: self.scene.observation_space(agent) for agent in self.agents}
        self.action_spaces = {agent: self.scene.action_space(agent) for agent in self.agents}

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, Any]:
        """Starts a scene."""
        observations, infos = self.scene.reset(seed=seed, options=options)
        self.agents = list(self.scene.agents)
        return observations, infos

    def step(self, actions: dict[str, Any]) -> tuple[Any, ...]:
        """Holds the commands of the rovers whose episodes run; the scene ends with the last of them.

        RLlib takes agents that are truncated one by one for terminated, so the time limit is one of the scene.
        """
        observations, rewards, terminated, truncated, infos = self.scene.step(actions)
        self.agents = list(self.scene.agents)
        is_cut = any(truncated.values())
        ends = {**terminated, "__all__": not self.agents and not is_cut}
        return observations, rewards, ends, {"__all__": is_cut}, infos


def configuration(
    workers: int, envs: int, batch: int, environment: dict[str, Any], seed: int, *, shares: bool = False
) -> PPOConfig:
    """PPO over env runners that each step `envs` rovers or scenes, and that are replaced if they die.

    `shares`: whether the environment has several rovers, which share a policy.
    """
    vectors: dict[str, Any] = {"num_envs_per_env_runner": envs}
    if not shares:
        vectors["gym_env_vectorize_mode"] = "vector_entry_point"
    rates = {"lr": 1e-3, "gamma": 0.97, "lambda_": 0.95, "minibatch_size": min(512, batch), "num_epochs": 6}
    config = PPOConfig().environment("Rover", env_config=environment).framework("torch").debugging(seed=seed)
    config = config.env_runners(num_env_runners=workers, num_cpus_per_env_runner=1, **vectors)
    config = config.fault_tolerance(restart_failed_env_runners=True)
    if shares:
        config = config.multi_agent(policies={"driver"}, policy_mapping_fn=lambda *_, **__: "driver")
    return config.learners(num_learners=0).training(train_batch_size_per_learner=batch, **rates)


def keep(algorithm: Any, checkpoint: Path) -> None:
    """Replaces the checkpoint by one of now, which is whole before the former is removed."""
    new = checkpoint.with_name("checkpoint.new")
    shutil.rmtree(new, ignore_errors=True)
    algorithm.save_to_path(new)
    shutil.rmtree(checkpoint, ignore_errors=True)
    new.rename(checkpoint)


def train(
    workers: int = 2,
    envs: int = 8,
    iterations: int = 20,
    batch: int = 2048,
    seed: int = 1,
    rocks: bool = False,
    rovers: int = 1,
    address: str | None = None,
    output: Path = Path("runs/rllib"),
    resume: bool = False,
) -> None:
    """Train, write a checkpoint after every iteration, and print the return and the decisions a second."""
    ray.init(address=address, log_to_driver=False)
    register_env("Rover", make_rovers if rovers == 1 else Scene)
    environment = {"threads": 1, **({"terrain": "rocks", "difficulty": 0.5, "height_scan": True} if rocks else {})}
    environment |= {} if rovers == 1 else {"rovers": rovers}
    algorithm = configuration(workers, envs, batch, environment, seed, shares=rovers > 1).build_algo()
    checkpoint = (output / "checkpoint").absolute()
    if resume:
        algorithm.restore_from_path(checkpoint)
    while algorithm.iteration < iterations:
        result = algorithm.train()
        found, seconds = result[ENV_RUNNER_RESULTS], float(result["timers"]["env_runner_sampling_timer"])
        rate = found["num_env_steps_sampled"] / seconds
        alive = algorithm.env_runner_group.num_healthy_remote_workers()
        keep(algorithm, checkpoint)
        mean = found.get(EPISODE_RETURN_MEAN, math.nan)  # missing at first, and nan where no episode has ended
        outcome = f"return {mean:.2f}" if math.isfinite(mean) else "no episode has ended"
        typer.echo(
            f"iteration {algorithm.iteration}: {outcome}, {rate:.0f} decisions/s while sampling, {alive} workers"
        )
    algorithm.stop()
    ray.shutdown()


if __name__ == "__main__":
    typer.run(train)
