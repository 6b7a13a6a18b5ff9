"""Which steps take the usual effort, in lanes, and which take more."""

from typing import Any

import numpy as np
import pytest
from rovers import placed, with_fields

from rover_gym import Plane, RoverModel, Simulation, SphereField
from rover_gym.core import SimulationBatch

LANES = {"AVX-512": 8, "AVX2": 4, "baseline": 1}


def steering_joints(model: RoverModel) -> list[str]:
    return [model.dof_names[i] for i in model.steering_joint_indices]


@pytest.mark.parametrize("terrain", [Plane(), SphereField.rug()])
@pytest.mark.parametrize("welded", [False, True])
def test_the_rover_steps_in_lanes_welded_or_not(terrain: Plane | SphereField, welded: bool) -> None:
    model = RoverModel()
    simulation = Simulation(model.weld(steering_joints(model)) if welded else model, terrain)
    assert simulation.lanes == LANES[SimulationBatch([simulation]).instruction_set]


def test_the_newton_variant_takes_its_steps_alone() -> None:
    simulation = Simulation(variant="newton")
    assert simulation.lanes == 1
    assert simulation.step(3).fallbacks == 0


@pytest.mark.parametrize(
    "options",
    [
        {"restitution": 0.25},
        {"warm_start": False},
        {"materials": {("wheel", "ground"): (0.7, 0.4)}},
        {"solver": "newton"},
        {"solver": "nsgs", "tolerance": 1e-8},
    ],
)
def test_rebounds_methods_and_cold_starts_are_fast(options: dict[str, Any]) -> None:
    simulation = Simulation(**options)
    assert simulation.step(20).fallbacks < 4  # it starts in the ground


def test_a_machine_on_a_stand_and_one_that_is_pushed_are_fast() -> None:
    stand = {"joint": "revolute", "axis": [0.0, 0.0, 1.0], "position": [0.0, 0.6, 0.0]}
    simulation = Simulation(with_fields(RoverModel(), {"trunk": stand}))
    simulation.apply_wrench("trunk", force=[0.0, 10.0, 0.0])
    assert simulation.step(20).fallbacks == 0


@pytest.mark.parametrize(
    "changes",
    [
        {"limits": [-0.5, 0.5]},
        {"damping": 3.0},
        {"spring": {"stiffness": 50.0}},
        {"armature": 0.2},
        {"joint": "prismatic"},
        {"coupled": {"joint": "front_axle", "ratio": -0.5}, "hold": None},
        {"friction": 5.0},
    ],
)
def test_joints_and_forces_of_every_kind_step_in_lanes(changes: dict[str, Any]) -> None:
    simulation = Simulation(with_fields(RoverModel(), {"left_bogie": changes}))
    simulation.step(200)
    simulation.set_wheel_torques([20.0] * 6)
    assert simulation.step(20).fallbacks == 0


@pytest.mark.parametrize("name", ["mars-rover", "open-rover", "four-steered", "skid-steered"])
def test_rovers_of_the_gallery_step_in_lanes(name: str) -> None:
    simulation = Simulation(RoverModel.named(name))
    simulation.step(200)
    assert simulation.step(20).fallbacks == 0


def test_bodies_that_touch_the_ground_or_each_other_step_in_lanes() -> None:
    simulation = placed(Simulation(with_fields(RoverModel(), self_contact=True)), y=0.6, roll=np.pi)
    report = simulation.step(200)
    assert "box" in simulation.contacts.kinds
    assert report.fallbacks < 40


def test_a_report_counts_steps_that_take_more_than_the_usual_effort() -> None:
    # A base that turns by more than half a radian in a step is taken in parts.
    simulation = placed(Simulation(gravity=[0.0, 0.0, 0.0]), 150.0 * np.eye(21)[3], y=50.0)
    assert simulation.step(3).fallbacks == 3
