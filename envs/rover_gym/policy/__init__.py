"""Policies: the PD baseline, the scan planner, trained networks, their commands, and their evaluation."""

from rover_gym.policy.arc_forecast import FORECAST_FILE, ForesightCosts
from rover_gym.policy.arc_network import ArcNetwork
from rover_gym.policy.arc_network_policy import ArcNetworkPolicy
from rover_gym.policy.arc_search import PathCosts
from rover_gym.policy.arcs_env import RoverArcsEnv, RoverArcsVectorEnv
from rover_gym.policy.command import CommandController, CommandLimits
from rover_gym.policy.command_env import CommandVectorEnv, DriveByCommand, RoverCommandEnv, RoverCommandVectorEnv
from rover_gym.policy.evaluation import (
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
from rover_gym.policy.features import Features
from rover_gym.policy.goal_env import GoalObservation, RoverGoalEnv, RoverGoalVectorEnv
from rover_gym.policy.ground_map import MapOptions
from rover_gym.policy.guided_policy import GuidedPolicy
from rover_gym.policy.named_policy import NamedPolicy, Policy, named_policy
from rover_gym.policy.network_files import Network, PolicyError
from rover_gym.policy.pd_policy import PDGains, PDPolicy
from rover_gym.policy.sand_policy import SandGains, SandPolicy
from rover_gym.policy.scan_policy import ScanGains, ScanPolicy
from rover_gym.policy.trap_env import RoverTrapEnv, RoverTrapVectorEnv, TrapBatch

__all__ = [
    "ENDS",
    "FORECAST_FILE",
    "ArcNetwork",
    "ArcNetworkPolicy",
    "CommandController",
    "CommandLimits",
    "CommandVectorEnv",
    "DriveByCommand",
    "Episode",
    "EvaluatedEpisode",
    "Features",
    "ForesightCosts",
    "GoalObservation",
    "GuidedPolicy",
    "IntervalEstimate",
    "MapOptions",
    "NamedPolicy",
    "Network",
    "PDGains",
    "PDPolicy",
    "PathCosts",
    "Policy",
    "PolicyError",
    "PolicySummary",
    "RoverArcsEnv",
    "RoverArcsVectorEnv",
    "RoverCommandEnv",
    "RoverCommandVectorEnv",
    "RoverGoalEnv",
    "RoverGoalVectorEnv",
    "RoverTrapEnv",
    "RoverTrapVectorEnv",
    "SandGains",
    "SandPolicy",
    "ScanGains",
    "ScanPolicy",
    "TrapBatch",
    "drive_all",
    "mean_estimate",
    "named_policy",
    "ratio_estimate",
    "run_episode",
    "summarise",
    "wilson_interval",
]
