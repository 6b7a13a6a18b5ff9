"""Training runs, leaves what it promises, goes on after a stop, and gives a policy that NumPy runs alike."""

import csv
import json
import shutil
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from commands import output_of

pytest.importorskip("stable_baselines3", reason="the extra train is not installed")

import torch
from stable_baselines3 import PPO
from stable_baselines3.common.vec_env import VecNormalize

from rover_gym.learning.build import build_env
from rover_gym.learning.training_config import environment_arguments, read_config
from rover_gym.policy import Network, TrainedPolicy, drive_all, summarise, wilson_interval
from rover_gym.record import read_run

Script = Callable[..., Any]

ENVIRONMENTS: Mapping[str, dict[str, Any]] = {
    "plane": {"terrain": "plane", "goal_distance": 2.0, "friction": [0.5, 0.8]},
    "rocks": {"terrain": "rocks", "goal_distance": 3.0, "height_scan": [12, 8, 0.2]},
}


def a_config(folder: Path, name: str) -> Path:
    """A training of 2048 decisions, two control periods each."""
    config: dict[str, Any] = {
        "environment": {**ENVIRONMENTS[name], "control_frequency": 10, "time_step": 0.02},
        "total_steps": 2048,
        "num_envs": 8,
        "max_episode_steps": 60,
        "pool": 2 if name == "rocks" else 1,
        "guided": name == "rocks",
        "ppo": {"n_steps": 64, "batch_size": 128, "n_epochs": 2, "net_arch": [16, 16]},
        "evaluation": {"every": 1024, "episodes": 4},
        "checkpoint_every": 1024,
    }
    if name == "rocks":
        config["curriculum"] = {"start": 0.1, "step": 0.2, "success": 0.1, "episodes": 10}
    path = folder / f"{name}.yaml"
    path.write_text(yaml.safe_dump(config), encoding="utf-8")
    return path


