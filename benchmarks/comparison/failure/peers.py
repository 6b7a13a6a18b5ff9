"""Scenes of the rover for every installed engine, ours at its defaults among them; step 2 ms, settings of the chart."""

import math
from collections.abc import Iterator
from typing import Any

import numpy as np

from comparison.failure.finding import Row, for_each
from comparison.failure.rover import ODD_MASSES, G, with_odd_masses
from comparison.peers import Runner, Variant
from comparison.scene import Phase, RoverScene, rigid, steps_in
from comparison.scenes import parked

STEP = 2e-3  # s


def _flat(name: str, machine: dict[str, Any], height: float, phase: Phase, *, brake: bool = True) -> RoverScene:
    q = np.zeros(21)
    q[1] = height
    return RoverScene(name=name, title=name, machine=machine, q=q, phases=(phase,), brake=brake)


def _build(variant: Variant, scene: RoverScene) -> Runner:
    runner = variant.build(scene, STEP)
    runner.command(scene.phases[0])
    return runner


@for_each()
def creep(variant: Variant) -> Iterator[Row]:
    """Parked and braked below the friction angle of 34.99 degrees, over the last 2 of 6 s."""
    for degrees in (15.0, 30.0, 34.9):
        runner = _build(variant, parked.scene(degrees))
        runner.advance(steps_in(4.0, STEP))
        before = runner.position()
        runner.advance(steps_in(2.0, STEP))
        speed = float(np.linalg.norm(runner.position() - before)) / 2.0
        upright = float(runner.rotation()[1, 1]) > 0.5
        how = "" if speed <= 1e-9 else ("creeps" if speed < 0.1 else "slides") if upright else "overturns"
        yield f"parked on {degrees:g} degrees", "0", speed, 1e-9, "m/s", how


@for_each()
def slide(variant: Variant) -> Iterator[Row]:
    """Braked on 40 degrees: g (sin - mu cos) over the second of two seconds."""
    runner = _build(variant, parked.scene(40.0))
    runner.advance(steps_in(1.0, STEP))
    before = runner.speed()
    runner.advance(steps_in(1.0, STEP))
    a, gained = G * (math.sin(math.radians(40.0)) - 0.7 * math.cos(math.radians(40.0))), runner.speed() - before
    expected, how = "1.0455 m/s²: g (sin - mu cos)", f"{gained:.4f} m/s²"
    yield "sliding on 40 degrees", expected, abs(gained / a - 1.0), 1e-3, "relative", how


@for_each()
def mass_ratios(variant: Variant) -> Iterator[Row]:
    """Trunk a hundred times heavier, wheels a thousand times lighter: dropped from 5 cm, it stands."""
    for title, odd in ODD_MASSES.items():
        runner = _build(variant, _flat(title, with_odd_masses(rigid(), *odd), 0.40, Phase(3.0)))
        runner.advance(steps_in(3.0, STEP))
        low, speed = float(0.35 - runner.position()[1]), runner.speed()
        off = max(abs(low), speed)
        how = "" if off <= 1e-3 else f"stands {1e3 * low:.0f} mm too low, moves at {speed:.1e} m/s"
        yield title, "stands at 0.35 m", off, 1e-3, "m, m/s", how


@for_each()
def wheel_spin(variant: Variant) -> Iterator[Row]:
    """260 N m a wheel for 2.3 s: all slip, v = mu g t = 15.79 m/s."""
    machine = rigid(wheel_torque_limit=1e3)
    runner = _build(variant, _flat("spin", machine, 0.35, Phase(2.3, torques=(260.0,) * 6), brake=False))
    runner.advance(steps_in(2.3, STEP))
    off = abs(runner.speed() / (0.7 * G * 2.3) - 1.0)
    how = f"{runner.speed():.2f} m/s" + ("" if float(runner.rotation()[1, 1]) > 0.5 else ", overturned")
    yield "wheels spinning at 260 N m", "15.79 m/s: mu g t", off, 1e-2, "relative", how


@for_each()
def drop(variant: Variant) -> Iterator[Row]:
    """From 2 m: how far the trunk goes below its height at rest, which is how deep the wheels go."""
    depth = 0.0
    for extra in (0.0, 0.004, 0.008):  # the impact falls elsewhere in its step
        runner = _build(variant, _flat("drop", rigid(), 2.35 + extra, Phase(1.0)))
        for _ in range(steps_in(1.0, STEP)):
            runner.advance(1)
            depth = max(depth, 0.35 - float(runner.position()[1]))
    yield "dropped from 2 m, depth", "not above a step's way, 12.5 mm", depth, 1.25e-2, "m"


#: The scenes in the order of the table.
SCENES = (creep, slide, mass_ratios, wheel_spin, drop)
