"""The manual's page on clusters, command by command, on Ray's own test cluster: two nodes of one core on this machine.

    .venv-rllib/bin/python tests/training/two_nodes.py FOLDER

Workers are killed while they evaluate and train. Only what starts the cluster is not run. Ray has an environment of its
own, without pytest, so this is a program: it ends with an error where something is not as the page says.
"""

import json
import os
import re
import secrets
import shlex
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import ray
from ray.cluster_utils import Cluster
from ray.rllib.env.multi_agent_env_runner import MultiAgentEnvRunner
from ray.rllib.env.single_agent_env_runner import SingleAgentEnvRunner

from rover_gym import PDPolicy
from rover_gym.drive import drive_all
from rover_gym.envs.vector import RoverVectorEnv
from rover_gym.learn.arc_config import read_arc_config
from rover_gym.learn.arc_rovers import Rovers

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "cluster.md").read_text(encoding="utf-8")
EPISODES = 64
#: What the page asks for, and what this asks for instead.
SMALLER = {
    "--episodes 10000": f"--episodes {EPISODES}",
    "train anywhere": "train tiny.yaml --output labels",
    "--iterations 20": "--iterations 4 --envs 2 --batch 128",
    "--iterations 40": "--iterations 6 --envs 2 --batch 128",
    "--workers 32": "--workers 2",
    "python training/": f"python {ROOT}/training/",
}
TINY = """
scenes:
  plane: {environment: {terrain: plane, goal_distance: 2}}
  rocks: {environment: {terrain: rocks, goal_distance: 2}}
rovers: 4
group: 2
imitation: {rounds: 2, decisions: 60, epochs: 1, batch_size: 16}
ppo: null
evaluation: {scenes: {near: {terrain: plane, goal_distance: 2}}, fields: 40}
"""


def say(text: str) -> None:
    """Prints at once."""
    sys.stdout.write(text)
    sys.stdout.flush()


def blocks(kind: str) -> list[str]:
    """The page's blocks of a kind."""
    return re.findall(rf"^```{kind}\n(.*?)^```$", PAGE, flags=re.MULTILINE | re.DOTALL)


def commands() -> list[str]:
    """The page's commands, made small."""
    text = "".join(blocks("console"))
    for asked, smaller in SMALLER.items():
        assert asked in text, f"the page does not say {asked!r} any more"
        text = text.replace(asked, smaller)
    return text.splitlines()


def children(node: Any, name: str) -> list[int]:
    """The processes of a node that run a task or an actor."""
    raylet = str(node.all_processes["raylet"][0].process.pid)
    found = []
    for folder in Path("/proc").glob("[0-9]*"):
        try:
            parent = (folder / "stat").read_text(encoding="utf-8").rpartition(")")[2].split()[1]
            if parent == raylet and (folder / "cmdline").read_bytes().startswith(f"ray::{name}".encode()):
                found.append(int(folder.name))
        except OSError:
            continue  # it has ended
    return found


def run(
    command: str,
    on_line: Callable[[str], None] = lambda _line: None,
    meanwhile: Callable[[], None] = lambda: None,
) -> list[str]:
    """Runs a command of the page; `meanwhile` once it has begun, `on_line` for each line that it prints."""
    program, *arguments = shlex.split(command)
    start = {"python": [], "rover": ["-c", "from rover_gym.cli import main; main()"]}[program]
    say(f"$ {command}\n")
    lines = []
    with subprocess.Popen([sys.executable, *start, *arguments], stdout=subprocess.PIPE, text=True) as process:
        meanwhile()
        for line in process.stdout or ():
            say(line)
            lines.append(line.rstrip())
            on_line(line)
    assert process.returncode == 0, f"{command}: {process.returncode}"
    return lines


def kill_one(node: Any, name: str) -> None:
    """Kills a process of a node that runs a task or an actor, as soon as there is one."""
    end = time.monotonic() + 300.0
    while not (found := children(node, name)):
        assert time.monotonic() < end, f"no {name} on the second node"
        time.sleep(0.02)
    os.kill(found[0], signal.SIGKILL)
    say(f"killed {name}, process {found[0]}\n")


