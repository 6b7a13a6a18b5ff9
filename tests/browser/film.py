"""Films a page of the player: the moving picture at the head of the manual, made by `make film`.

python -m browser.film PAGE.html FILM.webp --begin 1 --seconds 8 --preset chase
"""

import argparse
import io
import tempfile
import time
from pathlib import Path

from browser.test_replay_page import resize, start_browser
from PIL import Image
from selenium import webdriver

FPS = 10
QUALITY = 36
SHARPER = 1.5  # pixels drawn along an edge, to one of the film

#: What is in the way of the picture.
BARE = """
for (const name of ["tools", "bar", "message", "panel"]) document.getElementById(name).style.display = "none";
"""


def shown(browser: webdriver.Chrome, moment: float) -> Image.Image:
    """The picture at a moment of the run."""
    drawn = "return Number(document.querySelector('#root canvas').dataset.drawn || 0);"
    before = browser.execute_script(drawn)
    browser.execute_script(
        "const field = document.getElementById('time'); field.value = arguments[0];"
        "field.dispatchEvent(new Event('input', {bubbles: true}));",
        f"{moment:.3f}",
    )
    while browser.execute_script(drawn) <= before:
        time.sleep(0.01)
    return Image.open(io.BytesIO(browser.get_screenshot_as_png())).convert("RGB")


def main() -> None:
    """Films a page."""
    given = argparse.ArgumentParser(description=__doc__)
    given.add_argument("page", type=Path)
    given.add_argument("film", type=Path)
    given.add_argument("--begin", type=float, default=0.0, help="s of the run")
    given.add_argument("--seconds", type=float, default=8.0)
    given.add_argument("--preset", default="orbit")
    given.add_argument("--size", default="560x316")
    options = given.parse_args()
    width, height = (int(number) for number in options.size.split("x"))
    with tempfile.TemporaryDirectory() as profile:
        browser = start_browser(Path(profile))
        resize(browser, round(SHARPER * width), round(SHARPER * height))
        browser.get(options.page.resolve().as_uri())
        while not browser.find_elements("css selector", f"#presets [data-name={options.preset}]"):
            time.sleep(0.1)
        browser.execute_script(BARE)
        browser.execute_script(f"document.querySelector('#presets [data-name={options.preset}]').click();")
        moments = [options.begin + k / FPS for k in range(round(options.seconds * FPS))]
        frames = [shown(browser, moment).resize((width, height), Image.Resampling.LANCZOS) for moment in moments]
        browser.quit()
    options.film.parent.mkdir(parents=True, exist_ok=True)
    film = {"save_all": True, "append_images": frames[1:], "duration": round(1000 / FPS), "loop": 0}
    frames[0].save(options.film, **film, quality=QUALITY, method=6)


if __name__ == "__main__":
    main()
