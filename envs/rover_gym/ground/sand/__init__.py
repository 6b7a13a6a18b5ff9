"""Wheels on sand: soils, a virtual test bed for one wheel, and fits to measurements."""

from rover_gym.ground.sand.fit import FittedSoil, errors_of, fit_soil
from rover_gym.ground.sand.measurements import Runs, SingleWheel, read_runs
from rover_gym.ground.sand.rovers import slip_on_slope, with_wide_wheels
from rover_gym.ground.sand.slopes import climbed_slope
from rover_gym.ground.sand.soils import Soil, named_soil, soil_names
from rover_gym.ground.sand.trials import Trial, read_trial

__all__ = [
    "FittedSoil",
    "Runs",
    "SingleWheel",
    "Soil",
    "Trial",
    "climbed_slope",
    "errors_of",
    "fit_soil",
    "named_soil",
    "read_runs",
    "read_trial",
    "slip_on_slope",
    "soil_names",
    "with_wide_wheels",
]
