"""A pit: its ground, what fills it, and what is refused."""

import numpy as np
import pytest

from rover_gym.core import OptionError
from rover_gym.ground.grains import Pit

PIT = Pit(begin=0.0, length=0.8, width=0.6, depth=0.1, bank_deg=45.0, reach=5.0)


def test_its_ground_has_the_stated_shape():
    heights = PIT.terrain.heights([(-0.1, 0.0), (0.05, 0.0), (0.4, 0.0), (0.4, 0.25), (0.85, 0.0), (0.4, 0.35)])
    np.testing.assert_allclose(heights, [0.0, -0.05, -0.1, -0.05, 0.0, 0.0], atol=1e-6)


def test_its_volume_is_that_of_a_sum_over_the_map():
    x, z = np.meshgrid(np.linspace(0.0, 0.8, 161), np.linspace(-0.3, 0.3, 121), indexing="ij")
    heights = PIT.terrain.heights(np.column_stack((x.ravel(), z.ravel())))
    assert -heights.mean() * 0.8 * 0.6 == pytest.approx(PIT.volume, rel=0.02)


def test_a_fill_rests_in_it_to_the_brim():
    fill = PIT.fill(0.014, 0.018, seed=2, time_step=4e-3)
    top = (fill.position[:, 1] + fill.radius).max()
    assert -0.01 < top < 0.04
    depth = PIT.terrain.heights(fill.position[:, [0, 2]]) - (fill.position[:, 1] - fill.radius)
    assert depth.max() < 0.02  # beside a bank the nearest point is not below
    assert len(fill.radius) > 0.8 * PIT.count(0.016)
    sim = fill.simulation(time_step=4e-3)
    sim.step(25)
    assert np.abs(sim.position - fill.position).max() < 0.016
    assert sim.penetration() < 0.01 * 0.014
    mirrored = fill.mirrored(along_x=True, along_z=True)
    np.testing.assert_allclose(mirrored.position[:, 0] + fill.position[:, 0], 0.8)
    np.testing.assert_array_equal(mirrored.position[:, 2], -fill.position[:, 2])
    assert mirrored.simulation().penetration() < 0.01 * 0.014


@pytest.mark.parametrize(
    ("name", "value"),
    [("length", -1.0), ("depth", 0.0), ("bank_deg", 85.0), ("width", 0.15), ("reach", 0.1), ("begin", np.nan)],
)
def test_a_bad_pit_is_refused(name, value):
    with pytest.raises(OptionError, match=name):
        Pit(**{"begin": 0.0, "length": 0.8, "width": 0.6, "depth": 0.1, "bank_deg": 45.0, "reach": 5.0, name: value})


def test_too_many_or_too_large_balls_are_refused_before_they_are_made():
    with pytest.raises(OptionError, match="GB"):
        PIT.fill(1e-4, 1e-4)
    with pytest.raises(OptionError, match="radius_max"):
        PIT.fill(0.05, 0.06)
    with pytest.raises(OptionError, match="radius_min"):
        PIT.fill(-0.01, 0.02)


def test_a_pit_is_filled_evenly() -> None:
    fill = Pit(length=1.8, width=1.9, depth=0.06, bank_deg=12.0).fill(0.0243, 0.0297, time_step=4e-3)
    right = fill.position[:, 2] > 0.0
    assert fill.mass[right].sum() == pytest.approx(fill.mass[~right].sum(), rel=0.04)
