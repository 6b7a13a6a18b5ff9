from .fit import FittedSoil, errors_of, fit_soil
from .measurements import Runs, SingleWheel, read_runs
from .rovers import slip_on_slope, with_wide_wheels
from .slopes import climbed_slope
from .soils import Soil, named_soil, soil_names
from .trials import Trial, read_trial

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
