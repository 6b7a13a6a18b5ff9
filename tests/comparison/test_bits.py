"""Hashes of trajectories tell a changed bit."""

from collections.abc import Iterator

import numpy as np

from comparison import bits


def test_a_hash_tells_the_last_bit_and_the_order() -> None:
    def rows(*numbers: float) -> Iterator[object]:
        yield from ((np.array([x]), 1.0) for x in numbers)

    plain = bits.digest(rows(1.0, 2.0))
    assert plain == bits.digest(rows(1.0, 2.0))
    assert plain != bits.digest(rows(1.0, np.nextafter(2.0, 3.0)))
    assert plain != bits.digest(rows(2.0, 1.0))


def test_a_trajectory_that_changed_or_is_new_or_gone_is_named() -> None:
    assert bits.differences({"a": "1", "b": "2", "c": "3"}, {"a": "1", "b": "4", "d": "5"}) == ["b", "c", "d"]


def test_the_same_trajectory_has_the_same_hash_twice() -> None:
    trajectory = bits.trajectories()["batch of eight among rocks"]
    assert bits.digest(trajectory()) == bits.digest(trajectory())
