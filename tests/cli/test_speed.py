"""`rover speed`: what it measures adds up."""

import json

import pytest
from typer.testing import CliRunner

from rover_gym.cli import app


@pytest.mark.parametrize("terrain", ["plane", "sphere_field"])
def test_json_adds_up(terrain: str) -> None:
    options = ["--num-envs", "3", "--threads", "2", "--rounds", "2", "--terrain", terrain, "--json"]
    result = CliRunner().invoke(app, ["speed", *options])
    assert result.exit_code == 0, result.output
    told = json.loads(result.stdout)
    assert (told["num_envs"], told["threads"]) == (3, 2)
    assert 0.0 < told["physics"] <= told["step"]
    assert told["physics_share"] == told["physics"] / told["step"]
    assert told["speed_up"] == told["one_thread"] / told["all_threads"]
    assert told["steps_per_second"] == pytest.approx(3 / told["step"])
    assert told["gain"] == told["sync"] / told["step"]


def test_the_text_names_what_it_tells() -> None:
    result = CliRunner().invoke(app, ["speed", "--num-envs", "2", "--rounds", "1"])
    assert result.exit_code == 0, result.output
    for words in ("inside the physics", "over one thread", "over SyncVectorEnv", "reset of one rover"):
        assert words in result.output


def test_bad_numbers_are_refused() -> None:
    assert CliRunner().invoke(app, ["speed", "--num-envs", "0"]).exit_code == 2
