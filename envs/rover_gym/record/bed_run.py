"""What recordings of disks and of balls have in common."""

import numpy as np
import numpy.typing as npt

from rover_gym.record.channels import RESIDUAL, Channel, energy_channels
from rover_gym.record.run import Array


def bed_channels(chains: tuple[int, int], strongest: str, counted: str, *, packed: bool = False) -> tuple[Channel, ...]:
    """The channels of all grains: energy, number of contacts, overlap, strongest contacts, residual.

    Args:
        chains: Shape of a row of the strongest contacts.
        strongest: What such a row says.
        counted: What the number of contacts counts.
        packed: Whether the strongest contacts are packed.
    """
    strongest = f"strongest contacts{strongest} (N); zeros where none are"
    return (
        *energy_channels(" of all", "all mass centres at height 0"),
        Channel("n_contacts", "1", counted, read="n_contacts"),
        Channel("penetration", "m", "deepest overlap", read="sim.penetration"),
        Channel("force_chains", "m, N", strongest, chains, packed=packed, read="force_chains"),
        RESIDUAL,
    )


def strongest_contacts(
    n: int, bodies: npt.NDArray[np.int64], points: Array, strengths: Array, position: Array
) -> Array:
    """(n, 2 D + 1) the n strongest contacts: ends, m, and force, N; zeros where there are fewer.

    A contact of two grains joins their centres, any other a grain's centre and the point that it touches.

    Args:
        n: Number of rows.
        bodies: (n_contacts, 2) indices of the bodies.
        points: (n_contacts, D) m.
        strengths: (n_contacts,) N.
        position: (n_grains, 3), the centres in its first D columns, m.
    """
    D = points.shape[1]
    kept = np.argsort(-strengths, kind="stable")[:n]
    kept = kept[strengths[kept] > 0.0]
    chains, centres = np.zeros((n, 2 * D + 1)), position[:, :D]
    for side, ends in enumerate(bodies[kept].T):
        is_grain = (ends >= 0) & (ends < len(centres))
        places = np.where(is_grain[:, None], centres[np.where(is_grain, ends, 0)], points[kept])
        chains[: len(kept), D * side : D * (side + 1)] = places
    chains[: len(kept), -1] = strengths[kept]
    return chains
