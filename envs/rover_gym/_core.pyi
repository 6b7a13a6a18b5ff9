"""Compiled core of rover-gym: the border to the Rust mechanics (`rover-core`).

SI units and radians everywhere. World frame: x forward, y up, z to the right. Wheels are always
listed FL, FR, ML, BL, MR, BR. Every array returned is new.
"""

from collections.abc import Mapping, Sequence
from typing import Any, Literal, Protocol, TypeAlias, final, overload

import numpy as np
import numpy.typing as npt
from typing_extensions import disjoint_base

from rover_gym.maps import terrain_files
from rover_gym.maps.fractal import fractal_map
from rover_gym.models import file_writing, model_files

_Array: TypeAlias = npt.NDArray[np.float64]
_Rows: TypeAlias = npt.NDArray[np.uint64]
_Observation: TypeAlias = npt.NDArray[np.float32]
_Terrains: TypeAlias = "Sequence[Terrain]"
_Coordinates: TypeAlias = Literal["report", "state"]
_Range: TypeAlias = tuple[float, float]
_MaterialRow: TypeAlias = tuple[str, str, float, float]
_Materials: TypeAlias = Mapping[tuple[str, str], tuple[float, float]] | Sequence[_MaterialRow]

class _Soil(Protocol):
    @property
    def numbers(self) -> Mapping[str, float]: ...

class _SparseArray(Protocol):
    @property
    def shape(self) -> tuple[int, ...]: ...
    def tobsr(self, blocksize: tuple[int, int] | None = ..., copy: bool = ...) -> Any: ...

__all__: list[str] = [
    "AnySimulation",
    "BallSimulation",
    "BusyError",
    "CommandError",
    "Contacts",
    "DrawnEpisodes",
    "Drum",
    "Energy",
    "EpisodeBatch",
    "EpisodeDistribution",
    "EpisodeRules",
    "EpisodeRun",
    "FrictionContactSolution",
    "GrainContacts",
    "GrainSimulation",
    "HeightField",
    "Line",
    "Linearisation",
    "MirroredRoverSimulation",
    "ModelError",
    "Motor",
    "OptionError",
    "PathSearch",
    "PlanarContacts",
    "PlanarGround",
    "PlanarSimulation",
    "Plane",
    "Polyline",
    "ProblemError",
    "RoverGrainSimulation",
    "RoverGymError",
    "RoverModel",
    "Silo",
    "Simulation",
    "SimulationBatch",
    "Sine",
    "Snapshot",
    "SoftGround",
    "SoilSimulation",
    "SolverReport",
    "SphereField",
    "Spline",
    "StateError",
    "StepError",
    "StepReport",
    "Terrain",
    "TerrainError",
    "TriangleMesh",
    "TwoWheelRoverSimulation",
    "Union",
    "WheelBed",
    "__version__",
    "accuracy_options",
    "arrange_balls",
    "atan2",
    "ball_packing",
    "exp",
    "seed_generators",
    "sin_cos",
    "soil_packing",
    "solve_friction_contact",
    "standard_normals",
]

__version__: str

class RoverGymError(Exception):
    """Root of every error that rover-gym raises.

    Attributes:
        field: Name of the argument at fault, with the index of the entry; None where there is none.
        value: What was given there, or None.
    """

    field: str | None
    value: object

class ModelError(RoverGymError, ValueError):
    """A model's description is unreadable or not physical."""

class StateError(RoverGymError, ValueError):
    """A state or a snapshot has a wrong shape or an entry that is not finite."""

class TerrainError(RoverGymError, ValueError):
    """A terrain's description is invalid."""

class OptionError(RoverGymError, ValueError):
    """An option or another argument is out of its range."""

class CommandError(RoverGymError, ValueError):
    """A torque, a set-point or an action is invalid."""

class ProblemError(RoverGymError, ValueError):
    """A friction-contact problem has a wrong shape or an invalid entry."""

class StepError(RoverGymError, RuntimeError):
    """A time step could not be taken; the state is as it was before that step."""

class BusyError(RoverGymError, RuntimeError):
    """An object was used while another call on it was still going on. Nothing has changed."""

@final
class Motor:
    """The torque-speed line of a wheel's motor. Immutable.

    The torque is the command, but at most `stall_torque * (1 - speed / no_load_speed)` forwards and
    `stall_torque * (1 + speed / no_load_speed)` backwards, and at most `stall_torque` either way.

    Args:
        stall_torque: Torque of the line at rest, N m.
        no_load_speed: Speed at which the line reaches zero, rad/s. If infinite, the torque does not
            depend on the speed.
        regenerating: Whether the motor brakes when it is driven faster than `no_load_speed`, along
            the line and with at most the stall torque. Otherwise it turns freely there.

    Raises:
        ModelError: `stall_torque` is not from 1e-9 to 1e9 N m, or `no_load_speed` is neither from
            1e-6 to 1e9 rad/s nor infinite.
    """

    def __new__(cls, stall_torque: float, no_load_speed: float, regenerating: bool = True) -> Motor: ...
    @property
    def stall_torque(self) -> float:
        """Torque of the line at rest, N m."""
    @property
    def no_load_speed(self) -> float:
        """Speed at which the line reaches zero, rad/s; may be infinite."""
    @property
    def regenerating(self) -> bool:
        """Whether the motor brakes when it is driven faster than `no_load_speed`."""
    def torque(self, command: float, speed: float) -> float:
        """The torque that the motor gives under a command at a speed.

        Args:
            command: Commanded torque, N m.
            speed: Speed of the wheel in the direction of positive torque, rad/s.

        Returns:
            The torque, N m.

        Raises:
            CommandError: A number is not finite.
        """
    def __getnewargs__(self) -> tuple[float, float, bool]: ...
    def __eq__(self, other: object, /) -> bool: ...
    def __hash__(self) -> int: ...

@final
class RoverModel:
    """A machine: a tree of solids under a free base, read from data. Immutable.

    `RoverModel()` is the built-in six-wheel rover. The other constructors are `named`, `from_text`
    and `from_dict`, and those that read files: `from_file`, `from_urdf` and `from_mjcf`.

    Methods that take coordinates understand two sets of them, by the argument `coordinates`:
    "state", the `q` and `v` of `Simulation`, and "report", the Cardan angles of the 2010 report and
    their rates. They raise StateError where `q` or `qdot` has a wrong length or an entry that is
    not finite, OptionError where `coordinates` is neither of the two, and TerrainError where
    `terrain` is not a terrain.
    """

    def __new__(cls) -> RoverModel: ...
    from_file = staticmethod(model_files.from_file)
    @staticmethod
    def from_text(text: str) -> RoverModel:
        """Reads a model from TOML text.

        Args:
            text: What a model file holds.

        Raises:
            ModelError: The text does not describe a model.
        """
    @staticmethod
    def from_dict(description: Mapping[str, Any]) -> RoverModel:
        """Reads a model from nested dictionaries and lists.

        Args:
            description: What `to_dict` returns.

        Raises:
            ModelError: The dictionaries do not describe a model.
        """
    to_file = model_files.to_file
    def to_text(self) -> str:
        """The description as TOML text, as `from_text` reads it."""
    def to_dict(self) -> dict[str, Any]:
        """The description as nested dictionaries and lists, as `from_dict` reads it."""
    @staticmethod
    def named(name: str) -> RoverModel:
        """The model of the gallery with this name.

        Args:
            name: One of `names()`.

        Raises:
            ModelError: There is no such model; the message lists those that there are.
        """
    @staticmethod
    def names() -> list[str]:
        """Names of the models of the gallery; the first is the built-in rover."""
    from_urdf = staticmethod(model_files.from_urdf)
    from_mjcf = staticmethod(model_files.from_mjcf)
    @property
    def import_report(self) -> Any:
        """What the import of this model understood, assumed and left out.

        A `rover_gym.models.ImportReport`; None for a model that was not imported, and for one that
        was derived from an imported one.
        """
    def _with_import_report(self, report: object) -> RoverModel: ...
    to_urdf = file_writing.write_urdf
    to_mjcf = file_writing.write_mjcf
    def replace(
        self,
        *,
        wheel_radius: float | None = None,
        contact_radius: float | None = None,
        wheel_stiffness: float | None = None,
        wheel_damping: float | None = None,
        masses: Mapping[str, float] | Sequence[float] | None = None,
        steering_stiffness: float | None = None,
        steering_damping: float | None = None,
        wheel_torque_limit: float | None = None,
        mass_scale: float | None = None,
        motor: Motor | Mapping[str, Any] | None = ...,
    ) -> RoverModel:
        """Returns a model that differs in what is given.

        Args:
            wheel_radius: Radius of all wheels, m: shape, inertia and contact change together.
            contact_radius: Radius at which the wheels touch the ground, m; shape and inertia stay
                as they are.
            wheel_stiffness: Normal stiffness of all wheels where they touch, N/m, 0 for rigid
                wheels, which have no damping either.
            wheel_damping: Normal damping beside the stiffness, N s/m.
            masses: Masses by name of the solid, or one for each solid, kg. Inertias scale with
                them.
            steering_stiffness: Stiffness of every steering controller, N m/rad.
            steering_damping: Damping of every steering controller, N m s/rad.
            wheel_torque_limit: Largest torque of every wheel, N m.
            mass_scale: Factor of all masses and inertias.
            motor: The motor of all wheels: a `Motor`, its fields by name, or None for wheels that
                give their command at any speed. Left out, the motors stay.

        Raises:
            ModelError: A number is out of its range, a solid has no such name, or a wheel radius is
                given where a wheel's solid is no disc.
        """
    def weld(self, joints: Mapping[str, float] | Sequence[str] | str) -> RoverModel:
        """Returns the same machine with joints locked; their coordinates are gone.

        Args:
            joints: Names of joints, which are locked at 0, or a mapping of names to angles, rad.

        Returns:
            The new model. The locks are kept in its files and dictionaries.

        Raises:
            ModelError: There is no such joint, or an angle is not finite.
        """
    @property
    def name(self) -> str:
        """Name of the model."""
    @property
    def nq(self) -> int:
        """Number of coordinates."""
    @property
    def nv(self) -> int:
        """Number of velocities."""
    @property
    def mass(self) -> float:
        """Total mass, kg."""
    @property
    def dof_names(self) -> list[str]:
        """Names of the coordinates, x, y, z, roll, heading, pitch, then the joints."""
    @property
    def joint_names(self) -> list[str]:
        """Names of the joints that are not locked, in the order of q."""
    @property
    def solid_names(self) -> list[str]:
        """Names of the solids."""
    @property
    def wheel_names(self) -> list[str]:
        """Names of the wheels, in the order of every array with one entry a wheel."""
    @property
    def wheel_radii(self) -> _Array:
        """Radius at which each wheel touches the ground, (n_wheels,), m."""
    @property
    def clear_radius(self) -> float:
        """Radius of the place that the rover needs to turn on the spot, m.

        It is the largest distance from the trunk's origin to a wheel's contact, joints at zero,
        plus the wheel's radius and 0.1 m.
        """
    @property
    def wheel_torque_limits(self) -> _Array:
        """Largest torque of each wheel, (n_wheels,), N m."""
    @property
    def motors(self) -> list[Motor | None]:
        """The motor of each wheel; None where the torque is the command at any speed."""
    @property
    def wheel_joint_indices(self) -> list[int]:
        """Index in q of each wheel's rotation; -1 where it is locked."""
    @property
    def steering_joint_indices(self) -> list[int]:
        """Index in q of each wheel's steering joint; -1 where there is none or it is locked."""
    @property
    def steering_limit(self) -> float:
        """Largest steering set-point either way, rad."""
    def mass_matrix(self, q: npt.ArrayLike, coordinates: _Coordinates = "state") -> _Array:
        """The mass matrix M(q).

        Args:
            q: Coordinates, (nq,).
            coordinates: "state" or "report".

        Returns:
            (nv, nv), in kg, kg m and kg m².

        Source: Featherstone 2008, ch. 6.
        """
    def bias(
        self,
        q: npt.ArrayLike,
        qdot: npt.ArrayLike,
        gravity: npt.ArrayLike | None = None,
        coordinates: _Coordinates = "state",
    ) -> _Array:
        """The bias N(q, v) v + G(q) of the equations of motion, M dv/dt + bias = generalized forces.

        Args:
            q: Coordinates, (nq,).
            qdot: Velocity in the same coordinates, (nv,).
            gravity: Gravity, world frame, (3,), m/s²; (0, -9.81, 0) by default.
            coordinates: "state" or "report".

        Returns:
            (nv,), in N and N m.

        Raises:
            OptionError: `gravity` is not three finite numbers.

        Source: Featherstone 2008, ch. 5.
        """
    def actuation_matrix(self) -> _Array:
        """The matrix that maps wheel torques and steering torques to generalized forces.

        Returns:
            (nv, 2 n_wheels): a column for each wheel's torque, positive forward, then one for each
            steering torque.
        """
    def kinetic_energy(self, q: npt.ArrayLike, qdot: npt.ArrayLike, coordinates: _Coordinates = "state") -> float:
        """The kinetic energy, half of v · M v, J.

        Args:
            q: Coordinates, (nq,).
            qdot: Velocity in the same coordinates, (nv,).
            coordinates: "state" or "report".
        """
    def tags(self, q: npt.ArrayLike, coordinates: _Coordinates = "state") -> dict[str, _Array]:
        """Named points and axes of the machine in the world frame.

        Args:
            q: Coordinates, (nq,).
            coordinates: "state" or "report".

        Returns:
            Vectors (3,) by name: the origin of every solid and the tags of the model, m; the unit
            axle of every wheel, `axle_FL` and so on; the mass centre, `centre_of_mass`, m.
        """
    def poses(self, q: npt.ArrayLike, coordinates: _Coordinates = "state") -> dict[str, tuple[_Array, _Array]]:
        """The pose of every solid in the world frame.

        Args:
            q: Coordinates, (nq,).
            coordinates: "state" or "report".

        Returns:
            Origin (3,), m, and rotation matrix (3, 3) by name of the solid.
        """
    def wheel_gaps(self, q: npt.ArrayLike, terrain: Terrain | _Terrains, coordinates: _Coordinates = "state") -> _Array:
        """The distance of each wheel to the terrain.

        Args:
            q: Coordinates, (nq,).
            terrain: A terrain, or a list of several.
            coordinates: "state" or "report".

        Returns:
            (n_wheels,), m, positive when apart.
        """
    def resting_pose(self, terrain: Terrain | _Terrains, position: Sequence[float], heading: float) -> _Array:
        """The coordinates of the rover at rest on a terrain.

        On a plane the joints are at zero, the trunk is upright along the normal with its origin
        above the position, and the lowest wheel has gap zero. If that leaves wheels in the air,
        pitch, roll and the joints that nothing drives bring them down, where this puts more wheels
        on the ground. On any other terrain the same coordinates bring all wheels down to the ground
        as far as they can. No wheel is in the ground.

        Args:
            terrain: A terrain, or a list of several; a plane must not be vertical.
            position: x and z, (2,), m.
            heading: Heading, rad.

        Returns:
            Coordinates of the state, (nq,).

        Raises:
            TerrainError: `terrain` is no terrain, or does not say what the ground is under the
                trunk or a wheel.
            StateError: A number is not finite, or the plane is vertical.
        """
    def wheel_contact_points(
        self, q: npt.ArrayLike, terrain: Terrain | _Terrains, coordinates: _Coordinates = "state"
    ) -> _Array:
        """The point of each wheel's rim that is nearest to the terrain.

        Args:
            q: Coordinates, (nq,).
            terrain: A terrain, or a list of several.
            coordinates: "state" or "report".

        Returns:
            (n_wheels, 3), world frame, m.
        """
    def wheel_jacobians(
        self, q: npt.ArrayLike, terrain: Terrain | _Terrains, coordinates: _Coordinates = "state"
    ) -> _Array:
        """The contact Jacobian of each wheel: u = J v is the velocity of its contact point.

        Args:
            q: Coordinates, (nq,).
            terrain: A terrain, or a list of several.
            coordinates: "state" or "report".

        Returns:
            (n_wheels, 3, nv): rows along the normal, the rolling direction and the lateral
            direction.
        """
    def to_report(self, q: npt.ArrayLike, v: npt.ArrayLike) -> tuple[_Array, _Array]:
        """Converts a state to the report's coordinates.

        Args:
            q: Coordinates as `Simulation.q`, (nq,).
            v: Velocity as `Simulation.v`, (nv,).

        Returns:
            The report's q, (nq,), and its rate, (nv,).

        Raises:
            StateError: An array has a wrong length or an entry that is not finite, or the heading
                is ±90 degrees, where the report's angles are singular.
        """
    def from_report(self, q: npt.ArrayLike, qdot: npt.ArrayLike) -> tuple[_Array, _Array]:
        """Converts the report's coordinates to a state.

        Args:
            q: The report's coordinates, (nq,).
            qdot: Their rates, (nv,).

        Returns:
            Coordinates as `Simulation.q`, (nq,), and velocity as `Simulation.v`, (nv,).

        Raises:
            StateError: An array has a wrong length or an entry that is not finite.
        """
    def __reduce__(self) -> Any: ...

