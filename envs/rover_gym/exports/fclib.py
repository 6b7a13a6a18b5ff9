"""Contact problems in the HDF5 files of FCLIB, a public collection (Acary et al. 2014)."""

from __future__ import annotations

from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from rover_gym.core import ProblemError
from rover_gym.core.extras import require
from rover_gym.core.files import written_whole
from rover_gym.core.validation import array, checked, refuse

if TYPE_CHECKING:
    from collections.abc import Iterator

    import h5py

    from rover_gym.core import FrictionContactSolution

#: What the data set `nz` of a matrix says: the form in which its entries are stored. From 0 on they are triplets.
COLUMNS, ROWS = -1, -2


@dataclass(frozen=True)
class ContactProblem:
    """A problem of n_c contacts with d components each, as `solve_friction_contact` takes it.

    Attributes:
        W: Delassus operator, a sparse array of SciPy's, (n_c d, n_c d).
        q: Free velocity, (n_c d,), contact by contact: normal, tangents.
        mu: Friction coefficients, (n_c,).
        dimension: d, 2 or 3.
        impulses: Impulses that the file gives as a solution, (n_c, d); None if it has none.
        title: What the file says the problem is; may be empty.
    """

    W: Any
    q: npt.NDArray[np.float64]
    mu: npt.NDArray[np.float64]
    dimension: int
    impulses: npt.NDArray[np.float64] | None = None
    title: str = ""


