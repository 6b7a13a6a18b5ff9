"""Where a program writes: into the documentation, or a scratch folder for quick runs."""

import argparse
import shutil
from pathlib import Path

from reports import DOCS, ROOT, TABLES

#: JSON and pictures, and those of a quick run.
CHART = DOCS / "comparison"
QUICK = ROOT / "runs" / "comparison"


def page_of(folder: Path) -> Path:
    """The page whose tables a run fills: the documentation's, or a fresh copy of it for a quick run."""
    page = TABLES / "comparison.md"
    return page if folder == CHART else Path(shutil.copyfile(page, folder.with_suffix(".md")))


def command_line(
    name: str,
    description: str,
    quick: str,
    *,
    cap: float | None = None,
    has_scenes: bool = False,
    flags: dict[str, str] | None = None,
) -> argparse.Namespace:
    """Arguments of a program that measures, or only draws, and as `path` the file with what it measures.

    Args:
        name: Of the file.
        description: Of the program.
        quick: What a quick run is.
        cap: CPU time that a run may take by default, s, where a run may be stopped.
        has_scenes: Whether some scenes can be chosen.
        flags: Further options, with their help.
    """
    parser = argparse.ArgumentParser(description=description)
    parser.add_argument("--quick", action="store_true", help=f"{quick}, under {QUICK}")
    parser.add_argument("--draw", action="store_true", help=f"only draw what {name} has")
    if has_scenes:
        parser.add_argument("--scenes", nargs="*", help=f"only these; the rest is kept as it is in {name}")
    if cap is not None:
        parser.add_argument("--cap", type=float, default=cap, help="CPU time that a run may take, s")
    for flag, text in (flags or {}).items():
        parser.add_argument(f"--{flag}", action="store_true", help=text)
    given = parser.parse_args()
    given.path = (QUICK if given.quick else CHART) / name
    given.path.parent.mkdir(parents=True, exist_ok=True)
    return given
