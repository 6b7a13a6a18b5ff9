"""Frames and pages have one look: the same instant of a drive from the same eye, drawn by both engines."""

from pathlib import Path

import numpy as np
import pytest
from browser.one_look import both, difference, grounds

# Means of squares of 8 pixels differ by 2 to 3 levels of 255, and in the worst tenth of the squares by 5 to 7
# (`python -m browser.one_look`): pages have no antialiasing in software, and their shadows come from a map of 1024
# pixels, those of frames from flattened bodies. The two colours of tiles are 18 levels apart, the grain spans 40, and a
# twentieth more light is 8: swapped tiles, another grain, exposure, Sun, haze or eye exceed these bounds.
MEAN, WORST_TENTH = 5.0, 11.0
OTHER_GROUND = pytest.mark.nightly("tests/browser/test_one_look.py::test_a_frame_and_a_page_show_the_same")


@pytest.mark.parametrize(
    "ground", [pytest.param("plane", marks=OTHER_GROUND), "rocks", pytest.param("hills", marks=OTHER_GROUND)]
)
def test_a_frame_and_a_page_show_the_same(ground: str, tmp_path: Path) -> None:
    """Tiles were swapped, hills had none in frames and ended after a few metres on pages, and light was another."""
    frame, page = both(grounds()[ground], tmp_path)
    found = difference(frame, page)
    assert found["mean"] < MEAN
    assert found["worst tenth"] < WORST_TENTH
    # The measure tells pictures apart that look alike to it: a little darker, or seen from elsewhere.
    assert difference(0.94 * frame, page)["mean"] > MEAN
    assert difference(np.roll(frame, 40, axis=1), page)["worst tenth"] > WORST_TENTH
