"""The network of `ArcNetworkPolicy`, which needs NumPy alone: convolutions over the scan, then dense layers."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from rover_gym.core.files import written_whole
from rover_gym.core.validation import refuse
from rover_gym.drive.arcs.arc_driver import N_ARCS, SIZES, ArcObservation
from rover_gym.drive.forecast.network_files import LARGEST_WEIGHT, PolicyError, read_arrays
from rover_gym.drive.scan.scan_policy import SCAN

Single = npt.NDArray[np.float32]

#: Outputs, width of the kernel and stride of each convolution, and outputs of the dense layers before the arcs.
CONVOLUTIONS = ((24, 4, 2), (48, 3, 2), (48, 3, 2))
DENSE = (256, 128)


def shapes() -> dict[str, tuple[int, ...]]:
    """The arrays of the network by name: weights as PyTorch has them, and biases."""
    found: dict[str, tuple[int, ...]] = {}
    (rows, columns, _), channels = SCAN, 1
    for i, (outputs, kernel, stride) in enumerate(CONVOLUTIONS):
        found[f"conv_{i}"], found[f"conv_bias_{i}"] = (outputs, channels, kernel, kernel), (outputs,)
        rows, columns, channels = (rows - kernel) // stride + 1, (columns - kernel) // stride + 1, outputs
    inputs = rows * columns * channels + sum(SIZES.values())
    for i, outputs in enumerate((*DENSE, N_ARCS)):
        found[f"dense_{i}"], found[f"dense_bias_{i}"] = (outputs, inputs), (outputs,)
        inputs = outputs
    return found


@dataclass(frozen=True)
class ArcNetwork:
    """A network from observations of `RoverArcs-v0` to the logits of the arcs.

    Attributes:
        arrays: Those that `shapes` names.
    """

    arrays: Mapping[str, Single]

    def __call__(self, observation: ArcObservation) -> Single:
        """`(n, 64)` logits for observations of n rovers."""
        arrays = self.arrays
        x: Single = observation["scan"][:, None]
        n = len(x)
        for i, (outputs, kernel, stride) in enumerate(CONVOLUTIONS):
            windows = np.lib.stride_tricks.sliding_window_view(x, (kernel, kernel), (2, 3))[:, :, ::stride, ::stride]
            rows, columns = windows.shape[2:4]
            patches = windows.transpose(0, 2, 3, 1, 4, 5).reshape(n * rows * columns, -1)
            y: Single = patches @ arrays[f"conv_{i}"].reshape(outputs, -1).T + arrays[f"conv_bias_{i}"]
            x = np.maximum(y, np.float32(0.0)).reshape(n, rows, columns, outputs).transpose(0, 3, 1, 2)
        y = np.concatenate((x.reshape(n, -1), *(observation[name] for name in SIZES)), axis=1)
        for i in range(len(DENSE)):
            y = np.maximum(y @ arrays[f"dense_{i}"].T + arrays[f"dense_bias_{i}"], np.float32(0.0))
        last = len(DENSE)
        return y @ arrays[f"dense_{last}"].T + arrays[f"dense_bias_{last}"]

    def save(self, path: Path) -> None:
        """Writes the arrays in half precision as a compressed `.npz` file."""
        rows: dict[str, Any] = {name: value.astype(np.float16) for name, value in self.arrays.items()}
        with written_whole(path) as draft, draft.open("wb") as file:
            np.savez_compressed(file, **rows)

    @classmethod
    def read(cls, path: Path) -> "ArcNetwork":
        """Reads what `save` wrote.

        Raises:
            PolicyError: The file holds arrays of other names, shapes or types, or numbers out of range.
            OSError: The file does not exist or may not be read.
        """
        found, expected = read_arrays(path, np.float16), shapes()
        if found.keys() != expected.keys():
            refuse(PolicyError, f"{path}: arrays", sorted(found), f"must be {', '.join(expected)}")
        for name, shape in expected.items():
            if found[name].shape != shape:
                refuse(PolicyError, f"{path}: {name}", found[name].shape, f"must have the shape {shape}")
            if not (np.abs(found[name]) <= LARGEST_WEIGHT).all():
                refuse(PolicyError, f"{path}: {name}", "numbers", f"must be finite and at most {LARGEST_WEIGHT:g}")
        return cls({name: value.astype(np.float32) for name, value in found.items()})
