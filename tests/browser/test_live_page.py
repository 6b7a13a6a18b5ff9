"""The page of a live drive in a real browser: keys and sliders reach the rover, and nothing leaves the machine."""

from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
from browser.test_replay_page import (
    PATIENCE,
    await_that,
    changed,
    errors,
    frames,
    grey,
    messages,
    picture,
    start_browser,
)
from selenium import webdriver
from selenium.webdriver.common.by import By

from rover_gym.show.frames.appearance import GROUND_COLOUR
from rover_gym.show.live import LiveChoices, LiveLoop, LiveRover, LiveScene, LiveServer

#: A gamepad of the test's own, as the browser would report one.
GAMEPAD = """
window.pad = {index: 0, connected: true, axes: [0, -1], buttons: []};
navigator.getGamepads = () => [window.pad];
const event = new Event("gamepadconnected");
event.gamepad = window.pad;
window.dispatchEvent(event);
"""
PULLED_OUT = """
navigator.getGamepads = () => [null];
const event = new Event("gamepaddisconnected");
event.gamepad = window.pad;
window.dispatchEvent(event);
"""


class Live(NamedTuple):
    """A drive, and the browser that shows it."""

    browser: webdriver.Chrome
    loop: LiveLoop
    server: LiveServer
    folder: Path


@pytest.fixture(scope="module")
def live(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Live]:
    folder = tmp_path_factory.mktemp("live")
    choices = LiveChoices()
    loop = LiveLoop(LiveRover(LiveScene(goal_distance=30.0), choices), folder)
    server = LiveServer(loop, choices, port=0)
    loop.start()
    browser = start_browser(folder / "profile")
    try:
        browser.set_page_load_timeout(PATIENCE)
        browser.set_script_timeout(PATIENCE)
        browser.get_log("performance")  # what the browser's own first tab did
        browser.get(server.address)
        await_that(lambda: "solver converged" in text(browser, "clock"), "a state")
        # The state comes before the scene is built; tests that came first, as they may, looked at nothing.
        await_that(lambda: browser.find_elements(By.CSS_SELECTOR, "#root canvas[data-drawn]") != [], "a picture")
        yield Live(browser, loop, server, folder)
    finally:
        browser.quit()
        loop.stop()
        server.stop()


def text(browser: webdriver.Chrome, name: str) -> str:
    return browser.find_element(By.ID, name).text


def key(browser: webdriver.Chrome, kind: str, name: str) -> None:
    browser.execute_script(
        "document.body.dispatchEvent(new KeyboardEvent(arguments[0], {key: arguments[1], bubbles: true}));", kind, name
    )


def slide(browser: webdriver.Chrome, name: str, value: float | str) -> None:
    browser.execute_script(
        "const slider = document.getElementById(arguments[0]); slider.value = arguments[1];"
        "for (const kind of ['input', 'change']) slider.dispatchEvent(new Event(kind, {bubbles: true}));",
        name,
        value,
    )


def press(browser: webdriver.Chrome, name: str) -> None:
    browser.execute_script("document.getElementById(arguments[0]).click();", name)


def at_rest(live: Live) -> None:
    await_that(lambda: live.loop.state.speed < 0.05, "rest")


@pytest.mark.takes_long("starts a browser and opens the page that the other tests share")
def test_a_key_moves_the_rover_and_its_release_stops_it(live: Live) -> None:
    at_rest(live)
    key(live.browser, "keydown", "w")
    await_that(lambda: live.loop.state.speed > 0.5, "speed")
    key(live.browser, "keyup", "w")
    at_rest(live)
    heading = live.loop.state.heading
    key(live.browser, "keydown", "ArrowUp")
    key(live.browser, "keydown", "a")
    await_that(lambda: live.loop.state.heading > heading + 0.1, "a turn to the left")
    key(live.browser, "keyup", "a")
    key(live.browser, "keyup", "ArrowUp")
    at_rest(live)


@pytest.mark.nightly("tests/browser/test_live_page.py::test_a_key_moves_the_rover_and_its_release_stops_it")
def test_a_slider_drives_and_stop_stops(live: Live) -> None:
    slide(live.browser, "forward", -0.6)
    await_that(lambda: live.loop.state.speed > 0.3, "speed")
    press(live.browser, "stop")
    at_rest(live)


