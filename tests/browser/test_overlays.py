"""Overlays of the player in a real browser: a key each, greyed with a reason where a run holds nothing, and a ghost."""

import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from browser.test_replay_page import Shown, await_that, changed, errors, go_to, grey, opened, picture, showing
from selenium import webdriver
from selenium.webdriver.common.by import By
from typer.testing import CliRunner

from rover_gym.cli import app
from rover_gym.record import RoverRun, read_run
from rover_gym.show.replay import write_page
from rover_gym.show.replay.page import player_file

NAMES = ("trails", "forces", "cones", "mass", "plan", "scan", "laser", "depth", "loads", "slope", "spheres")
KEYS = dict(zip(NAMES, "vfcgpxzblhk", strict=True))


OTHER_KEY = pytest.mark.nightly("tests/browser/test_overlays.py::test_a_key_shows_an_overlay_and_takes_it_away")
FEW = {"trails", "forces", "depth", "slope"}
EVERY_KEY = [name if name in FEW else pytest.param(name, marks=OTHER_KEY) for name in KEYS]


def drive(folder: Path, *arguments: str) -> RoverRun:
    given = ["drive", "--time-limit", "1.5", "--seed", "11", "--output", str(folder), *arguments]
    result = CliRunner().invoke(app, given)
    assert result.exit_code == 0, result.output
    return read_run(folder / "episode-11.h5").resample(10.0)


@pytest.fixture(scope="module")
def shown(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Shown[RoverRun]]:
    folder = tmp_path_factory.mktemp("overlays")
    sees = ("--sensor", "laser", "--sensor", "depth")
    run = drive(folder / "run", "--difficulty", "1", "--policy", "scan", *sees)
    with showing(run, folder) as shown:
        go_to(shown.browser, 1.0)
        yield shown


def press(browser: webdriver.Chrome, key: str) -> None:
    browser.execute_script(
        "document.body.dispatchEvent(new KeyboardEvent('keydown', {key: arguments[0], bubbles: true}));", key
    )


def drawn(browser: webdriver.Chrome) -> int:
    (canvas,) = browser.find_elements(By.CSS_SELECTOR, "#root canvas[data-engine]")
    return int(canvas.get_attribute("data-drawn") or 0)


def after(browser: webdriver.Chrome, key: str) -> np.ndarray:
    """The picture after a key."""
    before = drawn(browser)
    press(browser, key)
    await_that(lambda: drawn(browser) > before, f"a picture after {key}")
    return picture(browser)


@pytest.mark.parametrize("name", EVERY_KEY)
def test_a_key_shows_an_overlay_and_takes_it_away(name: str, shown: Shown[RoverRun]) -> None:
    bare = picture(shown.browser)
    with_it = after(shown.browser, KEYS[name])
    without = after(shown.browser, KEYS[name])
    pixels = changed(with_it, bare, 20.0).sum()
    assert pixels > 50
    assert changed(without, bare, 20.0).sum() < 0.2 * pixels


def test_the_help_names_the_key_of_every_overlay_and_escape_closes_it(shown: Shown[RoverRun]) -> None:
    """Escape left the help open."""
    buttons = shown.browser.find_elements(By.CSS_SELECTOR, "#overlays button")
    assert {button.get_attribute("data-name") for button in buttons} == {"marks", *KEYS}
    assert all(button.is_enabled() for button in buttons)
    help_box = shown.browser.find_element(By.ID, "keys")
    press(shown.browser, "?")
    await_that(help_box.is_displayed, "the help")
    told = [node.text for node in help_box.find_elements(By.CSS_SELECTOR, "kbd")]
    assert {key.upper() for key in KEYS.values()} <= set(told)
    press(shown.browser, "Escape")
    await_that(lambda: not help_box.is_displayed(), "a page without its help")


@pytest.mark.parametrize("page", ["recorded.html", "live.html"])
def test_the_help_on_a_touch_screen_is_about_touch(page: str) -> None:
    """A phone showed a list of keys."""
    text = player_file(page)
    (touch,) = re.findall(r'<p data-for="touch">(.*?)</p>', text, flags=re.DOTALL)
    assert "<kbd>" not in touch
    assert "pinch" in touch
    assert "<kbd>" not in re.sub(r'<p data-for="mouse"[^>]*>.*?</p>', "", text, flags=re.DOTALL)


@pytest.mark.nightly("tests/browser/test_overlays.py::test_a_key_shows_an_overlay_and_takes_it_away")
def test_what_a_run_does_not_hold_is_grey_and_says_why_and_a_ghost_drives_along(tmp_path: Path) -> None:
    run = drive(tmp_path / "run")
    ghost = drive(tmp_path / "ghost", "--friction", "0.3", "--goal", "2", "2")
    page = write_page(run, tmp_path / "replay.html", ghost=ghost)
    with opened(page, tmp_path / "profile") as browser:
        go_to(browser, 1.4)
        reasons = grey(browser)
        assert reasons.keys() == {"plan", "scan", "laser", "depth", "spheres"}
        assert all(re.search("run|rocks|recorded", reason) for reason in reasons.values()), reasons
        press(browser, "z")
        message = browser.find_element(By.ID, "message")
        await_that(lambda: "--sensor laser" in (message.text or ""), "the reason")
        dashed = browser.find_elements(By.CSS_SELECTOR, "#panel path.ghost")
        assert len(dashed) == len(browser.find_elements(By.CSS_SELECTOR, "#panel path.curve:not(.ghost)")) > 0
        assert errors(browser) == []
