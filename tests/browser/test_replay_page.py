"""The replay page in a real browser: it loads offline, shows the rover, and synchronises timeline, scene and curves."""

import io
import json
import math
import re
import shutil
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Generic, NamedTuple, TypeVar

import numpy as np
import pytest
from PIL import Image
from recordings import recorded
from rovers import placed, standing
from selenium import webdriver
from selenium.common.exceptions import TimeoutException, WebDriverException
from selenium.webdriver.common.by import By

from rover_gym import HeightField, Plane, RoverModel, Simulation, SphereField, Terrain, Union
from rover_gym.ground.grains import rover_on_disks, settled_disks
from rover_gym.record import DiskRun, RoverRun
from rover_gym.record.saved_runs import open_run, record_run
from rover_gym.show.frames.appearance import GROUND_COLOUR, SKY_COLOUR, TRUNK_COLOUR
from rover_gym.show.replay import write_page
from rover_gym.show.replay.charts import LOAD_TIME
from rover_gym.show.replay.rover_scene import WHEEL_NAMES

R = TypeVar("R")

ROCKS = SphereField([[1.6, 0.0, 0.6], [1.2, 0.05, -1.3], [-0.9, 0.0, 1.3]], [0.25, 0.2, 0.15], Plane())
LOADS = f"wheel load, mean over {LOAD_TIME:g} s (N)"
PEAK = 1e5  # N, of an impact
PATIENCE = 120.0  # s: without a GPU, on a busy machine, a frame takes seconds


class Shown(NamedTuple, Generic[R]):
    """A page that is open, and the run that it should show."""

    browser: webdriver.Chrome
    run: R
    page: Path


def programs() -> tuple[str, str]:
    """Chromium and its driver, or a failure that names the packages: a missing browser must not pass for a test."""
    browser = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
    driver = shutil.which("chromedriver")
    if browser is None or driver is None:
        pytest.fail("the browser test needs Debian's chromium and chromium-driver: sudo apt-get install them")
    return browser, driver


def start_browser(profile: Path) -> webdriver.Chrome:
    binary, driver = programs()
    options = webdriver.ChromeOptions()
    options.binary_location = binary
    for argument in (
        "--headless=new",
        "--no-sandbox",
        "--disable-gpu",
        "--use-angle=swiftshader",
        "--enable-unsafe-swiftshader",
        "--disable-dev-shm-usage",
        "--disable-background-networking",
        "--disable-component-update",
        "--disable-sync",
        "--disable-quic",
        "--disable-extensions",
        "--no-first-run",
        "--hide-scrollbars",
        "--window-size=820,560",
        f"--user-data-dir={profile}",
    ):
        options.add_argument(argument)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL", "performance": "ALL"})
    return webdriver.Chrome(options=options, service=webdriver.ChromeService(driver))


def drive(path: Path, terrain: Terrain = ROCKS) -> RoverRun:
    """Two seconds over a few rocks, or over another ground, at 10 frames a second."""
    sim = placed(Simulation(RoverModel(), terrain), y=0.4) if terrain is ROCKS else standing(RoverModel(), terrain)
    sim.set_wheel_torques(np.full(6, 20.0))
    run = recorded(sim, path, 100, 4)
    run.trajectory["wheel_forces"][62, 0, 0] = PEAK  # between two frames of the page
    return run.resample(10.0)


@pytest.fixture(scope="module")
def shown(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Shown[RoverRun]]:
    folder = tmp_path_factory.mktemp("page")
    with showing(drive(folder / "run.h5"), folder) as shown:
        yield shown


@contextmanager
def showing(run: R, folder: Path) -> Iterator[Shown[R]]:
    """A browser with the page of a run."""
    page = write_page(run, folder / "replay.html")  # type: ignore[arg-type]
    with opened(page, folder / "profile") as browser:
        yield Shown(browser, run, page)


