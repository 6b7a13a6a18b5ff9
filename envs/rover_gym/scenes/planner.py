"""Plans a scene: model, ground, time-stepping scheme and step size, each with a reason."""

import math
from typing import Any

import numpy as np

from rover_gym.core import (
    HeightField,
    Line,
    MirroredRoverSimulation,
    ModelError,
    OptionError,
    Plane,
    RoverModel,
    Simulation,
    SimulationBatch,
    SphereField,
    StateError,
    Terrain,
    TerrainError,
    TriangleMesh,
    accuracy_options,
)
from rover_gym.core.validation import flag, number, refuse, vector
from rover_gym.ground.terrain_parts import parts_of, plane_of, surfaces_of
from rover_gym.scenes.scene_plan import (
    Accuracy,
    Array,
    Decision,
    Kind,
    Scene,
    ScenePlan,
    check_scene,
    gravity_of,
    steering_joints,
)

# The bounds hold for 10 s from rest on a plane while the wheels do not slip; `docs/economy.md` lists the measurements.
#: Largest distance between the trunks of the welded model and of the full model with PD-held steering, m. On a plane a
#: wheel touches the ground on its steering axis, so the contact does not turn it. Largest measured: 2.6e-7.
WELD_ERROR = 1e-6
#: Largest distance between the trunks of the planar and the welded model: rounding, m, and for each unit of the
#: solver's relative tolerance, m. Largest measured: 2.3e-13 m with a tolerance of 1e-12, and 1.3e-6 m with 1e-8.
PLANAR_ERROR, PLANAR_ERROR_BY_TOLERANCE = 1e-7, 400.0
#: Largest distance between the trunks of the linearised and the Newton scheme over the step size squared, m/s2.
#: Largest measured: 3.3e-3.
LINEARISED_ERROR = 1e-2
#: Time of a batch's physics with welded steering over that with steering, on the plane, and among rocks that are never
#: met over that on the plane: `python -m comparison.batch_economies`.
BATCH_WELDED, BATCH_UNMET = 0.5, 1.1
#: Largest wheel gap (m) at which the start counts as resting on the plane.
RESTING = 1e-6
_STRAIGHT = 1e-12  # rad or m: deviation from symmetry that counts as rounding


def plan(scene: Scene, accuracy: Accuracy = "balanced", *, planar: bool = True) -> ScenePlan:
    """Plans the simulation of a scene.

    Args:
        scene: The scene.
        accuracy: As for `Simulation`: a name, or an error in metres.
        planar: Whether a planar model is allowed; without it the plan uses the tree.

    Raises:
        OptionError: The accuracy, reach or heading is out of range, or `scene` is no scene or contradicts itself.
        StateError: The start has a wrong shape or an entry that is not finite.
        TerrainError: No start was given, and the terrain cannot be stood on.
    """
    check_scene(scene)
    planar = flag("planar", planar)
    terrain, terrain_decision = _ground(scene)
    start = _start(scene)
    chosen = accuracy_options(accuracy)
    weld, weld_decision = _steering(scene, terrain, start)
    obstacle = None if planar else "not wanted"
    if obstacle is None:
        obstacle = _obstacle(scene, terrain, start, steers=not weld and bool(steering_joints(scene.model)))
    kind: Kind = "full"
    model = scene.model
    if weld:
        kind = "welded"
        model = model.weld(steering_joints(model))
    if obstacle is None:
        kind = "planar"
        base = Decision(
            "base",
            "planar: 3 coordinates, pairs of wheels as one",
            "ground, torques and start are symmetric about the vertical plane through the heading",
            PLANAR_ERROR + PLANAR_ERROR_BY_TOLERANCE * chosen["tolerance"],
        )
    else:
        base = Decision("base", "free: 6 coordinates", f"no planar model: {obstacle}")
    variant, variant_decision = _variant(scene, chosen, calm=weld)
    options = {**scene.options, **chosen, "variant": variant}
    # The core checks the options now rather than when the simulation is built.
    simulation = Simulation(model, terrain, **options)
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
        _steps(simulation, kind),
        _batch(terrain, welded=weld),
    )
    return ScenePlan(scene, kind, model, terrain, start, options, decisions)


