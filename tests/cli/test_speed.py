"""`rover speed`: what it measures adds up."""

import json

import pytest
from commands import output_of, rover


@pytest.mark.parametrize("terrain", ["plane", "rocks"])
def test_json_adds_up(terrain: str) -> None:
    options = ["--num-envs", "3", "--threads", "2", "--rounds", "2", "--terrain", terrain, "--json"]
    whole = json.loads(output_of("speed", *options))
    assert whole["machine"]["cores"] > 0
    assert whole["machine"]["instruction_set"] in ("AVX-512", "AVX2", "baseline")
    assert list(whole["grounds"]) == [terrain]
    told = whole["grounds"][terrain]["environment"]
    assert (told["num_envs"], told["threads"]) == (3, 2)
    assert 0.0 < told["physics"] <= told["step"]
    assert told["physics_share"] == told["physics"] / told["step"]
    assert told["speed_up"] == told["one_thread"] / told["all_threads"]
    assert told["steps_per_second"] == pytest.approx(3 / told["step"])
    assert told["gain"] == told["sync"] / told["step"]
    exploring = whole["grounds"][terrain]["exploring"]
    assert (exploring["num_envs"], exploring["threads"], exploring["torque"]) == (3, 2, 60.0)
    assert exploring["rover_steps"] > 0.0
    assert 0.0 < exploring["median"] <= exploring["slow"] <= exploring["slowest"]
    assert exploring["simulated"] == pytest.approx(0.005 * exploring["rover_steps"])


def test_the_text_names_what_it_tells() -> None:
    output = output_of("speed", "--num-envs", "2", "--rounds", "1")
    for words in ("rover-steps/s", "99.9% within", "plane", "rocks", "inside the physics", "over SyncVectorEnv"):
        assert words in output


def test_bad_numbers_are_refused() -> None:
    assert rover("speed", "--num-envs", "0").exit_code == 2
    assert rover("speed", "--torque", "-1").exit_code == 2
