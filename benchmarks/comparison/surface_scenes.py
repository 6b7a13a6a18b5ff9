"""Drives over maps, ours beside the peers: `python -m comparison.surface_scenes [--quick]`.

A ball over the inner edges of a flat map and over a sine, and a box at rest, whose true paths are known; the rover over
level ground and hills. Writes `docs/comparison/surfaces.json`, `surfaces.png` and the tables of
`docs/tables/comparison.md` between their marks.
"""

from typing import Any

import numpy as np
from reports import fill, read_json, write_json
from rich.console import Console

from comparison.machine import meta
from comparison.output import command_line, page_of
from comparison.peers import installed
from comparison.surfaces.bodies import measure_edges, measure_rest, measure_wave
from comparison.surfaces.drives import SEEDS, hill_references, measure_hills, measure_level
from comparison.surfaces.tables import tables

STEPS = (5e-3, 2e-3, 1e-3)
#: One file an engine, each with `BODIES`, `ROVERS` and perhaps `ROVERS_ON_BALLS`; ImportError without its engine.
ENGINES = ("our_surfaces", "mujoco_surfaces", "bullet_surfaces", "drake_surfaces")
#: Of the ball over the edges, the ball on the sine, the rover on level ground and on hills, the box, s; of a quick run.
DURATIONS, SHORT = (3.0, 4.0, 4.0, 3.0, 2.0), (1.0, 1.0, 1.0, 0.5, 0.5)


def said(row: dict[str, Any]) -> str:
    """A row in a few words."""
    if "failure" in row:
        return f"{row['failure']}"
    impulse = f", false impulse {row['impulse']:.1e}" if "impulse" in row else ""
    return f"{1e3 * row.get('error', np.nan):.3g} mm{impulse}, {row['cpu_ms_per_s']:.1f} ms/s"


def measure(steps: tuple[float, ...], durations: tuple[float, ...], cap: float, console: Console) -> dict[str, Any]:
    """Every engine in every scene; a run that takes more CPU time than `cap` (s) is left out."""
    found, missing = installed("comparison.surfaces", ENGINES, console)
    points: list[dict[str, Any]] = []

    def keep(scene: str, key: tuple[str, str], step: float, rows: list[dict[str, Any]]) -> None:
        for row in rows:
            points.append({"scene": scene, "engine": key[0], "variant": key[1], "step": step} | row)
            spacing = f"{row['spacing']} m" if row.get("spacing") else "plane" if "spacing" in row else ""
            console.print(f"{scene:<6}{1e3 * step:>3g} ms  {', '.join(key)}, {spacing}: {said(row)}")

    references = hill_references(durations[3], SEEDS if durations is DURATIONS else SEEDS[:1])
    for step in steps:
        for module in found:
            for key, make in module.BODIES.items():
                keep("edges", key, step, measure_edges(make, step, durations[0], cap))
                keep("rest", key, step, measure_rest(make, step, durations[4], cap))
                keep("sine", key, step, measure_wave(make, step, durations[1], cap))
            for variant in module.ROVERS:
                keep("level", (variant.engine, variant.name), step, measure_level(variant, step, durations[2], cap))
            for variant in getattr(module, "ROVERS_ON_BALLS", module.ROVERS):
                row = measure_hills(variant, step, references, cap)
                keep("hills", (variant.engine, variant.name), step, [row])
    about = meta(
        durations_s=durations,
        changes_of_references_m=[change for _, _, change in references.values()],
        missing=[name.removesuffix("_surfaces") for name in missing],
    )
    return {"meta": about, "points": points}


def main() -> None:
    """Measures, draws, fills."""
    given = command_line("surfaces.json", "Drives over maps.", "one step and short scenes", cap=8.0)
    if not given.draw:
        steps, durations = (STEPS[:1], SHORT) if given.quick else (STEPS, DURATIONS)
        write_json(given.path, measure(steps, durations, given.cap, Console(width=140)))
    data = read_json(given.path)
    from comparison.surfaces.drawing import draw  # noqa: PLC0415 - Matplotlib would load before the engines

    draw(data, given.path.with_suffix(".png"))
    fill(page_of(given.path.parent), "surfaces", tables(data))


if __name__ == "__main__":
    main()
