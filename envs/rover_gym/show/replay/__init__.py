"""Exports saved runs for other programs: a browser page, VRML97, glTF."""

from rover_gym.show.replay.gltf import write_gltf
from rover_gym.show.replay.page import write_page
from rover_gym.show.replay.record_episodes import RecordEpisodes
from rover_gym.show.replay.vrml import write_vrml

__all__ = ["RecordEpisodes", "write_gltf", "write_page", "write_vrml"]
