"""Files of FCLIB: every way to store a matrix, local and global problems, and files that are none."""

from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
import scipy.sparse

from rover_gym import solve_friction_contact
from rover_gym.core import ProblemError
from rover_gym.exports import read_fclib, write_fclib

FORMS = {"csc": -1, "csr": -2, "triplets": None}


def put(group: h5py.Group, name: str, matrix: Any, form: str) -> None:
    """Stores a matrix as FCLIB's own writer does, with room for more entries than there are."""
    matrix = scipy.sparse.coo_array(matrix)
    if form == "triplets":
        first, second, entries, nz = *matrix.coords, matrix.data, matrix.nnz
    else:
        packed = matrix.tocsc() if form == "csc" else matrix.tocsr()
        first, nz = packed.indptr, FORMS[form]
        second, entries = np.append(packed.indices, [0, 0]), np.append(packed.data, [9.0, 9.0])
    for key, value in (("m", matrix.shape[0]), ("n", matrix.shape[1]), ("nz", nz), ("nzmax", len(entries))):
        group[f"{name}/{key}"] = np.array([value], np.int32)
    group[f"{name}/p"], group[f"{name}/i"] = np.asarray(first, np.int32), np.asarray(second, np.int32)
    group[f"{name}/x"] = entries


def machine(seed: int = 3) -> dict[str, np.ndarray]:
    """Two contacts of a body with eight velocities, two of which are tied to others."""
    draw = np.random.default_rng(seed)
    root = draw.normal(size=(8, 8))
    return {
        "M": root @ root.T + 8 * np.eye(8),
        "H": draw.normal(size=(8, 6)),
        "G": draw.normal(size=(8, 2)),
        "f": draw.normal(size=8) * 5,
        "w": draw.normal(size=6),
        "b": draw.normal(size=2),
        "mu": np.array([0.3, 0.8]),
    }


def write_global(path: Path, given: dict[str, np.ndarray], form: str = "csc", *, tied: bool = True) -> Path:
    with h5py.File(path, "w") as file:
        group = file.create_group("fclib_global")
        group["spacedim"] = np.array([3], np.int32)
        for name in ("M", "H", "G") if tied else ("M", "H"):
            put(group, name, given[name], form)
        for name in ("f", "w", "mu", "b") if tied else ("f", "w", "mu"):
            group[f"vectors/{name}"] = given[name]
        group["info/title"] = np.bytes_(b"a body")
    return path


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("tied", [False, True])
def test_a_global_problem_has_the_velocities_of_its_machine(tmp_path: Path, form: str, tied: bool) -> None:
    given = machine()
    problem = read_fclib(write_global(tmp_path / "global.hdf5", given, form, tied=tied))
    answer = solve_friction_contact(problem.W, problem.q, problem.mu, 1e-12, dimension=problem.dimension)
    assert answer.report.status == "converged"
    assert problem.title == "a body"
    assert problem.impulses is None
    # The machine's own equations, with the impulses as a load.
    load = given["H"] @ answer.impulses.ravel() + given["f"]
    if tied:
        G = given["G"]
        whole = np.block([[given["M"], -G], [G.T, np.zeros((2, 2))]])
        v = np.linalg.solve(whole, np.concatenate([load, -given["b"]]))[:8]
    else:
        v = np.linalg.solve(given["M"], load)
    np.testing.assert_allclose(given["H"].T @ v + given["w"], answer.velocities.ravel(), atol=1e-10)


def test_a_local_problem_may_have_multipliers(tmp_path: Path) -> None:
    """Eliminating the ties of a global problem by hand gives a local one with V and R, and the same W and q."""
    given = machine()
    inverse = np.linalg.inv(given["M"])
    H, G, f = given["H"], given["G"], given["f"]
    with h5py.File(tmp_path / "local.hdf5", "w") as file:
        group = file.create_group("fclib_local")
        group["spacedim"] = np.array([3], np.int32)
        for name, matrix in (("W", H.T @ inverse @ H), ("V", H.T @ inverse @ G), ("R", G.T @ inverse @ G)):
            put(group, name, matrix, "csr")
        group["vectors/q"], group["vectors/mu"] = H.T @ inverse @ f + given["w"], given["mu"]
        group["vectors/s"] = G.T @ inverse @ f + given["b"]
    ours = read_fclib(tmp_path / "local.hdf5")
    same = read_fclib(write_global(tmp_path / "global.hdf5", given))
    np.testing.assert_allclose(ours.W.toarray(), same.W.toarray(), atol=1e-12)
    np.testing.assert_allclose(ours.q, same.q, atol=1e-12)


