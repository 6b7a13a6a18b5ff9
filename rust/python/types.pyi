"""Types of the compiled module, from which `make stub` writes `envs/rover_gym/_core.pyi`.

A name with a type is a property. An argument that is not listed has the type of its default. All else is the module's:
docstrings, defaults, kinds of arguments and methods, base classes, special methods, and the types of the options that
`rust/python/src/options.rs` lists.
"""

import os
from collections.abc import Mapping, Sequence
from typing import Any, Literal, Protocol, TypeAlias, final, overload

import numpy as np
import numpy.typing as npt
from typing_extensions import disjoint_base

from rover_gym.ground.maps import terrain_files
from rover_gym.ground.maps.fractal import fractal_map
from rover_gym.models import file_writing, model_files

_Array: TypeAlias = npt.NDArray[np.float64]
_Rows: TypeAlias = npt.NDArray[np.uint64]
_Observation: TypeAlias = npt.NDArray[np.float32]
_Terrains: TypeAlias = "Sequence[Terrain | str | os.PathLike[str]] | str | os.PathLike[str]"
_Coordinates: TypeAlias = Literal["report", "state"]
_Range: TypeAlias = tuple[float, float]
_MaterialRow: TypeAlias = tuple[str, str, float, float]
_Materials: TypeAlias = Mapping[tuple[str, str], tuple[float, float]] | Sequence[_MaterialRow]

# Words that the module knows; the stub has a `Literal` of them.
_Accuracy: TypeAlias = str
_ContactRule: TypeAlias = str
_GrainStabilisation: TypeAlias = str
_Method: TypeAlias = str

class _Soil(Protocol):
    @property
    def numbers(self) -> Mapping[str, float]: ...

class _SparseArray(Protocol):
    @property
    def shape(self) -> tuple[int, ...]: ...
    def tobsr(self, blocksize: tuple[int, int] | None = ..., copy: bool = ...) -> Any: ...

__all__: list[str]

__version__: str

class RoverGymError:
    field: str | None
    value: object

class ModelError: ...
class StateError: ...
class TerrainError: ...
class OptionError: ...
class CommandError: ...
class ProblemError: ...
class StepError: ...
class BusyError: ...
class InternalError: ...

class Motor:
    def __new__(stall_torque: float, no_load_speed: float): ...
    stall_torque: float
    no_load_speed: float
    regenerating: bool

    def torque(command: float, speed: float) -> float: ...

class Machine:
    name: str
    solids: list[str]
    coordinates: slice
    joints: slice
    wheels: slice

class RoverModel:
    def __new__(): ...
    from_file = staticmethod(model_files.from_file)

    def from_text(text: str) -> RoverModel: ...
    def from_dict(description: Mapping[str, Any]) -> RoverModel: ...
    to_file = model_files.to_file

    def to_text() -> str: ...
    def to_dict() -> dict[str, Any]: ...
    def join(
        models: Mapping[str, RoverModel | str | os.PathLike[str]],
        loops: Sequence[Mapping[str, Any]] | None,
        name: str | None,
    ) -> RoverModel: ...
    machines: dict[str, Machine]

    def named(name: str) -> RoverModel: ...
    def names() -> list[str]: ...
    from_urdf = staticmethod(model_files.from_urdf)
    from_mjcf = staticmethod(model_files.from_mjcf)
    import_report: Any

    def _with_import_report(report: object) -> RoverModel: ...
    to_urdf = file_writing.write_urdf
    to_mjcf = file_writing.write_mjcf

    def replace(
        wheel_radius: float | None,
        contact_radius: float | None,
        wheel_stiffness: float | None,
        wheel_damping: float | None,
        wheel_tangential_ratio: float | None,
        wheel_relaxation_length: float | None,
        masses: Mapping[str, float] | Sequence[float] | None,
        steering_stiffness: float | None,
        steering_damping: float | None,
        wheel_torque_limit: float | None,
        mass_scale: float | None,
        motor: Motor | Mapping[str, Any] | None,
    ) -> RoverModel: ...
    def weld(joints: Mapping[str, float] | Sequence[str] | str) -> RoverModel: ...
    name: str
    nq: int
    nv: int
    mass: float
    loops: list[dict[str, Any]]

    def close_loops(q: npt.ArrayLike, v: npt.ArrayLike | None) -> tuple[_Array, _Array]: ...
    dof_names: list[str]
    joint_names: list[str]
    solid_names: list[str]
    wheel_names: list[str]
    wheel_radii: _Array
    wheel_stiffnesses: _Array
    clear_radius: float
    wheel_torque_limits: _Array
    motors: list[Motor | None]
    wheel_joint_indices: list[int]
    steering_joint_indices: list[int]
    steering_limit: float

    def mass_matrix(q: npt.ArrayLike, coordinates: _Coordinates) -> _Array: ...
    def bias(
        q: npt.ArrayLike, qdot: npt.ArrayLike, gravity: npt.ArrayLike | None, coordinates: _Coordinates
    ) -> _Array: ...
    def actuation_matrix() -> _Array: ...
    def kinetic_energy(q: npt.ArrayLike, qdot: npt.ArrayLike, coordinates: _Coordinates) -> float: ...
    def tags(q: npt.ArrayLike, coordinates: _Coordinates) -> dict[str, _Array]: ...
    def poses(q: npt.ArrayLike, coordinates: _Coordinates) -> dict[str, tuple[_Array, _Array]]: ...
    def wheel_gaps(q: npt.ArrayLike, terrain: Terrain | _Terrains, coordinates: _Coordinates) -> _Array: ...
    def resting_pose(terrain: Terrain | _Terrains, position: Sequence[float], heading: float) -> _Array: ...
    def wheel_contact_points(q: npt.ArrayLike, terrain: Terrain | _Terrains, coordinates: _Coordinates) -> _Array: ...
    def wheel_jacobians(q: npt.ArrayLike, terrain: Terrain | _Terrains, coordinates: _Coordinates) -> _Array: ...
    def to_report(q: npt.ArrayLike, v: npt.ArrayLike) -> tuple[_Array, _Array]: ...
    def from_report(q: npt.ArrayLike, qdot: npt.ArrayLike) -> tuple[_Array, _Array]: ...

