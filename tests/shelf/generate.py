"""Makes the shelf's data: ``PYTHONPATH=tests python -m shelf.generate [part of a name]``."""

import sys
from pathlib import Path

from shelf.piles import Scene, pile

DATA = Path(__file__).parent / "data"

PILES = {
    "stones_100": Scene("stones", 32, 100, disorder=0.2),
    "stones_250": Scene("stones", 72, 250, disorder=0.2),
    "stones_460": Scene("stones", 125, 460, disorder=0.2),
    "stones_460_slow": Scene("stones", 125, 460, disorder=0.2, seed=2),
    "logs_100": Scene("logs", 46, 100, tipping=0.3, disorder=0.2),
    "logs_250": Scene("logs", 106, 250, tipping=0.3, disorder=0.2),
    "logs_460": Scene("logs", 185, 460, tipping=0.3, disorder=0.2),
}


def main(wanted: str = "") -> None:
    """Writes every problem whose name holds `wanted`."""
    DATA.mkdir(exist_ok=True)
    for name, scene in PILES.items():
        if wanted in name:
            pile(scene).save(DATA / f"{name}.npz")
            print(name, flush=True)


if __name__ == "__main__":
    main(*sys.argv[1:])
