"""Counts the pictures that a page draws without a graphics card: `make pace`.

Each scene plays in Chromium with a page of 820 x 560. Pictures a second depend on what else the machine does; the
processor time of the browser for a picture hardly does, and with two free cores the one follows from the other.

python -m browser.pace --seconds 8
"""

import argparse
import os
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from browser.test_grain_page import MovingBalls
from browser.test_replay_page import resize, start_browser
from rich.console import Console
from rich.table import Table
from rovers import standing

from rover_gym import Plane, RoverModel, SphereField, Terrain
from rover_gym.record import read_run
from rover_gym.record.saved_runs import open_run, record_run
from rover_gym.show.replay import write_page

SIZE = 820, 560
TICKS = os.sysconf("SC_CLK_TCK")


def driven(folder: Path, terrain: Terrain, name: str) -> Path:
    """The page of a rover that drives straight on for ten seconds."""
    sim = standing(RoverModel(), terrain)
    sim.set_wheel_torques(np.full(6, 15.0))
    record_run(sim, 10.0, folder / f"{name}.h5", 25.0)
    return write_page(read_run(folder / f"{name}.h5"), folder / f"{name}.html")


def plane(folder: Path) -> Path:
    """A rover on level ground."""
    return driven(folder, Plane(), "plane")


def rocks(folder: Path) -> Path:
    """A rover among 2600 rocks."""
    field = SphereField.rocks(
        0.1, (-13.0, -13.0, 27.0, 13.0), 1, min_diameter=0.06, max_diameter=0.4, clear=[[0.0, 0.0, 1.5]]
    )
    nearest = np.argsort(np.linalg.norm(np.asarray(field.centres), axis=1))[:2600]
    return driven(
        folder, SphereField(np.asarray(field.centres)[nearest], np.asarray(field.radii)[nearest], Plane()), "rocks"
    )


def balls(folder: Path) -> Path:
    """20 000 balls, which all move."""
    record_run(MovingBalls((50, 10, 40), 0.01, 0.5), 4.0, folder / "balls.h5")
    return write_page(open_run(folder / "balls.h5"), folder / "balls.html")


SCENES: dict[str, Callable[[Path], Path]] = {"plane": plane, "rocks": rocks, "balls": balls}


def processor_time(root: int) -> float:
    """Processor time of a process and of all below it, s."""
    parents, times = {}, {}
    for entry in Path("/proc").glob("[0-9]*/stat"):
        try:
            text = entry.read_text(encoding="utf-8")
        except OSError:
            continue  # it has ended
        fields = text.rpartition(")")[2].split()
        pid = int(entry.parent.name)
        parents[pid], times[pid] = int(fields[1]), (int(fields[11]) + int(fields[12])) / TICKS

    def is_below(pid: int) -> bool:
        while pid in parents:
            if pid == root:
                return True
            pid = parents[pid]
        return False

    return sum(time for pid, time in times.items() if is_below(pid))


def pace(page: Path, seconds: float) -> tuple[float, float, float]:
    """Pictures a second, processor time and script time of a picture, s."""
    with tempfile.TemporaryDirectory() as profile:
        browser = start_browser(Path(profile))
        try:
            resize(browser, *SIZE)
            browser.get(page.as_uri())
            script = "return Number(document.querySelector('#root canvas').dataset[arguments[0]] || 0);"
            while browser.execute_script(script, "drawn") < 5:  # shaders are compiled, the first pieces unpacked
                time.sleep(0.2)
            time.sleep(1.0)
            root = browser.service.process.pid
            first, begin, used = browser.execute_script(script, "drawn"), time.monotonic(), processor_time(root)
            time.sleep(seconds)
            n = browser.execute_script(script, "drawn") - first
            took, cost = time.monotonic() - begin, processor_time(root) - used
            return n / took, cost / max(1, n), 1e-3 * browser.execute_script(script, "script")
        finally:
            browser.quit()


def main() -> None:
    """Prints a table of the scenes."""
    given = argparse.ArgumentParser(description=__doc__)
    given.add_argument("scenes", nargs="*", default=list(SCENES))
    given.add_argument("--seconds", type=float, default=8.0)
    options = given.parse_args()
    table = Table("scene", "pictures a second", "processor time a picture, ms", "script, ms")
    with tempfile.TemporaryDirectory() as folder:
        for name in options.scenes:
            rate, cost, script = pace(SCENES[name](Path(folder)), options.seconds)
            table.add_row(name, f"{rate:.1f}", f"{1e3 * cost:.0f}", f"{1e3 * script:.1f}")
    Console().print(table)


if __name__ == "__main__":
    main()
