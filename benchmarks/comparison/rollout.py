"""Any rover on any ground beside MuJoCo: `python -m comparison.rollout [--row TEXT] [--robot FILE] [--save]`.

The first table of `make bench`: microseconds of a step of 5 ms, of one rover alone, of one rover of a batch, and of
MuJoCo's `rollout` of the same rovers, with the same commands, in the same round. Torques and set-points are drawn anew
in every run, from a seed that is printed. Every rover of a batch has its own rocks, or its own place on a map. MuJoCo
gets the model as `RoverModel.to_mjcf` writes it, with position servos on the steered joints; the times that it needs
are those of its C code, as ours are those of the core. Each wheel has the cheapest shape in MuJoCo that moves the same:
on a plane a sphere, where the wheel touches it at one point.

`--save` writes `docs/comparison/rollout.json`, from which the manual's table and the paper's figures are made.
"""

import argparse
import json
import math
import statistics
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from datetime import UTC, datetime
from importlib import metadata
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import mujoco
import numpy as np
from mujoco import rollout
from rich.console import Console

from comparison.machine import processor
from comparison.mujoco_rover import rim
from comparison.output import CHART
from comparison.scene import Array
from rover_gym import HeightField, Plane, RoverModel, Simulation, SphereField
from rover_gym.core import SimulationBatch

TIME_STEP = 0.005  # s
#: Steps from one command to the next, commands of a round, rounds, and the first rounds, which are not counted.
STEPS_A_COMMAND, COMMANDS, ROUNDS, WARM_UP = 10, 10, 10, 1
#: Height by which a rover is raised until nothing overlaps, m, and steps that it has to come to rest, braked.
LIFT, LANDING = 0.005, 200
#: Largest torque of a wheel, as a share of that which its part of the weight resists at the rim.
EFFORT = 0.2
#: Rovers that are measured alone.
ALONE = 8
#: Names of MuJoCo's settings, with integrator, cone and impratio. The second has the friction of rigid contacts,
#: nearly; with it the integrator `discrete` is both the most accurate and the fastest. The default integrator, `Euler`,
#: is unstable with the gains of the steering.
MUJOCO = {
    "MuJoCo": ("mjINT_IMPLICITFAST", "mjCONE_PYRAMIDAL", 1.0),
    "elliptic": ("mjINT_DISCRETE", "mjCONE_ELLIPTIC", 100.0),
}
#: Drives by commands `(n_commands, n_rovers, 2 n_wheels)`, N m and rad.
Player = Callable[[Array], None]


@dataclass(frozen=True)
class Row:
    """A rover on a ground.

    Attributes:
        name: In the table.
        model: The rover.
        ground: Makes the ground of a rover from a generator.
        around: Largest distance along x and z from the origin at which a rover begins, m.
        roll: Its roll there, rad.
        bodies: Whether its boxes touch the ground in MuJoCo, too.
    """

    name: str
    model: RoverModel
    ground: Callable[[np.random.Generator], Any]
    around: float = 3.0
    roll: float = 0.0
    bodies: bool = False


def wide(width: float, rounding: float, *, rigid: bool = False) -> RoverModel:
    """The built-in rover on wheels of 0.20 m with a width and a rounding, m, 0 for thin discs.

    They yield as those of the package do, unless they are rigid.
    """
    model = RoverModel().replace(contact_radius=0.20, motor=None)
    if rigid:
        model = model.replace(wheel_stiffness=0.0)
    if width == 0.0:
        return model
    machine = model.to_dict()
    machine["wheels"] = [wheel | {"width": width, "rounding": rounding} for wheel in machine["wheels"]]
    return RoverModel.from_dict(machine)


def plane(_: np.random.Generator) -> Plane:
    """Level ground."""
    return Plane()


def rocks(rng: np.random.Generator) -> SphereField:
    """600 half-buried rocks of up to 15 cm on 12 m by 12 m."""
    n = 600
    radii = rng.uniform(0.04, 0.15, n)
    places = rng.uniform(-6.0, 6.0, (n, 2))
    depth = rng.uniform(0.3, 0.7, n) * radii
    return SphereField(np.column_stack([places[:, 0], -depth, places[:, 1]]), radii, Plane())


def one_rock(_: np.random.Generator) -> SphereField:
    """A rock that lifts the trunk of the built-in rover off its wheels of 0.20 m."""
    return SphereField([[0.0, -0.1, 0.0]], [0.5], Plane())


def hills(spacing: float) -> Callable[[np.random.Generator], HeightField]:
    """Self-affine hills with cells of a size, m, one map for all rovers of a row."""
    made: list[HeightField] = []

    def ground(rng: np.random.Generator) -> HeightField:
        if not made:
            made.append(HeightField.fractal(24.0, spacing, 0.15, longest_wave=12.0, seed=int(rng.integers(1 << 31))))
        return made[0]

    return ground


