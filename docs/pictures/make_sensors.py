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
from rover_gym.figures.style import STYLE
from rover_gym.sensors import DepthCamera, LaserScanner, Mount

PICTURE = Path(__file__).parent / "sensors.png"
DIFFICULTY, SEED = 1.0, 5
CAMERA = DepthCamera(
    mount=Mount(position=(0.6, 0.7, 0.0), pitch_deg=-22.0), width=160, height=120, view_deg=70.0, max_range=8.0
)
SCANNER = LaserScanner(
    mount=Mount(position=(0.0, 1.0, 0.0)), rays=720, elevations_deg=tuple(range(-40, 0, 4)), max_range=8.0
)


def main() -> None:
    """Resets among rocks, measures, and draws the three views."""
    env = gym.make(
        "RoverRocks-v0",
        sensors=[CAMERA, SCANNER],
        difficulty=DIFFICULTY,
        slope_deg=0.0,
        render_mode="rgb_array",
        render_options={"width": 640, "height": 640},
    )
    observation, _ = env.reset(seed=SEED)
    with mpl.rc_context(STYLE):
        figure, (left, middle, right) = plt.subplots(1, 3, figsize=(12.0, 4.0), width_ratios=(1.0, 1.45, 1.15))
        left.imshow(env.render())
        left.set_title("the scene")
        left.axis("off")
        image = middle.imshow(observation["depth"], cmap="viridis_r", vmin=0.0, vmax=CAMERA.max_range)
        middle.set_title("depth camera, 160 x 120")
        middle.axis("off")
        figure.colorbar(image, ax=middle, label="depth, m", shrink=0.8)
        draw_scan(right, observation["scan"], env.unwrapped)
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
    drawn = axes.scatter(places[met][:, 2], places[met][:, 0], c=height[met], s=1.5, cmap="viridis", vmin=0.0, vmax=0.5)
    axes.figure.colorbar(drawn, ax=axes, label="height, m", shrink=0.8)
    axes.set(title="laser scanner, 10 rings", xlabel="to the right, m", ylabel="ahead, m", aspect="equal")
    axes.set(xlim=(-5, 5), ylim=(-5, 5))


if __name__ == "__main__":
    main()
