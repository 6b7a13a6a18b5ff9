"""The compiled module as its stub describes it, which has the types beside the module's own docstrings."""

import __future__

import operator
import sys
from collections.abc import Callable
from functools import reduce
from pathlib import Path
from types import ModuleType
from typing import Any

from sphinx.pycode import ModuleAnalyzer

import rover_gym
from rover_gym import mechanics

ALIASES = (("npt.ArrayLike", "ArrayLike"), ("npt.NDArray[np.float64]", "np.ndarray"))  # unfolded, they fill half a page


def use_stub() -> None:
    """Puts the stub's classes where Sphinx looks for the compiled ones, in `rover_gym.mechanics`."""
    name = mechanics.__name__
    stub = ModuleType(name, mechanics.__doc__)
    source = Path(mechanics.__file__).with_name("_core.pyi")
    text = source.read_text(encoding="utf-8")
    for alias, name_in_print in ALIASES:
        text = text.replace(alias, name_in_print)
    stub.ArrayLike = type("ArrayLike", (), {"__module__": "numpy.typing"})
    stub.first_docstring = first_docstring
    run = text.replace("@overload", "@first_docstring")
    # A stub may name a class before it is there, so its annotations stay unevaluated.
    code = compile(run, source, "exec", __future__.annotations.compiler_flag)
    exec(code, stub.__dict__)  # noqa: S102 - our own stub
    kinds = (stub.Plane, stub.SphereField, stub.HeightField, stub.TriangleMesh, stub.Union)  # type: ignore[attr-defined]
    stub.Terrain = reduce(operator.or_, kinds)  # type: ignore[attr-defined]
    sys.modules[name] = rover_gym.mechanics = stub
    ModuleAnalyzer.cache["module", name] = ModuleAnalyzer.for_string(text, name, str(source))


def first_docstring(function: Callable[..., Any], known: dict[str, str | None] = {}) -> Callable[..., Any]:  # noqa: B006
    """Gives all signatures of an overloaded function the docstring of the first, which alone has one."""
    function.__doc__ = known.setdefault(function.__qualname__, function.__doc__)
    return function


def is_compiled(thing: object) -> bool:
    """Whether something comes from the compiled module, whose chapters document it, whoever offers it again."""
    return str(getattr(thing, "__module__", "")).startswith("rover_gym._core")
