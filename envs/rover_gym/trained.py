"""Trained policies: small networks that came from stable-baselines3 and run with NumPy alone.

A policy is a folder with

    policy.json   the environment's arguments it was trained for, its commands, what it came from
    policy.npz    float32 arrays: the features' mean and standard deviation, weights and biases

and, where it was trained by `training/train_ppo.py`, the run's config, curve and evaluation.
"""

import inspect
import io
import json
import math
import stat
import zipfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any, NoReturn

import numpy as np
import numpy.typing as npt

from rover_gym._core import OptionError, RoverGymError, StateError
from rover_gym.command import N_COMMANDS, CommandController, CommandLimits
from rover_gym.env import RoverEnv
from rover_gym.features import LARGEST_FEATURE, Features
from rover_gym.policy import rover_env
from rover_gym.validation import number, refuse

#: The policies that come with the package, by terrain.
SHIPPED: Mapping[str, str] = {"plane": "plane", "sphere_field": "rocks"}

FOLDER = Path(__file__).parent / "data" / "policies"

# A training file of another make is refused, not misread.
FORMAT = 1

#: Sizes beyond which a file is no policy of ours: bytes of the card and of all arrays, and layers.
LARGEST_CARD, LARGEST_NETWORK, MOST_LAYERS = 1 << 20, 1 << 26, 16
#: Weights and scales beyond which single precision has no room for sums, or for quotients.
LARGEST_WEIGHT, SMALLEST_DEVIATION = 1e6, 1e-6
#: Members of an archive that NumPy writes.
PACKINGS = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)
#: Arguments of the environment that are the caller's, and not the policy's.
NOT_A_POLICYS = ("model", "render_mode", "render_options")

Array = npt.NDArray[np.float32]


class PolicyError(OptionError):
    """A policy's folder holds no sound policy, or not one for this environment."""


def _refuse(path: Path, field: str, value: object, reason: str) -> NoReturn:
    """Refuses a file: names it, and in it the field that is not as it must be."""
    refuse(PolicyError, f"{path}: {field}", value, reason)


@dataclass(frozen=True)
class Network:
    """A multilayer perceptron with tanh between its layers.

    Attributes:
        mean: `(features,)` taken off the features.
        deviation: `(features,)` by which they are then divided, before they are cut at `LARGEST_FEATURE`.
        weights: Each `(outputs, inputs)`.
        biases: Each `(outputs,)`.
    """

    mean: Array
    deviation: Array
    weights: tuple[Array, ...]
    biases: tuple[Array, ...]

    def __call__(self, features: Array) -> Array:
        """The outputs `(n, outputs)` for features `(n, features)`, cut to [-1, 1] as stable-baselines3 does."""
        x = np.clip((features - self.mean) / self.deviation, -LARGEST_FEATURE, LARGEST_FEATURE)
        for weight, bias in zip(self.weights[:-1], self.biases[:-1], strict=True):
            x = np.tanh(x @ weight.T + bias)
        outputs: Array = x @ self.weights[-1].T + self.biases[-1]
        return outputs.clip(-1.0, 1.0)

    def save(self, path: Path) -> None:
        """Writes the arrays."""
        layers: dict[str, Any] = {f"weight_{i}": weight for i, weight in enumerate(self.weights)}
        layers |= {f"bias_{i}": bias for i, bias in enumerate(self.biases)}
        layers |= {"mean": self.mean, "deviation": self.deviation}
        rows: dict[str, Any] = {name: np.ascontiguousarray(array, dtype=np.float32) for name, array in layers.items()}
        np.savez_compressed(path, **rows)

    @classmethod
    def read(cls, path: Path) -> "Network":
        """Reads what `save` wrote.

        Raises:
            PolicyError: The file holds other arrays, of other shapes or types, or numbers that no network has.
            OSError: The file is not there or may not be read.
        """
        arrays = _read_arrays(path)
        n = sum(name.startswith("weight_") for name in arrays)
        expected = {"mean", "deviation", *(f"{kind}_{i}" for kind in ("weight", "bias") for i in range(n))}
        if n == 0 or arrays.keys() != expected:
            _refuse(path, "arrays", sorted(arrays), "must be mean, deviation, and weight_0, bias_0 and so on")
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
                _refuse(path, name, array.shape, f"must have the shape {shape}, none of it zero")
            if not (np.abs(array) <= LARGEST_WEIGHT).all():
                worst = float(array[~(np.abs(array) <= LARGEST_WEIGHT)].flat[0])
                _refuse(path, name, worst, f"must be finite and within {LARGEST_WEIGHT:g}")
        if not (arrays["deviation"] >= SMALLEST_DEVIATION).all():
            _refuse(path, "deviation", float(arrays["deviation"].min()), f"must be at least {SMALLEST_DEVIATION:g}")
        return cls(
            mean=arrays["mean"],
            deviation=arrays["deviation"],
            weights=tuple(arrays[f"weight_{i}"] for i in range(n)),
            biases=tuple(arrays[f"bias_{i}"] for i in range(n)),
        )