def _start(scene: Scene) -> Array:
    model = scene.model
    if scene.start is not None:
        return np.array(vector("start", scene.start, model.nq, error=StateError))
    heading = number("heading", scene.heading)
    ground: Terrain | None = scene.terrain if surfaces_of(scene.terrain) else plane_of(scene.terrain)
    if ground is None or (isinstance(ground, Plane) and ground.normal[1] <= 0.0):
        refuse(TerrainError, "terrain", scene.terrain, "has no plane to place the rover on: give a start")
    return model.resting_pose(ground, (0.0, 0.0), heading)


def _ground(scene: Scene) -> tuple[Terrain, Decision]:
    reach = None if scene.reach is None else number("reach", scene.reach, above=0.0)
    terrain = scene.terrain
    if isinstance(terrain, Plane):
        return terrain, Decision("ground", "plane, no search", "there are no spheres")
    if not isinstance(terrain, SphereField):
        why = "the faces near the rover are searched, however large the ground is"
        return terrain, Decision("ground", _words(terrain), why)
    centres, radii, plane = terrain.centres, terrain.radii, terrain.ground
    shown = np.ones(len(radii), dtype=bool)
    if plane is not None:
        shown = centres @ plane.normal + plane.offset + radii > 0.0
    buried = int(len(radii) - shown.sum())
    far = 0
    if reach is not None:
        start = _start(scene)
        # Upper bound on the distance from the trunk's origin to any rim, in any pose.
        wheels = scene.model.wheel_radii.max() + max(_widths(scene.model), default=0.0)
        own = float(np.linalg.norm(np.abs(_extent(scene.model)).max(axis=0)) + wheels)
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
        refuse(OptionError, "reach", scene.reach, "is too small: no ground is left under the rover")
    kept = SphereField(centres[shown], radii[shown], plane, terrain.material)
    return kept, Decision("ground", f"{left} spheres in a ball tree", f"of {len(radii)} spheres {dropped}")


def _words(terrain: Terrain) -> str:
    """The parts of a ground in words."""
    words = []
    for part in parts_of(terrain):
        if isinstance(part, HeightField):
            rows, columns = part.shape
            words.append(f"map of {columns} x {rows} heights")
        elif isinstance(part, TriangleMesh):
            words.append(f"mesh of {len(part.triangles)} triangles")
        elif isinstance(part, SphereField):
            words.append(f"{len(part)} spheres in a ball tree")
        else:
            words.append("plane")
    return " and ".join(words)


def _extent(model: RoverModel) -> Array:
    """`(n, 3)` origins of the solids and lowest points of the wheels relative to the trunk, joints at zero, m."""
    origins = [origin for origin, _ in model.poses(np.zeros(model.nq), coordinates="state").values()]
    rims = model.wheel_contact_points(np.zeros(model.nq), Plane(), coordinates="state")
    return np.concatenate([np.array(origins), rims])


def _widths(model: RoverModel) -> list[float]:
    """Distance between the ends of each wheel's tread, m."""
    wheels = model.to_dict()["wheels"]
    return [wheel.get("width", 0.0) - 2.0 * wheel.get("rounding", 0.0) for wheel in wheels]


def _steering(scene: Scene, terrain: Terrain, start: Array) -> tuple[bool, Decision]:
    joints = steering_joints(scene.model)
    if not joints:
        return False, Decision("steering", "none", "the model has no free steering joint")
    angles = start[[i for i in scene.model.steering_joint_indices if i >= 0]]
    if not scene.steered and np.any(angles):
        refuse(OptionError, "steered", scene.steered, "is False, but the wheels are turned at the start")
    if scene.steered:
        why = "steering may be commanded"
    elif not isinstance(terrain, Plane):
        climbed = "sphere" if isinstance(terrain, SphereField) else "face"
        why = f"not commanded, but on {climbed}s the PD gives way enough to change which {climbed} a wheel climbs"
    elif not _rests(scene, terrain, start):
        why = "not commanded, but in a landing wheels strike at an angle and turn"
    elif _steering_offset(scene.model) > _STRAIGHT:
        why = "not commanded, but the wheels touch beside their steering axes and turn"
    else:
        why = "never commanded, and every wheel touches on its steering axis, so contact forces do not turn it"
        return True, Decision("steering", f"{len(joints)} joints welded at zero", why, WELD_ERROR)
    return False, Decision("steering", f"{len(joints)} joints held by the PD", why)


