"""Figures of recorded runs: general ones for any run, and those of the report's sections 6.1 and 6.2."""

from rover_gym.show.figures.drawing import draw_overview, draw_run
from rover_gym.show.figures.section_6_1 import draw_section_6_1, draw_section_6_2

__all__ = ["draw_overview", "draw_run", "draw_section_6_1", "draw_section_6_2"]