@dataclass(frozen=True)
class PolicyCard:
    """What a policy needs to run, and where it came from.

    Attributes:
        environment: Arguments of the environment that the policy's observation needs.
        pool: Cells of the height scan are so many points long and wide.
        hold: How long a command holds, s.
        command: What its commands stand for.
        guided: Whether its actions are offsets to the guide's command.
        source: What it came from, for the reader: seed, steps, versions, revision.
    """

    environment: Mapping[str, Any]
    pool: int
    hold: float
    command: CommandLimits
    guided: bool
    source: Mapping[str, Any]

    def save(self, path: Path) -> None:
        """Writes the card as JSON."""
        plain = {"format": FORMAT, **asdict(self)}
        path.write_text(json.dumps(plain, indent=2) + "\n", encoding="utf-8")

    @classmethod
    def read(cls, path: Path) -> "PolicyCard":
        """Reads what `save` wrote.

        Raises:
            PolicyError: The file has another format, or a field is missing, unknown or not as it must be.
            OSError: The file is not there or may not be read.
        """
        plain = _read_object(path)
        if plain.get("format") != FORMAT:
            refuse(PolicyError, "policy", str(path), f"must be a policy of format {FORMAT}")
        names = {"format", *(field.name for field in fields(cls))}
        if plain.keys() != names:
            _refuse(path, "fields", sorted(plain.keys() ^ names), "must be those of a policy's card; these differ")
        for name in ("environment", "command", "source"):
            if not isinstance(plain[name], dict):
                _refuse(path, name, plain[name], "must be an object")
        if not isinstance(plain["guided"], bool):
            _refuse(path, "guided", plain["guided"], "must be true or false")
        _check_arguments(path, plain["environment"])
        hold = number(f"{path}: hold", plain["hold"], above=0.0, at_most=60.0, error=PolicyError)
        pool = number(f"{path}: pool", plain["pool"], at_least=1.0, at_most=1000.0, error=PolicyError)
        try:
            command = CommandLimits(**plain["command"])
        except (RoverGymError, TypeError) as error:
            _refuse(path, "command", plain["command"], f"cannot be ({error})")
        if pool != round(pool):
            _refuse(path, "pool", plain["pool"], "must be a whole number")
        return cls(
            environment=plain["environment"],
            pool=round(pool),
            hold=hold,
            command=command,
            guided=plain["guided"],
            source=plain["source"],
        )


@contextmanager
def _sound(path: Path) -> Iterator[None]:
    """Turns whatever a damaged file makes a library raise into an error that names the file."""
    try:
        yield
    except (RoverGymError, OSError):
        raise
    except Exception as error:
        reason = f"is damaged ({type(error).__name__}: {' '.join(str(error).split())[:200]})"
        refuse(PolicyError, "policy", str(path), reason)


def _read_bytes(path: Path, at_most: int) -> bytes:
    status = path.stat()
    if not stat.S_ISREG(status.st_mode):  # to open a pipe would wait for its writer
        refuse(PolicyError, "policy", str(path), "must be a regular file")
    if status.st_size > at_most:
        _refuse(path, "size", status.st_size, f"must be at most {at_most} bytes")
    return path.read_bytes()


