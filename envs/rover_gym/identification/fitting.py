"""Least squares of an identification, with common parameters and a starting state for each window."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from rover_gym.core import OptionError, Simulation, SimulationBatch
from rover_gym.core.validation import number, refuse
from rover_gym.identification.parameters import Parameter, Setup
from rover_gym.record.rover_run import RoverRun

Array = npt.NDArray[np.float64]

#: Fewest rows of a window: its first and two that the simulation predicts.
SHORTEST = 3


@dataclass(frozen=True)
class Window:
    """A section of a run.

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

    The commands of a row acted from the previous row to this one.

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
            refuse(OptionError, "recording", name, "is needed, but is not a channel of this run")
    time, data = run.time, run.trajectory.data
    for name in ("q", "v", "wheel_torques", "steering_set_points"):
        if not np.isfinite(data[name]).all():
            refuse(OptionError, f"recording.{name}", float("nan"), "must be finite")
    if np.isfinite(data.get("wheel_speed_set_points", np.nan)).any():
        refuse(OptionError, "recording.wheel_speed_set_points", "given", "must not be: torques must drive the wheels")
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
            refuse(OptionError, "window", window, f"must contain at least {SHORTEST} rows of the run")
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
        wheels: Columns of the wheels' angles, which the batch returns up to whole turns.
    """

    def __init__(self, nq: int, wheels: npt.NDArray[np.int64]) -> None:
        self._nq = nq
        self._wheels = wheels
        self._batches: dict[int, SimulationBatch] = {}

    def shoot(self, window: Window, rovers: Sequence[Simulation], gains: Array, states: Array) -> Array:
        """The rows of a window from each state, the first one being the state itself.

        Args:
            window: The window.
            rovers: (n,) simulations, whose states are overwritten. The same one may occur several times.
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


#: Smallest change of a state for a difference, m, rad, m/s or rad/s: the memory that a step has of the last impulses,
#: which a start does not have, moves a rover by as much.
SMALLEST_CHANGE = 1e-5
#: Change of a parameter for a difference, as a part of its scale.
PARAMETER_CHANGE = 2e-3
#: Dampings of a move of a window's starting state that are tried, in units of the weight of its own measurement.
DAMPINGS = (0.0, 1.0, 10.0, 100.0, 1e3, 1e4)
#: Mean square of a window's weighted residuals above which its starting state is searched for among those of the
#: differences, and the number of such moves: wheels that hold instead of slipping leave no derivative to follow.
MISFIT, MOST_MOVES = 2.5, 6
#: Number of restarts for the starting state of a window that does not fit, and iterations of each.
DRAWS, DRAW_ITERATIONS = 5, 8
#: An iteration that lowers the sum of squares by less than this, in units of the variance of a residual, is the last
#: one: a standard error changes it by one.
SMALLEST_GAIN = 0.02
#: A run determines a combination of parameters if its standard deviation, the inverse of its sensitivity, is less than
#: half of its scale. A weaker limit fails: noise makes wheels seem to slip for a step, and friction would appear to be
#: measured.
LEAST_SENSITIVITY = 2.0
#: Smallest sensitivity relative to the largest one: differences of simulations with contacts are not exact enough for
#: less.
SMALLEST_SENSITIVITY = 1e-4
#: Mean square of a window's weighted residuals from which on it counts for less: a wheel that spins in one window and
#: holds in its simulation says little until the parameters are nearly right, and would outweigh all other windows.
TOLERATED = 9.0
#: Largest change of a parameter in an iteration, relative to its scale: weakly determined parameters stay near their
#: start.
LONGEST_STEP = 0.5
#: Mean square of the weighted residuals at which a fit is exact.
EXACT = 1e-6
#: Attempts with shorter and shorter steps before a fit ends.
MOST_ATTEMPTS = 4


