"""The files of networks, read with care, and those that the package ships."""

import io
import math
import stat
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NoReturn

import numpy as np
import numpy.typing as npt

from rover_gym.core import OptionError, RoverGymError
from rover_gym.core.files import written_whole
from rover_gym.core.validation import refuse
from rover_gym.drive.commands.features import LARGEST_FEATURE


class PolicyError(OptionError):
    """There is no such policy, its files are damaged, or it is for another rover."""


def refuse_field(path: Path, field: str, value: object, reason: str) -> NoReturn:
    """Refuses a file with an error that names the file and the invalid field."""
    refuse(PolicyError, f"{path}: {field}", value, reason)


@contextmanager
def intact(path: Path) -> Iterator[None]:
    """Turns any exception that a damaged file causes into a `PolicyError` that names the file."""
    try:
        yield
    except (RoverGymError, OSError):
        raise
    except Exception as error:
        reason = f"is damaged ({type(error).__name__}: {' '.join(str(error).split())[:200]})"
        refuse(PolicyError, "policy", str(path), reason)


def read_bytes(path: Path, at_most: int) -> bytes:
    """Reads a whole file.

    Raises:
        PolicyError: The file is not a regular file, or larger than `at_most` bytes.
        OSError: The file does not exist or may not be read.
    """
    status = path.stat()
    if not stat.S_ISREG(status.st_mode):  # opening a pipe would wait for its writer
        refuse(PolicyError, "policy", str(path), "must be a regular file")
    if status.st_size > at_most:
        refuse_field(path, "size", status.st_size, f"must be at most {at_most} bytes")
    return path.read_bytes()


def is_there(path: Path) -> bool:
    """Whether the path exists; False for an impossible path."""
    try:
        return path.exists()
    except (OSError, ValueError):  # a name that is too long or impossible
        return False


#: Limits of a network's file: bytes of all arrays, and layers.
LARGEST_NETWORK, MOST_LAYERS = 1 << 26, 16

#: Limits within which sums and quotients stay finite in single precision.
LARGEST_WEIGHT, SMALLEST_DEVIATION = 1e6, 1e-6

#: Compression types that NumPy writes.
PACKINGS = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)

Array = npt.NDArray[np.float32]


@dataclass(frozen=True)
class Network:
    """A multilayer perceptron with rectifiers between its layers.

    Attributes:
        mean: `(features,)` mean of the features, which is subtracted.
        deviation: `(features,)` divisor of the result, which is then clipped at `LARGEST_FEATURE`.
        weights: Weight matrices, each `(outputs, inputs)`.
        biases: Bias vectors, each `(outputs,)`.
    """

    mean: Array
    deviation: Array
    weights: tuple[Array, ...]
    biases: tuple[Array, ...]

    def __call__(self, features: Array) -> Array:
        """The outputs `(n, outputs)` for features `(n, features)`, clipped to [-1, 1]."""
        x = np.clip((features - self.mean) / self.deviation, -LARGEST_FEATURE, LARGEST_FEATURE)
        for weight, bias in zip(self.weights[:-1], self.biases[:-1], strict=True):
            x = np.maximum(x @ weight.T + bias, np.float32(0.0))
        outputs: Array = x @ self.weights[-1].T + self.biases[-1]
        return outputs.clip(-1.0, 1.0)

    def save(self, path: Path) -> None:
        """Writes the arrays as a compressed `.npz` file."""
        layers: dict[str, Any] = {f"weight_{i}": weight for i, weight in enumerate(self.weights)}
        layers |= {f"bias_{i}": bias for i, bias in enumerate(self.biases)}
        layers |= {"mean": self.mean, "deviation": self.deviation}
        rows: dict[str, Any] = {name: np.ascontiguousarray(array, dtype=np.float32) for name, array in layers.items()}
        with written_whole(path) as draft, draft.open("wb") as file:
            np.savez_compressed(file, **rows)

    @classmethod
    def read(cls, path: Path) -> "Network":
        """Reads what `save` wrote.

        Raises:
            PolicyError: The file holds arrays of other names, shapes or types, or numbers out of range.
            OSError: The file does not exist or may not be read.
        """
        arrays = read_arrays(path)
        n = sum(name.startswith("weight_") for name in arrays)
        expected = {"mean", "deviation", *(f"{kind}_{i}" for kind in ("weight", "bias") for i in range(n))}
        if n == 0 or arrays.keys() != expected:
            refuse_field(path, "arrays", sorted(arrays), "must be mean, deviation, and weight_0, bias_0 and so on")
        features = arrays["mean"].size
        shapes: dict[str, tuple[int, ...]] = {"mean": (features,), "deviation": (features,)}
        size = features
        for i in range(n):
            outputs = arrays[f"weight_{i}"].shape[0] if arrays[f"weight_{i}"].ndim else 0
            shapes |= {f"weight_{i}": (outputs, size), f"bias_{i}": (outputs,)}
            size = outputs
        for name, shape in shapes.items():
            array = arrays[name]
            if array.shape != shape or 0 in shape:
                refuse_field(path, name, array.shape, f"must have the shape {shape}, none of it zero")
            if not (np.abs(array) <= LARGEST_WEIGHT).all():
                worst = float(array[~(np.abs(array) <= LARGEST_WEIGHT)].flat[0])
                refuse_field(path, name, worst, f"must be finite and within {LARGEST_WEIGHT:g}")
        if not (arrays["deviation"] >= SMALLEST_DEVIATION).all():
            refuse_field(
                path, "deviation", float(arrays["deviation"].min()), f"must be at least {SMALLEST_DEVIATION:g}"
            )
        return cls(
            mean=arrays["mean"],
            deviation=arrays["deviation"],
            weights=tuple(arrays[f"weight_{i}"] for i in range(n)),
            biases=tuple(arrays[f"bias_{i}"] for i in range(n)),
        )