def _read_object(path: Path) -> dict[str, Any]:
    text = _read_bytes(path, LARGEST_CARD)
    with _sound(path):
        plain = json.loads(text)
        json.dumps(plain, ensure_ascii=False).encode()  # half a pair of surrogates is no text
    if not isinstance(plain, dict):
        refuse(PolicyError, "policy", str(path), f"must be a policy of format {FORMAT}")
    return plain


def _read_arrays(path: Path) -> dict[str, Array]:
    """The float32 arrays of an archive; their sizes are known before they are unpacked."""
    data = _read_bytes(path, LARGEST_NETWORK)
    arrays: dict[str, Array] = {}
    with _sound(path), zipfile.ZipFile(io.BytesIO(data)) as archive:
        members = archive.infolist()
        if len(members) > 2 + 2 * MOST_LAYERS:
            _refuse(path, "arrays", len(members), f"must be at most {2 + 2 * MOST_LAYERS}")
        if sum(member.file_size for member in members) > LARGEST_NETWORK:
            _refuse(
                path, "arrays", sum(member.file_size for member in members), f"must be {LARGEST_NETWORK} bytes at most"
            )
        for member in members:
            name = member.filename.removesuffix(".npy")
            if name in arrays or name == member.filename or member.compress_type not in PACKINGS:
                _refuse(path, "arrays", member.filename, "must be arrays of their own names, as NumPy packs them")
            arrays[name] = _read_array(path, name, archive.read(member))
    return arrays


def _read_array(path: Path, name: str, data: bytes) -> Array:
    stream = io.BytesIO(data)
    version = np.lib.format.read_magic(stream)
    if version != (1, 0):
        _refuse(path, name, version, "must be an array of NumPy's format (1, 0)")
    shape, fortran, kind = np.lib.format.read_array_header_1_0(stream)
    if kind != np.float32 or fortran or len(shape) not in (1, 2):
        _refuse(path, name, f"{kind} {shape}", "must be float32, of one or two dimensions, row by row")
    body = data[stream.tell() :]
    if any(n < 0 for n in shape) or len(body) != 4 * math.prod(shape):
        _refuse(path, name, shape, f"must have the shape of its {len(body)} bytes")
    return np.frombuffer(body, dtype=kind).astype(np.float32).reshape(shape)


def _check_arguments(path: Path, arguments: Mapping[str, Any]) -> None:
    """Refuses arguments that no environment has; the environment itself checks their values."""
    known = [name for name in inspect.signature(RoverEnv).parameters if name not in NOT_A_POLICYS]
    for name in arguments:
        if name not in known:
            _refuse(path, f"environment.{name}", arguments[name], f"unknown; known are {', '.join(known)}")


def policy_folder(terrain: str) -> Path:
    """The folder of the policy that comes with the package for a terrain.

    Raises:
        PolicyError: There is none.
    """
    if terrain not in SHIPPED:
        refuse(PolicyError, "policy", terrain, f"none was trained; there are some for {', '.join(SHIPPED)}")
    return FOLDER / SHIPPED[terrain]


def find_policy(policy: str, terrain: str) -> Path | None:
    """The folder of "trained", the package's own for a terrain, or of a path; None for "pd", the baseline.

    Raises:
        PolicyError: There is no policy.
    """
    if policy == "pd":
        return None
    folder = policy_folder(terrain) if policy == "trained" else Path(policy)
    if not _is_there(folder / "policy.json"):
        refuse(PolicyError, "policy", policy, "must be 'pd', 'trained' or the folder of a trained policy")
    return folder


def _is_there(path: Path) -> bool:
    try:
        return path.exists()
    except (OSError, ValueError):  # a name that is too long, or that no file can have
        return False


