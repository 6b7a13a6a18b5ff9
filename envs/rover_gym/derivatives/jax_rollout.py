"""A rollout as a function of JAX, by its extension points `custom_vjp` and `pure_callback`."""

from typing import Any

import numpy as np

from rover_gym.core import Simulation
from rover_gym.core.extras import require
from rover_gym.derivatives.rollout import rollout, state_size


def jax_rollout(simulation: Simulation, threads: int | None = None) -> Any:
    """The states of a rollout as a function that JAX differentiates in reverse.

    Args:
        simulation: Model, ground and options, as in `rollout`.
        threads: Number of threads for a batch; one a core by default.

    Returns:
        A function of a state, (nx,) or (n, nx), and commands, (steps, nu) or (n, steps, nu), to the states,
        (steps + 1, nx) or (n, steps + 1, nx), of the state's type. On soft ground the state may be (q, v), as in
        `rollout`. It computes in double precision on the processor, within `jit` too. Second derivatives do not exist.

    Raises:
        MissingExtraError: JAX is not installed.
    """
    jax = require("jax", "jax")
    numbers = jax.numpy

    def on_host(state: Any, commands: Any) -> Any:
        dtype = np.asarray(state).dtype
        found = rollout(simulation, np.asarray(state, float), np.asarray(commands, float), threads=threads)
        return tuple(array.astype(dtype) for array in (found.states, found.a, found.b))

    def call(state: Any, commands: Any) -> Any:
        batch, nx, (steps, nu) = state.shape[:-1], state_size(simulation), commands.shape[-2:]
        shapes = ((steps + 1, nx), (steps, nx, nx), (steps, nx, nu))
        out = tuple(jax.ShapeDtypeStruct((*batch, *shape), state.dtype) for shape in shapes)
        return jax.pure_callback(on_host, out, state, commands, vmap_method="sequential")

    def forward(state: Any, commands: Any) -> Any:
        states, a, b = call(state, commands)
        return states, (a, b, state)

    def backward(derivatives: Any, costate: Any) -> Any:
        a, b, start = derivatives

        def back(later: Any, step: Any) -> Any:
            a_k, b_k, direct = step
            now = direct + numbers.einsum("...ij,...i->...j", a_k, later)
            return now, numbers.einsum("...ij,...i->...j", b_k, later)

        steps = (numbers.moveaxis(a, -3, 0), numbers.moveaxis(b, -3, 0), numbers.moveaxis(costate[..., :-1, :], -2, 0))
        state, commands = jax.lax.scan(back, costate[..., -1, :], steps, reverse=True)
        return state[..., : start.shape[-1]], numbers.moveaxis(commands, 0, -2)

    function = jax.custom_vjp(lambda state, commands: call(state, commands)[0])
    function.defvjp(forward, backward)
    return lambda state, commands: function(state, numbers.asarray(commands, state.dtype))