@disjoint_base
class Terrain:
    """Ground of any kind. Immutable.

    `Plane`, `SphereField`, `HeightField`, `TriangleMesh` and `Union` are its kinds.
    """

    def heights(self, points: npt.ArrayLike) -> _Array:
        """The height of the visible surface at places of the map.

        Args:
            points: Places (x, z), (m, 2), m.

        Returns:
            Heights y, (m,), m; nan where there is no ground or no data.

        Raises:
            TerrainError: `points` has a wrong shape.
        """
    def cast_rays(
        self, origins: npt.ArrayLike, directions: npt.ArrayLike, max_range: float | None = None
    ) -> tuple[_Array, _Array]:
        """Where rays meet the ground first.

        A surface is met from either side. What depth cameras and laser scanners measure.

        Args:
            origins: Where the rays begin, world frame, (n, 3) or one (3,) for all, m.
            directions: Where they go, world frame, (n, 3) or one (3,) for all, of any length.
            max_range: Distance to which they are followed, m; without end by default.

        Returns:
            Distances, (n,), m, infinite where nothing is met, and the surface's unit normals there,
            world frame, (n, 3), nan where nothing is met.

        Raises:
            OptionError: An array has a wrong shape or an entry that is not finite, a direction is
                zero, an origin is beyond 1e6 m, or `max_range` is not positive.
        """

@final
class Plane(Terrain):
    """A plane as ground: the half-space `normal · x + offset >= 0` is free, the ground lies below.

    A normal of unit length is taken as it is, so a plane's own `normal` and `offset` make the same
    plane to the bit.

    Args:
        normal: Direction out of the ground, (3,), of any length; straight up by default.
        offset: Gap between the world's origin and the plane, m; flat ground at height y has the
            offset -y.

    Raises:
        TerrainError: A number is not finite, the normal has no direction, or the offset is beyond
            1e6 m.
    """

    def __new__(cls, normal: npt.ArrayLike | None = None, offset: float = 0.0) -> Plane: ...
    @property
    def normal(self) -> _Array:
        """Unit normal out of the ground, (3,)."""
    @property
    def offset(self) -> float:
        """Gap between the world's origin and the plane, m; flat ground at height y has the offset -y."""
    @staticmethod
    def tilted(slope: float, uphill: float) -> Plane:
        """The plane through the origin that rises by a slope in a direction.

        Args:
            slope: Slope, rad.
            uphill: Direction of steepest ascent, rad: an angle about +y from +x.

        Raises:
            TerrainError: An angle is no finite number.
        """
    def height(self, x: float, z: float) -> float:
        """The height of the plane at a place.

        Args:
            x: Coordinate forward, m.
            z: Coordinate to the right, m.

        Returns:
            The height y, m.

        Raises:
            TerrainError: The plane is vertical, or an argument is not a number.
        """
    def __getnewargs__(self) -> tuple[Any, ...]: ...

@final
class SoftGround(Terrain):
    """Ground of sand, into which wheels sink. To every other part of a machine its surface is rigid.

    The ruts belong to a simulation and are part of its snapshots. Rocks on sand are a `Union` of
    both. Steps on soft ground are general: `Simulation.fallback_reason` says so.

    Args:
        surface: The undisturbed surface: a `Plane`, `HeightField` or `TriangleMesh`.
        soil: A `rover_gym.sand.Soil`, or a mapping of its numbers.
        rut_cell: Size of a cell of the map of ruts, from 0.001 to 1 m.

    Raises:
        TerrainError: The surface is no terrain, or a number of the soil is missing or out of its
            range.
    """

    def __new__(cls, surface: Terrain, soil: _Soil | Mapping[str, float], rut_cell: float = 0.02) -> SoftGround: ...
    @property
    def surface(self) -> Terrain:
        """The undisturbed surface."""
    @property
    def soil(self) -> dict[str, float]:
        """Numbers of the soil by their names."""
    @property
    def rut_cell(self) -> float:
        """Size of a cell of the map of ruts, m."""
    def __reduce__(self) -> Any: ...

@final
class WheelBed:
    """One wheel on a bed of soil, driven at prescribed speeds and free to sink under its load.

    Args:
        soil: A `rover_gym.sand.Soil`, or a mapping of its numbers.
        radius: Radius of the wheel without grousers, m.
        width: Its width, m.
        rounding: Radius of its edges, m.
        grouser_height: Height of its grousers, m.
        grousers: Number of its grousers.
        accuracy: Largest error of the forces by the number of points on the wheel.

    Raises:
        TerrainError: A number of the soil is missing or out of its range.
        OptionError: A number of the wheel is out of its range.
    """

    def __new__(
        cls,
        soil: _Soil | Mapping[str, float],
        radius: float,
        width: float,
        rounding: float = 0.0,
        grouser_height: float = 0.0,
        grousers: int = 0,
        accuracy: float = 0.002,
    ) -> WheelBed: ...
    @property
    def n_points(self) -> int:
        """Points at which the stress is evaluated."""
    @property
    def drum(self) -> float:
        """Radius of the drum with the sand that its grousers hold, m."""
    def steady(self, drives: npt.ArrayLike) -> _Array:
        """Steady motion.

        Args:
            drives: Speed of travel (m/s), rate of the wheel (rad/s, positive forward), slip angle
                (rad, to the right), load (N) and gravity (m/s²) of each run, (n, 5).

        Returns:
            Sinkage (m), drawbar pull, force to the right and lift (N), and driving torque (N m) of
            each run, (n, 5); nan where the soil does not bear the load.

        Raises:
            OptionError: `drives` has a wrong shape or an entry that is not finite.
        """
    def forces(self, sinkage: float, drives: npt.ArrayLike) -> _Array:
        """Forces in steady motion at a given sinkage.

        Args:
            sinkage: Depth of the lowest point under the surface, m.
            drives: As for `steady`; the load does not matter.

        Returns:
            As `steady`, (n, 5).

        Raises:
            OptionError: An argument has a wrong shape or is not finite.
        """
    def run(self, drives: npt.ArrayLike, mass: float, time_step: float) -> _Array:
        """A run from rest on the surface: the wheel is let down and driven.

        Args:
            drives: As for `steady`, one row for each step, (n, 5).
            mass: Mass that sinks with the wheel, kg.
            time_step: Length of a step, s.

        Returns:
            As `steady`, at the end of each step, (n, 5).

        Raises:
            OptionError: An argument has a wrong shape, is not finite, or is not positive.
        """

@final
class SphereField(Terrain):
    """Fixed spheres, with or without a plane under them. Immutable.

    `SphereField.from_file` reads them.

    Args:
        centres: Centres of the spheres, (n, 3), m.
        radii: Their radii, (n,), m.
        ground: The plane under them; none by default. Its material is "ground".
        material: Name of the spheres' material, for the laws of a `Simulation` by pair of
            materials.

    Raises:
        TerrainError: An array has a wrong shape, an entry is not finite or out of its range, or
            there are no spheres or too many of them.
    """

    def __new__(
        cls, centres: npt.ArrayLike, radii: npt.ArrayLike, ground: Plane | None = None, material: str = "rock"
    ) -> SphereField: ...
    from_file = staticmethod(terrain_files.sphere_field_from_file)
    @staticmethod
    def rug() -> SphereField:
        """The wavy ground of the 2010 report's Fig. 6.6.

        50 x 25 spheres of radius 0.5 m, without a plane.

        Source: Yang 2010, Fig. 6.6.
        """
    @staticmethod
    def rocks(
        abundance: float,
        area: Sequence[float],
        seed: int,
        *,
        max_diameter: float = 0.5,
        min_diameter: float = 0.05,
        burial: float | tuple[float, float] | None = None,
        ground: Terrain | _Terrains | None = None,
        clear: npt.ArrayLike | None = None,
        material: str = "rock",
    ) -> SphereField:
        """Rocks on a plane, with the size-frequency distribution of rocks on Mars.

        Args:
            abundance: Fraction of the ground that rocks of all sizes cover, 0 to 0.5.
            area: Corners x_min, z_min, x_max, z_max of the rectangle, m.
            seed: Seed of the random numbers; equal seeds give equal rocks.
            max_diameter: Largest diameter, m.
            min_diameter: Smallest diameter, m; the number of rocks grows without bound as it
                shrinks.
            burial: Fraction of its diameter that a rock is sunk into the ground, 0 to 0.5, or a
                range from which it is drawn for each rock; 0.5 by default.
            ground: What the rocks lie on; flat ground at height 0 by default. A plane is part of
                the field. Rocks on any other terrain are raised by its height, and the terrain is
                not part of the field: combine them as `Union([terrain, rocks])`.
            clear: Circles x, z, radius that no rock reaches into, (n, 3), m; none by default.
            material: Name of the rocks' material.

        Raises:
            TerrainError: An argument is out of its range.

        Source: Golombek and Rapp 1997.
        """
    @property
    def material(self) -> str:
        """Name of the spheres' material."""
    @property
    def centres(self) -> _Array:
        """Centres of the spheres, (n, 3), m."""
    @property
    def radii(self) -> _Array:
        """Radii of the spheres, (n,), m."""
    @property
    def ground(self) -> Plane | None:
        """The plane under the spheres, or None."""
    def __len__(self) -> int: ...
    def __getnewargs__(self) -> tuple[Any, ...]: ...

@final
class HeightField(Terrain):
    """A map of heights as ground: two triangles a cell, solid below. Immutable.

    Row j and column i stand at z = origin[1] + j spacing[1] and x = origin[0] + i spacing[0]. Each
    cell is cut along the diagonal from its corner (j, i) to (j + 1, i + 1). A height that is nan is
    no data: a rover that comes near it, or to the border of the map, ends the call with a
    `StepError` that names the place. Heights are kept in single precision. `HeightField.from_file`
    reads a map, `HeightField.fractal` makes one by a seed.

    Args:
        heights: Heights y, (n_z, n_x), m; nan for no data.
        spacing: Distance of columns and of rows, m: one number, or (dx, dz).
        origin: Place (x, z) of the first height, m; by default such that the map's middle is at
            the world's origin.
        material: Name of its material, for the laws of a `Simulation` by pair of materials.

    Raises:
        TerrainError: The array has a wrong shape, a height is infinite or beyond 1e6 m, no cell
            has data, or the spacing is not positive.
    """

    def __new__(
        cls,
        heights: npt.ArrayLike,
        spacing: float | tuple[float, float],
        origin: tuple[float, float] | None = None,
        material: str = "ground",
    ) -> HeightField: ...
    from_file = staticmethod(terrain_files.height_field_from_file)
    fractal = staticmethod(fractal_map)
    @property
    def material(self) -> str:
        """Name of its material."""
    @property
    def grid(self) -> npt.NDArray[np.float32]:
        """Heights, (n_z, n_x) float32, m; nan for no data."""
    @property
    def shape(self) -> tuple[int, int]:
        """Number of rows and columns."""
    @property
    def spacing(self) -> tuple[float, float]:
        """Distance of columns and of rows, (dx, dz), m."""
    @property
    def origin(self) -> tuple[float, float]:
        """Place (x, z) of the first height, m."""
    @property
    def bounds(self) -> tuple[float, float, float, float]:
        """Corners x_min, z_min, x_max, z_max of the map, m."""
    def __getnewargs__(self) -> tuple[Any, ...]: ...

@final
class TriangleMesh(Terrain):
    """A mesh of triangles as ground: rocks, or anything else that stands still. Immutable.

    Triangles turn counterclockwise, seen from outside. A closed mesh is solid; an open one is
    solid below.

    Corners at exactly equal positions are joined, so triangles may each bring their own three
    corners, as in an STL file. `triangles` then names the first of equal corners. Corners that
    differ by rounding are not joined: wheels catch on the seam between them.
    `TriangleMesh.from_file` reads a mesh.

    Args:
        vertices: Corners, (n, 3), m.
        triangles: Numbers of the three corners of each triangle, (m, 3).
        material: Name of its material, for the laws of a `Simulation` by pair of materials.

    Raises:
        TerrainError: An array has a wrong shape, an entry is not finite, a triangle has no area or
            names a corner that is not there, or two triangles turn opposite ways.
    """

    def __new__(cls, vertices: npt.ArrayLike, triangles: npt.ArrayLike, material: str = "ground") -> TriangleMesh: ...
    from_file = staticmethod(terrain_files.triangle_mesh_from_file)
    @property
    def material(self) -> str:
        """Name of its material."""
    @property
    def vertices(self) -> _Array:
        """Corners, (n, 3), m."""
    @property
    def triangles(self) -> npt.NDArray[np.uint32]:
        """Numbers of the corners of each triangle, (m, 3)."""
    @property
    def is_closed(self) -> bool:
        """Whether no triangle has a free border."""
    def __len__(self) -> int: ...
    def __getnewargs__(self) -> tuple[Any, ...]: ...

