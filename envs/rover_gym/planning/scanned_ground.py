"""What a planner may be given instead: the ground as far as it was seen, and raw actions in place of commands."""

import math
from typing import Any

import numpy as np
import numpy.typing as npt

from rover_gym.env.rover_env import RoverEnv
from rover_gym.extras import require
from rover_gym.mechanics import HeightField, OptionError
from rover_gym.policy.command import N_COMMANDS, CommandController
from rover_gym.policy.ground_map import MOST_CELLS, GroundMap, MapOptions
from rover_gym.policy.scan_policy import scan_grid
from rover_gym.validation import refuse

Array = npt.NDArray[np.float64]

#: How far the map goes beyond the goal on all sides, m.
MARGIN = 4.0


class ScannedGround:
    """A map of heights that grows with each height scan.

    Args:
        env: The environment, with a height scan, after its reset: the map reaches as far from the rover as its goal
            does, and `MARGIN` farther.

    Raises:
        OptionError: The environment has no height scan.
        MissingExtraError: SciPy is not installed.
    """

    def __init__(self, env: RoverEnv) -> None:
        self._ndimage = require("scipy.ndimage", "planning")
        scan, layout = scan_grid(env), env.observation_layout
        self._heights, self._q = layout["height_scan"], layout["q"].start
        self._scale = layout.scale
        place = env.simulation.q[[0, 2]]
        reach = float(np.hypot(*(np.array(env.goal) - place))) + MARGIN
        cells = int(np.ceil(2.0 * reach / scan.spacing))
        if cells > MOST_CELLS:
            refuse(OptionError, "height_scan", scan.spacing, f"gives a map of {cells} cells a side, over {MOST_CELLS}")
        self._map = GroundMap(scan, MapOptions(cells=cells), 1.0)
        self._cells = np.zeros((cells, cells), np.float32)
        self._corner = np.zeros(2, np.int64)
        self._map.begin(self._cells, self._corner, (float(place[0]), float(place[1])))

    def see(self, observation: npt.NDArray[np.floating[Any]]) -> None:
        """Writes the scan of an observation `(size,)` into the map."""
        seen = observation.astype(np.float64)
        x, y, z, heading = (float(seen[self._q + k]) for k in (0, 1, 2, 4))
        heights = seen[self._heights] * self._scale[self._heights] + y
        self._map.remember(self._cells, self._corner, heights, (x, z), heading)

    @property
    def terrain(self) -> HeightField:
        """The map as ground; what was not seen is as high as the nearest place that was."""
        unknown = np.isnan(self._cells)
        nearest = self._ndimage.distance_transform_edt(unknown, return_distances=False, return_indices=True)
        spacing = self._map.cell
        corner = (float(self._corner[0] * spacing), float(self._corner[1] * spacing))
        return HeightField(self._cells[tuple(nearest)].T, spacing, corner)


#: Torques of the steady sequences, over that at which a wheel pulls with its share of the weight: forward, hard
#: forward, backward, none.
LEVELS = (0.1, 0.4, -0.2, 0.0)

#: Curvature and sideways direction of the steady sequences, within [-1, 1].
TURNS = ((-1.0, 0.0), (-0.5, 0.0), (0.0, 0.0), (0.5, 0.0), (1.0, 0.0), (0.0, -0.7), (0.0, 0.7))


class RawActions:
    """Takes the place of a `CommandController`: what it is given are the actions.

    Args:
        env: The environment, read once.
        controller: Gives the set-points that suit a turn.
        spread: Standard deviations of torques, over that at which a wheel pulls with its share of the weight, and of
            set-points, over the steering limit.

    Attributes:
        spread: `(n_actions,)` standard deviations of the entries.
        library: `(n, n_actions)` actions of steady sequences.
    """

    def __init__(self, env: RoverEnv, controller: CommandController, spread: tuple[float, float]) -> None:
        task, model = env.task, env.model
        n, n_wheels = task.n_actions, len(model.wheel_names)
        weight = model.mass * math.hypot(*env.gravity)
        share = (weight / n_wheels * model.wheel_radii / model.wheel_torque_limits).clip(0.0, 1.0)
        self.spread = np.full(n, spread[1])
        self.spread[:n_wheels] = spread[0] * share
        commands = np.zeros((len(TURNS), N_COMMANDS))
        commands[:, 1:] = TURNS
        turns = controller.act(np.zeros((len(TURNS), task.layout.size)), commands).astype(np.float64)
        self.library = np.tile(turns, (len(LEVELS), 1))
        self.library[:, :n_wheels] = np.repeat(LEVELS, len(TURNS))[:, None] * share

    def act(self, _observations: npt.NDArray[Any], actions: npt.NDArray[Any]) -> npt.NDArray[np.float32]:
        """The actions `(n, n_actions)`."""
        clipped: npt.NDArray[np.float32] = np.clip(actions, -1.0, 1.0).astype(np.float32)
        return clipped
