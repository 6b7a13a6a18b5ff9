from .economies import Economy as Economy, measure_economies as measure_economies
from .incline import Incline as Incline, ball_on_slope as ball_on_slope
from .planner import plan as plan
from .report_scenes import (
    ReportScene as ReportScene,
    SceneResult as SceneResult,
    inclined_plane as inclined_plane,
    report_model as report_model,
    sphere_rug as sphere_rug,
)
from .scene_plan import (
    Accuracy as Accuracy,
    Decision as Decision,
    PlannedRover as PlannedRover,
    Scene as Scene,
    ScenePlan as ScenePlan,
)
