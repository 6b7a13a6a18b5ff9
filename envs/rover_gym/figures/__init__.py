"""Figures of recorded runs: those of any run, and those of the report's sections 6.1 and 6.2."""

from rover_gym.figures.run import draw_run
from rover_gym.figures.section_6_1 import draw_all
from rover_gym.figures.section_6_2 import draw_rug

__all__ = ["draw_all", "draw_rug", "draw_run"]
