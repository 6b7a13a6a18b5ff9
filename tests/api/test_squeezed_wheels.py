"""Steps of 1 ms over rocks converge within few iterations when wheels squeeze the ground against each other.

Six wheels brace against the ground up to the friction limit and slip at 1e-11 m/s. Solved badly, one step in nine takes
more than 100 iterations, the worst 1134, and 8 steps in 7000 miss 1e-12.
"""

import numpy as np

from rover_gym import RoverModel, Simulation, SphereField


def test_squeezed_wheels_take_few_iterations() -> None:
    """7 s over the rocks of seed 1, of which the last seconds are on the flat beyond."""
    field = SphereField.rocks(0.05, (-2.0, -2.0, 8.0, 2.0), 1, max_diameter=0.15, burial=0.5)
    simulation = Simulation(RoverModel().replace(contact_radius=0.20), field, time_step=1e-3)
    q = np.zeros(21)
    q[1] = 0.45
    simulation.set_state(q, np.zeros(21))
    simulation.step(1000)
    simulation.set_wheel_torques([20.0] * 6)
    reports = [simulation.step(1) for _ in range(6000)]
    assert all(report.is_converged for report in reports)
    iterations = np.array([report.iterations for report in reports])
    assert iterations.mean() < 12
    assert np.count_nonzero(iterations > 100) <= 10
