"""The page of a live drive: what it says to the drive, what the drive says to it, and who is at the wheel."""

from __future__ import annotations

import asyncio
import json
import math
import time
from contextlib import suppress
from itertools import cycle, islice
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rover_gym.core import CommandError, RoverGymError
from rover_gym.core.extras import require
from rover_gym.core.validation import checked, refuse
from rover_gym.envs.start import MAX_DIFFICULTY
from rover_gym.show.frames.appearance import WHEEL_COLOURS
from rover_gym.show.live.guarded_server import GuardedServer
from rover_gym.show.live.live_commands import command_of, read_message
from rover_gym.show.live.live_rover import ROCK_RADII
from rover_gym.show.live.live_scene import GOAL_DISTANCES, GRAVITY
from rover_gym.show.live.live_view import LiveView
from rover_gym.show.replay.page import page_parts, page_policy

if TYPE_CHECKING:
    from rover_gym.show.live.live_loop import LiveLoop
    from rover_gym.show.live.live_scene import LiveChoices
    from rover_gym.show.live.live_state import LiveState

#: States that a page gets, a second.
STATES = 10.0
#: Most pages at a time.
MOST_PAGES = 16
TITLE = "rover live"
#: With these commands a page asks for the wheel, and for the scene and its frames, binary.
TAKE, WATCH = {"do": "take"}, {"do": "watch"}
#: What the page may do besides showing itself: talk with its own server.
CONNECTION = "'self'"


class LiveServer:
    """Serves the page of a drive to browsers; the drive goes on without any.

    The first page that is open is at the wheel: its commands are carried out. Others watch, and may take the wheel. It
    is free as soon as its page is gone.

    Args:
        loop: The drive, which the caller starts and stops.
        choices: What may be chosen.
        host: Name or address to listen at; "127.0.0.1" refuses other machines.
        port: Port; 0 for any free one.

    Attributes:
        address: Where the page is, as a browser takes it.
        view: What the pages see.

    Raises:
        OptionError: There is no such host, or the port is in use.
        MissingExtraError: websockets is not installed.
    """

    @checked(loop="LiveLoop", choices="LiveChoices", host=str, port=int)
    def __init__(self, loop: LiveLoop, choices: LiveChoices, *, host: str = "127.0.0.1", port: int = 8765) -> None:
        self._loop, self._choices = loop, choices
        self._pages: list[Any] = []
        self._at_wheel: Any = None
        self.view = LiveView()
        self._seen: tuple[int, bytes] = (-1, b"")
        self._is_dark = False
        page = "".join(page_parts(TITLE, "live", more=CONNECTION))
        self._served = GuardedServer(host, port, page, page_policy("live", CONNECTION), self._serve)
        self.address = self._served.address

    @property
    def n_pages(self) -> int:
        """How many pages are open."""
        return len(self._pages)

    def stop(self) -> None:
        """Closes the pages' connections and frees the port; the drive goes on."""
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
        errors: asyncio.Queue[str] = asyncio.Queue()
        tasks = {
            "tell": asyncio.ensure_future(self._tell(page)),
            "answer": asyncio.ensure_future(_answer(page, errors)),
        }
        try:
            await page.send(json.dumps({"choices": self._offer()}))
            async for message in page:
                try:
                    if self._hear(page, message, errors) and "show" not in tasks:
                        tasks["show"] = asyncio.ensure_future(self._show(page))
                except RoverGymError as error:
                    errors.put_nowait(str(error))
        except closed:
            pass  # the browser has vanished: the command that it gave last runs out
        finally:
            for task in tasks.values():
                task.cancel()
            self._pages.remove(page)
            if self._at_wheel is page:
                self._at_wheel = None

    def _hear(self, page: Any, message: object, errors: asyncio.Queue[str]) -> bool:
        """Carries out a message; returns whether the page asks for the scene.

        What the drive refuses later, when it carries out the command, goes to `errors`.

        Raises:
            RoverGymError: The message is none, or not from the page at the wheel.
        """
        entries = read_message(message)
        if entries == TAKE:
            self._at_wheel = page
        if entries in (TAKE, WATCH):
            return entries == WATCH
        command = command_of(entries)
        if self._at_wheel is None:
            self._at_wheel = page
        if self._at_wheel is not page:
            refuse(
                CommandError,
                "do",
                entries["do"],
                'another page drives: press \'take the wheel\', or send {"do": "take"}',
            )
        server = asyncio.get_running_loop()

        def tell(error: str) -> None:
            with suppress(RuntimeError):  # the server has stopped
                server.call_soon_threadsafe(errors.put_nowait, error)

        self._loop.send(command, tell)
        return False

    async def _tell(self, page: Any) -> None:
        """Sends the states to a page; a page that is slow gets fewer."""
        closed = require("websockets.exceptions", "replay").ConnectionClosed
        try:
            while True:
                state = self._loop.state
                wheel = "here" if self._at_wheel is page else "free" if self._at_wheel is None else "elsewhere"
                shown = _plain(state) | {"wheel": wheel, "pages": len(self._pages)}
                await page.send(json.dumps({"state": shown}))
                await asyncio.sleep(1.0 / STATES)
        except closed:
            return

    async def _show(self, page: Any) -> None:
        """Sends the scene and its frames to a page; a page that is slow gets fewer."""
        closed = require("websockets.exceptions", "replay").ConnectionClosed
        shown, last, n_sent = -1, -1, 0
        try:
            while True:
                begin, state = time.perf_counter(), self._loop.state
                if state.number != last and not self._is_dark and self._follow(state):
                    last, (number, frame) = state.number, self._seen
                    if self.view.number != shown:
                        shown, n_sent = self.view.number, 0
                        await page.send(self.view.scene)
                    if number == last:
                        ruts = bytes(self.view.pressed[n_sent:])
                        n_sent += len(ruts)
                        await page.send(frame + ruts)
                await asyncio.sleep(max(0.0, 0.5 * state.period - (time.perf_counter() - begin)))
        except closed:
            return

    def _follow(self, state: LiveState) -> bool:
        """Makes the frame of a state, once for all pages; returns whether that went well."""
        if self._seen[0] == state.number:
            return True
        try:
            self.view.follow(state)
            self._seen = state.number, self.view.frame(state)
        except Exception as error:  # the drive goes on without its picture, and the user must learn of it
            self._is_dark = True
            self._loop.tell(f"the scene is shown no further: {type(error).__name__}: {error}")
        return not self._is_dark

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


async def _answer(page: Any, errors: asyncio.Queue[str]) -> None:
    """Tells a page what was wrong with its messages."""
    closed = require("websockets.exceptions", "replay").ConnectionClosed
    try:
        while True:
            await page.send(json.dumps({"error": await errors.get()}))
    except closed:
        return


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
