"""`rover train anywhere`: a training in seconds, its files, going on, and the network without PyTorch."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
import yaml
from commands import output_of, rover
from refusals import refused

from rover_gym import OptionError
from rover_gym.drive import ArcNetwork
from rover_gym.learn.arc_config import ArcConfig, ArcPPOConfig, read_arc_config
from rover_gym.learn.arc_learner import ArcVecEnv, leash_at, make_model, network_of
from rover_gym.learn.arc_recipe import train_arcs
from rover_gym.learn.arc_rovers import Group, Rovers
from rover_gym.learn.configuration import find_configuration

TINY: dict[str, Any] = {
    "scenes": {
        "rocks": {"environment": {"terrain": "rocks", "difficulty": [0.2, 0.6]}, "share": 2},
        "small": {"environment": {"terrain": "rocks", "model": "open-rover"}, "vary": True},
    },
    "environment": {"reward_weights": {"energy": -1e-4}},
    "rovers": 6,
    "group": 2,
    "imitation": {"rounds": 2, "decisions": 60, "epochs": 1, "batch_size": 32},
    "ppo": {"decisions": 96, "n_steps": 8, "batch_size": 24, "n_epochs": 1, "every": 48},
    "evaluation": {"scenes": {"easy": {"terrain": "plane", "battery": 200.0}}, "fields": 2},  # ends soon
}

TWO_PROCESSES = pytest.mark.nightly("tests/training/test_arc_training.py::test_a_training_writes_a_network_and_goes_on")


def config(tmp_path: Path, **changes: Any) -> ArcConfig:
    path = tmp_path / "tiny.yaml"
    path.write_text(yaml.safe_dump({**TINY, **changes}), encoding="utf-8")
    return read_arc_config(path)


@pytest.mark.parametrize("workers", [1, pytest.param(2, marks=TWO_PROCESSES)])
def test_a_training_writes_a_network_and_goes_on(tmp_path: Path, workers: int) -> None:
    settings, said = config(tmp_path), []
    folder = train_arcs(settings, tmp_path / "run", workers=workers, threads=1, device="cpu", say=said.append)
    ArcNetwork.read(folder / "arcs.npz")
    ArcNetwork.read(folder / "best" / "arcs.npz")
    facts = json.loads((folder / "run.json").read_text(encoding="utf-8"))
    assert facts["rounds"] == 2
    assert facts["decisions"] == 96
    assert facts["cpu_seconds"] > 0.0
    assert read_arc_config(folder / "config.yaml") == settings
    assert any("round 2 of 2" in line for line in said)
    lines = (folder / "curve.csv").read_text(encoding="utf-8").splitlines()
    assert lines[0].startswith("stage,decisions,cpu_minutes,easy")
    if workers == 1:
        longer = replace(settings, ppo=replace(settings.ppo, decisions=144))
        train_arcs(longer, folder, workers=1, threads=1, device="cpu", resume=True, say=said.append)
        assert json.loads((folder / "run.json").read_text(encoding="utf-8"))["decisions"] == 144
        other = config(tmp_path, scenes={"rocks": {"environment": {"terrain": "rocks"}}})
        with refused(OptionError, "scenes"):
            train_arcs(other, folder, resume=True)


@pytest.mark.nightly("tests/training/test_arc_training.py::test_a_training_writes_a_network_and_goes_on")
def test_the_command_trains_and_its_policy_drives(tmp_path: Path) -> None:
    path, run = tmp_path / "tiny.yaml", tmp_path / "run"
    path.write_text(yaml.safe_dump({**TINY, "ppo": None}), encoding="utf-8")
    output_of("train", path, "--output", run, "--workers", 1)
    output_of("evaluate", run, "--difficulty", 0, "--episodes", 1, "--output", tmp_path)
    assert "scenes:" in output_of("train", "anywhere", "--show")
    path.write_text("scenes: [", encoding="utf-8")
    assert rover("train", path).exit_code != 0


@pytest.mark.nightly("tests/training/test_arc_training.py::test_a_training_writes_a_network_and_goes_on")
def test_imitation_goes_on_after_a_round(tmp_path: Path) -> None:
    one = config(tmp_path, ppo=None, imitation={**TINY["imitation"], "rounds": 1})
    train_arcs(one, tmp_path / "run", threads=1, device="cpu", say=lambda _line: None)
    said: list[str] = []
    two = config(tmp_path, ppo=None)
    train_arcs(two, tmp_path / "run", threads=1, device="cpu", resume=True, say=said.append)
    assert not any("round 1 of" in line for line in said)
    assert any("round 2 of 2: 12" in line for line in said)  # labels of both rounds


def test_without_a_checkpoint_nothing_goes_on(tmp_path: Path) -> None:
    with refused(OptionError, "resume"):
        train_arcs(config(tmp_path), tmp_path / "run", resume=True)


def test_the_network_without_pytorch_is_the_same(tmp_path: Path) -> None:
    settings = config(tmp_path)
    model = make_model(ArcPPOConfig(batch_size=128), ArcVecEnv(None, 2), 1, "cpu")
    group = Group(settings.parsed()["rocks"], 2, 1)
    seen = group.begin()
    with torch.no_grad():
        tensors = {name: torch.from_numpy(part) for name, part in seen.items()}
        distribution: Any = model.policy.get_distribution(tensors)
        wanted = torch.log_softmax(torch.from_numpy(network_of(model.policy)(seen)), dim=1)
    np.testing.assert_allclose(wanted, distribution.distribution.logits, atol=1e-5)


def test_the_leash_is_zero_at_its_stake_and_grows(tmp_path: Path) -> None:
    model = make_model(ArcPPOConfig(batch_size=128), ArcVecEnv(None, 2), 1, "cpu")
    policy: Any = model.policy
    seen = Group(config(tmp_path).parsed()["rocks"], 2, 1).begin()
    tensors, actions = {name: torch.from_numpy(part) for name, part in seen.items()}, torch.zeros(2)
    policy.tie()
    assert float(policy.evaluate_actions(tensors, actions)[2].detach().abs().max()) < 1e-6
    with torch.no_grad():
        policy.action_net.bias[3] += 2.0
    assert (policy.evaluate_actions(tensors, actions)[2] < -0.01).all()
    settings = ArcPPOConfig(leash=0.4, final_leash=0.01)
    assert [leash_at(settings, x) for x in (0.0, 0.5, 1.0, 2.0)] == pytest.approx([0.4, 0.4 * 0.025**0.5, 0.01, 0.01])


def test_a_teachers_labels_are_its_drive(tmp_path: Path) -> None:
    rovers = Rovers(config(tmp_path))
    rovers.found(1, 0.5)
    labels, _ = rovers.label(None, 30, 1.0, 0.0)
    assert labels["scan"].dtype == np.int8
    assert len(labels["label"]) >= 30
    assert labels["label"].max() < 64


def test_bad_configurations_are_refused(tmp_path: Path) -> None:
    for changes, field in (
        ({"scenes": {}}, "scenes"),
        ({"scenes": {"a": {"environment": {"bumps": 1}}}}, "environment"),
        ({"scenes": {"a": {"environment": {}, "teacher": "oracle"}}}, "teacher"),
        ({"imitation": {"labelled": 0}}, "imitation.labelled"),
        ({"ppo": {"n_steps": 0}}, "ppo.n_steps"),
        ({"evaluation": {"seed": 3}}, "evaluation.seed"),
        ({"horses": 3}, "horses"),
    ):
        with pytest.raises(OptionError) as caught:
            config(tmp_path, **changes)
        assert caught.value.field.startswith(field)


def test_the_shipped_configuration_covers_all_scenes() -> None:
    settings = read_arc_config(find_configuration("anywhere"))
    assert set(settings.groups()) == set(settings.scenes)
    assert all(scene.environment["reward_weights"] for scene in settings.parsed().values())


def test_rovers_of_other_processes_are_neither_changed_nor_called() -> None:
    vector = ArcVecEnv(None, 2)
    with pytest.raises(AttributeError, match="difficulty"):
        vector.set_attr("difficulty", 1.0)
    with pytest.raises(AttributeError, match="set_difficulty"):
        vector.env_method("set_difficulty", 1.0)
    with pytest.raises(AttributeError, match="difficulty"):
        vector.get_attr("difficulty")
