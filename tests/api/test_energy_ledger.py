"""The report explains every change of the energy: work, springs, dampers, friction, projection, the scheme."""

from typing import Any, Literal

import numpy as np
import pytest
from rovers import placed, standing

from rover_gym import HeightField, Plane, RoverModel, Simulation
from rover_gym.core import StepReport

Variant = Literal["linearised", "newton"]
BALL = {"kind": "sphere", "radius": 0.1}


def explained(report: StepReport) -> float:
    """The change of the energy that the entries of a report add up to."""
    given = report.energy_supplied + report.energy_released + report.energy_lifted
    return given - report.energy_dissipated - report.energy_lost - report.energy_removed


def machine(*solids: dict[str, Any], **fields: Any) -> RoverModel:
    return RoverModel.from_dict({"format": 1, "name": "machine", "solids": list(solids), **fields})


def oscillator(hz: float, **fields: Any) -> RoverModel:
    """A ball of 2 kg on a spring, on a base that is fixed."""
    spring = {"stiffness": 2.0 * (2.0 * np.pi * hz) ** 2, "rest": 0.1}
    base = {"name": "base", "joint": "fixed", "position": [0, 0, 0], "mass": 1.0, "shape": BALL}
    slider = {"name": "slider", "parent": "base", "joint": "prismatic", "axis": [1, 0, 0], "position": [0, 0, 0]}
    return machine(base, {**slider, "mass": 2.0, "shape": BALL, "spring": spring, **fields})


def waves() -> HeightField:
    x, z = np.meshgrid(np.linspace(-8.0, 8.0, 81), np.linspace(-8.0, 8.0, 81), indexing="ij")
    return HeightField(0.06 * np.sin(3.0 * x) * np.cos(2.0 * z), 0.2, (-8.0, -8.0))


@pytest.mark.parametrize("variant", ["linearised", "newton"])
@pytest.mark.parametrize(("hz", "step"), [(1.0, 0.02), (10.0, 0.005), (10.0, 0.02), (60.0, 0.005)])
def test_an_undamped_spring_keeps_its_energy(hz: float, step: float, variant: Variant) -> None:
    """A spring of 10 Hz lost 55% of its energy in 10 s at 5 ms, and `energy_lost` was 0."""
    sim = Simulation(oscillator(hz), Plane(offset=10.0), gravity=(0, 0, 0), time_step=step, variant=variant)
    sim.set_state([0.0])
    start = sim.energy().total
    report = sim.step(round(4.0 / step))
    assert sim.energy().total == pytest.approx(start, rel=1e-9)
    assert report.energy_lost == pytest.approx(0.0, abs=1e-9 * start)


@pytest.mark.parametrize("variant", ["linearised", "newton"])
def test_a_spring_that_the_step_does_not_resolve_loses_energy_and_the_report_says_so(variant: Variant) -> None:
    sim = Simulation(oscillator(100.0), Plane(offset=10.0), gravity=(0, 0, 0), variant=variant)
    sim.set_state([0.0])
    start = sim.energy().total
    report = sim.step(20)
    assert report.energy_lost == pytest.approx(start - sim.energy().total, rel=1e-9)
    assert report.energy_lost > 0.5 * start


def test_a_held_joint_stores_energy_and_a_damper_takes_it() -> None:
    sim = Simulation(oscillator(1.0, spring={"stiffness": 0.0}), Plane(offset=10.0), gravity=(0, 0, 0))
    sim.set_state([0.0])
    sim.hold(["slider"], [0.2], stiffness=80.0, damping=0.0)
    assert sim.energy().potential == pytest.approx(0.5 * 80.0 * 0.04)
    sim.step(300)
    assert sim.energy().total == pytest.approx(1.6, rel=1e-9)
    sim.hold(["slider"], [0.0], stiffness=80.0, damping=5.0)
    before = sim.energy().total
    report = sim.step(1000)
    assert report.energy_of_set_points == pytest.approx(before - 1.6, rel=1e-9)
    assert report.energy_dissipated == pytest.approx(before, rel=0.01)
    assert explained(report) == pytest.approx(sim.energy().total - before, abs=1e-9)


