"""The page's server without a browser: who may connect, who is at the wheel, and what bad messages and ports do."""

import http.client
import json
import socket
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import pytest
from refusals import refused

from rover_gym.core import OptionError
from rover_gym.show.live import LiveChoices, LiveLoop, LiveRover, LiveScene, LiveServer
from rover_gym.show.live.live_view import FRAME, HEAD, SCENE

client = pytest.importorskip("websockets.sync.client")
from websockets.exceptions import InvalidStatus  # noqa: E402 - comes with it


@dataclass
class Served:
    """A drive that is served."""

    loop: LiveLoop
    server: LiveServer

    @property
    def port(self) -> int:
        """Where it listens."""
        return urlsplit(self.server.address).port or 0

    def page(self, path: str = "/live", **options: Any) -> Any:
        """A connection as a page of ours makes it."""
        options.setdefault("origin", f"http://127.0.0.1:{self.port}")
        return client.connect(f"ws://127.0.0.1:{self.port}{path}", **options)

    def get(self, path: str = "/", host: str | None = None) -> http.client.HTTPResponse:
        """The answer to a request for a page."""
        connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=10.0)
        connection.request("GET", path, headers={} if host is None else {"Host": host})
        return connection.getresponse()


@pytest.fixture
def served(tmp_path: Path) -> Iterator[Served]:
    choices = LiveChoices()
    loop = LiveLoop(LiveRover(LiveScene(), choices), tmp_path)
    server = LiveServer(loop, choices, port=0)
    loop.start()
    yield Served(loop, server)
    loop.stop()
    server.stop()


def say(page: Any, **message: Any) -> None:
    page.send(json.dumps(message))


def heard(page: Any, key: str, condition: Callable[[Any], bool] = lambda _: True) -> Any:
    """The next message of a kind that satisfies a condition."""
    end = time.monotonic() + 20.0
    while time.monotonic() < end:
        received = page.recv(timeout=20.0)
        message = json.loads(received) if isinstance(received, str) else {}
        if key in message and condition(message[key]):
            return message[key]
    raise AssertionError(f"no {key} came")


def test_a_page_hears_states_and_drives(served: Served) -> None:
    with served.page() as page:
        choices = heard(page, "choices")
        assert choices["ground"] == ["plane", "rocks", "hills", "sand"]
        assert heard(page, "state")["wheel"] == "here"
        for _ in range(12):
            say(page, do="drive", forward=1.0, turn=0.0)
            time.sleep(0.1)
        assert served.loop.state.speed > 0.5
        say(page, do="change", name="friction", value=0.25)
        assert heard(page, "state", lambda state: state["scene"]["friction"] == 0.25)
        say(page, do="change", name="ground", value="moon")
        assert "must be one of" in heard(page, "error")


def test_a_browser_that_vanishes_stops_the_rover_and_frees_the_wheel(served: Served) -> None:
    page = served.page()
    for _ in range(8):
        say(page, do="drive", forward=1.0)
        time.sleep(0.1)
    assert served.loop.state.speed > 0.3
    page.socket.shutdown(socket.SHUT_RDWR)  # without a word
    page.socket.close()
    end = time.monotonic() + 20.0
    while served.loop.state.speed > 0.1 or served.server.n_pages:
        assert time.monotonic() < end
        time.sleep(0.05)
    at = served.loop.state.time
    with served.page() as other:
        assert heard(other, "state")["wheel"] == "here"
    time.sleep(0.2)
    assert served.loop.state.time > at


