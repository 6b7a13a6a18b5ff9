"""SimBenchmark's scenes of free spheres, ours beside MuJoCo and Bullet: `python -m comparison.sphere_scenes [--quick]`.

Ours is the program `free_spheres` of `rust/comparison`, which also hands out the centres at the start, so that all
begin alike. Positions and velocities are read every 10 ms (outside the timing), and errors are taken from them in the
same way for all.
Writes `docs/comparison/spheres.json`, `spheres.png` and the tables of `docs/comparison.md` between their marks.
"""

import argparse
import json
import subprocess
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt
from rich.console import Console

from comparison.machine import processor, versions

Array = npt.NDArray[np.float64]

ROOT = Path(__file__).parents[2]
OUTPUT = ROOT / "docs" / "comparison"
STEPS = (1e-2, 5e-3, 2e-3, 1e-3)
SAMPLE = 0.01  # s
G = 9.81  # m/s²
BEGIN, END = "<!-- spheres: made by `make chart`, not by hand -->", "<!-- end of spheres -->"

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
}
#: What is measured, and its unit.
ERROR = {
    "666": ("penetration", "sum of penetration², m²"),
    "elastic 666": ("energy_error", "(E - E0)², J²"),
    "bouncing": ("energy_error", "(E - E0)², J²"),
}


@dataclass(frozen=True)
class Spheres:
    """A scene: spheres over the plane y = 0, without friction."""

    name: str
    duration: float  # s
    restitution: float
    mass: float  # kg
    radius: float  # m
    centres: Array  # (n, 3), m


class Runner(Protocol):
    """An engine with the scene in it."""

    def advance(self, steps: int) -> None:
        """Takes steps."""

    def state(self) -> tuple[Array, Array]:
        """Centres and velocities of the centres (n, 3), m and m/s."""


class MuJoCoSpheres:
    """`mj_step`; contacts without friction. There is no coefficient of restitution."""

    def __init__(self, scene: Spheres, time_step: float, *, is_stiff: bool) -> None:
        import mujoco  # noqa: PLC0415 - an engine may be missing

        if scene.restitution > 0.0:
            raise NotImplementedError("MuJoCo has no coefficient of restitution")
        solref = f'solref="{2.0 * time_step!r} 1"' if is_stiff else ""
        sphere = f'<freejoint/><geom type="sphere" size="{scene.radius!r}" mass="{scene.mass!r}"/>'
        bodies = "".join(f'<body pos="{x!r} {y!r} {z!r}">{sphere}</body>' for x, y, z in scene.centres.tolist())
        self.mujoco = mujoco
        self.model = mujoco.MjModel.from_xml_string(
            f'<mujoco><option timestep="{time_step!r}" gravity="0 {-G} 0"/><size memory="200M"/>'
            f'<default><geom condim="1" {solref}/></default><worldbody>'
            f'<geom type="plane" size="0 0 1" zaxis="0 1 0"/>{bodies}</worldbody></mujoco>'
        )
        self.data = mujoco.MjData(self.model)

    def advance(self, steps: int) -> None:
        self.mujoco.mj_step(self.model, self.data, nstep=steps)

    def state(self) -> tuple[Array, Array]:
        return self.data.qpos.reshape(-1, 7)[:, :3].copy(), self.data.qvel.reshape(-1, 6)[:, :3].copy()


class BulletSpheres:
    """`stepSimulation` on rigid bodies (maximal coordinates), 50 iterations, damping and sleeping off."""

    def __init__(self, scene: Spheres, time_step: float) -> None:
        import pybullet  # noqa: PLC0415 - an engine may be missing
        from pybullet_utils.bullet_client import BulletClient  # noqa: PLC0415

        self.client = c = BulletClient(pybullet.DIRECT)
        c.setGravity(0.0, -G, 0.0)
        c.setPhysicsEngineParameter(
            fixedTimeStep=time_step,
            numSolverIterations=50,
            numSubSteps=0,
            solverResidualThreshold=0.0,
            restitutionVelocityThreshold=0.0,
        )
        plane = c.createMultiBody(0, c.createCollisionShape(c.GEOM_PLANE, planeNormal=[0, 1, 0]))
        shape = c.createCollisionShape(c.GEOM_SPHERE, radius=scene.radius)
        self.spheres = [
            c.createMultiBody(scene.mass, shape, basePosition=x, useMaximalCoordinates=True)
            for x in scene.centres.tolist()
        ]
        for body in (plane, *self.spheres):
            # Bullet multiplies the restitutions of the two.
            c.changeDynamics(body, -1, restitution=scene.restitution, lateralFriction=0.0)
            c.changeDynamics(body, -1, linearDamping=0.0, angularDamping=0.0)

    def advance(self, steps: int) -> None:
        for _ in range(steps):
            self.client.stepSimulation()

    def state(self) -> tuple[Array, Array]:
        c = self.client
        centres = [c.getBasePositionAndOrientation(body)[0] for body in self.spheres]
        return np.array(centres), np.array([c.getBaseVelocity(body)[0] for body in self.spheres])


