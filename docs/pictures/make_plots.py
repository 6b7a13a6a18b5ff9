"""Draws the pictures of docs/watching.md anew: `.venv/bin/python docs/pictures/make_plots.py`."""

from pathlib import Path
from tempfile import TemporaryDirectory

from PIL import Image
from typer.testing import CliRunner

from rover_gym.cli import app
from rover_gym.record import read_run
from rover_gym.show.figures import draw_run

HERE = Path(__file__).parent
WIDTH = 900  # pixels
DRIVE = ("drive", "--terrain", "rocks", "--difficulty", "0.75", "--seed", "3", "--output")


def main() -> None:
    """Drives, draws, and keeps three figures."""
    with TemporaryDirectory() as folder:
        CliRunner().invoke(app, [*DRIVE, folder], catch_exceptions=False)
        figures = {path.stem: path for path in draw_run(read_run(Path(folder) / "episode-3.h5"), folder)}
        for name in ("path", "wheel-loads", "energy"):
            shrink(figures[name], HERE / f"plot-{name}.png")


def shrink(figure: Path, picture: Path) -> None:
    """Halves the size and keeps 256 colours, by octree: median cut would lose those of the thin lines."""
    with Image.open(figure) as image:
        small = image.convert("RGB").resize((WIDTH, image.height * WIDTH // image.width), Image.Resampling.LANCZOS)
    method = Image.Quantize.FASTOCTREE
    small.quantize(256, method=method, dither=Image.Dither.NONE).save(picture, optimize=True)


if __name__ == "__main__":
    main()