@final
class Union(Terrain):
    """Several terrains as one ground: a map with rocks on it, say. Immutable.

    A rover touches whatever of them it meets. Where a part has a plane, the ground is known
    everywhere; otherwise it is known where a height field knows it.

    Args:
        parts: Terrains of any kind, at least one; at most one of them may have a plane.

    Raises:
        TerrainError: A part is no terrain, there is none, or two have a plane.
    """

    def __new__(cls, parts: _Terrains) -> Union: ...
    @property
    def parts(self) -> list[Terrain]:
        """The terrains, in the order they were given."""
    def __len__(self) -> int: ...
    def __getnewargs__(self) -> tuple[Any, ...]: ...

@final
class StepReport:
    """How the steps of one call went: the worst of them, or their sum."""

    @property
    def status(self) -> Literal["converged", "not_converged"]:
        """Whether the steps "converged" or "not_converged".

        "converged" means that the contact solver met its tolerance in every step.
        """
    @property
    def is_converged(self) -> bool:
        """Whether the contact solver met its tolerance in every step."""
    @property
    def budget_exhausted(self) -> bool:
        """Whether a contact problem stayed unsolved because the solver's `budget` was spent.

        With a larger `budget` it may be solved.
        """
    @property
    def steps(self) -> int:
        """Number of steps taken."""
    @property
    def iterations(self) -> int:
        """Iterations of the contact solver, summed over the steps."""
    @property
    def newton_iterations(self) -> int:
        """Newton iterations of the scheme, summed over the steps; 0 with the linearised scheme."""
    @property
    def residual(self) -> float:
        """Largest relative residual of a step's contact problem, computed from its impulses.

        Where the energy audit slowed a rebound (`restitution` above 0), it contains how far the
        rebound then falls short of Newton's law. The status is the solver's.
        """
    @property
    def n_contacts(self) -> int:
        """Largest number of contacts in a step."""
    @property
    def retaken(self) -> int:
        """Number of steps taken again.

        A step is taken again when a motor reached its torque-speed line, when the energy audit asks
        for implicit gyroscopic terms, or when Newton's law of restitution had no solution.
        """
    @property
    def fallbacks(self) -> int:
        """Steps that the general step took, since the fast one does not take them.

        0 of machines in the plane and of grains, which have no fast one.
        `Simulation.fallback_reason` says whether a simulation has fast steps.
        """
    @property
    def energy_gain(self) -> float:
        """Largest unexplained gain of energy in a step, relative to the kinetic energy.

        Unexplained is what exceeds the work of gravity and actuators.
        """
    @property
    def energy_removed(self) -> float:
        """Energy that the scheme would have gained and the audit removed, summed over the steps, J."""
    @property
    def energy_dissipated(self) -> float:
        """Energy that friction and impacts took by their law, summed over the steps, J.

        Newton's law of restitution with friction can make it negative. A new contact that closes
        faster than gravity explains counts as an impact.
        """
    @property
    def energy_lost(self) -> float:
        """Energy that the scheme lost, summed over the steps, J; negative where it gained.

        The change of the energy is the work of the actuators minus `energy_dissipated`,
        `energy_lost` and `energy_removed`, plus `energy_lifted` and `energy_released`.
        `energy_lost` is therefore what no law explains: errors of the time step, and the work of
        reactions in contacts that persist. In smooth motion it shrinks with the square of the step.
        Always 0 with grains and planar soils, whose energy is not audited.
        """
    @property
    def energy_lifted(self) -> float:
        """Energy gained by pushing bodies out of penetration, less the actuators' work, all steps, J."""
    @property
    def energy_released(self) -> float:
        """Energy released by yielding wheels, summed over the steps, J; negative where they stored it.

        Wheels yield where their model gives them a `stiffness`. Their springs are part of neither
        the kinetic nor the potential energy. Besides what the springs give off, it holds the work
        that the wheel's force does because it is constant over a step, which cancels where a wheel
        comes to rest again.
        """
    @property
    def undetermined_loads(self) -> int:
        """Number of independent sets of wheel loads that balance one another in the last step.

        0 means that equilibrium determines the loads. Otherwise they are one of many answers, and
        micrometres decide which: a rigid chassis on four rigid wheels has one such set. Wheels with
        a `stiffness` have none. Friction is not considered; 0 for other machines than rovers.
        """
    def followed_by(self, later: StepReport) -> StepReport:
        """The report of these steps and of further ones.

        Args:
            later: How the further ones went.
        """

@final
class Contacts:
    """The contacts of a rover's last step, as new arrays with one row a contact."""

    @property
    def bodies(self) -> list[str]:
        """Names of the solids that touch, and of the joints that are at a stop."""
    @property
    def kinds(self) -> list[str]:
        """What touches in each contact, "wheel", "box" or "sphere"; "limit" for a joint's stop.

        The point of a stop is the origin of the solid that the joint carries, its normal is the
        joint's axis that opens the gap. Along it, at a revolute joint, the gap is in rad, the
        impulse in N m s and the velocity in rad/s; tangential entries are zero.
        """
    @property
    def wheels(self) -> npt.NDArray[np.int64]:
        """Indices of the wheels that touch, (n,); -1 where it is another solid or a joint's stop."""
    @property
    def points(self) -> _Array:
        """Contact points, world frame, (n, 3), m."""
    @property
    def frames(self) -> _Array:
        """Contact frames, world frame, (n, 3, 3).

        Rows are the unit vectors n (normal), t (rolling direction) and b (lateral).
        """
    @property
    def gaps(self) -> _Array:
        """Gaps, (n,), m, at the configuration where the step evaluated the contacts."""
    @property
    def impulses(self) -> _Array:
        """Impulses of the step along n, t, b, (n, 3), N s.

        Where the step was split, they are sums over its parts.
        """
    @property
    def velocities(self) -> _Array:
        """Relative velocities after the step along n, t, b, (n, 3), m/s."""
    def __len__(self) -> int: ...

@final
class PathSearch:
    """Finds the cheapest of many paths of a rover over a height scan, by beam search.

    `rover_gym.policy.ScanPolicy` drives by it, and `rover_gym.policy.PathCosts` says what a path
    costs. Poses are way ahead, way to the right, m, and turn to the left, rad.

    Args:
        scan: Rows, columns and spacing, m, of the height scan.
        outline: The rover in the trunk's frame: `wheels` (n_wheels, 2) and `underside` (n, 2), x
            and z, m; `clearance` (n,) of the underside, m; `plane_fit` (3, n_wheels), level and
            slopes of the ground plane by the heights under the wheels; `x_c`, m, of the point that
            follows the path; `radius` of the wheels, m.
        costs: The fields of `PathCosts`.
        first: The arcs that a path may begin with: `poses` (n, 4, 3), `direction` (n,), 1 or -1,
            and `commands` (n, 3), speed, curvature and sideways.
        further: Those that it may go on with: `poses` and `direction`.
        reach: The rover's reach, m.
        arrival: Distance within which the goal is reached, m.

    Raises:
        OptionError: An argument is missing, no number, or of a wrong shape.
    """

    def __new__(
        cls,
        *,
        scan: tuple[int, int, float],
        outline: Mapping[str, Any],
        costs: Mapping[str, float],
        first: Mapping[str, Any],
        further: Mapping[str, Any],
        reach: float,
        arrival: float,
    ) -> PathSearch: ...
    def best(
        self,
        heights: npt.ArrayLike,
        goal: npt.ArrayLike,
        command: npt.ArrayLike,
        boldness: float,
        traps: npt.ArrayLike,
        retreat: float,
        extra: npt.ArrayLike | None = None,
        ways: npt.ArrayLike | None = None,
    ) -> int:
        """The first arc of the cheapest path.

        Args:
            heights: `(rows * columns,)` heights of the scan, m.
            goal: The goal ahead and to the right of the point that follows the path, m.
            command: `(3,)` the present command; its first entry is 0 at a start.
            boldness: Factor on the costs of belly, climb and lean.
            traps: `(n, 3)` poses where the rover got stuck.
            retreat: Direction of the first arc, 1 or -1, while the rover backs off; 0 for a free
                choice.
            extra: `(n,)` a further cost of each first arc, m; none by default.
            ways: `(rows * columns,)` way to the goal from each point of the scan, m; straight by
                default.

        Returns:
            The index of the arc among the first arcs.

        Raises:
            OptionError: An argument has a wrong shape or an entry that is not finite.
        """
    def ways(
        self,
        heights: npt.ArrayLike,
        spacing: float,
        goal: npt.ArrayLike,
        boldness: float,
        extra: npt.ArrayLike | None = None,
    ) -> npt.NDArray[np.float64]:
        """The way to a goal from every cell of a map (Dijkstra 1959).

        The rover goes from a cell to one of its eight neighbours, headed for it. That costs the
        distance and what the ground costs on a path: belly, climb and lean. A wheel over ground
        that is not known stands as high as the others do; where all do, the distance is all.

        Args:
            heights: (rows, columns) heights, m, nan where they are not known; from 3 to 2000 of
                each. Rows lie across, the first farthest ahead; columns lead to the right.
            spacing: Distance of rows and columns, m.
            goal: Row and column of the goal. One beyond the map is reached by the straight way from
                its border.
            boldness: Factor on the costs of belly, climb and lean.
            extra: (rows, columns) further price of a metre in each cell, at least 0; none by
                default.

        Returns:
            (rows, columns) ways, in metres of level ground.

        Raises:
            OptionError: An argument has a wrong shape or an entry out of its range.
        """
    def under(self, heights: npt.ArrayLike, poses: npt.ArrayLike) -> npt.NDArray[np.float32]:
        """What lies under the rover in poses.

        Args:
            heights: `(rows * columns,)` heights of the scan, m.
            poses: `(..., 3)` poses.

        Returns:
            (n, n_wheels + 3) for each pose the heights under the wheels over the mean of the
            present ones and the least gap under the rover, both over the wheels' radius; then the
            slopes ahead and to the right of the plane through the ground under the wheels.

        Raises:
            OptionError: An argument has a wrong shape or an entry that is not finite.
        """

@final
class Linearisation:
    """Derivatives of a time step by state and command, as `Simulation.linearise` returns them.

    `x_next = next_state + a @ (x - state) + b @ (u - command)` to first order. The state is
    x = (q, v) as `Simulation.q` and `Simulation.v` return them, the command is u = (wheel torques,
    steering set-points). All arrays are new.
    """

    @property
    def a(self) -> _Array:
        """Derivative of the next state by the state, (nx, nx) with nx = 2 nv."""
    @property
    def b(self) -> _Array:
        """Derivative of the next state by the command, (nx, nu) with nu = 2 n_wheels.

        Columns of wheels without a drive or without steering are 0.
        """
    @property
    def state(self) -> _Array:
        """State before the step, (nx,)."""
    @property
    def command(self) -> _Array:
        """Command of the step, (nu,)."""
    @property
    def next_state(self) -> _Array:
        """State after the step, (nx,)."""
    @property
    def bodies(self) -> list[str]:
        """Names of the solids that touch in the step, and of the joints at a stop, one a contact."""
    @property
    def modes(self) -> list[str]:
        """Mode of each contact, "open", "stick" or "slip".

        An open contact transmits no impulse. A contact without friction is "slip" while closed.
        """
    @property
    def margins(self) -> _Array:
        """How far each contact is from another mode, (n,), m/s; rad/s at a joint's stop.

        It is the normal velocity of an open contact. Of a closed one it is the smaller of its
        normal impulse and, sticking, of mu p_N - |p_T|, both times the inverse effective mass along
        the normal, or, slipping, of the sliding speed.
        """
    @property
    def is_projected(self) -> bool:
        """Whether the step moves bodies out of penetration; the derivative contains it then."""
    @property
    def holds(self) -> npt.NDArray[np.bool_]:
        """Whether nothing jumps within the tested changes of each entry of (x, u), (nx + nu,).

        Two steps, ahead and back, have the same closed contacts in the same modes, are projected
        and corrected by the energy audit as this step is, and agree with the column within 1%.
        """
    @property
    def errors(self) -> _Array:
        """Difference of each column of (a, b) from that of its two tested steps, (nx + nu,).

        It is the largest difference of an entry, relative to the column's largest entry.
        """
    @property
    def is_smooth(self) -> bool:
        """Whether every column holds."""

@final
class Energy:
    """Kinetic and potential energy."""

    @property
    def kinetic(self) -> float:
        """Kinetic energy, J."""
    @property
    def potential(self) -> float:
        """Potential energy in gravity, J, zero at the world's origin."""
    @property
    def total(self) -> float:
        """Sum of both, J."""

@final
class Snapshot:
    """Everything that a simulation needs to continue bit for bit. Picklable."""

    @staticmethod
    def from_bytes(data: bytes) -> Snapshot:
        """Reads a snapshot.

        Args:
            data: What `to_bytes` returned.

        Raises:
            StateError: The bytes are not those of a snapshot.
        """
    def to_bytes(self) -> bytes:
        """The snapshot as bytes, as `from_bytes` reads them."""
    def __reduce__(self) -> Any: ...
    def __eq__(self, other: object, /) -> bool: ...
    def __hash__(self) -> int: ...

@disjoint_base
class AnySimulation:
    """What all simulations share. Made by the classes derived from it.

    They are `Simulation`, `PlanarSimulation`, `SoilSimulation`, `GrainSimulation` and
    `RoverGrainSimulation`.

    One call at a time: a call during another one, from another thread or a signal handler, raises
    BusyError.
    """

    @property
    def time(self) -> float:
        """Time since the last call of `set_state`, s; of a rover among grains that of the grains."""
    @property
    def time_step(self) -> float:
        """Time step, s."""
    def step(self, n: int = 1) -> StepReport:
        """Takes n steps.

        Other threads run meanwhile. Ctrl-C, or whatever else a signal handler raises, ends the call
        after a whole step, whose state stays. A contact solver that does not converge is no error:
        the report says so.

        Args:
            n: Number of steps.

        Raises:
            StepError: A step could not be taken; the state before it stays.
            OptionError: `n` is not a count.
        """
    def energy(self) -> Energy:
        """Kinetic and potential energy now."""
    def snapshot(self) -> Snapshot:
        """Everything that is needed to continue bit for bit."""
    def restore(self, snapshot: Snapshot) -> None:
        """Goes back to a snapshot.

        Args:
            snapshot: A snapshot of the same kind of simulation, with the same model or grains.

        Raises:
            StateError: The snapshot belongs to another simulation or is damaged. Nothing has
                changed.
        """

