"""Episodes are drawn in the compiled core: from NumPy's numbers, and the same on any threads and any processor."""

import hashlib
import math
import os
import subprocess
import sys
from typing import Any

import numpy as np
import pytest
from refusals import refused

from rover_gym import OptionError, Plane, RoverEnv
from rover_gym.core import (
    EpisodeBatch,
    EpisodeDistribution,
    Simulation,
    seed_generators,
    standard_normals,
)
from rover_gym.envs.generators import fresh_seed, generator_at, row_of
from rover_gym.envs.vector import RoverVectorEnv

#: Everything that can be drawn is drawn.
ALL_DRAWN: dict[str, Any] = {
    "terrain": "rocks",
    "difficulty": (0.0, 0.6),
    "friction": (0.5, 0.9),
    "mass_scale": (0.8, 1.2),
    "actuator_gain": (0.9, 1.1),
    "gravity_scale": (0.4, 1.0),
    "observation_noise": 0.02,
}


def numpys(seed: int) -> np.random.Generator:
    return np.random.Generator(np.random.PCG64(seed))


@pytest.mark.parametrize("seed", [0, 1, 12345, 2**32, 2**63, 2**64 - 1, 2**128 + 3, 2**400 - 1])
def test_seeds_give_the_states_and_normal_numbers_of_numpy(seed: int) -> None:
    generator = numpys(seed)
    rows = seed_generators([seed])
    np.testing.assert_array_equal(rows, row_of(generator)[None])
    for size in (1, 91, 5000):
        numbers, rows = standard_normals(rows, size)
        assert numbers.tobytes() == generator.standard_normal((1, size)).tobytes()
        np.testing.assert_array_equal(rows[0], row_of(generator))
    assert generator_at(rows[0]).random() == generator.random()


@pytest.mark.parametrize("seed", range(5))
def test_a_reset_draws_what_numpy_would_draw(seed: int) -> None:
    env = RoverEnv(**ALL_DRAWN)
    observation, info = env.reset(seed=seed)
    generator = numpys(seed)
    difficulty, rock_seed = generator.uniform(0.0, 0.6), int(generator.integers(2**63))
    slope = generator.uniform(0.0, math.radians(10.0) * difficulty)
    uphill, heading = (generator.uniform(-math.pi, math.pi) for _ in range(2))
    distance, bearing = generator.uniform(5.0, 10.0), generator.uniform(-math.pi / 2.0, math.pi / 2.0)
    assert (env.rocks.difficulty, env.rocks.seed) == (difficulty, rock_seed)
    assert (env.start.slope, env.start.uphill, env.start.heading) == (slope, uphill, heading)
    assert env.goal == pytest.approx(
        (distance * math.cos(heading + bearing), -distance * math.sin(heading + bearing)), abs=1e-14
    )
    ranges = {name: ALL_DRAWN[name] for name in ("mass_scale", "friction", "actuator_gain", "gravity_scale")}
    expected = {name: generator.uniform(*span) for name, span in ranges.items()}
    assert info["domain"] == env.domain.as_info() == expected
    noise = 0.02 * generator.standard_normal(91) * env.observation_layout.unbounded
    exact = RoverEnv(**{**ALL_DRAWN, "observation_noise": 0.0}).reset(seed=seed)[0]
    np.testing.assert_allclose(observation, exact + noise, atol=1e-6)
    assert env.np_random.bit_generator.state == generator.bit_generator.state


