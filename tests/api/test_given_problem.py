"""Friction-contact problems as users give them: SciPy's sparse arrays, one mu for all, the residuals on the way."""

import numpy as np
import pytest
import scipy.sparse
from hypothesis import given, settings
from hypothesis import strategies as st

import rover_gym
from rover_gym import solve_friction_contact


def chain(n, dimension, seed=0):
    """Contacts that feel their neighbours only: W (dense), q, mu."""
    rng = np.random.default_rng(seed)
    W = np.zeros((n * dimension, n * dimension))
    for i in range(n - 1):
        rows = np.arange(i * dimension, (i + 2) * dimension)
        jacobian = rng.normal(size=(2 * dimension, 2 * dimension + 1))
        W[np.ix_(rows, rows)] += jacobian @ jacobian.T
    q = rng.normal(size=n * dimension)
    q[::dimension] -= 1.0
    return W, q, rng.uniform(0.1, 0.9, n)


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("form", ["csr_array", "csc_array", "coo_array", "bsr_array", "lil_array", "csr_matrix"])
def test_every_sparse_form_gives_what_block_rows_give(form, dimension):
    W, q, mu = chain(40, dimension)
    sparse = getattr(scipy.sparse, form)(W)
    before = sparse.toarray().copy()
    blocks = scipy.sparse.csr_array(W).tobsr((dimension, dimension))
    rows = (blocks.indptr, blocks.indices, blocks.data)
    expected = solve_friction_contact(rows, q, mu, dimension=dimension)
    answer = solve_friction_contact(sparse, q, mu, dimension=dimension)
    assert answer.report.status == "converged"
    np.testing.assert_array_equal(answer.impulses, expected.impulses)
    np.testing.assert_array_equal(sparse.toarray(), before)


def test_entries_given_twice_are_added_and_the_callers_array_stays():
    index = np.array([0, 1, 2, 0])
    twice = scipy.sparse.coo_array((np.array([0.5, 1.0, 1.0, 0.5]), (index, index)), shape=(3, 3))
    answer = solve_friction_contact(twice, [-1.0, 0.5, 0.0], [0.7])
    np.testing.assert_allclose(answer.impulses, [[1.0, -0.5, 0.0]], atol=1e-12)
    assert twice.nnz == 4
    rows = scipy.sparse.csr_array((np.array([0.5, 0.5, 1.0, 1.0]), [0, 0, 1, 2], [0, 2, 3, 4]), shape=(3, 3))
    answer = solve_friction_contact(rows, [-1.0, 0.5, 0.0], [0.7])
    np.testing.assert_allclose(answer.impulses, [[1.0, -0.5, 0.0]], atol=1e-12)
    assert rows.nnz == 4


def test_a_contact_without_entries_is_named():
    W = scipy.sparse.csr_array(np.diag([1.0, 1.0, 1.0, 0.0, 0.0, 0.0]))
    with pytest.raises(rover_gym.ProblemError, match="contact 1 has W_NN = 0"):
        solve_friction_contact(W, np.full(6, -1.0), 0.5)


@pytest.mark.parametrize("shape", [(3, 6), (4, 4), (7, 7)])
def test_a_sparse_array_that_is_no_operator_is_refused(shape):
    with pytest.raises(rover_gym.ProblemError, match=r"W: must be square with 3 rows a contact") as error:
        solve_friction_contact(scipy.sparse.csr_array(np.ones(shape)), np.ones(shape[1]), 0.5)
    assert error.value.field == "W"


@settings(max_examples=30, deadline=None)
@given(mu=st.floats(0.0, 2.0), n=st.integers(2, 12) | st.just(0), dimension=st.sampled_from([2, 3]))
def test_one_mu_stands_for_all(mu, n, dimension):
    W, q, _ = chain(n, dimension)
    one = solve_friction_contact(W, q, mu, dimension=dimension)
    many = solve_friction_contact(W, q, np.full(n, mu), dimension=dimension)
    np.testing.assert_array_equal(one.impulses, many.impulses)


@pytest.mark.parametrize("mu", [0.5, [0.5, 0.5]])
def test_a_problem_in_the_plane_is_told_so(mu):
    W, q, _ = chain(2, 2)
    with pytest.raises(rover_gym.ProblemError, match="dimension=2") as error:
        solve_friction_contact(W, q, mu)
    assert error.value.field == "q"
    assert solve_friction_contact(W, q, mu, dimension=2).report.is_converged


@pytest.mark.parametrize("mu", [0.5, [0.5, 0.5, 0.5]])
def test_a_problem_in_space_is_told_so(mu):
    W, q, _ = chain(3, 3)
    with pytest.raises(rover_gym.ProblemError, match="dimension=3"):
        solve_friction_contact(W, q, mu, dimension=2)


@pytest.mark.parametrize("mu", [-0.1, np.nan, np.inf])
def test_a_bad_mu_for_all_is_refused(mu):
    with pytest.raises(rover_gym.ProblemError, match=r"mu\[0\]"):
        solve_friction_contact(np.eye(3), -np.ones(3), mu)


@pytest.mark.parametrize("solver", ["auto", "nsgs", "newton", "proximal", "admm", "relaxed"])
def test_the_history_leads_to_the_answer(solver):
    W, q, mu = chain(8, 3)
    plain = solve_friction_contact(W, q, mu, solver=solver)
    told = solve_friction_contact(W, q, mu, solver=solver, history=True)
    assert plain.history == []
    np.testing.assert_array_equal(plain.impulses, told.impulses)
    stages, iterations, residuals = zip(*told.history, strict=True)
    assert list(iterations) == sorted(iterations)
    assert iterations[-1] <= told.report.iterations
    assert set(stages) <= {stage for stage, _, _ in told.report.stages}
    assert np.isfinite(residuals).all()
    if solver == "relaxed":  # its history is of the relaxed law
        assert residuals[-1] <= 1e-8 < told.report.residual
    else:
        assert min(residuals) == told.report.residual
        assert residuals[-1] < 1e-3 * residuals[0]


def test_gauss_seidels_history_falls_steadily():
    W, q, mu = chain(40, 3)
    _, iterations, residuals = zip(*solve_friction_contact(W, q, mu, solver="nsgs", history=True).history, strict=True)
    assert iterations[0] == 0
    assert len(residuals) > 3
    assert (np.diff(np.log(residuals)) < 0.0).mean() > 0.8


def test_at_rest_there_is_no_history():
    assert solve_friction_contact(np.eye(3), np.zeros(3), 0.5, history=True).history == []
