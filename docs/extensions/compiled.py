"""The compiled module as its stub describes it, which has the types beside the module's own docstrings."""

import __future__

import re
import sys
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any

from sphinx.pycode import ModuleAnalyzer

import rover_gym
from rover_gym import core

NAMES_IN_PRINT = (
    ("npt.ArrayLike", "ArrayLike"),
    (r"npt.NDArray\[np.\w+\]", "np.ndarray"),
)  # unfolded, they fill half a page


def in_print(text: str) -> str:
    """A stub whose signatures say what they take: public names, and what private aliases stand for."""
    for pattern, name in NAMES_IN_PRINT:
        text = re.sub(pattern, name, text)
    aliases = dict(re.findall(r"^(_\w+): TypeAlias = (.*)$", text, flags=re.MULTILINE))
    text = re.sub(r"^_\w+: TypeAlias = .*\n", "", text, flags=re.MULTILINE)
    for _ in aliases:  # one may stand in another
        for alias, meaning in aliases.items():
            text = re.sub(rf"\b{alias}\b", meaning, text)
    return re.sub(r"\b_([A-Z]\w*)\b", r"\1", text)  # a protocol that only the stub has


def use_stub() -> None:
    """Puts the stub's classes where Sphinx looks for the compiled ones, in `rover_gym.core`."""
    name = core.__name__
    stub = ModuleType(name, core.__doc__)
    source = Path(core.__file__).parents[1] / "_core.pyi"
    text = in_print(source.read_text(encoding="utf-8"))
    stub.__path__ = core.__path__  # its checks of arguments are modules
    stub.ArrayLike = type("ArrayLike", (), {"__module__": "numpy.typing"})
    stub.first_docstring = first_docstring
    run = text.replace("@overload", "@first_docstring")
    # A stub may name a class before it is there, so its annotations stay unevaluated.
    code = compile(run, source, "exec", __future__.annotations.compiler_flag)
    exec(code, stub.__dict__)  # noqa: S102 - our own stub
    sys.modules[name] = rover_gym.core = stub
    ModuleAnalyzer.cache["module", name] = ModuleAnalyzer.for_string(text, name, str(source))


def first_docstring(function: Callable[..., Any], known: dict[str, str | None] = {}) -> Callable[..., Any]:  # noqa: B006
    """Gives all signatures of an overloaded function the docstring of the first, which alone has one."""
    function.__doc__ = known.setdefault(function.__qualname__, function.__doc__)
    return function


def is_compiled(thing: object) -> bool:
    """Whether something comes from the compiled module, whose chapters document it, whoever offers it again."""
    return str(getattr(thing, "__module__", "")).startswith("rover_gym._core")
