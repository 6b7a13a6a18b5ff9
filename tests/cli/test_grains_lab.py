"""`rover grains plate|shear|wheel`."""

import csv
from pathlib import Path

import pytest
from typer.testing import CliRunner

from rover_gym.cli import app

BED = ["--balls", "250", "--ball-radius", "0.013", "--width", "0.27", "--depth", "0.2", "--speed", "0.2"]
STRESSES = ["--normal-stress", "1000", "--normal-stress", "3000"]


@pytest.mark.parametrize(
    ("command", "options", "tables", "rows", "said"),
    [
        ("plate", ["--radius", "0.04", "--sinkage", "0.01", "--samples", "6"], ["plate.csv"], 6, "N/m^(n+2)"),
        (
            "shear",
            ["--radius", "0.04", "--displacement", "0.01", "--samples", "5", *STRESSES],
            ["shear-1000Pa.csv", "shear-3000Pa.csv"],
            5,
            "friction angle",
        ),
        (
            "wheel",
            ["--slip", "0", "--slip", "0.3", "--run-in", "0.01", "--distance", "0.02"],
            ["wheel.csv"],
            2,
            "slip 0.3",
        ),
    ],
)
def test_a_test_writes_its_tables(
    command: str, options: list[str], tables: list[str], rows: int, said: str, tmp_path: Path
) -> None:
    result = CliRunner().invoke(app, ["grains", command, *BED, *options, "--output", str(tmp_path)])
    assert result.exit_code == 0, result.output
    assert said in result.output
    for table in tables:
        with (tmp_path / table).open(encoding="utf-8") as file:
            assert len(list(csv.DictReader(file))) == rows


@pytest.mark.parametrize(
    ("command", "options", "said"),
    [
        ("plate", ["--radius", "0.001"], "radius"),
        ("wheel", ["--slip", "1.5"], "slip"),
        ("wheel", ["--load", "-1"], "load"),
    ],
)
def test_bad_options_are_told_in_one_line(command: str, options: list[str], said: str, tmp_path: Path) -> None:
    result = CliRunner().invoke(app, ["grains", command, *BED, *options, "--output", str(tmp_path)])
    assert result.exit_code == 2
    assert said in result.output
    assert not list(tmp_path.iterdir())