@pytest.mark.parametrize("kind", ["dense", "sparse"])
@pytest.mark.parametrize("dimension", [2, 3])
def test_written_problems_are_read_again(tmp_path: Path, kind: str, dimension: int) -> None:
    n = 4 * dimension
    root = np.random.default_rng(1).normal(size=(n, n))
    dense = root @ root.T
    rows = scipy.sparse.bsr_array(dense, blocksize=(dimension, dimension))
    W = {"dense": dense, "sparse": rows}[kind]
    q = np.tile([-1.0, 0.4, 0.2][:dimension], 4)
    solution = solve_friction_contact(W, q, 0.5, dimension=dimension)
    path = write_fclib(tmp_path / "new/p.hdf5", W, q, 0.5, dimension=dimension, solution=solution, title="four blöcks")
    problem = read_fclib(path)
    np.testing.assert_array_equal(problem.W.toarray(), dense)
    np.testing.assert_array_equal(problem.q, q)
    np.testing.assert_array_equal(problem.mu, np.full(4, 0.5))
    np.testing.assert_array_equal(problem.impulses, solution.impulses)
    assert problem.dimension == dimension
    assert problem.title == "four blöcks"


@pytest.mark.parametrize(
    ("damage", "field"),
    [
        (lambda file: file.move("fclib_local", "other"), "path"),
        (lambda file: file.pop("fclib_local/spacedim"), "spacedim"),
        (lambda file: file["fclib_local/spacedim"].write_direct(np.array([4], np.int32)), "spacedim"),
        (lambda file: file["fclib_local/spacedim"].write_direct(np.array([2], np.int32)), "spacedim"),
        (lambda file: file.pop("fclib_local/W/x"), "W/x"),
        (lambda file: file["fclib_local/W/i"].write_direct(np.full(9, 3, np.int32)), "W"),
        (lambda file: file["fclib_local/W/p"].write_direct(np.array([0, 9, 9, 70], np.int32)), "W"),
        (lambda file: file["fclib_local/W/m"].write_direct(np.array([4], np.int32)), "W"),
        (lambda file: file["fclib_local/vectors/q"].write_direct(np.array([0, np.nan, 0])), "vectors/q"),
        (lambda file: file.create_dataset("solution/r", data=np.zeros(2)), "solution/r"),
    ],
)
def test_damaged_files_are_refused_by_name(tmp_path: Path, damage: Any, field: str) -> None:
    path = write_fclib(tmp_path / "p.hdf5", np.ones((3, 3)), [-1.0, 0.0, 0.0], 0.5)
    with h5py.File(path, "r+") as file:
        damage(file)
    with pytest.raises(ProblemError) as refused:
        read_fclib(path)
    assert refused.value.field == field


def test_other_files_are_refused(tmp_path: Path) -> None:
    (tmp_path / "text.hdf5").write_text("no HDF5")
    with pytest.raises(ProblemError, match="is no HDF5 file"):
        read_fclib(tmp_path / "text.hdf5")
    with pytest.raises(FileNotFoundError):
        read_fclib(tmp_path / "missing.hdf5")


@pytest.mark.parametrize(
    ("change", "field"),
    [
        ({"W": np.ones((2, 3))}, "W"),
        ({"q": [1.0, 2.0]}, "q"),
        ({"q": [1.0, np.inf, 2.0]}, "q"),
        ({"mu": [0.5, 0.5]}, "mu"),
        ({"dimension": 4}, "dimension"),
        ({"solution": solve_friction_contact(np.eye(6), np.zeros(6), 0.5)}, "solution"),
    ],
)
def test_a_wrong_problem_is_refused_and_nothing_written(tmp_path: Path, change: dict[str, Any], field: str) -> None:
    given: dict[str, Any] = {"W": np.eye(3), "q": [-1.0, 0.0, 0.0], "mu": 0.5} | change
    with pytest.raises(ProblemError) as refused:
        write_fclib(tmp_path / "p.hdf5", **given)
    assert refused.value.field == field
    assert not list(tmp_path.iterdir())
