"""A saved run as a browser page, one file that needs no network: the scene with a timeline and curves."""

from __future__ import annotations

import base64
import hashlib
import html
import zlib
from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rover_gym.core import OptionError
from rover_gym.core.files import written_whole
from rover_gym.core.validation import checked, refuse
from rover_gym.record.disk_run import DiskRun
from rover_gym.record.grain_run import GrainRun
from rover_gym.record.planar_run import PlanarRun
from rover_gym.record.rover_run import RoverRun
from rover_gym.show.replay.flat_scene import disk_scene, planar_scene
from rover_gym.show.replay.grain_scene import grain_scene
from rover_gym.show.replay.page_scene import SAMPLES
from rover_gym.show.replay.rover_scene import rover_scene

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from rover_gym.record.saved_runs import SavedRun

#: The player's scripts, in order; what plays comes last.
SCRIPTS = (
    "three.min.js",
    "scene.js",
    "view.js",
    "ruts.js",
    "grains.js",
    "markers.js",
    "overlays.js",
    "eye.js",
    "curves.js",
    "stage.js",
)

#: What makes the scene of each kind of run.
SCENES: dict[type, Any] = {RoverRun: rover_scene, PlanarRun: planar_scene, DiskRun: disk_scene, GrainRun: grain_scene}


@checked(run=("RoverRun", "PlanarRun", "DiskRun", "GrainRun"), path=Path, follow=bool, ghost=("RoverRun", None))
def write_page(run: SavedRun, path: str | Path, *, follow: bool = True, ghost: RoverRun | None = None) -> Path:
    """Writes a run as a single browser page: the scene with a timeline and, beside it, curves.

    Args:
        run: The run; every sample becomes a frame of the replay.
        path: The file to write, usually `.html`. Its folder is created.
        follow: Whether the eye follows what moves; otherwise the ground stays fixed. A bed of disks is followed where
            it is wider than the picture.
        ghost: Another run of a rover, which drives beside a rover's run, translucent and with dashed curves.

    Raises:
        OptionError: A ghost is given beside a run of something else than a rover.
        RecordingError: The recording is damaged.
        OSError: The file cannot be written.
    """
    if ghost is not None and not isinstance(run, RoverRun):
        refuse(OptionError, "ghost", ghost, "can only drive beside a rover's run")
    more = {} if ghost is None else {"ghost": ghost}
    scene = SCENES[type(run)](run, follow=follow, **more)
    scene.facts |= {
        "time": [round(float(time - run.time[0]), 6) for time in run.time],
        "samples": SAMPLES,
        "pieces": -(-run.n_frames // SAMPLES),
    }
    with written_whole(path) as draft, draft.open("w", encoding="utf-8") as file:
        file.writelines(page_parts(run.title, "recorded", _packed(scene.message(), scene.pieces(run.n_frames))))
    return Path(path)


def page_parts(title: str, kind: str, contents: Iterable[str] = (), more: str = "") -> Iterator[str]:
    """A page of the player in parts, whose policy lets it load nothing and run no script but its own.

    Args:
        title: The page's title.
        kind: "recorded" or "live".
        contents: Elements that hold data.
        more: Where else the page may connect to, in the words of its policy.
    """
    yield f'<!DOCTYPE html><html lang="en"><head><meta charset="utf-8"><title>{html.escape(title)}</title>'
    yield f'<meta http-equiv="Content-Security-Policy" content="{page_policy(kind, more)}">'
    yield '<meta name="viewport" content="width=device-width,initial-scale=1">'
    yield f"<style>{player_file('page.css')}</style></head><body>{player_file(f'{kind}.html')}"
    yield from contents
    for name in (*SCRIPTS, f"{kind}.js"):
        yield f"<script>{player_file(name)}</script>\n"
    yield "</body></html>\n"


def page_policy(kind: str, more: str = "") -> str:
    """The content security policy of a page: its own scripts, by their hashes, and nothing from elsewhere."""
    scripts = [player_file(name) for name in (*SCRIPTS, f"{kind}.js")]
    hashes = [base64.b64encode(hashlib.sha256(script.encode()).digest()).decode() for script in scripts]
    own = " ".join(f"'sha256-{one}'" for one in hashes)
    rules = [
        "default-src 'none'",
        f"script-src {own}",
        "style-src 'unsafe-inline'",
        f"connect-src data: {more}".strip(),
    ]
    return "; ".join((*rules, "base-uri 'none'", "form-action 'none'"))


def player_file(name: str) -> str:
    """The text of a file of the player."""
    return resources.files("rover_gym.show.replay").joinpath("player", name).read_text(encoding="utf-8")


def _packed(message: bytes, pieces: Iterable[bytes]) -> Iterator[str]:
    """The scene and the pieces of its frames as elements that no browser shows."""
    yield _element("scene", message)
    for i, piece in enumerate(pieces):
        yield _element(f"piece-{i}", piece)


def _element(name: str, content: bytes) -> str:
    packed = base64.b64encode(zlib.compress(content, 6)).decode()
    return f'<script type="application/octet-stream" id="{name}">{packed}</script>\n'
