"""Rovers of a batch that go on from the middle of an episode."""

import numpy as np
import numpy.typing as npt
import pytest

from rover_gym.mechanics import EpisodeBatch, OptionError, Plane
from rover_gym.vector.batch import RoverBatch


def begun(**arguments: object) -> RoverBatch:
    batch = RoverBatch(2, threads=1, terrain="rocks", difficulty=0.8, **arguments)  # type: ignore[arg-type]
    batch.begin(batch.draw([0, 1], [7, 8]))
    return batch


def driven(episodes: EpisodeBatch, actions: npt.NDArray[np.float64], steps: int) -> list[npt.NDArray[np.float32]]:
    return [episodes.step(actions)[0] for _ in range(steps)]


def test_a_copy_of_a_rover_continues_bit_for_bit() -> None:
    first, second = (begun(observation_noise=0.01).episodes for _ in range(2))
    n = len(first.observations()[0])
    assert n > 0
    actions = np.full((2, first.episode(0).state()["previous_action"].size), 0.4)
    driven(first, actions, 15)
    rover = first.simulation(0)
    second.resume([1], rover, first.episode(0), first.origin(0), generator=first.generators([0]), steps=first.steps(0))
    assert second.steps(1) == 15
    assert second.origin(1)[2] == first.origin(0)[2]
    for _ in range(20):
        one, other = first.step(actions), second.step(actions)
        assert one[0][0].tobytes() == other[0][1].tobytes()
        assert one[1][0] == other[1][1]
    assert first.info(0) == second.info(1)


def test_bad_arguments_change_nothing() -> None:
    episodes = begun().episodes
    before = episodes.observations()
    rover, episode, origin = episodes.simulation(0), episodes.episode(0), episodes.origin(0)
    noise = episodes.generators([0])
    for bad, field in (
        (lambda: episodes.resume([5], rover, episode, origin, generator=noise), "index"),
        (lambda: episodes.resume([1], Plane(), episode, origin, generator=noise), "simulation"),  # type: ignore[arg-type]
        (lambda: episodes.resume([1], rover, rover, origin, generator=noise), "episode"),  # type: ignore[arg-type]
        (lambda: episodes.resume([1], rover, episode, origin[:3], generator=noise), "origin"),  # type: ignore[arg-type]
        (lambda: episodes.resume([1], rover, episode, origin, generator=noise[:0]), "generator"),
        (lambda: episodes.resume([1], rover, episode, origin, generator=noise, steps=-1), "steps"),
    ):
        with pytest.raises(OptionError, match=field):
            bad()
    assert (episodes.observations() == before).all()
