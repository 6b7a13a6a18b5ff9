"""What an environment shows of its episode, alone or as a row of a batch."""

from abc import ABC, abstractmethod
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from rover_gym.env.episode_scene import EpisodeScene
from rover_gym.env.observation import ObservationLayout
from rover_gym.env.sand_ground import soil_of
from rover_gym.env.start import Domain, Rocks, Start
from rover_gym.env.task import Task
from rover_gym.mechanics import RoverModel, Simulation
from rover_gym.sand.soils import Soil

if TYPE_CHECKING:
    from rover_gym.rendering import FrameRenderer


class EpisodeView(ABC):
    """What the task gives and what an episode drew, and frames of it.

    Attributes:
        task: The checked arguments.
    """

    task: Task
    _renderer: "FrameRenderer | None" = None

    @property
    @abstractmethod
    def scene(self) -> EpisodeScene:
        """The scene of the episode.

        Raises:
            ResetNeeded: There is none yet.
        """

    @property
    @abstractmethod
    def simulation(self) -> Simulation:
        """The simulation of the episode, to be read."""

    @property
    @abstractmethod
    def goal(self) -> tuple[float, float]:
        """The episode's present goal (x, z), m."""

    @abstractmethod
    def make_renderer(self, scene: EpisodeScene) -> "FrameRenderer":
        """Creates a renderer of a scene; the caller must close it."""

    @property
    def model(self) -> RoverModel:
        """The rover, before its masses are scaled."""
        return self.task.model

    @property
    def gravity(self) -> tuple[float, ...]:
        """Gravity before it is scaled, m/s2."""
        return self.task.gravity

    @property
    def dt(self) -> float:
        """Control period, s."""
        return self.task.dt

    @property
    def goal_tolerance(self) -> float:
        """Distance from a goal at which it is reached, m."""
        return self.task.goal_tolerance

    @property
    def max_steering(self) -> float:
        """Set-point of a steering action of 1, rad."""
        return self.task.max_steering

    @property
    def observation_layout(self) -> ObservationLayout:
        """The layout of the observation."""
        return self.task.layout

    @property
    def start(self) -> Start:
        """The episode's slope, pose and goal as they were drawn."""
        return self.scene.start

    @property
    def rocks(self) -> Rocks | None:
        """The episode's difficulty and rocks as they were drawn; None on the plane."""
        return self.scene.rocks

    @property
    def soil(self) -> Soil | None:
        """The soil of the episode's sand as it was drawn; None on firm ground."""
        return soil_of(self.task.soils, self.simulation.terrain)

    @property
    def domain(self) -> Domain:
        """The episode's properties of rover and world as they were drawn."""
        return self.scene.domain

    @property
    def difficulty(self) -> float | None:
        """The episode's difficulty; None on the plane."""
        rocks = self.rocks
        return None if rocks is None else rocks.difficulty

    def frame(self) -> npt.NDArray[np.uint8]:
        """Renders the present state, (height, width, 3)."""
        scene = self.scene
        if self._renderer is None:
            self._renderer = self.make_renderer(scene)
        self._renderer.set_scene(scene.terrain, goal=self.goal, goal_tolerance=self.goal_tolerance)
        return self._renderer.render(self.simulation)

    def close(self) -> None:
        """Frees the renderer, if there is one."""
        if self._renderer is not None:
            self._renderer.close()
            self._renderer = None