class Terrain:
    def heights(points: npt.ArrayLike) -> _Array: ...
    def cast_rays(
        origins: npt.ArrayLike, directions: npt.ArrayLike, max_range: float | None
    ) -> tuple[_Array, _Array]: ...

class Plane:
    def __new__(normal: npt.ArrayLike | None): ...
    normal: _Array
    offset: float

    def tilted(slope: float, uphill: float) -> Plane: ...
    def height(x: float, z: float) -> float: ...

class SoftGround:
    def __new__(surface: Terrain, soil: _Soil | Mapping[str, float]): ...
    surface: Terrain
    soil: dict[str, float]
    rut_cell: float

class WheelBed:
    def __new__(soil: _Soil | Mapping[str, float], radius: float, width: float): ...
    n_points: int
    drum: float

    def steady(drives: npt.ArrayLike) -> _Array: ...
    def forces(sinkage: float, drives: npt.ArrayLike) -> _Array: ...
    def run(drives: npt.ArrayLike, mass: float, time_step: float) -> _Array: ...

class SphereField:
    def __new__(centres: npt.ArrayLike, radii: npt.ArrayLike, ground: Plane | None): ...
    from_file = staticmethod(terrain_files.sphere_field_from_file)

    def rug() -> SphereField: ...
    def rocks(
        abundance: float,
        area: Sequence[float],
        seed: int,
        burial: float | tuple[float, float] | None,
        ground: Terrain | _Terrains | None,
        clear: npt.ArrayLike | None,
    ) -> SphereField: ...
    material: str
    centres: _Array
    radii: _Array
    ground: Plane | None

class HeightField:
    def __new__(
        heights: npt.ArrayLike,
        spacing: float | tuple[float, float],
        origin: tuple[float, float] | None,
        map_frame: Sequence[float] | None,
    ): ...
    from_file = staticmethod(terrain_files.height_field_from_file)
    fractal = staticmethod(fractal_map)
    material: str
    grid: npt.NDArray[np.float32]
    shape: tuple[int, int]
    spacing: tuple[float, float]
    origin: tuple[float, float]
    bounds: tuple[float, float, float, float]
    map_frame: tuple[float, float, float, float] | None

    def place_of(easting: float, northing: float) -> tuple[float, float]: ...
    def coordinates_of(x: float, z: float) -> tuple[float, float]: ...

class TriangleMesh:
    def __new__(vertices: npt.ArrayLike, triangles: npt.ArrayLike): ...
    from_file = staticmethod(terrain_files.triangle_mesh_from_file)
    material: str
    vertices: _Array
    triangles: npt.NDArray[np.uint32]
    is_closed: bool

class Union:
    def __new__(parts: _Terrains): ...
    parts: list[Terrain]

