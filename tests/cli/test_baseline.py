"""`rover baseline`: the table and its JSON."""

import json

from typer.testing import CliRunner, Result

from rover_gym.cli import app


def rover(*arguments: str) -> Result:
    return CliRunner(env={"COLUMNS": "160", "NO_COLOR": "1"}).invoke(app, list(arguments))


def test_the_table_has_a_row_a_difficulty() -> None:
    result = rover("baseline", "--episodes", "1", "--difficulty", "0", "--difficulty", "0.25")
    assert result.exit_code == 0, result.output
    for word in ("success", "95% interval", "time", "energy", "other ends", "0.25"):
        assert word in result.output


def test_json_says_the_same_twice() -> None:
    runs = [rover("baseline", "--episodes", "2", "--difficulty", "0.5", "--seed", "3", "--json") for _ in range(2)]
    assert runs[0].stdout == runs[1].stdout
    report = json.loads(runs[0].stdout)
    assert report["seed"] == 3
    (row,) = report["rows"]
    assert row["difficulty"] == 0.5
    assert row["episodes"] == sum(row["ends"].values()) == 2
    low, high = row["interval"]
    assert 0.0 <= low <= row["success_rate"] <= high <= 1.0


def test_a_difficulty_out_of_range_is_one_line() -> None:
    result = rover("baseline", "--episodes", "1", "--difficulty", "2.1")
    assert result.exit_code == 2
    assert result.stderr.startswith("error: ")
    assert len(result.stderr.splitlines()) == 1
    assert "difficulty" in result.stderr


def test_a_trained_policy_can_be_measured_too() -> None:
    result = rover("baseline", "--episodes", "1", "--difficulty", "0.25", "--policy", "trained")
    assert result.exit_code == 0, result.output
    assert "with a trained policy" in result.output


def test_the_planner_by_hand_can_be_measured_too() -> None:
    result = rover("baseline", "--episodes", "1", "--difficulty", "1.25", "--policy", "scan")
    assert result.exit_code == 0, result.output
    assert "the scan planner" in result.output