@pytest.mark.nightly("tests/browser/test_live_page.py::test_a_key_moves_the_rover_and_its_release_stops_it")
def test_a_gamepad_drives_until_it_is_pulled_out(live: Live) -> None:
    live.browser.execute_script(GAMEPAD)
    await_that(lambda: live.loop.state.speed > 0.5, "speed")
    live.browser.execute_script(PULLED_OUT)
    at_rest(live)
    assert text(live.browser, "gamepad") == "gamepad disconnected"


def test_sliders_change_friction_and_gravity(live: Live) -> None:
    slide(live.browser, "friction", 0.2)
    await_that(lambda: live.loop.state.scene.friction == 0.2, "friction")
    slide(live.browser, "gravity", 3.7)
    await_that(lambda: live.loop.state.scene.gravity == 3.7, "gravity")
    slide(live.browser, "friction", 0.7)
    slide(live.browser, "gravity", 9.81)
    await_that(lambda: live.loop.state.scene.gravity == 9.81, "gravity")


def test_it_pauses_steps_goes_back_and_records(live: Live) -> None:
    press(live.browser, "record")
    await_that(lambda: live.loop.state.recording != "", "a recording")
    key(live.browser, "keydown", " ")
    await_that(lambda: live.loop.state.is_paused, "the pause")
    at = live.loop.state.time
    key(live.browser, "keydown", ".")
    await_that(lambda: live.loop.state.time > at, "a step")
    assert live.loop.state.time == pytest.approx(at + 0.05)
    key(live.browser, "keydown", "r")
    await_that(lambda: live.loop.state.time < at - 0.5, "the past")
    await_that(lambda: text(live.browser, "pause") == "go on", "the button's name")
    press(live.browser, "pause")
    await_that(lambda: not live.loop.state.is_paused, "the time")
    press(live.browser, "record")
    await_that(lambda: live.loop.state.recording == "", "the end of the recording")
    assert (live.folder / "live-1.h5").exists()


def test_a_policy_drives_and_a_rock_falls_in_its_way(live: Live) -> None:
    slide(live.browser, "driver", "scan")
    await_that(lambda: live.loop.state.scene.driver == "scan", "the driver")
    distance = live.loop.state.distance_to_goal
    await_that(lambda: live.loop.state.distance_to_goal < distance - 1.0, "the way to the goal")
    world = live.loop.state.world
    key(live.browser, "keydown", "t")
    await_that(lambda: live.loop.state.world > world, "the rock")
    slide(live.browser, "driver", "hand")
    await_that(lambda: live.loop.state.scene.driver == "hand", "the driver")


@pytest.mark.nightly("tests/browser/test_overlays.py::test_a_key_shows_an_overlay_and_takes_it_away")
def test_overlays_show_what_the_rover_sees_and_those_of_a_planner_wait_for_one(live: Live) -> None:
    world = live.loop.state.world
    press(live.browser, "restart")  # away from the rock, which may fill the depth camera's picture
    await_that(lambda: live.loop.state.world > world, "the start")
    at_rest(live)
    await_that(lambda: {"plan", "scan"} == set(grey(live.browser)) - {"spheres"}, "what is grey by hand")
    for letter in "cgzb":
        bare = picture(live.browser)
        key(live.browser, "keydown", letter)
        frames(live.browser, 6)
        # A sensor is asked for with the key, and its picture comes when it comes.
        await_that(lambda: changed(picture(live.browser), bare, 20.0).sum() > 50, letter)  # noqa: B023
        key(live.browser, "keydown", letter)
        frames(live.browser, 6)
    key(live.browser, "keydown", "p")
    said = "return document.getElementById('message').textContent;"  # it is soon hidden again
    await_that(lambda: "choose scan" in live.browser.execute_script(said), "the reason")
    slide(live.browser, "driver", "scan")
    await_that(lambda: not {"plan", "scan"} & set(grey(live.browser)), "plan and scan")
    slide(live.browser, "driver", "hand")
    await_that(lambda: "plan" in grey(live.browser), "the wheel")