def check_evaluation(command: str, node: Any) -> None:
    """The episodes are those of one machine, though a task was killed."""
    run(command, meanwhile=lambda: kill_one(node, "_drive"))
    kept = json.loads(next(Path("runs/evaluation").glob("episodes-pd*.json")).read_text(encoding="utf-8"))
    assert len(kept["drives"]) == EPISODES
    first = kept["drives"][0]["seed"]
    here = drive_all(PDPolicy, range(first, first + 8), arguments=kept["key"]["environment"])
    assert [asdict(episode) for episode in here] == kept["drives"][:8]


def check_labels(command: str) -> None:
    """The labels of the first round are those of one process."""
    Path("tiny.yaml").write_text(TINY, encoding="utf-8")
    run(command)
    config = read_arc_config("tiny.yaml")
    rovers = Rovers(config)
    rovers.found(100, 0.5 / config.imitation.rounds)
    labels, _ = rovers.label(None, config.imitation.decisions, config.imitation.labelled, config.imitation.stray)
    with np.load("labels/labels-0.npz") as kept:
        assert set(kept) == set(labels)
        for name, values in labels.items():
            np.testing.assert_array_equal(kept[name], values)
    assert (Path("labels") / "labels-1.npz").is_file()


def check_training(first: str, second: str, node: Any) -> None:
    """RLlib trains on both nodes, goes on when one has lost its worker, and then from its checkpoint."""

    def on_line(line: str) -> None:
        if line.startswith("iteration 2:"):
            kill_one(node, "SingleAgentEnvRunner")

    def iterations(lines: list[str]) -> list[int]:
        return [int(found[1]) for line in lines if (found := re.match(r"iteration (\d+): .* workers$", line))]

    assert iterations(run(first, on_line)) == [1, 2, 3, 4]
    assert iterations(run(second)) == [5, 6]


def check_env_runner() -> None:
    """An env runner has one vector of the core, or scenes of several rovers."""
    sys.path.insert(0, str(ROOT / "training" / "examples"))
    import rllib  # noqa: PLC0415 - the example

    ray.tune.registry.register_env("Rover", rllib.make_rovers)
    config = rllib.configuration(workers=0, envs=4, batch=128, environment={"max_episode_steps": 20}, seed=1)
    runner = SingleAgentEnvRunner(config=config, worker_index=0)
    assert type(runner.env.unwrapped) is RoverVectorEnv
    assert runner.num_envs == 4
    episodes = runner.sample(num_timesteps=80, random_actions=True)
    assert sum(len(episode) for episode in episodes) >= 80
    assert any(episode.is_truncated for episode in episodes)
    ray.tune.registry.register_env("Rover", rllib.Scene)
    scenes = {"max_episode_steps": 20, "rovers": 3}
    config = rllib.configuration(workers=0, envs=2, batch=128, environment=scenes, seed=1, shares=True)
    episodes = MultiAgentEnvRunner(config=config).sample(num_timesteps=40)
    assert {len(episode.agent_episodes) for episode in episodes} == {3}
    assert any(episode.is_truncated and not episode.is_terminated for episode in episodes)


def start() -> tuple[Cluster, Any]:
    """The cluster and its second node; again, if the machine is so busy that Ray gives up its own start after 15 s."""
    for left in reversed(range(5)):
        cluster = Cluster()
        try:
            cluster.add_node(num_cpus=1, include_dashboard=False)
            return cluster, cluster.add_node(num_cpus=1)
        except Exception:
            say("Ray has not started\n")
            cluster.shutdown()
            if not left:
                raise
    raise AssertionError


def main(folder: Path) -> None:
    """Starts the cluster and goes through the page."""
    folder.mkdir(parents=True, exist_ok=True)
    os.chdir(folder)
    os.environ["RAY_AUTH_TOKEN"] = secrets.token_hex(16)
    cluster, node = start()
    try:
        os.environ["RAY_ADDRESS"] = cluster.address  # what "auto" then means
        evaluate, label, train, resume = commands()
        check_evaluation(evaluate, node)
        check_labels(label)
        check_training(train, resume, node)
        for code in blocks("python"):
            exec(compile(code, "docs/cluster.md", "exec"), {"__name__": "__main__"})  # noqa: S102 - that is the page
        assert len([one for one in ray.nodes() if one["Alive"]]) == 2
        check_env_runner()
        ray.shutdown()
    finally:
        cluster.shutdown()
    say("the page holds\n")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