def rows(robots: list[Path]) -> Iterator[Row]:
    """All rows of the table: the built-in rover by its wheels, the gallery, rovers on their bodies, files of robots."""
    grounds = {"plane": plane, "rocks": rocks, "hills 0.25 m": hills(0.25), "hills 0.05 m": hills(0.05)}
    wheels = {
        "thin discs": wide(0.0, 0.0),
        "cylinders": wide(0.15, 0.0),
        "rigid cylinders": wide(0.15, 0.0, rigid=True),
        "tori": wide(0.15, 0.075),
    }
    for ground, make in grounds.items():
        for name, model in wheels.items():
            yield Row(f"rover, {name}, {ground}", model, make)
    for name in ("mars-rover", "open-rover", "four-steered", "skid-steered"):
        for ground, make in grounds.items():
            yield Row(f"{name}, {ground}", RoverModel.named(name).replace(motor=None), make)
    yield Row("rover, trunk on a rock", wheels["thin discs"], one_rock, around=0.1, bodies=True)
    for ground in ("hills 0.25 m", "hills 0.05 m"):
        yield Row(f"rover, on its back, {ground}", wheels["thin discs"], grounds[ground], roll=math.pi, bodies=True)
    for file in robots:
        read = RoverModel.from_urdf if file.suffix == ".urdf" else RoverModel.from_mjcf
        for ground, make in grounds.items():
            yield Row(f"{file.stem}, {ground}", read(file), make)


def steering_limits(model: RoverModel) -> list[float]:
    """Largest set-points of the wheels' steering, rad, 0 of those without."""
    wheels = model.to_dict()["wheels"]
    return [min(w.get("steering_limit") or 0.0, 0.7) if w.get("steering") else 0.0 for w in wheels]


def rover_at_rest(row: Row, rng: np.random.Generator) -> Simulation:
    """A rover somewhere on its ground, at rest, its wheels braked until the first command."""
    terrain = row.ground(rng)
    simulation = Simulation(row.model, terrain, time_step=TIME_STEP)
    x, z = rng.uniform(-row.around, row.around, 2)
    q = row.model.resting_pose(Plane(), (x, z), rng.uniform(-math.pi, math.pi))
    q[3] += row.roll
    simulation.set_state(q)
    while simulation.deepest_overlap < -LIFT:
        q[1] += LIFT
        simulation.set_state(q)
    simulation.brake()
    simulation.step(LANDING)
    return simulation


def together(batch: SimulationBatch, n_wheels: int) -> Player:
    """Plays commands of all rovers in a batch."""

    def play(commands: Array) -> None:
        for command in commands:
            batch.step(command[:, :n_wheels], command[:, n_wheels:], STEPS_A_COMMAND)

    return play


def one_by_one(simulations: list[Simulation], reports: list[Any]) -> Player:
    """Plays commands rover by rover."""
    n_wheels = len(simulations[0].model.to_dict()["wheels"])

    def play(commands: Array) -> None:
        for i, simulation in enumerate(simulations):
            for command in commands[:, i]:
                simulation.set_commands(command[:n_wheels], command[n_wheels:])
                reports.append(simulation.step(STEPS_A_COMMAND))

    return play


def in_mujoco(
    simulations: list[Simulation], threads: int, states: dict[str, Array] | None = None, *, bodies: bool = False
) -> dict[str, Player]:
    """MuJoCo's rollout of the same rovers, by setting; with their states, which a dictionary receives.

    `bodies`: whether boxes touch the ground.
    """
    states = {} if states is None else states
    models = [mujoco.MjModel.from_xml_string(text) for text in descriptions(simulations, bodies=bodies)]
    for model, one in zip(models, simulations, strict=True):
        terrain: Any = one.terrain
        if isinstance(terrain, HeightField):
            heights = terrain.grid.astype(float)[::-1]  # our z is to the right, the file's y to the left
            low, high = heights.min(), heights.max()
            model.hfield_data[:] = ((heights - low) / (high - low)).ravel()
    datas = [mujoco.MjData(models[0]) for _ in range(threads)]
    whole = mujoco.mjtState.mjSTATE_FULLPHYSICS.value
    start = np.stack([_state(model, one, whole) for model, one in zip(models, simulations, strict=True)])
    wheels = simulations[0].model.to_dict()["wheels"]
    drives = [models[0].actuator(f"drive_{wheel['solid']}").id for wheel in wheels]
    steered = [i for i, wheel in enumerate(wheels) if wheel.get("steering")]
    holds = [models[0].actuator(f"hold_{wheels[i]['steering']}").id for i in steered]
    pool = rollout.Rollout(nthread=threads)

    def player(name: str, integrator: str, cone: str, impratio: float) -> Player:
        own = states[name] = start.copy()

        def play(commands: Array) -> None:
            for model in models:
                model.opt.integrator = getattr(mujoco.mjtIntegrator, integrator)
                model.opt.cone, model.opt.impratio = getattr(mujoco.mjtCone, cone), impratio
            control = np.empty((len(models), len(commands), models[0].nu))
            control[:, :, drives] = commands[:, :, : len(wheels)].transpose(1, 0, 2)
            control[:, :, holds] = commands[:, :, [len(wheels) + i for i in steered]].transpose(1, 0, 2)
            control = np.repeat(control, STEPS_A_COMMAND, axis=1)
            after, _ = pool.rollout(models, datas, own, control)
            own[:] = after[:, -1]

        return play

    return {name: player(name, *setting) for name, setting in MUJOCO.items()}


