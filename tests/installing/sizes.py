"""Measures what installations take on disk, and writes it where the README and the manual state it.

python -m installing.sizes            # the base alone
python -m installing.sizes demo train # and with these extras

It installs the wheel of `ROVER_GYM_WHEEL` with Python's own `venv` and `pip`, compiled Python files included, as a user
has it. `make sizes` builds the wheel before.
"""

import re
import subprocess
import sys
import tempfile
from pathlib import Path

from installing.test_wheel import python_of, wheel

ROOT = Path(__file__).parents[2]

#: The pages that state sizes, and what stands before a size of an installation by its extra; "" is the base.
PAGES = ("README.md", "docs/installing.md")


def command_of(extra: str) -> str:
    """The command whose size the pages state."""
    return f"pip install '.[{extra}]'" if extra else "pip install ."


def stated(page: str, extra: str) -> list[str]:
    """The sizes that a page states for an installation."""
    lines = (ROOT / page).read_text(encoding="utf-8").splitlines()
    return [found for line in lines if command_of(extra) in line for found in re.findall(r"[\d.]+ [MG]B", line)[-1:]]


def in_words(size: int) -> str:
    """A size of so many bytes."""
    return f"{size / 1e6:.0f} MB" if size < 1e9 else f"{size / 1e9:.1f} GB"


def measure(extra: str) -> int:
    """Bytes that an installation takes on disk, its environment included."""
    with tempfile.TemporaryDirectory() as place:
        subprocess.run([sys.executable, "-m", "venv", place], check=True)
        wanted = f"rover-gym[{extra}] @ {wheel().as_uri()}" if extra else str(wheel())
        python = python_of(Path(place))
        subprocess.run([str(python), "-m", "pip", "install", "--quiet", wanted], check=True)
        files = (path for path in Path(place).rglob("*") if path.is_file() and not path.is_symlink())
        return sum(path.stat().st_blocks * 512 for path in files)


def write(extra: str, size: str) -> None:
    """Writes a size into the pages that state it."""
    for page in PAGES:
        lines = (ROOT / page).read_text(encoding="utf-8").split("\n")
        for i, line in enumerate(lines):
            if command_of(extra) in line:
                head, found, tail = line.rpartition((re.findall(r"[\d.]+ [MG]B", line) or [""])[-1])
                lines[i] = head + (size if found else "") + tail
        (ROOT / page).write_text("\n".join(lines), encoding="utf-8")


def main() -> None:
    """Measures the base and the extras that are named."""
    for extra in dict.fromkeys(("", *sys.argv[1:])):
        size = in_words(measure(extra))
        write(extra, size)
        print(f"{command_of(extra)}: {size}")  # noqa: T201


if __name__ == "__main__":
    main()
