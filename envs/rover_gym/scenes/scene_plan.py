"""A scene, its plan with a reason for every part, and the rover built from it."""

import inspect
import math
from dataclasses import dataclass, field
from typing import Any, Literal, TypeAlias

import numpy as np
import numpy.typing as npt

from rover_gym.core import (
    CommandError,
    Line,
    MirroredRoverSimulation,
    OptionError,
    Plane,
    RoverModel,
    Simulation,
    StepError,
    StepReport,
    Terrain,
    accuracy_options,
)
from rover_gym.core.validation import flag, known_keys, refuse, vector
from rover_gym.ground.maps.ground_lookup import as_terrain
from rover_gym.models.lookup import as_model

Array: TypeAlias = npt.NDArray[np.float64]

Accuracy: TypeAlias = Literal["fast", "balanced", "reference"] | float

#: Keyword arguments of `Simulation` that a scene may set; the plan chooses the others, partly by the accuracy.
OPTIONS = tuple(
    name
    for name in inspect.signature(Simulation).parameters
    if name not in ("model", "terrain", "materials", "accuracy", *accuracy_options("balanced"))
)


@dataclass(frozen=True)
class Scene:
    """A rover, its terrain, and the commands that it may receive.

    Attributes:
        terrain: The ground, or the file of a map or a mesh.
        model: The rover, its name in the gallery or its file.
        start: `(nq,)` public coordinates; None starts at rest on the terrain at x = z = 0: on a map or a mesh with all
            wheels, elsewhere on the plane with joints at zero.
        heading: Heading of the default start, rad.
        steered: Whether a non-zero steering set-point may occur.
        equal_torques: Whether the two wheels of each axle always get the same torque.
        held: Whether joints may be held or wheels braked.
        tumbles: Whether the rover tumbles in free flight, so that its angular momentum matters.
        reach: Largest distance of the rover from its start on the map, m; None for no limit.
        options: Keyword arguments of `Simulation` that describe the scene: gravity, friction, restitution.
    """

    terrain: Terrain = field(default_factory=Plane)
    model: RoverModel = field(default_factory=RoverModel)
    start: npt.ArrayLike | None = None
    heading: float = 0.0
    steered: bool = True
    equal_torques: bool = False
    held: bool = False
    tumbles: bool = False
    reach: float | None = None
    options: dict[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        object.__setattr__(self, "terrain", as_terrain("terrain", self.terrain))
        object.__setattr__(self, "model", as_model("model", self.model))


def check_scene(scene: Scene) -> None:
    """Checks the types of a scene's parts and the names of its options."""
    if not isinstance(scene, Scene):
        refuse(OptionError, "scene", scene, "must be a Scene")
    for name in ("steered", "equal_torques", "held", "tumbles"):
        flag(name, getattr(scene, name))
    if not isinstance(scene.options, dict):
        refuse(OptionError, "options", scene.options, "must be a dict")
    known_keys("options", scene.options, OPTIONS)


def steering_joints(model: RoverModel) -> list[str]:
    """Names of the joints that steer a wheel."""
    return [model.dof_names[i] for i in model.steering_joint_indices if i >= 0]


def gravity_of(scene: Scene) -> Array:
    """(3,) gravity of the scene, m/s2; by default the Earth's."""
    gravity = scene.options.get("gravity")
    return np.array(vector("gravity", (0.0, -9.81, 0.0) if gravity is None else gravity, 3))


Kind: TypeAlias = Literal["full", "welded", "planar"]

#: Measured CPU time of a step on a plane, relative to the full model.
COST: dict[Kind, float] = {"full": 1.0, "welded": 0.75, "planar": 0.3}

#: Largest angle (rad) between trunk and ground of the planar model, which has no contacts between the two.
LARGEST_TILT = 0.2


@dataclass(frozen=True)
class Decision:
    """The decision about one part of a plan.

    Attributes:
        part: The part decided on.
        built: The choice.
        reason: The reason for the choice.
        error: Bound on the change of the trunk's position in 10 s, m; None where nothing was left out.
    """

    part: str
    built: str
    reason: str
    error: float | None = None


@dataclass(frozen=True)
class ScenePlan:
    """The plan of a scene: the model, ground, start and options of its simulation.

    Attributes:
        scene: The scene as the user described it.
        kind: The kind of model: the full tree, the tree with welded steering, or its planar image.
        model: The model to simulate; for the planar image, the tree it is derived from.
        terrain: The ground to simulate.
        start: `(nq,)` public coordinates of the full model.
        options: Keyword arguments of the simulation.
        decisions: The decision about every part.
    """

    scene: Scene
    kind: Kind
    model: RoverModel
    terrain: Terrain
    start: Array
    options: dict[str, Any]
    decisions: tuple[Decision, ...]

    @property
    def error(self) -> float:
        """Bound on the distance between the trunk and the full model's over 10 s at the same step size, m."""
        return sum(decision.error or 0.0 for decision in self.decisions)

    @property
    def cost(self) -> float:
        """Expected CPU time of a step, relative to the full model on the same ground."""
        return COST[self.kind]

    def explain(self) -> list[dict[str, Any]]:
        """The decisions as rows: part, built, reason, error (m or None)."""
        return [{"part": d.part, "built": d.built, "reason": d.reason, "error": d.error} for d in self.decisions]

    def rover(self) -> "PlannedRover":
        """Builds the rover at its start."""
        return PlannedRover(self)

    def simulation(self) -> Simulation | MirroredRoverSimulation:
        """Builds the bare simulation at its start; `rover` wraps it in one interface for all kinds of model."""
        if self.kind == "planar":
            return self._planar()
        sim = Simulation(self.model, self.terrain, **self.options)
        names = self.scene.model.dof_names
        sim.set_state(self.start[[names.index(name) for name in self.model.dof_names]])
        return sim

    def _planar(self) -> MirroredRoverSimulation:
        plane = self.terrain
        assert isinstance(plane, Plane)  # noqa: S101 - `plan` makes a planar plan only on a plane
        heading = self.start[4]
        n = plane.normal
        slope = -(n[0] * math.cos(heading) - n[2] * math.sin(heading)) / n[1]
        x, z = self.start[[0, 2]]
        options = dict(self.options)
        options["gravity"] = gravity_of(self.scene)[:2]
        sim = MirroredRoverSimulation(Line(slope, plane.height(x, z)), model=self.model, **options)
        names = self.scene.model.dof_names
        joints = [self.start[names.index(pair[0])] for pair in sim.joints]
        sim.set_state([0.0, self.start[1], self.start[5], *joints])
        return sim


class PlannedRover:
    """The rover of any plan, with the commands and coordinates of the full model.

    Args:
        plan: The plan to build.
    """

    def __init__(self, plan: ScenePlan) -> None:
        self.plan = plan
        self.simulation = plan.simulation()
        names, wheels = plan.scene.model.dof_names, plan.scene.model.wheel_names
        self._pairs: list[list[int]] = []
        if isinstance(self.simulation, MirroredRoverSimulation):
            # The planar x runs along the heading; `q` maps it to x and z.
            joints = [[names.index(name) for name in pair] for pair in self.simulation.joints]
            self._places = [[], [1], [5], *joints]
            self._pairs = [[wheels.index(name) for name in pair] for pair in self.simulation.wheels]
        else:
            self._places = [[names.index(name)] for name in plan.model.dof_names]

    @property
    def time(self) -> float:
        """Simulated time, s."""
        return self.simulation.time

    @property
    def q(self) -> Array:
        """`(nq,)` public coordinates of the full model."""
        q = self.plan.start.copy()
        own = self.simulation.q
        for value, places in zip(own, self._places, strict=True):
            q[places] = value
        if isinstance(self.simulation, MirroredRoverSimulation):
            heading = self.plan.start[4]
            q[0] += own[0] * math.cos(heading)
            q[2] -= own[0] * math.sin(heading)
        return q

    def set_wheel_torques(self, torques: npt.ArrayLike) -> None:
        """Sets the wheel torques `(n_wheels,)`, N m; positive drives forward.

        Raises:
            CommandError: The torques are not a finite number for each wheel, or differ on an axle of a planar model.
        """
        if isinstance(self.simulation, Simulation):
            self.simulation.set_wheel_torques(torques)
            return
        values = vector("torques", torques, len(self.plan.scene.model.wheel_names), error=CommandError)
        for pair in self._pairs:
            if len({values[i] for i in pair}) > 1:
                refuse(CommandError, "torques", values, "the scene was planned with equal torques on each axle")
        self.simulation.set_torques([values[pair[0]] for pair in self._pairs])

    def set_steering(self, set_points: npt.ArrayLike) -> None:
        """Sets the steering set-points `(n_wheels,)`, rad.

        Raises:
            CommandError: The set-points are not a finite number for each wheel, or not zero where the scene was
                planned without steering.
        """
        if self.plan.kind == "full" and isinstance(self.simulation, Simulation):
            self.simulation.set_steering(set_points)
            return
        values = vector("steering", set_points, len(self.plan.scene.model.wheel_names), error=CommandError)
        if any(values):
            refuse(CommandError, "steering", values, "the scene was planned without steering, so it must be 0")

    def step(self, n: int = 1) -> StepReport:
        """Takes n steps.

        Raises:
            StepError: A step failed, a planar rover has tilted so far that its trunk may touch the ground, or the rover
                has left the scene's reach.
        """
        report = self.simulation.step(n)
        reach = self.plan.scene.reach
        if reach is not None:
            way = self.q[[0, 2]] - self.plan.start[[0, 2]]
            if (distance := float(np.hypot(*way))) > reach:
                refuse(StepError, "reach", distance, f"the rover has left the planned reach of {reach:g} m")
        if isinstance(self.simulation, MirroredRoverSimulation):
            ground = self.simulation.ground
            tilt = float(self.simulation.q[2]) - (math.atan(ground.slope) if isinstance(ground, Line) else 0.0)
            if abs(math.remainder(tilt, math.tau)) > LARGEST_TILT:
                refuse(
                    StepError, "pitch", tilt, "the trunk may touch the ground, which the planar model does not include"
                )
        return report
