from .arc_forecast import FORECAST_FILE as FORECAST_FILE, ForesightCosts as ForesightCosts
from .arc_network import ArcNetwork as ArcNetwork
from .arc_network_policy import ArcNetworkPolicy as ArcNetworkPolicy
from .arc_search import PathCosts as PathCosts
from .command import CommandController as CommandController, CommandLimits as CommandLimits
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
from .features import Features as Features
from .field_plan import FieldPlan as FieldPlan
from .ground_map import MapOptions as MapOptions
from .guided_policy import GuidedPolicy as GuidedPolicy
from .named_policy import NamedPolicy as NamedPolicy, Policy as Policy, named_policy as named_policy
from .network_files import Network as Network, PolicyError as PolicyError
from .pd_policy import PDGains as PDGains, PDPolicy as PDPolicy
from .planner_policy import PlannerOptions as PlannerOptions, PlannerPolicy as PlannerPolicy
from .rollouts import Ends as Ends, Rollouts as Rollouts
from .sand_policy import SandGains as SandGains, SandPolicy as SandPolicy
from .scan_policy import ScanGains as ScanGains, ScanPolicy as ScanPolicy
