"""Plans simulations, and plans with them.

`plan` chooses the cheapest simulation of a scene, that is model, ground, time-stepping scheme and step size, from its
description.

    >>> from rover_gym import Plane
    >>> from rover_gym.planning import Scene, plan
    >>> straight = plan(Scene(Plane(), steered=False, equal_torques=True), accuracy="balanced")
    >>> straight.kind
    'planar'
    >>> rover = straight.rover()
    >>> rover.set_wheel_torques([15.0] * 6)
    >>> rover.step(200).is_converged
    True

A scene states what will never happen in it, and the plan leaves out only what that permits. A command that needs a part
left out is refused. `docs/economy.md` gives the error and the cost of each economy, and the command that measures them.

`PlannerPolicy` drives a rover by planning: `FieldPlan` knows the way over a whole field, `Futures` drives copies of the
rover by many sequences of commands (`docs/planning.md`).
"""

from rover_gym.planning.economy import Economy, measure_economies
from rover_gym.planning.field_plan import FieldPlan
from rover_gym.planning.futures import Ends, Futures
from rover_gym.planning.planner import plan
from rover_gym.planning.planner_policy import PlannerOptions, PlannerPolicy
from rover_gym.planning.scene_plan import Accuracy, Decision, PlannedRover, Scene, ScenePlan

__all__ = [
    "Accuracy",
    "Decision",
    "Economy",
    "Ends",
    "FieldPlan",
    "Futures",
    "PlannedRover",
    "PlannerOptions",
    "PlannerPolicy",
    "Scene",
    "ScenePlan",
    "measure_economies",
    "plan",
]
