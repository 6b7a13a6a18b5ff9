"""A small rover as URDF, in pieces that tests replace."""

import re
from pathlib import Path

BODY = """
  <link name="{name}">
    <inertial>
      <origin xyz="{centre}" rpy="{turn}"/>
      <mass value="{mass}"/>
      <inertia ixx="0.2" ixy="0.01" ixz="0.02" iyy="0.3" iyz="-0.03" izz="0.4"/>
    </inertial>
    {shapes}
  </link>"""

JOINT = """
  <joint name="{name}" type="{kind}">
    <origin xyz="{at}" rpy="{turn}"/>
    <parent link="{parent}"/>
    <child link="{child}"/>
    <axis xyz="{axis}"/>
    {more}
  </joint>"""

WHEEL = '<collision><origin xyz="0 0.05 0" rpy="1.5707963267948966 0 0"/><geometry><cylinder radius="0.2" length="0.1"/></geometry></collision>'
LIMIT = '<limit lower="-0.6" upper="0.5" effort="30" velocity="2"/>'


def body(name, *, mass=5.0, centre="0.01 0.02 0.03", turn="0.1 0.2 0.3", shapes=""):
    return BODY.format(name=name, mass=mass, centre=centre, turn=turn, shapes=shapes)


def joint(name, kind, parent, child, *, at="0 0 0", turn="0 0 0", axis="0 1 0", more=""):
    return JOINT.format(name=name, kind=kind, parent=parent, child=child, at=at, turn=turn, axis=axis, more=more)


def rover(*, wheel=WHEEL, steer_axis="0 0 1", wheel_axis="0 1 0", extra="", names=("left_wheel", "right_wheel")):
    """Two front wheels that steer on rockers that move oppositely, and one rear wheel."""
    left, right = names
    box = '<collision><geometry><box size="1 0.6 0.2"/></geometry></collision>'
    text = '<?xml version="1.0"?>\n<robot name="small">'
    text += body("chassis", mass=50.0, shapes=box) + '\n  <link name="mast_head"/>'
    text += joint("mast", "fixed", "chassis", "mast_head", at="0.3 0.1 0.5")
    for side, y, name in (("left", 0.5, left), ("right", -0.5, right)):
        more = LIMIT if side == "left" else LIMIT + '<mimic joint="left_pivot" multiplier="-1"/>'
        text += body(f"{side}_rocker")
        text += joint(f"{side}_pivot", "revolute", "chassis", f"{side}_rocker", at=f"0.2 {y} 0", more=more)
        text += body(f"{side}_fork", mass=1.0)
        text += joint(
            f"{side}_steer", "revolute", f"{side}_rocker", f"{side}_fork", at="0.3 0 -0.1", axis=steer_axis, more=LIMIT
        )
        text += body(name, mass=2.0, shapes=wheel)
        text += joint(f"{side}_drive", "continuous", f"{side}_fork", name, at="0 0 -0.1", axis=wheel_axis)
    text += body("rear_wheel", mass=2.0, shapes=wheel)
    text += joint("rear_drive", "continuous", "chassis", "rear_wheel", at="-0.5 0 -0.2", axis=wheel_axis)
    return text + extra + "\n</robot>\n"


def write(folder: Path, text: str, name: str = "robot.urdf") -> Path:
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


def changed(text: str, pattern: str, replacement: str) -> str:
    """The text with the first match replaced, which there must be."""
    result, count = re.subn(pattern, replacement, text, count=1, flags=re.DOTALL)
    assert count == 1, pattern
    return result
