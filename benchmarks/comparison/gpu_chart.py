"""How many rovers a second, at what error: `python -m comparison.gpu_chart [--draw]`.

Measures the rover of the flat drive in batches: here on all threads of the processor and in MuJoCo Warp on a graphics
card, and adds the rows to `docs/comparison/gpu.json`, in which every row names its hardware and its source. Without a
graphics card, or without MuJoCo Warp, it says so and draws what the file has: `docs/comparison/gpu.png`.
"""

import argparse
import os
import sys
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from reports import read_json, table as table_in_markdown, write_json

from comparison.machine import processor
from comparison.output import CHART
from comparison.run import run
from comparison.scenes import flat_drive

FILE = CHART / "gpu.json"
BATCHES = (2048, 8192, 32768)
TORQUE, ANGLE, TIME_STEP = 60.0, 0.28, 0.005
COLOURS = {"rover-gym": "#d1361f", "MuJoCo": "#3f8f4f", "MuJoCo Warp": "#1f6f5f", "Newton Kamino": "#8a5fb0"}


def card_or_reason() -> tuple[str | None, str]:
    """The graphics card, or why there is none to measure on."""
    try:
        from comparison import warp_peer  # noqa: PLC0415 - only where it is installed
    except ImportError as error:
        return None, f"MuJoCo Warp is not installed ({error}): pip install mujoco-warp"
    name = warp_peer.card()
    return name, "" if name else "no graphics card (CUDA) is found"


def measure(hardware: str) -> list[dict[str, Any]]:
    """Rows of MuJoCo Warp on the card, and of ours on the processor beside it."""
    from comparison import warp_peer  # noqa: PLC0415 - only where it is installed
    from comparison.peers import Variant  # noqa: PLC0415 - loads the engines
    from comparison.references import load  # noqa: PLC0415
    from rover_gym.envs.vector.throughput import measure_exploring  # noqa: PLC0415

    scene, path, rows = flat_drive.scene(), load("flat_drive"), []
    source = f"make chart-gpu, {datetime.now(tz=UTC).date().isoformat()}"
    for settings, options in warp_peer.SETTINGS.items():
        variant = Variant("MuJoCo Warp", settings, lambda s, h, o=options: warp_peer.WarpRunner(s, h, **o), "", "")
        error = flat_drive.error(run(variant, scene, TIME_STEP, 600.0), path)
        limits = warp_peer.limits_of(warp_peer.WarpRunner(scene, TIME_STEP, **options).model, TORQUE, ANGLE)
        for rovers in BATCHES:
            rate = warp_peer.throughput(scene, rovers, options, limits)
            rows.append(row("MuJoCo Warp", settings, hardware, rovers, rate, error, source))
    points = read_json(CHART / "chart.json")["points"]
    ours = {p["step"]: p for p in points if is_ours(p)}
    threads = os.cpu_count() or 1
    for rovers in BATCHES[:2]:
        rate = measure_exploring(rovers, threads, torque=TORQUE).steps_per_second
        on = f"{threads} threads of {processor()}"
        rows.append(row("rover-gym", "physics", on, rovers, rate, ours[TIME_STEP]["error"], source))
    return rows


def is_ours(point: dict[str, Any]) -> bool:
    """Whether a point of the chart is of our default on the flat drive."""
    return (point["scene"], point["engine"], point["variant"]) == ("flat_drive", "rover-gym", "linearised")


def row(
    engine: str, settings: str, hardware: str, rovers: int, rate: float, error: float, source: str
) -> dict[str, Any]:
    """A row of the file."""
    names = ("engine", "settings", "hardware", "rovers", "rover_steps_per_s", "rms_error_m", "source")
    return dict(zip(names, (engine, settings, hardware, rovers, rate, error, source), strict=True))


def lines_of(rows: list[dict[str, Any]]) -> dict[tuple[str, str, str], list[dict[str, Any]]]:
    """Rows of every engine, setting and hardware."""
    found: dict[tuple[str, str, str], list[dict[str, Any]]] = {}
    for one in rows:
        found.setdefault((one["engine"], one["settings"], one["hardware"]), []).append(one)
    return found


def table(data: dict[str, Any]) -> str:
    """Markdown: the largest rate of every engine, setting and hardware."""
    lines = []
    for key, own in lines_of(data["rows"]).items():
        best = max(own, key=lambda one: float(one["rover_steps_per_s"]))
        rate, error = f"{best['rover_steps_per_s'] / 1e6:.2g} million", f"{100.0 * best['rms_error_m']:.2g} cm"
        lines.append([*key, str(best["rovers"]), rate, error])
    return table_in_markdown(["engine", "settings", "hardware", "rovers", "rover-steps a second", "error"], lines)


def draw(data: dict[str, Any], path: Path) -> None:
    """Error over rover-steps a second, a line an engine, setting and hardware."""
    import matplotlib as mpl  # noqa: PLC0415 - would load before the engines

    mpl.use("Agg")
    from matplotlib import pyplot as plt  # noqa: PLC0415

    figure, axes = plt.subplots(figsize=(9, 5.5))
    marks = iter("osD^vPX*<>h")
    for (engine, settings, hardware), own in lines_of(data["rows"]).items():
        own.sort(key=lambda one: one["rovers"])
        rates = [one["rover_steps_per_s"] for one in own]
        errors = [100.0 * one["rms_error_m"] for one in own]
        filled = "full" if "GPU" in hardware or "H200" in hardware else "none"
        label = f"{engine}, {settings}; {hardware}"
        axes.plot(rates, errors, marker=next(marks), color=COLOURS[engine], fillstyle=filled, label=label)
    axes.set(
        xscale="log",
        yscale="log",
        xlabel="rover-steps of 5 ms a second",
        ylabel="RMS error of the flat drive at 5 ms, cm",
        title="How many rovers a second, at what error",
    )
    axes.grid(visible=True, which="major", alpha=0.3)
    axes.legend(fontsize="x-small", loc="upper center", bbox_to_anchor=(0.5, -0.12), ncols=1)
    figure.savefig(path, dpi=110, bbox_inches="tight")
    plt.close(figure)


def main() -> None:
    """Measures where it can, and draws."""
    parser = argparse.ArgumentParser(description="Rovers a second and error, on processors and graphics cards.")
    parser.add_argument("--draw", action="store_true", help="only draw what gpu.json has")
    is_drawing = parser.parse_args().draw
    data: dict[str, Any] = read_json(FILE)
    hardware, reason = (None, "") if is_drawing else card_or_reason()
    if hardware:
        found = measure(f"one {hardware}")
        kept = {key: own for key, own in lines_of(data["rows"]).items() if key not in lines_of(found)}
        data["rows"] = [one for own in kept.values() for one in own] + found
        write_json(FILE, data)
    elif reason:
        sys.stdout.write(f"chart-gpu: nothing measured, {reason}; the figure has the rows of {FILE.name}\n")
    draw(data, CHART / "gpu.png")


if __name__ == "__main__":
    main()
