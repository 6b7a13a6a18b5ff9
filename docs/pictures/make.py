"""Draws the pictures of the README and the manual anew: `.venv/bin/python docs/pictures/make.py`."""

from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
from PIL import Image

import rover_gym
from rover_gym.rendering import FrameRenderer

HERE = Path(__file__).parent
WIDTH, HEIGHT = 900, 500
OVERSAMPLING = 2  # smoother than the renderer's own antialiasing


def rocks(path: Path) -> None:
    """The rover on its way to a goal among rocks."""
    env = gym.make("RoverRocks-v0", difficulty=1.0, slope_deg=4.0, uphill_deg=150.0)
    policy = rover_gym.PDPolicy(env)
    rover: Any = env.unwrapped
    observation, _ = env.reset(seed=22, options={"heading_deg": 0.0, "goal": (6.5, 1.5)})
    for _ in range(81):
        observation, *_ = env.step(policy.predict(observation)[0])
    # From the right, low, so that the wheels on the rocks are seen, and the goal ahead.
    centre = rover.simulation.q[:3]
    eye, target = centre + np.array([[-2.75, 1.0, 2.05], [0.75, 0.06, 0.22]])
    with FrameRenderer(
        rover.model,
        rover.simulation.terrain,
        width=OVERSAMPLING * WIDTH,
        height=OVERSAMPLING * HEIGHT,
        camera=(tuple(eye), tuple(target)),
        goal=rover.goal,
        goal_tolerance=rover.goal_tolerance,
    ) as renderer:
        save(renderer.render(rover.simulation), path)


def save(frame: np.ndarray, path: Path) -> None:
    """Averages the oversampled pixels and writes a small PNG."""
    blocks = frame.reshape(HEIGHT, OVERSAMPLING, WIDTH, OVERSAMPLING, 3)
    image = Image.fromarray(np.round(blocks.mean(axis=(1, 3))).astype(np.uint8))
    image.quantize(256, dither=Image.Dither.FLOYDSTEINBERG).save(path, optimize=True)
    print(path, path.stat().st_size // 1000, "kB")  # noqa: T201


if __name__ == "__main__":
    rocks(HERE / "rocks.png")
