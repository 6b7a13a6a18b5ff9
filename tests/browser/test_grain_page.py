"""The page of balls in a real browser: it loads offline, shows balls and rover, and a picture costs little script."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from balls import MovingBalls, RoverOnMovingBalls
from browser.test_overlays import KEYS, after
from browser.test_replay_page import (
    LOADS,
    Shown,
    assert_alone,
    await_that,
    changed,
    click_halfway,
    coarse,
    errors,
    go_to,
    grey,
    headings,
    picture,
    play,
    readings,
    showing,
    shown_load,
    slider,
)
from pages import held
from selenium import webdriver

from rover_gym.record import GrainRun
from rover_gym.record.saved_runs import open_run, record_run
from rover_gym.show.frames.appearance import SAND_COLOUR
from rover_gym.show.replay import write_page
from rover_gym.show.replay.charts import LOAD_TIME

# Time of the script for a new sample, on any thread: rebuilt from its differences, and given to the graphics card. In
# units of one addition for each number of the sample, so that the machine and its load count for nothing.
SAMPLE_TIMES = """
const done = arguments[arguments.length - 1];
(async () => {
  const scene = openScene(await unpacked("scene"));
  const frames = new Frames(scene);
  frames.pieces.set(0, await unpacked("piece-0"));
  const gl = document.createElement("canvas").getContext("webgl2");
  gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
  gl.bufferData(gl.ARRAY_BUFFER, 6 * scene.arrays.radii.length, gl.DYNAMIC_DRAW);
  const [sum, other] = [1.0, 2.0].map((x) => new Float32Array(6 * scene.arrays.radii.length).fill(x));
  const [times, additions] = [[], []];
  for (let turn = 0; turn < 5; turn++) {
    frames.at = -1;
    frames.ready.clear();
    for (let k = 0; k < 10; k++) {
      const begin = performance.now();
      gl.bufferSubData(gl.ARRAY_BUFFER, 0, frames.frame(k).balls.data);
      const middle = performance.now();
      for (let pass = 0; pass < 10; pass++) for (let i = 0; i < sum.length; i++) sum[i] += other[i];
      times.push(middle - begin);
      additions.push((performance.now() - middle) / 10.0);
    }
  }
  const median = (own) => own.sort((a, b) => a - b)[25];
  done([median(times), median(additions)]);
})();
"""


@pytest.fixture(scope="module")
def shown(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Shown[GrainRun]]:
    folder = tmp_path_factory.mktemp("grains")
    record_run(RoverOnMovingBalls(), 1.2, folder / "run.h5", 10.0, title="a rover & <balls>")
    with showing(open_run(folder / "run.h5", GrainRun), folder) as shown:
        yield shown


def test_the_page_loads_without_errors_and_without_the_network(shown: Shown[GrainRun]) -> None:
    assert_alone(shown)
    assert shown.browser.title == "a rover & <balls>"


def test_balls_rover_and_sky_are_where_they_belong(shown: Shown[GrainRun]) -> None:
    go_to(shown.browser, 0.2)
    image = picture(shown.browser)
    height, width, _ = image.shape
    red, green, blue = np.moveaxis(image, -1, 0)
    # Sand is yellower than the ground: its green lies farther from its blue.
    sand = (red > green + 15.0) & (green - blue > 0.75 * (red - green)) & (blue < 160.0)
    assert SAND_COLOUR[1] - SAND_COLOUR[2] > 0.75 * (SAND_COLOUR[0] - SAND_COLOUR[1])
    assert sand[height // 2 :].mean() > 0.1
    assert blue[: height // 12].mean() > blue[height // 4].mean() + 20.0  # the haze
    light = (image.min(axis=-1) > 120.0) & (np.ptp(image, axis=-1) < 40.0)
    light[: height // 6] = False
    rows, columns = np.nonzero(light)  # the trunk
    assert len(rows) > 0.005 * light.size
    assert abs(columns.mean() / width - 0.5) < 0.2
    assert 0.25 < rows.mean() / height < 0.7


def test_the_timeline_moves_balls_and_rover_and_comes_back(shown: Shown[GrainRun]) -> None:
    paint(shown.browser, 2)  # balls that move have another colour than balls at rest
    go_to(shown.browser, 0.25)
    first = still(shown.browser)
    go_to(shown.browser, 1.15)
    later = still(shown.browser)
    go_to(shown.browser, 0.25)
    back = still(shown.browser)
    paint(shown.browser, 0)
    share = changed(later, first, 15.0).mean()
    assert share > 0.03
    assert changed(back, first, 15.0).mean() < 0.05 * share


@pytest.mark.parametrize("name", ["forces", "mass", "trails", "loads"])
def test_a_key_shows_an_overlay_among_balls_and_takes_it_away(name: str, shown: Shown[GrainRun]) -> None:
    go_to(shown.browser, 1.0)
    bare = still(shown.browser)
    with_it = after(shown.browser, KEYS[name])
    without = after(shown.browser, KEYS[name])
    pixels = changed(coarse(with_it), bare, 10.0).sum()
    assert pixels > 3
    assert changed(coarse(without), bare, 10.0).sum() < 0.2 * pixels


def test_what_means_nothing_among_balls_is_grey_and_says_why(shown: Shown[GrainRun]) -> None:
    reasons = grey(shown.browser)
    assert reasons.keys() == {"marks", "cones", "plan", "scan", "laser", "depth", "slope", "spheres"}
    assert "balls" in reasons["marks"]


def still(browser: webdriver.Chrome) -> np.ndarray:
    """The picture when it changes no more: in software, on a busy machine, it comes late. Means of squares."""
    browser.execute_script("document.getElementById('message').style.visibility = 'hidden';")
    before = coarse(picture(browser))
    for _ in range(20):
        now = coarse(picture(browser))
        if np.abs(now - before).max() < 1.0:
            return now
        before = now
    raise AssertionError("the picture does not come to rest")


def paint(browser: webdriver.Chrome, number: int) -> None:
    """Chooses the colours of the balls: 0 sand, 1 layers, 2 speed."""
    browser.execute_script(
        "const choice = document.getElementById('paint'); choice.value = arguments[0];"
        "choice.dispatchEvent(new Event('change'));",
        str(number),
    )


def test_layers_show_the_height_at_the_start(shown: Shown[GrainRun]) -> None:
    go_to(shown.browser, 0.2)
    plain = still(shown.browser)
    paint(shown.browser, 1)
    go_to(shown.browser, 0.2)
    layered = still(shown.browser)
    paint(shown.browser, 0)
    assert changed(layered, plain, 15.0).mean() > 0.03


def test_the_curves_follow_the_timeline(shown: Shown[GrainRun]) -> None:
    browser, run = shown.browser, shown.run
    told = [LOADS, "sinkage (mm)", "energy (J)", "contacts (1)", "deepest overlap (% of a radius)"]
    assert headings(browser) == told
    go_to(browser, float(run.time[7]) + 0.01)
    loads = run.mean(lambda run: run.wheel_forces[..., 1], LOAD_TIME)[7]
    pairs = zip(run.model.wheel_names, loads, strict=True)
    expected = [word for name, load in pairs for word in (name, shown_load(load))]
    await_that(lambda: readings(browser)[0] == expected, "the loads at that time")
    click_halfway(browser, run)


@pytest.mark.nightly("tests/browser/test_grain_page.py::test_the_timeline_moves_balls_and_rover_and_comes_back")
def test_it_plays_and_the_wheel_of_the_mouse_zooms(shown: Shown[GrainRun]) -> None:
    browser = shown.browser
    go_to(browser, 0.1)
    play(browser)
    await_that(lambda: (slider(browser) or 0.0) > 0.3, "a later time")
    go_to(browser, 0.1)
    far = still(browser)
    browser.execute_script(
        "const turn = new WheelEvent('wheel', {deltaY: -400, cancelable: true});"
        "document.querySelector('#root canvas').dispatchEvent(turn);"
    )
    go_to(browser, 0.1)
    near = still(browser)
    assert changed(near, far, 15.0).mean() > 0.1


@pytest.mark.nightly("tests/browser/test_grain_page.py::test_the_page_holds_the_places_of_every_sample")
def test_twenty_thousand_balls_cost_the_script_little(tmp_path: Path) -> None:
    """It took longer than a frame of 17 ms; as some additions a number it is 0.6 ms, of 50 000 balls less than 3."""
    record_run(MovingBalls((50, 10, 40), 0.01, 0.5), 0.4, tmp_path / "run.h5")
    with showing(open_run(tmp_path / "run.h5"), tmp_path) as shown:
        took, addition = shown.browser.execute_async_script(SAMPLE_TIMES)
        assert errors(shown.browser) == []
    assert 0.0 < took < 15.0 * addition  # 5 where nothing else runs


def test_the_page_holds_the_places_of_every_sample(tmp_path: Path) -> None:
    record_run(MovingBalls((12, 4, 8), moving=0.6), 2.4, tmp_path / "run.h5")
    run = open_run(tmp_path / "run.h5")
    page = held(write_page(run, tmp_path / "replay.html"))
    assert len(page.pieces) == 3
    (channel,) = [channel for channel in page.head["channels"] if channel["name"] == "balls"]
    assert np.abs(page.values("balls") - run.positions).max() <= 0.51 * max(channel["step"]) + 1e-6