@final
class Simulation(AnySimulation):
    """A rover on a terrain, stepped through time.

    It starts at rest with all coordinates 0, with its steering held at 0 and every other joint
    free.

    Args:
        model: The machine; the built-in rover by default.
        terrain: A terrain, or a list of several; flat ground at height 0 by default.
        gravity: Gravity, world frame, (3,), m/s²; (0, -9.81, 0) by default.
        friction: Coulomb's coefficient of every contact whose pair is not in `materials`.
        restitution: Newton's coefficient of every contact whose pair is not in `materials`, in
            [0, 1].
        materials: Friction and restitution by pair of materials, in any order, such as
            `{("wheel", "rock"): (0.5, 0.1)}`; a list of rows (name, name, friction, restitution)
            says the same. None by default.
        time_step: Time step, s, from 1e-9 to 1000; 0.005 by default.
        variant: "linearised" evaluates the forces once a step; "newton" solves for those at its
            end. "linearised" by default.
        theta: Weight of the end of the step in the time stepping, in [0.5, 1].
        forecast: A contact takes part in a step where gap + forecast * time_step * u_N <= 0, with
            u_N its normal velocity; in [0, 1].
        solver: Method for the contact problem, as in `solve_friction_contact`.
        tolerance: Largest relative residual of the contact problem; 1e-12 by default.
        max_iterations: Largest number of iterations of the contact solver in a step.
        budget: Largest amount of work of the contact solver in a step, counted and not timed, in
            the unit of `solve_friction_contact`; None grows with the number of contacts.
        stabilisation: What is done about penetration: "projection" moves the bodies out of it,
            "none" leaves it.
        warm_start: Whether the contact solver starts from the last step's impulses.
        accuracy: Chooses `time_step`, `variant` and `tolerance`, which then cannot be given, as
            `accuracy_options` does: "fast", "balanced", "reference", or the error allowed on a path
            of 20 m on flat ground, m.

    Raises:
        ModelError: `model` is not a RoverModel.
        TerrainError: `terrain` is not a terrain.
        OptionError: An option is out of its range, or is given beside `accuracy`.
    """

    def __new__(
        cls,
        model: RoverModel | None = None,
        terrain: Terrain | _Terrains | None = None,
        *,
        gravity: npt.ArrayLike | None = None,
        friction: float = 0.7,
        restitution: float = 0.0,
        materials: _Materials | None = None,
        time_step: float | None = None,
        variant: Literal["linearised", "newton"] | None = None,
        theta: float = 0.5,
        forecast: float = 0.5,
        solver: Literal["auto", "nsgs", "newton", "proximal", "admm"] = "auto",
        tolerance: float | None = None,
        max_iterations: int = 1000,
        budget: int | None = None,
        stabilisation: Literal["projection", "none"] = "projection",
        warm_start: bool = True,
        accuracy: Literal["fast", "balanced", "reference"] | float | None = None,
    ) -> Simulation: ...
    @property
    def model(self) -> RoverModel:
        """The machine."""
    @property
    def terrain(self) -> Terrain:
        """The ground."""
    def sand(self) -> dict[str, _Array] | None:
        """The sand under the wheels; None on firm ground.

        Returns:
            Arrays by name. `force` (N) and `moment` about the wheel's centre (N m) of the sand on
            each wheel in the last step, (n_wheels, 3), world frame; `sinkage` of each wheel's
            lowest point under the undisturbed surface, (n_wheels,), m, negative where it is clear;
            `absorbed`, energy that the sand has taken from each wheel, (n_wheels,), J; `slip`, rim
            slip of each wheel over the faster of rim and ground, (n_wheels,), 0 where it is clear;
            `ruts`, place x and z and depth of each cell that a wheel has pressed down, (n, 3), m.

        Raises:
            BusyError: Another thread is stepping this simulation.
        """
    @property
    def gravity(self) -> _Array:
        """Gravity, world frame, (3,), m/s²."""
    @property
    def friction(self) -> float:
        """Coulomb's coefficient of every contact whose pair is not in `materials`."""
    @property
    def restitution(self) -> float:
        """Newton's coefficient of every contact whose pair is not in `materials`."""
    @property
    def materials(self) -> dict[tuple[str, str], tuple[float, float]]:
        """Friction and restitution by pair of materials, as given."""
    @property
    def settings(self) -> dict[str, Any]:
        """The keyword arguments that make a simulation with the same options."""
    @property
    def lanes(self) -> Literal[1, 4, 8]:
        """Rovers that a batch steps together in one register of this machine.

        Either 8, 4 or 1, and always 1 if all steps are general: see `fallback_reason`.
        """
    @property
    def fallback_reason(self) -> str | None:
        """Why all steps are general, one rover at a time; None if they are fast, in lanes.

        Of fast steps, `StepReport.fallbacks` counts those that had to be general after all.
        """
    @property
    def q(self) -> _Array:
        """Coordinates, (nq,), m and rad.

        x, y, z of the trunk's origin; roll, heading, pitch; joints.
        """
    @property
    def v(self) -> _Array:
        """Velocities, (nv,), m/s and rad/s.

        Velocity of the trunk, world frame; its angular velocity, world frame; joint rates.
        """
    @property
    def rotation(self) -> _Array:
        """Rotation matrix R_WB, (3, 3), from coordinates in the trunk to coordinates in the world."""
    def set_state(
        self, q: npt.ArrayLike, qdot: npt.ArrayLike | None = None, *, coordinates: _Coordinates = "state"
    ) -> None:
        """Sets coordinates and velocities.

        Time starts at 0, and the next step has no warm start.

        Args:
            q: Coordinates, (nq,).
            qdot: Velocity in the same coordinates, (nv,); at rest by default.
            coordinates: "state", as `q` and `v` return them, or "report".

        Raises:
            StateError: An array has a wrong length or an entry that is not finite. Nothing has
                changed.
            OptionError: `coordinates` is neither of the two.
        """
    def report_state(self) -> tuple[_Array, _Array]:
        """The state in the report's coordinates.

        Returns:
            The report's q, (nq,), and its rate, (nv,).

        Raises:
            StateError: The heading is ±90 degrees, where these coordinates are singular.
        """
    @property
    def wheel_torques(self) -> _Array:
        """Commanded torques, within the model's limits, (n_wheels,), N m, positive forward."""
    @property
    def motor_torques(self) -> _Array:
        """Mean torques of the drives over the last step, (n_wheels,), N m, positive forward.

        Each is the command within the line of the wheel's `Motor`; 0 before any step.
        """
    def set_wheel_torques(self, torques: npt.ArrayLike) -> None:
        """Sets the driving torques; each saturates at its wheel's limit.

        Args:
            torques: Torques, (n_wheels,), N m, positive forward.

        Raises:
            CommandError: A wrong length, or an entry that is not finite. Nothing has changed.
        """
    @property
    def steering(self) -> _Array:
        """Steering set-points, (n_wheels,), rad; 0 for wheels whose steering is not held."""
    def set_steering(self, set_points: npt.ArrayLike) -> None:
        """Sets the steering set-points, which an implicit PD controller holds with the model's gains.

        Args:
            set_points: Angles, (n_wheels,), rad.

        Raises:
            CommandError: A wrong length, an entry that is not finite or beyond the wheel's limit,
                or one that is not 0 for a wheel that cannot be steered. Nothing has changed.
        """
    def set_commands(self, torques: npt.ArrayLike, set_points: npt.ArrayLike) -> None:
        """Sets torques and steering together: both, or neither where either is refused.

        Args:
            torques: As of `set_wheel_torques`, (n_wheels,), N m.
            set_points: As of `set_steering`, (n_wheels,), rad.

        Raises:
            CommandError: As of these two methods. Nothing has changed.
        """
    def set_joint_torques(self, torques: npt.ArrayLike) -> None:
        """Sets torques about the joint axes.

        A joint with a drive of its own saturates at its limit and has its motor's line. At all
        others the torques are added to the wheels' and have no limit.

        Args:
            torques: Torques, (n_joints,), N m, in the order of `RoverModel.joint_names`.

        Raises:
            CommandError: A wrong length, or an entry that is not finite. Nothing has changed.
        """
    def hold(
        self,
        joints: str | Sequence[str],
        set_points: npt.ArrayLike | None = None,
        *,
        stiffness: float | None = None,
        damping: float | None = None,
    ) -> None:
        """Holds joints at set-points by an implicit PD controller.

        Args:
            joints: Name of a joint, or names.
            set_points: Angles, one for each joint, rad; where they are now by default.
            stiffness: Stiffness of the controllers, N m/rad; the model's by default.
            damping: Damping of the controllers, N m s/rad; the model's by default.

        Raises:
            CommandError: There is no such joint, the number of set-points differs, or a number is
                negative or not finite where it must not be. Nothing has changed.
        """
    def release(self, joints: str | Sequence[str]) -> None:
        """Releases joints that are held.

        Args:
            joints: Name of a joint, or names.

        Raises:
            CommandError: There is no such joint. Nothing has changed.
        """
    def brake(self) -> None:
        """Holds all wheels where they are, as `hold` does, and sets their torques to 0."""
    @property
    def contacts(self) -> Contacts:
        """The contacts of the last step."""
    @property
    def wheel_gaps(self) -> _Array:
        """Gap of each wheel now, (n_wheels,), m, positive when apart."""
    @property
    def wheel_forces(self) -> _Array:
        """Mean contact force on each wheel over the last step, (n_wheels, 3), N.

        Sums over its contacts, each along its own normal, rolling and lateral direction.
        """
    @property
    def trunk_force(self) -> float:
        """Mean normal force over the last step on all solids but the wheels, N.

        It is large when the rover is high-centred.
        """
    @property
    def deepest_overlap(self) -> float:
        """Deepest overlap of a wheel or a box with the ground now, as a gap, m; 0 without overlap."""
    def reading(self, target: Sequence[float] | None = None, scan: npt.ArrayLike | None = None) -> _Array:
        """Everything that a controller looks at, as one new row.

        Args:
            target: The place (x, z) on the map that the entry `target` refers to, m; the origin by
                default.
            scan: Points of the height scan ahead and to the right of the trunk's origin in the
                heading frame, (n, 2), m; none by default.

        Returns:
            The row, whose parts `reading_layout` names.

        Raises:
            OptionError: An argument has a wrong shape or an entry that is not finite.
        """
    def reading_layout(self, n_scan: int = 0) -> dict[str, slice]:
        """The place of each quantity in a reading.

        - `pose`: q, with the angles of the wheels wrapped to one turn
        - `body_velocity`: linear and angular velocity of the trunk in its own frame, m/s and rad/s
        - `joint_rates`: rad/s
        - `wheel_gaps`: m, positive when apart
        - `wheel_contacts`: 1 where the wheel touches the ground, within 1 mm, else 0
        - `normal_forces`: mean over the last step, N
        - `tangential_forces`: mean over the last step, rolling and lateral for each wheel, N
        - `ground_normal`: normal of the ground plane in the trunk's frame; 0 without one
        - `target`: how far ahead of the trunk's origin and to its right the target is, and how far
          away, all horizontal, m
        - `cos_tilt`: cosine of the angle between the trunk's y axis and up
        - `speed`: horizontal speed of the trunk's origin, m/s
        - `trunk_force`: as the property, N
        - `slip_ratio`: mean over the wheels in contact of slip over the faster of rim and ground
        - `work`: work through the wheel motors in the last call of `step`, driving or braking, J
        - `positive_work`: the driving part of it, J
        - `time`: s
        - `solver`: of the last call of `step`: 1 if it did not converge, iterations, residual,
          contacts
        - `heights`: height of the ground at the points of the scan above the trunk's origin, m; nan
          where there is no ground

        Args:
            n_scan: Number of points of the height scan.

        Returns:
            Slices by name.

        Raises:
            OptionError: `n_scan` is not a count.
        """
    def cast_rays(
        self,
        origins: npt.ArrayLike,
        directions: npt.ArrayLike,
        max_range: float | None = None,
        *,
        parts: bool = False,
        without: str | Sequence[str] = (),
    ) -> tuple[_Array, _Array]:
        """Where rays meet the ground first, or the rover itself.

        Of the rover its wheels, boxes and balls are seen, as they collide.

        Args:
            origins: Where the rays begin, world frame, (n, 3) or one (3,) for all, m.
            directions: Where they go, world frame, (n, 3) or one (3,) for all, of any length.
            max_range: Distance to which they are followed, m; without end by default.
            parts: Whether the rover's own parts are met.
            without: Names of solids whose parts are not met, such as the one that carries a sensor.

        Returns:
            Distances, (n,), m, infinite where nothing is met, and the surface's unit normals there,
            world frame, (n, 3), nan where nothing is met.

        Raises:
            OptionError: As of `Plane.cast_rays`, or `without` names no solid of the model.
        """
    def momentum(self) -> tuple[_Array, _Array]:
        """Momentum of the rover.

        Returns:
            Linear momentum, (3,), kg m/s, and angular momentum about the origin, (3,), kg m²/s,
            world frame.
        """
    def centre_of_mass(self) -> _Array:
        """Mass centre, world frame, (3,), m."""
    def tags(self) -> dict[str, _Array]:
        """Named points and axes of the machine now, world frame, (3,) by name, as `RoverModel.tags`."""
    def poses(self) -> dict[str, tuple[_Array, _Array]]:
        """Origin (3,), m, and rotation matrix (3, 3) of every solid now, world frame, by name."""
    def last_problem(self) -> tuple[_Array, _Array, _Array]:
        """The friction-contact problem of the last step, of the last part of a split one.

        Returns:
            Delassus operator W, (3 n_c, 3 n_c), 1/kg; free velocity, (3 n_c,), m/s; friction
            coefficients, (n_c,).
        """
    def linearise(self, perturbation: float = 1e-6) -> Linearisation:
        """Derivatives of the next step by state and command. The simulation does not change.

        The step is the one after `set_state(q, v)`, without memory of earlier impulses. Its
        contacts and their modes are held, and so are the branches of the motors; the limits of the
        commands are left out. Where the modes change within `perturbation`, the step has no such
        derivative, and `Linearisation.holds` says so.

        Args:
            perturbation: Change of each entry of (x, u) in the two steps that test its column, m,
                rad, m/s or rad/s, and 1000 times as many N m; from 1e-9 to 1e-3, 1e-6 by default.

        Returns:
            A, B, the modes and how far they hold.

        Raises:
            OptionError: `perturbation` is out of its range, or the variant is "newton".
            StateError: A pitch is 90 degrees, where the coordinates are singular.
            StepError: A step could not be taken, or was taken in parts or not solved, so that it
                has no derivative.
        """
    def profile(self, n: int = 1000) -> dict[str, float]:
        """Measures where the time of a step goes, on a copy of this simulation.

        Args:
            n: Number of steps.

        Returns:
            Mean time a step of each part (`kinematics`, `mass_matrix`, `solve` and so on), µs.

        Raises:
            StepError: A step could not be taken.
            OptionError: `n` is not a count.
        """
    def __reduce__(self) -> Any: ...

@disjoint_base
class PlanarGround:
    """Ground of a planar scene, of any kind: x forward, y up. Immutable.

    `Line`, `Sine`, `Spline` and `Polyline` are its kinds.
    """

    @overload
    def height(self, x: float) -> float:
        """The height of the ground at one place or at many.

        Args:
            x: Places, a number or (m,), m.

        Returns:
            Heights, a number or (m,), m.

        Raises:
            OptionError: `x` is not a number or an array of one dimension.
        """
    @overload
    def height(self, x: Sequence[float] | _Array) -> _Array: ...

