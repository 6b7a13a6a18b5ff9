"""Reads films as ffmpeg decodes them."""

import re
import subprocess
from pathlib import Path

import imageio_ffmpeg
import numpy as np
import numpy.typing as npt


def film_of(path: Path) -> tuple[float, npt.NDArray[np.uint8]]:
    """Frames per second of a film, and its frames, (n, height, width, 3)."""
    command = [imageio_ffmpeg.get_ffmpeg_exe(), "-i", str(path), "-f", "rawvideo", "-pix_fmt", "rgb24", "-"]
    done = subprocess.run(command, capture_output=True, check=True)
    said = re.search(rb"Video: h264.*?, (\d+)x(\d+).*?, ([\d.]+) fps", done.stderr)
    assert said is not None, done.stderr
    width, height = int(said[1]), int(said[2])
    return float(said[3]), np.frombuffer(done.stdout, np.uint8).reshape(-1, height, width, 3)
