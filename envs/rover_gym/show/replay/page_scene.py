"""The scene format of the player: what stands still, once, and frames of what moves. Recorded and live pages read it.

A scene is a header, JSON, with static arrays. A frame is a row of whole numbers by channel, "levels": a value is
`low + step * level`. In a file, frames lie in pieces of `SAMPLES`, each of them the differences to the one before;
a live drive sends whole frames.
"""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import numpy.typing as npt

from rover_gym.show.frames.appearance import (
    FORCE_COLOUR,
    GROUND_COLOUR,
    GROUND_COLOUR_2,
    ROCK_COLOUR,
    SKY_BANDS,
    SKY_COLOUR,
    SKY_COLOUR_2,
    Colour,
)

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

Array = npt.NDArray[np.float64]
Levels = npt.NDArray[np.unsignedinteger[Any]]
Mesh = tuple[Colour, Array, npt.NDArray[np.int32]]

SAMPLES = 25  # of a piece: each begins with a whole frame
FINE = 2.0**-14  # m or a part of a turn, step of places and quaternions: 0.06 mm
COARSE = 2.0**-8  # m, step of what is many and need not be finer: 4 mm
TYPES = {"f4": "<f4", "u4": "<u4", "u2": "<u2", "u1": "u1"}


class FrameChannel(NamedTuple):
    """What moves: values (n, count, width), and how levels give them.

    `low` and `step` are of each of the `width` components; a level has 2 or 4 bytes.
    """

    name: str
    values: npt.NDArray[np.floating[Any]]
    low: Array
    step: Array
    bytes: int

    @classmethod
    def fine(cls, name: str, values: Array) -> FrameChannel:
        """Places, m, or what else lies within 100 km of zero."""
        width = values.shape[-1]
        return cls(name, values, np.full(width, -(2.0**31) * FINE), np.full(width, FINE), 4)

    @classmethod
    def coarse(cls, name: str, values: Array) -> FrameChannel:
        """Places as those of `fine`, to 4 mm."""
        width = values.shape[-1]
        return cls(name, values, np.full(width, -(2.0**31) * COARSE), np.full(width, COARSE), 4)

    @classmethod
    def turns(cls, name: str, values: Array) -> FrameChannel:
        """Components of unit quaternions."""
        width = values.shape[-1]
        return cls(name, values, np.full(width, -2.0), np.full(width, FINE), 2)

    @classmethod
    def within(cls, name: str, values: npt.NDArray[np.floating[Any]], low: Array, high: Array) -> FrameChannel:
        """Values between bounds, beyond which they stop."""
        return cls(name, values, low, np.maximum(high - low, 1e-6) / 65535.0, 2)

    def levels(self, rows: slice) -> Levels:
        """Levels (n, count, width) of some frames."""
        most = 2.0 ** (8 * self.bytes) - 1.0
        scaled = np.round((np.nan_to_num(self.values[rows]) - self.low) / self.step)
        result: Levels = np.clip(scaled, 0.0, most).astype("<u2" if self.bytes == 2 else "<u4")
        return result

    def header(self) -> dict[str, Any]:
        """How a page reads the levels."""
        _, count, width = self.values.shape
        sizes = {"count": count, "width": width, "bytes": self.bytes}
        return {"name": self.name, **sizes, "low": self.low.tolist(), "step": self.step.tolist()}

    def differences(self, rows: slice) -> npt.NDArray[np.uint8]:
        """Bytes (n, size): the first frame whole, then differences, by component, low bytes of all items first.

        A small step back has high bytes of 255; shifted by half a byte, small steps of both signs have 0.
        """
        levels = self.levels(rows)
        steps = np.diff(levels, axis=0, prepend=np.zeros_like(levels[:1])).transpose(0, 2, 1)
        steps[1:] += steps.dtype.type(128)
        planes = [(steps >> steps.dtype.type(8 * plane)) & steps.dtype.type(255) for plane in range(self.bytes)]
        return np.stack(planes, axis=2).astype(np.uint8).reshape(len(steps), -1)


