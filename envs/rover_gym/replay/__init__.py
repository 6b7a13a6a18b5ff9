"""Exports saved runs for other programs: a browser page, VRML97, glTF."""

from rover_gym.replay.gltf import write_gltf
from rover_gym.replay.page import write_page
from rover_gym.replay.record_episodes import RecordEpisodes
from rover_gym.replay.vrml import write_vrml

__all__ = ["RecordEpisodes", "write_gltf", "write_page", "write_vrml"]