def linkages() -> list[RoverModel]:
    """Machines with springs, stops, motors, dry friction, a loop, wheels that yield."""
    leg = {"parent": "a", "joint": "revolute", "axis": [0, 0, 1], "mass": 3.0, "collides": True}
    leg["shape"] = {"kind": "box", "size": [0.3, 0.1, 0.1]}
    trunk = {"name": "a", "mass": 5.0, "shape": {"kind": "box", "size": [0.6, 0.2, 0.3]}, "collides": True}
    motor = {"torque_limit": 40.0, "motor": {"stall_torque": 60.0, "no_load_speed": 20.0}}
    spring = {"stiffness": 200.0, "rest": 0.3}
    legs = machine(
        trunk,
        {**leg, "name": "b", "position": [0.4, 0.0, 0.0], "spring": spring, "limits": [-0.4, 0.4]},
        {**leg, "name": "c", "position": [-0.4, 0.0, 0.0], "friction": 3.0, "drive": motor},
        {**leg, "name": "d", "position": [0.0, 0.2, 0.2], "damping": 2.0, "armature": 0.1},
    )
    bar = {"mass": 1.0, "shape": BALL, "axis": [0, 0, 1]}
    closed = machine(
        {"name": "a", "mass": 4.0, "shape": {"kind": "box", "size": [0.6, 0.1, 0.3]}, "collides": True},
        {**bar, "name": "b", "parent": "a", "joint": "revolute", "position": [-0.2, 0.1, 0.0], "spring": spring},
        {**bar, "name": "c", "parent": "b", "joint": "revolute", "position": [0.0, 0.3, 0.0]},
        {**bar, "name": "d", "parent": "a", "joint": "revolute", "position": [0.2, 0.1, 0.0]},
        loops=[{"name": "pin", "kind": "connect", "solid": "c", "other": "d", "position": [0.4, 0.0, 0.0]}],
    )
    return [legs, closed]


def checked_step(sim: Simulation, n: int = 1) -> StepReport:
    before = sim.energy()
    report = sim.step(n)
    after = sim.energy()
    sizes = before.kinetic + abs(before.potential) + after.kinetic + abs(after.potential)
    sizes += abs(report.energy_supplied) + abs(report.energy_dissipated)
    assert after.total - before.total == pytest.approx(explained(report), abs=1e-9 * sizes)
    return report


@pytest.mark.parametrize("variant", ["linearised", "newton"])
@pytest.mark.parametrize("name", [*RoverModel.names()])
def test_the_entries_of_a_drive_add_up_to_its_change_of_energy(name: str, variant: Variant) -> None:
    """Springs and held joints were in no entry, and the work of the actuators neither."""
    rng = np.random.default_rng(3)
    model = RoverModel.named(name)
    sim = standing(model, waves(), heading=0.4, variant=variant)
    n = len(model.wheel_names)
    reports = []
    for _ in range(6):
        torques = rng.uniform(-30.0, 60.0, n)
        steers = np.array(model.steering_joint_indices) >= 0
        sim.set_commands(torques, steers * rng.uniform(-0.3, 0.3, n))
        reports += [checked_step(sim, k) for k in (1, 1, 8)]
    assert reports[0].followed_by(reports[1]).energy_supplied != 0.0
    assert any(report.energy_dissipated > 0.0 for report in reports)


@pytest.mark.parametrize("variant", ["linearised", "newton"])
@pytest.mark.parametrize("index", [0, 1])
def test_the_entries_of_a_tumble_add_up(index: int, variant: Variant) -> None:
    rng = np.random.default_rng(7)
    model = linkages()[index]
    sim = placed(Simulation(model, Plane(), variant=variant), rng.normal(size=model.nv), y=0.6)
    lifted = 0.0
    for _ in range(30):
        sim.set_joint_torques(rng.uniform(-5.0, 5.0, len(model.joint_names)))
        lifted += sum(checked_step(sim).energy_lifted for _ in range(6))
    assert lifted > 0.0
