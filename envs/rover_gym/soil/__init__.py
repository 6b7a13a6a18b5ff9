"""Granular soil: settled beds, the two-wheel rover on them, recordings, and trials with their statistics.

>>> from rover_gym.soil import rover_on_soil
>>> sim = rover_on_soil(count=222, layers=3)
>>> sim.set_torques([50.0, 50.0])
>>> sim.step(100).steps
100
"""

from rover_gym.mechanics import GrainContacts, SoilSimulation, soil_packing
from rover_gym.soil.bed import Bed, rover_on_soil, settled_bed
from rover_gym.soil.soil_run import SoilRun, SoilSampler
from rover_gym.soil.soil_trials import (
    BedEstimate,
    Pull,
    SoilDrive,
    Traction,
    drawbar_pull,
    drive_on_soil,
    fit_traction,
    over_beds,
)

__all__ = [
    "Bed",
    "BedEstimate",
    "GrainContacts",
    "Pull",
    "SoilDrive",
    "SoilRun",
    "SoilSampler",
    "SoilSimulation",
    "Traction",
    "drawbar_pull",
    "drive_on_soil",
    "fit_traction",
    "over_beds",
    "rover_on_soil",
    "settled_bed",
    "soil_packing",
]
