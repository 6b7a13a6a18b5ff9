"""The same instants of drives as frames and on pages, from the same eye: how far the two engines differ.

python -m browser.one_look [FOLDER]        # writes the pictures side by side
"""

import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from unittest import mock

import numpy as np
import numpy.typing as npt
from browser.test_replay_page import frames, go_to, opened, picture, resize
from PIL import Image
from rovers import standing

from rover_gym import HeightField, Plane, RoverModel, SphereField, Terrain, Union
from rover_gym.record import Recorder, RoverRun, RoverSampler, describe, read_run
from rover_gym.show.frames import FrameRenderer
from rover_gym.show.frames.frame_renderer import VIEW_ANGLE
from rover_gym.show.replay import rover_scene, write_page
from rover_gym.show.replay.scenery import View

Picture = npt.NDArray[np.float64]

WIDTH, HEIGHT = 640, 480
MOMENT = 1.6  # s
ROWS = 20.0  # a second
PANEL = 300  # pixels, of the page beside the picture
SQUARE = 8  # pixels, edge of the squares whose means are compared: engines sample edges differently

EYE, TARGET = np.array([-3.4, 1.9, 2.0]), np.array([0.5, 0.25, 0.2])  # from the rover, m


def grounds() -> dict[str, Terrain]:
    """What the drives go over, by name."""
    field = HeightField.fractal(40.0, 0.25, 0.12, hurst=0.8, craters=0.02, crater_diameter=(1.0, 4.0), seed=3)
    rocks = SphereField.rocks(0.1, (-12.0, -12.0, 12.0, 12.0), 1, ground=Plane(), clear=[[0.0, 0.0, 1.2]])
    return {
        "plane": Plane(),
        "rocks": rocks,
        "hills": Union([field, SphereField.rocks(0.05, field.bounds, 1, ground=field, clear=[[0.0, 0.0, 1.5]])]),
    }


def both(terrain: Terrain, folder: Path) -> tuple[Picture, Picture]:
    """A drive at `MOMENT`, (height, width, 3) levels each: as a frame and on a page."""
    model = RoverModel()
    sim = standing(model, terrain, heading=0.3)
    sim.set_wheel_torques(np.full(6, 25.0))
    sampler = RoverSampler(model)
    # Looked at from one place: then nothing hangs on how the two cameras follow.
    camera = sim.q[:3] + EYE, sim.q[:3] + TARGET
    look = tuple(tuple(point.tolist()) for point in camera)
    recorder = Recorder(folder / "run.h5", sampler.channels, describe(sim, "a drive"), terrain=terrain)
    with recorder, FrameRenderer(model, terrain, width=WIDTH, height=HEIGHT, camera=look) as renderer:
        recorder.append(sampler.row(sim))
        renderer.render(sim)
        for _ in range(round(MOMENT * ROWS)):
            sim.step(round(1.0 / ROWS / sim.time_step))
            recorder.append(sampler.row(sim))
            frame = renderer.render(sim)
    return frame.astype(np.float64), shown(read_run(folder / "run.h5"), camera, folder)


def shown(run: RoverRun, camera: tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]], folder: Path) -> Picture:
    """The page of a run at `MOMENT`, from an eye towards a target, m."""
    above = [0.0, rover_scene.ABOVE * run.model.clear_radius, 0.0]
    view = View(camera[0], camera[1] - above, float(np.radians(VIEW_ANGLE)))
    with mock.patch.object(rover_scene, "first_view", return_value=view):
        page = write_page(run, folder / "page.html", follow=False)
    with opened(page, folder / "profile") as browser:
        resize(browser, WIDTH + PANEL, HEIGHT)
        go_to(browser, MOMENT)
        frames(browser, 3)
        return picture(browser)


def squares(image: Picture) -> Picture:
    """Means over squares of pixels."""
    n, m = (size // SQUARE for size in image.shape[:2])
    return image[: n * SQUARE, : m * SQUARE].reshape(n, SQUARE, m, SQUARE, 3).mean(axis=(1, 3))


def difference(one: Picture, other: Picture) -> dict[str, float]:
    """How far two pictures differ, levels of 255, by the means of squares: their mean, and of the worst tenth."""
    away = np.abs(squares(one) - squares(other)).max(axis=-1).ravel()
    return {"mean": float(away.mean()), "worst tenth": float(np.quantile(away, 0.9))}


def measured(folder: Path | None = None) -> Iterator[tuple[str, dict[str, float]]]:
    """The differences by ground; with a folder, the pictures are written there."""
    for name, terrain in grounds().items():
        with tempfile.TemporaryDirectory() as place:
            frame, page = both(terrain, Path(place))
        if folder is not None:
            folder.mkdir(parents=True, exist_ok=True)
            beside = np.hstack((frame, page, np.minimum(255.0, 4.0 * np.abs(frame - page))))
            Image.fromarray(beside.astype(np.uint8)).save(folder / f"{name}.png")
        yield name, difference(frame, page)


if __name__ == "__main__":
    for ground, figures in measured(Path(sys.argv[1]) if len(sys.argv) > 1 else None):
        print(ground, *(f"{name} {value:.1f}" for name, value in figures.items()))  # noqa: T201 - what it is for
