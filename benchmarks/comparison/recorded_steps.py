"""Single steps from recorded states, before and after a change that must not alter them.

    python -m comparison.recorded_steps --record FILE     # with the build of before
    python -m comparison.recorded_steps --compare FILE    # with the build of now

Some sixty drives of every engine, ground, wheel, joint, law and variant are recorded every 50 ms: state, command, and
the state one step later, taken from there without a warm start. The comparison takes each step anew and lists the
drives in which a coordinate or a velocity differs by more than `EQUAL`, relative to the largest of the drive. Steps are
compared one by one, since contacts that make and break part the ways of any two computations in the end.
"""

import argparse
import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from api.test_derivatives_of_loops import four_bar, slider_crank, with_a_bar
from machines import FOUR, machine
from machines.test_rollers import platform
from machines.test_tracks import tracked
from rich.console import Console
from torture.joined import _scene as joined_scene

from rover_gym import HeightField, Plane, RoverModel, Simulation, SphereField, TriangleMesh
from rover_gym.core import (
    BallSimulation,
    DiskSimulation,
    GrainSimulation,
    Line,
    MirroredRoverSimulation,
    RoverGrainSimulation,
    Sine,
    SoftGround,
    TwoWheelRoverSimulation,
    ball_packing,
    disk_packing,
)
from rover_gym.envs.sand_ground import sand_rover
from rover_gym.ground.sand import named_soil

Arrays = tuple[npt.NDArray[np.float64], ...]
#: Time between two states that are recorded, s, and how many there are of each drive.
SAMPLE, SAMPLES = 0.05, 24
#: Difference of two steps that are the same.
EQUAL = 1e-9


@dataclass(frozen=True)
class Engine:
    """How a kind of simulation is read, set and commanded.

    Attributes:
        state: Attributes of its state, in the order in which `set_state` takes them.
        draw: Draws a command.
        command: Gives it.
    """

    state: tuple[str, ...]
    draw: Callable[[Any, np.random.Generator], Arrays] = lambda _sim, _generator: ()
    command: Callable[..., None] = lambda _sim, *_command: None

    def read(self, sim: Any) -> Arrays:
        """Its state."""
        return tuple(getattr(sim, name) for name in self.state)

    def write(self, sim: Any, *state: Any) -> None:
        """Sets a state, without a warm start."""
        sim.set_state(*state)


def _rover_command(sim: Any, generator: np.random.Generator) -> Arrays:
    limits = np.minimum(sim.model.wheel_torque_limits, 0.4 * 9.81 * sim.model.mass)
    torques = limits * generator.uniform(-0.4, 1.0, len(limits))
    steered = np.array(sim.model.steering_joint_indices) >= 0
    return torques, np.where(steered, 0.5 * sim.model.steering_limit * generator.uniform(-1.0, 1.0, len(limits)), 0.0)


ROVER = Engine(("q", "v"), _rover_command, lambda sim, torques, steering: sim.set_commands(torques, steering))
PLANAR = Engine(
    ("q", "v"),
    lambda sim, generator: (20.0 * generator.uniform(-0.4, 1.0, len(sim.torques)),),
    lambda sim, torques: sim.set_torques(torques) if len(torques) else None,
)
DISKS = Engine(("position", "velocity"))
BALLS = Engine(("position", "velocity", "spin"))


class AmongBalls(Engine):
    """A rover and balls."""

    def read(self, sim: Any) -> Arrays:
        return *ROVER.read(sim.rover), *BALLS.read(sim.grains)

    def write(self, sim: Any, *state: Any) -> None:
        ROVER.write(sim.rover, *state[:2])
        BALLS.write(sim.grains, *state[2:])


AMONG_BALLS = AmongBalls(
    (),
    lambda sim, generator: _rover_command(sim.rover, generator),
    lambda sim, torques, steering: sim.rover.set_commands(torques, steering),
)

Made = tuple[Engine, Callable[[], Any]]


def _on(model: RoverModel, terrain: Any, heading: float = 0.3, height: float = 0.004, **options: Any) -> Simulation:
    """A rover a few millimetres over a ground."""
    sim = Simulation(model, terrain, **options)
    q = model.resting_pose(sim.terrain, (0.0, 0.0), heading)
    q[1] += height
    sim.set_state(model.close_loops(q)[0])
    return sim


def _linkage(model: RoverModel, v: list[float]) -> Simulation:
    sim = Simulation(model)
    q, rates = model.close_loops(np.zeros(model.nq), np.array(v))
    sim.set_state(q, rates)
    return sim


def _pushed(wrench: npt.NDArray[np.float64]) -> Simulation:
    sim = _on(RoverModel(), Plane())
    sim.apply_wrench("trunk", force=wrench[:3], moment=wrench[3:])
    return sim


