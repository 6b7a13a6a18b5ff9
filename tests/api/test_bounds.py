"""Sizes and ranges are checked before anything is allocated or searched.

Unchecked, these inputs would allocate terabytes and abort, or run forever.
"""

import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from refusals import refused

from rover_gym import ModelError, RoverModel, SphereField, StepError, TerrainError
from rover_gym.core import (
    BallSimulation,
    DiskSimulation,
    Line,
    Polyline,
    Sine,
    Spline,
    TwoWheelRoverSimulation,
    disk_packing,
)


@contextmanager
def within(seconds: float) -> Iterator[None]:
    """A time limit far above a normal call, far below an unbounded one."""
    begin = time.perf_counter()
    yield
    assert time.perf_counter() - begin < seconds


@pytest.mark.parametrize("count", [10**7, 10**11, 2**63])
def test_a_packing_of_a_hundred_thousand_million_disks_is_refused(count: int) -> None:
    with within(1.0), refused(ModelError, "count", "at most 1000000 disks"):
        disk_packing(count)


def chain(n: int) -> dict[str, Any]:
    """A base and n - 1 solids, each hanging from the one before."""
    shape = {"kind": "box", "size": [0.1, 0.1, 0.1]}
    base = {"name": "s0", "mass": 1.0, "shape": shape}
    link = {"position": [0.1, 0.0, 0.0], "axis": [0.0, 0.0, 1.0], "mass": 1.0, "shape": shape}
    links = [link | {"name": f"s{i}", "parent": f"s{i - 1}"} for i in range(1, n)]
    return {"name": "chain", "solids": [base, *links]}


@pytest.mark.parametrize("n", [1001, 3000, 20_000])
def test_twenty_thousand_solids_are_refused(n: int) -> None:
    with within(10.0), pytest.raises(ModelError, match="at most 1000 solids") as caught:
        RoverModel.from_dict(chain(n))
    assert (caught.value.field, caught.value.value) == ("solids", n)


def test_a_chain_of_a_thousand_solids_is_built_at_once() -> None:
    with within(10.0):
        model = RoverModel.from_dict(chain(1000))
    assert model.nv == 1005
    everything = dict.fromkeys(model.joint_names, 0.0)
    with within(10.0):
        assert model.weld(everything).nv == 6


@pytest.mark.parametrize("key", ["wheels", "tags"])
def test_too_many_wheels_or_tags_are_refused(key: str) -> None:
    description = RoverModel().to_dict()
    description[key] = [description[key][0] | {"name": f"x{i}"} for i in range(1001)]
    with refused(ModelError, key, "at most 1000"):
        RoverModel.from_dict(description)


@pytest.mark.parametrize("text", ["a = " + "[" * 100_000, "a = " + "{a=" * 100_000, "[" * 100_000, "a." * 100_000])
def test_deeply_nested_text_is_a_model_error(text: str) -> None:
    with within(10.0), pytest.raises(ModelError, match="cannot be read"):
        RoverModel.from_text(text)


def test_deeply_nested_dictionaries_are_a_model_error() -> None:
    nested: dict[str, Any] = {}
    for _ in range(100_000):
        nested = {"a": nested}
    with pytest.raises(ModelError, match="cannot be read"):
        RoverModel.from_dict(nested)
    circle: dict[str, Any] = {}
    circle["name"] = circle
    with pytest.raises(ModelError, match="cannot be read"):
        RoverModel.from_dict(circle)


def test_texts_of_gigabytes_are_refused_before_they_are_parsed(tmp_path: Path) -> None:
    long = "#" * (17 << 20)
    with within(5.0), pytest.raises(ModelError, match="bytes"):
        RoverModel.from_text(long)
    path = tmp_path / "long.toml"
    path.write_text(long)
    with within(5.0), pytest.raises(ModelError, match=r"long\.toml"):
        RoverModel.from_file(path)
    if Path("/dev/zero").exists():
        with within(10.0), pytest.raises(ModelError, match="/dev/zero"):
            RoverModel.from_file("/dev/zero")


@pytest.mark.parametrize(
    ("field", "make"),
    [
        ("wavelength", lambda: Sine(0.01, 1e-6)),
        ("amplitude", lambda: Sine(1e308, 1.0)),
        ("amplitude", lambda: Sine(10.0, 1e-3)),
        ("phase", lambda: Sine(1.0, 1.0, 1e300)),
        ("x", lambda: Polyline(np.arange(2_000_001.0), np.zeros(2_000_001))),
        ("x[1]", lambda: Spline([0.0, 1e300], [0.0, 0.0])),
        ("centres", lambda: SphereField.rocks(0.5, (-1e5, -1e5, 1e5, 1e5), 0)),
        ("centres", lambda: SphereField(np.zeros((2_000_001, 3)), np.ones(2_000_001))),
        ("clear", lambda: SphereField.rocks(0.1, (0.0, 0.0, 1.0, 1.0), 0, clear=np.ones((1001, 3)))),
    ],
)
def test_grounds_that_cannot_be_searched_or_held_are_refused(field: str, make: Any) -> None:
    with within(5.0), refused(TerrainError, field):
        make()


@pytest.mark.parametrize(
    "ground",
    [
        Line(),
        Sine(1.0, 2.0),
        Sine(0.1, 1e-3),
        Spline(np.linspace(0.0, 50.0, 2001), np.sin(np.linspace(0.0, 300.0, 2001))),
        Polyline.step(0.0, 0.3),
    ],
    ids=repr,
)
@pytest.mark.parametrize("q", [[0.0, -1e9, 0.0], [1e9, -1e300, 0.0], [0.0, 1e9, 0.0]])
def test_a_ball_a_million_kilometres_down_is_stepped_at_once(ground: Any, q: list[float]) -> None:
    sim = BallSimulation(ground)
    sim.set_state(q, [0.0, -10.0, 0.0])
    with within(5.0):
        assert sim.gaps.shape == (1,)
        with suppress(StepError):
            sim.step(3)


def test_a_polyline_of_a_million_points_is_driven_over() -> None:
    x = np.linspace(-500.0, 500.0, 1_000_000)
    with within(10.0):
        ground = Polyline(x, 1e-4 * (np.arange(x.size) % 2))
        assert ground.height(x).shape == x.shape
        sim = TwoWheelRoverSimulation(ground)
        sim.set_state([0.0, 0.21, 0.0, 0.0, 0.0])
        sim.step(100)
    assert abs(sim.gaps).max() < 1e-3
    fast = BallSimulation(ground)
    fast.set_state([0.0, 2.0, 0.0], [0.0, -1e6, 0.0])
    with within(10.0):
        fast.step(2)


def test_an_abundance_that_vanishes_gives_no_rocks() -> None:
    """The decay overflowed, and the field had no rocks."""
    for abundance in (5e-324, 1e-300, 0.0):
        assert len(SphereField.rocks(abundance, (0.0, 0.0, 10.0, 10.0), 0)) == 0


def test_disks_flung_to_the_end_of_the_world_is_stepped_or_refused() -> None:
    sim = DiskSimulation([0.1, 0.1], [1.0, 1.0], [[0.0, 0.0], [1.0, 0.0]])
    sim.set_state([[0.0, 0.0, 0.0], [1e300, -1e300, 0.0]], [[1e300, 0.0, 0.0], [0.0, 0.0, 0.0]])
    with within(5.0), suppress(StepError):
        sim.step()
