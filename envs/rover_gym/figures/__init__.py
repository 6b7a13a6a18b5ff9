"""Figures of recorded runs: those of the report's sections 6.1 and 6.2, one room a section."""

from rover_gym.figures.section_6_1 import draw_all
from rover_gym.figures.section_6_2 import draw_rug

__all__ = ["draw_all", "draw_rug"]
