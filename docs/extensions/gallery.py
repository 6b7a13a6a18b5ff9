"""The gallery: a frame of every registered environment, and one page of the player, made while the manual is built."""

import hashlib
import tempfile
from pathlib import Path

import gymnasium as gym
import numpy as np
from PIL import Image
from typer.testing import CliRunner

import rover_gym
from rover_gym.cli import app
from rover_gym.record import read_run
from rover_gym.registration import ENVIRONMENTS
from rover_gym.replay import write_page

#: Width and height of a frame, pixels, and its quality as WebP.
SIZE, QUALITY = (560, 350), 74
SECONDS = 3.0  # of driving before the frame is taken
PAGE = "gallery-drive.html"


def frame(name: str) -> np.ndarray:
    """An environment after some seconds of driving."""
    width, height = SIZE
    env = gym.make(name, render_mode="rgb_array", render_options={"width": width, "height": height})
    env.reset(seed=7)
    if env.action_space.shape:
        action = np.zeros(env.action_space.shape, np.float32)
        action[: len(action) if len(action) <= 3 else len(action) // 2] = 0.35
    else:
        action = env.get_wrapper_attr("get_keys_to_action")()[""]
    for k in range(round(SECONDS / env.unwrapped.dt)):
        terminated = env.step(action)[2]
        if k % 3 == 0 or terminated:  # frames on the way, so that the wheels leave their marks
            image = env.render()
        if terminated:
            break
    env.close()
    return np.asarray(image)


def write_gallery(folder: Path, extra: Path) -> None:
    """Writes the frames into a folder, and the page into another, unless they are there and nothing has changed."""
    digest = hashlib.sha256(Path(__file__).read_bytes())
    package = Path(rover_gym.__file__).parent
    for path in sorted([*package.glob("rendering/*.py"), *package.glob("replay/**/*.*"), *package.glob("_core.*.so")]):
        digest.update(path.read_bytes())
    mark = folder / "made-from.txt"
    if mark.exists() and mark.read_text(encoding="utf-8") == digest.hexdigest() and (extra / PAGE).exists():
        return
    folder.mkdir(parents=True, exist_ok=True)
    extra.mkdir(parents=True, exist_ok=True)
    for name in ENVIRONMENTS:
        Image.fromarray(frame(name)).save(folder / f"{name.lower()}.webp", quality=QUALITY, method=6)
    with tempfile.TemporaryDirectory() as place:
        given = ["drive", "--difficulty", "1", "--policy", "scan", "--seed", "11", "--output", place]
        done = CliRunner().invoke(app, given)
        assert done.exit_code == 0, done.output  # noqa: S101 - the manual must not be built without it
        write_page(read_run(Path(place) / "episode-11.h5").resample(20.0), extra / PAGE)
    mark.write_text(digest.hexdigest(), encoding="utf-8")
