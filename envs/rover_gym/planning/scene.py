"""The user's description of a scene: the rover, its terrain, and the commands that will not occur."""

from dataclasses import dataclass, field
from typing import Any, Literal, TypeAlias

import numpy as np
import numpy.typing as npt

from rover_gym.mechanics import ModelError, OptionError, Plane, RoverModel, Terrain, TerrainError
from rover_gym.validation import flag, known_keys, refuse, vector

Array: TypeAlias = npt.NDArray[np.float64]
Accuracy: TypeAlias = Literal["fast", "balanced", "reference"] | float

#: Keyword arguments of `Simulation` that a scene may set; the plan chooses the others.
OPTIONS = (
    "gravity",
    "friction",
    "restitution",
    "theta",
    "forecast",
    "solver",
    "max_iterations",
    "budget",
    "stabilisation",
    "warm_start",
)


@dataclass(frozen=True)
class Scene:
    """A rover, its terrain, and the commands that it may receive.

    Attributes:
        terrain: The ground.
        model: The rover.
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


def check_scene(scene: Scene) -> None:
    """Checks the types of a scene's parts and the names of its options."""
    if not isinstance(scene, Scene):
        refuse(OptionError, "scene", scene, "must be a Scene")
    if not isinstance(scene.terrain, Terrain):
        refuse(TerrainError, "terrain", scene.terrain, "must be a terrain; several make a Union")
    if not isinstance(scene.model, RoverModel):
        refuse(ModelError, "model", scene.model, "must be a RoverModel")
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
