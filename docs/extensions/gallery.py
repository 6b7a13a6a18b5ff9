"""The gallery: a frame of every registered environment, and a page of a drive in it, made while the manual is built."""

import hashlib
import html
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any, ClassVar

import gymnasium as gym
import numpy as np
from docutils import nodes
from PIL import Image
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

import rover_gym
from rover_gym.cli.tape import Tape, Watched
from rover_gym.env.rover_env import RoverEnv
from rover_gym.policy.named_policy import named_policy
from rover_gym.registration import ENVIRONMENTS
from rover_gym.replay import write_page
from rover_gym.runs import open_run, record_run

#: Width and height of a frame, pixels, and its quality as WebP.
SIZE, QUALITY = (560, 350), 74
SECONDS = 3.0  # of driving before the frame is taken
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


def frame(name: str) -> np.ndarray:
    """An environment after some seconds of driving."""
    width, height = SIZE
    env = gym.make(name, render_mode="rgb_array", render_options={"width": width, "height": height})
    env.reset(seed=SEED)
    driver = _Fixed(env)
    for k in range(round(SECONDS / env.unwrapped.dt)):
        terminated = env.step(driver.predict(None)[0])[2]
        if k % 3 == 0 or terminated:  # frames on the way, so that the wheels leave their marks
            image = env.render()
        if terminated:
            break
    env.close()
    return np.asarray(image)


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
