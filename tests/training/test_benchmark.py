"""`rover benchmark`: sets that stay, episodes that any policy drives, files and pages of results, seeds held back."""

import json
import math
from functools import partial
from itertools import combinations
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from commands import error_of, output_of, rover
from refusals import refused

from rover_gym import OptionError, PDPolicy, RoverEnv, RoverModel
from rover_gym.drive import (
    HELD_BACK_SEEDS,
    BenchmarkResult,
    BenchmarkSet,
    Interface,
    NamedPolicy,
    ScoredSet,
    benchmark as benchmarks,
    benchmark_sets,
    check_training_model,
    check_training_seeds,
    drive_all,
    named_policy,
    score_set,
)
from rover_gym.drive.benchmark import HeldActions, PeakImpulse, baselines, score
from rover_gym.drive.benchmark_page import benchmark_page, mean_success, success_table
from rover_gym.drive.benchmark_sets import BENCHMARK

VERSION, SETS = benchmark_sets()
#: Two short episodes.
SHORT = BenchmarkSet("short", "Rover-v0", {"goal_distance": [1.0, 1.5]}, seed=7, episodes=2, seconds=6.0)
#: Start, heading and goal of the first episode of each set.
PLACES = {
    "rocks": (0.000000, 0.000000, -2.332417, 2.503048, 9.669275),
    "hills": (0.000000, 0.000000, 1.868030, 1.047900, -7.893298),
    "sand": (0.000000, 0.000000, 2.492121, -5.619577, -2.746539),
    "traps": (-0.896439, -2.211511, 1.503823, -5.100928, -3.910912),
    "maps": (14.338180, -0.256140, -2.020140, 14.441966, 16.986050),
    "small-rocks": (0.000000, 0.000000, 3.110232, -0.648665, 8.409848),
    "unknown-rocks": (0.000000, 0.000000, 0.558044, -1.023804, -5.660136),
    "unknown-hills": (0.000000, 0.000000, -1.468361, -5.502116, 2.656709),
}
ROOT = Path(__file__).parents[2]


def by_name(policy: str) -> Any:
    return partial(named_policy, policy)


def a_result(**sets: ScoredSet) -> BenchmarkResult:
    return BenchmarkResult("pd", {"policy": "pd"}, {"versions": {"rover-gym": "0"}}, dict(sets))


def test_the_sets_have_seeds_of_their_own_that_are_held_back() -> None:
    for one in SETS.values():
        assert set(one.seeds()) <= set(HELD_BACK_SEEDS)
    assert all(not set(a.seeds()) & set(b.seeds()) for a, b in combinations(SETS.values(), 2))
    assert {one.arguments.get("terrain") for one in SETS.values()} >= {"rocks", "hills", "sand"}
    assert {"traps", "maps"} <= SETS.keys()
    rovers = {(one.rover() or RoverModel()).name for one in SETS.values()}
    assert rovers == {"rover", "open-rover", "triple-bogie"}


@pytest.mark.parametrize("name", SETS)
def test_the_first_episode_of_a_set_is_as_ever(name: str) -> None:
    """A change of start or goal is a new version of the benchmark."""
    one = SETS[name]
    ((arguments, _),) = one.scenes(one.seeds(1))
    env = gym.make(one.environment, **arguments)
    env.reset(seed=one.seed, options=benchmarks._place(env, one, one.seed))
    start = env.unwrapped.start  # type: ignore[attr-defined]
    place = (*start.position, start.heading, *start.goal)
    assert place == pytest.approx(PLACES[name], abs=1e-6)


def test_a_policy_drives_as_it_does_in_an_evaluation() -> None:
    found = score_set(SHORT, by_name("pd"))
    ((arguments, seeds),) = SHORT.scenes(SHORT.seeds())
    for one, other in zip(found, drive_all(PDPolicy, seeds, arguments=arguments), strict=True):
        assert (one.seed, one.end, one.time, one.success) == (other.seed, "goal", other.time, True)
        assert one.energy == pytest.approx(other.energy, rel=1e-9)
        assert 0.0 < one.decision_median <= one.decision_99 < 1.0


def test_the_impulse_of_the_ground_is_that_of_all_contacts() -> None:
    """The momentum's balance against the contacts' impulses, summed over every physics step of a drive over rocks."""
    env: Any = gym.make("RoverRocks-v0", difficulty=1.5, control_frequency=200.0)
    policy, peak, largest = PDPolicy(env), PeakImpulse(), 0.0
    observation, _ = env.reset(seed=3)
    env.unwrapped.on_period = peak
    peak(env.unwrapped, {"time": 0.0})
    simulation = env.unwrapped.simulation
    weight = simulation.model.mass * 9.81 * env.unwrapped.dt
    for _ in range(300):
        observation, _, terminated, _, _ = env.step(policy.predict(observation)[0])
        contacts = env.unwrapped.simulation.contacts
        given = np.einsum("nij,ni->j", contacts.frames, contacts.impulses)
        largest = max(largest, float(np.linalg.norm(given)) / weight)
        assert not terminated
    # The scheme's momenta are those of the configuration at the beginning of a step.
    assert peak.largest == pytest.approx(largest, rel=2e-3)
    assert largest > 1.5


