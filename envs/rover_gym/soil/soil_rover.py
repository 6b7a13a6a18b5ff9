"""The two-wheel rover, placed on a bed and settled."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from rover_gym.mechanics import OptionError, SoilSimulation
from rover_gym.soil.bed import Bed, settled_bed, slowness, step_count
from rover_gym.validation import number, refuse, vector

#: Wheel radius of the rover and distance of its axles from its centre, m.
WHEEL_RADIUS, HALF_LENGTH = 0.2, 0.4
SETTLING = 0.2  # s, settling time of the rover at 9.81 m/s^2


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
    """The two-wheel rover, at rest at the left end of a settled bed.

    The rover starts just above the disks and settles for 0.2 s (at 9.81 m/s^2) before time 0.

    Args:
        bed: The soil; by default `settled_bed` makes one from `count`, `layers` and `seed`.
        count: Number of disks of the default bed.
        layers: Number of layers of the default bed.
        seed: Seed of the default bed.
        start: x of the rover's centre, m.
        rover: Keyword arguments of `TwoWheelRoverSimulation` that describe another rover: `mass`, `wheel_mass`, ...
        **options: Options of `SoilSimulation`.

    Raises:
        OptionError: The rover would overlap a wall, or an option is out of range.
        ModelError: The rover is not valid.
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
