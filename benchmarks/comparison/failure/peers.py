"""Scenes of the rover for every installed engine, ours at its defaults among them; step 2 ms, settings of the chart."""

import math
from collections.abc import Iterator
from typing import Any

import numpy as np

from comparison.failure.finding import Finding
from comparison.peers import Runner, Variant
from comparison.scene import Phase, RoverScene, steps_in
from comparison.scenes import parked
from rover_gym import RoverModel

G = 9.81  # m/s²
STEP = 2e-3  # s


def _flat(name: str, machine: dict[str, Any], height: float, phase: Phase, *, brake: bool = True) -> RoverScene:
    q = np.zeros(21)
    q[1] = height
    return RoverScene(name=name, title=name, machine=machine, q=q, phases=(phase,), brake=brake)


def _build(variant: Variant, scene: RoverScene) -> Runner:
    runner = variant.build(scene, STEP)
    runner.command(scene.phases[0])
    return runner


def creep(variant: Variant) -> Iterator[Finding]:
    """Parked and braked below the friction angle of 34.99 degrees, over the last 2 of 6 s."""
    for degrees in (15.0, 30.0, 34.9):
        runner = _build(variant, parked.scene(degrees))
        runner.advance(steps_in(4.0, STEP))
        before = runner.position()
        runner.advance(steps_in(2.0, STEP))
        speed = float(np.linalg.norm(runner.position() - before)) / 2.0
        upright = float(runner.rotation()[1, 1]) > 0.5
        how = "" if speed <= 1e-9 else ("creeps" if speed < 0.1 else "slides") if upright else "overturns"
        yield Finding(
            f"parked on {degrees:g} degrees", "0", variant.engine + ", " + variant.name, speed, 1e-9, "m/s", how
        )


def slide(variant: Variant) -> Iterator[Finding]:
    """Braked on 40 degrees: g (sin - mu cos) over the second of two seconds."""
    runner = _build(variant, parked.scene(40.0))
    runner.advance(steps_in(1.0, STEP))
    before = runner.speed()
    runner.advance(steps_in(1.0, STEP))
    a = G * (math.sin(math.radians(40.0)) - 0.7 * math.cos(math.radians(40.0)))
    off = abs((runner.speed() - before) / a - 1.0)
    yield Finding(
        "sliding on 40 degrees",
        "1.0455 m/s²: g (sin - mu cos)",
        variant.engine + ", " + variant.name,
        off,
        1e-3,
        "relative",
        f"{runner.speed() - before:.4f} m/s²",
    )


def mass_ratios(variant: Variant) -> Iterator[Finding]:
    """Trunk a hundred times heavier, wheels a thousand times lighter: dropped from 5 cm, it stands."""
    for title, part, factor in (
        ("trunk 100 times heavier", "trunk", 100.0),
        ("wheels 1000 times lighter", "wheel", 1e-3),
    ):
        machine = RoverModel().replace(wheel_stiffness=0.0, motor=None).to_dict()
        for solid in machine["solids"]:
            if solid["name"].startswith(part):
                solid["mass"] *= factor
        runner = _build(variant, _flat(title, machine, 0.40, Phase(3.0)))
        highest = 0.0
        for _ in range(15):
            runner.advance(steps_in(0.2, STEP))
            highest = max(highest, runner.speed())
        off = float(abs(runner.position()[1] - 0.35))
        how = (
            ""
            if max(off, runner.speed()) <= 1e-3
            else f"stands {1e3 * (0.35 - runner.position()[1]):.0f} mm too low, moves at {runner.speed():.1e} m/s"
        )
        yield Finding(
            title,
            "stands at 0.35 m",
            variant.engine + ", " + variant.name,
            max(off, runner.speed()),
            1e-3,
            "m, m/s",
            how,
        )


def wheel_spin(variant: Variant) -> Iterator[Finding]:
    """260 N m a wheel for 2.3 s: all slip, v = mu g t = 15.79 m/s."""
    machine = RoverModel().replace(wheel_torque_limit=1e3, wheel_stiffness=0.0, motor=None).to_dict()
    scene = _flat("spin", machine, 0.35, Phase(2.3, torques=(260.0,) * 6), brake=False)
    runner = _build(variant, scene)
    runner.advance(steps_in(2.3, STEP))
    off = abs(runner.speed() / (0.7 * G * 2.3) - 1.0)
    upright = float(runner.rotation()[1, 1]) > 0.5
    yield Finding(
        "wheels spinning at 260 N m",
        "15.79 m/s: mu g t",
        variant.engine + ", " + variant.name,
        off,
        1e-2,
        "relative",
        f"{runner.speed():.2f} m/s" + ("" if upright else ", overturned"),
    )


def drop(variant: Variant) -> Iterator[Finding]:
    """From 2 m: how far the trunk goes below its height at rest, which is how deep the wheels go."""
    depth = 0.0
    for extra in (0.0, 0.004, 0.008):  # the impact falls elsewhere in its step
        runner = _build(
            variant,
            _flat("drop", RoverModel().replace(wheel_stiffness=0.0, motor=None).to_dict(), 2.35 + extra, Phase(1.0)),
        )
        for _ in range(steps_in(1.0, STEP)):
            runner.advance(1)
            depth = max(depth, 0.35 - float(runner.position()[1]))
    yield Finding(
        "dropped from 2 m, depth",
        "not above a step's way, 12.5 mm",
        variant.engine + ", " + variant.name,
        depth,
        1.25e-2,
        "m",
    )


#: The scenes in the order of the table.
SCENES = (creep, slide, mass_ratios, wheel_spin, drop)