@dataclass
class _Linear:
    """Weighted residuals of a window and their derivatives.

    Attributes:
        residuals: (m,)
        by_state: (m, nq + nv) derivative by the starting state.
        by_parameters: (m, p) derivative by the parameters.
        basis: (m, nq + nv) orthonormal basis of the columns of `by_state`.
    """

    residuals: Array
    by_state: Array
    by_parameters: Array
    basis: Array

    @property
    def weight(self) -> float:
        """Weight of the window, by its loss: about 1 if it fits, and the inverse of its mean square if it does not."""
        return (1.0 + 1.0 / TOLERATED) / (1.0 + _loss_argument(self.residuals))

    def free_of_state(self, columns: Array) -> Array:
        """The part of columns (m, ...) that a change of the starting state cannot explain."""
        free: Array = columns - self.basis @ (self.basis.T @ columns)
        return free


@dataclass(frozen=True)
class Solution:
    """Result of a fit.

    Attributes:
        values: (p,) the parameters.
        residuals: (m,) residuals of all windows in measured units, simulated minus measured.
        weighted: (m,) the same over the deviations, without what the starting states explain to first order, times the
            root of the window's weight.
        jacobian: (m, p) derivative of `weighted` by the parameters.
        deviations: (nq + nv,) standard deviations of the measurements.
        freedom: Number of residuals that the starting states leave free.
        loss: Loss of the weighted residuals: their sum of squares, if all windows fit.
        iterations: Number of iterations.
    """

    values: Array
    residuals: Array
    weighted: Array
    jacobian: Array
    deviations: Array
    freedom: float
    loss: float
    iterations: int


