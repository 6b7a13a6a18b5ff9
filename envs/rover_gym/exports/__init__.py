"""Runs, policies and simulations for other programs."""

from rover_gym.exports.mcap_run import write_mcap
from rover_gym.exports.mcap_writer import McapWriter

__all__ = ["McapWriter", "write_mcap"]