class StepReport:
    status: Literal["converged", "not_converged"]
    is_converged: bool
    budget_exhausted: bool
    steps: int
    iterations: int
    newton_iterations: int
    residual: float
    n_contacts: int
    immovable_contacts: int
    loop_gap: float
    retaken: int
    fallbacks: int
    energy_gain: float
    energy_removed: float
    energy_supplied: float
    energy_of_set_points: float
    energy_dissipated: float
    energy_lost: float
    energy_lifted: float
    energy_released: float
    undetermined_loads: int

    def followed_by(later: StepReport) -> StepReport: ...

class Contacts:
    bodies: list[str]
    others: list[str | None]
    kinds: list[str]
    wheels: npt.NDArray[np.int64]
    points: _Array
    frames: _Array
    gaps: _Array
    impulses: _Array
    velocities: _Array

class PathSearch:
    def __new__(
        scan: tuple[int, int, float],
        outline: Mapping[str, Any],
        costs: Mapping[str, float],
        first: Mapping[str, Any],
        further: Mapping[str, Any],
        reach: float,
        arrival: float,
    ): ...
    def best(
        heights: npt.ArrayLike,
        goal: npt.ArrayLike,
        command: npt.ArrayLike,
        boldness: float,
        traps: npt.ArrayLike,
        retreat: float,
        extra: npt.ArrayLike | None,
        ways: npt.ArrayLike | None,
    ) -> int: ...
    def ways(
        heights: npt.ArrayLike, spacing: float, goal: npt.ArrayLike, boldness: float, extra: npt.ArrayLike | None
    ) -> npt.NDArray[np.float64]: ...
    def under(heights: npt.ArrayLike, poses: npt.ArrayLike) -> npt.NDArray[np.float32]: ...

class Linearisation:
    a: _Array
    b: _Array
    c: _Array
    state: _Array
    command: _Array
    next_state: _Array
    bodies: list[str]
    modes: list[str]
    margins: _Array
    is_projected: bool
    holds: npt.NDArray[np.bool_] | None
    errors: _Array | None
    is_smooth: bool | None

class StepDerivatives:
    states: _Array
    a: _Array
    b: _Array
    c: _Array

class Energy:
    kinetic: float
    potential: float
    total: float

class Snapshot:
    def from_bytes(data: bytes) -> Snapshot: ...
    def to_bytes() -> bytes: ...

class AnySimulation:
    time: float
    time_step: float

    def step() -> StepReport: ...
    def energy() -> Energy: ...
    def snapshot() -> Snapshot: ...
    def restore(snapshot: Snapshot): ...

class Simulation:
    def __new__(
        model: RoverModel | str | os.PathLike[str] | None,
        terrain: Terrain | _Terrains | None,
        gravity: npt.ArrayLike | None,
        accuracy: _Accuracy | float | None,
    ): ...
    model: RoverModel
    terrain: Terrain

    def sand() -> dict[str, _Array] | None: ...
    gravity: _Array
    friction: float
    restitution: float
    materials: dict[tuple[str, str], tuple[float, float]]
    settings: dict[str, Any]
    lanes: Literal[1, 4, 8]
    q: _Array
    v: _Array
    rotation: _Array

    def set_state(q: npt.ArrayLike, qdot: npt.ArrayLike | None, coordinates: _Coordinates): ...
    def report_state() -> tuple[_Array, _Array]: ...
    wheel_torques: _Array
    motor_torques: _Array
    loop_forces: dict[str, _Array]

    def set_wheel_torques(torques: npt.ArrayLike): ...
    steering: _Array

    def set_steering(set_points: npt.ArrayLike): ...
    def set_commands(torques: npt.ArrayLike, set_points: npt.ArrayLike): ...
    def set_joint_torques(torques: npt.ArrayLike): ...
    def apply_wrench(
        solid: str, force: npt.ArrayLike | None, moment: npt.ArrayLike | None, point: npt.ArrayLike | None
    ): ...
    def clear_wrenches(): ...
    def hold(
        joints: str | Sequence[str], set_points: npt.ArrayLike | None, stiffness: float | None, damping: float | None
    ): ...
    def release(joints: str | Sequence[str]): ...
    def brake(): ...
    contacts: Contacts
    wheel_gaps: _Array
    wheel_forces: _Array
    trunk_force: float
    deepest_overlap: float

    def reading(target: Sequence[float] | None, scan: npt.ArrayLike | None) -> _Array: ...
    def reading_layout() -> dict[str, slice]: ...
    def cast_rays(
        origins: npt.ArrayLike, directions: npt.ArrayLike, max_range: float | None, without: str | Sequence[str]
    ) -> tuple[_Array, _Array]: ...
    def momentum() -> tuple[_Array, _Array]: ...
    def centre_of_mass() -> _Array: ...
    def tags() -> dict[str, _Array]: ...
    def poses() -> dict[str, tuple[_Array, _Array]]: ...
    def last_problem() -> tuple[_Array, _Array, _Array]: ...
    def linearise(parameters: Sequence[str] | str) -> Linearisation: ...
    def differentiate(
        states: npt.ArrayLike, commands: npt.ArrayLike, parameters: Sequence[str] | str, threads: int | None
    ) -> StepDerivatives: ...
    def profile() -> dict[str, float]: ...