PEERS: dict[tuple[str, str], Callable[[Spheres, float], Runner]] = {
    ("MuJoCo", "defaults"): lambda scene, h: MuJoCoSpheres(scene, h, is_stiff=False),
    ("MuJoCo", "stiff, solref 2 h"): lambda scene, h: MuJoCoSpheres(scene, h, is_stiff=True),
    ("Bullet", "50 iterations"): BulletSpheres,
}


def penetration(centres: Array, radius: float) -> float:
    """Sum of squared overlaps, m², of spheres with one another and with the plane y = 0."""
    i, j = np.triu_indices(len(centres), 1)
    between = 2.0 * radius - np.linalg.norm(centres[i] - centres[j], axis=1)
    depths = np.concatenate([between, radius - centres[:, 1]])
    return float(np.square(np.maximum(depths, 0.0)).sum())


def energy(scene: Spheres, centres: Array, velocities: Array) -> float:
    """Of the centres' motion, J: without friction no sphere spins."""
    return float(scene.mass * (0.5 * np.square(velocities).sum() + G * centres[:, 1].sum()))


def run_peer(
    make: Callable[[Spheres, float], Runner], scene: Spheres, step: float, duration: float, cap: float
) -> dict[str, Any]:
    """Error and cost of one engine, or why there is none."""
    try:
        runner = make(scene, step)
    except (ImportError, NotImplementedError) as reason:
        return {"failure": f"left out: {reason}"}
    before = energy(scene, scene.centres, np.zeros_like(scene.centres))
    per_sample = max(round(SAMPLE / step), 1)
    n_samples = max(round(duration / (per_sample * step)), 1)
    depths, changes, cpu = [], [], 0.0
    for _ in range(n_samples):
        start = time.process_time()
        runner.advance(per_sample)
        cpu += time.process_time() - start
        centres, velocities = runner.state()
        depths.append(penetration(centres, scene.radius))
        changes.append((energy(scene, centres, velocities) - before) ** 2)
        if not np.isfinite(depths[-1] + changes[-1]):
            return {"failure": "not finite"}
        if cpu > cap:
            return {"failure": f"stopped: more than {cap:g} s of CPU time"}
    steps = n_samples * per_sample
    return {
        "penetration": float(np.mean(depths)),
        "last_penetration": depths[-1],
        "energy_error": float(np.mean(changes)),
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


def measure(steps: tuple[float, ...], quick: bool, cap: float, console: Console) -> dict[str, Any]:
    """Every engine in every scene; `quick` shortens the scenes to 2 s."""
    rows: list[dict[str, Any]] = []
    for given in ours("--start"):
        scene = Spheres(
            given["scene"],
            given["duration"],
            given["restitution"],
            given["mass"],
            given["radius"],
            np.array(given["centres"]),
        )
        duration = 2.0 if quick else scene.duration
        key = ERROR[scene.name][0]
        for step in steps:
            found: list[tuple[str, str, dict[str, Any]]] = []
            shown = ours("--scene", scene.name, "--duration", repr(duration), repr(step))
            for row in shown[0]["runs"]:
                variant = "projection" if row["projects"] else "velocity level"
                found.append(("rover-gym", variant, row["run"]))
            for (engine, variant), make in PEERS.items():
                found.append((engine, variant, run_peer(make, scene, step, duration, cap)))
            for engine, variant, row in found:
                rows.append({"scene": scene.name, "engine": engine, "variant": variant, "step": step} | row)
                text = row.get("failure") or f"{row[key]:.2e} {row['us_per_step']:8.1f} us a step"
                console.print(f"{scene.name:<12}{step * 1e3:>5g} ms  {engine}, {variant}: {text}")
    meta = {"command": "make chart", "processor": processor(), "packages": versions(), "is_quick": quick}
    return {"meta": meta, "points": rows, "published": PUBLISHED}


COLOURS = {"rover-gym": "#d1361f", "MuJoCo": "#3f8f4f", "Bullet": "#8a5fb0"}


def draw(data: dict[str, Any], path: Path) -> None:
    """Error against CPU time, one panel a scene."""
    import matplotlib as mpl  # noqa: PLC0415 - after the engines

    mpl.use("Agg")
    from matplotlib import pyplot as plt  # noqa: PLC0415

    figure, panels = plt.subplots(1, 3, figsize=(13.2, 4.6), dpi=100)
    for axes, (scene, (key, label)) in zip(panels, ERROR.items(), strict=True):
        points = [p for p in data["points"] if p["scene"] == scene and key in p]
        for engine, variant in dict.fromkeys((p["engine"], p["variant"]) for p in points):
            curve = [p for p in points if (p["engine"], p["variant"]) == (engine, variant)]
            is_second = variant in ("velocity level", "defaults") and scene == "666"
            axes.plot(
                [p["cpu_ms_per_s"] for p in curve],
                [p[key] for p in curve],
                color=COLOURS[engine],
                linestyle="--" if is_second else "-",
                linewidth=2.4 if engine == "rover-gym" else 1.5,
                marker="o",
                markersize=4.5,
                label=f"{engine}, {variant}",
            )
        axes.set_xscale("log")
        axes.set_yscale("log")
        axes.margins(0.12)
        axes.set_title(scene, fontsize=11, loc="left")
        axes.set_xlabel("CPU time, ms per simulated second")
        axes.set_ylabel(label)
        axes.grid(which="major", color="#dddddd", linewidth=0.7)
        low, high = axes.get_ylim()
        axes.set_ylim(low, high * (high / low) ** 0.3)  # room for the legend
        axes.legend(fontsize=8.5, frameon=False, loc="upper right")
        for side in ("top", "right"):
            axes.spines[side].set_visible(False)
    figure.tight_layout()
    figure.savefig(path)
    plt.close(figure)


def tables(data: dict[str, Any]) -> str:
    """Markdown of errors and costs."""
    lines = []
    for scene, (key, label) in ERROR.items():
        steps = sorted({p["step"] for p in data["points"]}, reverse=True)
        lines += [
            f"**{scene}**: {label}, and CPU time of a step",
            "",
            "| engine | " + " | ".join(f"{1e3 * h:g} ms" for h in steps) + " |",
            "|---" * (len(steps) + 1) + "|",
        ]
        own = [p for p in data["points"] if p["scene"] == scene]
        for engine, variant in dict.fromkeys((p["engine"], p["variant"]) for p in own):
            row = {p["step"]: p for p in own if (p["engine"], p["variant"]) == (engine, variant)}
            if not any(key in p for p in row.values()):
                continue
            cells = [f"{p[key]:.1e}, {p['us_per_step']:.0f} us" if key in p else "-" for p in map(row.get, steps) if p]
            lines.append(f"| {engine}, {variant} | " + " | ".join(cells) + " |")
        for engine, (error, cost) in PUBLISHED[scene].items():
            cell = f"{error:.1e}" + (f", {cost:.0f} us" if cost else "")
            lines.append(f"| {engine}, *published* | " + "- | " * (len(steps) - 1) + f"{cell} |")
        lines.append("")
    lines.append(f"Measured with `make chart` on {data['meta']['processor']}, shared with other work.")
    return "\n".join(lines)


def fill(page: Path, data: dict[str, Any]) -> None:
    """Puts the tables between their marks."""
    text = page.read_text(encoding="utf-8")
    before, rest = text.split(BEGIN)
    after = rest.split(END)[1]
    page.write_text(f"{before}{BEGIN}\n\n{tables(data)}\n\n{END}{after}", encoding="utf-8")


def main() -> None:
    """Measures, draws, fills."""
    parser = argparse.ArgumentParser(description="Free spheres after SimBenchmark.")
    parser.add_argument("--quick", action="store_true", help="two steps and 2 s of each scene; the page is left alone")
    parser.add_argument("--draw", action="store_true", help="only draw what spheres.json has")
    parser.add_argument("--cap", type=float, default=40.0, help="CPU time that a peer's run may take, s")
    parser.add_argument("--output", type=Path, default=OUTPUT)
    arguments = parser.parse_args()
    arguments.output.mkdir(parents=True, exist_ok=True)
    path = arguments.output / "spheres.json"
    if not arguments.draw:
        steps = STEPS[:2] if arguments.quick else STEPS
        data = measure(steps, arguments.quick, arguments.cap, Console(width=120))
        path.write_text(json.dumps(data, indent=1) + "\n", encoding="utf-8")
    data = json.loads(path.read_text(encoding="utf-8"))
    draw(data, path.with_suffix(".png"))
    if arguments.output == OUTPUT and not data["meta"]["is_quick"]:
        fill(OUTPUT.with_suffix(".md"), data)


if __name__ == "__main__":
    main()
