"""What a scene needs, and no more: from its description to the model, ground, scheme and step that are built for it.

    >>> from rover_gym import Plane
    >>> from rover_gym.scene_plan import Scene, plan
    >>> straight = plan(Scene(Plane(), steered=False, equal_torques=True), accuracy="balanced")
    >>> straight.kind
    'planar'
    >>> rover = straight.rover()
    >>> rover.set_wheel_torques([15.0] * 6)
    >>> rover.step(200).is_converged
    True

A scene says what will never happen in it; whatever it leaves open is built. What was left out is refused when it is
asked for later. `docs/economy.md` has the error and the cost of each economy, and the command that measures them.
"""

import math
from dataclasses import dataclass, field
from typing import Any, Literal, TypeAlias

import numpy as np
import numpy.typing as npt

from rover_gym._core import (
    CommandError,
    Line,
    MirroredRoverSimulation,
    ModelError,
    OptionError,
    Plane,
    RoverModel,
    Simulation,
    SphereField,
    StateError,
    StepError,
    StepReport,
    TerrainError,
    accuracy_options,
)
from rover_gym.start import resting_pose
from rover_gym.validation import flag, known_keys, number, refuse, vector

Array: TypeAlias = npt.NDArray[np.float64]
Accuracy: TypeAlias = Literal["fast", "balanced", "reference"] | float
Kind: TypeAlias = Literal["full", "welded", "planar"]

# The bounds are for 10 s from rest on a plane while the wheels do not slip; `docs/economy.md` has what was measured.
#: Largest distance of the trunk from that of the full model with its steering held by the PD, m. On a plane a wheel
#: touches on its steering axis and nothing turns it. Largest measured: 2.6e-7.
WELD_ERROR = 1e-6
#: The same for the planar model against the welded one, m: rounding, the solver's tolerance. Largest measured: 1.9e-8.
PLANAR_ERROR = 1e-7
#: Linearised against Newton scheme over the step squared, m/s2, on the same drives. Largest measured: 3.3e-3.
LINEARISED_ERROR = 1e-2
#: CPU time of a step on a plane, relative to the full model, as measured.
COST: dict[Kind, float] = {"full": 1.0, "welded": 0.75, "planar": 0.3}
#: Gap of a wheel (m) up to which the start counts as resting on the plane.
RESTING = 1e-6
#: The planar model's trunk does not touch the ground; this far from parallel to it (rad) it might.
LARGEST_TILT = 0.2

#: Keyword arguments of `Simulation` that a scene may hold: all but those that the plan chooses.
OPTIONS = (
    "gravity",
    "friction",
    "restitution",
    "theta",
    "forecast",
    "solver",
    "max_iterations",
    "stabilisation",
    "warm_start",
)

_STRAIGHT = 1e-12  # rad or m: what counts as symmetric, a few roundings away from it


