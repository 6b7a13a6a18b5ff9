"""The manual: every public name is printed with its docstring, and its pages fit a desk and a phone."""

import importlib
import inspect
import pkgutil
import re
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest
from browser.manual_pages import DOCS, build, printed
from browser.test_replay_page import await_that, messages, resize, start_browser
from PIL import Image
from selenium import webdriver

import rover_gym
from rover_gym import _core, core
from rover_gym.envs.registration import ENVIRONMENTS

pytestmark = pytest.mark.timeout(1200)

WIDTHS = {"desk": 1280, "phone": 390}  # CSS pixels

# Pages of every kind: start, tables, formulas, code, commands, a chapter of the reference.
SAMPLE = (
    "index.html",
    "accuracy.html",
    "notation.html",
    "first-steps.html",
    "tables/comparison.html",
    "api/simulation.html",
)

# What sticks out to the right of the window, but for what can be scrolled by itself within the text.
STICKING_OUT = """
const scrolls = (node) => node.tagName !== "ARTICLE" &&
  (["auto", "scroll"].includes(getComputedStyle(node).overflowX) || scrolls(node.parentElement));
return [...document.querySelectorAll("article *")]
  .filter((node) => node.getBoundingClientRect().right > innerWidth + 1 && !scrolls(node.parentElement))
  .map((node) => node.tagName + "." + node.className + ": " + node.textContent.slice(0, 60)).slice(0, 3);
"""


@pytest.fixture(scope="module")
def manual() -> Path:
    pytest.importorskip("furo", reason="the extra docs is not installed")
    return build()


@pytest.fixture(scope="module")
def texts(manual: Path) -> dict[str, str]:
    return printed(manual)


@pytest.fixture(scope="module")
def browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[webdriver.Chrome]:
    browser = start_browser(tmp_path_factory.mktemp("profile"))
    try:
        yield browser
    finally:
        browser.quit()


def rooms() -> list[ModuleType]:
    """The modules that offer public names."""
    packages = [info.name for info in pkgutil.walk_packages(rover_gym.__path__, "rover_gym.") if info.ispkg]
    names = [name for name in packages if name.count(".") < 3]  # the test beds of grains have their modules on the page
    found = [importlib.import_module(name) for name in names]
    for late in ("models.model_files", "ground.maps.terrain_files"):  # which define methods of compiled classes
        importlib.import_module(f"rover_gym.{late}")
    return [room for room in found if hasattr(room, "__all__")]


def public_names() -> Iterator[tuple[str, Any]]:
    """Full names, as the manual has them, of what the rooms offer, each with the thing itself, members included."""
    for room in rooms():
        for name in room.__all__:
            thing = getattr(room, name)
            is_compiled = getattr(_core, name, None) is thing
            if name.startswith("_") or (is_compiled and room is not core):
                continue
            full = f"{room.__name__}.{name}"
            yield full, thing
            if isinstance(thing, type) and full != "rover_gym.envs.RoverArguments":  # its card has its table
                inherited = {one for base in thing.__mro__[1:] for one in {**vars(base), **data(base)}}
                for member in {**vars(thing), **data(thing)}:
                    if not member.startswith("_") and member not in inherited:
                        # A class as a value has no words here.
                        is_data = member in data(thing)
                        yield f"{full}.{member}", None if is_data else inspect.getattr_static(thing, member, None)


def data(of: type) -> dict[str, Any]:
    """The members that a class annotates itself."""
    return vars(of).get("__annotations__", {})


def letters(text: str) -> str:
    """A text without signs, spaces and markup, for comparison."""
    return re.sub(r"[\W_]+", "", re.sub(r":\w+:`", "", text))


def first_sentence(thing: Any) -> str:
    """The first line of a docstring, where the thing has one of its own."""
    thing = thing.__func__ if isinstance(thing, staticmethod | classmethod) else thing
    documented = isinstance(thing, type) or inspect.isroutine(thing) or inspect.isdatadescriptor(thing)
    line = (inspect.getdoc(thing) or "").split("\n")[0] if documented else ""
    return "" if line.startswith("Alias for field number") else line  # a named tuple's own word


@pytest.mark.takes_long("brings the manual up to date, which `make docs` has built")
def test_every_public_name_is_printed_with_its_docstring(texts: dict[str, str]) -> None:
    expected = dict(public_names())
    assert len(expected) > 900
    missing = [name for name in expected if name not in texts]
    silent = [name for name in expected if name in texts and not texts[name]]
    garbled = [
        name for name, thing in expected.items() if letters(first_sentence(thing)) not in letters(texts.get(name, ""))
    ]
    assert (missing, silent, sorted(set(garbled) - set(missing) - set(silent))) == ([], [], [])


