"""Forces and moments of the ground on the wheels, in the wheels' frames."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from rover_gym.ros.rover_frames import ros_vector

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rover_gym.core import RoverModel, Simulation

Array = npt.NDArray[np.float64]


def wheel_links(model: RoverModel) -> list[str]:
    """The frame of each wheel."""
    return [wheel["solid"] for wheel in model.to_dict()["wheels"]]


def wheel_wrenches(simulation: Simulation, links: Sequence[str]) -> list[tuple[Array, Array]]:
    """Force (3,), N, and moment (3,), N m, on each wheel in the last step, about its origin, in its frame (z up)."""
    contacts, sand, poses, n = simulation.contacts, simulation.sand(), simulation.poses(), len(links)
    forces, moments = np.zeros((n, 3)), np.zeros((n, 3))
    if sand is not None:
        forces, moments = forces + sand["force"], moments + sand["moment"]
    on_wheels = np.flatnonzero(contacts.wheels >= 0)
    if len(on_wheels):
        wheels = contacts.wheels[on_wheels]
        pushes = np.einsum("ci,cij->cj", contacts.impulses[on_wheels], contacts.frames[on_wheels])
        pushes /= simulation.settings["time_step"]
        arms = contacts.points[on_wheels] - np.array([poses[link][0] for link in links])[wheels]
        np.add.at(forces, wheels, pushes)
        np.add.at(moments, wheels, np.cross(arms, pushes))
    turns = [poses[link][1] for link in links]
    return [
        (ros_vector(force @ turn), ros_vector(moment @ turn))
        for force, moment, turn in zip(forces, moments, turns, strict=True)
    ]
