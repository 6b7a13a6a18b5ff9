"""The state of an episode outside the simulation, as snapshots hold it."""

from dataclasses import dataclass
from typing import Any

from rover_gym.env.quantities import Array, Observations
from rover_gym.mechanics import EpisodeRules, EpisodeRun


@dataclass(frozen=True)
class Progress:
    """The state of an episode outside the simulation.

    Attributes:
        goal: The goal (x, z), m; the first of several.
        domain: `(4,)` fields of `Domain`, in its order.
        trunk_load_limit: Trunk force beyond which the rover is high-centred, N.
        difficulty: Difficulty of the rocks.
        distance: Horizontal distance to the present goal, m.
        previous_action: `(n_actions,)` last action.
        energy: Motor work since reset, braking counted, J.
        energy_positive: Motor work since reset, driving only, J.
        stuck_time: How long the rover has been high-centred, s.
        observation: `(size,) float32`, the last observation.
        further: `(n, 2)` goals after the first, m.
        reached: How many goals have been reached.
        outcome: Quantities, reward terms and termination of the last control period.
        owed: Noise of the heights that the last observation lacks; None where it lacks none.
    """

    goal: tuple[float, float]
    domain: Array
    trunk_load_limit: float
    difficulty: float
    distance: float
    previous_action: Array
    energy: float
    energy_positive: float
    stuck_time: float
    observation: Observations
    further: Array
    reached: int
    outcome: tuple[Array, Array, str]
    owed: Array | None

    @classmethod
    def of(cls, episode: EpisodeRun) -> "Progress":
        """The progress of an episode."""
        return cls(**episode.state())

    def episode(self, rules: EpisodeRules) -> EpisodeRun:
        """The episode that continues from here.

        Raises:
            OptionError: A value does not fit the rules, or is not finite.
        """
        state: dict[str, Any] = vars(self)
        return EpisodeRun(rules, **state)
