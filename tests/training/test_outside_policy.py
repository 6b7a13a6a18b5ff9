"""Policies from outside: functions and classes of modules, models of stable-baselines3 and ONNX files."""

from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from refusals import refused

from rover_gym import RoverEnv
from rover_gym.cli.options import named_driver
from rover_gym.drive import BenchmarkSet, Interface, PolicyError, drive_all, named_policy, score_set
from rover_gym.drive.outside_policy import FunctionPolicy, OnnxPolicy, is_module_and_name

#: An episode of a second.
BRIEF = BenchmarkSet("brief", "Rover-v0", {}, seed=2, episodes=1, seconds=1.0)


def test_a_class_of_a_module_drives_as_under_its_name() -> None:
    """`arguments` of the class are those that its environment is made with, and may depend on the rover."""
    fields = {"terrain": "rocks", "difficulty": 0.5, "goal_distance": 1.5}
    for name, path in (("pd", "rover_gym.drive:PDPolicy"), ("scan", "rover_gym.drive:ScanPolicy")):
        one, other = (drive_all(policy, [1, 2], arguments=fields) for policy in (name, path))
        assert one == other
    assert (
        named_policy("rover_gym.drive:ScanPolicy", "open-rover").arguments
        == named_policy("scan", "open-rover").arguments
    )


def test_a_function_drives_one_rover_and_many() -> None:
    space = RoverEnv().observation_space
    policy = FunctionPolicy(lambda row: row[:12], space)
    rows = np.arange(2 * space.shape[0], dtype=np.float32).reshape(2, -1)  # type: ignore[index]
    np.testing.assert_array_equal(policy.predict(rows[0])[0], rows[0, :12])
    np.testing.assert_array_equal(policy.predict(rows)[0], rows[:, :12])


@pytest.mark.parametrize("name", ["runs/a:b", "C:\\run", "a:", "a.b", "a:b.c", "1a:b"])
def test_a_path_is_no_module(name: str) -> None:
    assert not is_module_and_name(name)


def test_what_is_no_policy_is_refused() -> None:
    for name in ("no_such_module:drive", "math:pi", "math:nothing"):
        with refused(PolicyError, "policy"):
            named_policy(name)
    with refused(PolicyError, "policy", "predict"):
        named_policy("fractions:Fraction").make(1)


def a_graph(path: Path, inputs: dict[str, int], n_out: int) -> Path:
    """A graph whose output is the sum of each input's first entry, times 0.1, 0.2, ... for each output."""
    onnx = pytest.importorskip("onnx")
    pytest.importorskip("onnxruntime")
    helper, kind = onnx.helper, onnx.TensorProto.FLOAT
    nodes, constants, parts = [], [], []
    for k, (name, size) in enumerate(inputs.items()):
        weight = np.zeros((size, n_out), np.float32)
        weight[0] = 0.1 * np.arange(1, n_out + 1)
        constants.append(onnx.numpy_helper.from_array(weight, f"w{k}"))
        nodes.append(helper.make_node("MatMul", [name, f"w{k}"], [f"y{k}"]))
        parts.append(f"y{k}")
    nodes.append(helper.make_node("Sum", parts, ["out"]))
    given = [helper.make_tensor_value_info(name, kind, ["n", size]) for name, size in inputs.items()]
    graph = helper.make_graph(nodes, "g", given, [helper.make_tensor_value_info("out", kind, ["n", n_out])], constants)
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=10)
    path.write_bytes(model.SerializeToString())
    return path


def test_an_onnx_file_of_anybody_drives_one_rover_and_many(tmp_path: Path) -> None:
    env = RoverEnv()
    size = env.observation_layout.size
    path = a_graph(tmp_path / "mine.onnx", {"whatever": size}, 12)
    policy = OnnxPolicy(env, path)
    rows = np.zeros((3, size), np.float32)
    rows[:, 0] = [0.0, 1.0, -2.0]
    expected = rows[:, :1] * 0.1 * np.arange(1, 13)
    np.testing.assert_allclose(policy.predict(rows)[0], expected, rtol=1e-6)
    np.testing.assert_allclose(policy.predict(rows[1])[0], expected[1], rtol=1e-6)
    (episode,) = score_set(BRIEF, lambda model: named_policy(str(path), model))
    assert (episode.end, episode.time) == ("time", pytest.approx(1.0))
    assert drive_all(str(path), [2], arguments={}, max_episode_steps=20)[0].energy == episode.energy


