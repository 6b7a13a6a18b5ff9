"""What a node publishes: a rover that drives, or a recorded one."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from rover_gym.core import CommandError, Simulation
from rover_gym.core.validation import refuse
from rover_gym.envs.sensors.sensor import Moment
from rover_gym.envs.sensors.sensor_suite import moment_of
from rover_gym.ros.driving import Driving

if TYPE_CHECKING:
    from rover_gym.core import RoverModel
    from rover_gym.record import RoverRun
    from rover_gym.ros.driving import Command
    from rover_gym.show.live import LiveRover
    from rover_gym.show.live.live_rover import LiveMoment


class NodeRover(Protocol):
    """A rover over time.

    Attributes:
        drives_itself: Whether it moves without a command.
    """

    drives_itself: bool

    @property
    def episodes(self) -> int:
        """How many drives have begun."""
        ...

    @property
    def model(self) -> RoverModel:
        """The rover's model."""
        ...

    @property
    def simulation(self) -> Simulation:
        """The rover's simulation, to be read."""
        ...

    @property
    def time(self) -> float:
        """Time of the drive, s."""
        ...

    @property
    def dt(self) -> float:
        """Time from one step to the next, s."""
        ...

    @property
    def goal(self) -> tuple[float, float] | None:
        """Goal on the map (x, z), m."""
        ...

    @property
    def ended(self) -> str:
        """Why it cannot go on; "" while it can."""
        ...

    def moment(self) -> Moment:
        """The rover now, for sensors."""
        ...

    def check(self, command: Command) -> None:
        """Refuses a command that the rover cannot follow."""
        ...

    def step(self, command: Command | None) -> None:
        """Takes a step, by a command or by the rover's own driver."""
        ...

    def reset(self, seed: int, difficulty: float) -> None:
        """Begins again."""
        ...

    def snapshot(self) -> Any:
        """The present state, for `restore`."""
        ...

    def restore(self, snapshot: Any) -> None:
        """Goes back to a state."""
        ...


class DrivenRover:
    """A rover in the simulator; `NodeRover` has its methods.

    Args:
        rover: The rover. It belongs to the source from here on.
    """

    def __init__(self, rover: LiveRover) -> None:
        self.rover, self.drives_itself = rover, rover.driver is not None
        self._driving = Driving(rover.env.model)

    @property
    def episodes(self) -> int:
        """How many drives have begun."""
        return self.rover.drives

    @property
    def model(self) -> RoverModel:
        """The rover's model."""
        return self.rover.env.model

    @property
    def simulation(self) -> Simulation:
        """The rover's simulation."""
        return self.rover.env.simulation

    @property
    def time(self) -> float:
        """Time of the drive, s."""
        return self.rover.time

    @property
    def dt(self) -> float:
        """Control period, s."""
        return self.rover.dt

    @property
    def goal(self) -> tuple[float, float]:
        """The present goal (x, z), m."""
        return self.rover.env.goal

    @property
    def ended(self) -> str:
        """Why the drive cannot go on."""
        return self.rover.ended

    def moment(self) -> Moment:
        """The rover now."""
        return moment_of(self.rover.env)

    def check(self, command: Command) -> None:
        """Refuses a command that the rover cannot follow."""
        self._driving.check(command)

    def step(self, command: Command | None) -> None:
        """Takes a control period."""
        if command is None:
            self.rover.step()
        else:
            self.rover.follow(lambda simulation: self._driving.send(simulation, command))

    def reset(self, seed: int, difficulty: float) -> None:
        """Begins a drive with a seed and a difficulty."""
        self.rover.restart(seed, difficulty)

    def snapshot(self) -> LiveMoment:
        """The present state."""
        return self.rover.moment()

    def restore(self, snapshot: LiveMoment) -> None:
        """Goes back to a state, also of an earlier drive."""
        self.rover.go_back(snapshot)


class RecordedRover:
    """A recorded run, row by row; `NodeRover` has its methods. It takes no commands and ends with its last row.

    Args:
        run: The run.

    Raises:
        CommandError: It has no velocities, or fewer than two rows.
    """

    #: A recording moves without a command.
    drives_itself = True

    def __init__(self, run: RoverRun) -> None:
        if "v" not in run.trajectory.data or run.n_frames < 2:
            refuse(CommandError, "run", sorted(run.trajectory.data), "must have velocities `v` and two rows")
        self._run, self._row = run, 0
        self.simulation = Simulation(run.model, run.terrain)
        self.episodes = 1
        self._show()

    @property
    def model(self) -> RoverModel:
        """The rover's model."""
        return self._run.model

    @property
    def time(self) -> float:
        """Time of the row, s."""
        return float(self._run.time[self._row])

    @property
    def dt(self) -> float:
        """Time from this row to the next, s."""
        row = min(self._row, self._run.n_frames - 2)
        return float(self._run.time[row + 1] - self._run.time[row])

    @property
    def goal(self) -> tuple[float, float] | None:
        """The goal (x, z), m."""
        return self._run.goal

    @property
    def ended(self) -> str:
        """The end of the recording."""
        return "end_of_recording" if self._row == self._run.n_frames - 1 else ""

    def moment(self) -> Moment:
        """The rover now."""
        return Moment(self.simulation, self.time)

    def check(self, command: Command) -> None:
        """Refuses every command."""
        refuse(CommandError, "command", command, "cannot drive a recorded rover")

    def step(self, command: Command | None) -> None:  # noqa: ARG002 - none passes `check`
        """Goes to the next row."""
        self._row = min(self._row + 1, self._run.n_frames - 1)
        self._show()

    def reset(self, seed: int, difficulty: float) -> None:  # noqa: ARG002 - a recording has its own
        """Goes to the first row."""
        self._row = 0
        self.episodes += 1
        self._show()

    def snapshot(self) -> int:
        """The row."""
        return self._row

    def restore(self, snapshot: int) -> None:
        """Goes back to a row."""
        self._row = snapshot
        self.episodes += 1
        self._show()

    def _show(self) -> None:
        data = self._run.trajectory.data
        self.simulation.set_state(np.asarray(data["q"][self._row]), np.asarray(data["v"][self._row]))
