"""A problem of the shelf and its file: W, q and mu, where bodies are free by the factors of W.

    u = Hᵀ v,   v = v_free + M̂⁻¹ H p,   so that   u = W p + q   with   W = Hᵀ M̂⁻¹ H,   q = Hᵀ v_free - u_wall.

A body's velocity is (speed of its mass centre, spin), both in the world's axes. The implicit part of the gyroscopic
couple makes M̂, and with it W, unsymmetric. `tests/solver/npz.rs` reads the same files.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt
from comparison.problems import Problem

DATA = Path(__file__).parent / "data"
Array = npt.NDArray[np.float64]
Indices = npt.NDArray[np.int64]

GROUND = -1  # the body of a contact that does not move


@dataclass(frozen=True)
class FreeBodies:
    """A friction-contact problem of n_b free bodies with n_c contacts, by its factors.

    Attributes:
        mass: (n_b,) kg.
        inertia_inverse: (n_b, 3, 3) Inverse of the spins' block of M̂, world axes, 1/(kg m²); need not be symmetric.
        pairs: (n_c, 2) Bodies 1 and 2 of a contact; the normal points from 1 to 2, u is the velocity of 2 against 1.
        frames: (n_c, 3, 3) Rows: normal, tangent, tangent.
        levers: (n_c, 2, 3) From the mass centres of bodies 1 and 2 to the contact point, m.
        q: (3 n_c,) Free velocity, m/s, contact by contact.
        mu: (n_c,) Friction coefficients.
    """

    mass: Array
    inertia_inverse: Array
    pairs: Indices
    frames: Array
    levers: Array
    q: Array
    mu: Array

    def jacobian(self) -> Array:
        """Hᵀ (3 n_c, 6 n_b): local velocities of the bodies' velocities."""
        n_contacts, n_bodies = len(self.pairs), len(self.mass)
        jacobian = np.zeros((n_contacts, 3, n_bodies, 6))
        for side, sign in ((0, -1.0), (1, 1.0)):
            contact = np.flatnonzero(self.pairs[:, side] != GROUND)
            body, frame, lever = self.pairs[contact, side], self.frames[contact], self.levers[contact, side]
            jacobian[contact, :, body, :3] += sign * frame
            # e . (spin x lever) = (lever x e) . spin
            jacobian[contact, :, body, 3:] += sign * np.cross(lever[:, None], frame)
        return jacobian.reshape(3 * n_contacts, 6 * n_bodies)

    def apply_inverse_mass(self, momenta: Array) -> Array:
        """M̂⁻¹ times momenta (6 n_b, any)."""
        split = momenta.reshape(len(self.mass), 6, -1)
        velocities = np.empty_like(split)
        velocities[:, :3] = split[:, :3] / self.mass[:, None, None]
        velocities[:, 3:] = self.inertia_inverse @ split[:, 3:]
        return velocities.reshape(momenta.shape)

    def delassus(self) -> Array:
        """W (3 n_c, 3 n_c), 1/kg, dense."""
        jacobian = self.jacobian()
        return jacobian @ self.apply_inverse_mass(jacobian.T)


def frames_of(normals: Array) -> Array:
    """Right-handed frames (n, 3, 3) with the given unit normals (n, 3) as their first rows."""
    axis = np.eye(3)[np.abs(normals).argmin(axis=1)]
    tangent = np.cross(normals, axis)
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    return np.stack([normals, tangent, np.cross(normals, tangent)], axis=1)


def block_rows(W: Array) -> tuple[Indices, Indices, Array]:
    """The nonzero 3 x 3 blocks of a dense W, as `solve_friction_contact` takes them."""
    n_contacts = len(W) // 3
    blocks = W.reshape(n_contacts, 3, n_contacts, 3).swapaxes(1, 2)
    rows, columns = np.nonzero(np.any(blocks != 0.0, axis=(2, 3)))
    return np.searchsorted(rows, np.arange(n_contacts + 1)), columns, blocks[rows, columns]


@dataclass(frozen=True)
class Dense:
    """A problem by its operator W (n_c d, n_c d), 1/kg; q (n_c d,), m/s; mu (n_c,); d is 2 or 3."""

    W: Array
    q: Array
    mu: Array
    dimension: int = 3

    def delassus(self) -> Array:
        """W, as it is."""
        return self.W


def save(name: str, problem: FreeBodies | Dense, velocities: Array | None) -> None:
    """Writes a problem and, where they are unique, the velocities u (n_c d,) of its answer, m/s."""
    arrays = {key: np.ascontiguousarray(value) for key, value in vars(problem).items() if key != "dimension"}
    if velocities is not None:
        arrays["velocities"] = velocities
    dimension = problem.dimension if isinstance(problem, Dense) else 3
    np.savez_compressed(DATA / f"{name}.npz", dimension=np.int64(dimension), **arrays)


def names() -> list[str]:
    """The shelf's problems, smallest file first."""
    return [path.stem for path in sorted(DATA.glob("*.npz"), key=lambda path: (path.stat().st_size, path.stem))]


def load(name: str) -> tuple[Problem, Array | None]:
    """A problem of the shelf and, where they are unique, the velocities of its answer."""
    with np.load(DATA / f"{name}.npz") as data:
        arrays = dict(data)
    dimension, velocities = int(arrays.pop("dimension")), arrays.pop("velocities", None)
    stored = Dense(**arrays, dimension=dimension) if "W" in arrays else FreeBodies(**arrays)
    return Problem(name, stored.delassus(), stored.q, stored.mu, dimension), velocities
