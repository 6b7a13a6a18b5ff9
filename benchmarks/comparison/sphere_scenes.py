"""SimBenchmark's scenes of free spheres, ours beside the peers: `python -m comparison.sphere_scenes [--quick]`.

Ours is the program `free_spheres` of `rust/comparison`, which also hands out the scenes, so that all begin alike.
Positions and velocities are read every 10 ms (outside the timing), and errors are taken from them in the same way for
all. Writes `docs/comparison/spheres.json`, `spheres.png` and the tables of `docs/tables/comparison.md` between their
marks.
"""

import argparse
import importlib
import json
import subprocess
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console

from comparison.machine import processor, versions
from comparison.output import CHART, QUICK
from comparison.peers import LeftOut
from comparison.spheres.scene import FreeRunner, FreeScene, energy, penetration, velocity_error
from comparison.spheres.tables import ERRORS, fill

ROOT = Path(__file__).parents[2]
STEPS = (1e-2, 5e-3, 2e-3, 1e-3)
SAMPLE = 0.01  # s
SETTLE = 0.5  # s of rest before a push, in which the weight compresses what springs an engine has
#: One file an engine, each with `VARIANTS`; ImportError where its engine is missing.
ENGINES = ("mujoco_spheres", "drake_spheres", "bullet_spheres")
#: What the curves of ours are called.
OWN = {
    "convergence": "projection to convergence",
    "projection": "projection",
    "velocity_level": "velocity level",
}
Builder = Callable[[FreeScene, float], FreeRunner]


def peers(console: Console) -> dict[tuple[str, str], Builder]:
    """Of the engines that are installed."""
    found: dict[tuple[str, str], Builder] = {}
    for name in ENGINES:
        try:
            module = importlib.import_module(f"comparison.spheres.{name}")
        except ImportError as missing:
            console.print(f"left out, not installed: {name} ({missing})")
        else:
            found |= module.VARIANTS
    return found


def run_peer(make: Builder, scene: FreeScene, step: float, duration: float, cap: float) -> dict[str, Any]:
    """Errors and cost of one engine, or why there are none."""
    try:
        runner = make(scene, step)
    except LeftOut as left_out:
        return {"failure": f"left out: {left_out.reason}"}
    if scene.slab is not None:
        runner.advance(round(SETTLE / step))
        runner.push()
    before = energy(scene, scene.centres, np.zeros_like(scene.centres))
    per_sample = max(round(SAMPLE / step), 1)
    n_samples = max(round(duration / (per_sample * step)), 1)
    n = len(scene.centres)
    depths, changes, offs, cpu = [], [], [], 0.0
    for sample in range(n_samples):
        start = time.process_time()
        try:
            runner.advance(per_sample)
        except (RuntimeError, ArithmeticError) as error:
            return {"failure": f"the engine stops: {str(error).splitlines()[0][:120]}"}
        cpu += time.process_time() - start
        centres, velocities = runner.state()
        if not np.isfinite(centres).all() or not np.isfinite(velocities).all():
            return {"failure": "not finite"}
        depths.append(penetration(centres[:n], scene.radius))
        changes.append((energy(scene, centres[:n], velocities[:n]) - before) ** 2)
        if scene.accelerations is not None:
            at = (sample + 1) * per_sample * step
            offs.append(velocity_error(scene.accelerations, velocities, at))
        if cpu > cap:
            return {"failure": f"stopped: more than {cap:g} s of CPU time"}
    steps = n_samples * per_sample
    return {
        "penetration": float(np.mean(depths)),
        "last_penetration": depths[-1],
        "largest_penetration": max(depths),
        "energy_error": float(np.mean(changes)),
        "velocity_error": float(np.mean(offs)) if offs else None,
        "cpu_ms_per_s": 1e3 * cpu / (steps * step),
        "us_per_step": 1e6 * cpu / steps,
    }


def ours(*arguments: str) -> list[dict[str, Any]]:
    """What the program `free_spheres` prints."""
    program = "cargo run --release --locked --quiet -p rover-comparison --bin free_spheres --"
    command = [*program.split(), *arguments]
    done = subprocess.run(command, cwd=ROOT, check=True, capture_output=True, text=True)
    parsed: list[dict[str, Any]] = json.loads(done.stdout)
    return parsed


def measure(
    steps: tuple[float, ...], wanted: list[str] | None, quick: bool, cap: float, console: Console
) -> dict[str, Any]:
    """Every engine in every scene; `quick` shortens the scenes to 2 s."""
    rows: list[dict[str, Any]] = []
    engines = peers(console)
    cost: dict[tuple[str, str, str], float] = {}  # us of a step, at the step before
    for given in ours("--start"):
        scene = FreeScene.of(given)
        if wanted and scene.name not in wanted:
            continue
        duration = min(2.0, scene.duration) if quick else scene.duration
        key = ERRORS[scene.name].key
        for step in steps:
            found: list[tuple[str, str, dict[str, Any]]] = []
            shown = ours("--scene", scene.name, "--duration", repr(duration), repr(step))
            found += [("rover-gym", OWN[row["treatment"]], row["run"]) for row in shown[0]["runs"]]
            for (engine, variant), make in engines.items():
                key_of_cost = (scene.name, engine, variant)
                if cost.get(key_of_cost, 0.0) * 1e-6 * duration / step > 1.5 * cap:
                    row = {"failure": f"left out: would take more than {cap:g} s of CPU time"}
                else:
                    row = run_peer(make, scene, step, duration, cap)
                    cost[key_of_cost] = row.get("us_per_step", cost.get(key_of_cost, 0.0))
                found.append((engine, variant, row))
            for engine, variant, row in found:
                rows.append({"scene": scene.name, "engine": engine, "variant": variant, "step": step} | row)
                text = row.get("failure") or f"{row[key]:.2e} {row['us_per_step']:8.1f} us a step"
                console.print(f"{scene.name:<18}{step * 1e3:>5g} ms  {engine}, {variant}: {text}")
    meta = {"command": "make chart", "processor": processor(), "packages": versions(), "is_quick": quick}
    return {"meta": meta, "points": rows}


def main() -> None:
    """Measures, draws, fills."""
    parser = argparse.ArgumentParser(description="Free spheres after SimBenchmark.")
    parser.add_argument("--quick", action="store_true", help=f"two steps and 2 s of each scene, under {QUICK}")
    parser.add_argument("--draw", action="store_true", help="only draw what spheres.json has")
    parser.add_argument("--scenes", nargs="*", help="only these; the rest is kept as it is in spheres.json")
    parser.add_argument("--cap", type=float, default=60.0, help="CPU time that a peer's run may take, s")
    arguments = parser.parse_args()
    output = QUICK if arguments.quick else CHART
    output.mkdir(parents=True, exist_ok=True)
    path = output / "spheres.json"
    if not arguments.draw:
        steps = STEPS[:2] if arguments.quick else STEPS
        data = measure(steps, arguments.scenes, arguments.quick, arguments.cap, Console(width=120))
        if arguments.scenes and path.exists():
            old = json.loads(path.read_text(encoding="utf-8"))["points"]
            data["points"] = [row for row in old if row["scene"] not in arguments.scenes] + data["points"]
        path.write_text(json.dumps(data, indent=1) + "\n", encoding="utf-8")
    data = json.loads(path.read_text(encoding="utf-8"))
    from comparison.spheres.drawing import draw  # noqa: PLC0415 - Matplotlib would load before the engines

    draw(data, path.with_suffix(".png"))
    fill(output, data)


if __name__ == "__main__":
    main()