def test_numbers_that_a_user_draws_are_not_drawn_again() -> None:
    env, vector = RoverEnv(**ALL_DRAWN), RoverVectorEnv(3, threads=2, **ALL_DRAWN)
    generator = numpys(4)
    env.reset(seed=4)
    vector.reset(seed=[3, 4, 5])
    action = np.full(12, 0.1, np.float32)
    for _ in range(2):
        user, other = env.np_random, vector.np_random[1]
        assert user.normal() == other.normal()
        assert user.integers(100) == other.integers(100)  # leaves half of a number for the next such draw
        alone, together = env.step(action)[0], vector.step(np.tile(action, (3, 1)))[0]
        assert alone.tobytes() == together[1].tobytes()
        assert (
            env.reset()[0].tobytes()
            == vector.reset(options={"reset_mask": np.array([False, True, False])})[0][1].tobytes()
        )
        assert user is env.np_random
        assert other is vector.np_random[1]
        assert user.bit_generator.state == other.bit_generator.state
    assert user.random() != generator.random()
    vector.reset(seed=8)
    assert vector.np_random[1] is not other


def test_another_kind_of_generator_is_refused_before_anything_changes() -> None:
    env = RoverEnv()
    env.reset(seed=0)
    before = env.start
    env.np_random = np.random.Generator(np.random.MT19937(0))
    with pytest.raises(OptionError, match="np_random: must be a generator over PCG64"):
        env.reset()
    assert env.start == before
    env.reset(seed=1)
    assert env.start != before


def test_an_unseeded_rover_has_a_seed_that_repeats_its_episode() -> None:
    vector = RoverVectorEnv(2, threads=1)
    first, _ = vector.reset()
    seeds = vector.np_random_seed
    assert seeds[0] != seeds[1]
    assert vector.reset(seed=list(seeds))[0].tobytes() == first.tobytes()
    assert fresh_seed() != fresh_seed()


@pytest.mark.parametrize("mode", ["NextStep", "SameStep"])
def test_scenes_do_not_hang_on_the_number_of_threads(mode: str) -> None:
    runs = []
    for threads in (1, 2, 5):
        env = RoverVectorEnv(7, threads=threads, autoreset_mode=mode, max_episode_steps=2, **ALL_DRAWN)
        assert env.batch.episodes.threads == threads
        seen = [env.reset(seed=0)[0]]
        seen += [env.step(np.full((7, 12), 0.2, np.float32))[0] for _ in range(5)]
        fields = [rover.simulation.terrain.centres for rover in env.envs]
        runs.append(b"".join(one.tobytes() for one in [*seen, *fields]))
    assert runs[0] == runs[1] == runs[2]


def test_episodes_can_be_drawn_without_an_environment() -> None:
    task = RoverEnv(terrain="rocks").task
    rows, fixed = seed_generators([1, 2, 3]), {"difficulty": 0.2, "position": (1.0, 2.0)}
    one, two = (EpisodeBatch(task.rules, Simulation(), 4, threads=threads) for threads in (1, 2))
    drawn, again = one.draw(task.episodes, rows, fixed=fixed), two.draw(task.episodes, rows, fixed=[fixed] * 3)
    assert len(drawn) == len(again) == 3
    one.begin([3, 0, 1], drawn)
    two.begin([3, 0, 1], again)
    for i in (3, 0, 1):
        assert one.simulation(i).snapshot() == two.simulation(i).snapshot()
        np.testing.assert_array_equal(one.terrain(i).centres, two.terrain(i).centres)
        start, rocks, _, _ = one.origin(i)
        assert (rocks[0], *start[2:4]) == (0.2, 1.0, 2.0)
    np.testing.assert_array_equal(one.generators([3, 1]), drawn.generators[[0, 2]])
    np.testing.assert_array_equal(drawn.generators, again.generators)
    one.set_generators([1], rows[:1])
    np.testing.assert_array_equal(one.generators([3, 1]), [drawn.generators[0], rows[0]])
    assert one.simulation(2).snapshot() == Simulation().snapshot()
    before = one.generators([0])
    for call, given in ((one.begin, drawn), (one.set_generators, rows)):
        for indices in ([0, 1], [0, 1, 4], [0, 1, -1], 3):
            with pytest.raises(OptionError, match=r"indices|index"):
                call(indices, given)  # type: ignore[operator]
    other = EpisodeBatch(RoverEnv(goal_tolerance=0.7).task.rules, Simulation(), 3)
    with pytest.raises(OptionError, match="rules"):
        other.begin([0, 1, 2], drawn)
    with pytest.raises(OptionError, match="not begun"):
        one.set_generators([0, 2, 3], rows)
    np.testing.assert_array_equal(one.generators([0]), before)


