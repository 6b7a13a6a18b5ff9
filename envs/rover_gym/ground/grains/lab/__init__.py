"""The virtual laboratory: plate, shear and wheel tests on beds of balls, and laws of soft soil fitted to them."""

from rover_gym.ground.grains.lab.fits import (
    PressureLaw,
    ShearLaw,
    Strength,
    fit_pressure,
    fit_pull,
    fit_shear,
    fit_strength,
)
from rover_gym.ground.grains.lab.plate_and_shear import PlatePoint, ShearPoint, plate_test, shear_test
from rover_gym.ground.grains.lab.rig import write_table
from rover_gym.ground.grains.lab.wheel import WheelPoint, wheel_test

__all__ = [
    "PlatePoint",
    "PressureLaw",
    "ShearLaw",
    "ShearPoint",
    "Strength",
    "WheelPoint",
    "fit_pressure",
    "fit_pull",
    "fit_shear",
    "fit_strength",
    "plate_test",
    "shear_test",
    "wheel_test",
    "write_table",
]