class PlanarGround:
    @overload
    def height(x: float) -> float: ...
    @overload
    def height(x: Sequence[float] | _Array) -> _Array: ...

class Line:
    def __new__(): ...
    slope: float
    offset: float

class Sine:
    def __new__(amplitude: float, wavelength: float): ...
    amplitude: float
    wavelength: float
    phase: float
    offset: float

class Spline:
    def __new__(x: npt.ArrayLike, y: npt.ArrayLike): ...
    x: _Array
    y: _Array

class Polyline:
    def __new__(x: npt.ArrayLike, y: npt.ArrayLike): ...
    def step(x: float, height: float) -> Polyline: ...
    x: _Array
    y: _Array

class PlanarContacts:
    discs: npt.NDArray[np.int64]
    points: _Array
    normals: _Array
    gaps: _Array
    impulses: _Array
    velocities: _Array

class PlanarSimulation:
    ground: PlanarGround
    q: _Array
    v: _Array
    centres: _Array
    gaps: _Array
    torques: _Array
    parameters: dict[str, Any]
    settings: dict[str, Any]

    def set_state(q: npt.ArrayLike, v: npt.ArrayLike | None): ...
    def set_torques(torques: npt.ArrayLike): ...
    contacts: PlanarContacts

    def mass_matrix() -> _Array: ...
    def last_problem() -> tuple[_Array, _Array, _Array]: ...

class BallSimulation:
    def __new__(ground: PlanarGround, inertia: float | None, gravity: npt.ArrayLike | None, contact: _ContactRule): ...

class TwoWheelRoverSimulation:
    def __new__(
        ground: PlanarGround,
        inertia: float | None,
        wheel_mass: float | npt.ArrayLike | None,
        wheel_radius: float | npt.ArrayLike | None,
        wheel_inertia: float | npt.ArrayLike | None,
        axle_a: npt.ArrayLike | None,
        axle_b: npt.ArrayLike | None,
        gravity: npt.ArrayLike | None,
        contact: _ContactRule,
    ): ...

class MirroredRoverSimulation:
    def __new__(
        ground: PlanarGround,
        model: RoverModel | str | os.PathLike[str] | None,
        gravity: npt.ArrayLike | None,
        contact: _ContactRule,
    ): ...
    joints: list[list[str]]
    wheels: list[list[str]]

class SimulationBatch:
    def __new__(simulations: Sequence[Simulation], scan: npt.ArrayLike | None, threads: int | None): ...
    threads: int
    instruction_set: Literal["AVX-512", "AVX2", "baseline"]
    reading_layout: dict[str, slice]

    def step(
        torques: npt.ArrayLike, set_points: npt.ArrayLike, active: npt.NDArray[np.bool_] | None
    ) -> tuple[_Array, dict[int, str]]: ...
    def readings() -> _Array: ...
    def replace(index: int, simulation: Simulation, target: Sequence[float] | None): ...
    def simulation(index: int) -> Simulation: ...

class EpisodeRules:
    def observation() -> list[tuple[str, int, int, str, tuple[float, ...], float, float, str]]: ...
    def observation_rows() -> list[tuple[int, int, str, str, str, str]]: ...
    def info_rows() -> list[tuple[str, str, str]]: ...
    terms: tuple[str, ...]

    def __new__(
        model: RoverModel,
        substeps: int,
        dt: float,
        torque_limits: npt.ArrayLike,
        max_steering: float,
        goal_tolerance: float,
        cos_max_tilt: float,
        stuck_time: float,
        weights: Mapping[str, float],
        gravity: float,
        scan: npt.ArrayLike | None,
        battery: float | None,
        free_distance: float | None,
        field_margin: float | None,
    ): ...

