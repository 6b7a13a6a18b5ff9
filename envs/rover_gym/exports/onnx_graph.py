"""Multilayer perceptrons as ONNX graphs, built from their weights without a training framework."""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from rover_gym.core import __version__
from rover_gym.core.extras import require

if TYPE_CHECKING:
    from collections.abc import Mapping

Array = npt.NDArray[np.float32]

#: Version that runtimes since 2022 read.
OPSET, IR_VERSION = 17, 8


@dataclass(frozen=True)
class Perceptron:
    """A perceptron with input normalisation and output scaling.

    `y = after(W_n f(... f(W_1 x' + b_1) ...) + b_n)` with `x' = clip((x - mean) / deviation)`.

    Attributes:
        weights: Matrices, each (outputs, inputs).
        biases: Vectors, each (outputs,).
        activation: f, an ONNX operator without attributes: "Tanh", "Relu", ...
        mean: (inputs,).
        deviation: (inputs,).
        largest: Limit of the normalised inputs; None for no limit.
        squash: "Clip" or "Tanh", which bounds the outputs by 1.
        scale: (outputs,) factor of the squashed outputs.
        offset: (outputs,) offset added afterwards.
        low: (outputs,) lower limits at the end.
        high: (outputs,) upper limits at the end.
    """

    weights: tuple[Array, ...]
    biases: tuple[Array, ...]
    activation: str
    mean: Array | None = None
    deviation: Array | None = None
    largest: float | None = None
    squash: str | None = None
    scale: Array | None = None
    offset: Array | None = None
    low: Array | None = None
    high: Array | None = None


def onnx_model(network: Perceptron, name: str, inputs: str, outputs: str, facts: Mapping[str, Any]) -> Any:
    """The graph of a network, for any number of rows.

    Args:
        network: The network.
        name: Name of the graph.
        inputs: Name of its input, (n, inputs) float32.
        outputs: Name of its output, (n, outputs) float32.
        facts: Metadata, stored as JSON texts.

    Raises:
        MissingExtraError: onnx is not installed.
    """
    onnx = require("onnx", "onnx")
    nodes: list[Any] = []
    constants: list[Any] = []
    value = inputs

    def constant(array: npt.ArrayLike) -> str:
        constants.append(onnx.numpy_helper.from_array(np.array(array, np.float32), f"c{len(constants)}"))
        return str(constants[-1].name)

    def then(operator: str, *arguments: str, **attributes: Any) -> None:
        nonlocal value
        result = f"x{len(nodes)}"
        nodes.append(onnx.helper.make_node(operator, [value, *arguments], [result], **attributes))
        value = result

    if network.mean is not None:
        then("Sub", constant(network.mean))
    if network.deviation is not None:
        then("Div", constant(network.deviation))
    if network.largest is not None:
        then("Clip", constant(-network.largest), constant(network.largest))
    for i, (weight, bias) in enumerate(zip(network.weights, network.biases, strict=True)):
        then("Gemm", constant(weight), constant(bias), transB=1)
        if i + 1 < len(network.weights):
            then(network.activation)
    if network.squash == "Clip":
        then("Clip", constant(-1.0), constant(1.0))
    elif network.squash is not None:
        then(network.squash)
    for operator, array in (
        ("Mul", network.scale),
        ("Add", network.offset),
        ("Max", network.low),
        ("Min", network.high),
    ):
        if array is not None:
            then(operator, constant(array))
    then("Identity")
    nodes[-1].output[0] = outputs

    def ends(name: str, width: int) -> Any:
        return onnx.helper.make_tensor_value_info(name, onnx.TensorProto.FLOAT, ["n", width])

    graph = onnx.helper.make_graph(
        nodes,
        name,
        [ends(inputs, network.weights[0].shape[1])],
        [ends(outputs, network.weights[-1].shape[0])],
        constants,
    )
    return finished_model(graph, facts)


def finished_model(graph: Any, facts: Mapping[str, Any]) -> Any:
    """The checked model of a graph, with metadata as JSON texts."""
    onnx = require("onnx", "onnx")
    model = onnx.helper.make_model(
        graph,
        opset_imports=[onnx.helper.make_opsetid("", OPSET)],
        ir_version=IR_VERSION,
        producer_name="rover-gym",
        producer_version=__version__,
    )
    texts = {key: fact if isinstance(fact, str) else json.dumps(fact) for key, fact in facts.items()}
    onnx.helper.set_model_props(model, texts)
    onnx.checker.check_model(model, full_check=True)
    return model