class WindowFit:
    """Fits parameters to windows by the method of Gauss and Newton with shortened steps.

    A window starts from a state that is measured with noise, so the state is estimated as well, from all rows of the
    window. It is eliminated from the normal equations (variable projection), so that only the parameters remain.

    Args:
        setup: Simulation setup before the parameters change it.
        parameters: The parameters.
        windows: The windows.
    """

    def __init__(self, setup: Setup, parameters: Sequence[Parameter], windows: Sequence[Window]) -> None:
        self._setup = setup
        self._parameters = parameters
        self._windows = windows
        self._scales = np.array([parameter.scale for parameter in parameters])
        self._lows = np.array([parameter.low for parameter in parameters])
        self._highs = np.array([parameter.high for parameter in parameters])
        self._shooter = Shooter(setup.model.nq, np.array(setup.model.wheel_joint_indices))
        self._states = [window.measured[0].copy() for window in windows]

    def hold(self, held: Mapping[int, float]) -> "WindowFit":
        """Returns a copy with some parameters, by index, held at given values."""
        setup = self._setup
        for i, value in held.items():
            setup = self._parameters[i].apply(setup, value)
        free = [parameter for i, parameter in enumerate(self._parameters) if i not in held]
        fit = WindowFit(setup, free, self._windows)
        fit.go_on_from(self)
        return fit

    def go_on_from(self, other: "WindowFit") -> None:
        """Copies the starting states of another fit of the same windows."""
        self._states = list(other._states)

    def restart(self, solution: Solution) -> bool:
        """Fits the starting states of windows that do not fit from other places: as measured, and drawn around it.

        Returns:
            Whether a window fits better now. The draws are the same each time.
        """
        setup = self._setup
        for parameter, value in zip(self._parameters, solution.values.tolist(), strict=True):
            setup = parameter.apply(setup, value)
        random = np.random.default_rng(0)
        is_better = False
        for k, window in enumerate(self._windows):
            alone = WindowFit(setup, [], [window])
            alone._states = [self._states[k]]
            loss = alone.solve(np.zeros(0), solution.deviations, iterations=0).loss
            if loss <= MISFIT * window.measured.size:
                continue
            for draw in range(DRAWS):
                noise = random.normal(0.0, solution.deviations) if draw else 0.0
                alone._states = [window.measured[0] + noise]
                found = alone.solve(np.zeros(0), solution.deviations, iterations=DRAW_ITERATIONS).loss
                if found < loss - 1.0:
                    loss, self._states[k], is_better = found, alone._states[0], True
        return is_better

    def rover(self, values: Array) -> tuple[Simulation, float]:
        """A simulation with given values of the parameters, and the factor on its torques."""
        setup = self._setup
        for parameter, value in zip(self._parameters, values.tolist(), strict=True):
            setup = parameter.apply(setup, value)
        return setup.simulation(), setup.gain

    def solve(
        self,
        values: Array,
        deviations: Array,
        *,
        iterations: int,
        progress: Callable[[int, float], None] = lambda _iteration, _cost: None,
    ) -> Solution:
        """Fits from given values and the last starting states.

        Args:
            values: (p,) start values of the parameters.
            deviations: (nq + nv,) standard deviations of the measurements, by which residuals are divided.
            iterations: Largest number of iterations.
            progress: Called with each iteration and the mean square of the weighted residuals.
        """
        part, done, attempts = 1.0, 0, 0
        values = np.clip(values, self._lows, self._highs)
        linear = self._linearise(values, deviations)
        n = sum(part.residuals.size for part in linear)
        cost = _cost(linear)
        while done < iterations and attempts < MOST_ATTEMPTS and cost > EXACT * n:
            progress(done, cost / n)
            moved, states, found = self._better(values, deviations, linear, part)
            if not found < cost:
                part, attempts = 0.25 * part, attempts + 1
                continue
            is_last = cost - found < SMALLEST_GAIN * found / n
            values, self._states, part, attempts = moved, states, min(4.0 * part, 1.0), 0
            linear = self._linearise(values, deviations)
            cost = _cost(linear)
            done += 1
            if is_last:
                break
        progress(done, cost / n)
        width = deviations.size
        freedom = sum(part.weight * (part.residuals.size - float((part.basis**2).sum())) for part in linear)
        residuals = np.concatenate([part.residuals for part in linear])
        return Solution(
            values,
            (residuals.reshape(-1, width) * deviations).ravel(),
            _reduced(linear, [part.residuals for part in linear]),
            _reduced(linear, [part.by_parameters for part in linear]),
            deviations,
            freedom,
            cost,
            done,
        )

    def _linearise(self, values: Array, deviations: Array) -> list[_Linear]:
        """Residuals and derivatives of all windows, by central differences."""
        ends, distances = [], []
        for i, change in enumerate(PARAMETER_CHANGE * self._scales):
            pair = []
            for sign in (1.0, -1.0):
                moved = values.copy()
                moved[i] = np.clip(moved[i] + sign * change, self._lows[i], self._highs[i])
                pair.append(moved)
            ends += pair
            distances.append(pair[0][i] - pair[1][i])
        changed = [self.rover(end) for end in ends]
        base = self.rover(values)
        changes = np.maximum(deviations, SMALLEST_CHANGE)
        n = changes.size
        rovers = [base[0]] * (2 * n + 1) + [rover for rover, _ in changed]
        gains = np.array([base[1]] * (2 * n + 1) + [gain for _, gain in changed])
        shot: list[tuple[Array, Array]] = []
        for window, state in zip(self._windows, self._states, strict=True):
            states = np.tile(state, (len(rovers), 1))
            states[1 : n + 1] += np.diag(changes)
            states[n + 1 : 2 * n + 1] -= np.diag(changes)
            shot.append((states, self._weighted(window, rovers, gains, states, deviations)))
        misfits = [i for i, (_, rows) in enumerate(shot) if _is_misfit(rows[0])]
        # If most windows do not fit, it is for the parameters.
        for i in misfits if 2 * len(misfits) <= len(shot) or len(shot) == 1 else ():
            states, rows = shot[i]
            for _ in range(MOST_MOVES):
                squares = np.nan_to_num((rows[: 2 * n + 1] ** 2).sum(axis=1), nan=np.inf)
                best = int(np.argmin(squares))
                if best == 0 or not _is_misfit(rows[0]):
                    break
                states = states + (states[best] - states[0])
                rows = self._weighted(self._windows[i], rovers, gains, states, deviations)
            shot[i] = (states, rows)
        self._states = [states[0] for states, _ in shot]
        result = []
        for window, (_, rows) in zip(self._windows, shot, strict=True):
            if not np.isfinite(rows[0]).all():
                refuse(
                    OptionError,
                    "recording",
                    float(window.time[0]),
                    "has a window that cannot be simulated, which starts at (s)",
                )
            by_state = np.nan_to_num((rows[1 : n + 1] - rows[n + 1 : 2 * n + 1]).T / (2.0 * changes))
            by_parameters = np.nan_to_num((rows[2 * n + 1 :: 2] - rows[2 * n + 2 :: 2]).T / np.array(distances))
            result.append(_Linear(rows[0], by_state, by_parameters, np.linalg.qr(by_state)[0]))
        return result

    def _better(
        self, values: Array, deviations: Array, linear: Sequence[_Linear], part: float
    ) -> tuple[Array, list[Array], float]:
        """A part of a step of Gauss and Newton: parameters, starting states and the loss there.

        Combinations of the parameters that the run does not determine do not change.
        """
        jacobian = _reduced(linear, [one.by_parameters for one in linear]) * self._scales
        residuals = _reduced(linear, [one.residuals for one in linear])
        left, sensitivities, right = np.linalg.svd(jacobian, full_matrices=False)
        identifiable = is_identifiable(sensitivities)
        step = -right[identifiable].T @ ((left.T @ residuals)[identifiable] / sensitivities[identifiable])
        step *= part / max(1.0, float(np.abs(step).max(initial=0.0)) / LONGEST_STEP)
        moved = np.clip(values + self._scales * step, self._lows, self._highs)
        rover, gain = self.rover(moved)
        tries = len(DAMPINGS) + 1  # the last is where it is
        rovers, gains = [rover] * tries, np.full(tries, gain)
        changes = np.maximum(deviations, SMALLEST_CHANGE)
        states, total = [], 0.0
        for one, window, state in zip(linear, self._windows, self._states, strict=True):
            expected = one.residuals + one.by_parameters @ (moved - values)
            _, widths, axes = np.linalg.svd(one.by_state * changes, full_matrices=False)
            along = axes @ (changes * (one.by_state.T @ expected))
            tried = np.tile(state, (tries, 1))
            for k, damping in enumerate(DAMPINGS):
                tried[k] -= changes * (axes.T @ (along / (widths**2 + damping + 1e-12 * widths[0] ** 2)))
            rows = self._weighted(window, rovers, gains, tried, deviations)
            costs = np.nan_to_num((rows**2).sum(axis=1), nan=np.inf)
            best = int(np.argmin(costs))
            states.append(tried[best])
            total += _loss(rows[best])
        return moved, states, total

    def _weighted(
        self, window: Window, rovers: Sequence[Simulation], gains: Array, states: Array, deviations: Array
    ) -> Array:
        """(n, m) weighted residuals of a window, simulated minus measured, from each state."""
        rows = self._shooter.shoot(window, rovers, gains, states)
        return ((rows - window.measured) / deviations).reshape(len(rovers), -1)


