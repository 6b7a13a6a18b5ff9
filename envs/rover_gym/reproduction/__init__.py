"""The report of 2010, run again: its section 6.1 and 6.2 rover and the balls of its chapter 3."""

from rover_gym.reproduction.report_rover import report_model
from rover_gym.reproduction.scene_runs import SceneResult

__all__ = [
    "SceneResult",
    "report_model",
]
