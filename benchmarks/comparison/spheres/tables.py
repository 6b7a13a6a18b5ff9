"""The tables of `docs/tables/comparison.md` that are made from `spheres.json`."""

from dataclasses import dataclass
from typing import Any

from reports import measured, table


@dataclass(frozen=True)
class Error:
    """What is measured in a scene: its key in the results, and its name with the unit."""

    key: str
    label: str


_ENERGY = Error("energy_error", "(E - E0)², J²")
_VELOCITY = Error("velocity_error", "squared velocity error, m²/s²")
ERRORS = {
    "666": Error("penetration", "sum of penetration², m²"),
    "elastic 666": _ENERGY,
    "bouncing": _ENERGY,
    "rolling, along x": _VELOCITY,
    "rolling, along z": _VELOCITY,
    "rolling, diagonal": _VELOCITY,
}
#: SimBenchmark's figures at 1 ms: error in the scene's unit and, where given, us a step. Their machine, not this one.
PUBLISHED: dict[str, dict[str, tuple[float, float | None]]] = {
    "666": {
        "RaiSim": (1.35e-4, 151),
        "Bullet": (0.38, 1198),
        "ODE": (1.6e-4, 1058),
        "MuJoCo": (0.095, 1206),
        "DART": (2.8e-4, 2292),
    },
    "elastic 666": {"RaiSim": (8.4, None), "Bullet": (4.1e4, None), "ODE": (112.0, None), "DART": (3.5e5, None)},
    "bouncing": {"RaiSim": (1.9e-2, None), "Bullet": (7.5e4, None), "ODE": (185.0, None), "DART": (7.2e4, None)},
    "rolling, diagonal": {
        "RaiSim": (4e-7, None),
        "Bullet": (6e-9, None),
        "ODE": (3.1, None),
        "MuJoCo": (7e-3, None),
        "DART": (3.1, None),
    },
}


def tables(data: dict[str, Any]) -> str:
    """Markdown of errors and costs."""
    parts = []
    for scene, error in ERRORS.items():
        own = [p for p in data["points"] if p["scene"] == scene]
        steps = sorted({p["step"] for p in own}, reverse=True)
        if not own:
            continue
        lines = []
        for engine, variant in dict.fromkeys((p["engine"], p["variant"]) for p in own if error.key in p):
            row = {p["step"]: p for p in own if (p["engine"], p["variant"]) == (engine, variant)}
            found = [row.get(step, {}) for step in steps]
            cells = [f"{p[error.key]:.1e}, {p['us_per_step']:.0f} us" if error.key in p else "-" for p in found]
            lines.append([f"{engine}, {variant}", *cells])
        for engine, (value, cost) in PUBLISHED.get(scene, {}).items():
            cell = f"{value:.1e}" + (f", {cost:.0f} us" if cost else "")
            lines.append([f"{engine}, *published*", *["-"] * (len(steps) - 1), cell])
        parts.append(f"**{scene}**: {error.label}, and CPU time of a step")
        parts.append(table(["engine", *(f"{1e3 * h:g} ms" for h in steps)], lines))
    return "\n\n".join([*parts, f"{measured(data['meta'])}."])


#: Scenes of the manual's table: of rolling one direction stands for three.
SHORT = ("666", "elastic 666", "bouncing", "rolling, diagonal")


def short_table(data: dict[str, Any], step: float = 1e-3) -> str:
    """Markdown: the errors at one step, a line an engine and variant and a column a scene."""
    points = [p for p in data["points"] if p["step"] == step]
    lines = []
    for key in dict.fromkeys((p["engine"], p["variant"]) for p in points):
        rows = {p["scene"]: p for p in points if (p["engine"], p["variant"]) == key}
        found = [rows.get(scene, {}).get(ERRORS[scene].key) for scene in SHORT]
        lines.append([", ".join(key), *("-" if error is None else f"{error:.1e}" for error in found)])
    return table(["engine", *(f"{scene}: {ERRORS[scene].label}" for scene in SHORT)], lines)