def test_an_onnx_file_that_does_not_fit_is_refused(tmp_path: Path) -> None:
    env = RoverEnv()
    size = env.observation_layout.size
    for name, graph in (
        ("inputs", ({"a": size + 1}, 12)),
        ("outputs", ({"a": size}, 11)),
        ("inputs", ({"a": 1, "b": 1}, 12)),
    ):
        with refused(PolicyError, "policy", f"has {name}"):
            OnnxPolicy(env, a_graph(tmp_path / "mine.onnx", *graph))
    (tmp_path / "mine.onnx").write_bytes(b"no graph")
    with refused(PolicyError, "policy", "cannot be read as an ONNX graph"):
        named_policy(tmp_path / "mine.onnx")
    with pytest.raises(FileNotFoundError):
        named_policy(tmp_path / "none.onnx")


def test_an_exported_network_chooses_arcs_as_the_policy(tmp_path: Path) -> None:
    """Inputs by the names of a dictionary's parts, and the largest of the scores."""
    pytest.importorskip("onnxruntime")
    from rover_gym.exports import write_onnx  # noqa: PLC0415 - needs the extra

    path = write_onnx("anywhere", tmp_path / "anywhere.onnx")
    fields: dict[str, Any] = {"terrain": "rocks", "difficulty": 1.0}
    rocks = BenchmarkSet("rocks", "Rover-v0", fields, seed=5, episodes=1, seconds=2.0)
    (ours,) = score_set(rocks, lambda model: named_policy("anywhere", model))
    (theirs,) = score_set(rocks, lambda model: named_policy(str(path), model), Interface("RoverArcs-v0"))
    assert theirs.energy == pytest.approx(ours.energy, rel=1e-6)


def test_a_model_of_stable_baselines_is_scored_and_as_onnx_too(tmp_path: Path) -> None:
    learners = pytest.importorskip("stable_baselines3")
    pytest.importorskip("onnxruntime")
    from stable_baselines3.common.vec_env import VecNormalize  # noqa: PLC0415 - needs the extra

    from rover_gym.envs.vector.sb3 import RoverVecEnv  # noqa: PLC0415
    from rover_gym.exports import write_onnx  # noqa: PLC0415
    from rover_gym.learn.raw_policy import RawPolicy  # noqa: PLC0415

    trained = {"control_frequency": 5.0, "terrain": "rocks"}
    rovers = VecNormalize(RoverVecEnv(1, threads=1, **trained))  # type: ignore[arg-type]
    model = learners.PPO("MlpPolicy", rovers, n_steps=8, batch_size=8, device="cpu", seed=1)
    RawPolicy(model, rovers, trained).save(tmp_path / "raw")
    path = write_onnx(tmp_path / "raw", tmp_path / "raw.onnx")
    files = (str(tmp_path / "raw" / "model.zip"), str(path))
    zipped, exported = (score_set(BRIEF, lambda rover, file=file: named_driver(file, rover))[0] for file in files)
    assert exported.distance == pytest.approx(zipped.distance, rel=1e-3)
    assert zipped.end == "time"
    commands = learners.PPO("MlpPolicy", gym.make("RoverCommand-v0", repeat=4), n_steps=8, batch_size=8, device="cpu")
    commands.save(tmp_path / "commands.zip")
    file = str(tmp_path / "commands.zip")
    (held,) = score_set(BRIEF, lambda rover: named_driver(file, rover), Interface("RoverCommand-v0", {"repeat": 4}))
    assert held.time == pytest.approx(1.0)
    with refused(PolicyError, "policy", "observations of shape"):
        score_set(BRIEF, lambda rover: named_driver(file, rover))
