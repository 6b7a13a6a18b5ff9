"""The tables of `docs/tables/comparison.md` that are made from `spheres.json`."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from comparison.output import between

BEGIN, END = "<!-- spheres: made by `make chart`, not by hand -->", "<!-- end of spheres -->"


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
    lines = []
    for scene, error in ERRORS.items():
        own = [p for p in data["points"] if p["scene"] == scene]
        steps = sorted({p["step"] for p in own}, reverse=True)
        if not own:
            continue
        lines += [
            f"**{scene}**: {error.label}, and CPU time of a step",
            "",
            "| engine | " + " | ".join(f"{1e3 * h:g} ms" for h in steps) + " |",
            "|---" * (len(steps) + 1) + "|",
        ]
        for engine, variant in dict.fromkeys((p["engine"], p["variant"]) for p in own):
            row = {p["step"]: p for p in own if (p["engine"], p["variant"]) == (engine, variant)}
            if not any(error.key in p for p in row.values()):
                continue
            cells = [
                f"{p[error.key]:.1e}, {p['us_per_step']:.0f} us" if error.key in p else "-"
                for p in (row.get(h, {}) for h in steps)
            ]
            lines.append(f"| {engine}, {variant} | " + " | ".join(cells) + " |")
        for engine, (value, cost) in PUBLISHED.get(scene, {}).items():
            cell = f"{value:.1e}" + (f", {cost:.0f} us" if cost else "")
            lines.append(f"| {engine}, *published* | " + "- | " * (len(steps) - 1) + f"{cell} |")
        lines.append("")
    packages = ", ".join(f"{name} {version}" for name, version in data["meta"]["packages"].items())
    lines.append(f"Measured with `make chart` on {data['meta']['processor']}, shared with other work; {packages}.")
    return "\n".join(lines)


def fill(output: Path, data: dict[str, Any]) -> None:
    """Puts the tables between their marks."""
    between(output, BEGIN, END, tables(data))