class EpisodeRun:
    def begin(
        rules: EpisodeRules,
        simulation: Simulation,
        goal: Sequence[float],
        domain: npt.ArrayLike,
        trunk_load_limit: float,
        difficulty: float,
        normals: npt.ArrayLike | None,
        further: npt.ArrayLike | None,
    ) -> EpisodeRun | None: ...
    observation: _Observation
    previous_action: _Array
    goal: _Range

    def info() -> dict[str, Any]: ...
    def changed(
        goal: Sequence[float] | None,
        distance: float | None,
        domain: npt.ArrayLike | None,
        trunk_load_limit: float | None,
        seen: EpisodeRun | None,
    ) -> EpisodeRun: ...
    def to_bytes() -> bytes: ...
    def from_bytes(rules: EpisodeRules, data: bytes) -> EpisodeRun: ...

class EpisodeDistribution:
    def __new__(
        rules: EpisodeRules,
        simulation: Simulation,
        start: Mapping[str, _Range],
        domain: Mapping[str, _Range],
        trunk_load_limit: float,
        rocks: Mapping[str, Any] | None,
        ground: Terrain | _Terrains | None,
        hills: float | None,
        sand: Sequence[SoftGround] | None,
    ): ...

class DrawnEpisodes:
    generators: _Rows

    def simulation(index: int) -> Simulation: ...

class EpisodeBatch:
    def __new__(rules: EpisodeRules, simulation: Simulation, n: int, max_steps: int | None, threads: int | None): ...
    threads: int

    def step(
        actions: object, active: npt.NDArray[np.bool_] | None, among: Sequence[RoverGrainSimulation | None] | None
    ) -> tuple[_Observation, _Array, npt.NDArray[np.bool_], npt.NDArray[np.bool_], list[int]]: ...
    over: list[int]

    def infos() -> dict[str, Any]: ...
    def info(index: int) -> dict[str, Any]: ...
    def observations() -> _Observation: ...
    def draw(
        distribution: EpisodeDistribution,
        generators: _Rows,
        difficulties: Sequence[_Range | None] | None,
        fixed: Mapping[str, Any] | Sequence[Mapping[str, Any]] | None,
    ) -> DrawnEpisodes: ...
    def begin(indices: Sequence[int], episodes: DrawnEpisodes): ...
    def resume(
        indices: Sequence[int],
        simulation: Simulation,
        episode: EpisodeRun,
        origin: tuple[npt.ArrayLike, npt.ArrayLike, int, npt.ArrayLike],
        generator: _Rows,
        message: str | None,
    ): ...
    def episode(index: int) -> EpisodeRun: ...
    def steps(index: int) -> int: ...
    def generators(indices: Sequence[int]) -> _Rows: ...
    def set_generators(indices: Sequence[int], generators: _Rows): ...
    def origin(index: int) -> tuple[_Array, _Array, int, _Array]: ...
    def terrain(index: int) -> Plane | SphereField: ...
    def complete(index: int) -> _Observation: ...
    def simulation(index: int) -> Simulation: ...

class BedSimulation:
    radius: npt.NDArray[np.float64]
    mass: npt.NDArray[np.float64]
    position: npt.NDArray[np.float64]
    velocity: npt.NDArray[np.float64]
    kinematic: npt.NDArray[np.bool_]
    asleep: npt.NDArray[np.bool_]
    walls: _Array
    settings: dict[str, Any]

    def remove(which: npt.ArrayLike): ...
    contacts: GrainContacts

    def momentum() -> npt.NDArray[np.float64]: ...
    def penetration() -> float: ...
    def wake(): ...

class DiskSimulation:
    def __new__(
        radius: npt.ArrayLike,
        mass: npt.ArrayLike,
        position: npt.ArrayLike,
        kinematic: npt.ArrayLike | None,
        walls: npt.ArrayLike | None,
        ground: PlanarGround | None,
        rover: dict[str, Any] | None,
        rig: npt.ArrayLike | None,
        machine: npt.ArrayLike | None,
        gravity: npt.ArrayLike | None,
        stabilisation: _GrainStabilisation | None,
        penetration_tolerance: float | None,
        sleep_speed: float | None,
        sleep_distance: float | None,
    ): ...
    machine: npt.NDArray[np.float64]
    machine_rate: npt.NDArray[np.float64]
    wheels: npt.NDArray[np.float64]
    torques: npt.NDArray[np.float64]
    pull: tuple[float, float]

    def set_state(
        position: npt.ArrayLike,
        velocity: npt.ArrayLike | None,
        machine: npt.ArrayLike | None,
        machine_rate: npt.ArrayLike | None,
    ): ...
    def set_torques(torques: npt.ArrayLike): ...
    def set_pull(pull: npt.ArrayLike): ...
    def impulse_on_wheels() -> npt.NDArray[np.float64]: ...

