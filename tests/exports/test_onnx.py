"""ONNX files give the originals' outputs to 1e-5, in the runtime that robots use."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from commands import error_of, output_of

from rover_gym.drive import ArcNetwork, Network, PolicyError
from rover_gym.drive.arcs.arc_driver import observation_space
from rover_gym.drive.forecast.arc_forecast import OUTPUTS
from rover_gym.drive.forecast.network_files import FOLDER, FORECAST

pytest.importorskip("onnx")
pytest.importorskip("onnxruntime")

import onnx
import onnxruntime as runtime

from rover_gym.exports import onnx_policy


def run(model: Any, rows: np.ndarray) -> np.ndarray:
    options = runtime.SessionOptions()
    options.intra_op_num_threads = 1
    session = runtime.InferenceSession(model.SerializeToString(), options, providers=["CPUExecutionProvider"])
    (result,) = session.run(None, {session.get_inputs()[0].name: rows.astype(np.float32)})
    return np.asarray(result)


def facts(model: Any) -> dict[str, str]:
    return {entry.key: entry.value for entry in model.metadata_props}


def features(network: Network, n: int = 500) -> np.ndarray:
    """Inputs around the network's mean, some of them far outside of what it has seen."""
    draw = np.random.default_rng(5).standard_normal((n, len(network.mean)))
    draw[::10] *= 100.0
    return (network.mean + draw * network.deviation).astype(np.float32)


def test_the_forecast_gives_the_same_outcomes() -> None:
    network = Network.read(FOLDER / FORECAST / "forecast.npz")
    rows = features(network)
    expected = network(rows) * OUTPUTS
    expected[:, 1:] = expected[:, 1:].clip(0.0, 1.0)
    assert np.abs(run(onnx_policy("foresight"), rows) - expected).max() < 1e-5


@pytest.mark.parametrize("policy", ["pd", "scan", "no/such/folder"])
def test_what_has_no_network_is_refused(policy: str, tmp_path: Path) -> None:
    with pytest.raises(PolicyError):
        onnx_policy(policy)
    error_of("export", "onnx", policy, "--output", tmp_path / "a.onnx")
    assert not (tmp_path / "a.onnx").exists()


def test_the_command_writes_a_file_that_the_checker_accepts(tmp_path: Path) -> None:
    path = tmp_path / "a.onnx"
    output_of("export", "onnx", "foresight", "--output", path)
    onnx.checker.check_model(str(path), full_check=True)


def test_the_network_for_any_rover_gives_the_same_logits() -> None:
    network = ArcNetwork.read(FOLDER / "anywhere" / "arcs.npz")
    space = observation_space()
    space.seed(3)
    rows = [space.sample() for _ in range(5)]
    seen = {name: np.stack([row[name] for row in rows]) for name in rows[0]}
    model = onnx_policy("anywhere")
    session = runtime.InferenceSession(model.SerializeToString(), providers=["CPUExecutionProvider"])
    (logits,) = session.run(None, seen)
    wanted = network(seen)
    assert np.abs(logits - wanted).max() < 1e-5 * max(1.0, float(np.abs(wanted).max()))
    assert facts(model)["kind"] == "arcs"
