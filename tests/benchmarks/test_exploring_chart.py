"""The chart's exploring drives: their references, and that ours approaches them."""

import numpy as np
import pytest
from comparison import exploring_chart as chart
from comparison.ensembles import drive
from comparison.scene import distance


@pytest.mark.parametrize(("ground", "torque"), chart.SCENES)
def test_every_drive_has_a_reference_of_its_length(ground: str, torque: float) -> None:
    played = chart.members(ground, torque)
    known = chart.references()[played[0].name]
    assert len(known) == len(played)
    for member in known:
        path = np.array(member["path"])
        assert path.shape == (round(chart.HORIZON / chart.PERIOD) + 1, 3)
        assert not path[0].any()
        assert member["change"] < chart.SETTLED or member["step"] == chart.FINEST


@pytest.mark.parametrize(("ground", "torque"), chart.SCENES)
def test_smaller_steps_come_nearer_to_the_reference(ground: str, torque: float) -> None:
    played = chart.members(ground, torque)[:3]
    paths = [np.array(member["path"]) for member in chart.references()[played[0].name]]
    errors = {
        step: np.median(
            [distance(chart.driven(drive(one, step)[0]), path) for one, path in zip(played, paths[:3], strict=True)]
        )
        for step in (1e-2, 1e-3)
    }
    assert errors[1e-3] < 0.3 * errors[1e-2]


def test_an_engine_without_a_figure_leaves_a_gap_in_the_table() -> None:
    point = {"scene": "s", "engine": "E", "variant": "v"}
    engine = {"engine": "E", "variant": "v"}
    done = point | {"step": 0.01, "error": 2e-3, "cpu_ms_per_s": 1.5}
    data = {"points": [done, point | {"step": 0.005, "failure": "no"}], "changes": {"s": 3e-6}, "engines": [engine]}
    assert chart.table_of(data, "s").splitlines()[-1] == "| E, v | 2, 1.5 ms/s | - |"
