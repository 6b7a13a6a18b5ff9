"""The cards of the environments, each a page of its own.

A class that is registered once has its docstring as its card. What is registered with other arguments has a short one.
"""

import inspect

import gymnasium as gym

import rover_gym  # noqa: F401 - registers the environments
from rover_gym import RoverEnv
from rover_gym.envs import RoverGrainsEnv
from rover_gym.envs.registration import ENVIRONMENTS
from rover_gym.envs.several.pettingzoo_env import RoverParallelEnv
from rover_gym.envs.tasks import RoverArcsEnv, RoverCommandEnv, RoverGoalEnv, RoverTrapEnv

#: Environments whose docstring is a card, by name.
CARDS = {
    "Rover-v0": RoverEnv,
    "RoverGrains-v0": RoverGrainsEnv,
    "RoverArcs-v0": RoverArcsEnv,
    "RoverCommand-v0": RoverCommandEnv,
    "RoverGoal-v0": RoverGoalEnv,
    "RoverTrap-v0": RoverTrapEnv,
    "rovers_v0": RoverParallelEnv,
}

#: The others: the task, and where the manual says more.
TASKS = {
    "RoverRocks-v0": (
        "Drive to a goal among rocks on a slope. `difficulty` (0 to 2) sets the number and size of the rocks.",
        "[the ground and the policies](../policies.md), [results](../policy-results.md)",
    ),
    "RoverHills-v0": (
        "Drive to a goal over hills with craters and rocks. `difficulty` (0 to 2) sets how rough they are.",
        "[the policies](../policies.md), [results](../policy-results.md)",
    ),
    "RoverSand-v0": (
        "Drive to a goal on dry sand, among ripples and rocks. Its wide wheels sink in and leave ruts. "
        "`soil` chooses the sand.",
        "[sand](../sand.md#drive-to-a-goal-on-sand)",
    ),
    "RoverWaypoints-v0": (
        "Reach five goals in order. The observation also holds the next goal and how many remain.",
        "[waypoints](../tasks.md#waypoints)",
    ),
    "RoverBattery-v0": (
        "Reach a goal among rocks before the battery is empty. The observation also holds the charge.",
        "[batteries](../tasks.md#battery)",
    ),
}


def task_card(name: str) -> str:
    """The card of an environment that is `RoverEnv` with other arguments."""
    task, more = TASKS[name]
    env = gym.make(name)
    layout = env.unwrapped.observation_layout  # type: ignore[attr-defined]
    arguments = ", ".join(f"{key}={value!r}" for key, value in ENVIRONMENTS[name].arguments.items())
    rows = [
        ("action", f"{env.action_space.shape[0]} numbers from -1 to 1: torques of the wheels, steering angles"),  # type: ignore[index]
        ("observation", f"{env.observation_space.shape[0]} numbers: {', '.join(f'`{field}`' for field in layout)}"),  # type: ignore[index]
        ("end", f"goal reached, rolled over, high-centred, or {env.spec.max_episode_steps} steps of 0.05 s"),  # type: ignore[union-attr]
        ("registered as", f"`RoverEnv({arguments})`"),
    ]
    env.close()
    lines = ["| | |", "|---|---|", *(f"| {label} | {text} |" for label, text in rows)]
    table = "\n".join(lines)
    return (
        f"# {name}\n\n{task}\n\n{table}\n\n"
        f"Action, observation, reward and all arguments are those of [`Rover-v0`](rover-v0.md). More: {more}.\n"
    )


def pages() -> dict[str, str]:
    """Text of each card's page by its file's name."""
    long = {f"{name.lower()}.md": f"# {name}\n\n{inspect.getdoc(card)}\n" for name, card in CARDS.items()}
    return long | {f"{name.lower()}.md": task_card(name) for name in TASKS}