def test_an_action_at_5_hz_is_held_for_four_periods() -> None:
    slow = gym.make("RoverRocks-v0", difficulty=1.0, control_frequency=5.0)
    held = HeldActions(gym.make("RoverRocks-v0", difficulty=1.0), 4)
    random = np.random.default_rng(1)
    seen = [env.reset(seed=4)[0] for env in (slow, held)]
    for _ in range(10):
        np.testing.assert_array_equal(*seen)
        action = random.uniform(-0.3, 1.0, 12).astype(np.float32)
        (a, *_), (b, *_) = slow.step(action), held.step(action)
        seen = [a, b]
    seconds = [env.unwrapped.simulation.q for env in (slow, held)]  # type: ignore[attr-defined]
    np.testing.assert_array_equal(*seconds)


def test_a_policy_chooses_what_it_sees_but_not_the_ground() -> None:
    sizes: list[int] = []

    class Sees:
        def predict(self, observation: Any, state: Any = None, _start: Any = None) -> tuple[Any, Any]:
            sizes.append(len(observation))
            return np.zeros(12, np.float32), state

    # As in the run.json of a training: what belongs to the set is left to the set.
    trained = {"height_scan": (4, 3, 0.2), "control_frequency": 5.0, "terrain": "hills", "friction": 0.1}
    named = NamedPolicy(trained, lambda _env: Sees())
    brief = BenchmarkSet("brief", "Rover-v0", {}, seed=1, episodes=1, seconds=1.0)
    (episode,) = score_set(brief, lambda _model: named)
    assert (episode.end, episode.time, len(sizes)) == ("time", pytest.approx(1.0), 5)
    assert set(sizes) == {RoverEnv().observation_layout.size + 12}
    with refused(OptionError, "argument.friction"):
        Interface(arguments={"friction": 0.9})
    with refused(OptionError, "control_frequency"):
        score_set(brief, lambda _model: NamedPolicy({"control_frequency": 15.0}, lambda _env: Sees()))
    with refused(OptionError, "environment"):
        score_set(SETS["traps"], by_name("pd"), Interface("RoverCommand-v0"))


def test_every_map_has_a_seed_of_its_own_and_starts_apart() -> None:
    one = SETS["maps"]
    scenes = one.scenes(one.seeds())
    points = np.random.default_rng(1).uniform(-30.0, 30.0, (50, 2))
    assert [len(seeds) for _, seeds in scenes] == [one.episodes_per_map] * 5
    a, b = (scene["terrain"].heights(points) for scene, _ in scenes[:2])
    assert np.abs(a - b).max() > 0.1
    (again, _), *_ = one.scenes(range(one.seed + 3, one.seed + 5))
    np.testing.assert_array_equal(again["terrain"].heights(points), a)
    starts = [next(iter(one.places(seed)))["position"] for seed in one.seeds()]
    assert len(set(starts)) == one.episodes
    assert max(abs(x) for start in starts for x in start) <= one.starts


def test_a_file_of_results_says_all_and_is_read_back(tmp_path: Path) -> None:
    episodes = tuple(score_set(SHORT, by_name("pd")))
    result = a_result(short=ScoredSet(episodes), other=ScoredSet(refused="too small"))
    result.write(tmp_path / "pd.json")
    written = json.loads((tmp_path / "pd.json").read_text(encoding="utf-8"))
    assert written.keys() == {"format", "benchmark", "policy", "key", "made", "sets"}
    assert written["benchmark"] == VERSION
    assert written["sets"]["short"]["columns"] == list(benchmarks.COLUMNS)
    read = BenchmarkResult.read(tmp_path / "pd.json")
    assert read.sets["other"] == result.sets["other"]
    for one, other in zip(read.sets["short"].episodes, episodes, strict=True):
        assert (one.seed, one.end) == (other.seed, other.end)
        for name in benchmarks.COLUMNS[2:]:
            assert getattr(one, name) == pytest.approx(getattr(other, name), rel=1e-4), name


