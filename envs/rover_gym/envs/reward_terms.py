"""The terms of the reward: the weights of the environment's own, and terms that the user gives as functions.

A term is a function of a control period,

    term(before, action, after, info) -> reward

with the observations before and after it, split into their fields in SI units by `ObservationLayout.split`, the action,
and the info of the step. It is called once for one rover, or once for all rovers of a batch: then every array has a
leading axis of n rovers, and the reward is `(n,)`. Written with `[..., i]`, one function serves both:

    def climb(before, action, after, info):
        return after["q"][..., 1] - before["q"][..., 1]  # metres that the trunk has risen

The value counts as it is, without a weight, and stands under the term's name in `info["reward_terms"]`. A period that
ends with `"step_failed"` earns nothing from it.

The reward of a step is the sum of the terms. Each term is its weight times a quantity of that step; a negative weight
makes it a cost. The card of `RoverEnv` lists the quantities, and the core computes them.
"""

from collections.abc import Callable, Iterable, Mapping
from types import MappingProxyType
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

from rover_gym.core import OptionError
from rover_gym.core.validation import refuse, shown
from rover_gym.envs.observation import Array, Mask, ObservationLayout, Observations

Fields: TypeAlias = dict[str, Array]

#: A term of the reward; see the module's docstring.
RewardTerm: TypeAlias = Callable[[Fields, Array, Fields, Mapping[str, Any]], npt.ArrayLike]

RewardTerms: TypeAlias = Mapping[str, RewardTerm]

#: Default weights. A 7 m drive on flat ground earns about 15: 7 for progress and 10 at the goal, less the costs.
WEIGHTS: Mapping[str, float] = MappingProxyType(
    {
        "progress": 1.0,
        "time": -0.05,
        "energy": -5e-5,
        "slip": -0.1,
        "tilt": -0.1,
        "torque_change": -0.02,
        "steering_change": -0.02,
        "success": 10.0,
        "failure": -10.0,
    }
)


def check_reward_terms(field: str, value: object) -> dict[str, RewardTerm]:
    """Checks terms by name, or one function, whose own name counts."""
    if callable(value):
        name = getattr(value, "__name__", "")
        if not name.isidentifier():
            refuse(OptionError, field, value, "has no name: give a mapping from names to functions")
        value = {name: value}
    if not isinstance(value, Mapping):
        refuse(OptionError, field, value, "must be a function or a mapping from names to functions")
    for name, term in value.items():
        if not (isinstance(name, str) and name.isidentifier()):
            refuse(OptionError, f"{field}.{shown(name)}", name, "must have an identifier as its name")
        if name in WEIGHTS:
            refuse(
                OptionError,
                f"{field}.{name}",
                term,
                "is already a term of the environment; change its weight by reward_weights",
            )
        if not callable(term):
            refuse(OptionError, f"{field}.{name}", term, "must be a function")
    return dict(value)


def earn(
    terms: RewardTerms,
    layout: ObservationLayout,
    before: Observations,
    action: npt.ArrayLike,
    after: Observations,
    info: Mapping[str, Any],
    counts: Mask | bool = True,
) -> dict[str, Array]:
    """The terms of a control period, `()` of one rover or `(n,)` of a batch.

    Args:
        terms: The functions by name.
        layout: Layout of the observations.
        before: `(size,)` or `(n, size)` observations before the period.
        action: `(n_actions,)` or `(n, n_actions)`.
        after: Observations after it.
        info: Info of the step, or the infos of the batch.
        counts: Whether a rover has moved, and its step has not failed; the others earn 0.

    Raises:
        OptionError: A function raises, or returns another shape or a number that is not finite; `field` names it. The
            period has been taken.
    """
    fields = layout.split(before), np.asarray(action, np.float64), layout.split(after)
    shape = np.shape(after)[:-1]
    return {name: _term(name, term, fields, info, np.broadcast_to(counts, shape)) for name, term in terms.items()}


def _term(
    name: str, term: RewardTerm, fields: tuple[Fields, Array, Fields], info: Mapping[str, Any], counts: Mask
) -> Array:
    field, function = f"reward_terms.{name}", getattr(term, "__qualname__", type(term).__name__)
    try:
        value = np.asarray(term(*fields, info), np.float64)
    except Exception as error:
        reason = f"{function} raised {type(error).__name__}: {error}"
        exception = OptionError(f"{field}: {reason}")
        exception.field, exception.value = field, term
        raise exception from error
    if value.shape not in ((), counts.shape):
        refuse(OptionError, field, value.shape, f"{function} must return the shape {counts.shape}")
    earned: Array = np.where(counts, value, 0.0)
    if not np.isfinite(earned).all():
        refuse(OptionError, field, value, f"{function} must return finite numbers")
    return earned


def total(terms: Iterable[Array]) -> Array:
    """The sum of terms of one shape, one after the other."""
    return sum(terms, start=np.zeros(()))