def test_of_two_pages_one_is_at_the_wheel(served: Served) -> None:
    with served.page() as first, served.page() as second:
        assert heard(first, "state", lambda state: state["pages"] == 2)["wheel"] == "here"
        assert heard(second, "state")["wheel"] == "elsewhere"
        say(second, do="change", name="friction", value=0.1)
        assert "another page drives" in heard(second, "error")
        assert served.loop.state.scene.friction == 0.7
        say(second, do="take")
        assert heard(second, "state", lambda state: state["wheel"] == "here")
        assert heard(first, "state", lambda state: state["wheel"] == "elsewhere")
        say(second, do="change", name="friction", value=0.1)
        assert heard(first, "state", lambda state: state["scene"]["friction"] == 0.1)
        say(first, do="pause")
        assert "another page drives" in heard(first, "error")
        second.close()
        assert heard(first, "state", lambda state: state["wheel"] == "free")
        say(first, do="pause")
        assert heard(first, "state", lambda state: state["paused"])["wheel"] == "here"


@pytest.mark.parametrize(
    "message", ["", "{", "null", '{"do": "fly"}', b"\xff\x00", '{"do": "drive", "forward": 1e400}']
)
def test_malformed_messages_are_answered_and_the_drive_goes_on(served: Served, message: str | bytes) -> None:
    with served.page() as page:
        page.send(message)
        assert heard(page, "error")
        at = served.loop.state.time
        assert heard(page, "state", lambda state: state["time"] > at)


@pytest.mark.parametrize(
    ("message", "what"),
    [({"do": "change", "name": "friction", "value": -1}, "friction: "), ({"do": "rock", "radius": 99}, "radius: ")],
)
def test_what_the_drive_refuses_is_answered_with_an_error(served: Served, message: dict[str, Any], what: str) -> None:
    """It came as a notice of the state, where the manual promises an error."""
    with served.page() as page:
        say(page, **message)
        assert heard(page, "error").startswith(what)
        assert served.loop.state.notice == ""


def test_a_message_is_json_however_it_is_spaced(served: Served) -> None:
    """`{"do": "watch"}` was refused for its space."""
    with served.page() as page:
        page.send('{ "do" : "watch" }')
        assert pictures(page, 1.0)
        page.send('{"do": "watch", "more": 1}')
        assert "do: must be one of drive, " in heard(page, "error")


@pytest.mark.parametrize("origin", ["http://example.org", "null", "https://127.0.0.1", "http://127.0.0.1:1"])
def test_other_pages_are_refused(served: Served, origin: str) -> None:
    with pytest.raises(InvalidStatus, match="403"):
        served.page(origin=origin)


@pytest.mark.parametrize("host", ["example.org", "example.org:80", "[", "127.0.0.1.example.org"])
def test_a_name_of_a_site_that_leads_here_is_refused(served: Served, host: str) -> None:
    """DNS rebinding: a site may resolve its name to this address, so that the browser treats our page as its own."""
    assert served.get("/", host).status == 421


def test_the_page_is_all_that_is_served_and_may_load_nothing(served: Served) -> None:
    page = served.get("/")
    assert page.status == 200
    policy = page.headers["Content-Security-Policy"]
    assert "default-src 'none'" in policy
    assert "unsafe-eval" not in policy
    assert "'unsafe-inline'" not in policy.partition("script-src")[2].partition(";")[0]
    assert "http" not in policy
    assert b"rover live" in page.read()
    for path in ("/../pyproject.toml", "/%2e%2e/viser/__init__.py", "/assets", "/live.js"):
        assert served.get(path).status == 404
    assert served.get("/?x=1", "localhost").status == 200


def test_nothing_but_the_drive_opens_a_connection(served: Served) -> None:
    with pytest.raises(InvalidStatus, match="404"):
        served.page("/")


def test_a_port_in_use_is_named(served: Served, tmp_path: Path) -> None:
    choices = LiveChoices()
    loop = LiveLoop(LiveRover(LiveScene(), choices), tmp_path)
    with pytest.raises(OptionError, match=f"port: is in use by another program.*{served.port}"):
        LiveServer(loop, choices, port=served.port)
    assert served.get("/").status == 200
    loop.stop()


