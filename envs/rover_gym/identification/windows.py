"""A run cut into short windows, each of which is simulated from a state of its own."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from rover_gym.mechanics import OptionError, Simulation, SimulationBatch
from rover_gym.record.rover_run import RoverRun
from rover_gym.validation import number, refuse

Array = npt.NDArray[np.float64]

#: Fewest rows of a window: its first and two that the simulation predicts.
SHORTEST = 3


@dataclass(frozen=True)
class Window:
    """A stretch of a run.

    Attributes:
        time: (n,) time of its rows, s.
        steps: Time steps from each row to the next, (n - 1,).
        measured: (n, nq + nv) recorded coordinates and velocities.
        torques: (n - 1, n_wheels) commanded wheel torques from each row to the next, N m.
        set_points: (n - 1, n_wheels) steering set-points from each row to the next, rad.
    """

    time: Array
    steps: npt.NDArray[np.int64]
    measured: Array
    torques: Array
    set_points: Array


def cut(run: RoverRun, window: float, time_step: float) -> list[Window]:
    """Cuts a run into windows that share no row.

    The commands of a row are those under which the rover came to it from the row before.

    Args:
        run: The run.
        window: Length of a window, s.
        time_step: Time step of the run's simulation, s.

    Raises:
        OptionError: The run lacks a channel, its rows are not whole steps apart, or it is shorter than a window, or a
            window holds fewer than three rows.
    """
    window = number("window", window, above=0.0)
    for name in ("q", "v", "wheel_torques", "steering_set_points"):
        if name not in run.trajectory.data:
            refuse(OptionError, "recording", name, "is no channel of this run, but needed")
    time, data = run.time, run.trajectory.data
    for name in ("q", "v", "wheel_torques", "steering_set_points"):
        if not np.isfinite(data[name]).all():
            refuse(OptionError, f"recording.{name}", float("nan"), "must be finite")
    exact = np.diff(time) / time_step
    steps = np.rint(exact).astype(np.int64)
    if len(steps) and (np.abs(exact - steps) > 1e-3).any():
        worst = int(np.argmax(np.abs(exact - steps)))
        reason = f"must be whole steps of {time_step:g} s apart"
        refuse(OptionError, f"recording.time[{worst + 1}]", float(np.diff(time)[worst]), reason)
    measured = np.concatenate([data["q"], data["v"]], axis=1)
    windows = []
    first = 0
    while first < len(time):
        last = int(np.searchsorted(time, time[first] + window * (1.0 + 1e-9), side="right")) - 1
        if time[-1] < time[first] + window * (1.0 - 1e-9):
            break
        if last - first + 1 < SHORTEST:
            refuse(OptionError, "window", window, f"must hold {SHORTEST} rows of the run, or more")
        rows, between = slice(first, last + 1), slice(first + 1, last + 1)
        windows.append(
            Window(
                time[rows],
                steps[first:last],
                measured[rows],
                data["wheel_torques"][between],
                data["steering_set_points"][between],
            )
        )
        first = last + 1
    if not windows:
        refuse(OptionError, "window", window, f"must be at most the run's duration, {time[-1] - time[0]:g} s")
    return windows


class Shooter:
    """Simulates a window from several states, or under several setups, side by side in the core's batch.

    Args:
        nq: Number of coordinates.
        wheels: Columns of the wheels' angles, which the batch tells up to whole turns.
    """

    def __init__(self, nq: int, wheels: npt.NDArray[np.int64]) -> None:
        self._nq = nq
        self._wheels = wheels
        self._batches: dict[int, SimulationBatch] = {}

    def shoot(self, window: Window, rovers: Sequence[Simulation], gains: Array, states: Array) -> Array:
        """The rows of a window from each state, the first one being the state itself.

        Args:
            window: The window.
            rovers: (n,) simulations, whose states are overwritten; the same one may stand several times.
            gains: (n,) factors on the wheel torques.
            states: (n, nq + nv) states at the window's first row.

        Returns:
            (n, rows, nq + nv); NaN from where a rover cannot take a step.
        """
        n, nq = len(rovers), self._nq
        if n not in self._batches:
            self._batches[n] = SimulationBatch(list(rovers), threads=1)
        batch = self._batches[n]
        for i, rover in enumerate(rovers):
            rover.set_state(states[i, :nq], states[i, nq:])
            batch.replace(i, rover)
        rows = np.empty((n, *window.measured.shape))
        rows[:, 0] = states
        is_lost = np.zeros(n, np.bool_)
        for k, steps in enumerate(window.steps.tolist()):
            torques = gains[:, None] * window.torques[k]
            seen, failed = batch.step(torques, np.tile(window.set_points[k], (n, 1)), steps)
            is_lost[list(failed)] = True
            rows[:, k + 1] = self._row(batch, seen, window.measured[k + 1])
            rows[is_lost, k + 1] = np.nan
        return rows

    def _row(self, batch: SimulationBatch, seen: Array, measured: Array) -> Array:
        """(n, nq + nv) coordinates and velocities as a simulation has them, from the batch's readings."""
        parts = batch.reading_layout
        q, body = seen[:, parts["pose"]].copy(), seen[:, parts["body_velocity"]]
        off = q[:, self._wheels] - measured[self._wheels]
        q[:, self._wheels] -= 2.0 * np.pi * np.rint(off / (2.0 * np.pi))
        R = rotations(q[:, 3:6])
        turned = [np.einsum("nij,nj->ni", R, body[:, part]) for part in (slice(0, 3), slice(3, 6))]
        return np.concatenate([q, *turned, seen[:, parts["joint_rates"]]], axis=1)


def rotations(angles: Array) -> Array:
    """(n, 3, 3) attitudes R = Ry(heading) Rz(pitch) Rx(roll) from (n, 3) roll, heading and pitch."""
    (sr, sh, sp), (cr, ch, cp) = np.sin(angles).T, np.cos(angles).T
    rows = (
        (ch * cp, sh * sr - ch * sp * cr, ch * sp * sr + sh * cr),
        (sp, cp * cr, -cp * sr),
        (-sh * cp, sh * sp * cr + ch * sr, ch * cr - sh * sp * sr),
    )
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)