def policy_arguments(folder: Path) -> dict[str, Any]:
    """The arguments with which a policy's environment must be made.

    Raises:
        PolicyError: The folder holds no sound policy.
        OSError: The file may not be read.
    """
    arguments = dict(PolicyCard.read(folder / "policy.json").environment)
    if isinstance(arguments.get("height_scan"), list):
        arguments["height_scan"] = tuple(arguments["height_scan"])
    return arguments


class TrainedPolicy:
    """Drives `Rover-v0` by a trained network, with stable-baselines3's `predict`.

    Args:
        env: A `Rover-v0` made with the policy's arguments, wrapped or not, or a vector of them. It is read once.
        network: From features to commands.
        card: What the commands stand for.
    """

    def __init__(self, env: Any, network: Network, card: PolicyCard) -> None:
        rover: RoverEnv = rover_env(env)
        self.card = card
        self._size = rover.observation_layout.size
        self._features = Features(rover, card.pool)
        self._controller = CommandController(rover, card.command, guided=card.guided)
        self._network = network
        self._repeat = max(1, round(card.hold / rover.dt))
        inputs, outputs = network.weights[0].shape[1], network.weights[-1].shape[0]
        if inputs != self._features.size:
            reason = f"needs an environment made with {dict(card.environment)}: {inputs} features"
            refuse(PolicyError, "policy", self._features.size, reason)
        if outputs != N_COMMANDS:
            refuse(PolicyError, "policy", outputs, f"must have {N_COMMANDS} outputs")

    @classmethod
    def load(cls, env: Any, folder: str | Path) -> "TrainedPolicy":
        """The policy of a folder.

        Raises:
            PolicyError: The folder holds no sound policy, or the environment was not made with its arguments.
            OSError: A file may not be read.
        """
        path = Path(folder)
        for name in ("policy.npz", "policy.json"):
            if not _is_there(path / name):
                refuse(PolicyError, "policy", str(path / name), "is not there")
        return cls(env, Network.read(path / "policy.npz"), PolicyCard.read(path / "policy.json"))

    @classmethod
    def untrained(cls, env: Any, card: PolicyCard) -> "TrainedPolicy":
        """A policy whose actions are zero: the guide alone, or, without one, a rover that stands."""
        features = Features(rover_env(env), card.pool).size
        zero = Network(
            mean=np.zeros(features, np.float32),
            deviation=np.ones(features, np.float32),
            weights=(np.zeros((N_COMMANDS, features), np.float32),),
            biases=(np.zeros(N_COMMANDS, np.float32),),
        )
        return cls(env, zero, card)

    def predict(
        self,
        observation: npt.NDArray[np.float32],
        state: tuple[npt.NDArray[Any], ...] | None = None,
        episode_start: npt.NDArray[np.bool_] | None = None,
        deterministic: bool = True,  # noqa: ARG002 - the signature is stable-baselines3's
    ) -> tuple[npt.NDArray[np.float32], tuple[npt.NDArray[Any], ...] | None]:
        """The action for an observation `(size,)`, or the actions `(n, 12)` for a batch `(n, size)`.

        A command holds for `card.hold` seconds, which the returned state counts: hand it in again with the next
        observation, and say with `episode_start` `(n,)` where an episode begins. Without a state the command is new.

        Raises:
            StateError: The observation has a wrong shape or an entry that is not finite.
        """
        given = np.asarray(observation)
        if given.ndim not in (1, 2) or given.shape[-1] != self._size:
            refuse(StateError, "observation", given.shape, f"must be (..., {self._size})")
        if not np.isfinite(given).all():
            refuse(StateError, "observation", observation, "must be finite")
        rows = np.atleast_2d(given)
        if state is None:
            commands, age = np.zeros((len(rows), N_COMMANDS), np.float32), np.zeros(len(rows), np.int64)
        else:
            commands, age = state[0].copy(), state[1].copy()
        if episode_start is not None:
            age[np.broadcast_to(episode_start, age.shape)] = 0
        new = age % self._repeat == 0
        if new.any():
            commands[new] = self._network(self._features(rows[new]))
        actions = self._controller.act(rows, commands)
        return (actions[0] if given.ndim == 1 else actions), (commands, age + 1)
