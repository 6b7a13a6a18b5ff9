"""Ten metres of every rover of the gallery stay within 1 cm of Pinocchio's path at fine steps."""

import json
from pathlib import Path

import numpy as np
import pytest
from models.drives import DRIVES, FRICTION, SAMPLE, commands, start

from rover_gym import RoverModel, Simulation

REFERENCES = json.loads(Path(__file__).with_name("drives.json").read_text(encoding="utf-8"))
#: Largest distance of the trunk's origin from the reference at any time, m.
BOUND = 0.01
#: The same at 0.5 ms. Where four wheels slide, the moment at which they let go is known to a few steps: at 0.25 ms the
#: distance is half as large.
FINE_BOUNDS = {"skid-steered": 7e-4}
FINE_BOUND = 2e-4


#: Stiffness and damping of four wheels on a rigid chassis in the reference, where the ground yields.
STIFF = {"skid-steered": (3.6e6, 1.3e4), "four-steered": (5.2e6, 1.8e4)}


def in_the_reference(name):
    """The wheels of the reference: rigid ones of six, nearly rigid ones of four that are not renewed as they roll."""
    if name not in STIFF:
        return RoverModel.named(name).replace(wheel_stiffness=0.0)
    stiffness, damping = STIFF[name]
    return RoverModel.named(name).replace(
        wheel_stiffness=stiffness, wheel_damping=damping, wheel_tangential_ratio=100.0, wheel_relaxation_length=100.0
    )


def path(name, **options):
    model = in_the_reference(name)
    sim = Simulation(model, friction=FRICTION, **options)
    sim.set_state(start(model))
    places = [sim.q[:3]]
    for torques, set_points in commands(model, DRIVES[name]):
        sim.set_commands(torques, set_points)
        report = sim.step(round(SAMPLE / sim.time_step))
        assert report.is_converged
        places.append(sim.q[:3])
    return np.array(places)


def distance(name, **options):
    found, reference = path(name, **options), np.array(REFERENCES[name]["path"])
    return float(np.linalg.norm(found - reference, axis=1).max())


def test_every_rover_of_the_gallery_drives_ten_metres():
    assert set(DRIVES) == set(REFERENCES) == set(RoverModel.names())
    for name, reference in REFERENCES.items():
        assert np.linalg.norm(np.diff(reference["path"], axis=0), axis=1).sum() >= 10.0, name


@pytest.mark.parametrize("name", DRIVES)
def test_a_drive_at_the_usual_step_stays_within_a_centimetre_of_the_reference(name):
    assert distance(name) < BOUND


@pytest.mark.parametrize("name", DRIVES)
def test_a_drive_at_a_fine_step_is_the_reference(name):
    assert distance(name, time_step=5e-4) < FINE_BOUNDS.get(name, FINE_BOUND)
