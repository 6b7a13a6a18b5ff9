"""The page of a live drive: what it says to the drive, what the drive says to it, and who is at the wheel."""

from __future__ import annotations

import asyncio
import json
import math
from importlib import resources
from itertools import cycle, islice
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rover_gym.env.start import MAX_DIFFICULTY
from rover_gym.extras import require
from rover_gym.live.guarded_server import GuardedServer, start_guarded
from rover_gym.live.live_commands import command_of, read_message
from rover_gym.live.live_rover import ROCK_RADII
from rover_gym.live.live_scene import GOAL_DISTANCES, GRAVITY
from rover_gym.live.live_view import LiveView
from rover_gym.mechanics import CommandError, RoverGymError
from rover_gym.rendering.appearance import WHEEL_COLOURS
from rover_gym.replay.player import with_parts
from rover_gym.validation import checked, number, refuse

if TYPE_CHECKING:
    from rover_gym.live.live_loop import LiveLoop
    from rover_gym.live.live_scene import LiveChoices
    from rover_gym.live.live_state import LiveState

#: States that a page gets, a second.
STATES = 10.0
#: Most pages at a time.
MOST_PAGES = 16
TITLE = "rover live"


class LiveServer:
    """Serves the page of a drive to browsers; the drive goes on without any.

    The first page that is open is at the wheel: its commands are carried out. Others watch, and may take the wheel. It
    is free as soon as its page is gone.

    Args:
        loop: The drive, which the caller starts and stops.
        choices: What may be chosen.
        host: Name or address to listen at; "127.0.0.1" refuses other machines.
        port: Port; 0 for any free one.
        fps: Pictures of the scene a second, 1 to 60; fewer for a browser that draws slowly.

    Attributes:
        address: Where the page is, as a browser takes it.
        view: What the pages see.

    Raises:
        OptionError: There is no such host, the port is in use, or `fps` is out of its range.
        MissingExtraError: viser is not installed.
    """

    @checked(loop="LiveLoop", choices="LiveChoices", host=str, port=int, fps=float)
    def __init__(
        self, loop: LiveLoop, choices: LiveChoices, *, host: str = "127.0.0.1", port: int = 8765, fps: float = 40.0
    ) -> None:
        pictures = number("fps", fps, at_least=1.0, at_most=60.0)
        self._loop, self._choices = loop, choices
        self._pages: list[Any] = []
        self._at_wheel: Any = None
        self._served: GuardedServer = start_guarded(host, port, _page(), self._serve)
        self.address = self._served.address
        self.view = LiveView(self._served.viser, loop, pictures)
        self.view.start()

    @property
    def n_pages(self) -> int:
        """How many pages are open."""
        return len(self._pages)

    def stop(self) -> None:
        """Closes the pages' connections and frees the port; the drive goes on."""
        self.view.stop()
        self._served.stop()

    async def _serve(self, page: Any) -> None:
        """Talks with one page until it is gone."""
        closed = require("websockets.exceptions", "replay").ConnectionClosed
        if len(self._pages) >= MOST_PAGES:
            await page.close(1013, f"{MOST_PAGES} pages are open")
            return
        self._pages.append(page)
        if self._at_wheel is None:
            self._at_wheel = page
        telling = asyncio.ensure_future(self._tell(page))
        try:
            await page.send(json.dumps({"choices": self._offer()}))
            async for message in page:
                answer = self._hear(page, message)
                if answer:
                    await page.send(json.dumps({"error": answer}))
        except closed:
            pass  # the browser has vanished: the command that it gave last runs out
        finally:
            telling.cancel()
            self._pages.remove(page)
            if self._at_wheel is page:
                self._at_wheel = None

    def _hear(self, page: Any, message: object) -> str:
        """Carries out a message; returns what is wrong with it, "" for nothing."""
        try:
            entries = read_message(message)
            if entries["do"] == "take":
                self._at_wheel = page
                return ""
            command = command_of(entries)
            if self._at_wheel is None:
                self._at_wheel = page
            if self._at_wheel is not page:
                refuse(
                    CommandError,
                    "do",
                    entries["do"],
                    "is allowed on the page in control only, and another page is in control",
                )
            self._loop.send(command)
        except RoverGymError as error:
            return str(error)
        return ""

    async def _tell(self, page: Any) -> None:
        """Sends the states to a page; a page that is slow gets fewer."""
        closed = require("websockets.exceptions", "replay").ConnectionClosed
        try:
            while True:
                state = self._loop.state
                wheel = "here" if self._at_wheel is page else "free" if self._at_wheel is None else "elsewhere"
                shown = _plain(state) | {"wheel": wheel, "pages": len(self._pages), "pictures": self.view.frames}
                await page.send(json.dumps({"state": shown}))
                await asyncio.sleep(1.0 / STATES)
        except closed:
            return

    def _offer(self) -> dict[str, Any]:
        """What the page offers to choose from."""
        choices = self._choices
        return {
            "ground": list(choices.grounds),
            "model": list(choices.models),
            "driver": list(choices.drivers),
            "difficulty": [0.0, MAX_DIFFICULTY],
            "goal_distance": list(GOAL_DISTANCES),
            "gravity": list(GRAVITY),
            "rock": list(ROCK_RADII),
        }


def _plain(state: LiveState) -> dict[str, Any]:
    """A state as JSON takes it."""
    scene = state.scene
    wheels = state.model.wheel_names
    return {
        "scene": vars(scene),
        "time": round(state.time, 4),
        "speed": _short(state.speed),
        "wheels": list(wheels),
        "colours": list(islice(cycle(WHEEL_COLOURS), len(wheels))),
        "loads": [_short(load, 1) for load in state.loads],
        "slip": _short(state.slip),
        "energy": _short(state.energy, 1),
        "tilt": _short(math.degrees(state.tilt), 2),
        "distance": _short(state.distance_to_goal),
        "goals": state.goals_reached,
        "solver": state.solver_status,
        "iterations": state.solver_iterations,
        "contacts": state.contacts,
        "ended": state.ended,
        "paused": state.is_paused,
        "reach": _short(state.reach, 2),
        "pace": _short(state.real_time_factor),
        "recording": Path(state.recording).name,
        "rows": state.recorded_rows,
        "notice": state.notice,
        "notices": state.notices,
        "over": state.is_over,
        "world": state.world,
    }


def _short(value: float, digits: int = 3) -> float | None:
    """A number for JSON, which knows neither nan nor infinity."""
    return round(float(value), digits) if math.isfinite(value) else None


def _page() -> str:
    """Viser's client with our panel beside it."""
    viser = require("viser", "replay")
    client = Path(viser.__file__).parent / "client" / "build" / "index.html"
    own = resources.files("rover_gym.live")
    panel = resources.files("rover_gym.replay").joinpath("panel.css").read_text(encoding="utf-8")
    style, script, body = (
        own.joinpath(f"live_page.{ending}").read_text(encoding="utf-8") for ending in ("css", "js", "html")
    )
    parts = f"<style>{panel}{style}</style>{body}<script>{script}</script>"
    return with_parts(client.read_text(encoding="utf-8"), TITLE, parts)
