"""Policies by name: the baseline, the policies for sand and rocks, and networks."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from os import PathLike, fspath
from pathlib import Path
from typing import Any

from rover_gym.core.validation import refuse, regular_file
from rover_gym.drive.arcs.arc_network_policy import ARCS_FILE, ArcNetworkPolicy
from rover_gym.drive.arcs.guided_policy import GuidedPolicy
from rover_gym.drive.commands.driven import Policy
from rover_gym.drive.forecast.arc_forecast import FORECAST_FILE
from rover_gym.drive.forecast.network_files import ANYWHERE, FOLDER, PolicyError, is_there
from rover_gym.drive.outside_policy import (
    OnnxPolicy,
    is_module_and_name,
    named_object,
    object_policy,
    onnx_arguments,
)
from rover_gym.drive.pd.pd_policy import PDPolicy
from rover_gym.drive.pd.sand_policy import SandPolicy
from rover_gym.drive.scan.scan_policy import ScanPolicy
from rover_gym.models.lookup import ModelLike

#: Help text of the command line about the names.
NAMES_HELP = (
    "'pd' for the baseline, 'sand' for the one that crawls on sand, 'scan' for the search on the height scan, "
    "'foresight' for the same with a learned prediction, "
    "'anywhere' for the network that drives any rover without a planner, 'guided' for both together, "
    "the folder of a run of `rover train` or of a forecast, a file of stable-baselines3 (.zip) or ONNX (.onnx), "
    "or a function or class as 'module:name'."
)

#: Why a policy is refused that is none.
UNKNOWN = (
    "must be 'pd', 'sand', 'scan', 'foresight', 'anywhere', 'guided', the folder of a run of `rover train` or of a "
    "forecast, a file that ends in .onnx, 'module:name', or on the command line a file of stable-baselines3 that ends "
    "in .zip"
)

#: Policies without a folder.
NAMES = ("pd", "sand", "scan", "foresight", ANYWHERE, "guided")

_TITLES = {
    "pd": "the PD baseline",
    "sand": "the crawler on sand",
    "scan": "the search on the height scan",
    "foresight": "the search with foresight",
    ANYWHERE: "the network for any rover",
    "guided": "the search guided by the network",
}


def policy_title(policy: str) -> str:
    """Title of a policy, by its name or folder, for headings."""
    return _TITLES.get(policy, "a trained network")


@dataclass(frozen=True)
class NamedPolicy:
    """A policy to be made for an environment.

    Attributes:
        arguments: The arguments that its environment must be made with.
        make: Makes it from such an environment.
        files: Files that it is read from.
    """

    arguments: Mapping[str, Any]
    make: Callable[[Any], Policy]
    files: tuple[Path, ...] = ()


def named_policy(policy: object, model: ModelLike | None = None) -> NamedPolicy:
    """The policy of a name, of a folder, or as it is.

    Args:
        policy: "pd", "sand", "scan", "foresight", "anywhere", "guided", or the folder of a run of `rover train` or of a
            forecast; a file that ends in .onnx, or a function or class as "module:name"; or an object with `predict`.
        model: The rover, to which the height scan is fitted, its name in the gallery or its file; None for the built-in
            one.

    Raises:
        PolicyError: There is no such policy.
        ModelError: There is no such model.
        OSError: A file may not be read.
    """
    if isinstance(policy, NamedPolicy):
        return policy
    if not isinstance(policy, type) and callable(getattr(policy, "predict", None)):
        return NamedPolicy({}, lambda _env: policy)  # type: ignore[arg-type, return-value] # it has predict
    if not isinstance(policy, (str, PathLike)):
        refuse(PolicyError, "policy", policy, UNKNOWN)
    policy = fspath(policy)
    if policy in ("pd", "sand"):
        return NamedPolicy({}, SandPolicy if policy == "sand" else PDPolicy)
    if policy.endswith(".onnx"):
        file = regular_file(policy, error=PolicyError)
        return NamedPolicy(onnx_arguments(file), partial(OnnxPolicy, path=file), (file,))
    if is_module_and_name(policy):
        found, source = named_object(policy)
        needs = getattr(found, "arguments", {})
        arguments = needs(model) if callable(needs) else needs
        return NamedPolicy(arguments, partial(object_policy, found), () if source is None else (source,))
    return _own_policy(policy, model)


def _own_policy(policy: str, model: ModelLike | None) -> NamedPolicy:
    """A policy of this package that sees the height scan, by its name or folder."""
    seen = ScanPolicy.arguments(model)
    foresight = tuple(sorted(FOLDER.glob("foresight*/*")))
    network = network_folder(policy)
    if policy == "scan":
        return NamedPolicy(seen, ScanPolicy)
    if policy == "guided":
        return NamedPolicy(seen, GuidedPolicy, (*foresight, FOLDER / ANYWHERE / ARCS_FILE))
    if policy == "foresight":
        return NamedPolicy(seen, partial(ScanPolicy, forecast=True), foresight)
    if is_there(Path(policy) / FORECAST_FILE):
        return NamedPolicy(seen, partial(ScanPolicy, forecast=policy), (Path(policy) / FORECAST_FILE,))
    if network is None:
        refuse(PolicyError, "policy", policy, UNKNOWN)
    return NamedPolicy(seen, partial(_load_network, network), (network / ARCS_FILE,))


def network_folder(policy: str) -> Path | None:
    """The folder of the network that a policy's name or folder stands for; None of other policies."""
    folder = FOLDER / ANYWHERE if policy == ANYWHERE else Path(policy)
    return folder if is_there(folder / ARCS_FILE) else None


def _load_network(folder: Path, env: Any) -> Policy:
    return ArcNetworkPolicy.load(env, folder)
