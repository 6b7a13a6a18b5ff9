"""Rovers in a pose, and models with other fields."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from rover_gym import Plane, RoverModel, Simulation, Terrain
from rover_gym.core import Snapshot


def placed(sim: Simulation, v: npt.ArrayLike | None = None, **coordinates: float) -> Simulation:
    """The simulation with these coordinates, by name, the others zero; at rest unless `v` is given."""
    q = np.zeros(sim.model.nq)
    q[[sim.model.dof_names.index(name) for name in coordinates]] = list(coordinates.values())
    sim.set_state(q, v)
    return sim


def standing(
    model: RoverModel | None = None,
    terrain: Terrain | None = None,
    place: npt.ArrayLike = (0.0, 0.0),
    heading: float = 0.0,
    *,
    lift: float = 0.0,
    **options: Any,
) -> Simulation:
    """A simulation of a rover at rest, all wheels on the ground, or lifted from there."""
    sim = Simulation(model, terrain, **options)
    q = sim.model.resting_pose(sim.terrain, place, heading)
    q[1] += lift
    sim.set_state(q)
    return sim


def slid(model: RoverModel, degrees: float, heading: float = 0.0, seconds: float = 2.0, **options: Any) -> float:
    """How far a braked machine moves on a slope, m."""
    sim = standing(model, Plane.tilted(np.radians(degrees), 0.0), heading=heading, **options)
    start = sim.q
    sim.brake()
    assert sim.step(round(seconds / sim.time_step)).is_converged
    return float(np.linalg.norm((sim.q - start)[:3]))


def goes_on_alike(sim: Any, steps: int) -> bool:
    """Whether a simulation that is put back to its snapshot takes the same steps again, bit for bit."""
    saved = sim.snapshot()
    sim.step(steps)
    end = sim.snapshot().to_bytes()
    sim.restore(Snapshot.from_bytes(saved.to_bytes()))
    sim.step(steps)
    return sim.snapshot().to_bytes() == end


def with_fields(
    model: RoverModel,
    solids: Mapping[str, Mapping[str, Any]] = {},
    wheels: Mapping[str, Any] = {},
    **fields: Any,
) -> RoverModel:
    """The model with other fields of its description: of solids by name, of all wheels, and of itself."""
    description = model.to_dict()
    description["solids"] = [solid | solids.get(solid["name"], {}) for solid in description["solids"]]
    description["wheels"] = [wheel | wheels for wheel in description["wheels"]]
    return RoverModel.from_dict(description | fields)
