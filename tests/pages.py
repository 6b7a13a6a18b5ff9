"""Reads a page of the player as its own script does: the scene, its arrays, and the frames."""

import base64
import json
import re
import zlib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

TYPES = {"f4": "<f4", "u4": "<u4", "u2": "<u2", "u1": "u1"}


@dataclass
class HeldPage:
    """What a page holds.

    Attributes:
        head: The header.
        arrays: The static arrays.
        pieces: The pieces of its frames, unpacked.
    """

    head: dict[str, Any]
    arrays: dict[str, np.ndarray]
    pieces: list[bytes]

    def values(self, name: str) -> np.ndarray:
        """(n, count, width) values of a channel."""
        channels = self.head["channels"]
        before = sum(one["count"] * one["width"] * one["bytes"] for one in channels[: self._number(name)])
        channel = channels[self._number(name)]
        count, width, planes = channel["count"], channel["width"], channel["bytes"]
        whole = sum(one["count"] * one["width"] * one["bytes"] for one in channels)
        levels = []
        for piece in self.pieces:
            rows = np.frombuffer(piece, np.uint8).reshape(-1, whole)[:, before : before + count * width * planes]
            parts = rows.reshape(len(rows), width, planes, count).astype(np.int64)
            steps = sum(parts[:, :, plane] << (8 * plane) for plane in range(planes))
            steps[1:] -= 128
            levels.append(np.cumsum(steps, axis=0) % (1 << (8 * planes)))
        found = np.concatenate(levels).transpose(0, 2, 1)
        return np.array(channel["low"]) + np.array(channel["step"]) * found

    def _number(self, name: str) -> int:
        return [channel["name"] for channel in self.head["channels"]].index(name)


def held(page: Path) -> HeldPage:
    """What a page holds."""
    text = page.read_text(encoding="utf-8")
    found = re.findall(r'<script type="application/octet-stream" id="([\w-]+)">(.*?)</script>', text, flags=re.DOTALL)
    parts = {name: zlib.decompress(base64.b64decode(data)) for name, data in found}
    message = parts.pop("scene")
    length = int.from_bytes(message[:4], "little")
    head = json.loads(message[4 : 4 + length])
    arrays = {
        name: np.frombuffer(message, TYPES[kind], count, 4 + length + first)
        for name, (kind, first, count) in head["arrays"].items()
    }
    return HeldPage(head, arrays, [parts[f"piece-{i}"] for i in range(len(parts))])
