"""The gallery: a frame of every registered environment, and a page of a drive in it, made while the manual is built."""

import hashlib
import html
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any, ClassVar, NamedTuple

import gymnasium as gym
import numpy as np
from docutils import nodes
from PIL import Image
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

import rover_gym
from rover_gym.drive.named_policy import named_policy
from rover_gym.envs.registration import ENVIRONMENTS
from rover_gym.envs.rover_env import RoverEnv
from rover_gym.record.saved_runs import open_run, record_run
from rover_gym.show.replay import write_page
from rover_gym.show.replay.tape import Tape, Watched

#: Width and height of a frame, pixels, and its quality as WebP.
SIZE, QUALITY = (560, 350), 74
SECONDS = 3.0  # of driving before the frame is taken, or what FRAMES says
LONGEST, RATE = 12.0, 20.0  # s of a drive on a page, and its samples a second
SEED, ROCKY_SEED = 7, 11

#: Who drives on the page; elsewhere a fixed action does.
DRIVERS = {
    "Rover-v0": "pd",
    "RoverRocks-v0": "scan",
    "RoverHills-v0": "scan",
    "RoverSand-v0": "sand",
    "RoverWaypoints-v0": "pd",
    "RoverBattery-v0": "scan",
}


class _Fixed:
    """Repeats one action; among arcs it takes those of the planner."""

    def __init__(self, env: gym.Env[Any, Any]) -> None:
        self._env = env
        self._action = np.zeros(env.action_space.shape or (0,), np.float32)
        size = len(self._action)
        self._action[: size if size <= 3 else size // 2] = 0.35

    def predict(self, _: Any, state: Any = None, episode_start: Any = None) -> tuple[Any, Any]:  # noqa: ARG002
        """The action, and no state."""
        if not len(self._action):
            return self._env.get_wrapper_attr("expert_action")(), state
        return self._action, state


class Shot(NamedTuple):
    """How the frame of an environment is taken, so that no two look alike.

    Attributes:
        seconds: Of driving before it.
        aside: From which side the camera looks along the way to the goal, degrees.
        back, up: Of the camera behind the rover and over it, in reaches of the rover.
    """

    seconds: float = SECONDS
    aside: float = 22.0
    back: float = 3.6
    up: float = 1.4


#: What differs from `Shot()`.
FRAMES = {
    "RoverRocks-v0": Shot(aside=-25.0, up=1.8),
    "RoverHills-v0": Shot(aside=28.0, back=4.5, up=2.2),
    "RoverSand-v0": Shot(seconds=6.0, aside=-15.0),
    "RoverWaypoints-v0": Shot(seconds=5.0, aside=-12.0, back=6.0, up=4.2),
    "RoverBattery-v0": Shot(seconds=5.0, aside=8.0, back=4.4, up=2.6),
    "RoverCommand-v0": Shot(seconds=2.0, aside=-30.0, back=4.6, up=0.9),
    "RoverArcs-v0": Shot(seconds=2.0, aside=15.0, back=3.4, up=2.2),
    "RoverGoal-v0": Shot(seconds=1.0, aside=38.0, back=4.4, up=3.0),
    "RoverTrap-v0": Shot(aside=-12.0, back=3.2, up=2.0),
    "RoverGrains-v0": Shot(aside=60.0, back=3.4, up=1.7),
}


def frame(name: str) -> np.ndarray:
    """An environment after some seconds of driving, with its goal."""
    width, height = SIZE
    camera = camera_of(name, _driven(gym.make(name), name))
    options = {"width": width, "height": height, "camera": camera}
    return _driven(gym.make(name, render_mode="rgb_array", render_options=options), name)[2]


def _driven(env: gym.Env[Any, Any], name: str) -> tuple[np.ndarray, np.ndarray, np.ndarray, float]:
    """Drives to where the frame is taken: the rover's place, the goal's, the frame, and the rover's reach, m."""
    env.reset(seed=SEED)
    driver, image = _Fixed(env), np.zeros((0, 0, 3))
    for k in range(round(FRAMES.get(name, Shot()).seconds / env.unwrapped.dt)):  # type: ignore[attr-defined]
        terminated = env.step(driver.predict(None)[0])[2]
        if env.render_mode is not None and (k % 3 == 0 or terminated):  # on the way, so that the wheels leave marks
            image = np.asarray(env.render())
        if terminated:
            break
    rover = env.unwrapped
    place, (x, z) = rover.simulation.q[:3], rover.goal  # type: ignore[attr-defined]
    reach = float(rover.model.clear_radius)  # type: ignore[attr-defined]
    env.close()
    return place, np.array([x, place[1], z]), image, reach


def camera_of(name: str, driven: tuple[np.ndarray, np.ndarray, np.ndarray, float]) -> tuple[list[float], list[float]]:
    """Eye and target of a frame."""
    place, goal, _, reach = driven
    shot = FRAMES.get(name, Shot())
    way = (goal - place) / max(1e-9, float(np.linalg.norm(goal - place)))
    c, s = np.cos(np.radians(shot.aside)), np.sin(np.radians(shot.aside))
    back = np.array([c * way[0] - s * way[2], 0.0, s * way[0] + c * way[2]])
    eye = place - shot.back * reach * back + np.array([0.0, shot.up * reach, 0.0])
    # It looks between rover and goal, and both are in the picture.
    ways = [(end - eye) / np.linalg.norm(end - eye) for end in (place, goal)]
    return eye.tolist(), (eye + 0.55 * ways[0] + 0.45 * ways[1]).tolist()


def record(name: str, path: Path) -> None:
    """Records a drive in an environment."""
    known = named_policy(DRIVERS[name]) if name in DRIVERS else None
    env = gym.make(name, **({} if known is None else known.arguments))
    rover = env.unwrapped
    assert isinstance(rover, RoverEnv)  # noqa: S101 - all of them are
    observation, info = env.reset(seed=ROCKY_SEED if known is not None and "height_scan" in known.arguments else SEED)
    driver = Watched(_Fixed(env) if known is None else known.make(env))
    if name == "RoverGrains-v0":  # its balls are recorded with the rover
        env.step(driver.predict(observation)[0])
        record_run(rover.batch.movers[0], LONGEST, path, RATE, title=name, until=lambda sim: sim.rover.q[0] > 3.0)
        return
    tape = Tape(path, rover, name, SEED, {} if known is None else known.arguments, driver)
    step = rover.step

    def taped(action: Any) -> Any:
        """A command may be held for several control periods; each of them is a row."""
        result = step(action)
        tape.append(rover, result[4])
        return result

    with tape.recorder:
        tape.append(rover, info)
        rover.step = taped  # type: ignore[method-assign]
        terminated = truncated = False
        while not (terminated or truncated) and rover.simulation.time < LONGEST:
            observation, _, terminated, truncated, _ = env.step(driver.predict(observation, driver.state)[0])
    env.close()


def page(name: str) -> str:
    """File name of an environment's page."""
    return f"gallery-{name.lower()}.html"


def write_gallery(extra: Path) -> None:
    """Writes frames and pages into a folder, unless they are there and nothing has changed."""
    digest = hashlib.sha256(Path(__file__).read_bytes())
    package = Path(rover_gym.__file__).parent
    for path in sorted([*package.glob("rendering/*.py"), *package.glob("replay/**/*.*"), *package.glob("_core.*.so")]):
        digest.update(path.read_bytes())
    mark = extra.parent / "gallery-made-from.txt"
    if mark.exists() and mark.read_text(encoding="utf-8") == digest.hexdigest() and (extra / page("Rover-v0")).exists():
        return
    extra.mkdir(parents=True, exist_ok=True)
    for name in ENVIRONMENTS:
        Image.fromarray(frame(name)).save(extra / f"{name.lower()}.webp", quality=QUALITY, method=6)
        with tempfile.TemporaryDirectory() as place:
            record(name, Path(place) / "drive.h5")
            write_page(open_run(Path(place) / "drive.h5"), extra / page(name))
    mark.write_text(digest.hexdigest(), encoding="utf-8")


#: Loads the page of a drive when it is opened, and ends it when it is closed: browsers load hidden frames, too.
TOGGLE = "const frame = this.querySelector('iframe'); frame.src = this.open ? frame.dataset.page : 'about:blank'"


class DriveDirective(SphinxDirective):
    """An environment in the gallery: its frame, which makes room for the page of a drive when it is opened."""

    required_arguments = 1
    has_content = True
    option_spec: ClassVar[Mapping[str, Any]] = {}  # type: ignore[misc]

    def run(self) -> list[nodes.Node]:
        """The frame, the page that is loaded when it is opened, and the text."""
        self.env.note_dependency(__file__)
        name = self.arguments[0]
        if name not in ENVIRONMENTS:
            raise self.error(f"{name} is no registered environment")
        title = html.escape(f"A drive in {name}")
        picture = f'<img src="{name.lower()}.webp" width="{SIZE[0]}" height="{SIZE[1]}" alt="{title}" loading="lazy">'
        frame = f'<iframe class="player" data-page="{page(name)}" title="{title}"></iframe>'
        held = nodes.container(classes=["drive"])
        summary = f"<summary>{picture}<span></span></summary>"
        held += nodes.raw("", f'<details ontoggle="{TOGGLE}">{summary}{frame}</details>', format="html")
        self.state.nested_parse(self.content, self.content_offset, held)
        return [held]


def setup(app: Sphinx) -> dict[str, bool]:
    """Called by Sphinx."""
    app.add_directive("drive", DriveDirective)
    return {"parallel_read_safe": True}