@dataclass
class PageScene:
    """A scene of the player.

    Attributes:
        kind: "rover", "grains", "planar" or "disks".
        view: Where the eye stands and looks at the start, m, and the vertical field of view, rad.
        reach: Size of what is looked at, m: a camera and the shadow fit it.
        frames: Number of moving frames, the places and turns of the channels `places` and `turns`.
        facts: Further entries of the header.
        groups: Coloured surfaces, each on a moving frame or, with -1, on the world. "solid" ones cast a shadow, and
            "soil" shows the ground's tiles on its level faces.
        channels: What moves.
        arrays: Static arrays by name, each with its type.
    """

    kind: str
    view: dict[str, Any]
    reach: float
    frames: int = 0
    facts: dict[str, Any] = field(default_factory=dict)
    groups: list[tuple[int, Mesh, str]] = field(default_factory=list)
    channels: list[FrameChannel] = field(default_factory=list)
    arrays: dict[str, tuple[str, npt.ArrayLike]] = field(default_factory=dict)

    def put_mesh(self, meshes: Iterable[Mesh], frame: int = -1, role: str = "") -> None:
        """Adds surfaces to a moving frame, or to the world; `groups` says what roles there are."""
        self.groups += [(frame, mesh, role) for mesh in meshes if len(mesh[2])]

    def put_map(self, x: Array, z: Array, heights: Array) -> None:
        """Adds a height map: columns x, rows z, m, and heights (n_z, n_x), nan where they are unknown."""
        known = heights[np.isfinite(heights)]
        low, high = (float(known.min()), float(known.max())) if known.size else (0.0, 0.0)
        step = max(high - low, 1e-6) / 65534.0
        levels = np.where(np.isfinite(heights), np.round((np.nan_to_num(heights) - low) / step), 65535.0)
        k = len(self.facts.setdefault("maps", []))
        names = {name: f"map-{k}-{name}" for name in ("x", "z", "heights")}
        self.facts["maps"].append({**names, "low": low, "step": step})
        for name, kind, values in (("x", "f4", x), ("z", "f4", z), ("heights", "u2", levels.ravel())):
            self.arrays[names[name]] = (kind, values)

    def message(self) -> bytes:
        """Header and arrays: length of the header, header, arrays."""
        arrays = {**self.arrays, **_packed(self.groups)}
        contents = {name: np.ascontiguousarray(values, dtype=TYPES[kind]) for name, (kind, values) in arrays.items()}
        places, at = {}, 0
        for name, content in contents.items():
            places[name] = [arrays[name][0], at, content.size]
            at += -(-content.nbytes // 4) * 4
        head = json.dumps(self._header(places), separators=(",", ":"), allow_nan=False).encode()
        head += b" " * (-len(head) % 4)
        parts = [content.tobytes() + bytes(-content.nbytes % 4) for content in contents.values()]
        return len(head).to_bytes(4, "little") + head + b"".join(parts)

    def _header(self, arrays: dict[str, Any]) -> dict[str, Any]:
        ends = np.cumsum([0, *(mesh[2].size for _, mesh, _ in self.groups)]).tolist()
        groups = [
            {"frame": frame, "first": ends[i], "count": ends[i + 1] - ends[i], "role": role}
            for i, (frame, _, role) in enumerate(self.groups)
        ]
        usual = {
            "rover": False,
            "flat": False,
            "shadow": False,
            "maps": [],
            "wheels": [],
            "events": [],
            "haze": 0.0,
            "far": 500.0,
            "tile": 0.5,
            "sky": [SKY_COLOUR_2, SKY_COLOUR],
            "bands": SKY_BANDS,
            "soil": [GROUND_COLOUR, GROUND_COLOUR_2],
            "rock": ROCK_COLOUR,
            "force": FORCE_COLOUR,
        }
        return {
            **usual,
            **self.facts,
            "kind": self.kind,
            "view": self.view,
            "reach": self.reach,
            "frames": self.frames,
            "groups": groups,
            "channels": [channel.header() for channel in self.channels],
            "arrays": arrays,
        }

    def pieces(self, n: int) -> Iterator[bytes]:
        """The frames of a run of n samples, in pieces."""
        for first in range(0, n, SAMPLES):
            rows = slice(first, min(first + SAMPLES, n))
            yield np.concatenate([channel.differences(rows) for channel in self.channels], axis=1).tobytes()

    def whole(self) -> bytes:
        """The first frame, whole."""
        return b"".join(channel.differences(slice(0, 1)).tobytes() for channel in self.channels)


def _packed(groups: list[tuple[int, Mesh, str]]) -> dict[str, tuple[str, npt.ArrayLike]]:
    """Vertices, their colours, and triangles of all surfaces."""
    vertices, colours, triangles, n = [np.zeros((0, 3))], [np.zeros((0, 4))], [np.zeros((0, 3), dtype=np.int64)], 0
    for _, (colour, points, corners), _ in groups:
        used, faces = np.unique(corners, return_inverse=True)
        vertices.append(points[used])
        colours.append(np.tile(np.round(255.0 * np.array([*colour, 1.0])), (len(used), 1)))
        triangles.append(faces.reshape(-1, 3) + n)
        n += len(used)
    return {
        "vertices": ("f4", np.concatenate(vertices).ravel()),
        "colours": ("u1", np.concatenate(colours).ravel()),
        "triangles": ("u4", np.concatenate(triangles).ravel()),
    }
