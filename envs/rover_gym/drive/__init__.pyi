from .arc_forecast import FORECAST_FILE, ForesightCosts
from .arc_network import ArcNetwork
from .arc_network_policy import ArcNetworkPolicy
from .arc_search import PathCosts
from .command import CommandController, CommandLimits
from .evaluation import (
    ENDS,
    Episode,
    EvaluatedEpisode,
    IntervalEstimate,
    PolicySummary,
    drive_all,
    mean_estimate,
    ratio_estimate,
    run_episode,
    summarise,
    wilson_interval,
)
from .features import Features
from .field_plan import FieldPlan
from .ground_map import MapOptions
from .guided_policy import GuidedPolicy
from .named_policy import NamedPolicy, Policy, named_policy
from .network_files import Network, PolicyError
from .pd_policy import PDGains, PDPolicy
from .planner_policy import PlannerOptions, PlannerPolicy
from .rollouts import Ends, Rollouts
from .sand_policy import SandGains, SandPolicy
from .scan_policy import ScanGains, ScanPolicy

__all__ = [
    "ENDS",
    "FORECAST_FILE",
    "ArcNetwork",
    "ArcNetworkPolicy",
    "CommandController",
    "CommandLimits",
    "Ends",
    "Episode",
    "EvaluatedEpisode",
    "Features",
    "FieldPlan",
    "ForesightCosts",
    "GuidedPolicy",
    "IntervalEstimate",
    "MapOptions",
    "NamedPolicy",
    "Network",
    "PDGains",
    "PDPolicy",
    "PathCosts",
    "PlannerOptions",
    "PlannerPolicy",
    "Policy",
    "PolicyError",
    "PolicySummary",
    "Rollouts",
    "SandGains",
    "SandPolicy",
    "ScanGains",
    "ScanPolicy",
    "drive_all",
    "mean_estimate",
    "named_policy",
    "ratio_estimate",
    "run_episode",
    "summarise",
    "wilson_interval",
]
