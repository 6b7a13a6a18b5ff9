from .fit import FittedSoil as FittedSoil, errors_of as errors_of, fit_soil as fit_soil
from .measurements import Runs as Runs, SingleWheel as SingleWheel, read_runs as read_runs
from .rovers import slip_on_slope as slip_on_slope, with_wide_wheels as with_wide_wheels
from .slopes import climbed_slope as climbed_slope
from .soils import Soil as Soil, named_soil as named_soil, soil_names as soil_names
from .trials import Trial as Trial, read_trial as read_trial
