"""Draws the pictures of the tutorials anew, by running them: `PYTHONPATH=tests python docs/pictures/make_tutorials.py`.

Names of tutorials, such as `ball-wheel-rover`, draw only theirs.
"""

import os
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

import matplotlib as mpl
from PIL import Image
from tutorials.pages import TUTORIALS, run

HERE = Path(__file__).parent
WIDTH = 900  # pixels, at most

#: Tutorial: what it leaves, and the picture's name.
PICTURES = {
    "ball-wheel-rover": ("plane.png", "tutorial-plane.png"),
    "a-contact-problem": ("block.png", "tutorial-contact.png"),
    "a-rover-over-a-map": ("runs/crater/plots/path.png", "tutorial-map.png"),
    "train-a-policy": ("watch.png", "tutorial-train.png"),
}


def main(names: list[str]) -> None:
    """Runs tutorials in an empty folder each."""
    mpl.use("Agg")
    for name in names or PICTURES:
        left, picture = PICTURES[name]
        with TemporaryDirectory() as folder:
            os.chdir(folder)
            run(TUTORIALS / f"{name}.md")
            shrink(Path(left), HERE / picture)
            os.chdir(HERE)


def shrink(source: Path, picture: Path) -> None:
    """At most `WIDTH` wide, with 256 colours, by octree: median cut would lose those of the thin lines."""
    with Image.open(source) as image:
        small = image.convert("RGB")
    if small.width > WIDTH:
        small = small.resize((WIDTH, small.height * WIDTH // small.width), Image.Resampling.LANCZOS)
    quantized = small.quantize(256, method=Image.Quantize.FASTOCTREE, dither=Image.Dither.NONE)
    quantized.save(picture, optimize=True)


if __name__ == "__main__":
    main(sys.argv[1:])