@checked(path=Path)
def read_fclib(path: str | Path) -> ContactProblem:
    """Reads a problem from an HDF5 file of FCLIB; needs the extra `planning`.

    A file has a local problem, u = W r + V l + q with V^T r + R l + s = 0, or a global one, M v = H r + G l + f with
    u = H^T v + w and G^T v + b = 0. Unknowns other than the impulses r are eliminated, and so is the mass matrix M.

    Raises:
        ProblemError: It is no HDF5 file, or a data set is missing or does not fit; the error names it.
        OSError: The file does not exist or cannot be read.
        MissingExtraError: SciPy is not installed.
    """
    import h5py  # noqa: PLC0415 - slow to load

    path = Path(path)
    if not h5py.is_hdf5(path):
        path.open("rb").close()  # a file that is missing or protected
        refuse(ProblemError, "path", str(path), "is no HDF5 file")
    with h5py.File(path, "r") as file:
        if "fclib_local" in file:
            group, form = file["fclib_local"], _local
        elif "fclib_global" in file:
            group, form = file["fclib_global"], _global
        else:
            refuse(ProblemError, "path", str(path), "has neither fclib_local nor fclib_global")
        dimension = _whole(group, "spacedim")
        if dimension not in (2, 3):
            refuse(ProblemError, "spacedim", dimension, "must be 2 or 3")
        W, q = form(group)
        if len(q) % dimension:
            refuse(ProblemError, "spacedim", dimension, f"must divide the {len(q)} rows of W")
        mu = _vector(group, "vectors/mu", len(q) // dimension)
        impulses = None
        if "solution/r" in file:
            impulses = _vector(file, "solution/r", len(q)).reshape(-1, dimension)
        return ContactProblem(W, q, mu, dimension, impulses, _text(group, "info/title"))


@checked(path=Path, dimension=int, solution=("FrictionContactSolution", None), title=str)
def write_fclib(
    path: str | Path,
    W: Any,
    q: npt.ArrayLike,
    mu: npt.ArrayLike,
    *,
    dimension: int = 3,
    solution: FrictionContactSolution | None = None,
    title: str = "",
) -> Path:
    """Writes a problem as a local one of FCLIB, whole or not at all; needs the extra `planning`.

    Args:
        path: HDF5 file to write.
        W: Delassus operator, (n_c d, n_c d), an array or a sparse one of SciPy's.
        q: Free velocity, (n_c d,).
        mu: Friction coefficients, (n_c,), or one for all contacts.
        dimension: Components d of a contact, 2 or 3.
        solution: What `solve_friction_contact` returned for it.
        title: What the problem is.

    Raises:
        ProblemError: An array has a wrong shape or an entry that is not finite; nothing is written.
        OSError: The file cannot be written.
        MissingExtraError: SciPy is not installed.
    """
    import h5py  # noqa: PLC0415 - slow to load

    sparse = require("scipy.sparse", "planning")
    if dimension not in (2, 3):
        refuse(ProblemError, "dimension", dimension, "must be 2 or 3")
    free = array("q", q, error=ProblemError).ravel()
    if not len(free) or len(free) % dimension:
        refuse(ProblemError, "q", len(free), f"needs {dimension} entries a contact")
    n_contacts = len(free) // dimension
    matrix = W if sparse.issparse(W) else array("W", W, error=ProblemError)
    coefficients = array("mu", mu, error=ProblemError)
    if coefficients.size == 1:
        coefficients = np.full(n_contacts, coefficients.item())
    for field, values, shape in (("W", matrix, (len(free),) * 2), ("mu", coefficients, (n_contacts,))):
        if values.shape != shape:
            refuse(ProblemError, field, values.shape, f"must have the shape {shape}")
    rows = sparse.csr_array(matrix)
    for field, entries in (("W", rows.data), ("q", free), ("mu", coefficients)):
        if not np.isfinite(entries).all():
            refuse(ProblemError, field, entries[~np.isfinite(entries)][0], "must be finite")
    if solution is not None and solution.impulses.shape != (n_contacts, dimension):
        refuse(ProblemError, "solution", solution.impulses.shape, f"must have the shape {(n_contacts, dimension)}")
    with written_whole(path) as draft, h5py.File(draft, "w") as file:
        group = file.create_group("fclib_local")
        for name, number in (
            ("spacedim", dimension),
            ("W/m", len(free)),
            ("W/n", len(free)),
            ("W/nz", ROWS),
            ("W/nzmax", rows.nnz),
        ):
            group[name] = _integers(number)
        group["W/p"], group["W/i"], group["W/x"] = _integers(rows.indptr), _integers(rows.indices), rows.data
        group["vectors/q"], group["vectors/mu"] = free, coefficients
        if title:
            group["info/title"] = np.bytes_(title.encode())
        if solution is not None:
            file["solution/r"], file["solution/u"] = solution.impulses.ravel(), solution.velocities.ravel()
    return Path(path)


def _local(group: h5py.Group) -> tuple[Any, npt.NDArray[np.float64]]:
    """W and q of a local problem, without the multipliers l."""
    W = _matrix(group, "W")
    if W.shape[0] != W.shape[1]:
        refuse(ProblemError, "W", W.shape, "must be square")
    q = _vector(group, "vectors/q", W.shape[0])
    if "V" in group:
        V, R = _matrix(group, "V"), _matrix(group, "R")
        s = _vector(group, "vectors/s", R.shape[0])
        with _fitting("V, R"):
            W = W - V @ _solve(R, V.T)
            q = q - V @ _solve(R, s)
    return W, q


def _global(group: h5py.Group) -> tuple[Any, npt.NDArray[np.float64]]:
    """W and q of a global problem: the velocities v and multipliers l solve one linear system for each impulse."""
    sparse = require("scipy.sparse", "planning")
    M, H = _matrix(group, "M"), _matrix(group, "H")
    load, w = _vector(group, "vectors/f", M.shape[0]), _vector(group, "vectors/w", H.shape[1])
    with _fitting("M, H, G"):
        if "G" in group:
            G = _matrix(group, "G")
            M = sparse.block_array([[M, -G], [G.T, None]], format="csc")
            H = sparse.vstack([H, sparse.csc_array((G.shape[1], H.shape[1]))])
            load = np.concatenate([load, -_vector(group, "vectors/b", G.shape[1])])
        return H.T @ _solve(M, H), H.T @ _solve(M, load) + w


def _solve(matrix: Any, right: Any) -> Any:
    """The solution of a sparse system for a vector, or for the columns of a sparse matrix.

    Raises:
        ValueError: Shapes do not fit, or the matrix is singular.
    """
    linalg, sparse = require("scipy.sparse.linalg", "planning"), require("scipy.sparse", "planning")
    try:
        factor = linalg.splu(sparse.csc_array(matrix))
    except RuntimeError as error:
        raise ValueError(str(error)) from error
    if sparse.issparse(right):
        return sparse.csr_array(factor.solve(right.toarray()))
    return factor.solve(right)


@contextmanager
def _fitting(names: str) -> Iterator[None]:
    """Refuses matrices that do not fit together, or of which one is singular."""
    try:
        yield
    except ValueError as error:
        refuse(ProblemError, names, str(error), "the matrices do not fit")


def _matrix(group: h5py.Group, name: str) -> Any:
    """A sparse matrix, stored by rows, by columns or as triplets."""
    sparse = require("scipy.sparse", "planning")
    shape = _whole(group, f"{name}/m"), _whole(group, f"{name}/n")
    count = _whole(group, f"{name}/nz")
    first, second = (_data(group, f"{name}/{one}").astype(np.int64) for one in "pi")
    entries = _data(group, f"{name}/x").astype(np.float64)
    try:
        if count >= 0:
            return sparse.coo_array((entries[:count], (first[:count], second[:count])), shape=shape).tocsr()
        used = first[-1]  # nzmax may be larger
        by = sparse.csc_array if count == COLUMNS else sparse.csr_array
        matrix = by((entries[:used], second[:used], first), shape=shape)
        matrix.check_format(full_check=True)
        return matrix.tocsr()
    except (ValueError, IndexError) as error:
        refuse(ProblemError, name, str(error), f"is no sparse matrix of shape {shape}")


def _data(group: h5py.Group, name: str) -> npt.NDArray[Any]:
    """A data set of numbers, flat."""
    found = group.get(name)
    if found is None or getattr(found, "dtype", np.dtype("S1")).kind not in "iuf":
        refuse(ProblemError, name, found, "must be a data set of numbers")
    return np.asarray(found[()]).ravel()


def _whole(group: h5py.Group, name: str) -> int:
    """A data set of one integer."""
    found = _data(group, name)
    if len(found) != 1:
        refuse(ProblemError, name, found.tolist(), "must be one number")
    return int(found[0])


def _vector(group: h5py.Group, name: str, size: int) -> npt.NDArray[np.float64]:
    """A data set of `size` finite numbers."""
    found = _data(group, name).astype(np.float64)
    if len(found) != size or not np.isfinite(found).all():
        refuse(ProblemError, name, found, f"must be {size} finite numbers")
    return found


def _text(group: h5py.Group, name: str) -> str:
    """A text, empty where there is none."""
    found = group.get(name)
    value = b"" if found is None else found[()]
    return value.decode("utf-8", "replace") if isinstance(value, bytes) else str(value)


def _integers(values: object) -> npt.NDArray[np.int32]:
    """Integers as FCLIB reads them: 32 bits, one of them an array of one."""
    return np.atleast_1d(np.asarray(values)).astype(np.int32)
