"""`solve_friction_contact`: closed forms, Coulomb's law on random problems, bad input."""

import numpy as np
import pytest
import scipy.sparse
from hypothesis import given, settings, strategies as st
from refusals import refused
from rovers import placed

import rover_gym
from rover_gym import solve_friction_contact


def test_a_block_pushed_into_the_ground_sticks_slides_or_flies():
    eye = np.eye(3)
    stick = rover_gym.solve_friction_contact(eye, [-1.0, 0.5, 0.0], [0.7])
    np.testing.assert_allclose(stick.impulses, [[1.0, -0.5, 0.0]], atol=1e-12)
    slide = rover_gym.solve_friction_contact(eye, [-1.0, 2.0, 0.0], [0.7])
    np.testing.assert_allclose(slide.impulses, [[1.0, -0.7, 0.0]], atol=1e-12)
    np.testing.assert_allclose(slide.velocities, [[0.0, 1.3, 0.0]], atol=1e-12)
    fly = rover_gym.solve_friction_contact(eye, [1.0, 2.0, 0.0], [0.7])
    np.testing.assert_array_equal(fly.impulses, 0.0)
    plane = rover_gym.solve_friction_contact(np.eye(2), [-1.0, 2.0], [0.7], dimension=2)
    np.testing.assert_allclose(plane.impulses, [[1.0, -0.7]], atol=1e-12)
    for answer in (stick, slide, fly, plane):
        assert answer.report.status == "converged"


RIGID = rover_gym.RoverModel().replace(wheel_stiffness=0.0)
SOLVERS = ["auto", "nsgs", "newton", "proximal", "admm"]


@pytest.mark.parametrize("solver", SOLVERS)
def test_every_solver_gives_the_rovers_loads(solver):
    sim = rover_gym.Simulation(RIGID)
    sim.step()
    answer = rover_gym.solve_friction_contact(*sim.last_problem(), tolerance=1e-10, solver=solver, max_iterations=20000)
    assert answer.report.is_converged
    assert answer.impulses[:, 0].sum() == pytest.approx(960.0 * 9.81 * sim.time_step, rel=1e-6)
    assert np.abs(answer.velocities).max() < 1e-9


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("dimension", [2, 3])
def test_block_rows_and_an_unsymmetric_operator_are_taken_as_they_are(solver, dimension):
    # Two contacts that stick, made from their impulses: q = -W p.
    d = dimension
    blocks = np.stack([2 * np.eye(d), 0.3 * np.ones((d, d)), -0.2 * np.ones((d, d)), 3 * np.eye(d)])
    W = np.block([[blocks[0], blocks[1]], [blocks[2], blocks[3]]])
    impulses = np.tile([1.0, 0.2, -0.1][:d], 2)
    sparse = ([0, 2, 4], [0, 1, 0, 1], blocks)
    for operator in (W, sparse):
        answer = rover_gym.solve_friction_contact(
            operator, -W @ impulses, [0.5, 0.5], 1e-10, dimension=d, solver=solver
        )
        assert answer.report.is_converged
        assert answer.report.law == "coulomb"
        np.testing.assert_allclose(answer.impulses.ravel(), impulses, atol=1e-8)


def test_the_relaxed_law_says_that_it_is_another_law():
    answer = rover_gym.solve_friction_contact(np.eye(3), [-1.0, 2.0, 0.0], [0.5], solver="relaxed")
    assert (answer.report.status, answer.report.law, answer.report.is_converged) == ("relaxed", "relaxed", False)
    # It parts with mu |u_T|: p = 1.6 (1, -0.5), u = (0.6, 1.2).
    np.testing.assert_allclose(answer.velocities, [[0.6, 1.2, 0.0]], atol=1e-7)
    assert answer.report.velocity_error > 0.1
    with refused(rover_gym.OptionError, "solver"):
        rover_gym.Simulation(solver="relaxed")


def test_the_last_problem_is_that_of_the_velocities_where_the_position_was_projected():
    """`last_problem` returned the problem of the projection, whose q are gaps in metres."""
    sim = placed(rover_gym.Simulation(RIGID, warm_start=False), y=0.5)  # not by the fast step
    while sim.step().energy_lifted == 0.0:
        assert sim.time < 2.0
    W, q_free, _ = sim.last_problem()
    contacts = sim.contacts
    np.testing.assert_allclose(W @ contacts.impulses.ravel() + q_free, contacts.velocities.ravel(), atol=1e-9)


def test_a_warm_start_is_taken(sim):
    sim.step()
    problem = sim.last_problem()
    cold = rover_gym.solve_friction_contact(*problem)
    warm = rover_gym.solve_friction_contact(*problem, initial=cold.impulses)
    assert warm.report.iterations < cold.report.iterations


@pytest.mark.parametrize(
    ("field", "arguments"),
    [
        ("W", (np.eye(4), np.zeros(3), [0.5])),
        ("q", (np.eye(4), np.zeros(4), [0.5])),
        ("W", (np.ones((3, 2)), np.zeros(3), [0.5])),
        ("q", (np.eye(3), np.zeros(2), [0.5])),
        ("q", (np.eye(3), np.zeros(3), [0.5, 0.5])),
        ("mu[0]", (np.eye(3), np.zeros(3), [-0.5])),
        ("q[0]", (np.eye(3), [np.nan, 0.0, 0.0], [0.5])),
        ("W[0, 0]", (np.full((3, 3), np.inf), np.zeros(3), [0.5])),
        ("W", (np.diag([0.0, 1.0, 1.0]), np.zeros(3), [0.5])),
        ("W", (np.diag([1.0, 1.0, -1.0]), np.zeros(3), [0.5])),
        ("W", ([["a", "b"]], np.zeros(3), [0.5])),
        ("W", (([0, 1], [1], np.eye(3)[None]), np.zeros(3), [0.5])),
        ("W", (([0, 1], [0.5], np.eye(3)[None]), np.zeros(3), [0.5])),
        ("W", (([0, 1], [0], np.eye(2)[None]), np.zeros(3), [0.5])),
        ("W[0, 0]", (([0, 1], [0], np.full((1, 3, 3), np.nan)), np.zeros(3), [0.5])),
    ],
)
def test_a_bad_problem_is_refused_by_field(field, arguments):
    with refused(rover_gym.ProblemError, field):
        rover_gym.solve_friction_contact(*arguments)


