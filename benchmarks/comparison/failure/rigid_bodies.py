"""Free rigid bodies with given contacts, stepped by Moreau and Jean's scheme: a test bench for law and solver.

The contact problem of a step is assembled here, densely, and handed to the solver under test. Bodies are few and turn
little in these scenes, so inertia is taken about the axes of the world.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from rover_gym import solve_friction_contact

Array = npt.NDArray[np.float64]
#: W, q, mu, last impulses -> impulses (n, d), whether it converged, iterations.
Solver = Callable[[Array, Array, Array, Array | None], tuple[Array, bool, int]]
G = 9.81  # m/s²; here z is up, as where these scenes come from
UP = (0.0, 0.0, 1.0)


def ours(name: str, tolerance: float = 1e-12, dimension: int = 3, max_iterations: int = 1000) -> Solver:
    """This project's solver of a name; `max_iterations` are sweeps of "nsgs" and steps of "newton".

    "relaxed" solves the convex law (no mu |u_T| in the normal row), as convex engines do.
    """

    def solve(W: Array, q: Array, mu: Array, initial: Array | None) -> tuple[Array, bool, int]:
        options: dict[str, Any] = {"dimension": dimension, "solver": name, "max_iterations": max_iterations}
        answer = solve_friction_contact(W, q, mu, tolerance, initial=initial, **options)
        report = answer.report
        return answer.impulses, report.status in ("converged", "relaxed"), report.iterations

    return solve


@dataclass
class Spring:
    """No solver: each contact is a spring and damper with regularised friction, as in `rust/comparison/src/penalty.rs`.

    `p_N = h max(0, -k g_N - c u_N)` where `g_N < 0`, `p_T = -mu p_N u_T / sqrt(u_T² + v_s²)`, u before the step. Gaps
    are those since the first step, which begins at 0, so it is for contacts that stay.

    Attributes:
        stiffness: k, N/m.
        damping: c, N s/m.
        slip_speed: v_s, m/s.
    """

    stiffness: float
    damping: float
    slip_speed: float
    gaps: Array = field(default_factory=lambda: np.zeros(0))

    def impulses(self, u: Array, mu: Array, h: float) -> Array:
        """(n, 3) from the local velocities (3 n,) before the step."""
        u = u.reshape(-1, 3)
        if len(self.gaps) != len(u):
            self.gaps = np.zeros(len(u))
        normal = np.where(self.gaps < 0.0, -self.stiffness * self.gaps - self.damping * u[:, 0], 0.0)
        normal = h * np.maximum(normal, 0.0)
        slip = np.hypot(np.linalg.norm(u[:, 1:], axis=1), self.slip_speed)
        return np.column_stack([normal, -(mu * normal / slip)[:, None] * u[:, 1:]])

    def move(self, u: Array, h: float) -> None:
        """Moves the gaps on with the local velocities (3 n,) after the step."""
        self.gaps = self.gaps + h * u[::3]


@dataclass
class Contact:
    """Between body `a` (the normal points to it) and body `b`, or the ground where b is -1."""

    a: int
    b: int
    point: Sequence[float]
    normal: Sequence[float]
    mu: float


@dataclass
class World:
    """Bodies by place, mass and (3,) inertia, where one number holds for all; `v` (n, 6) is linear and angular."""

    places: Array
    contacts: Callable[["World"], list[Contact]]
    masses: Array | float = 1.0
    inertias: Array | float = 1.0
    h: float = 1e-3  # s
    restitution: float = 0.0
    forces: Array | None = None
    gravity: float = G
    impulses: Array = field(default_factory=lambda: np.zeros((0, 3)))
    converged: bool = True
    iterations: int = 0

    def __post_init__(self) -> None:
        self.places = np.array(self.places, dtype=float)
        n = len(self.places)
        self.masses = np.broadcast_to(self.masses, n)
        self.inertias = np.broadcast_to(self.inertias, (n, 3))
        self.v = np.zeros((n, 6))

    def inverse_masses(self) -> Array:
        """(6 n,) of the diagonal mass matrix."""
        return 1.0 / np.column_stack([*[self.masses] * 3, self.inertias]).ravel()

    def jacobian(self, contacts: list[Contact]) -> Array:
        """(3 n_c, 6 n) local velocities from body velocities."""
        H = np.zeros((3 * len(contacts), 6 * len(self.masses)))
        for k, c in enumerate(contacts):
            n = np.asarray(c.normal) / np.linalg.norm(c.normal)
            t = np.cross(n, [0.0, 0.0, 1.0] if abs(n[2]) < 0.9 else [0.0, 1.0, 0.0])
            t /= np.linalg.norm(t)
            frame = np.array([n, t, np.cross(n, t)])
            for body, sign in ((c.a, 1.0), (c.b, -1.0)):
                if body >= 0:
                    r = np.asarray(c.point) - self.places[body]
                    H[3 * k : 3 * k + 3, 6 * body : 6 * body + 3] = sign * frame
                    H[3 * k : 3 * k + 3, 6 * body + 3 : 6 * body + 6] = sign * np.cross(r, frame)
        return H

    def step(self, solver: Solver | Spring) -> None:
        """One step, theta = 1/2."""
        h = self.h
        free = self.v.copy()
        free[:, 2] -= h * self.gravity
        if self.forces is not None:
            free[:, :3] += h * self.forces / self.masses[:, None]
        contacts = self.contacts(self)
        if contacts:
            H, inverse = self.jacobian(contacts), self.inverse_masses()
            mu = np.array([c.mu for c in contacts])
            before = H @ self.v.ravel()
            if isinstance(solver, Spring):
                self.impulses = solver.impulses(before, mu, h)
            else:
                q = H @ free.ravel()
                q[::3] += self.restitution * np.minimum(before[::3], 0.0)
                initial = self.impulses.ravel() if len(self.impulses) == len(contacts) else None
                self.impulses, converged, iterations = solver((H * inverse) @ H.T, q, mu, initial)
                self.converged &= converged
                self.iterations += iterations
            free = free + (inverse * (H.T @ self.impulses.ravel())).reshape(free.shape)
            if isinstance(solver, Spring):
                solver.move(H @ free.ravel(), h)
        else:
            self.impulses = np.zeros((0, 3))
        self.places = self.places + 0.5 * h * (self.v + free)[:, :3]
        self.v = free


def box_inertia(mass: float, size: Sequence[float]) -> Array:
    """(3,) about the centre."""
    a, b, c = size
    return mass / 12.0 * np.array([b * b + c * c, a * a + c * c, a * a + b * b])


def corners(size: Sequence[float]) -> list[tuple[float, float]]:
    """Of a box's face, around its centre."""
    return [(sx * size[0] / 2.0, sy * size[1] / 2.0) for sx in (-1, 1) for sy in (-1, 1)]


def stack(masses: Sequence[float], friction: Sequence[float], size: Sequence[float] = (0.2, 0.2, 0.2)) -> World:
    """Boxes on each other, four contacts between neighbours; `friction` from the ground up."""

    def contacts(world: World) -> list[Contact]:
        return [
            Contact(level, level - 1, (x + cx, y + cy, level * size[2]), UP, friction[level])
            for level, (x, y, _) in enumerate(world.places)
            for cx, cy in corners(size)
        ]

    places = [(0.0, 0.0, (level + 0.5) * size[2]) for level in range(len(masses))]
    return World(np.array(places), contacts, np.array(masses), np.array([box_inertia(m, size) for m in masses]))
