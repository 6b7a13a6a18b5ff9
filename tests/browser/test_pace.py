"""`make pace` counts the pictures of a page in a second, without a graphics card."""

from pathlib import Path

import pytest
from browser.pace import SCENES, pace


@pytest.mark.nightly("tests/browser/test_grain_page.py::test_balls_rover_and_sky_are_where_they_belong")
@pytest.mark.parametrize("name", SCENES)
def test_the_pace_of_a_page_is_measured(name: str, tmp_path: Path) -> None:
    """How fast it is depends on the machine: the manual says what `make pace` found on which."""
    rate, cost, script = pace(SCENES[name](tmp_path), 5.0)
    assert rate > 0.0
    assert cost > 0.0
    assert 0.0 < script < cost