def descriptions(simulations: list[Simulation], *, bodies: bool = False) -> list[str]:
    """The rovers and their grounds as MJCF, z up. Only wheels touch the ground, in the shapes of `rim`.

    With `bodies` boxes do so, too. A rollout wants equally large models: fields of fewer rocks get some far below.
    """
    machine = simulations[0].model
    masks = {"contype": "2", "conaffinity": "1", "friction": "0.7 0 0", "condim": "3"}
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "rover.xml"
        machine.to_mjcf(file)
        text = file.read_text(encoding="utf-8")
    wheels = {wheel["solid"]: wheel for wheel in machine.to_dict()["wheels"]}
    solids = {solid["name"]: solid for solid in machine.to_dict()["solids"]}
    texts = []
    for simulation in simulations:
        root = ElementTree.fromstring(text)  # noqa: S314 - our own text
        ElementTree.SubElement(root, "option", timestep=repr(TIME_STEP), gravity="0 0 -9.81")
        for body in root.iter("body"):
            for geom in body.findall("geom"):
                if bodies and geom.get("type") == "box":
                    geom.attrib |= masks
                    continue
                is_rim = body.get("name") in wheels and geom.get("type") == "cylinder" and "contype" not in geom.keys()  # noqa: SIM118
                if not is_rim:
                    body.remove(geom)
                    continue
                wheel = wheels[str(body.get("name"))]
                radius = float(str(geom.get("size")).split()[0])
                is_flat = not isinstance(simulation.terrain, HeightField | SphereField)
                kind, size = rim(wheel, radius, is_flat=is_flat)
                geom.attrib |= masks | {"type": kind, "size": size}
        for motor in root.iter("motor"):
            motor.attrib.pop("ctrlrange", None)
        # A joint held by its model, and not steered, is a spring and a damper.
        driven = {*wheels, *(str(servo.get("name")).removeprefix("hold_") for servo in root.iter("position"))}
        for joint in root.iter("joint"):
            hold = solids.get(str(joint.get("name")), {}).get("hold")
            if hold and joint.get("type") and joint.get("name") not in driven:
                joint.attrib |= {gain: repr(hold[gain]) for gain in ("stiffness", "damping")}
        _add_ground(root, simulation.terrain)
        texts.append(ElementTree.tostring(root, encoding="unicode"))
    return texts


def _add_ground(root: ElementTree.Element, terrain: Any) -> None:
    """Adds a ground of ours to MJCF: x forward, y left, z up."""
    world = root.find("worldbody")
    assert world is not None
    masks = {"contype": "1", "conaffinity": "2", "friction": "0.7 0 0", "condim": "3"}
    if isinstance(terrain, HeightField):
        x_min, z_min, x_max, z_max = terrain.bounds
        low, high = float(terrain.grid.min()), float(terrain.grid.max())
        rows, columns = terrain.grid.shape
        size = f"{(x_max - x_min) / 2!r} {(z_max - z_min) / 2!r} {high - low!r} 1"
        asset = ElementTree.SubElement(root, "asset")
        ElementTree.SubElement(asset, "hfield", name="map", nrow=str(rows), ncol=str(columns), size=size)
        pos = f"{(x_min + x_max) / 2!r} {-(z_min + z_max) / 2!r} {low!r}"
        ElementTree.SubElement(world, "geom", masks, type="hfield", hfield="map", pos=pos)
        return
    ElementTree.SubElement(world, "geom", masks, type="plane", size="0 0 1")
    if isinstance(terrain, SphereField):
        for (x, y, z), r in zip(terrain.centres, terrain.radii, strict=True):
            pos = f"{float(x)!r} {-float(z)!r} {float(y)!r}"
            ElementTree.SubElement(world, "geom", masks, type="sphere", size=repr(float(r)), pos=pos)


