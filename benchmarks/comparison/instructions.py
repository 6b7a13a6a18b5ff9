"""Instructions of a step, which no other program disturbs: `python -m comparison.instructions` (`make instructions`).

callgrind counts a short and a long run of some programs of `rust/comparison/examples/`; the difference belongs to the
steps. The counts are compared with those of `instructions.json` and may differ by `TOLERANCE`; `--save` writes that
file. They are those of one compiler. A processor under valgrind has no AVX-512, so lanes are AVX2's.
"""

import argparse
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import NamedTuple

from rich.console import Console
from rich.table import Table

ROOT = Path(__file__).parents[2]
COUNTS = Path(__file__).with_name("instructions.json")
#: Relative; another version of the C library changes less.
TOLERANCE = 0.01


class Scene(NamedTuple):
    """A program that takes steps.

    Attributes:
        example: Its name.
        after: Arguments behind the number of steps.
        short: Steps of the short run.
        long: Steps of the long run.
        rovers: Rovers that take each step.
    """

    example: str
    after: tuple[str, ...]
    short: int
    long: int
    rovers: int = 1


#: Rovers of a batch.
BATCH = 8
#: Grounds and wheels of the table of speeds.
GROUNDS = ("plane", "rocks", "hills, cells 0.25 m", "hills, cells 0.05 m")
WHEELS = ("wheels 0.20 m", "cylinders", "rigid cylinders", "tori")


def alone_and_in_batch(scenes: dict[str, tuple[str, tuple[str, ...]]]) -> dict[str, Scene]:
    """Scenes by name with their example and its arguments for one rover, and the same for a batch."""
    alone = {name: Scene(example, after, 10, 210) for name, (example, after) in scenes.items()}
    batches = {
        f"{name}, batch": Scene(
            one.example, (*(word for word in one.after if word != "alone"), "batch"), 10, 110, BATCH
        )
        for name, one in alone.items()
    }
    return alone | batches


SCENES = {
    "rover in a curve": Scene("drive_steps", (), 1, 1001),
    "rover in a curve, Newton": Scene("drive_steps", ("newton",), 1, 301),
    **alone_and_in_batch(
        {f"{g}, {w}": ("explore_steps", (f"{g}, {w}", "alone")) for g in GROUNDS for w in WHEELS}
        | {"six wheels and a differential": ("machine_steps", ("open-rover", "alone"))}
        | {f"sand, {how}": ("sand_steps", (how,)) for how in ("rest", "drive", "explore")}
    ),
    "bed of disks": Scene("disk_steps", (), 1, 101),
    "derivatives in sand": Scene("sand_steps", ("derivatives",), 10, 50),
    "derivatives on firm ground": Scene("sand_steps", ("derivatives-on-firm-ground",), 10, 50),
    "two rovers with a hitch": Scene("machine_steps", ("tow", "alone"), 10, 210),
}
#: Machines of `machine_steps` in the tables of the decisions 20 and 32, and how many are stepped with all effort, alone
#: and in a batch.
MACHINES = (
    "rover", "flying", "turning", "mecanum", "tracks", "open-rover", "bar", "dry", "open-dry",
    "two", "three", "push", "tow",
)  # fmt: skip
EFFORTS = {"general": 1, "alone": 1, "batch": BATCH}


def of_machine(name: str, how: str) -> str:
    """Thousands of instructions a step and a rover; a dash where valgrind lacks an instruction."""
    count = collected_between(Scene("machine_steps", (name, how), 10, 210, EFFORTS[how]))
    return f"{count / 1000:.0f}" if count else "-"


def collected(scene: Scene, steps: int) -> int:
    """Instructions of one run."""
    program = ROOT / os.environ.get("CARGO_TARGET_DIR", "target") / "release" / "examples" / scene.example
    with tempfile.TemporaryDirectory() as folder:
        done = subprocess.run(
            ["valgrind", "--tool=callgrind", f"--callgrind-out-file={folder}/out", program, str(steps), *scene.after],  # noqa: S607
            check=True,
            capture_output=True,
            text=True,
        )
    (found,) = re.findall(r"Collected : (\d+)", done.stderr)
    return int(found)


def collected_between(scene: Scene) -> int | None:
    """Instructions of a step and a rover; None where valgrind lacks an instruction."""
    steps = (scene.long - scene.short) * scene.rovers
    try:
        return round((collected(scene, scene.long) - collected(scene, scene.short)) / steps)
    except subprocess.CalledProcessError as error:
        if error.returncode != -signal.SIGILL:
            raise
        return None


def build() -> None:
    """Compiles the programs."""
    examples = sorted({scene.example for scene in SCENES.values()})
    command = ["cargo", "build", "--release", "--quiet", "--locked", "-p", "rover-comparison"]
    subprocess.run([*command, *(word for one in examples for word in ("--example", one))], cwd=ROOT, check=True)


def compiler() -> str:
    """Version of the compiler, such as `1.95.0`."""
    told = subprocess.run(["rustc", "--version"], check=True, capture_output=True, text=True).stdout  # noqa: S607
    return told.split()[1]


def changes(before: dict[str, int | None], now: dict[str, int | None]) -> list[str]:
    """Names of the scenes whose counts differ by more than the tolerance, or that only one side has."""
    both = {name: (before[name], now[name]) for name in before.keys() & now.keys()}
    changed = {name for name, (a, b) in both.items() if a and b and abs(b - a) > TOLERANCE * a}
    return sorted(changed | (before.keys() ^ now.keys()))


def main() -> None:
    """Counts and compares."""
    parser = argparse.ArgumentParser(description="Instructions of a step: have they changed?")
    parser.add_argument("--save", action="store_true", help=f"write them to {COUNTS.name}")
    parser.add_argument("--machines", action="store_true", help="print the table of the machines instead")
    arguments = parser.parse_args()
    if shutil.which("valgrind") is None:
        sys.exit("valgrind is not installed")
    build()
    console = Console(width=100, highlight=False)
    if arguments.machines:
        console.print(f"| machine | {' | '.join(EFFORTS)} |\n|---|---|---|---|")
        for name in MACHINES:
            console.print(f"| `{name}` | {' | '.join(of_machine(name, how) for how in EFFORTS)} |")
        return
    rustc = compiler()
    with ThreadPoolExecutor() as pool:
        now = dict(zip(SCENES, pool.map(collected_between, SCENES.values()), strict=True))
    before = json.loads(COUNTS.read_text(encoding="utf-8")) if COUNTS.exists() else {"rustc": rustc, "a step": {}}
    table = Table("scene", "instructions a step and rover", "committed", "change")
    for name, count in now.items():
        known = before["a step"].get(name)
        change = f"{100 * (count / known - 1):+.2f}%" if count and known else ""
        table.add_row(name, str(count or "-"), str(known or ""), change)
    console.print(table)
    if arguments.save:
        COUNTS.write_text(json.dumps({"rustc": rustc, "a step": now}, indent=1) + "\n", encoding="utf-8")
        return
    if before["rustc"] != rustc:
        sys.exit(f"the committed counts are of rustc {before['rustc']}, and this is {rustc}")
    if changed := changes(before["a step"], now):
        sys.exit(f"changed by more than {100 * TOLERANCE:g}%: {', '.join(changed)}; `--save` commits new counts")


if __name__ == "__main__":
    main()