@final
class Line(PlanarGround):
    """The ground y = slope x + offset of a planar scene.

    Args:
        slope: Tangent of the inclination.
        offset: Height at x = 0, m.

    Raises:
        TerrainError: A number is not finite, the slope is beyond 1000 or the offset beyond 1e6 m.
    """

    def __new__(cls, slope: float = 0.0, offset: float = 0.0) -> Line: ...
    @property
    def slope(self) -> float:
        """Tangent of the inclination."""
    @property
    def offset(self) -> float:
        """Height at x = 0, m."""
    def __getnewargs__(self) -> tuple[Any, ...]: ...

@final
class Sine(PlanarGround):
    """The ground y = amplitude sin(2 pi x / wavelength + phase) + offset of a planar scene.

    Args:
        amplitude: Amplitude, m.
        wavelength: Wavelength, m.
        phase: Phase at x = 0, rad.
        offset: Mean height, m.

    Raises:
        TerrainError: A number is not finite, the wavelength is below 1e-3 m, or the slope 2 pi
            amplitude / wavelength is beyond 1000.
    """

    def __new__(cls, amplitude: float, wavelength: float, phase: float = 0.0, offset: float = 0.0) -> Sine: ...
    @property
    def amplitude(self) -> float:
        """Amplitude, m."""
    @property
    def wavelength(self) -> float:
        """Wavelength, m."""
    @property
    def phase(self) -> float:
        """Phase at x = 0, rad."""
    @property
    def offset(self) -> float:
        """Mean height, m."""
    def __getnewargs__(self) -> tuple[Any, ...]: ...

@final
class Spline(PlanarGround):
    """The natural cubic spline through points: a ground with continuous curvature.

    It goes on along its tangents beyond the first and the last point.

    Args:
        x: Places of the points, (n,), m, increasing.
        y: Their heights, (n,), m.

    Raises:
        TerrainError: There are fewer than two points or more than 2 000 000, the lengths differ, an
            entry is not finite or beyond 1e6 m, or x does not increase.
    """

    def __new__(cls, x: npt.ArrayLike, y: npt.ArrayLike) -> Spline: ...
    @property
    def x(self) -> _Array:
        """Places of the points, (n,), m."""
    @property
    def y(self) -> _Array:
        """Heights of the points, (n,), m."""
    def __getnewargs__(self) -> tuple[Any, ...]: ...

@final
class Polyline(PlanarGround):
    """Straight pieces between points, with corners: a ground of steps, ramps and kerbs.

    Two points may stand above each other.

    Args:
        x: Places of the points, (n,), m, not decreasing.
        y: Their heights, (n,), m.

    Raises:
        TerrainError: There are fewer than two points or more than 2 000 000, the lengths differ, an
            entry is not finite or beyond 1e6 m, x decreases, or a point is given twice.
    """

    def __new__(cls, x: npt.ArrayLike, y: npt.ArrayLike) -> Polyline: ...
    @staticmethod
    def step(x: float, height: float) -> Polyline:
        """Level ground at height 0 with one step.

        Args:
            x: Place of the step, m.
            height: Height of the ground beyond it, m; negative for a step down.

        Raises:
            TerrainError: A number is not finite or beyond 1e6 m, or the step has no height.
        """
    @property
    def x(self) -> _Array:
        """Places of the points, (n,), m."""
    @property
    def y(self) -> _Array:
        """Heights of the points, (n,), m."""
    def __getnewargs__(self) -> tuple[Any, ...]: ...

@final
class PlanarContacts:
    """The contacts of a planar simulation's last step, as new arrays with one row a contact."""

    @property
    def discs(self) -> npt.NDArray[np.int64]:
        """Indices of the discs that touch, (n,); 0 is the ball or wheel A, 1 wheel B."""
    @property
    def points(self) -> _Array:
        """Points of the ground, world frame, (n, 2), m."""
    @property
    def normals(self) -> _Array:
        """Unit normals out of the ground, (n, 2); the tangent is (n_y, -n_x)."""
    @property
    def gaps(self) -> _Array:
        """Gaps, (n,), m."""
    @property
    def impulses(self) -> _Array:
        """Impulses of the step along normal and tangent, (n, 2), N s.

        Where the step was split, they are sums over its parts.
        """
    @property
    def velocities(self) -> _Array:
        """Velocities of the rim after the step along normal and tangent, (n, 2), m/s."""
    def __len__(self) -> int: ...

@disjoint_base
class PlanarSimulation(AnySimulation):
    """A planar machine on a ground: what the machines share. Made by the classes derived from it."""

    @property
    def ground(self) -> PlanarGround:
        """The ground."""
    @property
    def q(self) -> _Array:
        """Coordinates, (nv,), x and y, m, then angles, rad, which turn to the left."""
    @property
    def v(self) -> _Array:
        """Rates of the coordinates, (nv,), m/s and rad/s."""
    @property
    def centres(self) -> _Array:
        """Centres of the discs, world frame, (n_discs, 2), m."""
    @property
    def gaps(self) -> _Array:
        """Gap of each disc now, (n_discs,), m; negative where it overlaps the ground."""
    @property
    def torques(self) -> _Array:
        """Commanded torques, (n_discs,), N m, positive forward."""
    @property
    def parameters(self) -> dict[str, Any]:
        """The keyword arguments that describe the machine."""
    @property
    def settings(self) -> dict[str, Any]:
        """The keyword arguments that make a simulation with the same options."""
    def set_state(self, q: npt.ArrayLike, v: npt.ArrayLike | None = None) -> None:
        """Sets coordinates and rates; torques stay.

        Time starts at 0, and the next step has no warm start.

        Args:
            q: Coordinates, (nv,), m and rad.
            v: Their rates, (nv,), m/s and rad/s; at rest by default.

        Raises:
            StateError: An array has a wrong length or an entry that is not finite. Nothing has
                changed.
        """
    def set_torques(self, torques: npt.ArrayLike) -> None:
        """Sets the driving torques; each saturates at its limit, where the machine has one.

        Args:
            torques: Torques between the body and each disc, (n_discs,), N m, positive forward.

        Raises:
            CommandError: A wrong length, or an entry that is not finite. Nothing has changed.
        """
    @property
    def contacts(self) -> PlanarContacts:
        """The contacts of the last step."""
    def mass_matrix(self) -> _Array:
        """Mass matrix now, (nv, nv), in kg, kg m and kg m²."""
    def last_problem(self) -> tuple[_Array, _Array, _Array]:
        """The friction-contact problem of the last step, of the last part of a split one.

        Returns:
            Delassus operator W, (2 n_c, 2 n_c), 1/kg; free velocity, (2 n_c,), m/s; friction
            coefficients, (n_c,).
        """
    def __reduce__(self) -> Any: ...

@final
class BallSimulation(PlanarSimulation):
    """A disc on a ground: coordinates x, y of its centre, m, and its angle theta, rad.

    Args:
        ground: A `Line`, `Sine`, `Spline` or `Polyline`.
        mass: Mass, kg.
        radius: Radius, m.
        inertia: Inertia about the centre, kg m²; that of a homogeneous disc by default.
        **options: Options as of `Simulation`, from `gravity`, here (2,), to `warm_start`, and
            `contact`: "nearest", the disc touches where the ground is nearest to its centre, or
            "centre_height", the 2010 report's rule, by which the centre itself stops at the ground.

    Raises:
        ModelError: `mass`, `radius` or `inertia` is not finite and positive.
        TerrainError: `ground` is not a ground.
        OptionError: An option is out of its range.
        TypeError: An option is unknown.
    """

    def __new__(
        cls,
        ground: PlanarGround,
        *,
        mass: float = 3.0,
        radius: float = 1.5,
        inertia: float | None = None,
        **options: Any,
    ) -> BallSimulation: ...

@final
class TwoWheelRoverSimulation(PlanarSimulation):
    """A body on two driven wheels.

    Coordinates are x, y of the body's mass centre, m, theta, theta_A and theta_B, rad. A is the
    back wheel, B the front wheel. All angles are absolute. The defaults are the rover of the 2010
    report's granular run.

    Args:
        ground: A `Line`, `Sine`, `Spline` or `Polyline`.
        mass: Mass of the body, kg.
        inertia: Inertia of the body about its mass centre, kg m²; that of a rod from axle to axle
            by default.
        wheel_mass: Mass of both wheels or of each, kg; 60 by default.
        wheel_radius: Radius of both wheels or of each, m; 0.2 by default.
        wheel_inertia: Inertia of both wheels or of each about the axle, kg m²; that of a
            homogeneous disc by default.
        axle_a: Back axle relative to the body's mass centre, body axes, (2,), m; (-0.4, 0) by
            default.
        axle_b: Front axle relative to the body's mass centre, body axes, (2,), m; (0.4, 0) by
            default.
        **options: Options as of `BallSimulation`.

    Raises:
        ModelError: A mass, radius or inertia is not finite and positive, or the wheels overlap.
        TerrainError: `ground` is not a ground.
        OptionError: An option is out of its range.
        TypeError: An option is unknown.
    """

    def __new__(
        cls,
        ground: PlanarGround,
        *,
        mass: float = 130.0,
        inertia: float | None = None,
        wheel_mass: float | npt.ArrayLike | None = None,
        wheel_radius: float | npt.ArrayLike | None = None,
        wheel_inertia: float | npt.ArrayLike | None = None,
        axle_a: npt.ArrayLike | None = None,
        axle_b: npt.ArrayLike | None = None,
        **options: Any,
    ) -> TwoWheelRoverSimulation: ...

@final
class MirroredRoverSimulation(PlanarSimulation):
    """The six-wheel rover driven straight, in its plane of symmetry.

    Coordinates are x, y, m, theta, and the angle of each mirrored pair of joints, rad. Joints that
    do not turn about z are locked at 0. Only wheels touch the ground. A torque is that of each
    wheel of a pair.

    Args:
        ground: A `Line`, `Sine`, `Spline` or `Polyline`.
        model: The machine, its own mirror image about the trunk's x-y plane; the built-in rover by
            default.
        **options: Options as of `BallSimulation`.

    Raises:
        ModelError: The model is not its own mirror image.
        TerrainError: `ground` is not a ground.
        OptionError: An option is out of its range.
        TypeError: An option is unknown.
    """

    def __new__(
        cls, ground: PlanarGround, *, model: RoverModel | None = None, **options: Any
    ) -> MirroredRoverSimulation: ...
    @property
    def joints(self) -> list[list[str]]:
        """Names of the joints that share each coordinate from the fourth on."""
    @property
    def wheels(self) -> list[list[str]]:
        """Names of the wheels of each disc."""

@final
class SimulationBatch:
    """Many rovers stepped side by side on several threads, each bit for bit as it would be alone.

    The batch copies the simulations. One call at a time: a call during another one raises
    BusyError.

    Args:
        simulations: Simulations of models with equally many coordinates.
        scan: Points of the height scan ahead and to the right of the trunk's origin in the heading
            frame, (n, 2), m; none by default.
        threads: Number of threads; one a core by default.

    Raises:
        OptionError: There are no simulations or their models differ in size, `scan` has a wrong
            shape, or `threads` is out of its range.
    """

    def __new__(
        cls, simulations: Sequence[Simulation], *, scan: npt.ArrayLike | None = None, threads: int | None = None
    ) -> SimulationBatch: ...
    @property
    def threads(self) -> int:
        """Number of threads."""
    @property
    def instruction_set(self) -> Literal["AVX-512", "AVX2", "baseline"]:
        """Either "AVX-512", "AVX2" or "baseline", as the processor has it."""
    @property
    def reading_layout(self) -> dict[str, slice]:
        """Place of each quantity in a row of readings; `Simulation.reading_layout` lists them."""
    def step(
        self,
        torques: npt.ArrayLike,
        set_points: npt.ArrayLike,
        n: int = 1,
        *,
        active: npt.NDArray[np.bool_] | None = None,
    ) -> tuple[_Array, dict[int, str]]:
        """Sets the commands of all rovers and takes n steps.

        Ctrl-C ends the call after a whole step of each rover, which need not be the same one.

        Args:
            torques: Commands as of `Simulation.set_wheel_torques`, (n_rovers, n_wheels), N m.
            set_points: Commands as of `Simulation.set_steering`, (n_rovers, n_wheels), rad.
            n: Number of steps.
            active: Which rovers move, (n_rovers,); all by default. The others stay as they are.

        Returns:
            A row of readings for each rover, (n_rovers, size), and the message of the StepError of
            each rover that could not take a step, by its index. The other rovers go on.

        Raises:
            CommandError: An array has a wrong shape or an entry that a rover refuses. No rover has
                moved.
            OptionError: `n` or `active` is invalid.
        """
    def readings(self) -> _Array:
        """The readings of all rovers now, (n_rovers, size)."""
    def replace(self, index: int, simulation: Simulation, target: Sequence[float] | None = None) -> None:
        """Puts a copy of a simulation, with its own terrain, in the place of a rover.

        Args:
            index: Index of the rover.
            simulation: Its replacement, a model with equally many coordinates.
            target: The place (x, z) on the map that its readings refer to, m; the origin by
                default.

        Raises:
            OptionError: There is no such rover, or an argument is invalid. Nothing has changed.
        """
    def simulation(self, index: int) -> Simulation:
        """Returns a copy of one rover.

        Args:
            index: Index of the rover.

        Raises:
            OptionError: There is no such rover.
        """
    def __len__(self) -> int: ...

@final
class EpisodeRules:
    """What all episodes of a driving task share.

    Args:
        model: The machine.
        substeps: Physics steps of a control period.
        dt: Control period, s.
        torque_limits: Torque of a torque action of 1, (n_wheels,), N m.
        max_steering: Set-point of a steering action of 1, rad. Actions have an entry for each
            steering joint, in the order of the wheels, after the torques; none if this is 0.
        goal_tolerance: Distance within which the goal is reached, m.
        cos_max_tilt: Cosine of the tilt beyond which the rover has rolled over.
        stuck_time: Time until a high-centred rover ends the episode, s.
        weights: Weights of the reward, one for each of its terms.
        scale: Value of an entry of 1 of the observation, (size,).
        noise: Standard deviation of each entry's noise, (size,); no noise by default.
        scan: Points of the height scan ahead and to the right of the trunk's origin in the heading
            frame, (n, 2), m; none by default.
        goals: Number of goals that are reached one after the other. The observation of several has
            three entries more before the heights: the goal after the present one, ahead and to the
            right, m, and the number of goals still to reach.
        battery: Work of the motors, driving or braking, after which the battery is empty and the
            episode ends, J; none by default. The observation of a rover with a battery has one
            entry more, after the time to high-centring: the fraction of its charge.
        free_distance: Distance from where an episode began at which the rover is free, which ends
            the episode; progress is then measured from there, m; none by default.

    Raises:
        ModelError: `model` is not a RoverModel.
        OptionError: A number is out of its range, a list has a wrong length, or the weights are not
            those of the terms.
    """

    @staticmethod
    def info_rows() -> list[tuple[str, str, str]]:
        """Name, unit and meaning of each entry of an info."""
    @property
    def terms(self) -> tuple[str, ...]:
        """Names of the reward's terms, in the order of their sum."""
    def __new__(
        cls,
        model: RoverModel,
        *,
        substeps: int,
        dt: float,
        torque_limits: npt.ArrayLike,
        max_steering: float,
        goal_tolerance: float,
        cos_max_tilt: float,
        stuck_time: float,
        weights: Mapping[str, float],
        scale: npt.ArrayLike,
        noise: npt.ArrayLike | None = None,
        scan: npt.ArrayLike | None = None,
        goals: int = 1,
        battery: float | None = None,
        free_distance: float | None = None,
    ) -> EpisodeRules: ...
    def __getnewargs_ex__(self) -> tuple[tuple[RoverModel], dict[str, Any]]: ...