class Drum:
    def __new__(radius: float, length: float, centre: npt.ArrayLike | None): ...
    radius: float
    length: float
    rate: float
    centre: tuple[float, float, float]

class Silo:
    def __new__(radius: float, floor: float | None, axis: npt.ArrayLike | None): ...
    radius: float
    floor: float | None
    hole: float
    axis: tuple[float, float]

class GrainContacts:
    bodies: npt.NDArray[np.int64]
    points: _Array
    normals: _Array
    frames: _Array
    gaps: _Array
    impulses: _Array
    velocities: _Array
    world_impulses: _Array
    world_moments: _Array

class GrainSimulation:
    def __new__(
        radius: npt.ArrayLike,
        mass: npt.ArrayLike,
        position: npt.ArrayLike,
        kinematic: npt.ArrayLike | None,
        walls: npt.ArrayLike | None,
        wall_velocity: npt.ArrayLike | None,
        vessel: Drum | Silo | None,
        terrain: Terrain | _Terrains | None,
        cohesion_range: float | None,
        gravity: npt.ArrayLike | None,
        stabilisation: _GrainStabilisation | None,
        penetration_tolerance: float | None,
        sleep_speed: float | None,
        sleep_distance: float | None,
    ): ...
    spin: _Array
    terrain: Terrain | None
    vessel: Drum | Silo | None

    def set_state(position: npt.ArrayLike, velocity: npt.ArrayLike | None, spin: npt.ArrayLike | None): ...
    def exchange(
        radius: npt.ArrayLike,
        mass: npt.ArrayLike,
        position: npt.ArrayLike,
        before: Sequence[int],
        kinematic: npt.ArrayLike | None,
        velocity: npt.ArrayLike | None,
        spin: npt.ArrayLike | None,
    ): ...

class RoverGrainSimulation:
    def __new__(rover: Simulation, grains: GrainSimulation): ...
    rover: Simulation
    grains: GrainSimulation
    wheel_friction: float
    wheel_gaps: npt.NDArray[np.float64]

    def penetration() -> float: ...

def seed_generators(seeds: Sequence[int]) -> _Rows: ...
def standard_normals(generators: _Rows, size: int) -> tuple[_Array, _Rows]: ...
def disk_packing() -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64], npt.NDArray[np.float64]]: ...
def ball_packing(
    count: int, radius_min: float, radius_max: float, mass: float, width: float, depth: float
) -> tuple[_Array, _Array, _Array]: ...
def arrange_balls(radius: npt.ArrayLike, width: float, depth: float) -> _Array: ...

class SolverReport:
    status: Literal["converged", "relaxed", "not_converged", "budget_exhausted"]
    is_converged: bool
    iterations: int
    residual: float
    velocity_error: float
    solver: str
    stage: Literal[
        "at_rest",
        "sweeps",
        "body_sweeps",
        "islands",
        "pivoting",
        "guided_newton",
        "newton",
        "proximal",
        "restarts",
        "interior_point",
        "admm",
        "relaxed",
    ]
    stages: list[tuple[str, str, int]]
    work: int
    law: Literal["coulomb", "relaxed"]

class FrictionContactSolution:
    impulses: _Array
    velocities: _Array
    report: SolverReport
    history: list[tuple[str, int, float]]

def accuracy_options(accuracy: _Accuracy | float) -> dict[str, Any]: ...
@overload
def sin_cos(x: float) -> tuple[float, float]: ...
@overload
def sin_cos(x: npt.NDArray[Any]) -> tuple[_Array, _Array]: ...
@overload
def atan2(y: float, x: float) -> float: ...
@overload
def atan2(y: npt.NDArray[Any], x: npt.NDArray[Any]) -> _Array: ...
@overload
def exp(x: float) -> float: ...
@overload
def exp(x: npt.NDArray[Any]) -> _Array: ...
def solve_friction_contact(
    W: npt.ArrayLike | _SparseArray | tuple[npt.ArrayLike, npt.ArrayLike, npt.ArrayLike],
    q: npt.ArrayLike,
    mu: npt.ArrayLike,
    dimension: Literal[2, 3],
    solver: _Method,
    initial: npt.ArrayLike | None,
    budget: int | None,
) -> FrictionContactSolution: ...
