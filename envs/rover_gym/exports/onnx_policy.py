"""Policies as ONNX files."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from rover_gym.core.extras import MissingExtraError, require
from rover_gym.core.files import write_whole
from rover_gym.core.validation import checked, refuse
from rover_gym.drive.arcs.arc_network import ArcNetwork
from rover_gym.drive.arcs.arc_network_policy import ARCS_FILE
from rover_gym.drive.commands.features import LARGEST_FEATURE
from rover_gym.drive.forecast.arc_forecast import FORECAST_FILE, OUTPUTS
from rover_gym.drive.forecast.network_files import ANYWHERE, FOLDER, FORECAST, Network, PolicyError, is_there
from rover_gym.exports.onnx_arcs import arcs_model
from rover_gym.exports.onnx_graph import Perceptron, onnx_model

#: The file that identifies a run of `RawPolicy.save`.
RAW_FILE = "model.zip"


@checked(policy=Path, path=Path)
def write_onnx(policy: str | Path, path: str | Path) -> Path:
    """Writes a policy's network as ONNX, with the normalisation of its inputs.

    | policy | input | output |
    |---|---|---|
    | "foresight", or the folder of a forecast | `features` | `outcomes`: way, stuck, failed |
    | "anywhere", or the folder of a run of it | `scan`, `features`, `command`, `clocks` | `logits` of the arcs |
    | the folder of a run of `RawPolicy.save` | `observation` | `action` |

    Args:
        policy: The policy.
        path: The file to write, with its folder.

    Raises:
        PolicyError: There is no such policy, it has no network, or its files are damaged.
        OSError: A file may not be read or written.
        MissingExtraError: An extra is not installed.
    """
    require("onnx", "onnx")
    return write_whole(path, onnx_policy(policy).SerializeToString())


@checked(policy=Path)
def onnx_policy(policy: str | Path) -> Any:
    """The `onnx.ModelProto` of a policy, as `write_onnx` writes it.

    Raises:
        PolicyError: There is no such policy, it has no network, or its files are damaged.
        OSError: A file may not be read.
        MissingExtraError: An extra is not installed.
    """
    folder = FOLDER / FORECAST if policy == FORECAST else Path(policy)
    if is_there(folder / FORECAST_FILE):
        facts: Mapping[str, Any] = {
            "kind": "forecast",
            "features": "rover_gym.drive.forecast.arc_forecast.ArcFeatures, and whether the arc is driven fast",
            "outcomes": "way along the arc over the way at cruising speed; share of the time that ends an episode for"
            " which the trunk has been held; probability that the episode has failed",
        }
        return onnx_model(
            forecast_network(Network.read(folder / FORECAST_FILE)), "forecast", "features", "outcomes", facts
        )
    if is_there(folder / RAW_FILE):
        return _raw(folder)
    network = FOLDER / ANYWHERE if policy == ANYWHERE else folder
    if not is_there(network / ARCS_FILE):
        refuse(PolicyError, "policy", str(policy), "has no network to export")
    return arcs_model(ArcNetwork.read(network / ARCS_FILE))


def forecast_network(network: Network) -> Perceptron:
    """A forecast's network: outputs in the units of `Outcomes`, stuck and failed from 0 to 1."""
    return Perceptron(
        network.weights,
        network.biases,
        "Relu",
        network.mean,
        network.deviation,
        LARGEST_FEATURE,
        squash="Clip",
        scale=OUTPUTS,
        low=np.array([-OUTPUTS[0], 0.0, 0.0], np.float32),
        high=OUTPUTS,
    )


def _raw(folder: Path) -> Any:
    """A complete policy of Stable-Baselines3, from the observation to the action."""
    try:
        from rover_gym.exports.onnx_raw import raw_network  # noqa: PLC0415 - torch is slow to load, and optional
        from rover_gym.learn.raw_policy import RawPolicy  # noqa: PLC0415
    except ModuleNotFoundError as error:
        raise MissingExtraError(error.name or "torch", "train") from error
    policy = RawPolicy.load(folder)
    facts = {
        "kind": "raw",
        "observation": "that of RoverEnv, made with `environment`",
        "action": "that of RoverEnv",
        "environment": policy.environment,
    }
    return onnx_model(raw_network(policy), "policy", "observation", "action", facts)
