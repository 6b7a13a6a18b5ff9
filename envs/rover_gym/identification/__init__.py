"""Identification: parameters of rover and ground from a recorded run, with their uncertainty."""

from rover_gym.identification.estimates import Estimate, Identification
from rover_gym.identification.identifying import identify
from rover_gym.identification.parameters import Parameter, Setup

__all__ = ["Estimate", "Identification", "Parameter", "Setup", "identify"]