@contextmanager
def opened(page: Path, profile: Path) -> Iterator[webdriver.Chrome]:
    """A browser with the page, its player paused at the start."""
    browser = start_browser(profile)
    try:
        browser.set_page_load_timeout(PATIENCE)
        browser.set_script_timeout(PATIENCE)
        browser.get_log("performance")  # what the browser's own first tab did
        browser.get(page.as_uri())
        await_that(lambda: (slider(browser) or 0.0) > 0.0, "the player, which plays on load")
        go_to(browser, 0.0)  # typing a time pauses it
        yield browser
    finally:
        browser.quit()


def await_that(condition: Callable[[], bool], what: str) -> None:
    end = time.monotonic() + PATIENCE
    while not condition():
        assert time.monotonic() < end, f"{what} did not come within {PATIENCE:g} s"
        time.sleep(0.1)


def slider(browser: webdriver.Chrome) -> float | None:
    """What the timeline says, s."""
    found = browser.find_elements(By.CSS_SELECTOR, "#root [role=slider]")
    return float(found[0].get_attribute("aria-valuenow") or "nan") if found else None


def go_to(browser: webdriver.Chrome, moment: float) -> None:
    """Types a time into the player's field, which pauses it."""
    browser.execute_script(
        "const field = document.getElementById('time'); field.value = arguments[0];"
        "field.dispatchEvent(new Event('input', {bubbles: true}));",
        f"{moment:.3f}",
    )
    await_that(lambda: slider(browser) == pytest.approx(moment, abs=1e-3), f"{moment} s on the timeline")
    frames(browser, 2)


def frames(browser: webdriver.Chrome, n: int) -> None:
    """Waits until the browser has drawn some frames."""
    browser.execute_async_script(
        "const [n, done] = arguments; let left = n;"
        "const tick = () => (left-- > 0 ? requestAnimationFrame(tick) : done()); tick();",
        n,
    )


def picture(browser: webdriver.Chrome) -> np.ndarray:
    """(height, width, 3) what the scene shows, without the buttons over it."""
    browser.execute_script(
        "for (const name of ['tools', 'bar', 'message', 'dials', 'stick'])"
        "  document.getElementById(name)?.style.setProperty('visibility', 'hidden');"
    )
    (canvas, *_) = browser.find_elements(By.CSS_SELECTOR, "#root canvas[data-engine]")
    box = canvas.rect
    end = time.monotonic() + PATIENCE
    while True:
        try:
            png = browser.get_screenshot_as_png()
            break
        except (TimeoutException, WebDriverException):  # the driver waits 10 s for a frame; a busy machine needs more
            if time.monotonic() > end:
                raise
    image = np.asarray(Image.open(io.BytesIO(png)).convert("RGB"), dtype=np.float64)
    x, y, width, height = (round(box[key]) for key in ("x", "y", "width", "height"))
    return image[y : y + height, x : x + width]


def resize(browser: webdriver.Chrome, width: int, height: int) -> None:
    """Gives the page this many CSS pixels."""
    size = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": False}
    browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)


def changed(one: np.ndarray, other: np.ndarray, level: float) -> np.ndarray:
    """The pixels in which two pictures differ by more than a level of 255."""
    return np.abs(one - other).max(axis=-1) > level


def grey(browser: webdriver.Chrome) -> dict[str, str]:
    """The overlays that cannot be chosen, with the reasons."""
    buttons = browser.find_elements(By.CSS_SELECTOR, "#overlays button:disabled")
    return {str(button.get_attribute("data-name")): str(button.get_attribute("title")) for button in buttons}


def headings(browser: webdriver.Chrome) -> list[str]:
    """What stands above the curves."""
    return [node.text for node in browser.find_elements(By.CSS_SELECTOR, "#panel h2")]


def errors(browser: webdriver.Chrome) -> list[str]:
    """What the browser has reported as an error since the last call."""
    return [entry["message"] for entry in browser.get_log("browser") if entry["level"] == "SEVERE"]


def messages(browser: webdriver.Chrome, method: str) -> list[dict[str, Any]]:
    found = [json.loads(entry["message"])["message"] for entry in browser.get_log("performance")]
    return [message["params"] for message in found if message["method"] == method]


def test_the_page_loads_without_errors_and_without_the_network(shown: Shown[RoverRun]) -> None:
    assert_alone(shown)
    assert shown.browser.title == shown.run.title


