"""SimBenchmark's scenes of free spheres, ours beside the peers: `python -m comparison.sphere_scenes [--quick]`.

Ours is the program `free_spheres` of `rust/comparison`, which also hands out the scenes, so that all begin alike.
Positions and velocities are read every 10 ms (outside the timing), and errors are taken from them in the same way for
all. Writes `docs/comparison/spheres.json`, `spheres.png` and the tables of `docs/tables/comparison.md` between their
marks.
"""

import json
import subprocess
import time
from collections.abc import Callable
from typing import Any

import numpy as np
from reports import ROOT, fill, read_json, write_json
from rich.console import Console

from comparison.machine import meta
from comparison.output import command_line, page_of
from comparison.peers import LeftOut, installed
from comparison.spheres.scene import FreeRunner, FreeScene, energy, penetration, velocity_error
from comparison.spheres.tables import ERRORS, tables

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
    modules, _ = installed("comparison.spheres", ENGINES, console)
    engines: dict[tuple[str, str], Builder] = {key: make for one in modules for key, make in one.VARIANTS.items()}
    cost: dict[tuple[str, str, str], float] = {}  # us of a step, at the step before
    for given in ours("--start"):
        scene = FreeScene.of(given)
        if wanted and scene.name not in wanted:
            continue
        duration = min(2.0, scene.duration) if quick else scene.duration
        for step in steps:
            (shown,) = ours("--scene", scene.name, "--duration", repr(duration), repr(step))
            found = {("rover-gym", OWN[row["treatment"]]): row["run"] for row in shown["runs"]}
            for key, make in engines.items():
                known = cost.get((scene.name, *key), 0.0)
                if known * 1e-6 * duration / step > 1.5 * cap:
                    found[key] = {"failure": f"left out: would take more than {cap:g} s of CPU time"}
                else:
                    found[key] = run_peer(make, scene, step, duration, cap)
                    cost[(scene.name, *key)] = found[key].get("us_per_step", known)
            for (engine, variant), row in found.items():
                rows.append({"scene": scene.name, "engine": engine, "variant": variant, "step": step} | row)
                error = ERRORS[scene.name].key
                text = row.get("failure") or f"{row[error]:.2e} {row['us_per_step']:8.1f} us a step"
                console.print(f"{scene.name:<18}{step * 1e3:>5g} ms  {engine}, {variant}: {text}")
    return {"meta": meta(is_quick=quick), "points": rows}


def main() -> None:
    """Measures, draws, fills."""
    quick = "two steps and 2 s of each scene"
    given = command_line("spheres.json", "Free spheres after SimBenchmark.", quick, cap=60.0, has_scenes=True)
    if not given.draw:
        steps = STEPS[:2] if given.quick else STEPS
        data = measure(steps, given.scenes, given.quick, given.cap, Console(width=120))
        if given.scenes:
            old = read_json(given.path, {"points": []})["points"]
            data["points"] = [row for row in old if row["scene"] not in given.scenes] + data["points"]
        write_json(given.path, data)
    data = read_json(given.path)
    from comparison.spheres.drawing import draw  # noqa: PLC0415 - Matplotlib would load before the engines

    draw(data, given.path.with_suffix(".png"))
    fill(page_of(given.path.parent), "spheres", tables(data))


if __name__ == "__main__":
    main()
