"""A rollout as a function of PyTorch, by its extension point `torch.autograd.Function`."""

from typing import Any

from rover_gym.core import Simulation
from rover_gym.core.extras import require
from rover_gym.derivatives.rollout import rollout


def torch_rollout(simulation: Simulation, threads: int | None = None) -> Any:
    """The states of a rollout as a function that PyTorch differentiates.

    Args:
        simulation: Model, ground and options, as in `rollout`.
        threads: Number of threads for a batch; one a core by default.

    Returns:
        A function of a state, (nx,) or (n, nx), and commands, (steps, nu) or (n, steps, nu), both tensors, to the
        states, (steps + 1, nx) or (n, steps + 1, nx). On soft ground the state may be (q, v), as in `rollout`. It
        computes in double precision on the processor, and returns the type and the device of the state. Second
        derivatives do not exist.

    Raises:
        MissingExtraError: PyTorch is not installed.
    """
    torch = require("torch", "train")

    class RolloutFunction(torch.autograd.Function):  # type: ignore[misc, name-defined]
        @staticmethod
        def forward(ctx: Any, state: Any, commands: Any) -> Any:
            def array(tensor: Any) -> Any:
                return tensor.detach().cpu().double().numpy()

            ctx.rollout = rollout(simulation, array(state), array(commands), threads=threads)
            ctx.size = state.shape[-1]
            ctx.like = state.dtype, state.device, commands.dtype, commands.device
            return torch.from_numpy(ctx.rollout.states).to(state)

        @staticmethod
        @torch.autograd.function.once_differentiable  # type: ignore[untyped-decorator]
        def backward(ctx: Any, costate: Any) -> Any:
            gradients = ctx.rollout.vjp(costate.cpu().double().numpy())
            dtype, device, commands_dtype, commands_device = ctx.like
            by_state = torch.from_numpy(gradients.state[..., : ctx.size]).to(device, dtype)
            return by_state, torch.from_numpy(gradients.commands).to(commands_device, commands_dtype)

    return RolloutFunction.apply