def test_bad_options_are_refused_by_field():
    problem = (np.eye(3), np.zeros(3), [0.5])
    for field, options in [
        ("tolerance", {"tolerance": -1.0}),
        ("tolerance", {"tolerance": np.nan}),
        ("dimension", {"dimension": 4}),
        ("solver", {"solver": "lemke"}),
        ("max_iterations", {"max_iterations": 0}),
    ]:
        with refused(rover_gym.OptionError, field):
            rover_gym.solve_friction_contact(*problem, **options)
    with refused(rover_gym.ProblemError, "initial"):
        rover_gym.solve_friction_contact(*problem, initial=[np.nan, 0.0, 0.0])


def test_a_rover_with_enormous_friction_gains_no_energy():
    # With friction=1e16 every step was called converged while the energy grew.
    sim = rover_gym.Simulation(friction=1e16)
    sim.step()  # the projection lifts the wheels out of the ground
    sim.set_wheel_torques([20.0] * 6)
    sim.step(100)
    sim.set_wheel_torques([0.0] * 6)
    before = sim.energy().total
    for _ in range(40):
        report = sim.step(10)
        after = sim.energy().total
        given = report.energy_released  # the treads give off what they have stored
        assert report.status != "converged" or after <= before + given + 1e-9 * abs(before)
        before = after


@pytest.mark.parametrize("solver", ["auto", "nsgs", "newton", "proximal", "admm", "relaxed"])
@pytest.mark.parametrize("dimension", [2, 3])
def test_a_problem_without_contacts_has_an_empty_answer(solver, dimension):
    # ADMM and the relaxation panicked.
    d = dimension
    for W in (np.zeros((0, 0)), ([0], [], np.zeros((0, d, d)))):
        answer = rover_gym.solve_friction_contact(W, [], [], dimension=d, solver=solver)
        assert answer.impulses.shape == answer.velocities.shape == (0, d)
        assert answer.report.status == ("relaxed" if solver == "relaxed" else "converged")
        assert (answer.report.stage, answer.report.iterations) == ("at_rest", 0)


def test_the_report_names_its_stages(sim):
    sim.step()
    problem = sim.last_problem()
    cold = rover_gym.solve_friction_contact(*problem)
    name, end, _ = cold.report.stages[-1]
    assert (name, end) == (cold.report.stage, "converged")
    assert sum(iterations for *_, iterations in cold.report.stages) == cold.report.iterations
    warm = rover_gym.solve_friction_contact(*problem, initial=cold.impulses)
    assert warm.report.stages == [("pivoting", "converged", warm.report.iterations)]
    assert "pivoting" in repr(warm.report)


def test_a_spent_budget_is_said_and_the_work_is_counted(sim):
    sim.step()
    problem = sim.last_problem()
    answer = rover_gym.solve_friction_contact(*problem, budget=1000)
    assert answer.report.status == "budget_exhausted"
    assert answer.report.work <= 1000
    full = rover_gym.solve_friction_contact(*problem)
    assert full.report.is_converged
    again = rover_gym.solve_friction_contact(*problem, budget=full.report.work)
    np.testing.assert_array_equal(again.impulses, full.impulses)


@pytest.mark.parametrize(
    ("W", "q", "mu"),
    [
        (np.eye(3), [1e308, -1e308, 1e308], [1.0]),
        (np.eye(3) * 1e308, [-1e308, 1.0, 0.0], [1e308]),
        (np.eye(3) * 1e-308, [-1e308, 1.0, 0.0], [0.5]),
        (np.eye(3) * 5e-324, [-1.0, 1.0, 0.0], [0.5]),
        (np.diag([1e-300, 1e300, 1.0]), [-1.0, 1.0, 0.0], [0.5]),
        (np.array([[1.0, 1e308, 0], [1e308, 1, 0], [0, 0, 1.0]]), [-1.0, 1.0, 0.0], [1e5]),
    ],
)
@pytest.mark.parametrize("solver", ["auto", "nsgs", "newton", "proximal", "admm", "relaxed"])
def test_numbers_at_the_end_of_their_range_neither_panic_nor_lie(W, q, mu, solver):
    answer = rover_gym.solve_friction_contact(W, q, mu, solver=solver, max_iterations=50)
    p, u = answer.impulses[0], answer.velocities[0]
    assert np.isfinite([p, u]).all()
    if answer.report.is_converged:
        assert u[0] >= -1e-6 * np.abs(q).max()
        assert p[0] >= -1e-6 * np.abs(q).max() / np.asarray(W)[0, 0]


def chain(n, dimension, seed=0):
    """Contacts that are coupled with their neighbours only: W (dense), q, mu."""
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
    with refused(rover_gym.ProblemError, "W", r"W: must be square with 3 rows a contact"):
        solve_friction_contact(scipy.sparse.csr_array(np.ones(shape)), np.ones(shape[1]), 0.5)


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
    with refused(rover_gym.ProblemError, "q", "dimension=2"):
        solve_friction_contact(W, q, mu)
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
