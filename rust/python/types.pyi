"""Types of the compiled module, from which `make stub` writes `envs/rover_gym/_core.pyi`.

A name with a type is a property. An argument that a function does not list has the type that `_ARGUMENTS` gives its
name, or else that of its default; a constructor may be left out. All else is the module's: docstrings, defaults, kinds
of arguments and methods, base classes, special methods, and the types of the options that `options.rs` and
`bed_options.rs` list in `rust/python/src`.
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
_Method: TypeAlias = str

# Types of arguments by name. A function lists those of its arguments that have another type.
_ARGUMENTS = {
    "float": (
        "abundance amplitude arrival battery boldness contact_radius cos_max_tilt damping depth difficulty "
        "distance dt easting field_margin floor free_distance goal_tolerance heading height hills inertia "
        "length mass_scale max_range max_steering no_load_speed northing radius_max radius_min reach retreat "
        "sinkage slope speed stall_torque steering_damping steering_stiffness stiffness stuck_time time_step "
        "trunk_load_limit uphill wavelength wheel_damping wheel_radius wheel_relaxation_length "
        "wheel_stiffness wheel_tangential_ratio wheel_torque_limit width z"
    ),
    "npt.ArrayLike": (
        "axis axle_a axle_b centre centres clear command commands directions domain drives extra force "
        "further goal gravity heights initial kinematic machine machine_rate mass moment mu normal normals "
        "origins point points poses position pull q qdot radii radius rig scan set_points speeds spin states "
        "torque_limits torques traps triangles v velocity vertices wall_velocity walls ways which"
    ),
    "int": "budget count index max_steps n seed size substeps threads",
    "str": "message name solid text",
    "str | Sequence[str]": "joints",
    "_Coordinates": "coordinates",
    "Terrain | _Terrains": "terrain",
    "PlanarGround": "ground",
    "bytes": "data",
    "RoverModel | str | os.PathLike[str]": "model",
    "_Accuracy | float": "accuracy",
    "Sequence[float]": "target",
    "Sequence[str] | str": "parameters",
    "_ContactRule": "contact",
    "npt.NDArray[np.bool_]": "active",
    "Simulation": "simulation",
    "EpisodeRules": "rules",
    "_Rows": "generators",
    "Sequence[int]": "indices",
    "_Soil | Mapping[str, float]": "soil",
}

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
    stall_torque: float
    no_load_speed: float
    regenerating: bool

    def torque(command: float) -> float: ...

class Machine:
    name: str
    solids: list[str]
    coordinates: slice
    joints: slice
    wheels: slice

class RoverModel:
    from_file = staticmethod(model_files.from_file)

    def from_text() -> RoverModel: ...
    def from_dict(description: Mapping[str, Any]) -> RoverModel: ...
    to_file = model_files.to_file

    def to_text() -> str: ...
    def to_dict() -> dict[str, Any]: ...
    def join(
        models: Mapping[str, RoverModel | str | os.PathLike[str]], loops: Sequence[Mapping[str, Any]] | None
    ) -> RoverModel: ...
    machines: dict[str, Machine]

    def named() -> RoverModel: ...
    def names() -> list[str]: ...
    from_urdf = staticmethod(model_files.from_urdf)
    from_mjcf = staticmethod(model_files.from_mjcf)
    import_report: Any

    def _with_import_report(report: object) -> RoverModel: ...
    to_urdf = file_writing.write_urdf
    to_mjcf = file_writing.write_mjcf

    def replace(
        masses: Mapping[str, float] | Sequence[float] | None, motor: Motor | Mapping[str, Any] | None
    ) -> RoverModel: ...
    def weld(joints: Mapping[str, float] | Sequence[str] | str) -> RoverModel: ...
    name: str
    nq: int
    nv: int
    mass: float
    loops: list[dict[str, Any]]

    def close_loops() -> tuple[_Array, _Array]: ...
    dof_names: list[str]
    joint_names: list[str]
    solid_names: list[str]
    wheel_names: list[str]
    wheel_radii: _Array
    wheel_stiffnesses: _Array
    clear_radius: float
    wheel_torque_limits: _Array
    wheel_speed_gains: _Array
    motors: list[Motor | None]
    wheel_joint_indices: list[int]
    steering_joint_indices: list[int]
    steering_limit: float

    def mass_matrix() -> _Array: ...
    def bias() -> _Array: ...
    def actuation_matrix() -> _Array: ...
    def kinetic_energy() -> float: ...
    def tags() -> dict[str, _Array]: ...
    def poses() -> dict[str, tuple[_Array, _Array]]: ...
    def wheel_gaps() -> _Array: ...
    def resting_pose(position: Sequence[float]) -> _Array: ...
    def wheel_contact_points() -> _Array: ...
    def wheel_jacobians() -> _Array: ...
    def to_report() -> tuple[_Array, _Array]: ...
    def from_report() -> tuple[_Array, _Array]: ...

class Terrain:
    def heights() -> _Array: ...
    def cast_rays() -> tuple[_Array, _Array]: ...

class Plane:
    normal: _Array
    offset: float

    def tilted() -> Plane: ...
    def height(x: float) -> float: ...

class SoftGround:
    def __new__(surface: Terrain): ...
    surface: Terrain
    soil: dict[str, float]
    rut_cell: float

class WheelBed:
    def __new__(radius: float, accuracy: float): ...
    n_points: int
    drum: float

    def steady() -> _Array: ...
    def forces() -> _Array: ...
    def run(mass: float) -> _Array: ...

class SphereField:
    def __new__(ground: Plane | None): ...
    from_file = staticmethod(terrain_files.sphere_field_from_file)

    def rug() -> SphereField: ...
    def rocks(
        area: Sequence[float], burial: float | tuple[float, float] | None, ground: Terrain | _Terrains | None
    ) -> SphereField: ...
    material: str
    centres: _Array
    radii: _Array
    ground: Plane | None

class HeightField:
    def __new__(
        spacing: float | tuple[float, float], origin: tuple[float, float] | None, map_frame: Sequence[float] | None
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

    def place_of() -> tuple[float, float]: ...
    def coordinates_of(x: float) -> tuple[float, float]: ...

class TriangleMesh:
    from_file = staticmethod(terrain_files.triangle_mesh_from_file)
    material: str
    vertices: _Array
    triangles: npt.NDArray[np.uint32]
    is_closed: bool

class Union:
    def __new__(parts: _Terrains): ...
    parts: list[Terrain]

class PictureLook:
    def __new__(
        drawings: Mapping[str, tuple[npt.ArrayLike, npt.ArrayLike, npt.ArrayLike]],
        colours: Mapping[str, npt.ArrayLike],
        light: Mapping[str, npt.ArrayLike],
        grain: npt.ArrayLike,
        tile: float,
    ): ...

class StepReport:
    status: Literal["converged", "not_converged"]
    is_converged: bool
    budget_exhausted: bool
    acceptable: int
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
    ): ...
    def best() -> int: ...
    def ways(spacing: float) -> npt.NDArray[np.float64]: ...
    def under() -> npt.NDArray[np.float32]: ...

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
    def from_bytes() -> Snapshot: ...
    def to_bytes() -> bytes: ...

class AnySimulation:
    time: float
    time_step: float

    def step() -> StepReport: ...
    def energy() -> Energy: ...
    def snapshot() -> Snapshot: ...
    def restore(snapshot: Snapshot): ...

class Simulation:
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

    def set_state(): ...
    def report_state() -> tuple[_Array, _Array]: ...
    wheel_torques: _Array
    motor_torques: _Array
    loop_forces: dict[str, _Array]

    def set_wheel_torques(): ...
    wheel_speeds: _Array | None

    def set_wheel_speeds(set_points: npt.ArrayLike | None): ...
    steering: _Array

    def set_steering(): ...
    def set_commands(): ...
    def set_joint_torques(): ...
    def apply_wrench(): ...
    def clear_wrenches(): ...
    def hold(): ...
    def release(): ...
    def brake(): ...
    contacts: Contacts
    wheel_gaps: _Array
    wheel_forces: _Array
    trunk_force: float
    deepest_overlap: float

    def reading() -> _Array: ...
    def reading_layout() -> dict[str, slice]: ...
    def cast_rays(without: str | Sequence[str]) -> tuple[_Array, _Array]: ...
    def take_picture(
        look: PictureLook,
        place: npt.ArrayLike,
        pixel: float,
        sun: npt.ArrayLike | None,
        balls: SphereField | None,
        without: str | Sequence[str],
    ) -> tuple[_Observation, npt.NDArray[np.uint8], _Array]: ...
    def momentum() -> tuple[_Array, _Array]: ...
    def centre_of_mass() -> _Array: ...
    def tags() -> dict[str, _Array]: ...
    def poses() -> dict[str, tuple[_Array, _Array]]: ...
    def last_problem() -> tuple[_Array, _Array, _Array]: ...
    def linearise() -> Linearisation: ...
    def differentiate() -> StepDerivatives: ...
    def profile() -> dict[str, float]: ...

class PlanarGround:
    @overload
    def height(x: float) -> float: ...
    @overload
    def height(x: Sequence[float] | _Array) -> _Array: ...

class Line:
    slope: float
    offset: float

class Sine:
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
    def step(x: float) -> Polyline: ...
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

    def set_state(): ...
    def set_torques(): ...
    contacts: PlanarContacts

    def mass_matrix() -> _Array: ...
    def last_problem() -> tuple[_Array, _Array, _Array]: ...

class BallSimulation:
    def __new__(mass: float, radius: float): ...

class TwoWheelRoverSimulation:
    def __new__(
        mass: float,
        wheel_mass: float | npt.ArrayLike | None,
        wheel_radius: float | npt.ArrayLike | None,
        wheel_inertia: float | npt.ArrayLike | None,
    ): ...

class MirroredRoverSimulation:
    joints: list[list[str]]
    wheels: list[list[str]]

class SimulationBatch:
    def __new__(simulations: Sequence[Simulation]): ...
    threads: int
    instruction_set: Literal["AVX-512", "AVX2", "baseline"]
    reading_layout: dict[str, slice]

    def step(torques: npt.ArrayLike | None, speeds: npt.ArrayLike | None) -> tuple[_Array, dict[int, str]]: ...
    def readings() -> _Array: ...
    def replace(): ...
    def simulation() -> Simulation: ...

class EpisodeRules:
    def observation() -> list[tuple[str, int, int, str, tuple[float, ...], float, float, str]]: ...
    def observation_rows() -> list[tuple[int, int, str, str, str, str]]: ...
    def info_rows() -> list[tuple[str, str, str]]: ...
    terms: tuple[str, ...]

    def __new__(model: RoverModel, weights: Mapping[str, float], gravity: float): ...

class EpisodeRun:
    def begin(goal: Sequence[float]) -> EpisodeRun | None: ...
    observation: _Observation
    previous_action: _Array
    goal: _Range

    def info() -> dict[str, Any]: ...
    def changed(goal: Sequence[float] | None, seen: EpisodeRun | None) -> EpisodeRun: ...
    def to_bytes() -> bytes: ...
    def from_bytes() -> EpisodeRun: ...

class EpisodeDistribution:
    def __new__(
        start: Mapping[str, _Range],
        domain: Mapping[str, _Range],
        rocks: Mapping[str, Any] | None,
        ground: Terrain | _Terrains | None,
        sand: Sequence[SoftGround] | None,
    ): ...

class DrawnEpisodes:
    generators: _Rows

    def simulation() -> Simulation: ...

class EpisodeBatch:
    threads: int

    def step(
        actions: object,
        among: Sequence[RoverGrainSimulation | None] | None,
        info: int | Literal["all"] | None,
    ) -> tuple[_Observation, _Array, npt.NDArray[np.bool_], npt.NDArray[np.bool_], dict[str, Any]]: ...
    over: list[int]

    def infos() -> dict[str, Any]: ...
    def info() -> dict[str, Any]: ...
    def observations() -> _Observation: ...
    def draw(
        distribution: EpisodeDistribution,
        difficulties: Sequence[_Range | None] | None,
        fixed: Mapping[str, Any] | Sequence[Mapping[str, Any]] | None,
    ) -> DrawnEpisodes: ...
    def begin(episodes: DrawnEpisodes): ...
    def resume(
        episode: EpisodeRun, origin: tuple[npt.ArrayLike, npt.ArrayLike, int, npt.ArrayLike], generator: _Rows
    ): ...
    def episode() -> EpisodeRun: ...
    def steps() -> int: ...
    def generators() -> _Rows: ...
    def set_generators(): ...
    def origin() -> tuple[_Array, _Array, int, _Array]: ...
    def terrain() -> Plane | SphereField: ...
    def complete() -> _Observation: ...
    def simulation() -> Simulation: ...

class BedSimulation:
    radius: npt.NDArray[np.float64]
    mass: npt.NDArray[np.float64]
    position: npt.NDArray[np.float64]
    velocity: npt.NDArray[np.float64]
    kinematic: npt.NDArray[np.bool_]
    asleep: npt.NDArray[np.bool_]
    walls: _Array
    settings: dict[str, Any]

    def remove(): ...
    contacts: GrainContacts

    def momentum() -> npt.NDArray[np.float64]: ...
    def penetration() -> float: ...
    def wake(): ...

class DiskSimulation:
    def __new__(rover: dict[str, Any] | None): ...
    machine: npt.NDArray[np.float64]
    machine_rate: npt.NDArray[np.float64]
    wheels: npt.NDArray[np.float64]
    torques: npt.NDArray[np.float64]
    pull: tuple[float, float]

    def set_state(): ...
    def set_torques(): ...
    def set_pull(): ...
    def impulse_on_wheels() -> npt.NDArray[np.float64]: ...

class Drum:
    def __new__(radius: float): ...
    radius: float
    length: float
    rate: float
    centre: tuple[float, float, float]

class Silo:
    def __new__(radius: float): ...
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
    def __new__(vessel: Drum | Silo | None): ...
    spin: _Array
    terrain: Terrain | None
    vessel: Drum | Silo | None

    def set_state(): ...
    def exchange(before: Sequence[int]): ...

class RoverGrainSimulation:
    def __new__(rover: Simulation, grains: GrainSimulation): ...
    rover: Simulation
    grains: GrainSimulation
    wheel_friction: float
    wheel_gaps: npt.NDArray[np.float64]

    def penetration() -> float: ...

def seed_generators(seeds: Sequence[int]) -> _Rows: ...
def standard_normals() -> tuple[_Array, _Rows]: ...
def disk_packing(mass: float) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64], npt.NDArray[np.float64]]: ...
def ball_packing(mass: float) -> tuple[_Array, _Array, _Array]: ...
def arrange_balls() -> _Array: ...

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
        "pyramids",
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

def accuracy_options() -> dict[str, Any]: ...
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
    dimension: Literal[2, 3],
    solver: _Method,
) -> FrictionContactSolution: ...