def is_identifiable(sensitivities: Array) -> npt.NDArray[np.bool_]:
    """(p,) which combinations of parameters a run determines, in the order of their sensitivities."""
    least = max(LEAST_SENSITIVITY, SMALLEST_SENSITIVITY * float(sensitivities.max(initial=0.0)))
    identifiable: npt.NDArray[np.bool_] = sensitivities >= least
    return identifiable


def _is_misfit(residuals: Array) -> bool:
    return not float(residuals @ residuals) < MISFIT * residuals.size


def _loss_argument(residuals: Array) -> float:
    return float(residuals @ residuals) / residuals.size / TOLERATED


def _loss(residuals: Array) -> float:
    """Cauchy's loss of a window: its sum of squares if it fits, the logarithm of it if it does not."""
    return residuals.size * TOLERATED * float(np.log1p(_loss_argument(residuals)))


def _cost(linear: Sequence[_Linear]) -> float:
    return sum(_loss(part.residuals) for part in linear)


def _reduced(linear: Sequence[_Linear], columns: Sequence[Array]) -> Array:
    """The weighted part of the columns that changes of the starting states cannot explain."""
    parts = [np.sqrt(part.weight) * part.free_of_state(one) for part, one in zip(linear, columns, strict=True)]
    return np.concatenate(parts)