@pytest.mark.parametrize(
    ("arguments", "field"),
    [
        ({"generators": [[1, 2, 3, 4]]}, "generators"),
        ({"generators": np.zeros((2, 3), np.uint64)}, "generators"),
        ({"difficulties": [None]}, "difficulties"),
        ({"difficulties": [None, (0.4, 0.2)]}, "difficulties[1]"),
        ({"fixed": [{}]}, "fixed"),
        ({"fixed": {"slope": "steep"}}, "fixed.slope"),
        ({"fixed": {"goal": (1.0, 2.0, 3.0)}}, "fixed.goal"),
        ({"fixed": {"q": [0.0]}}, "q"),
        ({"attempts": -1}, "attempts"),
    ],
)
def test_a_bad_request_for_episodes_is_refused_by_name(arguments: dict[str, Any], field: str) -> None:
    task = RoverEnv().task
    request: dict[str, Any] = {"generators": seed_generators([1, 2]), **arguments}
    with refused(ValueError, field, r"must|needs"):
        EpisodeBatch(task.rules, Simulation(), 1).draw(task.episodes, **request)


def test_a_bad_distribution_is_refused_by_name() -> None:
    rules = RoverEnv().task.rules
    good: dict[str, Any] = {
        "start": dict.fromkeys(("slope", "uphill", "heading", "goal_distance", "goal_bearing", "turn"), (0.0, 1.0)),
        "domain": dict.fromkeys(("mass_scale", "friction", "actuator_gain", "gravity_scale"), (1.0, 1.0)),
        "trunk_load_limit": 50.0,
    }
    batch = EpisodeBatch(rules, Simulation(), 1)
    assert len(batch.draw(EpisodeDistribution(rules, Simulation(), **good), seed_generators([0]))) == 1
    for change, field in (
        ({"start": {"slope": (0.0, 1.0)}}, "start.uphill"),
        ({"domain": 3}, "domain"),
        ({"start": {**good["start"], "slope": (1.0, 0.0)}}, "start.slope"),
        ({"trunk_load_limit": "much"}, "trunk_load_limit"),
        ({"rocks": {"abundance": 0.1}}, "rocks.difficulty"),
        ({"ground": 3}, "terrain"),
        ({"hills": -1.0}, "hills"),
        ({"ground": Plane(), "hills": 0.1}, "hills"),
    ):
        with refused(ValueError, field, "must"):
            EpisodeDistribution(rules, Simulation(), **{**good, **change})
    for seeds in ([-1], [1.5], ["x"]):
        with pytest.raises(OptionError, match=r"seeds\[0\]"):
            seed_generators(seeds)  # type: ignore[arg-type]


#: Prints the hash of first observations, poses and rocks.
RESETS = """
import hashlib, numpy as np
from rover_gym import RoverEnv
seen = hashlib.sha256()
rocks = {"terrain": "rocks", "height_scan": True, "observation_noise": 0.1}
for arguments in ({"slope_deg": (0.0, 20.0)}, rocks, {"terrain": "hills"}):
    env = RoverEnv(**arguments)
    for seed in range(40):
        seen.update(env.reset(seed=seed)[0].tobytes() + env.simulation.q.tobytes())
print(seen.hexdigest())
"""


def test_first_observations_hung_on_the_matrix_products_of_the_processor() -> None:
    def run(**settings: str) -> str:
        environment = {**os.environ, **settings}
        return subprocess.check_output([sys.executable, "-c", RESETS], env=environment, text=True).strip()

    old = {"OPENBLAS_CORETYPE": "Prescott", "NPY_DISABLE_CPU_FEATURES": "AVX512F AVX512_SKX AVX2 FMA3"}
    assert run() == run(**old)
    assert len(run()) == len(hashlib.sha256().hexdigest())