def _rests(scene: Scene, terrain: Plane, start: Array) -> bool:
    """Whether all wheels touch the plane at the start."""
    gaps = scene.model.wheel_gaps(start, terrain, coordinates="state")
    return float(np.abs(gaps).max()) <= RESTING


def _steering_offset(model: RoverModel) -> float:
    """Largest offset of a wheel's centre or contact points from its steering axis, wheels straight ahead, m."""
    description = model.to_dict()
    axes = {solid["name"]: np.array(solid.get("axis", (0.0, 0.0, 0.0)), dtype=float) for solid in description["solids"]}
    poses = model.poses(np.zeros(model.nq), coordinates="state")
    offsets = [0.0, *_widths(model)]
    for wheel in description["wheels"]:
        if (name := wheel.get("steering")) in model.dof_names:
            arm = poses[wheel["solid"]][0] - poses[name][0]
            axis = poses[name][1] @ axes[name]
            offsets.append(float(np.linalg.norm(np.cross(arm, axis)) / np.linalg.norm(axis)))
            # On a plane a wheel touches straight below its centre.
            offsets.append(float(np.hypot(axis[0], axis[2])))
    return max(offsets)


def _obstacle(scene: Scene, terrain: Terrain, start: Array, *, steers: bool) -> str | None:
    """The reason why a planar model is impossible; None if it is possible."""
    if not isinstance(terrain, Plane):
        ground = "spheres are" if isinstance(terrain, SphereField) else "the ground is"
        return f"{ground} not the same left and right"
    if steers:
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
    gravity = gravity_of(scene)
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
    if scene.model.wheel_stiffnesses.any():
        return "the wheels yield, and those of the planar model are rigid"
    return None


def _steps(simulation: Simulation, kind: Kind) -> Decision:
    if kind == "planar":
        return Decision(
            "steps", "general, one rover at a time", "the planar image has its own step, one machine at a time"
        )
    if simulation.settings["variant"] == "newton":
        return Decision("steps", "general, one rover at a time", 'variant is "newton"')
    register = "one rover to a register" if simulation.lanes == 1 else f"{simulation.lanes} rovers to a register"
    return Decision(
        "steps",
        f"fast: in lanes, {register} ({SimulationBatch([simulation]).instruction_set})",
        "a machine on fixed ground; `report.fallbacks` counts steps that take more effort, each alone",
    )


def _batch(terrain: Terrain, *, welded: bool) -> Decision:
    """The vector environment of such rovers, and what it saves."""
    arguments = []
    why = "steering may move"
    if welded:
        arguments.append("steered False")
        why = f"welded steering takes {BATCH_WELDED:g} of the time"
    if isinstance(terrain, Plane):
        why += f"; no rock is met, and a field of them would take {BATCH_UNMET:g} of the time"
    elif isinstance(terrain, SphereField):
        arguments.append("terrain 'rocks'")
        why += "; rocks may be met"
    else:
        arguments.append("this terrain")
        why += "; every start is on this ground"
    return Decision("in a batch", f"RoverVectorEnv with {' and '.join(arguments) or 'its defaults'}", why)


def _variant(scene: Scene, chosen: dict[str, Any], *, calm: bool) -> tuple[str, Decision]:
    if scene.tumbles:
        return "newton", Decision("scheme", "Newton", "keeps angular momentum in free flight to rounding")
    why = "Newton is of use in free flight; on the ground it changes the path by less than the error of the step"
    error = LINEARISED_ERROR * chosen["time_step"] ** 2 if calm else None
    return "linearised", Decision("scheme", "linearised", why, error)