@dataclass(frozen=True)
class Scene:
    """What a rover will meet and be told.

    Attributes:
        terrain: The ground.
        model: The machine.
        start: `(nq,)` public coordinates; at rest on the terrain's plane at x = z = 0 if not given.
        heading: Of the start that is made if none is given, rad.
        steered: Whether a steering set-point other than zero may ever be given.
        equal_torques: Whether the two wheels of each axle always get the same torque.
        held: Whether joints may be held or wheels braked.
        tumbles: Whether the rover turns over in free flight, so that its angular momentum matters.
        reach: The rover stays within this distance of its start on the map, m; None promises nothing.
        options: Keyword arguments of `Simulation` that describe the scene: gravity, friction, restitution.
    """

    terrain: Plane | SphereField = field(default_factory=Plane)
    model: RoverModel = field(default_factory=RoverModel)
    start: npt.ArrayLike | None = None
    heading: float = 0.0
    steered: bool = True
    equal_torques: bool = False
    held: bool = False
    tumbles: bool = False
    reach: float | None = None
    options: dict[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Decision:
    """One part of what is built.

    Attributes:
        part: What was decided about.
        built: What is built.
        reason: Why.
        error: Bound on what it changes in the trunk's place in 10 s, m; None where nothing was left out.
    """

    part: str
    built: str
    reason: str
    error: float | None = None


@dataclass(frozen=True)
class ScenePlan:
    """What is built for a scene.

    Attributes:
        scene: The scene as it was described.
        kind: The model: the full tree, the tree with its steering welded, or its planar image.
        model: The machine as it is built (for the planar image the tree that it is made of).
        terrain: The ground as it is built.
        start: `(21,)` public coordinates of the full model.
        options: Keyword arguments of the simulation.
        decisions: Every part and why it is as it is.
    """

    scene: Scene
    kind: Kind
    model: RoverModel
    terrain: Plane | SphereField
    start: Array
    options: dict[str, Any]
    decisions: tuple[Decision, ...]

    @property
    def error(self) -> float:
        """Bound on the distance of the trunk from the full model's at the same step, 10 s of a drive, m."""
        return sum(decision.error or 0.0 for decision in self.decisions)

    @property
    def cost(self) -> float:
        """CPU time to expect of a step, relative to the full model on the same ground."""
        return COST[self.kind]

    def explain(self) -> list[dict[str, Any]]:
        """Rows of what was built and why: part, built, reason, error (m or None)."""
        return [{"part": d.part, "built": d.built, "reason": d.reason, "error": d.error} for d in self.decisions]

    def rover(self) -> "PlannedRover":
        """The rover at its start."""
        return PlannedRover(self)

    def simulation(self) -> Simulation | MirroredRoverSimulation:
        """The bare simulation at its start: `rover` wraps it so that all kinds are used alike."""
        if self.kind == "planar":
            return self._planar()
        sim = Simulation(self.model, self.terrain, **self.options)
        names = self.scene.model.dof_names
        sim.set_state(self.start[[names.index(name) for name in self.model.dof_names]])
        return sim

    def _planar(self) -> MirroredRoverSimulation:
        plane = self.terrain
        assert isinstance(plane, Plane)  # noqa: S101 - `plan` makes no planar plan without
        heading = self.start[4]
        n = plane.normal
        slope = -(n[0] * math.cos(heading) - n[2] * math.sin(heading)) / n[1]
        x, z = self.start[[0, 2]]
        options = dict(self.options)
        options["gravity"] = _gravity(self.scene)[:2]
        sim = MirroredRoverSimulation(Line(slope, plane.height(x, z)), model=self.model, **options)
        names = self.scene.model.dof_names
        joints = [self.start[names.index(pair[0])] for pair in sim.joints]
        sim.set_state([0.0, self.start[1], self.start[5], *joints])
        return sim


class PlannedRover:
    """A rover of any plan under the full rover's commands and coordinates.

    Args:
        plan: What to build.
    """

    def __init__(self, plan: ScenePlan) -> None:
        self.plan = plan
        self.simulation = plan.simulation()
        names, wheels = plan.scene.model.dof_names, plan.scene.model.wheel_names
        self._pairs: list[list[int]] = []
        if isinstance(self.simulation, MirroredRoverSimulation):
            # x runs along the heading, so it is put in its place by itself.
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
        """`(21,)` public coordinates of the full model."""
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
        """`(6,)` N m, positive drives forward.

        Raises:
            CommandError: Not six finite numbers, or unequal on an axle of a planar model.
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
        """`(6,)` rad.

        Raises:
            CommandError: Not six finite numbers, or not zero although the scene was planned without steering.
        """
        if self.plan.kind == "full" and isinstance(self.simulation, Simulation):
            self.simulation.set_steering(set_points)
            return
        values = vector("steering", set_points, len(self.plan.scene.model.wheel_names), error=CommandError)
        if any(values):
            refuse(CommandError, "steering", values, "the scene was planned without steering")

    def step(self, n: int = 1) -> StepReport:
        """Takes n steps.

        Raises:
            StepError: A step could not be taken, a planar rover has tilted so far that it may touch with its trunk, or
                the rover has left the scene's reach.
        """
        report = self.simulation.step(n)
        reach = self.plan.scene.reach
        if reach is not None:
            way = self.q[[0, 2]] - self.plan.start[[0, 2]]
            if (distance := float(np.hypot(*way))) > reach:
                refuse(StepError, "reach", distance, f"the rover has left the reach of {reach:g} m it was planned with")
        if isinstance(self.simulation, MirroredRoverSimulation):
            ground = self.simulation.ground
            tilt = float(self.simulation.q[2]) - (math.atan(ground.slope) if isinstance(ground, Line) else 0.0)
            if abs(math.remainder(tilt, math.tau)) > LARGEST_TILT:
                refuse(StepError, "pitch", tilt, "the trunk may touch the ground, which the planar model does not know")
        return report


def plan(scene: Scene, accuracy: Accuracy = "balanced", *, planar: bool = True) -> ScenePlan:
    """Decides what is built for a scene.

    Args:
        scene: What the rover will meet and be told.
        accuracy: As for `Simulation`: a name, or an error in metres.
        planar: Whether a planar model is welcome; without, the tree is built.

    Raises:
        OptionError: The accuracy, reach or heading is out of its range; a scene that contradicts itself, or is none.
        StateError: The start has a wrong shape or an entry that is not finite.
        TerrainError: No start was given, and the terrain has no plane to stand on.
    """
    _check(scene)
    planar = flag("planar", planar)
    terrain, terrain_decision = _ground(scene)
    start = _start(scene)
    chosen = accuracy_options(accuracy)
    weld, weld_decision = _steering(scene, terrain, start)
    obstacle = None if planar else "not wanted"
    if obstacle is None:
        obstacle = _obstacle(scene, terrain, start, welded=weld)
    kind: Kind = "full"
    model = scene.model
    if weld:
        kind = "welded"
        model = model.weld(_steering_joints(model))
    if obstacle is None:
        kind = "planar"
        base = Decision(
            "base",
            "planar: 3 coordinates, pairs of wheels as one",
            "ground, torques and start are symmetric about the vertical plane through the heading",
            PLANAR_ERROR,
        )
    else:
        base = Decision("base", "free: 6 coordinates", f"no planar model: {obstacle}")
    variant, variant_decision = _variant(scene, chosen, calm=weld)
    options = {**scene.options, **chosen, "variant": variant}
    # Wrong options are refused here, not when the simulation is built.
    Simulation(model, terrain, **options)
    decisions = (
        terrain_decision,
        weld_decision,
        base,
        variant_decision,
        Decision(
            "contact solver",
            "auto, with one tangent a contact" if kind == "planar" else "auto, with two tangents a contact",
            "starts from the last impulses and escalates to Newton's method only where the cheap method stalls",
        ),
        Decision(
            "step",
            f"{1e3 * options['time_step']:g} ms, tolerance {options['tolerance']:g}",
            f"accuracy {accuracy!r}",
        ),
    )
    return ScenePlan(scene, kind, model, terrain, start, options, decisions)


def _check(scene: Scene) -> None:
    """Refuses a scene whose parts are not what they must be."""
    if not isinstance(scene, Scene):
        refuse(OptionError, "scene", scene, "must be a Scene")
    if not isinstance(scene.terrain, (Plane, SphereField)):
        refuse(TerrainError, "terrain", scene.terrain, "must be a Plane or a SphereField")
    if not isinstance(scene.model, RoverModel):
        refuse(ModelError, "model", scene.model, "must be a RoverModel")
    for name in ("steered", "equal_torques", "held", "tumbles"):
        flag(name, getattr(scene, name))
    if not isinstance(scene.options, dict):
        refuse(OptionError, "options", scene.options, "must be a dict")
    known_keys("options", scene.options, OPTIONS)


def _steering_joints(model: RoverModel) -> list[str]:
    return [model.dof_names[i] for i in model.steering_joint_indices if i >= 0]


def _gravity(scene: Scene) -> Array:
    gravity = scene.options.get("gravity")
    return np.array(vector("gravity", (0.0, -9.81, 0.0) if gravity is None else gravity, 3))


def _start(scene: Scene) -> Array:
    model = scene.model
    if scene.start is not None:
        return np.array(vector("start", scene.start, model.nq, error=StateError))
    heading = number("heading", scene.heading)
    plane = scene.terrain if isinstance(scene.terrain, Plane) else scene.terrain.ground
    if plane is None or plane.normal[1] <= 0.0:
        refuse(TerrainError, "terrain", scene.terrain, "has no plane to stand on: give a start")
    return resting_pose(model, plane, (0.0, 0.0), heading)


def _ground(scene: Scene) -> tuple[Plane | SphereField, Decision]:
    reach = None if scene.reach is None else number("reach", scene.reach, above=0.0)
    terrain = scene.terrain
    if isinstance(terrain, Plane):
        return terrain, Decision("ground", "plane, no search", "there are no spheres")
    centres, radii, plane = terrain.centres, terrain.radii, terrain.ground
    shown = np.ones(len(radii), dtype=bool)
    if plane is not None:
        shown = centres @ plane.normal + plane.offset + radii > 0.0
    buried = int(len(radii) - shown.sum())
    far = 0
    if reach is not None:
        start = _start(scene)
        # From the trunk's origin to the farthest rim of the rover, in any pose.
        own = float(np.linalg.norm(np.abs(_extent(scene.model)).max(axis=0)) + scene.model.wheel_radii.max())
        near = np.hypot(centres[:, 0] - start[0], centres[:, 2] - start[2]) - radii <= reach + own
        far = int((shown & ~near).sum())
        shown &= near
    left = int(shown.sum())
    dropped = ", ".join(
        text for count, text in ((buried, f"{buried} are under the plane"), (far, f"{far} out of reach")) if count
    )
    if left == 0 and plane is not None:
        why = f"of {len(radii)} spheres {dropped}" if len(radii) else "there are no spheres"
        return plane, Decision("ground", "plane, no search", why, 0.0)
    if left == len(radii):
        search = "spheres may be anywhere near the rover" if reach is None else "all spheres are within reach"
        return terrain, Decision("ground", f"{left} spheres in a ball tree", search)
    if left == 0:
        refuse(OptionError, "reach", scene.reach, "leaves the rover without any ground")
    kept = SphereField(centres[shown], radii[shown], plane)
    return kept, Decision("ground", f"{left} spheres in a ball tree", f"of {len(radii)} spheres {dropped}")


def _extent(model: RoverModel) -> Array:
    """`(n, 3)` origins of the solids and of the wheels' lowest points relative to the trunk, joints at zero, m."""
    origins = [origin for origin, _ in model.poses(np.zeros(model.nq), coordinates="state").values()]
    rims = model.wheel_contact_points(np.zeros(model.nq), Plane(), coordinates="state")
    return np.concatenate([np.array(origins), rims])


def _steering(scene: Scene, terrain: Plane | SphereField, start: Array) -> tuple[bool, Decision]:
    joints = _steering_joints(scene.model)
    held = f"{len(joints)} joints held by the PD"
    if not joints:
        return False, Decision("steering", "none", "the model has no free steering joint")
    angles = start[[i for i in scene.model.steering_joint_indices if i >= 0]]
    if scene.steered:
        return False, Decision("steering", held, "steering may be commanded")
    if np.any(angles):
        refuse(OptionError, "steered", scene.steered, "the start has turned wheels, which no set-point keeps turned")
    if isinstance(terrain, SphereField):
        why = "not commanded, but on spheres the PD gives way enough to change which sphere a wheel climbs"
        return False, Decision("steering", held, why)
    if not _rests(scene, terrain, start):
        why = "not commanded, but in a landing wheels strike at an angle and turn"
        return False, Decision("steering", held, why)
    if _steering_offset(scene.model) > _STRAIGHT:
        why = "not commanded, but the wheels touch beside their steering axes and turn"
        return False, Decision("steering", held, why)
    why = "never commanded, and every wheel touches on its steering axis, so nothing else turns it"
    return True, Decision("steering", f"{len(joints)} joints welded at zero", why, WELD_ERROR)


def _rests(scene: Scene, terrain: Plane, start: Array) -> bool:
    """Whether all wheels touch the plane at the start."""
    gaps = scene.model.wheel_gaps(start, terrain, coordinates="state")
    return float(np.abs(gaps).max()) <= RESTING


def _steering_offset(model: RoverModel) -> float:
    """Largest distance of a wheel's centre from its steering axis, straight ahead, m."""
    description = model.to_dict()
    axes = {solid["name"]: np.array(solid.get("axis", (0.0, 0.0, 0.0)), dtype=float) for solid in description["solids"]}
    poses = model.poses(np.zeros(model.nq), coordinates="state")
    offsets = [0.0]
    for wheel in description["wheels"]:
        if (name := wheel.get("steering")) in model.dof_names:
            arm = poses[wheel["solid"]][0] - poses[name][0]
            axis = poses[name][1] @ axes[name]
            offsets.append(float(np.linalg.norm(np.cross(arm, axis)) / np.linalg.norm(axis)))
            # On a plane it touches straight below its centre.
            offsets.append(float(np.hypot(axis[0], axis[2])))
    return max(offsets)


def _obstacle(scene: Scene, terrain: Plane | SphereField, start: Array, *, welded: bool) -> str | None:
    """Why there is no planar model; None if there is."""
    if isinstance(terrain, SphereField):
        return "spheres are not the same left and right"
    if not welded:
        return "steering is free"
    if not scene.equal_torques:
        return "torques may differ from left to right"
    if scene.held:
        return "joints may be held"
    if scene.tumbles:
        return "the rover may turn out of the plane in flight"
    n, heading = terrain.normal, start[4]
    if abs(n[0] * math.sin(heading) + n[2] * math.cos(heading)) > _STRAIGHT:
        return "the ground slopes across the heading"
    gravity = _gravity(scene)
    if gravity[0] or gravity[2]:
        return "gravity is not along y"
    try:
        image = MirroredRoverSimulation(Line(), model=scene.model)
    except ModelError as error:
        return str(error)
    names = scene.model.dof_names
    pairs = [[names.index(name) for name in pair] for pair in image.joints]
    free = {0, 1, 2, 4, 5, *(i for pair in pairs for i in pair)}
    still = [i for i in range(scene.model.nq) if i not in free]
    apart = [np.ptp(start[pair]) for pair in pairs]
    if np.abs(start[still]).max(initial=0.0) > _STRAIGHT or max(apart) > _STRAIGHT:
        return "the start is not symmetric"
    return None


def _variant(scene: Scene, chosen: dict[str, Any], *, calm: bool) -> tuple[str, Decision]:
    if scene.tumbles:
        return "newton", Decision("scheme", "Newton", "keeps angular momentum in free flight to rounding")
    why = "Newton pays in free flight: on the ground it moves the path by less than the step's own error"
    error = LINEARISED_ERROR * chosen["time_step"] ** 2 if calm else None
    return "linearised", Decision("scheme", "linearised", why, error)