@final
class EpisodeRun:
    """One episode of a driving task: what its simulation does not hold.

    `begin` and `from_bytes` make one.
    """

    @staticmethod
    def begin(
        rules: EpisodeRules,
        simulation: Simulation,
        *,
        goal: Sequence[float],
        domain: npt.ArrayLike,
        trunk_load_limit: float,
        difficulty: float,
        normals: npt.ArrayLike | None = None,
        further: npt.ArrayLike | None = None,
    ) -> EpisodeRun | None:
        """The beginning of an episode.

        Args:
            rules: What all episodes of the task share.
            simulation: The rover at its start.
            goal: The goal (x, z), m.
            domain: Properties of rover and world: mass_scale, friction, actuator_gain,
                gravity_scale.
            trunk_load_limit: Force on the trunk beyond which the rover is high-centred, N.
            difficulty: Difficulty of the rocks.
            normals: A standard normal number for each entry of the observation, (size,), where the
                rules have noise.
            further: Goals after the first, (n, 2), x and z, m; none by default.

        Returns:
            The episode; None if its observation is not finite in float32.

        Raises:
            OptionError: An argument has a wrong shape or a number that is not finite, or the
                rover's model does not fit the rules.
        """
    @property
    def observation(self) -> _Observation:
        """The last observation, (size,) float32."""
    @property
    def previous_action(self) -> _Array:
        """The last action, (n_actions,); zeros at the beginning."""
    @property
    def goal(self) -> _Range:
        """The present goal (x, z), m; the last one where all are reached."""
    def info(self) -> dict[str, Any]:
        """The info of the last period, or of the beginning."""
    def changed(
        self,
        *,
        goal: Sequence[float] | None = None,
        distance: float | None = None,
        domain: npt.ArrayLike | None = None,
        trunk_load_limit: float | None = None,
        seen: EpisodeRun | None = None,
    ) -> EpisodeRun:
        """The same episode with other properties, another goal, or seen by other rules.

        Args:
            goal: The first goal, (x, z), m; none counts as reached, and an episode that has ended
                goes on.
            distance: Horizontal distance to the present goal, m.
            domain: Properties of rover and world, as of `begin`.
            trunk_load_limit: Force on the trunk beyond which the rover is high-centred, N.
            seen: An episode whose rules and observation are taken over.

        Raises:
            OptionError: An argument has a wrong shape or a number that is not finite, or does not
                fit the rules.
        """
    def to_bytes(self) -> bytes:
        """All that an episode holds, as `from_bytes` reads it."""
    @staticmethod
    def from_bytes(rules: EpisodeRules, data: bytes) -> EpisodeRun:
        """An episode that goes on.

        Args:
            rules: What all episodes of the task share.
            data: What `to_bytes` returned.

        Raises:
            StateError: The bytes are not those of an episode.
            OptionError: The episode does not fit the rules.
        """
    def __reduce__(self) -> Any: ...

@final
class EpisodeDistribution:
    """What the episodes of a task are drawn from.

    Draws come from generators that are number for number NumPy's `PCG64`; a generator is given and
    returned as four unsigned 64-bit numbers: high and low half of its state, high and low half of
    its increment.

    Args:
        rules: What all episodes share; rocks leave the goal clear within its tolerance.
        simulation: The rover, before its masses are scaled, and the options of its steps.
        start: Ranges (low, high) of `slope`, `uphill`, `heading`, `goal_distance`, `goal_bearing`
            and `turn`, by name, rad and m. A goal after the first lies at a distance from
            `goal_distance` from the one before it, in the direction of the last leg turned by
            `turn`.
        domain: Ranges of `mass_scale`, `friction`, `actuator_gain` and `gravity_scale`, by name.
        trunk_load_limit: Force on the trunk beyond which the rover is high-centred, before masses
            and gravity are scaled, N.
        rocks: Range of `difficulty`, and `abundance` and `max_radius` or None, by name; None for no
            rocks.
        slope_by_difficulty: Whether the slope follows from the difficulty of the rocks.
        ground: The ground of every episode, a terrain of any kind; None for a tilted plane.
        hills: Fractal ground: root mean square of its slope, rise over run, or nan for one that
            follows from the difficulty of the rocks; None for none. Not together with `ground`.
        sand: Soft grounds, one of which is drawn, on a tilted plane with ripples by the difficulty
            of the rocks; their surfaces do not count; None for none. Not together with the two
            others.

    Raises:
        OptionError: An argument is missing, no number, or out of its range.
        TerrainError: `ground` is no terrain.
    """

    def __new__(
        cls,
        rules: EpisodeRules,
        simulation: Simulation,
        *,
        start: Mapping[str, _Range],
        domain: Mapping[str, _Range],
        trunk_load_limit: float,
        rocks: Mapping[str, Any] | None = None,
        slope_by_difficulty: bool = False,
        ground: Terrain | _Terrains | None = None,
        hills: float | None = None,
        sand: Sequence[SoftGround] | None = None,
    ) -> EpisodeDistribution: ...
    def __getnewargs_ex__(self) -> tuple[tuple[EpisodeRules, Simulation], dict[str, Any]]: ...

@final
class DrawnEpisodes:
    """Drawn episodes, in the order of the generators."""

    @property
    def generators(self) -> _Rows:
        """The generators after the draws, (m, 4) uint64."""
    def simulation(self, index: int) -> Simulation:
        """A new simulation of the rover at the start of an episode.

        Args:
            index: Number of the episode.

        Raises:
            OptionError: There is no such episode.
        """
    def __len__(self) -> int: ...

@final
class EpisodeBatch:
    """Many rovers with their episodes, each bit for bit as it would be alone.

    One call at a time: a call during another one raises BusyError. Methods that take the index of a
    rover raise OptionError where there is no such rover, or where its episode has not begun.

    Args:
        rules: What all episodes share.
        simulation: A rover of the task; the batch begins with copies of it, without episodes.
        n: Number of rovers.
        max_steps: Control periods until an episode is truncated; no limit by default.
        threads: Number of threads; one a core by default.

    Raises:
        OptionError: An argument is out of its range, or the model does not fit the rules.
    """

    def __new__(
        cls,
        rules: EpisodeRules,
        simulation: Simulation,
        n: int,
        *,
        max_steps: int | None = None,
        threads: int | None = None,
    ) -> EpisodeBatch: ...
    @property
    def threads(self) -> int:
        """Number of threads."""
    def step(
        self,
        actions: object,
        active: npt.NDArray[np.bool_] | None = None,
        *,
        has_scan: bool = True,
        among: Sequence[RoverGrainSimulation | None] | None = None,
    ) -> tuple[_Observation, _Array, npt.NDArray[np.bool_], npt.NDArray[np.bool_], list[int]]:
        """Gives all rovers their actions for one control period.

        Other threads run meanwhile. Ctrl-C, or whatever else a signal handler raises, ends the call
        after a whole physics step of each rover, which need not be the same one.

        Args:
            actions: Torques, then steering, within [-1, 1], (n_rovers, n_actions).
            active: Which rovers move, (n_rovers,); all by default. The others stay as they are.
            has_scan: Whether the heights are taken. Without, only episodes that end or reach the
                time limit take them; the others keep the last ones.
            among: The grains that each rover drives among, a list of n_rovers
                RoverGrainSimulation of `simulation`; they move with the rovers, one after the
                other. None by default.

        Returns:
            Observations (n_rovers, size) float32, rewards (n_rovers,), which episodes have ended,
            which have reached the time limit, (n_rovers,), and the indices of all that have done
            either. A rover that stays has the values of its last period.

        Raises:
            CommandError: The actions have a wrong shape or an entry that is not finite or outside
                [-1, 1]. No rover has moved.
            OptionError: `active` or `among` is invalid, or an episode has not begun. No rover has
                moved.
        """
    @property
    def over(self) -> list[int]:
        """Indices of the rovers whose episode is over and whose next has not begun, in order."""
    def infos(self) -> dict[str, Any]:
        """The infos of all rovers, of their last periods or beginnings.

        Returns:
            For each entry an array (n_rovers,), and under its name after an underscore the mask of
            the rovers that have it: all.
        """
    def info(self, index: int) -> dict[str, Any]:
        """The info of one rover, of its last period or beginning.

        Args:
            index: Index of the rover.
        """
    def observations(self) -> _Observation:
        """The last observations of all rovers, (n_rovers, size) float32; zeros before an episode."""
    def draw(
        self,
        distribution: EpisodeDistribution,
        generators: _Rows,
        *,
        attempts: int = 100,
        difficulties: Sequence[_Range | None] | None = None,
        fixed: Mapping[str, Any] | Sequence[Mapping[str, Any]] | None = None,
    ) -> DrawnEpisodes:
        """Draws one episode from each generator on the threads of this batch; no rover changes.

        A scene in which the rover would stand deeper than 1 cm in the ground or in a sphere is
        drawn again. The given generators do not change: see `DrawnEpisodes.generators`.

        Args:
            distribution: What the episodes are drawn from.
            generators: Generators, (m, 4) uint64.
            attempts: Most scenes drawn for a rover until it has room.
            difficulties: For each generator a range (low, high) that replaces that of the rocks'
                difficulty, or None; by default none.
            fixed: Values that replace draws, which are made all the same, by name: `slope`,
                `uphill`, `position` (x, z), `heading`, `goal` (x, z), `further` (n, 2) of the goals
                after it, `difficulty`, `field_seed`, `q`, `v`; one mapping for all or a list of one
                for each generator; none by default.

        Returns:
            The episodes, the same for any number of threads.

        Raises:
            TerrainError: A rover has no room in `attempts` scenes, or the ground refuses a number.
            StateError: `q` or `v` has a wrong length or an entry that is not finite, or float32
                cannot hold the observation.
            ModelError: A scaled mass is out of its range.
            OptionError: Any other argument is invalid.
        """
    def begin(self, indices: Sequence[int], episodes: DrawnEpisodes) -> None:
        """Begins drawn episodes.

        Args:
            indices: Indices of the rovers, one for each episode.
            episodes: Drawn episodes with the rules of the batch.

        Raises:
            OptionError: There is no such rover, or the episodes do not fit. Nothing has changed.
        """
    def resume(
        self,
        indices: Sequence[int],
        simulation: Simulation,
        episode: EpisodeRun,
        origin: tuple[npt.ArrayLike, npt.ArrayLike, int, npt.ArrayLike],
        *,
        generator: _Rows,
        steps: int = 0,
        message: str | None = None,
    ) -> None:
        """Puts copies of a rover in the middle of its episode in the places of others.

        With `simulation`, `episode`, `origin`, `steps` and `generators` of one rover the copies
        continue it bit for bit.

        Args:
            indices: Indices of the rovers that it replaces.
            simulation: The rover.
            episode: Its episode, with the rules of the batch.
            origin: Where and on what it began, as `origin` tells.
            generator: Generator of the noise, (1, 4) uint64.
            steps: Control periods since the episode began.
            message: Message of the physics step that failed, if that has ended the episode.

        Raises:
            OptionError: There is no such rover, or an argument does not fit. Nothing has changed.
        """
    def episode(self, index: int) -> EpisodeRun:
        """A copy of the episode of one rover.

        Args:
            index: Index of the rover.
        """
    def steps(self, index: int) -> int:
        """Control periods of one rover since its episode began.

        Args:
            index: Index of the rover.
        """
    def generators(self, indices: Sequence[int]) -> _Rows:
        """The generators of rovers, from which their noise is drawn.

        Args:
            indices: Indices of the rovers.

        Returns:
            (m, 4) uint64: high and low half of each state, high and low half of each increment.
        """
    def set_generators(self, indices: Sequence[int], generators: _Rows) -> None:
        """Sets the generators of rovers.

        Args:
            indices: Indices of the rovers.
            generators: As `generators` returns them, (m, 4) uint64.

        Raises:
            OptionError: There is no such rover, its episode has not begun, or `generators` has a
                wrong shape. Nothing has changed.
        """
    def origin(self, index: int) -> tuple[_Array, _Array, int, _Array]:
        """Where and on what the episode of a rover has begun.

        Args:
            index: Index of the rover.

        Returns:
            Its rows of `DrawnEpisodes.starts`, `rocks`, `rock_seeds` and `domains`.
        """
    def terrain(self, index: int) -> Plane | SphereField:
        """The ground of one rover.

        Args:
            index: Index of the rover.
        """
    def complete(self, index: int) -> _Observation:
        """Takes the heights that the last observation of one rover lacks, if it lacks any.

        Args:
            index: Index of the rover.

        Returns:
            The observation, (size,) float32.
        """
    def simulation(self, index: int) -> Simulation:
        """The simulation of one rover, which moves with it until its next episode begins.

        Args:
            index: Index of the rover.
        """
    def __len__(self) -> int: ...