@pytest.mark.parametrize(
    ("change", "field"),
    [
        ({"benchmark": 99}, "results.benchmark"),
        ({"format": 0}, "results.format"),
        ({"sets": {"rocks": {"columns": ["seed"], "episodes": [[1, 2]]}}}, "results"),
        ({"sets": {"rocks": {"columns": ["seed"], "episodes": [[1]]}}}, "results"),
        ({"sets": []}, "results"),
        ({"made": 3}, "results"),
    ],
)
def test_a_file_of_another_version_or_shape_is_refused(change: dict[str, Any], field: str, tmp_path: Path) -> None:
    a_result().write(tmp_path / "a.json")
    sound = json.loads((tmp_path / "a.json").read_text(encoding="utf-8"))
    (tmp_path / "a.json").write_text(json.dumps(sound | change), encoding="utf-8")
    with refused(OptionError, field):
        BenchmarkResult.read(tmp_path / "a.json")


def test_only_missing_episodes_are_driven(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(benchmarks, "benchmark_sets", lambda: (VERSION, {"short": SHORT}))
    path, driven = tmp_path / "pd.json", []
    true_score = benchmarks._score

    def counted(env: Any, policy: Any, one: BenchmarkSet, seed: int) -> Any:
        driven.append(seed)
        return true_score(env, policy, one, seed)

    monkeypatch.setattr(benchmarks, "_score", counted)
    result = score(a_result(), path, by_name("pd"), episodes=1)
    result = score(BenchmarkResult.read(path), path, by_name("pd"))
    result = score(BenchmarkResult.read(path), path, by_name("pd"), episodes=1)
    assert driven == [7, 8]
    assert [episode.seed for episode in result.sets["short"].episodes] == [7, 8]
    with refused(OptionError, "set.dunes"):
        score(result, path, by_name("pd"), names=("dunes",))


def test_the_page_shows_wilsons_interval_and_ranks_by_the_mean(monkeypatch: pytest.MonkeyPatch) -> None:
    from rover_gym.drive import benchmark_page as pages  # noqa: PLC0415 - the module, not its function

    monkeypatch.setattr(pages, "benchmark_sets", lambda: (VERSION, {"short": SHORT}))
    good, *_ = score_set(SHORT, by_name("pd"), seeds=range(7, 8))
    bad = type(good)(**{**vars(good), "end": "time"})
    mixed = a_result(short=ScoredSet((good, bad)))
    best = BenchmarkResult("best", {}, {}, {"short": ScoredSet((good, good))})
    none = BenchmarkResult("none", {}, {}, {"short": ScoredSet(refused="too small")})
    assert success_table([mixed]) == [("policy", "short", "mean"), ("pd", "50 (9 to 91)", "50.0")]
    assert mean_success(none) is None
    page = benchmark_page([none, mixed, best])
    assert page.index("| best |") < page.index("| pd |") < page.index("| none |")
    assert "`none` has not driven short: too small" in page
    assert "1 ran out of time" in page


def test_seeds_and_rover_of_the_benchmark_are_refused_to_trainings(tmp_path: Path) -> None:
    yaml = pytest.importorskip("yaml")
    pytest.importorskip("stable_baselines3")
    check_training_seeds(range(4_999_990, 5_000_000))
    for seeds in (range(4_999_990, 5_000_001), [3, 5_999_999]):
        with refused(OptionError, "seed", "held back for `rover benchmark`"):
            check_training_seeds(seeds)
    held_back = BENCHMARK / "triple-bogie.toml"
    renamed = {**RoverModel.from_file(held_back).to_dict(), "name": "mine"}
    for model in (held_back, RoverModel.from_dict(renamed)):
        with refused(OptionError, "model", "held back"):
            check_training_model(model)
    check_training_model(None)
    check_training_model("mars-rover")

    scenes = {"rocks": {"environment": {"terrain": "rocks"}}}
    evaluation = {"scenes": {"a": {"terrain": "rocks"}}, "fields": 100, "seed": 4_999_950}
    config = tmp_path / "mine.yaml"
    config.write_text(yaml.safe_dump({"scenes": scenes, "evaluation": evaluation}), encoding="utf-8")
    assert "evaluation.seed: must not be from 5000000" in error_of("train", config, "--output", tmp_path / "run")
    scenes["rocks"]["environment"]["model"] = str(held_back)
    config.write_text(yaml.safe_dump({"scenes": scenes}), encoding="utf-8")
    assert "environment.model: must be another rover" in error_of("train", config, "--output", tmp_path / "run")
    assert not (tmp_path / "run").exists()
    assert "--seed: must not be" in error_of("evaluate", "--seed", 5_000_000, "--output", tmp_path / "run")


def test_no_training_of_the_package_uses_the_benchmark() -> None:
    pytest.importorskip("yaml")
    from rover_gym.learn.arc_config import read_arc_config  # noqa: PLC0415 - needs the extra
    from rover_gym.learn.configuration import SHIPPED_CONFIGURATIONS, find_configuration  # noqa: PLC0415

    for name in SHIPPED_CONFIGURATIONS:
        read_arc_config(find_configuration(name))  # refuses it itself
    for run in sorted((BENCHMARK.parent / "policies").glob("*/config.yaml")):
        read_arc_config(run)


def test_the_page_of_the_manual_is_that_of_the_committed_results() -> None:
    """`make benchmark` writes both."""
    results = baselines()
    assert {"pd", "scan", "anywhere", "guided"} <= {result.policy for result in results}
    for result in results:
        assert result.sets.keys() == SETS.keys()
        for name, one in result.sets.items():
            assert [episode.seed for episode in one.episodes] == list(SETS[name].seeds(len(one.episodes)))
            assert all(math.isfinite(episode.energy) for episode in one.episodes)
    page = (ROOT / "docs" / "tables" / "benchmark.md").read_text(encoding="utf-8")
    assert page == benchmark_page(results)


FUNCTIONS = """
import numpy as np


def crawl(observation):
    return np.full(12, 0.1, np.float32)


class Slow:
    arguments = {"control_frequency": 5.0}

    def __init__(self, env):
        self.n = env.action_space.shape[0]

    def predict(self, observation, state=None, episode_start=None):
        return np.zeros(self.n, np.float32), state
"""


def test_the_command_writes_results_and_a_page_beside_ours(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("my_driver.py").write_text(FUNCTIONS, encoding="utf-8")
    given = ("--set", "unknown-rocks", "--episodes", 1, "--output", "results")
    told = json.loads(output_of("benchmark", "my_driver:crawl", *given, "--json"))
    assert told["version"] == VERSION
    rows = {row["policy"]: row for row in told["success"]}
    assert rows["my_driver.crawl"]["unknown-rocks"].startswith("0 (0 to ")
    assert rows.keys() == {"my_driver.crawl", *(one.policy for one in baselines())}
    page = Path("results/benchmark.md").read_text(encoding="utf-8")
    assert "| my_driver.crawl | 1 of 50 |" in page
    result = BenchmarkResult.read("results/my_driver.crawl.json")
    assert result.key["policy"] == "my_driver:crawl"

    def drives_again(*_given: Any, **_options: Any) -> None:
        raise AssertionError

    monkeypatch.setattr(benchmarks, "score_set", drives_again)
    output = output_of("benchmark", "my_driver:crawl", *given, "--page", "page.md")
    assert "page.md" in output
    assert Path("page.md").read_text(encoding="utf-8") == page
    shown = output_of("benchmark", "results/my_driver.crawl.json", "--output", "other")
    assert "my_driver.crawl" in shown
    Path("my_driver.py").write_text(FUNCTIONS + "\n", encoding="utf-8")
    assert isinstance(rover("benchmark", "my_driver:crawl", *given).exception, AssertionError | SystemExit)


def test_a_benchmark_that_is_interrupted_keeps_its_sets(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    other = BenchmarkSet("other", "Rover-v0", {}, seed=1, episodes=1, seconds=0.5)
    sets = VERSION, {"short": SHORT, "other": other}
    monkeypatch.setattr(benchmarks, "benchmark_sets", lambda: sets)
    true_set = benchmarks.score_set

    def interrupted(one: BenchmarkSet, *given: Any, **options: Any) -> Any:
        if one is other:
            raise KeyboardInterrupt
        return true_set(one, *given, **options)

    monkeypatch.setattr(benchmarks, "score_set", interrupted)
    result = rover("benchmark", "pd", "--output", tmp_path)
    assert result.exit_code == 130
    assert "the next call goes on" in result.stderr
    assert BenchmarkResult.read(tmp_path / "pd.json").sets.keys() == {"short"}


@pytest.mark.parametrize(
    ("given", "message"),
    [
        (("pd", "pd"), "POLICIES: must be named once"),
        (("nope",), "POLICIES: must be 'pd'"),
        (("no.such.module:drive",), "cannot be imported"),
        (("math:pi",), "must name a function or a class"),
        (("pd", "--set", "dunes"), "set.dunes: unknown"),
        (("pd", "--argument", "difficulty=0"), "argument.difficulty: is part of the sets"),
        (("pd", "--environment", "Rover-v9"), "must be one of"),
        (("pd", "--set", "traps", "--environment", "RoverCommand-v0"), "must fit one of the sets"),
    ],
)
def test_what_cannot_be_scored_is_one_line(given: tuple[str, ...], message: str, tmp_path: Path) -> None:
    assert message in error_of("benchmark", *given, "--output", tmp_path / "none")