def _state(model: Any, simulation: Simulation, whole: int) -> Array:
    """The rover's start as MuJoCo's state."""
    data = mujoco.MjData(model)
    x, y, z = simulation.q[:3]
    data.qpos[:3] = x, -z, y
    turn = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])  # from y up to z up
    mujoco.mju_mat2Quat(data.qpos[3:7], (turn @ simulation.rotation @ turn.T).ravel())
    for name, angle in zip(simulation.model.dof_names[6:], simulation.q[6:], strict=True):
        data.qpos[model.joint(name).qposadr[0]] = angle
    state = np.empty(mujoco.mj_stateSize(model, whole))
    mujoco.mj_getState(model, data, state, whole)
    return state


def measure(row: Row, rovers: int, threads: int, seed: int, rounds: int = ROUNDS) -> dict[str, float]:
    """Microseconds of a step by engine, and the shares of general steps and of commands with an unsolved one."""
    rng = np.random.default_rng(seed)
    simulations = [rover_at_rest(row, rng) for _ in range(rovers)]
    description = row.model.to_dict()
    n = len(description["wheels"])
    masses = sum(solid["mass"] for solid in description["solids"])
    radius = statistics.mean(w.get("contact_radius") or w["radius"] for w in description["wheels"])
    torque = EFFORT * masses * 9.81 * radius / n
    limits = np.array([torque] * n + steering_limits(row.model))
    reports: list[Any] = []
    alone = simulations[: min(ALONE, rovers)]
    beside = in_mujoco(simulations, threads, bodies=row.bodies)
    engines: dict[str, tuple[int, Player]] = {
        "batch": (rovers, together(SimulationBatch(simulations, threads=threads), n)),
        "alone": (len(alone), one_by_one(alone, reports)),
    } | {name: (rovers, play) for name, play in beside.items()}
    seconds: dict[str, list[float]] = {name: [] for name in engines}
    for _ in range(rounds + WARM_UP):
        commands = rng.uniform(-1.0, 1.0, (COMMANDS, rovers, 2 * n)) * limits
        for name, (count, play) in engines.items():
            start = time.perf_counter()
            play(commands)
            seconds[name].append((time.perf_counter() - start) / (count * COMMANDS * STEPS_A_COMMAND))
    general = sum(report.fallbacks for report in reports) / (STEPS_A_COMMAND * len(reports))
    return {name: 1e6 * statistics.median(times[WARM_UP:]) for name, times in seconds.items()} | {
        "general": general,
        "unsolved": sum(not report.is_converged for report in reports) / len(reports),
    }


def main() -> None:
    """Measures and prints."""
    parser = argparse.ArgumentParser(description="Cost of a step of any rover on any ground, beside MuJoCo.")
    parser.add_argument("--rovers", type=int, default=64)
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--seed", type=int, help="of commands and grounds; drawn, where not given")
    parser.add_argument("--row", default="", help="only rows with this text in their name")
    parser.add_argument("--robot", type=Path, action="append", default=[], help="a URDF or MJCF, in rows of its own")
    parser.add_argument("--save", action="store_true", help="write docs/comparison/rollout.json; other rows are kept")
    given = parser.parse_args()
    seed = int(np.random.SeedSequence().entropy % (1 << 32)) if given.seed is None else given.seed
    console = Console(width=160, highlight=False)
    packages = f"rover-gym {metadata.version('rover-gym')}, MuJoCo {metadata.version('mujoco')}"
    console.print(f"{processor()}; {packages}; seed {seed}; {given.rovers} rovers, {given.threads} thread(s)")
    console.print(
        f"{'us a step of 5 ms':<32}{'alone':>8}{'batch':>8}{'MuJoCo':>9}{'elliptic':>9}{'general':>9}{'unsolved':>9}"
    )
    for row in rows(given.robot):
        if given.row in row.name:
            found = measure(row, given.rovers, given.threads, seed)
            times = f"{found['alone']:9.1f}{found['batch']:9.1f}{found['MuJoCo']:9.1f}{found['elliptic']:9.1f}"
            console.print(f"{row.name:<32}{times}{found['general']:9.2%}{found['unsolved']:9.2%}")
            if given.save:
                save(row.name, found, {"seed": seed, "rovers": given.rovers, "threads": given.threads})


def save(row: str, found: dict[str, float], meta: dict[str, Any]) -> None:
    """Writes a row of `rollout.json`, with when and where it was measured."""
    path = CHART / "rollout.json"
    data: dict[str, Any] = json.loads(path.read_text(encoding="utf-8")) if path.exists() else {"rows": []}
    meta |= {"processor": processor(), "date": datetime.now(tz=UTC).date().isoformat(), "mujoco": mujoco.__version__}
    line = {"row": row, **{name: found[name] for name in ("alone", "batch", *MUJOCO)}, **meta}
    kept = [other for other in data["rows"] if other["row"] != row]
    data["rows"] = sorted([*kept, line], key=lambda one: str(one["row"]))
    path.write_text(json.dumps(data, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