@pytest.fixture(scope="module", params=["plane", "rocks"])
def run(request: pytest.FixtureRequest, train: Script, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp(request.param)
    result = train(
        "--config", a_config(folder, request.param), "--output", folder / "run", "--seed", 3, "--no-progress"
    )
    assert result.exit_code == 0, result.output
    return folder / "run"


def test_the_run_leaves_what_it_was(run: Path) -> None:
    report = json.loads((run / "run.json").read_text(encoding="utf-8"))
    assert report["seed"] == 3
    assert report["decisions"] == 2048
    assert 0.0 < report["environment_share"] < 1.0
    assert report["environment_cpu_seconds"] > 0.0
    assert report["learner_cpu_seconds"] > 0.0
    assert {"rover-gym", "stable-baselines3", "torch"} <= report["versions"].keys()
    assert "revision" in report
    assert read_config(run / "config.yaml").total_steps == 2048
    assert list((run / "log").glob("events.out.tfevents.*"))


def test_returns_are_finite_and_the_curve_has_every_episode(run: Path) -> None:
    lines = (run / "curve.monitor.csv").read_text(encoding="utf-8").splitlines()[1:]
    rows = list(csv.DictReader(lines))
    # 2048 decisions of 2 periods, episodes of at most 60.
    assert len(rows) >= 2048 * 2 // 60 - 8
    assert np.isfinite([float(row["r"]) for row in rows]).all()


def test_evaluations_come_with_their_intervals_and_their_cost(run: Path) -> None:
    with (run / "evaluations.csv").open(encoding="utf-8") as file:
        rows = [{name: float(value) for name, value in row.items()} for row in csv.DictReader(file)]
    assert [row["decisions"] for row in rows] == [1024, 2048]
    for row in rows:
        assert row["episodes"] == 4
        low, high = wilson_interval(round(row["successes"]), 4)
        assert (row["success"], row["low"], row["high"]) == pytest.approx((row["successes"] / 4, low, high), rel=1e-3)
        assert row["cpu_seconds"] > 0.0
    with (run / "log" / "progress.csv").open(encoding="utf-8") as file:
        logged = [float(row["evaluation/low"]) for row in csv.DictReader(file) if row.get("evaluation/low")]
    assert logged == pytest.approx([row["low"] for row in rows], rel=1e-3)


def test_the_last_evaluation_is_that_of_the_exported_policy(run: Path) -> None:
    """The evaluation during training drove coarser physics and shorter episodes than that afterwards."""
    config = read_config(run / "config.yaml")
    arguments = environment_arguments(config.evaluated_environment)
    assert not arguments.keys() & {"time_step", "solver_options", "control_frequency"}
    drives = drive_all(
        lambda env: TrainedPolicy.load(env, run / "policy"), range(2_000_000, 2_000_004), arguments=arguments
    )
    with (run / "evaluations.csv").open(encoding="utf-8") as file:
        last = list(csv.DictReader(file))[-1]
    assert int(last["successes"]) == sum(drive.success for drive in drives)
    assert float(last["energy_per_metre"]) == pytest.approx(summarise("", drives).energy_per_metre.value, rel=1e-3)


def test_the_parameters_have_changed(run: Path) -> None:
    first, last = (PPO.load(run / "checkpoints" / f"{n:09d}.zip", device="cpu") for n in (1024, 2048))
    for (name, before), after in zip(first.policy.named_parameters(), last.policy.parameters(), strict=True):
        assert torch.isfinite(after).all()
        assert not torch.equal(before, after), name


def test_the_saved_policy_acts_like_the_model(run: Path) -> None:
    config = read_config(run / "config.yaml")
    venv = build_env(config, num_envs=5, seed=7)
    normalisation = VecNormalize.load(str(run / "checkpoints" / "000002048.pkl"), venv)
    normalisation.training = False
    model = PPO.load(run / "checkpoints" / "000002048.zip", device="cpu")
    network = Network.read(run / "policy" / "policy.npz")
    features = venv.reset()
    assert isinstance(features, np.ndarray)
    for _ in range(10):
        actions, _ = model.predict(normalisation.normalize_obs(features), deterministic=True)
        np.testing.assert_allclose(network(features), actions, atol=1e-5)
        features, *_ = venv.step(actions)

    rover = venv.unwrapped.prototype
    seen = rover.reset(seed=1)[0]
    one, two = (TrainedPolicy.load(rover, run / "policy").predict(seen)[0] for _ in range(2))
    np.testing.assert_array_equal(one, two)
    assert one in rover.action_space


@pytest.mark.takes_long("trains, stops and goes on")
def test_a_stopped_training_goes_on(run: Path, train: Script, tmp_path: Path) -> None:
    config = a_config(tmp_path, run.parent.name.rstrip("0123456789"))
    arguments = ("--config", config, "--output", tmp_path / "run", "--no-progress")
    assert train(*arguments, "--steps", 1024).exit_code == 0
    before = PPO.load(tmp_path / "run" / "checkpoints" / "000001024.zip", device="cpu")
    result = train(*arguments, "--resume")
    assert result.exit_code == 0, result.output
    after = PPO.load(tmp_path / "run" / "checkpoints" / "000002048.zip", device="cpu")
    assert after.num_timesteps == 2048
    assert after._n_updates == 2 * before._n_updates
    report = json.loads((tmp_path / "run" / "run.json").read_text(encoding="utf-8"))
    assert report["resumed_from"] == 1024
    assert (tmp_path / "run" / "curve-1024.monitor.csv").exists()


@pytest.mark.takes_long("trains, stops and goes on")
def test_a_training_goes_on_with_the_hyperparameters_that_are_given(run: Path, train: Script, tmp_path: Path) -> None:
    """Resuming wrote the new configuration and trained with the old one."""
    folder = tmp_path / "run"
    shutil.copytree(run, folder)
    config = yaml.safe_load((folder / "config.yaml").read_text(encoding="utf-8"))
    changed = {"gamma": 0.9, "n_steps": 32, "batch_size": 64, "n_epochs": 1, "learning_rate": 2e-4, "clip_range": 0.1}
    config["ppo"] |= changed | {"final_learning_rate": 2e-4}
    config["num_envs"] = 4
    path = tmp_path / "changed.yaml"
    path.write_text(yaml.safe_dump(config), encoding="utf-8")
    result = train("--config", path, "--output", folder, "--resume", "--steps", 2304, "--no-progress")
    assert result.exit_code == 0, result.output
    model = PPO.load(folder / "checkpoints" / "000002304.zip", device="cpu")
    for name in ("gamma", "n_steps", "batch_size", "n_epochs"):
        assert getattr(model, name) == changed[name]
    assert model.clip_range(1.0) == 0.1
    assert model.policy.optimizer.param_groups[0]["lr"] == 2e-4
    normalisation = VecNormalize.load(str(folder / "checkpoints" / "000002304.pkl"), build_env(read_config(path)))
    assert normalisation.gamma == 0.9
    assert read_config(folder / "config.yaml").ppo.gamma == 0.9


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("ppo.net_arch", [8]),
        ("ppo.log_std_init", -1.0),
        ("command.speed", 0.7),
        ("guided", None),
        ("environment.height_scan", [4, 4, 0.5]),
    ],
)
def test_a_training_does_not_go_on_with_another_network(
    field: str, value: Any, run: Path, train: Script, tmp_path: Path
) -> None:
    config = yaml.safe_load((run / "config.yaml").read_text(encoding="utf-8"))
    *outer, name = field.split(".")
    inner = config[outer[0]] if outer else config
    inner[name] = not inner[name] if value is None else value
    path = tmp_path / "changed.yaml"
    path.write_text(yaml.safe_dump(config), encoding="utf-8")
    before = {file: file.read_bytes() for file in run.rglob("*") if file.is_file()}
    result = train("--config", path, "--output", run, "--resume", "--steps", 4096, "--no-progress")
    assert result.exit_code == 2
    assert result.stderr.startswith(f"error: {field}: was "), result.stderr
    assert before == {file: file.read_bytes() for file in run.rglob("*") if file.is_file()}


