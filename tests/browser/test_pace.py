"""What a picture of a page costs without a graphics card; `make pace` counts pictures a second."""

from pathlib import Path

import pytest
from browser.pace import SCENES, pace


@pytest.mark.nightly("tests/browser/test_grain_page.py::test_balls_rover_and_sky_are_where_they_belong")
@pytest.mark.parametrize(("name", "most"), [("plane", 0.1), ("rocks", 0.16), ("balls", 0.3)])
def test_a_picture_costs_little_processor_time(name: str, most: float, tmp_path: Path) -> None:
    """With two free cores: 10 pictures a second on the plane, and 6 among 2600 rocks and with 20 000 balls."""
    _, cost, script = pace(SCENES[name](tmp_path), 5.0)
    assert cost < most
    assert script < 0.01