def _box(terrain: Any, shape: dict[str, Any]) -> Simulation:
    """A body that falls turning onto a ground."""
    solid = {"name": "body", "joint": "free", "mass": 2.0, "shape": shape, "collides": True}
    sim = Simulation(RoverModel.from_dict({"name": "body", "solids": [solid]}), terrain)
    q, v = np.zeros(6), np.zeros(6)
    q[1], q[3:6], v[3:] = 0.6, (0.3, 0.2, 0.1), (2.0, 1.0, -3.0)
    sim.set_state(q, v)
    return sim


def _balls() -> GrainSimulation:
    radius, mass, position = ball_packing(60, radius_min=0.03, radius_max=0.04, mass=0.2, width=0.5, depth=0.5)
    return GrainSimulation(radius, mass, position, walls=[[0.0, 0.0, 0.0, 0.0, 1.0, 0.0]], time_step=0.002)


def _among_balls() -> RoverGrainSimulation:
    model = RoverModel.named("open-rover")
    rover = _on(model, Plane(), time_step=0.002)
    radius = np.full(12, 0.03)
    position = np.column_stack((np.linspace(0.3, 0.9, 12), np.full(12, 0.031), 0.2 * (-1.0) ** np.arange(12)))
    grains = GrainSimulation(radius, np.full(12, 0.2), position, terrain=Plane(), time_step=0.002)
    return RoverGrainSimulation(rover, grains)


def drives() -> dict[str, Made]:
    """All of them by name."""
    hills = HeightField.fractal(20.0, 0.2, 0.15, seed=2)
    rocks = SphereField.rocks(0.2, (-6.0, -6.0, 6.0, 6.0), 3, max_diameter=0.25, ground=Plane())
    generator = np.random.default_rng(5)
    step = TriangleMesh([[0.5, 0.0, -4.0], [4.0, 0.1, -4.0], [4.0, 0.1, 4.0], [0.5, 0.0, 4.0]], [[0, 2, 1], [0, 3, 2]])
    grounds = {
        "plane": Plane(),
        "slope": Plane.tilted(float(np.radians(12.0)), 0.5),
        "rocks": rocks,
        "hills": hills,
        "ramp": [Plane(), step],
    }
    found: dict[str, Made] = {}
    for name in RoverModel.names():
        for ground, terrain in grounds.items():
            found[f"{name}, {ground}"] = (ROVER, partial(_on, RoverModel.named(name), terrain))
    options: dict[str, dict[str, Any]] = {
        "newton": {"variant": "newton"},
        "theta 0.6": {"theta": 0.6},
        "implicit": {"theta": 1.0},
        "restitution": {"restitution": 0.4, "height": 0.1},
        "nsgs": {"solver": "nsgs"},
        "newton's method": {"solver": "newton"},
        "proximal": {"solver": "proximal"},
        "without projection": {"stabilisation": "none"},
        "tolerance 1e-6": {"tolerance": 1e-6},
        "20 ms": {"time_step": 0.02},
        "1 ms": {"time_step": 0.001},
        "smooth": {"friction": 0.0},
        "rough": {"friction": 1.5},
        "Mars": {"gravity": [0.0, -3.71, 0.0]},
    }
    for name, given in options.items():
        found[f"rover among rocks, {name}"] = (ROVER, partial(_on, RoverModel(), rocks, **given))
    rigid = RoverModel().replace(wheel_stiffness=0.0)
    found["rigid wheels, rocks"] = (ROVER, partial(_on, rigid, rocks))
    wide = rigid.to_dict()
    wide["wheels"] = [wheel | {"width": 0.15, "rounding": 0.02} for wheel in wide["wheels"]]
    found["wide wheels, ramp"] = (ROVER, partial(_on, RoverModel.from_dict(wide), grounds["ramp"]))
    found["tracks, rocks"] = (ROVER, partial(_on, tracked(), rocks))
    found["rollers, slope"] = (ROVER, partial(_on, platform(), grounds["slope"]))
    found["cart, hills"] = (ROVER, partial(_on, machine("cart", FOUR), hills))
    found["bar differential, hills"] = (ROVER, partial(_on, with_a_bar(), hills))
    found["four-bar"] = (ROVER, partial(_linkage, four_bar(), [2.0, 0.0, 0.0, 1.0]))
    found["four-bar with dry joints"] = (ROVER, partial(_linkage, four_bar(0.3), [2.0, 0.0, 0.0, 1.0]))
    found["slider-crank"] = (ROVER, partial(_linkage, slider_crank(), [3.0, 0.0, 0.0]))
    found["pushed"] = (ROVER, partial(_pushed, generator.normal(0.0, 100.0, 6)))
    shapes: dict[str, dict[str, Any]] = {
        "box": {"kind": "box", "size": [0.3, 0.2, 0.4]},
        "capsule": {"kind": "capsule", "radius": 0.1, "height": 0.3},
        "ellipsoid": {"kind": "ellipsoid", "radii": [0.1, 0.2, 0.15]},
    }
    for name, shape in shapes.items():
        found[f"{name}, hills"] = (ROVER, partial(_box, hills, shape))
    for seed in range(4):
        found[f"joined machines {seed}"] = (ROVER, partial(joined_scene, np.random.default_rng(seed)))
    for soil in ("cmu-sand", "grc-1-loose"):
        sand = SoftGround(Plane(), named_soil(soil))
        found[f"sand, {soil}"] = (ROVER, partial(_on, sand_rover(), sand, height=0.0))
    found["ball, line"] = (PLANAR, partial(BallSimulation, Line(slope=-0.2)))
    found["two wheels, waves"] = (PLANAR, partial(TwoWheelRoverSimulation, Sine(0.05, 1.0)))
    found["mirrored rover, line"] = (PLANAR, partial(MirroredRoverSimulation, Line()))
    found["disks"] = (DISKS, lambda: DiskSimulation(*disk_packing(60, width=0.6), ground=Line()))
    found["balls"] = (BALLS, _balls)
    found["rover among balls"] = (AMONG_BALLS, _among_balls)
    return found