@pytest.mark.parametrize(
    "text", ["", "[]", '{"name": "../../000000001", "hardest": null}', '{"name": 3}', "[" * 100_000]
)
def test_a_damaged_checkpoint_is_one_line(text: str, train: Script, tmp_path: Path) -> None:
    folder = tmp_path / "run" / "checkpoints"
    folder.mkdir(parents=True)
    (folder / "latest.json").write_text(text, encoding="utf-8")
    config = "plane"
    result = train("--config", config, "--output", tmp_path / "run", "--resume")
    assert result.exit_code == 2
    assert result.stderr.startswith("error: --resume: is not a checkpoint")
    assert len(result.stderr.splitlines()) == 1


def test_the_curriculum_rises_with_success(run: Path) -> None:
    with (run / "log" / "progress.csv").open(encoding="utf-8") as file:
        rows = [row for row in csv.DictReader(file) if row.get("curriculum/hardest")]
    levels = [float(row["curriculum/hardest"]) for row in rows]
    if "rocks" not in run.parent.name:
        assert not levels
        return
    assert levels == sorted(levels)
    assert levels[0] >= 0.1
    assert levels[-1] > 0.1


def test_an_evaluation_names_policies_and_baseline(run: Path, evaluate: Script, tmp_path: Path) -> None:
    terrain = "rocks" if "rocks" in run.parent.name else "plane"
    result = evaluate(run, "pd", "scan", "--terrain", terrain, "--episodes", 2, "--output", tmp_path)
    assert result.exit_code == 0, result.output
    report = json.loads((tmp_path / "evaluation.json").read_text(encoding="utf-8"))
    guides = ["guide alone"] if terrain == "rocks" else []
    expected = ["pd", "scan", *guides, "run"]
    assert [row["policy"] for row in report["rows"]] == expected
    for row in report["rows"]:
        assert sum(row["ends"].values()) == row["episodes"] == 2
        assert f"| {row['policy']} |" in (tmp_path / "evaluation.md").read_text(encoding="utf-8")
    assert (tmp_path / "evaluation.png").stat().st_size > 1000


def test_enjoy_drives(run: Path, enjoy: Script) -> None:
    terrain = "rocks" if "rocks" in run.parent.name else "plane"
    result = enjoy(run, "--terrain", terrain, "--seed", 5)
    assert result.exit_code == 0, result.output
    assert "seed 5: " in result.output


def test_a_policy_for_another_rover_trains_drives_and_is_replayed(
    train: Script, evaluate: Script, enjoy: Script, tmp_path: Path
) -> None:
    config = yaml.safe_load(a_config(tmp_path, "plane").read_text(encoding="utf-8"))
    config["environment"]["model"] = "skid-steered"
    config |= {"total_steps": 256, "max_episode_steps": 40, "evaluation": {"every": 256, "episodes": 2}}
    config["ppo"] |= {"n_steps": 32, "batch_size": 64}
    path = tmp_path / "skid.yaml"
    path.write_text(yaml.safe_dump(config), encoding="utf-8")
    result = train("--config", path, "--output", tmp_path / "run", "--no-progress")
    assert result.exit_code == 0, result.output
    policy = tmp_path / "run" / "policy"
    card = json.loads((policy / "policy.json").read_text(encoding="utf-8"))
    assert card["source"]["model"] == "skid-steered"

    ground = ("--terrain", "plane", "--model", "skid-steered")
    result = evaluate(policy, "pd", *ground, "--episodes", 2, "--output", tmp_path / "evaluation")
    assert result.exit_code == 0, result.output
    assert enjoy(policy, *ground, "--seed", 5).exit_code == 0
    result = evaluate(policy, "--terrain", "plane", "--episodes", 1, "--output", tmp_path / "wrong")
    assert result.exit_code == 2
    assert "for a model like 'skid-steered'" in result.stderr

    drive = ["drive", "--policy", policy, "--model", "skid-steered", "--time-limit", 1, "--output", tmp_path / "drive"]
    replay = ["replay", tmp_path / "drive" / "episode-0.h5", "--vrml", tmp_path / "run.wrl"]
    for command in (drive, replay):
        output_of(*command)
    assert read_run(tmp_path / "drive" / "episode-0.h5").model.name == "skid-steered"


def test_a_wrong_configuration_is_one_line(train: Script, tmp_path: Path) -> None:
    path = tmp_path / "wrong.yaml"
    path.write_text("environment: {terrain: plane}\ntotal_steps: 1\nsteps_total: 2\n", encoding="utf-8")
    result = train("--config", path, "--output", tmp_path / "run")
    assert result.exit_code == 2
    assert result.stderr.startswith("error: steps_total: unknown")
    assert len(result.stderr.splitlines()) == 1
    assert not (tmp_path / "run").exists()
