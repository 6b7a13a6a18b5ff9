"""Packs what `rover report --figures` draws beside our run into the package's data.

    python tests/golden/pack_section_6_1.py

Takes the report's figures 6.2 to 6.5 (kept in the figures' own units) and, from the Siconos runs, what the same
figures show: the trunk's position, the gaps and the steering angles.
"""

import json
from pathlib import Path

GOLDEN = Path(__file__).parent
PACKED = GOLDEN.parent.parent / "envs" / "rover_gym" / "data" / "section_6_1.json"

STEERING = [7, 8, 12, 13, 17, 18]  # indices in the report's q, wheels FL, FR, ML, BL, MR, BR
PUBLISHED = ("fig_6_2_wheel_traces", "fig_6_3_gaps", "fig_6_4_reaction", "fig_6_5_steering")


def pack() -> str:
    """The packed data as JSON text."""
    figures = json.loads((GOLDEN / "report_figures.json").read_text(encoding="utf-8"))
    packed = {
        "meta": {
            "what": "Curves to draw beside the run of the report's section 6.1.",
            "generator": "tests/golden/pack_section_6_1.py",
            "published": figures["meta"],
        },
        "published": {name: figures[name] for name in PUBLISHED},
        "siconos": [_siconos(name) for name in ("siconos_plane_h5ms", "siconos_plane_h200us")],
    }
    return json.dumps(packed, separators=(",", ":")) + "\n"


def _siconos(name: str) -> dict[str, object]:
    run = json.loads((GOLDEN / f"{name}.json").read_text(encoding="utf-8"))
    every = 2 if name.endswith("5ms") else 1  # both every 50 ms
    return {
        "computed_with": run["meta"]["computed_with"],
        "step": run["meta"]["step"],
        "t": run["t"][::every],
        "trunk": [_rounded(q[:3]) for q in run["q"][::every]],
        "gap": [_rounded(gap) for gap in run["gap"][::every]],
        "steering": [_rounded([q[i] for i in STEERING]) for q in run["q"][::every]],
    }


def _rounded(values: list[float]) -> list[float]:
    return [round(value, 7) for value in values]


if __name__ == "__main__":
    PACKED.write_text(pack(), encoding="utf-8")