@final
class SoilSimulation(AnySimulation):
    """A granular soil of disks, and a machine that drives on it.

    The disks are free, with friction, between walls or on a ground.

    Args:
        radius: Radii of the disks, (n,), m.
        mass: Masses of the disks, (n,), kg; they are homogeneous.
        position: Centres, (n, 2), m, or centres and angles, (n, 3), m and rad.
        kinematic: Disks whose velocity no force changes, (n,), such as grains glued to a rough
            floor, or a piston with the velocity that `set_state` gives it; none by default. They
            may overlap one another and walls.
        walls: A point of each wall and the normal to its free side, (n, 4), m; none by default.
        ground: A `Line`, `Sine`, `Spline` or `Polyline` below the disks; none by default.
        rover: Keyword arguments of `TwoWheelRoverSimulation` that describe a rover, such as its
            `parameters`; none by default.
        rig: Mass (kg) and radius (m) of a single wheel whose forward speed and turning rate no
            force changes; none by default.
        machine: Coordinates of the rover (x, y, theta, theta_A, theta_B) or of the rig (x, y, -,
            theta, -), (5,), m and rad.
        friction: Coulomb's coefficient between disks.
        wall_friction: Coulomb's coefficient of disks on walls and ground.
        wheel_friction: Coulomb's coefficient of wheels.
        rolling_friction: Largest moment that resists the rolling of a disk on a disk, wall or
            ground, over the normal force and the rolling radius: 1/r = 1/r_1 + 1/r_2 of two disks,
            the disk's own radius elsewhere. It does not act on wheels, or where Coulomb's
            coefficient is 0.
        restitution: Newton's coefficient of all contacts, in [0, 1].
        gravity: Gravity, (2,), m/s²; (0, -9.81) by default.
        time_step: Time step, s.
        tolerance: Largest relative residual of the contact problem. Its velocities are also right
            to ten times that in m/s, times the square root of gravity over 9.81 m/s².
        max_iterations: Largest number of sweeps of the contact solver in a step.
        stabilisation: "projection" moves overlapping bodies apart, which may add energy by lifting
            those above; "none" leaves them. By default "none" without restitution and "projection"
            with it.
        penetration_tolerance: Overlap that projection leaves alone, m; 0.5% of the smallest radius
            by default.
        sleep: Whether disks at rest far from anything that moves are left out of the step.
        sleep_speed: Speed below which a disk is at rest, m/s; 5e-4 by default.
        sleep_distance: Distance within which nothing may move for a disk to sleep, m; 0.2 by
            default.

    Raises:
        ModelError: A radius or mass is not finite and positive, or the machine's data are invalid.
        StateError: Positions have a wrong shape or an entry that is not finite, or disks, walls or
            wheels overlap.
        TerrainError: A wall has no direction, or `ground` is not a ground.
        OptionError: An option is out of its range, or both `rover` and `rig` are given.
    """

    def __new__(
        cls,
        radius: npt.ArrayLike,
        mass: npt.ArrayLike,
        position: npt.ArrayLike,
        *,
        kinematic: npt.ArrayLike | None = None,
        walls: npt.ArrayLike | None = None,
        ground: PlanarGround | None = None,
        rover: dict[str, Any] | None = None,
        rig: npt.ArrayLike | None = None,
        machine: npt.ArrayLike | None = None,
        friction: float = 0.5,
        wall_friction: float = 0.5,
        wheel_friction: float = 0.9,
        rolling_friction: float = 0.0,
        restitution: float = 0.0,
        gravity: npt.ArrayLike | None = None,
        time_step: float = 0.001,
        tolerance: float = 0.0001,
        max_iterations: int = 2000,
        stabilisation: Literal["projection", "none"] | None = None,
        penetration_tolerance: float | None = None,
        sleep: bool = False,
        sleep_speed: float | None = None,
        sleep_distance: float | None = None,
    ) -> SoilSimulation: ...
    @property
    def radius(self) -> npt.NDArray[np.float64]:
        """Radii of the disks, (n,), m."""
    @property
    def mass(self) -> npt.NDArray[np.float64]:
        """Masses of the disks, (n,), kg."""
    @property
    def position(self) -> npt.NDArray[np.float64]:
        """Centres and angles of the disks, (n, 3), m and rad."""
    @property
    def velocity(self) -> npt.NDArray[np.float64]:
        """Rates of `position`, (n, 3), m/s and rad/s."""
    @property
    def kinematic(self) -> npt.NDArray[np.bool_]:
        """Which disks are kinematic, (n,)."""
    @property
    def asleep(self) -> npt.NDArray[np.bool_]:
        """Which disks sleep, (n,); kinematic ones always do."""
    @property
    def machine(self) -> npt.NDArray[np.float64]:
        """Coordinates of the machine, (5,), m and rad; empty without one."""
    @property
    def machine_rate(self) -> npt.NDArray[np.float64]:
        """Rates of the machine's coordinates, (5,), m/s and rad/s; empty without one."""
    @property
    def wheels(self) -> npt.NDArray[np.float64]:
        """Centre and radius of each wheel, (n_wheels, 3), m."""
    @property
    def walls(self) -> _Array:
        """A point of each wall and the normal to its free side, (m, 4), m."""
    @property
    def torques(self) -> npt.NDArray[np.float64]:
        """Commanded torques of the rover's wheels, (2,), N m, positive forward; empty without a rover."""
    @property
    def pull(self) -> tuple[float, float]:
        """Force at the machine's centre along x and y, N."""
    @property
    def settings(self) -> dict[str, Any]:
        """The options of contacts, gravity and solver, by the names of the arguments."""
    def set_state(
        self,
        position: npt.ArrayLike,
        velocity: npt.ArrayLike | None = None,
        machine: npt.ArrayLike | None = None,
        machine_rate: npt.ArrayLike | None = None,
    ) -> None:
        """Sets positions and rates; time starts at 0.

        Args:
            position: Centres, (n, 2), m, or centres and angles, (n, 3), m and rad.
            velocity: Rates, (n, 2), m/s, or (n, 3), m/s and rad/s; at rest by default.
            machine: Coordinates of the machine, (5,), m and rad; where it is by default.
            machine_rate: Rates of the machine's coordinates, (5,), m/s and rad/s; at rest by
                default.

        Raises:
            StateError: An array has a wrong shape or an entry that is not finite, or bodies
                overlap. Nothing has changed.
        """
    def remove(self, which: npt.ArrayLike) -> None:
        """Takes disks out; the others keep their order.

        Args:
            which: Which disks go, (n,) truth values.

        Raises:
            ModelError: The number of truth values differs, or no disk would be left. Nothing has
                changed.
        """
    def set_torques(self, torques: npt.ArrayLike) -> None:
        """Sets the torques of the rover's wheels.

        Args:
            torques: Torques of wheels A and B, (2,), N m, positive forward.

        Raises:
            CommandError: A wrong length, or an entry that is not finite. Nothing has changed.
        """
    def set_pull(self, pull: npt.ArrayLike) -> None:
        """Sets the force at the machine's centre, such as that of a drawbar.

        Args:
            pull: Force along x and y, (2,), N.

        Raises:
            CommandError: A wrong length, or an entry that is not finite. Nothing has changed.
        """
    @property
    def contacts(self) -> GrainContacts:
        """The contacts of the last step."""
    def momentum(self) -> npt.NDArray[np.float64]:
        """Momentum of the disks, (3,): along x and y, kg m/s, and about the origin, kg m²/s.

        Kinematic disks do not count.
        """
    def impulse_on_wheels(self) -> npt.NDArray[np.float64]:
        """Sum of the last step's contact impulses on the wheels, along x and y, (2,), N s."""
    def penetration(self) -> float:
        """Deepest overlap now, m."""
    def wake(self) -> None:
        """Wakes all disks."""

@final
class Drum:
    """A drum that turns about its axis, which lies along z, between two ends at rest.

    Args:
        radius: Inner radius, m.
        length: Distance between the ends, m.
        rate: Angular velocity about +z, rad/s.
        centre: Its middle, (3,), m; the origin by default.

    Raises:
        TerrainError: A number is not finite, or the radius or length is not positive.
    """

    def __new__(
        cls, radius: float, length: float, rate: float = 0.0, *, centre: npt.ArrayLike | None = None
    ) -> Drum: ...
    @property
    def radius(self) -> float:
        """Inner radius, m."""
    @property
    def length(self) -> float:
        """Distance between the ends, m."""
    @property
    def rate(self) -> float:
        """Angular velocity about +z, rad/s."""
    @property
    def centre(self) -> tuple[float, float, float]:
        """Its middle, m."""

@final
class Silo:
    """An upright tube, open above, perhaps on a flat floor with a round hole.

    Without a floor it has no end. What falls through the hole is free.

    Args:
        radius: Inner radius, m.
        floor: Height of the floor, m; no floor by default.
        hole: Radius of the hole in the middle of the floor, m; 0 for none.
        axis: Place (x, z) of the axis, (2,), m; the origin by default.

    Raises:
        TerrainError: A number is not finite, the radius is not positive, or the hole is as wide as
            the tube.
    """

    def __new__(
        cls,
        radius: float,
        *,
        floor: float | None = None,
        hole: float = 0.0,
        axis: npt.ArrayLike | None = None,
    ) -> Silo: ...
    @property
    def radius(self) -> float:
        """Inner radius, m."""
    @property
    def floor(self) -> float | None:
        """Height of the floor, m, or None."""
    @property
    def hole(self) -> float:
        """Radius of the hole, m."""
    @property
    def axis(self) -> tuple[float, float]:
        """Place (x, z) of the axis, m."""

@final
class GrainContacts:
    """The contacts of the last step of grains, as new arrays with one row a contact.

    Vectors have D entries: 2 of disks in the plane, 3 of balls in space. Contacts between sleeping
    grains are left out.
    """

    @property
    def bodies(self) -> npt.NDArray[np.int64]:
        """Numbers of both bodies, (n, 2), grains from 0, then wheels; -1 for a wall or the ground."""
    @property
    def points(self) -> _Array:
        """Points of the first body's surface, (n, D), m."""
    @property
    def normals(self) -> _Array:
        """Unit normals from the second body into the first, (n, D)."""
    @property
    def frames(self) -> _Array:
        """Contact frames, world frame, (n, D, D).

        Rows are the unit vectors n (normal), t and b (tangents); t = (n_y, -n_x) in the plane.
        """
    @property
    def gaps(self) -> _Array:
        """Gaps at the start of the step, (n,), m; negative where bodies overlap."""
    @property
    def impulses(self) -> _Array:
        """Impulses on the first body along n, t, b of `frames`, (n, D), N s.

        Cohesion is part of the normal ones, which are negative where a contact bears tension.
        """
    @property
    def velocities(self) -> _Array:
        """Velocities of the first body against the second after the step along n, t, b, (n, D), m/s."""
    @property
    def world_impulses(self) -> _Array:
        """Impulses on the first body along x, y, z, (n, D), N s."""
    @property
    def world_moments(self) -> _Array:
        """Moments of rolling and drilling friction on the first body, (n, 3), N m s."""
    def __len__(self) -> int: ...

@final
class GrainSimulation(AnySimulation):
    """Grains in space: free balls with friction, between walls or on a terrain.

    World axes: x forward, y up, z to the right.

    Args:
        radius: Radii of the balls, (n,), m.
        mass: Masses of the balls, (n,), kg; they are homogeneous.
        position: Centres, (n, 3), m.
        kinematic: Balls whose velocity no force changes, (n,), such as grains glued to a rough
            floor, or a piston with the velocity that `set_state` gives it; none by default. They
            may overlap one another and walls.
        walls: A point of each wall and the normal to its free side, (m, 6), m; none by default.
        wall_velocity: Velocities of the walls, (m, 3), m/s; at rest by default. A wall is in its
            place at time 0.
        vessel: A `Drum` or a `Silo` around the balls; none by default.
        terrain: A `Plane`, `SphereField`, `HeightField`, `TriangleMesh` or `Union`, or a list of
            them, below the balls; none by default. Where it knows no ground, balls fall. Balls
            have a vessel or a terrain, not both.
        friction: Coulomb's coefficient between balls.
        wall_friction: Coulomb's coefficient of balls on walls, vessel and terrain.
        rolling_friction: Largest moment that resists the rolling of a ball on a ball, wall, vessel
            or terrain, over the normal force and the rolling radius: 1/r = 1/r_1 + 1/r_2 of two
            balls, the ball's own radius elsewhere. A ball rests on a slope up to this tangent.
        drilling_friction: The same for rotation about the contact's normal. Neither acts on a
            rover, or where Coulomb's coefficient is 0.
        cohesion: Attraction of bodies that touch, N: the pull that breaks their contact. The law of
            a contact is 0 <= u_N + gap/h, p_N + h cohesion >= 0, one of them 0; friction is bounded
            by friction (p_N + h cohesion).
        cohesion_range: Gap up to which the attraction acts, m; 1% of the smallest radius by
            default, at most 20%.
        restitution: Newton's coefficient of all contacts, in [0, 1].
        gravity: Gravity, (3,), m/s²; (0, -9.81, 0) by default.
        time_step: Time step, s.
        tolerance: Largest relative residual of the contact problem. Its velocities are also right
            to 25 times that, in units of the root of gravity times the smallest radius; without
            gravity that of 9.81 m/s².
        max_iterations: Largest number of sweeps of the contact solver in a step.
        stabilisation: "projection" moves overlapping bodies apart, "push_out" lets them part by a
            fifth of their excessive overlap in each step; both may add energy by lifting those
            above. "none" leaves overlaps. By default "push_out", but "projection" with
            restitution or in a vessel: a step along the inside of a curve leads into it.
        penetration_tolerance: Overlap that stabilisation leaves alone, m; 0.5% of the smallest
            radius by default.
        sleep: Whether balls at rest far from anything that moves are left out of the step.
        sleep_speed: Speed below which a ball is at rest, m/s; 5e-4 by default.
        sleep_distance: Distance within which nothing may move for a ball to sleep, m; 0.2 by
            default.
        threads: Number of threads that solve the contact problem. The answer does not depend on
            it; below some thousands of balls a second one gains little.

    Raises:
        ModelError: A radius or mass is not finite and positive.
        StateError: Positions have a wrong shape or an entry that is not finite, or balls, walls or
            terrain overlap.
        TerrainError: A wall has no direction, or `terrain` or `vessel` is none.
        OptionError: An option is out of its range, or both `terrain` and `vessel` are given.
    """

    def __new__(
        cls,
        radius: npt.ArrayLike,
        mass: npt.ArrayLike,
        position: npt.ArrayLike,
        *,
        kinematic: npt.ArrayLike | None = None,
        walls: npt.ArrayLike | None = None,
        wall_velocity: npt.ArrayLike | None = None,
        vessel: Drum | Silo | None = None,
        terrain: Terrain | _Terrains | None = None,
        friction: float = 0.5,
        wall_friction: float = 0.5,
        rolling_friction: float = 0.0,
        drilling_friction: float = 0.0,
        cohesion: float = 0.0,
        cohesion_range: float | None = None,
        restitution: float = 0.0,
        gravity: npt.ArrayLike | None = None,
        time_step: float = 0.002,
        tolerance: float = 0.001,
        max_iterations: int = 2000,
        stabilisation: Literal["projection", "none"] | None = None,
        penetration_tolerance: float | None = None,
        sleep: bool = False,
        sleep_speed: float | None = None,
        sleep_distance: float | None = None,
        threads: int = 1,
    ) -> GrainSimulation: ...
    @property
    def radius(self) -> _Array:
        """Radii of the balls, (n,), m."""
    @property
    def mass(self) -> _Array:
        """Masses of the balls, (n,), kg."""
    @property
    def position(self) -> _Array:
        """Centres of the balls, (n, 3), m."""
    @property
    def velocity(self) -> _Array:
        """Velocities of the centres, (n, 3), m/s."""
    @property
    def spin(self) -> _Array:
        """Angular velocities of the balls, world frame, (n, 3), rad/s."""
    @property
    def kinematic(self) -> npt.NDArray[np.bool_]:
        """Which balls are kinematic, (n,)."""
    @property
    def asleep(self) -> npt.NDArray[np.bool_]:
        """Which balls sleep, (n,); kinematic ones always do."""
    @property
    def terrain(self) -> Terrain | None:
        """The terrain below the balls, or None."""
    @property
    def vessel(self) -> Drum | Silo | None:
        """The vessel around the balls, or None."""
    @property
    def walls(self) -> _Array:
        """A point of each wall now and the normal to its free side, (m, 6), m."""
    @property
    def settings(self) -> dict[str, Any]:
        """The options of contacts, gravity and solver, by the names of the arguments."""
    def set_state(
        self,
        position: npt.ArrayLike,
        velocity: npt.ArrayLike | None = None,
        spin: npt.ArrayLike | None = None,
    ) -> None:
        """Sets positions and velocities; time starts at 0.

        Args:
            position: Centres, (n, 3), m.
            velocity: Velocities of the centres, (n, 3), m/s; at rest by default.
            spin: Angular velocities, (n, 3), rad/s; at rest by default.

        Raises:
            StateError: An array has a wrong shape or an entry that is not finite, or bodies
                overlap. Nothing has changed.
        """
    def remove(self, which: npt.ArrayLike) -> None:
        """Takes balls out; the others keep their order.

        Args:
            which: Which balls go, (n,) truth values.

        Raises:
            ModelError: The number of truth values differs, or no ball would be left. Nothing has
                changed.
        """
    def exchange(
        self,
        radius: npt.ArrayLike,
        mass: npt.ArrayLike,
        position: npt.ArrayLike,
        before: Sequence[int],
        *,
        kinematic: npt.ArrayLike | None = None,
        velocity: npt.ArrayLike | None = None,
        spin: npt.ArrayLike | None = None,
    ) -> None:
        """Puts other balls in the place of those so far; time and options stay.

        Balls that were there keep their sleep and the impulses of their contacts, from which the
        next step's solver starts. Overlaps are not refused: a run may have made them. Earlier
        snapshots fit again once the same balls are back.

        Args:
            radius: Radii of all balls from here on, (n,), m.
            mass: Their masses, (n,), kg.
            position: Their centres, (n, 3), m.
            before: The number of each among the balls so far, (n,); -1 for one that was not there.
                Balls that stay keep their order.
            kinematic: Which of them are kinematic, (n,); none by default.
            velocity: Velocities of their centres, (n, 3), m/s; at rest by default.
            spin: Their angular velocities, (n, 3), rad/s; at rest by default.

        Raises:
            ModelError: A radius or mass is not finite and positive, or `before` does not increase.
                Nothing has changed.
            StateError: An array has a wrong shape or an entry that is not finite. Nothing has
                changed.
        """
    @property
    def contacts(self) -> GrainContacts:
        """The contacts of the last step."""
    def momentum(self) -> _Array:
        """Momentum of the balls, (6,): along x, y, z, kg m/s, and about the origin, kg m²/s.

        Kinematic balls do not count.
        """
    def penetration(self) -> float:
        """Deepest overlap now, m."""
    def wake(self) -> None:
        """Wakes all balls."""

