"""What a scene needs, and no more: from its description to the model, ground, scheme and step that are built for it.

    >>> from rover_gym import Plane
    >>> from rover_gym.planning import Scene, plan
    >>> straight = plan(Scene(Plane(), steered=False, equal_torques=True), accuracy="balanced")
    >>> straight.kind
    'planar'
    >>> rover = straight.rover()
    >>> rover.set_wheel_torques([15.0] * 6)
    >>> rover.step(200).is_converged
    True

A scene says what will never happen in it; whatever it leaves open is built. What was left out is refused when it is
asked for later. `docs/economy.md` has the error and the cost of each economy, and the command that measures them.
"""

from rover_gym.planning.economy import Economy, measure_economies
from rover_gym.planning.planner import plan
from rover_gym.planning.scene import Accuracy, Scene
from rover_gym.planning.scene_plan import Decision, PlannedRover, ScenePlan

__all__ = [
    "Accuracy",
    "Decision",
    "Economy",
    "PlannedRover",
    "Scene",
    "ScenePlan",
    "measure_economies",
    "plan",
]
