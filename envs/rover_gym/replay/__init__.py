"""Exports saved runs for other programs: a browser page, VRML97, glTF."""

from rover_gym.replay.gltf import write_gltf
from rover_gym.replay.grain_page import write_grain_page
from rover_gym.replay.page import write_page
from rover_gym.replay.planar_page import write_planar_page
from rover_gym.replay.soil_page import write_soil_page
from rover_gym.replay.vrml import write_vrml

__all__ = ["write_gltf", "write_grain_page", "write_page", "write_planar_page", "write_soil_page", "write_vrml"]
