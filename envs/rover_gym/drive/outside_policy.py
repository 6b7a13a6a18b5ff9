"""Policies from outside the package: functions and classes of any module, and networks in ONNX files."""

import importlib
import inspect
import json
import re
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import numpy.typing as npt

from rover_gym.core.extras import require
from rover_gym.core.validation import refuse
from rover_gym.drive.forecast.network_files import PolicyError

_MODULE_AND_NAME = re.compile(r"[^\W\d]\w*(\.[^\W\d]\w*)*:[^\W\d]\w*")


def is_module_and_name(policy: str) -> bool:
    """Whether a policy's name is "module:function" or "module:Class"."""
    return _MODULE_AND_NAME.fullmatch(policy) is not None


def named_object(policy: str) -> tuple[Any, Path | None]:
    """The object that "module:name" means, and the file of its module. Modules of the working folder are found, too.

    Raises:
        PolicyError: The module cannot be imported, has no such name, or the object cannot be called.
    """
    module_name, _, name = policy.partition(":")
    sys.path.insert(0, str(Path.cwd()))
    try:
        module = importlib.import_module(module_name)
    except ImportError as error:
        refuse(PolicyError, "policy", policy, f"cannot be imported ({error})")
    finally:
        sys.path.pop(0)
    found = getattr(module, name, None)
    if not callable(found) and not callable(getattr(found, "predict", None)):
        refuse(PolicyError, "policy", policy, f"must name a function or a class of {module_name}")
    file = inspect.getsourcefile(module)
    return found, None if file is None else Path(file)


def object_policy(found: Any, env: Any) -> Any:
    """The policy that an object of a module is: with `predict` as it is, a class made for `env`, or a function.

    Raises:
        PolicyError: The class makes objects without `predict`.
    """
    is_class = inspect.isclass(found)
    made: Any = found(env) if is_class else found
    if callable(getattr(made, "predict", None)):
        return made
    if is_class:
        refuse(PolicyError, "policy", type(made).__name__, "must be a class of objects with `predict`")
    return FunctionPolicy(made, env.observation_space)


class FunctionPolicy:
    """A function from an observation to an action as a policy.

    Args:
        function: Takes one observation of the environment and returns an action.
        space: The environment's observation space.
    """

    def __init__(self, function: Callable[[Any], Any], space: gym.Space[Any]) -> None:
        self._function, self._space = function, space

    def predict(
        self,
        observation: Any,
        state: Any = None,
        episode_start: Any = None,  # noqa: ARG002 - as stable-baselines3's
    ) -> tuple[npt.NDArray[Any], Any]:
        """The action for an observation, or `(n, ...)` actions for a batch of flat observations `(n, size)`."""
        if isinstance(self._space, gym.spaces.Box) and np.ndim(observation) > len(self._space.shape):
            return np.stack([np.asarray(self._function(one)) for one in observation]), state
        return np.asarray(self._function(observation)), state


class OnnxPolicy:
    """A network in an ONNX file as a policy; needs the extra `onnx`.

    The graph has one input of observations `(n, size) float32`, or for dictionaries an input of each part by its name.
    Its first output is `(n, n_actions)`. If actions are discrete, it has a score for each, and the largest is chosen.

    Args:
        env: The environment.
        path: The file.

    Raises:
        PolicyError: The file is no ONNX graph, or its inputs or output do not fit the environment.
        MissingExtraError: onnxruntime is not installed.
        OSError: The file cannot be read.
    """

    def __init__(self, env: gym.Env[Any, Any], path: Path) -> None:
        self._session = onnx_session(path)
        self._actions, space = env.action_space, env.observation_space
        self._shapes: dict[str, tuple[int, ...]]
        inputs = {one.name: tuple(one.shape[1:]) for one in self._session.get_inputs()}
        if isinstance(space, gym.spaces.Dict):
            self._shapes = {name: part.shape or () for name, part in space.items()}
        else:
            self._shapes = dict.fromkeys(inputs if len(inputs) == 1 else ("observation",), space.shape or ())
        wanted = self._shapes
        if inputs.keys() != wanted.keys() or not all(_fits(inputs[name], wanted[name]) for name in inputs):
            refuse(PolicyError, "policy", str(path), f"has inputs {inputs}, but the environment's are {wanted}")
        n_out = self._actions.n if isinstance(self._actions, gym.spaces.Discrete) else self._actions.shape[0]  # type: ignore[index]
        output = tuple(self._session.get_outputs()[0].shape[1:])
        if not _fits(output, (int(n_out),)):
            refuse(PolicyError, "policy", str(path), f"has outputs {output}, but the environment has {n_out} actions")

    def predict(
        self,
        observation: Any,
        state: Any = None,
        episode_start: Any = None,  # noqa: ARG002 - as stable-baselines3's
    ) -> tuple[npt.NDArray[Any], Any]:
        """The action for an observation, or `(n, ...)` actions for a batch of them."""
        given = observation if isinstance(observation, Mapping) else dict.fromkeys(self._shapes, observation)
        rows = {name: np.asarray(given[name], np.float32) for name in self._shapes}
        is_one = all(row.ndim == len(self._shapes[name]) for name, row in rows.items())
        found = self._session.run(None, {name: row[None] if is_one else row for name, row in rows.items()})[0]
        actions = found.argmax(axis=-1) if isinstance(self._actions, gym.spaces.Discrete) else found
        return np.asarray(actions[0] if is_one else actions), state


def onnx_session(path: Path) -> Any:
    """The session of an ONNX file on one thread of the processor.

    Raises:
        PolicyError: The file is no ONNX graph.
        MissingExtraError: onnxruntime is not installed.
        OSError: The file cannot be read.
    """
    runtime = require("onnxruntime", "onnx")
    options = runtime.SessionOptions()
    options.intra_op_num_threads = options.inter_op_num_threads = 1
    content = path.read_bytes()
    try:
        return runtime.InferenceSession(content, options, providers=["CPUExecutionProvider"])
    except Exception as error:  # onnxruntime has no common class of its errors
        first, *_ = str(error).splitlines() or [type(error).__name__]
        refuse(PolicyError, "policy", str(path), f"cannot be read as an ONNX graph: {first}")


def onnx_arguments(path: Path) -> dict[str, Any]:
    """The arguments of the environment that `rover export onnx` has written into a file; none in another's file."""
    text = onnx_session(path).get_modelmeta().custom_metadata_map.get("environment", "{}")
    try:
        found = json.loads(text)
    except ValueError:
        return {}
    arguments = found if isinstance(found, dict) else {}
    return {name: tuple(value) if isinstance(value, list) else value for name, value in arguments.items()}


def _fits(shape: tuple[Any, ...], wanted: tuple[int, ...]) -> bool:
    """Whether a shape of a graph, whose sizes may be names, can be another one."""
    return len(shape) == len(wanted) and all(
        a == b or not isinstance(a, int) for a, b in zip(shape, wanted, strict=True)
    )
