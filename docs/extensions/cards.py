"""The cards of the environments: docstrings in Markdown, each a page of its own."""

import inspect

from rover_gym import RoverEnv
from rover_gym.env import RoverGrainsEnv
from rover_gym.policy import RoverArcsEnv, RoverCommandEnv, RoverGoalEnv, RoverTrapEnv

#: Environments whose docstring is a card, by name.
CARDS = {
    "Rover-v0": RoverEnv,
    "RoverGrains-v0": RoverGrainsEnv,
    "RoverArcs-v0": RoverArcsEnv,
    "RoverCommand-v0": RoverCommandEnv,
    "RoverGoal-v0": RoverGoalEnv,
    "RoverTrap-v0": RoverTrapEnv,
}


def pages() -> dict[str, str]:
    """Text of each card's page by its file's name."""
    return {f"{name.lower()}.md": f"# {name}\n\n{inspect.getdoc(card)}\n" for name, card in CARDS.items()}
