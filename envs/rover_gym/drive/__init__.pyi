from .arcs.arc_network import ArcNetwork as ArcNetwork
from .arcs.arc_network_policy import ArcNetworkPolicy as ArcNetworkPolicy
from .arcs.guided_policy import GuidedPolicy as GuidedPolicy
from .benchmark import (
    BenchmarkResult as BenchmarkResult,
    Interface as Interface,
    ScoredEpisode as ScoredEpisode,
    ScoredSet as ScoredSet,
    score_set as score_set,
)
from .benchmark_sets import (
    HELD_BACK_SEEDS as HELD_BACK_SEEDS,
    BenchmarkSet as BenchmarkSet,
    benchmark_sets as benchmark_sets,
    check_training_model as check_training_model,
    check_training_seeds as check_training_seeds,
)
from .commands.command import CommandController as CommandController, CommandLimits as CommandLimits
from .commands.driven import ObservingPolicy as ObservingPolicy, Policy as Policy
from .commands.features import Features as Features
from .commands.wheel_kinematics import WheelCommands as WheelCommands, WheelKinematics as WheelKinematics
from .evaluation import (
    ENDS as ENDS,
    Episode as Episode,
    EvaluatedEpisode as EvaluatedEpisode,
    IntervalEstimate as IntervalEstimate,
    PolicySummary as PolicySummary,
    drive_all as drive_all,
    mean_estimate as mean_estimate,
    ratio_estimate as ratio_estimate,
    run_episode as run_episode,
    summarise as summarise,
    wilson_interval as wilson_interval,
)
from .forecast.arc_forecast import FORECAST_FILE as FORECAST_FILE, ForesightCosts as ForesightCosts
from .forecast.network_files import Network as Network, PolicyError as PolicyError
from .named_policy import NamedPolicy as NamedPolicy, named_policy as named_policy
from .pd.pd_policy import PDGains as PDGains, PDPolicy as PDPolicy
from .pd.sand_policy import SandGains as SandGains, SandPolicy as SandPolicy
from .planning.planner_policy import PlannerOptions as PlannerOptions, PlannerPolicy as PlannerPolicy
from .planning.rollouts import Ends as Ends, Rollouts as Rollouts
from .scan.scan_policy import ScanGains as ScanGains, ScanPolicy as ScanPolicy
from .search.arc_search import PathCosts as PathCosts
from .search.field_plan import FieldPlan as FieldPlan
from .search.ground_map import MapOptions as MapOptions
