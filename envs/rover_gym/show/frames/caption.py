"""Lines of text in the corner of a film's frames."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

from rover_gym.core.extras import require

Frame: TypeAlias = npt.NDArray[np.uint8]

LETTERS = 0.045  # of the letters, in heights of the frame

SMALLEST_LETTERS = 11  # pixels


def captioned(frame: Frame, lines: Sequence[str]) -> Frame:
    """A copy of a frame `(height, width, 3)` with lines of text in its upper left corner.

    Raises:
        MissingExtraError: Pillow is not installed.
    """
    image = require("PIL.Image", "render").fromarray(frame)
    draw = require("PIL.ImageDraw", "render").Draw(image)
    size = max(SMALLEST_LETTERS, round(LETTERS * frame.shape[0]))
    for i, line in enumerate(lines):
        place = (0.5 * size, (0.4 + 1.25 * i) * size)
        draw.text(place, line, font=_font(size), fill=(255, 255, 255), stroke_width=max(1, size // 16), stroke_fill=0)
    return np.asarray(image, dtype=np.uint8)


@lru_cache(maxsize=4)
def _font(size: int) -> Any:
    return require("PIL.ImageFont", "render").load_default(size)