def test_text_of_the_drive_is_shown_as_text(live: Live) -> None:
    live.browser.execute_script("document.getElementById('message').style.visibility = '';")  # `picture` hides it
    live.loop.tell("<img src=x onerror='document.title=1'><b id=bold>")
    await_that(lambda: "<b id=bold>" in text(live.browser, "message"), "the notice")
    assert live.browser.find_elements(By.ID, "bold") == []
    assert live.browser.title == "rover, driven by hand"


def test_the_scene_shows_the_ground_and_the_curves_are_drawn(live: Live) -> None:
    image = picture(live.browser)
    red, green, blue = np.moveaxis(image, -1, 0)
    warm = (red > 1.3 * green) & (green > blue)
    assert GROUND_COLOUR[0] > 1.3 * GROUND_COLOUR[1]
    assert warm[image.shape[0] // 2 :].mean() > 0.3
    colours = (
        "return [...document.querySelectorAll('#charts canvas')].map((canvas) => new Set(canvas.getContext('2d')"
        ".getImageData(0, 0, canvas.width, canvas.height).data).size);"
    )
    assert len(live.browser.execute_script(colours)) == 4
    await_that(lambda: min(live.browser.execute_script(colours)) > 10, "curves")


@pytest.mark.nightly("tests/browser/test_live_page.py::test_a_key_moves_the_rover_and_its_release_stops_it")
def test_another_rover_is_named_and_the_camera_comes_nearer(live: Live) -> None:
    """The page did not say which rover drove, and showed a small one from as far away as the large one before it."""
    canvas = live.browser.find_element(By.CSS_SELECTOR, "#root canvas")
    await_that(lambda: text(live.browser, "name") == "rover, driven by hand", "the rover's name")
    before = float(canvas.get_attribute("data-distance") or "nan")
    slide(live.browser, "model", "open-rover")
    await_that(lambda: text(live.browser, "name").startswith("open-rover"), "the other rover's name")
    await_that(lambda: float(canvas.get_attribute("data-distance") or "nan") < 0.7 * before, "a nearer camera")
    slide(live.browser, "model", "rover")
    await_that(lambda: text(live.browser, "name").startswith("rover,"), "the first rover's name")
    at_rest(live)


@pytest.mark.nightly("tests/live/test_live_server.py::test_a_browser_that_vanishes_stops_the_rover_and_frees_the_wheel")
def test_a_second_page_watches_and_may_take_the_wheel(live: Live) -> None:
    first = live.browser.current_window_handle
    live.browser.switch_to.new_window("tab")
    live.browser.get(live.server.address)
    await_that(lambda: "Another page drives" in text(live.browser, "wheel"), "the notice")
    assert not live.browser.find_element(By.ID, "friction").is_enabled()
    live.browser.find_element(By.CSS_SELECTOR, "#wheel button").click()
    await_that(lambda: live.browser.find_element(By.ID, "friction").is_enabled(), "the wheel")
    slide(live.browser, "friction", 0.33)
    await_that(lambda: live.loop.state.scene.friction == 0.33, "friction")
    live.browser.close()
    live.browser.switch_to.window(first)
    await_that(lambda: live.browser.find_element(By.ID, "friction").is_enabled(), "the wheel, which is free again")
    slide(live.browser, "friction", 0.7)
    await_that(lambda: live.loop.state.scene.friction == 0.7, "friction")


@pytest.mark.takes_long("waits for the page that the other tests share")
def test_nothing_leaves_the_machine_and_nothing_fails(live: Live) -> None:
    asked = [params["request"]["url"] for params in messages(live.browser, "Network.requestWillBeSent")]
    asked += [params["url"] for params in messages(live.browser, "Network.webSocketCreated")]
    own = (live.server.address, live.server.address.replace("http", "ws", 1), "data:", "blob:", "chrome:")
    assert any(url.startswith(live.server.address) for url in asked)
    assert [url[:100] for url in asked if not url.startswith(own)] == []
    assert errors(live.browser) == []