def _start(make: Callable[[], Any]) -> Any:
    """A simulation at its start; scenes that are drawn are drawn alike every time."""
    if isinstance(make, partial) and make.args and isinstance(make.args[0], np.random.Generator):
        make = partial(make.func, np.random.default_rng(int(make.args[0].bit_generator.seed_seq.entropy)))  # type: ignore[attr-defined]
    return make()


def record(played: Mapping[str, Made], console: Console) -> dict[str, npt.NDArray[np.float64]]:
    """Drives, and takes a step from every state that is recorded."""
    found: dict[str, npt.NDArray[np.float64]] = {}
    for name, (engine, make) in played.items():
        sim, probe, generator = _start(make), _start(make), np.random.default_rng(1)
        rows: dict[str, list[npt.NDArray[np.float64]]] = {}
        for _ in range(SAMPLES):
            command, state = engine.draw(sim, generator), engine.read(sim)
            for part, given in enumerate((*state, *command)):
                rows.setdefault(f"{name}/in {part}", []).append(np.array(given))
            for part, after in enumerate(one_step(engine, probe, state, command)):
                rows.setdefault(f"{name}/out {part}", []).append(np.array(after))
            engine.command(sim, *command)
            sim.step(max(1, round(SAMPLE / sim.time_step)))
        found |= {key: np.array(values) for key, values in rows.items()}
        console.print(name)
    return found


def one_step(engine: Engine, probe: Any, state: Arrays, command: Arrays) -> Arrays:
    """The state a step after another."""
    engine.write(probe, *state)
    engine.command(probe, *command)
    probe.step()
    return engine.read(probe)


def compare(played: Mapping[str, Made], recorded: Mapping[str, npt.NDArray[np.float64]], console: Console) -> int:
    """Takes the recorded steps anew; how many of them differ."""
    different = 0
    for name, (engine, make) in played.items():
        probe = _start(make)
        n_state = len(engine.read(probe))
        inputs = [recorded[f"{name}/in {k}"] for k in range(sum(key.startswith(f"{name}/in ") for key in recorded))]
        outputs = [recorded[f"{name}/out {k}"] for k in range(n_state)]
        scales = [max(1.0, float(np.abs(part).max(initial=0.0))) for part in outputs]
        worst = []
        for i in range(len(outputs[0])):
            given = [part[i] for part in inputs]
            now = one_step(engine, probe, tuple(given[:n_state]), tuple(given[n_state:]))
            off = [np.abs(a - b[i]).max(initial=0.0) / scale for a, b, scale in zip(now, outputs, scales, strict=True)]
            worst.append(max(off))
        beyond = sum(off > EQUAL for off in worst)
        different += beyond
        if max(worst) > 0.0:
            console.print(f"{name}: {beyond} of {len(worst)} steps differ, at most {max(worst):.1e}")
    return different


def main() -> None:
    """Records or compares."""
    parser = argparse.ArgumentParser(description="Single steps from recorded states.")
    which = parser.add_mutually_exclusive_group(required=True)
    which.add_argument("--record", type=Path, metavar="FILE", help="write states and steps (.npz)")
    which.add_argument("--compare", type=Path, metavar="FILE", help="take the steps of a file anew")
    arguments = parser.parse_args()
    console = Console(width=120, highlight=False)
    if arguments.record is not None:
        np.savez_compressed(arguments.record, **record(drives(), console))  # type: ignore[arg-type]
        return
    with np.load(arguments.compare) as file:
        different = compare(drives(), dict(file), console)
    console.print(f"{different} steps differ by more than {EQUAL:g}")
    sys.exit(bool(different))


if __name__ == "__main__":
    main()
