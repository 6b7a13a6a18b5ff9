"""Who drives, by name: the policies of `rover_gym.policy`, and the planner with futures."""

from rover_gym.mechanics import RoverModel
from rover_gym.planning.planner_policy import PlannerPolicy
from rover_gym.policy.named_policy import NAMES_HELP, NamedPolicy, named_policy, policy_title

DRIVERS_HELP = f"{NAMES_HELP[:-1]}; 'planner' tries out futures in the simulator, see the manual's page on policies."


def named_driver(name: str, terrain: str, model: RoverModel | None = None) -> NamedPolicy:
    """The policy of a name, as `named_policy` takes it, or "planner".

    Raises:
        PolicyError: There is no such policy.
        OSError: A file may not be read.
    """
    return NamedPolicy({}, PlannerPolicy) if name == "planner" else named_policy(name, terrain, model)


def driver_title(name: str) -> str:
    """What a driver is, as a heading says it."""
    return "the planner with futures" if name == "planner" else policy_title(name)
