"""Public files of wheeled robots, arms and pendulums that ship in packages, with the options that they are read with."""

import importlib.util
from pathlib import Path

#: By package and path: options of `RoverModel.from_urdf`.
URDF = {
    "pybullet_data/husky/husky.urdf": {},
    "pybullet_data/racecar/racecar.urdf": {},
    "pybullet_data/r2d2.urdf": {},
    "pybullet_data/franka_panda/panda.urdf": {"free_base": False, "wheels": []},
    "pybullet_data/kuka_iiwa/model.urdf": {"free_base": False, "wheels": []},
}
#: The same for `RoverModel.from_mjcf`.
MJCF = {
    "gymnasium/envs/mujoco/assets/ant.xml": {"wheels": []},
    "gymnasium/envs/mujoco/assets/inverted_double_pendulum.xml": {"wheels": []},
}


def place(name: str) -> Path | None:
    """The file, or None where its package is not installed."""
    package, _, path = name.partition("/")
    found = importlib.util.find_spec(package)
    if found is None or found.origin is None:
        return None
    file = Path(found.origin).parent / path
    return file if file.is_file() else None
