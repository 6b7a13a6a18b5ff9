"""Angles of robot files that are multiples of pi/2 with few digits."""

import math

import numpy as np
import pytest
from models.robot_files import body, joint, rover, write

from rover_gym import RoverModel
from rover_gym.models.robot_tree import right_angle

pytest.importorskip("yourdfpy")


@pytest.mark.parametrize(
    ("word", "count", "name"),
    [
        ("1.5708", 1, "pi/2"),
        ("1.5707", 1, "pi/2"),
        ("1.57", 1, "pi/2"),
        ("-1.571", -1, "-pi/2"),
        ("3.14159", 2, "pi"),
        ("3.1416", 2, "pi"),
        ("3.14", 2, "pi"),
        ("-3.1415926", -2, "-pi"),
        ("4.7124", 3, "3 pi/2"),
        ("-6.2832", -4, "-2 pi"),
        ("15708e-4", 1, "pi/2"),
    ],
)
def test_a_multiple_of_half_pi_has_all_its_digits(word, count, name):
    assert right_angle(word) == (count * math.pi / 2, name)


@pytest.mark.parametrize(
    "word",
    ["0", "0.00", "1.6", "2", "3", "3.1", "1.58", "1.5", "1.5712", "3.1420", "3.15", "0.7854", "1.0472", "1.5707963267948966", "1e9", "1.57e5", "1.5708000", "1e-400", "1.5708" + "0" * 40, "9" * 400],
)  # fmt: skip
def test_other_angles_stay_as_they_are(word):
    assert right_angle(word) is None


def test_wheels_turned_by_3_14159_stand_as_those_turned_by_pi(tmp_path):
    """AgileX's Limo: two of its wheels are turned by 3.14159, which left them 2.65e-6 rad askew and two without load."""
    models = []
    for turn in ("3.14159", repr(math.pi)):
        text = rover(
            extra=body("camera", mass=1.0) + joint("mount", "fixed", "chassis", "camera", turn=f"1.5708 0 {turn}")
        )
        models.append(RoverModel.from_urdf(write(tmp_path, text)))
    rounded, exact = models
    assert rounded == exact
    listed = "\n".join(rounded.import_report.assumed)
    assert "3.14159 rad is read as pi: line" in listed
    assert "1.5708 rad is read as pi/2: line" in listed
    assert "joint[mount].origin.rpy" in listed
    assert "read as pi:" not in "\n".join(exact.import_report.assumed)
    np.testing.assert_allclose(exact.poses(np.zeros(exact.nq))["camera"][1][1], [0.0, 0.0, -1.0], atol=1e-15)


RADIANS = """
<mujoco model="cart">
  <compiler angle="{unit}" autolimits="true"/>
  <default><default class="rim"><geom type="cylinder" size="0.15 0.04" euler="{quarter} 0 0"/></default></default>
  <worldbody>
    <body name="chassis" pos="0 0 1">
      <freejoint/>
      <geom type="box" size="0.5 0.3 0.1" mass="10"/>
      <body name="wheel_left" pos="0.3 0.4 -0.1"><joint axis="0 1 0"/><geom class="rim"/></body>
      <frame axisangle="0 0 1 {half}">
        <body name="wheel_right" pos="0.3 0.4 -0.1"><joint axis="0 -1 0"/><geom class="rim"/></body>
      </frame>
      <body name="tail" pos="-0.4 0 0" euler="0 {other} {half}">
        <inertial pos="0 0 0" axisangle="1 0 0 {quarter}" mass="1" diaginertia="0.1 0.2 0.25"/>
      </body>
    </body>
  </worldbody>
</mujoco>
"""


def test_radians_of_an_mjcf_are_completed_as_those_of_a_urdf_are(tmp_path):
    """1.5708 in radians left the wheels of an MJCF askew, while a URDF's were not."""
    pytest.importorskip("mujoco")
    given = {
        "rounded": {"unit": "radian", "quarter": "1.5708", "half": "3.14159", "other": "0.3"},
        "exact": {"unit": "radian", "quarter": repr(math.pi / 2), "half": repr(math.pi), "other": "0.3"},
    }
    models = {
        name: RoverModel.from_mjcf(write(tmp_path, RADIANS.format(**words), f"{name}.xml"))
        for name, words in given.items()
    }
    assert models["rounded"] == models["exact"]
    listed = "\n".join(models["rounded"].import_report.assumed)
    assert listed.count("1.5708 rad is read as pi/2: line") == 1
    for place in ("geom[]", "body[tail].inertial"):
        assert place in listed
    assert "3.14159 rad is read as pi" in listed
    assert "frame[]" in listed
    assert "body[tail]" in listed
    assert "read as pi" not in "\n".join(models["exact"].import_report.assumed)


def test_degrees_of_an_mjcf_stay_as_they_are(tmp_path):
    """1.57 degrees are no right angle."""
    pytest.importorskip("mujoco")
    words = {"unit": "degree", "quarter": "90", "half": "180", "other": "1.57"}
    model = RoverModel.from_mjcf(write(tmp_path, RADIANS.format(**words), "degrees.xml"))
    assert "read as" not in "\n".join(model.import_report.assumed)