def read_arrays(path: Path, kind: type[np.floating[Any]] = np.float32) -> dict[str, Array]:
    """Reads an archive's arrays of a kind as float32. Their sizes are checked before decompression.

    Raises:
        PolicyError: The file is no such archive, or too large.
        OSError: The file does not exist or may not be read.
    """
    data = read_bytes(path, LARGEST_NETWORK)
    arrays: dict[str, Array] = {}
    with intact(path), zipfile.ZipFile(io.BytesIO(data)) as archive:
        members = archive.infolist()
        if len(members) > 2 + 2 * MOST_LAYERS:
            refuse_field(path, "arrays", len(members), f"must be at most {2 + 2 * MOST_LAYERS}")
        if sum(member.file_size for member in members) > LARGEST_NETWORK:
            refuse_field(
                path, "arrays", sum(member.file_size for member in members), f"must be {LARGEST_NETWORK} bytes at most"
            )
        for member in members:
            name = member.filename.removesuffix(".npy")
            if name in arrays or name == member.filename or member.compress_type not in PACKINGS:
                refuse_field(path, "arrays", member.filename, "must be arrays of their own names, as NumPy packs them")
            arrays[name] = _read_array(path, name, archive.read(member), np.dtype(kind))
    return arrays


def _read_array(path: Path, name: str, data: bytes, expected: np.dtype[Any]) -> Array:
    stream = io.BytesIO(data)
    version = np.lib.format.read_magic(stream)
    if version != (1, 0):
        refuse_field(path, name, version, "must be an array of NumPy's format (1, 0)")
    shape, fortran, kind = np.lib.format.read_array_header_1_0(stream)
    if kind != expected or fortran or not 1 <= len(shape) <= 4:
        refuse_field(path, name, f"{kind} {shape}", f"must be {expected}, of one to four dimensions, row by row")
    body = data[stream.tell() :]
    if any(n < 0 for n in shape) or len(body) != expected.itemsize * math.prod(shape):
        refuse_field(path, name, shape, f"must have the shape of its {len(body)} bytes")
    return np.frombuffer(body, dtype=kind).astype(np.float32).reshape(shape)


#: The shipped forecast: the name of its folder.
FORECAST = "foresight"

#: The shipped network for any rover: its name, and its folder's.
ANYWHERE = "anywhere"

FOLDER = Path(__file__).parents[2] / "data" / "policies"
