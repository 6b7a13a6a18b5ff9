"""Packs the report's figures 3.2 to 3.5, which `rover report --figures` draws beside our runs, into the package's data.

python tests/golden/pack_chapter_3.py
"""

import json
from pathlib import Path

GOLDEN = Path(__file__).parent
PACKED = GOLDEN.parent.parent / "envs" / "rover_gym" / "data" / "chapter_3.json"


def pack() -> str:
    """The packed data as JSON text."""
    figures = json.loads((GOLDEN / "report_figures.json").read_text(encoding="utf-8"))
    packed = {
        "meta": {
            "what": "Curves to draw beside the runs of the report's chapter 3.",
            "generator": "tests/golden/pack_chapter_3.py",
            "published": figures["meta"],
        },
        "published": {name: value for name, value in figures.items() if name.startswith("fig_3")},
    }
    return json.dumps(packed, separators=(",", ":")) + "\n"


if __name__ == "__main__":
    PACKED.write_text(pack(), encoding="utf-8")
