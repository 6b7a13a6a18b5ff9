"""Roll-outs of a rover: the same state driven on by many sequences of commands, side by side in the core's batch."""

from dataclasses import replace
from typing import Any, NamedTuple, Protocol

import numpy as np
import numpy.typing as npt

from rover_gym.core import EpisodeBatch, EpisodeRules, EpisodeRun, Simulation, Terrain
from rover_gym.core.validation import number, whole
from rover_gym.envs.rover_env import RoverEnv
from rover_gym.models.lookup import ModelLike, as_model

Array = npt.NDArray[np.float64]

#: Solver of the roll-outs: their physics is coarser than the environment's.
SOLVER: dict[str, Any] = {"tolerance": 1e-4, "max_iterations": 20}


class Controller(Protocol):
    """Turns what is drawn into actions, as `CommandController` does."""

    def act(self, observations: npt.NDArray[Any], commands: npt.NDArray[Any], /) -> npt.NDArray[np.float32]:
        """The actions `(n, n_actions)` for observations `(n, size)`."""


class Ends(NamedTuple):
    """How roll-outs ended; an entry for each.

    Attributes:
        place: (n, 2) x and z of the trunk's origin, m.
        time: (n,) how long the roll-out lasted, s.
        reached: (n,) whether it reached the goal.
        failed: (n,) whether its episode ended otherwise.
        energy: (n,) work of the wheel motors, driving or braking, J.
        tilt: (n,) angle between the trunk and the vertical, rad.
        stuck: (n,) for how much of the time that ends an episode the trunk has been held, 0 to 1.
    """

    place: Array
    time: Array
    reached: npt.NDArray[np.bool_]
    failed: npt.NDArray[np.bool_]
    energy: Array
    tilt: Array
    stuck: Array


class Rollouts:
    """Drives copies of an environment's rover through sequences of commands.

    Args:
        env: The environment, whose state each call of `drive` reads; it does not change.
        n: Number of copies.
        time_step: Largest physics step of the roll-outs, s; the control period is divided into equal ones.
        threads: Threads that step them; None for one per core.
        model: The rover of the roll-outs, its name in the gallery or its file; the episode's by default. Use
            another one to study model errors.
        friction: Friction of wheels and ground in the roll-outs; the episode's by default.

    Raises:
        OptionError: An argument is out of its range, or the model has other joints.
    """

    def __init__(
        self,
        env: RoverEnv,
        n: int,
        *,
        time_step: float = 0.025,
        threads: int | None = None,
        model: ModelLike | None = None,
        friction: float | None = None,
    ) -> None:
        self._env, self.n = env, whole("n", n, at_least=1, at_most=100_000)
        task = env.task
        substeps = max(1, int(np.ceil(env.dt / number("time_step", time_step, above=0.0) - 1e-9)))
        self._friction = None if friction is None else number("friction", friction, at_least=0.0)
        own = None if model is None else as_model("model", model)
        self._has_own_model = own is not None
        options = dict(task.simulation_options, time_step=env.dt / substeps, **SOLVER)
        self._task = replace(task, model=task.model if own is None else own, simulation_options=options)
        (rover,), settings = task.rules.__getnewargs_ex__()
        self._rules = EpisodeRules(rover, **(settings | {"substeps": substeps, "noise": 0.0}))
        self._batch = EpisodeBatch(self._rules, self._simulation(env.simulation.terrain), self.n, threads=threads)
        q = task.layout["q"]
        self._stuck = task.layout["stuck"].start
        self._place, self._scale = [q.start, q.start + 2], task.layout.scale[[q.start, q.start + 2]]

    def _simulation(self, terrain: Terrain) -> Simulation:
        """A rover of the roll-outs on a terrain, at rest in the zero configuration."""
        domain = self._env.domain
        if self._has_own_model:
            domain = replace(domain, mass_scale=1.0, further={})
        if self._friction is not None:
            domain = replace(domain, friction=self._friction)
        return self._task.simulate(terrain, domain)

    def drive(self, controller: Controller, commands: npt.ArrayLike, hold: int, terrain: Terrain | None = None) -> Ends:
        """Drives the copies from the environment's present state.

        Args:
            controller: Turns commands into actions: `CommandController`, for instance.
            commands: (n, knots, size of a command) within [-1, 1].
            hold: Control periods that each command is held.
            terrain: The ground of the roll-outs; the episode's by default.

        Returns:
            How each roll-out ended: at its end, or where its episode did.
        """
        plan = np.asarray(commands, dtype=np.float64)
        now, snapshot = self._env.simulation, self._env.snapshot()
        simulation = self._simulation(now.terrain if terrain is None else terrain)
        simulation.set_state(now.q, now.v)
        start = snapshot.scene.start
        row = [start.slope, start.uphill, *start.position, start.heading, *start.goal]
        origin = (row, [0.0, 0.0, 0.0], 0, [1.0] * 4)
        episode = EpisodeRun.from_bytes(self._rules, snapshot.progress)
        self._batch.resume(range(self.n), simulation, episode, origin, generator=np.zeros((1, 4), np.uint64))
        seen = self._batch.observations()
        alive = np.ones(self.n, np.bool_)
        time = np.zeros(self.n)
        for k in range(plan.shape[1] * hold):
            action = controller.act(seen, plan[:, k // hold])
            seen, _, ended, _, _ = self._batch.step(action, alive, has_scan=False)
            time[alive] += self._env.dt
            alive &= ~ended
            if not alive.any():
                break
        infos: dict[str, Any] = self._batch.infos()
        reached = np.asarray(infos["termination"]) == "goal"
        return Ends(
            seen[:, self._place].astype(np.float64) * self._scale,
            time,
            reached,
            ~alive & ~reached,
            np.asarray(infos["energy"]) - self._env.progress.info()["energy"],
            np.asarray(infos["tilt"]),
            seen[:, self._stuck].astype(np.float64),
        )
