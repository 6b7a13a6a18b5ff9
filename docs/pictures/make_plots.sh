#!/usr/bin/env bash
# Makes the pictures of docs/plots.md, 900 pixels wide. Run from the root, with the rover and python of the environment
# first in PATH.
set -euo pipefail
runs=$(mktemp -d)
trap 'rm -rf "$runs"' EXIT
rover drive --terrain sphere_field --difficulty 0.75 --seed 3 --output "$runs" > /dev/null
rover plot "$runs/episode-3.h5" --output "$runs" > /dev/null
python - "$runs" << 'PYTHON'
"""Shrinks the figures and keeps 256 colours of each, by octree: median cut would lose the thin lines' colours."""
import sys
from pathlib import Path

from PIL import Image

for name in ("path", "wheel-loads", "energy"):
    figure = Image.open(Path(sys.argv[1]) / f"{name}.png").convert("RGB")
    small = figure.resize((900, round(figure.height * 900 / figure.width)), Image.Resampling.LANCZOS)
    small.quantize(256, method=Image.Quantize.FASTOCTREE, dither=Image.Dither.NONE).save(Path("docs/pictures") / f"plot-{name}.png", optimize=True)
PYTHON
