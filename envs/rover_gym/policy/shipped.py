"""Finds policies and forecasts: those shipped with the package, by terrain or rover, and others, by folder."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from rover_gym.env.arguments import terrain_name
from rover_gym.mechanics import RoverModel
from rover_gym.policy.policy_card import PolicyCard, PolicyError, is_there
from rover_gym.validation import refuse

#: Folder names of the shipped policies, by terrain.
SHIPPED: Mapping[str, str] = {"plane": "plane", "rocks": "rocks"}

#: Folder names of the shipped forecasts: by the name of the rover's model, of the built-in one on hills, and of it
#: on all other ground.
FORECASTS: Mapping[str, str] = {"open-rover": "foresight-open-rover"}
HILLS_FORECAST, ROCKS_FORECAST = "foresight-hills", "foresight"

FOLDER = Path(__file__).parents[1] / "data" / "policies"


def policy_folder(terrain: str) -> Path:
    """The folder of the policy shipped for a terrain.

    Raises:
        PolicyError: No policy is shipped for this terrain.
    """
    terrain = terrain_name(terrain)
    if terrain not in SHIPPED:
        refuse(PolicyError, "policy", terrain, f"none was trained; there are some for {', '.join(SHIPPED)}")
    return FOLDER / SHIPPED[terrain]


def forecast_folder(model: RoverModel | None = None, *, hills: bool = False) -> Path:
    """The folder of the forecast shipped for a rover, None for the built-in one, among rocks or on hills."""
    of_terrain = HILLS_FORECAST if hills else ROCKS_FORECAST
    return FOLDER / (of_terrain if model is None else FORECASTS.get(model.name, of_terrain))


def find_policy(policy: str, terrain: str) -> Path | None:
    """The folder of a policy: the shipped one for "trained", otherwise the given path; None for "pd" and "scan".

    Of the folder of a run of `rover train` it is the policy at its end.

    Raises:
        PolicyError: There is no such policy.
    """
    if policy in ("pd", "scan"):
        return None
    folder = policy_folder(terrain) if policy == "trained" else Path(policy)
    if is_there(folder / "policy" / "policy.json"):
        folder = folder / "policy"
    if not is_there(folder / "policy.json"):
        refuse(
            PolicyError,
            "policy",
            policy,
            "must be 'pd', 'scan', 'foresight', 'trained' or the folder of a run, a trained policy or a forecast",
        )
    return folder


def policy_arguments(folder: Path) -> dict[str, Any]:
    """The arguments that a policy's environment must be made with.

    Raises:
        PolicyError: The folder holds no valid policy.
        OSError: The file may not be read.
    """
    arguments = dict(PolicyCard.read(folder / "policy.json").environment)
    if isinstance(arguments.get("height_scan"), list):
        arguments["height_scan"] = tuple(arguments["height_scan"])
    return arguments
