"""Free rigid bodies in contact: their friction-contact problem (W, q, mu), and how the shelf stores it.

    u = Hᵀ v,   v = v_free + M̂⁻¹ H p,   so that   u = W p + q   with   W = Hᵀ M̂⁻¹ H,   q = Hᵀ v_free - u_wall.

A body's velocity is (speed of its mass centre, spin), both in the world's axes. The implicit part of the gyroscopic
couple makes M̂, and with it W, unsymmetric.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

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

    def save(self, path: Path) -> None:
        """Writes the problem where `shelf.load` and the reader of the Rust tests find it."""
        np.savez_compressed(
            path,
            dimension=np.int64(3),
            contacts=np.int64(len(self.mu)),
            mass=self.mass,
            inertia_inverse=np.ascontiguousarray(self.inertia_inverse),
            pairs=self.pairs,
            frames=self.frames,
            levers=self.levers,
            q=self.q,
            mu=self.mu,
        )


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
