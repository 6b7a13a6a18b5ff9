"""The network of `ArcNetworkPolicy` as an ONNX graph."""

from __future__ import annotations

from typing import Any

import numpy as np

from rover_gym.core.extras import require
from rover_gym.drive.arcs.arc_driver import N_ARCS, SIZES
from rover_gym.drive.arcs.arc_network import CONVOLUTIONS, DENSE, ArcNetwork
from rover_gym.drive.scan.scan_policy import SCAN
from rover_gym.exports.onnx_graph import finished_model

#: What the graph's inputs and output are, as metadata.
FACTS = {
    "kind": "arcs",
    "observation": "that of RoverArcs-v0, an input for each part",
    "logits": "one for each action of RoverArcs-v0; the largest is the policy's choice",
}


def arcs_model(network: ArcNetwork) -> Any:
    """The graph from `scan`, `features`, `command` and `clocks` to `logits`, for any number of rovers.

    Raises:
        MissingExtraError: onnx is not installed.
    """
    onnx = require("onnx", "onnx")
    helper, float32 = onnx.helper, onnx.TensorProto.FLOAT
    constants = [onnx.numpy_helper.from_array(values, name) for name, values in network.arrays.items()]
    constants.append(onnx.numpy_helper.from_array(np.array([1], np.int64), "axis"))
    nodes = [helper.make_node("Unsqueeze", ["scan", "axis"], ["x"])]
    value = "x"
    for i, (_, _, stride) in enumerate(CONVOLUTIONS):
        inputs = [value, f"conv_{i}", f"conv_bias_{i}"]
        nodes.append(helper.make_node("Conv", inputs, [f"y{i}"], strides=[stride, stride]))
        nodes.append(helper.make_node("Relu", [f"y{i}"], [f"x{i}"]))
        value = f"x{i}"
    nodes.append(helper.make_node("Flatten", [value], ["found"]))
    nodes.append(helper.make_node("Concat", ["found", *SIZES], ["z0"], axis=1))
    last = len(DENSE)
    for i in range(last + 1):
        result = "logits" if i == last else f"w{i}"
        nodes.append(helper.make_node("Gemm", [f"z{i}", f"dense_{i}", f"dense_bias_{i}"], [result], transB=1))
        if i < last:
            nodes.append(helper.make_node("Relu", [f"w{i}"], [f"z{i + 1}"]))
    rows, columns, _ = SCAN
    inputs = [helper.make_tensor_value_info("scan", float32, ["n", rows, columns])]
    inputs += [helper.make_tensor_value_info(name, float32, ["n", size]) for name, size in SIZES.items()]
    outputs = [helper.make_tensor_value_info("logits", float32, ["n", N_ARCS])]
    return finished_model(helper.make_graph(nodes, "arcs", inputs, outputs, constants), FACTS)