@pytest.mark.parametrize(
    ("host", "port", "field"), [("no.such.host.invalid", 0, "host"), ("127.0.0.1", 99_999, "port")]
)
def test_a_place_that_is_none_is_named(tmp_path: Path, host: str, port: int, field: str) -> None:
    choices = LiveChoices()
    loop = LiveLoop(LiveRover(LiveScene(), choices), tmp_path)
    with refused(OptionError, field):
        LiveServer(loop, choices, host=host, port=port)
    loop.stop()


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux has more than one address of its own")
def test_other_machines_are_refused_unless_asked_in(served: Served, tmp_path: Path) -> None:
    """127.0.0.2 stands for an address that other machines reach: the server listens at its own address only."""
    with pytest.raises(ConnectionRefusedError):
        socket.create_connection(("127.0.0.2", served.port), timeout=5.0)
    loop = LiveLoop(LiveRover(), tmp_path)
    server = LiveServer(loop, LiveChoices(), host="0.0.0.0", port=0)  # noqa: S104 - as `--host 0.0.0.0`
    port = urlsplit(server.address).port or 0
    with client.connect(f"ws://127.0.0.2:{port}/live", origin=f"http://127.0.0.2:{port}") as page:
        assert heard(page, "choices")
    loop.stop()
    server.stop()


def pictures(page: Any, seconds: float) -> list[bytes]:
    """The binary messages of a while."""
    end, found = time.monotonic() + seconds, []
    while time.monotonic() < end:
        message = page.recv(timeout=20.0)
        if isinstance(message, bytes):
            found.append(message)
    return found


def test_a_page_that_watches_gets_the_scene_once_and_then_frames(served: Served) -> None:
    with served.page() as page:
        say(page, do="state")  # no such command: the page hears an error, and no picture
        page.send('{"do":"watch"}')
        first, *frames = pictures(page, 2.0)
    kind, number, _ = HEAD.unpack(first[: HEAD.size])
    assert (kind, number) == (SCENE, 1)
    length = int.from_bytes(first[HEAD.size : HEAD.size + 4], "little")
    head = json.loads(first[HEAD.size + 4 : HEAD.size + 4 + length])
    size = sum(channel["count"] * channel["width"] * channel["bytes"] for channel in head["channels"])
    moving = ["places", "turns", "centre", "forces", "normals", "mass", "friction", "laser", "depth"]
    assert [channel["name"] for channel in head["channels"]] == moving
    assert set(head["missing"]) == {"scan", "plan"}
    assert len(frames) > 10
    assert {len(frame) for frame in frames} == {HEAD.size + size}
    assert {HEAD.unpack(frame[: HEAD.size])[:2] for frame in frames} == {(FRAME, 1)}
    times = [HEAD.unpack(frame[: HEAD.size])[2] for frame in frames]
    assert times == sorted(times)
    assert size < 4000


@pytest.mark.nightly("tests/live/test_live_server.py::test_a_page_that_watches_gets_the_scene_once_and_then_frames")
def test_another_ground_is_another_scene(served: Served) -> None:
    with served.page() as page:
        page.send('{"do":"watch"}')
        assert pictures(page, 1.0)
        say(page, do="change", name="ground", value="rocks")
        kinds = [HEAD.unpack(message[: HEAD.size])[:2] for message in pictures(page, 4.0)]
    assert (SCENE, 2) in kinds
    assert kinds[-1] == (FRAME, 2)


def test_a_scene_that_cannot_be_shown_is_told_and_the_drive_goes_on(
    served: Served, monkeypatch: pytest.MonkeyPatch
) -> None:
    def broken(*_: object) -> None:
        raise ZeroDivisionError("of the test")

    monkeypatch.setattr(served.server.view, "follow", broken)
    with served.page() as page:
        page.send('{"do":"watch"}')
        notice = heard(page, "state", lambda state: state["notice"] != "")["notice"]
        assert notice == "the scene is shown no further: ZeroDivisionError: of the test"
        at = served.loop.state.time
        assert heard(page, "state", lambda state: state["time"] > at)
