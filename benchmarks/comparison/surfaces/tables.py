"""The tables of `docs/tables/comparison.md` that are made from `surfaces.json`."""

from collections.abc import Callable
from typing import Any

from reports import left_out, measured, table

from comparison.surfaces.bodies import inner_edges
from comparison.tables import number

Row = dict[str, Any]


def millimetres(length: float) -> str:
    """Two digits, in mm; less than a nanometre is 0."""
    return "0" if length < 1e-9 else number(1e3 * length)


def false_impulse(share: float) -> str:
    """Of the weight's; less than 1e-9 of it counts as none."""
    return "0" if share < 1e-9 else f"{share:.1g}" if share < 0.1 else number(share)


def _edge(row: Row) -> str:
    error = f"{millimetres(row['error'])} ({millimetres(row['from_plane'])})"
    return f"{error}, {false_impulse(row['impulse'])}, {number(row['cpu_ms_per_s'])}"


def _rest(row: Row) -> str:
    cost = number(row["cpu_ms_per_s"])
    return f"{millimetres(row['error'])}, {false_impulse(row['impulse'])}, {cost}, {row['contacts']}"


def _wave(row: Row) -> str:
    return f"{millimetres(row['error'])}, {millimetres(row['from_sine'])}, {number(row['cpu_ms_per_s'])}"


def _level(row: Row) -> str:
    return ("" if row["spacing"] is None else f"{millimetres(row['error'])}, ") + number(row["cpu_ms_per_s"])


def _hills(row: Row) -> str:
    return f"{millimetres(row['error'])} ({millimetres(max(row['errors']))}), {number(row['cpu_ms_per_s'])}"


def _table(points: list[Row], column: str, heads: dict[Any, str], cell: Callable[[Row], str]) -> list[str]:
    """A line an engine and a column a value of `column`; then what is left out, and why."""
    lines = []
    reasons: dict[str, str] = {}
    for key in dict.fromkeys((p["engine"], p["variant"]) for p in points):
        rows = {p[column]: p for p in points if (p["engine"], p["variant"]) == key}
        cells = ["-" if "failure" in rows[value] else cell(rows[value]) for value in heads]
        lines.append([", ".join(key), *cells])
        reasons |= {f"{', '.join(key)}, {heads[v]}": r["failure"] for v, r in rows.items() if "failure" in r}
    parts = [table(["engine", *heads.values()], lines), ""]
    if reasons:
        parts += ["Left out: " + "; ".join(f"{what}: {why}" for what, why in reasons.items()) + ".", ""]
    return parts


def tables(data: dict[str, Any]) -> str:
    """Markdown of errors, false impulses and costs."""
    points = data["points"]
    steps = sorted({p["step"] for p in points}, reverse=True)
    lines: list[str] = []
    cost = "CPU time, ms per simulated second"
    captions: dict[str, tuple[str, str, Callable[[Row], str]]] = {
        "edges": (
            "a ball over inner edges",
            "RMS error of the path, mm (and its distance from the engine's own path on its plane); largest false "
            f"impulse over m g h; {cost}",
            _edge,
        ),
        "rest": (
            "a box at rest on a flat map",
            f"largest way of its centre, mm; largest false impulse over m g h; {cost}; most contacts",
            _rest,
        ),
        "sine": (
            "a ball on a sine",
            f"RMS distance from the path on the facets, mm; from that on the sine, mm; {cost}",
            _wave,
        ),
        "level": (
            "the rover on level ground",
            f"RMS distance from the engine's own path on its plane, mm; {cost}",
            _level,
        ),
    }
    for scene, (title, what, cell) in captions.items():
        for step in dict.fromkeys((steps[0], steps[-1])):
            own = [p for p in points if (p["scene"], p["step"]) == (scene, step)]
            heads = {p["spacing"]: f"cells of {p['spacing']:g} m" if p["spacing"] else "plane" for p in own}
            if scene == "edges":
                duration = data["meta"]["durations_s"][0]
                heads |= {s: f"{head}, {inner_edges(s, duration)} edges" for s, head in heads.items() if s}
            if own:
                lines += [f"**{title}, steps of {1e3 * step:g} ms**: {what}", ""]
                lines += _table(own, "spacing", heads, cell)
    own = [p for p in points if p["scene"] == "hills"]
    lines += [f"**the rover over hills**: RMS error of the path, mm, median (worst); {cost}", ""]
    lines += _table(own, "step", {s: f"{1e3 * s:g} ms" for s in steps}, _hills)
    meta = data["meta"]
    changes = ", ".join(millimetres(change) for change in meta["changes_of_references_m"])
    lines += [f"The references of the hills change by {changes} mm when their step is halved.", ""]
    return "\n".join([*lines, *left_out(meta["missing"]), f"{measured(meta)}."])


def short_table(data: dict[str, Any], spacing: float = 0.05, step: float = 1e-3) -> str:
    """Markdown: what the manual shows of one spacing of the cells and one step, a line an engine and variant."""
    cells: dict[str, Callable[[Row], str]] = {
        "edges": lambda row: f"{millimetres(row['error'])}, {false_impulse(row['impulse'])}",
        "rest": lambda row: f"{millimetres(row['error'])}, {false_impulse(row['impulse'])}",
        "sine": lambda row: millimetres(row["error"]),
        "hills": lambda row: f"{millimetres(row['error'])}, {number(row['cpu_ms_per_s'])} ms/s",
    }
    points = [p for p in data["points"] if p["step"] == step and p.get("spacing", spacing) == spacing]
    lines = []
    for key in dict.fromkeys((p["engine"], p["variant"]) for p in points):
        rows = {p["scene"]: p for p in points if (p["engine"], p["variant"]) == key}
        own = [cell(rows[scene]) if "failure" not in rows[scene] else "-" for scene, cell in cells.items()]
        lines.append([", ".join(key), *own])
    what = ("ball over edges: error, false impulse", "box at rest: way, false impulse")
    heads = ["errors in mm", *what, "ball on a sine: error", "rover over hills: error, CPU time"]
    return table(heads, lines)
