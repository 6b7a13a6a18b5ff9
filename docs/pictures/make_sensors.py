"""Draws the picture of docs/sensors.md anew: `.venv/bin/python docs/pictures/make_sensors.py`."""

import io
from pathlib import Path

import gymnasium as gym
import matplotlib as mpl
import numpy as np

mpl.use("Agg")

import matplotlib.pyplot as plt
from PIL import Image

import rover_gym
from rover_gym.envs.sensors import ColourCamera, DepthCamera, LaserScanner, Mount, SegmentationCamera
from rover_gym.show.figures.style import STYLE

PICTURE = Path(__file__).parent / "sensors.png"
SEED = 4
VIEW = {"mount": Mount(position=(0.75, 0.2, 0.0), pitch_deg=-14.0), "width": 320, "height": 240, "view_deg": 60.0}
CAMERA = DepthCamera(max_range=6.0, **VIEW)
FISHEYE = ColourCamera(
    name="fisheye",
    mount=Mount(position=(0.75, 0.2, 0.0), heading_deg=70.0, pitch_deg=-20.0),
    width=320,
    height=240,
    view_deg=190.0,
    fisheye=True,
    sun_azimuth_deg=20.0,
    sun_elevation_deg=14.0,
    exposure=0.45,
    vignetting=0.5,
)
#: Colours of sky, ground, rocks and rover.
LABELS = np.array([(230, 230, 230), (213, 94, 0), (86, 180, 233), (0, 0, 0)], dtype=np.uint8)
SCANNER = LaserScanner(
    mount=Mount(position=(0.0, 1.2, 0.0)),
    rays=1440,
    elevations_deg=tuple(np.linspace(-60.0, -12.0, 48)),
    max_range=8.0,
)
#: Of the rendered scene: a place behind the depth camera, and one that it looks at, m.
EYE, TARGET = (-3.5, 2.6, 1.6), (1.2, 0.2, 0.0)


def main() -> None:
    """Resets among rocks, measures, and draws the four views."""
    env = gym.make(
        "RoverRocks-v0",
        sensors=[CAMERA, ColourCamera(**VIEW), SegmentationCamera(**VIEW), FISHEYE, SCANNER],
        difficulty=2.0,
        rock_abundance=0.3,
        slope_deg=0.0,
        heading_deg=0.0,
        goal_bearing_deg=0.0,
        render_mode="rgb_array",
        render_options={"width": 800, "height": 800, "camera": (EYE, TARGET)},
    )
    observation, _ = env.reset(seed=SEED)
    with mpl.rc_context(STYLE):
        figure, ((scene, colour, labels), (fisheye, depth, scan)) = plt.subplots(2, 3, figsize=(13.0, 7.0))
        scene.imshow(env.render())
        scene.set_title("the scene")
        colour.imshow(observation["colour"])
        colour.set_title("colour camera, 320 x 240")
        labels.imshow(LABELS[observation["segmentation"]])
        labels.set_title("segmentation camera")
        fisheye.imshow(observation["fisheye"])
        fisheye.set_title("fisheye with a view of 190 degrees, the Sun low")
        image = depth.imshow(observation["depth"], cmap="viridis_r", vmin=0.0, vmax=CAMERA.max_range)
        depth.set_title("depth camera")
        for axes in (scene, colour, labels, fisheye, depth):
            axes.axis("off")
        figure.colorbar(image, ax=depth, label="depth, m", shrink=0.8)
        draw_scan(scan, observation["scan"], env.unwrapped)
        memory = io.BytesIO()
        figure.savefig(memory)
        plt.close(figure)
    env.close()
    with Image.open(memory) as drawn:
        small = drawn.convert("RGB").resize((1200, drawn.height * 1200 // drawn.width), Image.Resampling.LANCZOS)
    small.quantize(256, method=Image.Quantize.FASTOCTREE, dither=Image.Dither.NONE).save(PICTURE, optimize=True)


def draw_scan(axes: plt.Axes, scan: np.ndarray, env: rover_gym.RoverEnv) -> None:
    """Draws where the rays meet ground, rocks and rover, from above: ahead is up, left is left."""
    met = (scan > 0.0) & (scan < SCANNER.max_range)
    places = SCANNER.directions * scan[..., None] + np.asarray(SCANNER.mount.position)
    height = places[..., 1] + env.simulation.q[1]
    drawn = axes.scatter(
        places[met][:, 2], places[met][:, 0], c=height[met], s=0.4, lw=0.0, cmap="viridis", vmin=0.0, vmax=0.4
    )
    axes.figure.colorbar(drawn, ax=axes, label="height, m", shrink=0.8)
    axes.set(title="laser scanner, 48 rings", xlabel="to the right, m", ylabel="ahead, m", aspect="equal")
    axes.set(xlim=(-5.0, 5.0), ylim=(-4.0, 6.0))


if __name__ == "__main__":
    main()
