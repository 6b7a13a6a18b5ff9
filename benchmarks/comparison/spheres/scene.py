"""A scene of free spheres, perhaps with a box among them, and how the errors of a run are taken."""

from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
G = 9.81  # m/s²


@dataclass(frozen=True)
class Slab:
    """A box that lies on the plane, is pushed and carries spheres.

    Attributes:
        mass: kg.
        half: (3,) half of its edges, m.
        friction: Coulomb's coefficient between it and a sphere.
        push: (3,) force at its centre, N.
        centre: (3,) at the start, m.
    """

    mass: float
    half: Array
    friction: float
    push: Array
    centre: Array

    @property
    def inertia(self) -> Array:
        """(3,) about its own axes, kg m²."""
        square = self.half**2
        return self.mass / 3.0 * (square.sum() - square)


@dataclass(frozen=True)
class FreeScene:
    """Spheres over the plane y = 0, all at rest.

    Attributes:
        name: As in the results.
        duration: s.
        restitution: Newton's e of every contact.
        friction: Coulomb's coefficient of every contact but the slab's with spheres.
        mass: Of a sphere, kg.
        radius: Of a sphere, m.
        centres: (n, 3) of the spheres, m.
        slab: The box, if there is one.
        accelerations: (2, 3) of the slab and of the spheres on it, exact, m/s²; None where there is no closed form.
    """

    name: str
    duration: float
    restitution: float
    friction: float
    mass: float
    radius: float
    centres: Array
    slab: Slab | None
    accelerations: Array | None

    @classmethod
    def of(cls, given: dict[str, Any]) -> "FreeScene":
        """From what the program `free_spheres --start` prints."""
        slab = given["slab"]
        exact = given["accelerations"]
        return cls(
            name=given["scene"],
            duration=given["duration"],
            restitution=given["restitution"],
            friction=given["friction"],
            mass=given["mass"],
            radius=given["radius"],
            centres=np.array(given["centres"]),
            slab=slab and Slab(**{k: np.array(v) if isinstance(v, list) else v for k, v in slab.items()}),
            accelerations=None if exact is None else np.array(exact),
        )


class FreeRunner(Protocol):
    """An engine with the scene in it."""

    def push(self) -> None:
        """From now on the slab's force acts."""

    def advance(self, steps: int) -> None:
        """Takes steps. This alone is timed."""

    def state(self) -> tuple[Array, Array]:
        """Centres and velocities of the centres (n, 3), the slab's last, m and m/s."""


def penetration(centres: Array, radius: float) -> float:
    """Sum of squared overlaps, m², of spheres with one another and with the plane y = 0."""
    i, j = np.triu_indices(len(centres), 1)
    between = 2.0 * radius - np.linalg.norm(centres[i] - centres[j], axis=1)
    depths = np.concatenate([between, radius - centres[:, 1]])
    return float(np.square(np.maximum(depths, 0.0)).sum())


def energy(scene: FreeScene, centres: Array, velocities: Array) -> float:
    """Of the centres' motion, J: without friction no sphere spins."""
    return float(scene.mass * (0.5 * np.square(velocities).sum() + G * centres[:, 1].sum()))


def velocity_error(accelerations: Array, velocities: Array, time: float) -> float:
    """Squared error of the slab's velocity and the mean of the spheres' squared errors, m²/s²."""
    slab, ball = accelerations * time
    balls = np.square(velocities[:-1] - ball).sum(axis=1)
    return float(np.square(velocities[-1] - slab).sum() + balls.mean())
