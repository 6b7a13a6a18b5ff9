"""The sets of `rover benchmark`, and what no training may use: their seeds and the rover that they hold back."""

import tomllib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cache
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np

from rover_gym.core import HeightField, OptionError, RoverModel
from rover_gym.core.validation import refuse
from rover_gym.ground.maps.fractal import fractal_map
from rover_gym.models.lookup import open_model

#: Folder of the sets, of the rover that is held back, and of the results of this package's policies.
BENCHMARK = Path(__file__).parents[1] / "data" / "benchmark"

#: Seeds that only the benchmark drives.
HELD_BACK_SEEDS = range(5_000_000, 6_000_000)


@dataclass(frozen=True)
class BenchmarkSet:
    """Episodes of one rover on one kind of ground.

    Attributes:
        name: Name of the set.
        environment: Registered environment.
        arguments: Its arguments.
        seed: Seed of the first episode; the others count up from it.
        episodes: Number of episodes.
        seconds: Time limit of an episode, s.
        model: File of a model in `BENCHMARK`; None where the arguments name the rover.
        maps: Arguments of `fractal_map` for the ground; None where the arguments name it.
        episodes_per_map: Episodes on each map.
        starts: Largest distance of a start from the middle of the map along x and z, m.
    """

    name: str
    environment: str
    arguments: Mapping[str, Any]
    seed: int
    episodes: int
    seconds: float
    model: str | None = None
    maps: Mapping[str, Any] | None = None
    episodes_per_map: int = 1
    starts: float = 0.0

    def seeds(self, most: int | None = None) -> range:
        """The seeds of the episodes, or of the first `most` of them."""
        return range(self.seed, self.seed + min(self.episodes, most or self.episodes))

    def rover(self) -> RoverModel | None:
        """The rover; None for the default of the environment."""
        if self.model is not None:
            return open_model(BENCHMARK / self.model)
        named = self.arguments.get("model")
        return None if named is None else open_model(named)

    def scenes(self, seeds: range) -> list[tuple[dict[str, Any], range]]:
        """The arguments of each environment that the seeds need, and those that are driven in it."""
        model = {} if self.model is None else {"model": self.rover()}
        given = {name: tuple(one) if isinstance(one, list) else one for name, one in self.arguments.items()} | model
        if self.maps is None:
            return [(given, seeds)]
        n = self.episodes_per_map
        blocks = groupby(seeds, lambda seed: (seed - self.seed) // n)
        of_maps = [(k, list(block)) for k, block in blocks]
        return [({**given, "terrain": self._map(k)}, range(block[0], block[-1] + 1)) for k, block in of_maps]

    def places(self, seed: int) -> Iterable[dict[str, Any]]:
        """Reset options to try one after the other until the rover has room: starts on a map."""
        if self.maps is None:
            yield {}
            return
        random = np.random.default_rng(seed)
        for _ in range(1000):
            yield {"position": tuple(random.uniform(-self.starts, self.starts, 2).tolist())}

    def _map(self, k: int) -> HeightField:
        assert self.maps is not None  # noqa: S101 - only sets with maps ask
        given: dict[str, Any] = {name: tuple(one) if isinstance(one, list) else one for name, one in self.maps.items()}
        return fractal_map(**given, seed=self.seed + k)


@cache
def benchmark_sets() -> tuple[int, dict[str, BenchmarkSet]]:
    """The version of the benchmark, and its sets by name."""
    read = tomllib.loads((BENCHMARK / "sets.toml").read_text(encoding="utf-8"))
    return read["version"], {one["name"]: BenchmarkSet(**one) for one in read["sets"]}


def check_training_seeds(seeds: Iterable[int], field: str = "seed") -> None:
    """Refuses seeds that only the benchmark drives. Call it before you train or tune on seeds of your own.

    Args:
        seeds: The seeds of the resets.
        field: Name of the argument, for messages.

    Raises:
        OptionError: One of them is in `HELD_BACK_SEEDS`.
    """
    seed = next((one for one in seeds if one in HELD_BACK_SEEDS), None)
    if seed is not None:
        first, last = HELD_BACK_SEEDS[0], HELD_BACK_SEEDS[-1]
        refuse(OptionError, field, seed, f"must not be from {first} to {last}: held back for `rover benchmark`")


def check_training_model(model: object, field: str = "model") -> None:
    """Refuses the rover that the benchmark holds back, whatever its name.

    Args:
        model: A model, a name of the gallery, or a file; None for the built-in rover.
        field: Name of the argument, for messages.

    Raises:
        OptionError: It is that rover.
        ModelError: There is no such model.
        OSError: Its file cannot be read.
    """
    if model is None:
        return
    found = model if isinstance(model, RoverModel) else open_model(model, field)
    _, sets = benchmark_sets()
    for name in {one.model for one in sets.values() if one.model is not None}:
        if {**found.to_dict(), "name": ""} == {**open_model(BENCHMARK / name).to_dict(), "name": ""}:
            refuse(OptionError, field, found.name, "must be another rover: this one is held back for `rover benchmark`")
