"""What a training was made of: its command, versions and revision."""

import platform
import subprocess
import sys
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

PACKAGES = ("rover-gym", "numpy", "gymnasium", "stable-baselines3", "torch", "ray")


def provenance() -> dict[str, Any]:
    """The command, machine type, versions of Python and the packages, and revision of the sources."""
    return {
        "command": [Path(sys.argv[0]).name, *sys.argv[1:]],
        "python": platform.python_version(),
        "machine": platform.machine(),
        "versions": {name: found for name in PACKAGES if (found := _version(name)) is not None},
        "revision": revision(),
    }


def revision() -> str | None:
    """The git revision of the sources, with "-dirty" after uncommitted changes; None if no repository holds them."""
    here = Path(__file__)
    git = ["git", "-C", str(here.parent)]
    try:
        # An installed package may lie in the folder of another repository, which does not track it.
        subprocess.run([*git, "ls-files", "--error-unmatch", here.name], check=True, capture_output=True)  # noqa: S603
        head = subprocess.run([*git, "rev-parse", "HEAD"], check=True, capture_output=True, text=True)  # noqa: S603
        changed = subprocess.run([*git, "status", "--porcelain"], check=True, capture_output=True, text=True)  # noqa: S603
    except (OSError, subprocess.CalledProcessError):
        return None
    return head.stdout.strip() + ("-dirty" if changed.stdout.strip() else "")


def _version(name: str) -> str | None:
    try:
        return version(name)
    except PackageNotFoundError:
        return None
