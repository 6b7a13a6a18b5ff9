"""A trajectory with the derivatives of its steps."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rover_gym.core import OptionError, Simulation, StateError
from rover_gym.core.validation import refuse


class Gradients(NamedTuple):
    """Gradients of a number that depends on a trajectory."""

    state: NDArray[np.float64]
    """By the state at its start, (..., nx)."""
    commands: NDArray[np.float64]
    """By the command of each step, (..., steps, nu)."""
    parameters: NDArray[np.float64]
    """By the parameters, (..., n_parameters)."""


@dataclass(frozen=True, eq=False)
class Rollout:
    """States of a trajectory, or of a batch of them, with the derivatives of each step.

    To first order `dx[k + 1] = a[k] @ dx[k] + b[k] @ du[k] + c[k] @ dp`.
    """

    states: NDArray[np.float64]
    """States (q, v), on soft ground with the sand behind, (..., steps + 1, nx)."""
    a: NDArray[np.float64]
    """Derivatives of the next state by the state, (..., steps, nx, nx)."""
    b: NDArray[np.float64]
    """By the command, (..., steps, nx, nu)."""
    c: NDArray[np.float64]
    """By the parameters, (..., steps, nx, n_parameters)."""
    parameters: tuple[str, ...]
    """Names of the parameters."""

    def jvp(
        self,
        state: ArrayLike | None = None,
        commands: ArrayLike | None = None,
        parameters: ArrayLike | None = None,
    ) -> NDArray[np.float64]:
        """Changes of all states with a change of state, commands and parameters, to first order.

        Args:
            state: Change of the state at the start, (..., nx); none by default.
            commands: Changes of the commands, (..., steps, nu); none by default.
            parameters: Changes of the parameters, (..., n_parameters); none by default.

        Returns:
            Changes of the states, (..., steps + 1, nx).

        Raises:
            OptionError: A change has a wrong shape.
        """
        batch, steps = self.b.shape[:-3], self.b.shape[-3]
        out = np.zeros_like(self.states)
        out[..., 0, :] = _shaped("state", state, (*batch, self.a.shape[-1]))
        du = _shaped("commands", commands, (*batch, steps, self.b.shape[-1]))
        dp = _shaped("parameters", parameters, (*batch, self.c.shape[-1]))
        driven = _times(self.b, du) + _times(self.c, dp[..., None, :])
        for k in range(steps):
            out[..., k + 1, :] = _times(self.a[..., k, :, :], out[..., k, :]) + driven[..., k, :]
        return out

    def vjp(self, states: ArrayLike) -> Gradients:
        """Gradients of a number, from its derivatives by all states of the trajectory.

        Args:
            states: Derivative of the number by each state, (..., steps + 1, nx).

        Returns:
            Its gradients by the state at the start, the commands and the parameters.

        Raises:
            OptionError: `states` has a wrong shape.
        """
        direct = _shaped("states", states, self.states.shape)
        costate = direct.copy()
        for k in reversed(range(self.a.shape[-3])):
            costate[..., k, :] += _transpose_times(self.a[..., k, :, :], costate[..., k + 1, :])
        later = costate[..., 1:, :]
        by_parameters = _transpose_times(self.c, later).sum(axis=-2)
        return Gradients(costate[..., 0, :].copy(), _transpose_times(self.b, later), by_parameters)


def rollout(
    simulation: Simulation,
    state: ArrayLike,
    commands: ArrayLike,
    parameters: Sequence[str] = (),
    threads: int | None = None,
) -> Rollout:
    """Drives copies of a simulation and differentiates every step.

    Each step is the one after `Simulation.set_state`, without memory of earlier impulses. Torques saturate at their
    limits. The simulation does not change. On soft ground the state has seven more numbers a wheel, see
    `Linearisation`, and the ruts stay as they are in the simulation.

    Args:
        simulation: Model, ground with its ruts, options, held joints and further torques.
        state: State at the start, (nx,), or a batch of them, (n, nx). On soft ground (q, v) alone serves too: the
            sand is then as it is in the simulation.
        commands: Wheel torques (N m) and steering set-points (rad) of each step, (steps, nu) or (n, steps, nu).
        parameters: Names of parameters, as in `Simulation.linearise`.
        threads: Number of threads for a batch; one a core by default.

    Returns:
        The trajectories with their derivatives.

    Raises:
        StateError: `state` has a wrong shape or an entry that is not finite, or a pitch is 90 degrees.
        CommandError: `commands` has a wrong shape or an entry that is refused.
        OptionError: A parameter does not exist.
        StepError: A step could not be taken, or has no derivative.
    """
    start, driven = np.asarray(state, dtype=np.float64), np.asarray(commands, dtype=np.float64)
    if start.ndim not in (1, 2):
        refuse(StateError, "state", start.shape, "needs shape (nx,) or (n, nx)")
    is_one = start.ndim == 1
    if is_one:
        start, driven = start[None], driven[None]
    names = (parameters,) if isinstance(parameters, str) else tuple(parameters)
    found = simulation.differentiate(start, driven, names, threads)
    one = 0 if is_one else slice(None)
    return Rollout(found.states[one], found.a[one], found.b[one], found.c[one], names)


def state_size(simulation: Simulation) -> int:
    """The number nx of entries of the state."""
    model = simulation.model
    return 2 * model.nv + (0 if simulation.sand() is None else 7 * len(model.wheel_names))


def _times(matrices: NDArray[np.float64], vectors: NDArray[np.float64]) -> NDArray[np.float64]:
    return (matrices @ vectors[..., None])[..., 0]


def _transpose_times(matrices: NDArray[np.float64], vectors: NDArray[np.float64]) -> NDArray[np.float64]:
    return (vectors[..., None, :] @ matrices)[..., 0, :]


def _shaped(field: str, given: ArrayLike | None, shape: tuple[int, ...]) -> NDArray[np.float64]:
    if given is None:
        return np.zeros(shape)
    array = np.asarray(given, dtype=np.float64)
    if array.shape != shape:
        refuse(OptionError, field, array.shape, f"needs shape {shape}")
    return array