def assert_alone(shown: Shown[Any]) -> None:
    """The page makes no external request, and the browser reports no error."""
    asked = [params["request"]["url"] for params in messages(shown.browser, "Network.requestWillBeSent")]
    assert shown.page.as_uri() in asked
    inside = ("data:", "blob:", "chrome:", shown.page.as_uri())
    assert [url[:100] for url in asked if not url.startswith(inside)] == []
    assert messages(shown.browser, "Network.webSocketCreated") == []
    assert errors(shown.browser) == []


def test_the_scene_shows_rover_rocks_and_ground_the_right_way_up(shown: Shown[RoverRun]) -> None:
    go_to(shown.browser, 0.0)
    image = picture(shown.browser)
    height, width, _ = image.shape
    assert image.std(axis=(0, 1)).min() > 10.0  # not blank
    red, green, blue = np.moveaxis(image, -1, 0)
    warm = red - blue > 0.5 * 255 * (GROUND_COLOUR[0] - GROUND_COLOUR[2])
    ground = warm & (red > green) & (blue < 0.5 * 255 * (GROUND_COLOUR[2] + SKY_COLOUR[2]))
    assert ground[height // 2 :].mean() > 0.5  # warm below
    assert ground[: height // 12].mean() < 0.5  # sky and haze above
    # Only the trunk is both light and grey; it is in the centre.
    light = (image.min(axis=-1) > 0.5 * 255 * min(TRUNK_COLOUR)) & (np.ptp(image, axis=-1) < 60.0)
    light[: height // 6] = False  # the sky
    rows, columns = np.nonzero(light)
    assert len(rows) > 0.005 * light.size
    assert abs(columns.mean() / width - 0.5) < 0.15
    assert 0.25 < rows.mean() / height < 0.8
    # Its wheels and its shadow are dark, and below it.
    dark = image.max(axis=-1) < 90.0
    assert dark[round(rows.mean()) :].mean() > 0.005


@pytest.mark.nightly("tests/browser/test_replay_page.py::test_the_scene_shows_rover_rocks_and_ground_the_right_way_up")
def test_a_map_lies_under_the_rover_and_no_rock_floats_in_the_sky(tmp_path: Path) -> None:
    """Rocks outside the displayed part of the map floated in the air."""
    field = HeightField.fractal(60.0, 0.25, 0.1, hurst=0.8, craters=0.02, crater_diameter=(1.0, 4.0), seed=3)
    rocks = SphereField.rocks(0.05, field.bounds, 1, ground=field, clear=[[0.0, 0.0, 1.5]])
    with showing(drive(tmp_path / "run.h5", Union([field, rocks])), tmp_path) as shown:
        go_to(shown.browser, 1.0)
        image = picture(shown.browser)
        assert errors(shown.browser) == []
    red, _, blue = np.moveaxis(image, -1, 0)
    height = len(image)
    assert (red > blue + 20.0)[height // 2 :].mean() > 0.5  # the ground
    assert (image.max(axis=-1) < 150.0)[: height // 8].mean() < 0.02  # the sky; a fifth of it was rocks


def test_the_timeline_moves_the_rover(shown: Shown[RoverRun]) -> None:
    go_to(shown.browser, 0.3)
    first = picture(shown.browser)
    again = picture(shown.browser)
    go_to(shown.browser, 1.6)
    later = picture(shown.browser)
    go_to(shown.browser, 0.3)
    back = picture(shown.browser)
    share = changed(later, first, 30.0).mean()
    assert share > 0.05
    assert changed(again, first, 30.0).mean() < 0.1 * share  # paused, it stands still
    assert changed(back, first, 30.0).mean() < 0.1 * share  # and back in time it is as it was


def cursors(browser: webdriver.Chrome) -> list[float]:
    found = browser.find_elements(By.CSS_SELECTOR, "#panel .cursor")
    return [float(cursor.get_attribute("x1") or "nan") for cursor in found]


def shown_load(load: float) -> str:
    """A load, N, as the panel prints it: the page has one decimal, and JavaScript rounds halves up."""
    load = round(float(load), 1)
    return f"{load:.1f}" if abs(load) < 100.0 else str(math.floor(load + 0.5))


def readings(browser: webdriver.Chrome) -> list[list[str]]:
    found = browser.find_elements(By.CSS_SELECTOR, "#panel .legend")
    return [legend.text.split() for legend in found]


def test_the_curves_stand_beside_the_scene_and_follow_the_timeline(shown: Shown[RoverRun]) -> None:
    browser, run = shown.browser, shown.run
    assert headings(browser) == [LOADS, "wheel gap (mm)", "speed (m/s)"]
    assert len(browser.find_elements(By.CSS_SELECTOR, "#panel .curve")) == 13
    (canvas, *_) = browser.find_elements(By.CSS_SELECTOR, "#root canvas[data-engine]")
    panel = browser.find_element(By.ID, "panel")
    assert panel.rect["x"] >= canvas.rect["x"] + canvas.rect["width"] - 1.0

    loads = run.mean(lambda run: run.trajectory["wheel_forces"][:, :, 0], LOAD_TIME)
    positions = []
    for row in (5, 15):
        go_to(browser, float(run.time[row] - run.time[0]) + 0.01)
        await_that(lambda row=row: f"{run.time[row] + 0.01:.2f} s of" in panel.text, "the panel's clock")
        positions.append(cursors(browser))
        pairs = zip(run.model.wheel_names, np.round(loads[row]), strict=True)
        expected = [word for name, load in pairs for word in (*WHEEL_NAMES[name].split(), shown_load(load))]
        assert readings(browser)[0] == expected
    assert len(positions[0]) == 3
    # One impact must not flatten the other curves: the axis ends below it and notes that.
    peak = browser.find_element(By.CSS_SELECTOR, "#panel .peak").text
    assert peak == f"beyond the scale: peak {float(f'{loads.max():.3g}'):g} N"
    curves = browser.find_elements(By.CSS_SELECTOR, "#panel .curve")[:6]
    heights = [float(y) for curve in curves for y in re.findall(r"[\d.]+ ([\d.]+)", curve.get_attribute("d") or "")]
    assert min(heights) == pytest.approx(6.0, abs=0.1)  # the top
    assert np.mean(np.array(heights) < 130.0) > 0.5  # the rest stands clear of the axis, which lies at 160
    assert positions[1][0] - positions[0][0] == pytest.approx(0.5 * (330 - 42 - 6), abs=2.0)  # half of the axis


def click_halfway(browser: webdriver.Chrome, run: Any) -> None:
    """Clicks on the middle of a chart, which goes to the time there."""
    chart = browser.find_element(By.CSS_SELECTOR, "#panel svg")
    browser.execute_script(
        "const box = arguments[0].getBoundingClientRect();"
        "const at = {bubbles: true, clientX: box.x + box.width / 2, clientY: box.y + box.height / 2};"
        "arguments[0].dispatchEvent(new MouseEvent('click', at));",
        chart,
    )
    middle = (165 - 42) / (330 - 42 - 6) * float(run.time[-1] - run.time[0])
    await_that(lambda: slider(browser) == pytest.approx(middle, abs=0.02), "the time that was clicked on")


def test_a_click_on_a_curve_goes_to_that_time(shown: Shown[RoverRun]) -> None:
    go_to(shown.browser, 0.2)
    click_halfway(shown.browser, shown.run)


@pytest.mark.nightly("tests/browser/test_replay_page.py::test_the_timeline_moves_the_rover")
def test_it_plays(shown: Shown[RoverRun]) -> None:
    go_to(shown.browser, 0.2)
    # One button starts and stops, and a slow browser may not have stopped yet.
    play(shown.browser)
    if not moves(shown.browser, 20.0):
        play(shown.browser)
        assert moves(shown.browser, PATIENCE)
    go_to(shown.browser, 0.0)


@pytest.mark.nightly("tests/browser/test_replay_page.py::test_the_timeline_moves_the_rover")
def test_a_page_left_playing_holds_no_more_after_several_loops(shown: Shown[RoverRun]) -> None:
    """The page slowed down with every loop."""
    browser = shown.browser
    held = "return document.querySelector('#root canvas').dataset.held;"
    go_to(browser, 0.1)
    before = browser.execute_script(held)
    browser.execute_script("document.getElementById('speed').value = '4';")
    play(browser)
    for _ in range(3):
        await_that(lambda: (slider(browser) or 0.0) > 1.2, "the second half")
        await_that(lambda: (slider(browser) or 0.0) < 0.8, "the next loop")
    assert browser.execute_script(held) == before
    browser.execute_script("document.getElementById('speed').value = '1';")
    go_to(browser, 0.0)


def play(browser: webdriver.Chrome) -> None:
    browser.execute_script("document.getElementById('play').click();")


def moves(browser: webdriver.Chrome, patience: float) -> bool:
    """Whether the time changes while one waits, s."""
    start, end = slider(browser), time.monotonic() + patience
    while time.monotonic() < end:
        if slider(browser) != start:
            return True
        time.sleep(0.1)
    return False


# --- The two-wheel rover on disks


@pytest.fixture(scope="module")
def disks_shown(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Shown[DiskRun]]:
    """Half a second on 150 disks."""
    folder = tmp_path_factory.mktemp("disks")
    bed = settled_disks(150, 2, settle=0.1)
    sim = rover_on_disks(bed)
    sim.set_torques([50.0, 50.0])
    record_run(sim, 0.5, folder / "disks.h5", 20.0, title="the rover on 150 disks")
    with showing(open_run(folder / "disks.h5", DiskRun), folder) as shown:
        yield shown


@pytest.mark.nightly("tests/browser/test_grain_page.py::test_the_page_loads_without_errors_and_without_the_network")
def test_a_page_of_disks_loads_alone_and_shows_rover_and_disks(disks_shown: Shown[DiskRun]) -> None:
    assert_alone(disks_shown)
    browser = disks_shown.browser
    assert browser.title == "the rover on 150 disks"
    assert headings(browser) == [LOADS, "sinkage (mm)", "rim speed minus forward speed (mm/s)"]
    red, green, blue = np.moveaxis(picture(browser), -1, 0)
    assert ((blue > red + 60.0) & (green < blue)).mean() > 0.002  # the body, blue
    assert (np.maximum(red, np.maximum(green, blue)) < 70.0).mean() > 0.002  # the tyres, black
    sand = (blue < 160.0) & (red > blue + 30.0) & (green - blue > 0.45 * (red - blue))  # yellow, darker than paper
    assert sand.mean() > 0.005
    assert np.nonzero(sand)[0].min() > 0.4 * sand.shape[0]  # below


@pytest.mark.nightly("tests/browser/test_grain_page.py::test_the_timeline_moves_balls_and_rover_and_comes_back")
def test_the_timeline_of_disks_moves_disks_chains_and_wheels_and_comes_back(disks_shown: Shown[DiskRun]) -> None:
    browser, run = disks_shown.browser, disks_shown.run
    go_to(browser, 0.0)
    first = picture(browser)
    go_to(browser, 0.5)
    later = picture(browser)
    end = shown_load(run.mean(lambda run: run.wheel_forces[..., 1], LOAD_TIME)[-1, 0])
    await_that(lambda: end in readings(browser)[0], "the load at the end")
    go_to(browser, 0.0)
    back = picture(browser)
    red = [((image[..., 0] > image[..., 1] + 120.0) & (image[..., 2] < 90.0)).sum() for image in (first, later)]
    assert red[1] > red[0]  # no contact had borne anything at the start
    share = changed(coarse(later), coarse(first), 15.0).mean()
    assert share > 0.01
    assert changed(coarse(back), coarse(first), 15.0).mean() < 0.1 * share


def coarse(image: np.ndarray) -> np.ndarray:
    """Means of squares of 8 pixels: the player draws with more or fewer pixels as it finds time."""
    height, width = (8 * (n // 8) for n in image.shape[:2])
    return image[:height, :width].reshape(height // 8, 8, width // 8, 8, 3).mean(axis=(1, 3))


def test_a_missing_browser_is_named_and_fails(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(shutil, "which", lambda _: None)
    with pytest.raises(pytest.fail.Exception, match="chromium and chromium-driver"):
        programs()
