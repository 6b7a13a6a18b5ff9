"""Reproduction of the 2010 report: the rover of sections 6.1 and 6.2 and the balls of chapter 3."""

from rover_gym.reproduction.scene_runs import ReportScene, SceneResult, inclined_plane, report_model, sphere_rug

__all__ = [
    "ReportScene",
    "SceneResult",
    "inclined_plane",
    "report_model",
    "sphere_rug",
]