def test_every_argument_of_a_constructor_is_printed(texts: dict[str, str]) -> None:
    missing = []
    for name, thing in public_names():
        if isinstance(thing, type) and name.startswith("rover_gym.core."):
            try:
                arguments = inspect.signature(thing).parameters
            except ValueError:
                continue  # it has no constructor
            missing += [f"{name}({one})" for one in arguments if not re.search(rf"\b{one}\b", texts[name])]
    assert not missing


def test_no_docstring_is_taken_for_a_type(texts: dict[str, str]) -> None:
    assert not [name for name, text in texts.items() if re.search(r"^Type\b", text, flags=re.MULTILINE)]


@pytest.mark.parametrize("device", WIDTHS)
def test_no_page_is_wider_than_the_window(manual: Path, browser: webdriver.Chrome, device: str, whole: bool) -> None:
    pages = sorted(page for page in manual.rglob("*.html") if not page.parts[-2].startswith("_static"))
    assert len(pages) > 40
    if not whole:
        pages = [manual / name for name in SAMPLE]
    resize(browser, WIDTHS[device], 844)
    wide = {}
    for page in pages:
        browser.get(page.as_uri())
        assert browser.execute_script("return innerWidth") == WIDTHS[device]
        if found := browser.execute_script(STICKING_OUT):
            wide[str(page.relative_to(manual))] = found
    assert wide == {}


def test_what_is_wider_than_the_window_is_seen(manual: Path, browser: webdriver.Chrome) -> None:
    browser.get((manual / "glossary.html").as_uri())
    assert browser.execute_script(STICKING_OUT) == []
    browser.execute_script(
        "const wide = document.createElement('p'); wide.textContent = 'wide'; wide.style.width = '3000px';"
        "document.querySelector('article').append(wide);"
    )
    assert browser.execute_script(STICKING_OUT) == ["P.: wide"]


def test_the_start_page_has_four_ways_in(manual: Path, browser: webdriver.Chrome) -> None:
    browser.get((manual / "index.html").as_uri())
    links = browser.execute_script(
        "return [...document.querySelectorAll('.way')].map((way) => [way.querySelector('strong a').href,"
        " way.querySelector('img').naturalWidth]);"
    )
    assert len(links) == len(list((DOCS / "tutorials").glob("*.md"))) == 4
    assert all(width > 0 and Path(link.removeprefix("file://")).is_file() for link, width in links)


def test_the_gallery_shows_every_environment_and_plays_a_drive_when_it_is_opened(
    manual: Path, browser: webdriver.Chrome
) -> None:
    """With `--tier all` it failed: the browser's log still held the pages that the tests before it had visited."""
    asked_for(browser)  # what other tests visited
    browser.get((manual / "gallery.html").as_uri())
    assert asked_for(browser) == set()  # no page is loaded before it is opened
    for name in ENVIRONMENTS:
        shown = f"article img[src$='{name.lower()}.webp']"
        assert len(browser.find_elements("css selector", shown)) == 1
        image = np.asarray(Image.open(manual / f"{name.lower()}.webp"))
        assert image.std(axis=(0, 1)).min() > 10.0
        assert (manual / f"{name.lower()}.webp").stat().st_size < 60_000
        assert 300_000 < (manual / f"gallery-{name.lower()}.html").stat().st_size < 2_000_000
    (summary,) = browser.find_elements("css selector", "details:has(iframe[data-page$='roverrocks-v0.html']) summary")
    browser.execute_script("arguments[0].scrollIntoView(); arguments[0].click();", summary)
    frame = browser.find_element("css selector", "iframe[data-page$='roverrocks-v0.html']")
    browser.switch_to.frame(frame)
    drawn = "return Number(document.querySelector('#root canvas')?.dataset.drawn || 0);"
    await_that(lambda: browser.execute_script(drawn) > 2, "the page in the gallery")
    browser.switch_to.default_content()
    assert asked_for(browser) == {"gallery-roverrocks-v0.html"}


def asked_for(browser: webdriver.Chrome) -> set[str]:
    """The gallery's pages that the browser has asked for since the last call."""
    names = {told["request"]["url"].rpartition("/")[2] for told in messages(browser, "Network.requestWillBeSent")}
    return {name for name in names if name.startswith("gallery-")}
