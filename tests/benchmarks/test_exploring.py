"""The recorded drives of random policies, and how the bench adds its figures up."""

import numpy as np
import pytest
from comparison import exploring_bench as bench
from comparison.exploring import GROUNDS, PERIODS, SEEDS, TORQUES, drives, scene
from comparison.peers.base import Variant
from comparison.peers.ours import OurRunner
from comparison.run import run


def test_every_drive_is_recorded_whole_and_no_two_are_alike() -> None:
    assert [drive.seed for drive in drives()] == list(SEEDS)
    for drive in drives():
        assert drive.actions.shape == (PERIODS, 12)
        assert np.abs(drive.actions).max() <= 1.0
        assert np.linalg.norm(drive.normal) == pytest.approx(1.0)
        assert drive.spheres[:, 3].min() > 0.0
    assert len({drive.actions.tobytes() for drive in drives()}) == len(drives())
    assert len({drive.spheres.tobytes() for drive in drives()}) == len(drives())


@pytest.mark.parametrize("ground", GROUNDS)
def test_a_drive_starts_free_of_the_ground_and_gets_to_its_end(ground: str) -> None:
    played = scene(drives()[0], ground, TORQUES[-1], periods=4)
    runner = OurRunner(played, 0.005)
    assert runner.simulation.deepest_overlap > -1e-6  # coordinates are rounded to 1 um
    trace = run(Variant("rover-gym", "", OurRunner, "", ""), played, 0.005)
    assert not trace.failure
    assert len(trace.positions) == round(played.duration / played.sample) + 1


def test_shares_of_a_histogram_fall_into_the_bins_of_their_titles() -> None:
    found = dict(zip(bench.titles(), bench.shares([(0, 1), (5, 2), (6, 1), (128, 3), (500, 1)]), strict=True))
    assert {title: share for title, share in found.items() if share} == {
        "0": 0.125,
        "5-6": 0.375,
        "65-128": 0.375,
        "129+": 0.125,
    }
