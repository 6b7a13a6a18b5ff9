"""Everything that a `RoverEnv` needs to continue bit for bit."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from rover_gym.env.episode_scene import EpisodeScene
from rover_gym.env.progress import Progress
from rover_gym.mechanics import Snapshot
from rover_gym.validation import Range

if TYPE_CHECKING:
    pass


@dataclass(frozen=True)
class EnvSnapshot:
    """Everything that `RoverEnv` needs to continue bit for bit; picklable.

    A time limit is a wrapper's business, so the wrapper's count of steps is not in here.
    """

    simulation: Snapshot
    scene: EpisodeScene
    progress: Progress
    difficulty: Range | None
    random_state: Mapping[str, Any]
