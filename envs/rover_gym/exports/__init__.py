"""Runs, policies and simulations for other programs."""

from rover_gym.exports.fmu import write_fmu
from rover_gym.exports.mcap_writer import McapWriter, write_mcap
from rover_gym.exports.minari_data import write_dataset
from rover_gym.exports.onnx_policy import onnx_policy, write_onnx

__all__ = ["McapWriter", "onnx_policy", "write_dataset", "write_fmu", "write_mcap", "write_onnx"]
