"""The manual's page of robot files has a row for every feature that an import refuses."""

import re
from pathlib import Path

import pytest
from models.robot_files import write

from rover_gym import ModelError, RoverModel

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "robot-files.md").read_text(encoding="utf-8")
SOURCES = (ROOT / "envs" / "rover_gym" / "models").glob("*.py")


def test_every_refused_feature_has_its_row():
    named = {row for source in SOURCES for row in re.findall(r'row="([^"]+)"', source.read_text(encoding="utf-8"))}
    assert len(named) > 8
    first_columns = re.findall(r"^\| (.*?) \|", PAGE, re.MULTILINE)
    rows = {name for column in first_columns for name in re.findall(r"`([^`]+)`", column)}
    assert named | {"flex", "plugin", "mocap"} <= rows


def test_a_refusal_names_its_row(tmp_path):
    pytest.importorskip("mujoco")
    body = '<body><freejoint/><geom size="1"/></body>'
    text = f'<mujoco><option viscosity="1"/><worldbody>{body}</worldbody></mujoco>'
    with pytest.raises(
        ModelError, match=r"ignore=\[\"fluid\"\] leaves it out \(robot files, row 'option density'\), got"
    ):
        RoverModel.from_mjcf(write(tmp_path, text, "ball.xml"))
