"""A configuration is checked key by key."""

from pathlib import Path
from typing import Any

import pytest
from refusals import refused

from rover_gym import OptionError, RoverGymError

pytest.importorskip("stable_baselines3", reason="the extra train is not installed")

from rover_gym.learning.build import build_env
from rover_gym.learning.training_config import SHIPPED_CONFIGURATIONS, find_configuration, parse_config, read_config

SMALLEST: dict[str, Any] = {"environment": {"terrain": "plane"}, "total_steps": 100}


@pytest.mark.parametrize("name", [name for name in SHIPPED_CONFIGURATIONS if name != "anywhere"])
def test_a_kept_configuration_survives_writing_and_reading(name: str, tmp_path: Path) -> None:
    config = read_config(find_configuration(name))
    copy = tmp_path / "copy.yaml"
    copy.write_text(config.to_yaml(), encoding="utf-8")
    assert read_config(copy).to_yaml() == config.to_yaml()
    assert config.total_steps > 0


@pytest.mark.parametrize(
    ("change", "field"),
    [
        ({"total_stepz": 1}, "total_stepz"),
        ({"ppo": {"gama": 0.9}}, "ppo.gama"),
        ({"ppo": {"gamma": 1.5}}, "ppo.gamma"),
        ({"ppo": {"net_arch": 64}}, "ppo.net_arch"),
        ({"ppo": {"net_arch": [64, 0.5]}}, "ppo.net_arch[1]"),
        ({"ppo": {"n_steps": "many"}}, "ppo.n_steps"),
        ({"ppo": 3}, "ppo"),
        ({"guided": "yes"}, "guided"),
        ({"num_envs": 1.5}, "num_envs"),
        ({"num_envs": 0}, "num_envs"),
        ({"command": {"speed": -1}}, "command.speed"),
        ({"curriculum": {"start": 0.5}}, "curriculum"),
        ({"curriculum": {}}, "curriculum.start"),
        ({"curriculum": {"start": 2.1}}, "curriculum.start"),
        ({"curriculum": {"start": 0.5, "end": 2.5}}, "curriculum.end"),
        ({"curriculum": {"start": 0.5, "success": 1.5}}, "curriculum.success"),
        ({"environment": {"terrain": "plane", "frction": 0.5}}, "environment.frction"),
        ({"environment": {"terrain": "plane", "friction": -1.0}}, "friction"),
        ({"environment": {"terrain": "moon"}}, "terrain"),
        ({"environment": {"height_scan": [5, 4, 0.2]}, "pool": 2}, "pool"),
        ({"evaluation": {"episodes": 0}}, "evaluation.episodes"),
        ({"evaluation": {"environment": {"heading": 3}}}, "environment.heading"),
    ],
)
def test_a_wrong_key_or_value_is_named(change: dict[str, Any], field: str) -> None:
    with refused(RoverGymError, field):
        parse_config(SMALLEST | change)


@pytest.mark.parametrize("missing", ["environment", "total_steps"])
def test_what_has_no_default_must_be_given(missing: str) -> None:
    with refused(OptionError, missing):
        parse_config({name: value for name, value in SMALLEST.items() if name != missing})


def test_a_file_that_is_no_yaml_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "broken.yaml"
    path.write_text("ppo: [", encoding="utf-8")
    with refused(OptionError, "config"):
        read_config(path)


def test_randomisation_reaches_the_environment() -> None:
    config = parse_config(
        SMALLEST
        | {"environment": {"terrain": "plane", "friction": [0.5, 0.9], "mass_scale": [0.8, 1.2], "gravity_scale": 0.38}}
    )
    venv = build_env(config, num_envs=4)
    venv.reset()
    domains = venv.get_attr("domain")
    assert len({domain.friction for domain in domains}) == 4
    assert all(0.5 <= domain.friction <= 0.9 and 0.8 <= domain.mass_scale <= 1.2 for domain in domains)
    assert {domain.gravity_scale for domain in domains} == {0.38}
