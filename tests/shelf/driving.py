"""Problems that the rover's own time steps pose: six wheels, more contacts than freedoms to hold them."""

from typing import Literal

import numpy as np
from rovers import placed

from rover_gym import RoverModel, Simulation, SphereField
from shelf.problem import Dense


def hardest(simulation: Simulation, steps: int) -> Dense:
    """The problem of the step, of so many, that took the solver the most iterations."""
    worst, problem = -1, None
    for _ in range(steps):
        report = simulation.step()
        if report.iterations > worst:
            worst, problem = report.iterations, simulation.last_problem()
    return Dense(*(np.array(array) for array in problem))


def on_rocks(
    time_step: float,
    *,
    seed: int,
    wait: float = 0.0,
    friction: float = 0.7,
    variant: Literal["linearised", "newton"] = "linearised",
) -> Simulation:
    """The rover with 20 N m a wheel on half-buried rocks, `wait` seconds after it set off."""
    field = SphereField.rocks(0.05, (-2.0, -2.0, 8.0, 2.0), seed, max_diameter=0.15, burial=0.5)
    simulation = Simulation(
        RoverModel().replace(wheel_radius=0.20), field, time_step=time_step, friction=friction, variant=variant
    )
    placed(simulation, y=0.45)
    simulation.step(round(1.0 / time_step))
    simulation.set_wheel_torques([20.0] * 6)
    simulation.step(round(wait / time_step))
    return simulation


def on_gravel(friction: float = 1.0) -> Simulation:
    """The rover dropped on gravel without ground under it: each wheel lies on several pebbles at once."""
    x, z = np.meshgrid(np.arange(-1.5, 1.5, 0.08), np.arange(-1.5, 1.5, 0.08))
    centres = np.column_stack([x.ravel(), np.full(x.size, -0.05), z.ravel()])
    simulation = Simulation(
        RoverModel(), SphereField(centres, np.full(x.size, 0.05)), friction=friction, time_step=5e-3
    )
    q = np.zeros(21)
    q[1] = 0.45
    qdot = np.zeros(21)
    qdot[:2] = 0.8, -2.0
    simulation.set_state(q, qdot)
    return simulation


def lying(restitution: float, steps: int) -> Simulation:
    """The elastic rover, so many steps after it was thrown: it lies on many corners of trunk and bogies."""
    simulation = Simulation(RoverModel(), friction=0.7, restitution=restitution, time_step=5e-2)
    q, qdot = np.zeros(21), np.zeros(21)
    q[1], q[3] = 1.5, 2.5
    qdot[3:6] = 1.0, -2.0, 1.5
    simulation.set_state(q, qdot)
    simulation.step(steps)
    return simulation
