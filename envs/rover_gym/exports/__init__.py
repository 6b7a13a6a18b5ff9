"""Runs, policies, simulations and contact problems for other programs."""

from rover_gym.exports.fclib import ContactProblem, read_fclib, write_fclib
from rover_gym.exports.fmu import write_fmu
from rover_gym.exports.mcap_writer import McapWriter, write_mcap
from rover_gym.exports.minari_data import write_dataset
from rover_gym.exports.onnx_policy import onnx_policy, write_onnx

__all__ = [
    "ContactProblem",
    "McapWriter",
    "onnx_policy",
    "read_fclib",
    "write_dataset",
    "write_fclib",
    "write_fmu",
    "write_mcap",
    "write_onnx",
]