@final
class RoverGrainSimulation(AnySimulation):
    """A rover among grains in space, stepped together.

    Wheels, boxes and balls of the rover meet the grains with exact contact and friction, and forces
    go both ways within the step. The rover and the grains keep their own simulations, which have
    their states, commands, contacts and forces; only the steps are taken here, with the solver
    settings of the grains, θ = 1. Walls of the grains hold grains alone: what shall hold the rover
    too is a terrain of both.

    Args:
        rover: The rover, with its model, terrain, friction and commands.
        grains: The balls, with the same time step and gravity.
        wheel_friction: Coulomb's coefficient between the rover and grains.

    Raises:
        OptionError: The time steps or gravities differ, or the coefficient is negative or not
            finite.
        StateError: A part of the rover is in a grain.
    """

    def __new__(
        cls, rover: Simulation, grains: GrainSimulation, *, wheel_friction: float = 0.9
    ) -> RoverGrainSimulation: ...
    @property
    def rover(self) -> Simulation:
        """The rover's simulation. Its own `step` moves it without the grains."""
    @property
    def grains(self) -> GrainSimulation:
        """The grains' simulation. Its own `step` moves them without the rover."""
    @property
    def wheel_friction(self) -> float:
        """Coulomb's coefficient between the rover and grains."""
    @property
    def wheel_gaps(self) -> npt.NDArray[np.float64]:
        """Gap of each wheel now to the nearest grain or the terrain, (n_wheels,), m.

        Positive when apart. A wheel without a grain within its radius has the gap to the terrain.
        """
    def penetration(self) -> float:
        """Deepest overlap now, m: of grains with anything, and of the rover with grains."""

def seed_generators(seeds: Sequence[int]) -> _Rows:
    """Seeds generators as `numpy.random.PCG64` does.

    Args:
        seeds: Whole numbers from 0, of any size.

    Returns:
        (m, 4) uint64: high and low half of each state, high and low half of each increment.

    Raises:
        OptionError: A seed is no whole number from 0.
    """

def standard_normals(generators: _Rows, size: int) -> tuple[_Array, _Rows]:
    """Draws standard normal numbers as `numpy.random.Generator.standard_normal` does.

    Args:
        generators: Generators, (m, 4) uint64.
        size: Numbers for each.

    Returns:
        The numbers, (m, size), and the generators after the draws, (m, 4) uint64.

    Raises:
        OptionError: An argument has a wrong shape or type.
    """

def soil_packing(
    count: int = 222,
    *,
    radius_min: float = 0.016,
    radius_max: float = 0.0165,
    mass: float = 0.7,
    left: float = 0.0,
    width: float = 2.4494,
    bottom: float = 0.0,
    seed: int = 0,
) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64], npt.NDArray[np.float64]]:
    """Disks in loose rows over a width, without overlap: where a soil starts from.

    The radii are drawn evenly from their range. The defaults are the soil of the 2010 report: three
    layers of 74.

    Args:
        count: Number of disks, at most 1 000 000.
        radius_min: Smallest radius, m.
        radius_max: Largest radius, m.
        mass: Mass of a disk of the mean radius, kg; the others' go with their area.
        left: Left edge, m.
        width: Width of the rows, m.
        bottom: Height of the lower edge, m.
        seed: Seed of the random numbers; equal seeds give equal disks.

    Returns:
        Radii, (n,), m, masses, (n,), kg, and centres, (n, 2), m.

    Raises:
        ModelError: A number is not finite or out of its range, the radii are the wrong way round,
            or a disk does not fit.
    """

def ball_packing(
    count: int,
    *,
    radius_min: float,
    radius_max: float,
    mass: float,
    width: float,
    depth: float,
    left: float = 0.0,
    back: float = 0.0,
    bottom: float = 0.0,
    seed: int = 0,
) -> tuple[_Array, _Array, _Array]:
    """Balls in loose layers over a rectangle, without overlap: where a bed starts from.

    The radii are drawn evenly from their range.

    Args:
        count: Number of balls, at most 1 000 000.
        radius_min: Smallest radius, m.
        radius_max: Largest radius, m.
        mass: Mass of a ball of the mean radius, kg; the others' go with their volume.
        width: Width of the rectangle along x, m.
        depth: Width of the rectangle along z, m.
        left: Smallest x, m.
        back: Smallest z, m.
        bottom: Height of the lower edge, m.
        seed: Seed of the random numbers; equal seeds give equal balls.

    Returns:
        Radii, (n,), m, masses, (n,), kg, and centres, (n, 3), m.

    Raises:
        ModelError: A number is not finite or out of its range, the radii are the wrong way round,
            or a ball does not fit.
    """

def arrange_balls(
    radius: npt.ArrayLike,
    *,
    width: float,
    depth: float,
    left: float = 0.0,
    back: float = 0.0,
    bottom: float = 0.0,
    seed: int = 0,
) -> _Array:
    """Places balls of given radii in loose layers over a rectangle, without overlap.

    Each has a place as wide as the largest ball, and they fill the layers in the order given.

    Args:
        radius: Radii, (n,), m.
        width: Width of the rectangle along x, m.
        depth: Width of the rectangle along z, m.
        left: Smallest x, m.
        back: Smallest z, m.
        bottom: Height of the lower edge, m.
        seed: Seed of the random numbers; equal seeds give equal places.

    Returns:
        Centres, (n, 3), m.

    Raises:
        ModelError: A number is not finite or out of its range, or a ball does not fit.
    """

@final
class SolverReport:
    """How the contact solver ended."""

    @property
    def status(self) -> Literal["converged", "relaxed", "not_converged", "budget_exhausted"]:
        """One of "converged", "relaxed", "not_converged" and "budget_exhausted".

        "relaxed": the convex relaxation is solved, which is not Coulomb's law. "budget_exhausted":
        the work that `budget` allows is done, and the answer is the best one found.
        """
    @property
    def is_converged(self) -> bool:
        """Whether Coulomb's law holds to the tolerance."""
    @property
    def iterations(self) -> int:
        """Iterations of the stage that answered."""
    @property
    def residual(self) -> float:
        """Violation of Signorini's and Coulomb's laws by the returned impulses, relative to the data."""
    @property
    def velocity_error(self) -> float:
        """Largest violation of Signorini's and Coulomb's laws at one contact, m/s."""
    @property
    def solver(self) -> str:
        """Name of the method that answered; never "auto"."""
    @property
    def stage(
        self,
    ) -> Literal[
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
    ]:
        """Name of the stage that answered; "at_rest" where q = 0 left nothing to do."""
    @property
    def stages(self) -> list[tuple[str, str, int]]:
        """Every stage that was tried, in order, with the reason for its end and its iterations.

        Reasons are "converged", "max_iterations", "stalled", "budget_exhausted", "non_finite" and
        "relaxed".
        """
    @property
    def work(self) -> int:
        """Work done, in the unit of the argument `budget`."""
    @property
    def law(self) -> Literal["coulomb", "relaxed"]:
        """The law that the answer obeys, "coulomb" or "relaxed"."""

@final
class FrictionContactSolution:
    """The solution of a friction-contact problem."""

    @property
    def impulses(self) -> _Array:
        """Impulses p, (n_c, d), N s, along the normal and the tangents."""
    @property
    def velocities(self) -> _Array:
        """Velocities u = W p + q, (n_c, d), m/s, along the normal and the tangents."""
    @property
    def report(self) -> SolverReport:
        """How the solver ended."""
    @property
    def history(self) -> list[tuple[str, int, float]]:
        """The residuals measured on the way, with the argument `history`.

        Each is a tuple of the stage, the iterations so far and the relative residual. "nsgs" and
        "admm" measure every few iterations, the others at every step. Of "relaxed" it is the
        residual of the relaxed law.
        """

def accuracy_options(accuracy: Literal["fast", "balanced", "reference"] | float) -> dict[str, Any]:
    """The options of `Simulation` that an accuracy stands for.

    Args:
        accuracy: "fast", "balanced" or "reference", or the error allowed on a path of 20 m on flat
            ground, m.

    Returns:
        The keyword arguments `time_step` (s), `variant` and `tolerance`.

    Raises:
        OptionError: The name is unknown, or the error is finer than any choice of options gives.
    """

@overload
def sin_cos(x: float) -> tuple[float, float]:
    """Sine and cosine of angles.

    Unlike those of NumPy and of `math` they have the same bits on every machine. They are within
    1 ulp; of what is not finite they are NaN.

    Args:
        x: An angle, or an array of any shape, rad.

    Returns:
        Sine and cosine: two numbers, or two new arrays of the shape of x.

    Raises:
        OptionError: x is no number and no array of numbers.
    """

@overload
def sin_cos(x: npt.NDArray[Any]) -> tuple[_Array, _Array]: ...
@overload
def atan2(y: float, x: float) -> float:
    """Angles of the points (x, y), in [-pi, pi].

    Unlike those of NumPy and of `math` they have the same bits on every machine. They are within
    1 ulp.

    Args:
        y: A number or an array of any shape.
        x: The same; the two shapes must be equal.

    Returns:
        The angle, rad: a number, or a new array.

    Raises:
        OptionError: An argument is no number and no array of numbers, or the shapes differ.
    """

@overload
def atan2(y: npt.NDArray[Any], x: npt.NDArray[Any]) -> _Array: ...
@overload
def exp(x: float) -> float:
    """Exponentials.

    Unlike those of NumPy and of `math` they have the same bits on every machine. They are within
    1 ulp.

    Args:
        x: A number or an array of any shape.

    Returns:
        The exponential: a number, or a new array of the shape of x.

    Raises:
        OptionError: x is no number and no array of numbers.
    """

@overload
def exp(x: npt.NDArray[Any]) -> _Array: ...
def solve_friction_contact(
    W: npt.ArrayLike | _SparseArray | tuple[npt.ArrayLike, npt.ArrayLike, npt.ArrayLike],
    q: npt.ArrayLike,
    mu: npt.ArrayLike,
    tolerance: float = 1e-8,
    *,
    dimension: Literal[2, 3] = 3,
    solver: Literal["auto", "nsgs", "newton", "proximal", "admm", "relaxed"] = "auto",
    max_iterations: int = 1000,
    initial: npt.ArrayLike | None = None,
    budget: int | None = None,
    history: bool = False,
) -> FrictionContactSolution:
    """Solves the friction-contact problem K* contains W p + q + mu |u_T| n, orthogonal to p in K.

    Args:
        W: Delassus operator, (n_c d, n_c d), 1/kg, used as it is: it may be singular or
            unsymmetric. For many contacts one of SciPy's sparse arrays, or block rows
            `(indptr, indices, data)` of shapes (n_c + 1,), (n_blocks,), (n_blocks, d, d), each row
            ascending and with its diagonal block.
        q: Free velocity, (n_c d,), m/s, contact by contact: normal, tangents.
        mu: Friction coefficients, (n_c,), or one for all contacts.
        tolerance: Largest relative residual of a converged answer; its velocities are right to
            max(tolerance, 1e-9) m/s as well.
        dimension: Components d of a contact, 2 or 3.
        solver: "auto" tries cheap methods first and robust ones last; "nsgs", "newton", "proximal"
            and "admm" are single methods for Coulomb's law; "relaxed" solves its convex relaxation,
            another law, and never counts as converged.
        max_iterations: Largest number of Newton steps, sweeps or ADMM iterations.
        initial: Impulses from which the solver starts, (n_c d,), N s; zero by default.
        budget: Largest amount of work, counted and not timed: a unit is one multiplication and
            addition in a product with W. None allows 3e8 units, about 0.3 s, for up to 48
            contacts, 1.2e9 for up to 200, and more in proportion to their square beyond. What
            exceeds the budget is left undone, and the report says so.
        history: Whether the solution keeps the residuals measured on the way.

    Returns:
        Impulses, velocities and the solver's report. Not converging is no error: see
        `report.status`.

    Raises:
        ProblemError: An array has a wrong shape or an invalid entry.
        OptionError: The solver or the dimension is unknown, or `tolerance`, `max_iterations` or
            `budget` is out of its range.

    Source: Acary and Brogliato 2008; Acary, Brémond and Huber 2018.
    """
