"""The two-wheel rover, put down on a bed and come to rest."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from rover_gym.mechanics import OptionError, SoilSimulation
from rover_gym.soil.bed import Bed, settled_bed, slowness, step_count
from rover_gym.validation import number, refuse, vector

#: Radius of the rover's wheels and distance of its axles from its middle, m.
WHEEL_RADIUS, HALF_LENGTH = 0.2, 0.4
SETTLING = 0.2  # s, in which the rover comes to rest, at 9.81 m/s^2


def rover_on_soil(
    bed: Bed | None = None,
    *,
    count: int = 222,
    layers: int = 3,
    seed: int = 0,
    start: float = 0.7,
    rover: Mapping[str, Any] | None = None,
    **options: Any,
) -> SoilSimulation:
    """The two-wheel rover, at rest on a settled bed at its left end.

    It is put down just above the disks and comes to rest in 0.2 s (at 9.81 m/s^2), which are before time 0.

    Args:
        bed: The soil; the original's if not given.
        count: Disks of a bed that is not given.
        layers: Its layers.
        seed: Its seed.
        start: Place of the rover's middle, m.
        rover: Keyword arguments of `TwoWheelRoverSimulation` that describe another rover: `mass`, `wheel_mass`, ...
        **options: Of `SoilSimulation`.

    Raises:
        OptionError: The rover would stand in a wall, or an option is out of its range.
        ModelError: The rover cannot be.
    """
    if bed is None:
        shared = {name: options[name] for name in ("gravity", "friction", "time_step") if name in options}
        bed = settled_bed(count, layers, seed=seed, **shared)
    start = number("start", start)
    rover = {} if rover is None else rover
    if not isinstance(rover, Mapping):
        refuse(OptionError, "rover", rover, "must be a mapping of TwoWheelRoverSimulation's arguments")
    rover = dict(rover)
    radius = rover.get("wheel_radius", WHEEL_RADIUS)
    radii = np.array(vector("rover.wheel_radius", np.resize(radius, 2) if np.ndim(radius) == 0 else radius, 2))
    axles = np.array(
        [
            vector("rover.axle_a", rover.get("axle_a", (-HALF_LENGTH, 0.0)), 2),
            vector("rover.axle_b", rover.get("axle_b", (HALF_LENGTH, 0.0)), 2),
        ]
    )
    places = start + axles[:, 0]
    if (places - radii).min() < 0.0 or (places + radii).max() > bed.width:
        reason = f"puts a wheel out of the bed, which is {bed.width:.2f} m wide"
        refuse(OptionError, "start", start, reason)
    height = max(bed.clear_height(x, r) - y for x, r, y in zip(places, radii, axles[:, 1], strict=True))
    sim = SoilSimulation(
        bed.radius,
        bed.mass,
        bed.position,
        walls=bed.walls,
        rover=rover,
        machine=[start, height + 1e-4, 0.0, 0.0, 0.0],
        **options,
    )
    sim.step(step_count("gravity", SETTLING * slowness(sim), sim.time_step))
    sim.set_state(sim.position, sim.velocity, sim.machine, sim.machine_rate)
    return sim
