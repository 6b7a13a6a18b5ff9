"""Compiled core of rover-gym: the border to the Rust mechanics (`rover-core`).

SI units and radians everywhere. World frame: x forward, y up, z to the right. Wheels are always
listed FL, FR, ML, BL, MR, BR. Every array returned is new.
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
    "BedSimulation",
    "BusyError",
    "CommandError",
    "Contacts",
    "DiskSimulation",
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
    "InternalError",
    "Line",
    "Linearisation",
    "Machine",
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
    "SolverReport",
    "SphereField",
    "Spline",
    "StateError",
    "StepDerivatives",
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
    "disk_packing",
    "exp",
    "seed_generators",
    "sin_cos",
    "solve_friction_contact",
    "standard_normals",
]
__version__: str

class RoverGymError(Exception):
    """Base class of all rover-gym errors.

    Attributes:
        field: Name of the invalid argument, with the index of the entry; None if the error concerns no argument.
        value: The value given, or None.
    """

    field: str | None
    value: object

class ModelError(RoverGymError, ValueError):
    """The description of a model cannot be read or is not physical."""

class StateError(RoverGymError, ValueError):
    """A state or a snapshot has a wrong shape or an entry that is not finite."""

class TerrainError(RoverGymError, ValueError):
    """A terrain's description is invalid."""

class OptionError(RoverGymError, ValueError):
    """An option or another argument is invalid or out of range."""

class CommandError(RoverGymError, ValueError):
    """A torque, a set-point or an action is invalid."""

class ProblemError(RoverGymError, ValueError):
    """A friction-contact problem has a wrong shape or an invalid entry."""

class StepError(RoverGymError, RuntimeError):
    """A time step failed. The state is the one before that step."""

class BusyError(RoverGymError, RuntimeError):
    """An object was used while another call on it was still running. Nothing has changed."""

class InternalError(RoverGymError, RuntimeError):
    """A fault of rover-gym. Please report it, with what led to it and the message, which names the place."""

@final
class Motor:
    """The torque-speed line of a wheel's motor. Immutable.

    The motor gives the commanded torque, limited to `stall_torque * (1 - speed / no_load_speed)`
    forwards and `stall_torque * (1 + speed / no_load_speed)` backwards, and at most `stall_torque`
    either way.

    Args:
        stall_torque: Largest torque at standstill, N m.
        no_load_speed: Speed at which the available torque reaches zero, rad/s. If infinite, the
            limit does not depend on the speed.
        regenerating: Whether the motor brakes when it is driven faster than `no_load_speed`,
            following the same line up to the stall torque. Otherwise it turns freely there.

    Raises:
        ModelError: `stall_torque` is not from 1e-9 to 1e9 N m, or `no_load_speed` is neither from
            1e-6 to 1e9 rad/s nor infinite.
    """
    def __new__(cls, stall_torque: float, no_load_speed: float, regenerating: bool = True) -> Motor: ...
    @property
    def stall_torque(self) -> float:
        """Largest torque at standstill, N m."""
    @property
    def no_load_speed(self) -> float:
        """Speed at which the available torque reaches zero, rad/s; may be infinite."""
    @property
    def regenerating(self) -> bool:
        """Whether the motor brakes when it is driven faster than `no_load_speed`."""
    def torque(self, command: float, speed: float) -> float:
        """Motor torque for a command at a speed.

        Args:
            command: Commanded torque, N m.
            speed: Speed of the wheel in the direction of positive torque, rad/s.

        Returns:
            The torque, N m.

        Raises:
            CommandError: A number is not finite.
        """
    def __eq__(self, other: object, /) -> bool: ...
    def __hash__(self) -> int: ...
    def __getnewargs__(self) -> tuple[Any, ...]: ...

@final
class Machine:
    """A machine of a model, with its slices of the model's arrays."""
    @property
    def name(self) -> str:
        """Name of the machine."""
    @property
    def solids(self) -> list[str]:
        """Names of the machine's solids."""
    @property
    def coordinates(self) -> slice:
        """The machine's slice of coordinates and velocities, such as `Simulation.q`."""
    @property
    def joints(self) -> slice:
        """The machine's slice of arrays with one entry a joint."""
    @property
    def wheels(self) -> slice:
        """The machine's slice of arrays with one entry a wheel, such as `Simulation.wheel_forces`."""

@final
class RoverModel:
    """A machine: a tree of solids under a free base, read from data. Immutable.

    `RoverModel()` is the built-in six-wheel rover. The other constructors are `named`, `from_text`
    and `from_dict`, those that read files, `from_file`, `from_urdf` and `from_mjcf`, and `join` for
    several machines.

    Methods that take coordinates have an argument `coordinates`: "state" for the `q` and `v` of
    `Simulation`, "report" for the Cardan angles of the 2010 report and their rates. They raise
    StateError if `q` or `qdot` has a wrong length or an entry that is not finite, OptionError if
    `coordinates` is neither of the two, and TerrainError if `terrain` is not a terrain.
    """
    def __new__(cls) -> RoverModel: ...
    from_file = staticmethod(model_files.from_file)
    @staticmethod
    def from_text(text: str) -> RoverModel:
        """Reads a model from TOML text.

        Args:
            text: Contents of a model file.

        Raises:
            ModelError: The text does not describe a model.
        """
    @staticmethod
    def from_dict(description: Mapping[str, Any]) -> RoverModel:
        """Reads a model from nested dictionaries and lists.

        Args:
            description: A description as `to_dict` returns it.

        Raises:
            ModelError: The dictionaries do not describe a model.
        """
    to_file = model_files.to_file
    def to_text(self) -> str:
        """The description as TOML text, for `from_text`."""
    def to_dict(self) -> dict[str, Any]:
        """The description as nested dictionaries and lists, for `from_dict`."""
    @staticmethod
    def join(
        models: Mapping[str, RoverModel | str | os.PathLike[str]],
        *,
        loops: Sequence[Mapping[str, Any]] | None = None,
        name: str | None = None,
    ) -> RoverModel:
        """Joins several machines to one model, in which they meet, push and tow each other.

        The names of their solids, joints, wheels, tags and loops get the machine's name and a slash
        in front, such as "tug/trunk". Coordinates, joints and wheels are those of the machines, one
        machine after another: a state is `numpy.concatenate` of the states of all machines, a
        command likewise, and `machines` has the part of each.

        Args:
            models: Machines by name: objects, names of the gallery or files.
            loops: Constraints between machines, dictionaries with the fields of a closed loop in a
                model file. Between free machines `other_position` is required, and in a weld
                `other_rotation`. None by default.
            name: Name of the model; by default the machines' names.

        Raises:
            ModelError: `models` are not models by name, or a loop is invalid.
        """
    @property
    def machines(self) -> dict[str, Machine]:
        """Machines of the model by name; one, of the model's own name, unless several were joined."""
    @staticmethod
    def named(name: str) -> RoverModel:
        """Returns a model of the gallery by name.

        Args:
            name: One of `names()`.

        Raises:
            ModelError: There is no such model; the message lists the available ones.
        """
    @staticmethod
    def names() -> list[str]:
        """Names of the models of the gallery; the first is the built-in rover."""
    from_urdf = staticmethod(model_files.from_urdf)
    from_mjcf = staticmethod(model_files.from_mjcf)
    @property
    def import_report(self) -> Any:
        """What the importer read, assumed and left out of the source file.

        A `rover_gym.models.ImportReport`. None for models that were not imported, and for models
        derived from an imported one, for instance by `replace`.
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
        wheel_tangential_ratio: float | None = None,
        wheel_relaxation_length: float | None = None,
        masses: Mapping[str, float] | Sequence[float] | None = None,
        steering_stiffness: float | None = None,
        steering_damping: float | None = None,
        wheel_torque_limit: float | None = None,
        mass_scale: float | None = None,
        motor: Motor | Mapping[str, Any] | None = ...,
    ) -> RoverModel:
        """Returns a copy of the model with the given properties changed.

        The stiffness of the wheels does not follow masses and radii.

        Args:
            wheel_radius: Radius of all wheels, m. Shape, inertia and contact radius change
                together.
            contact_radius: Radius at which the wheels touch the ground, m. Shape and inertia do not
                change.
            wheel_stiffness: Normal contact stiffness of all wheels, N/m; 0 for rigid wheels, which
                have no damping, tangential ratio and relaxation length either.
            wheel_damping: Normal contact damping of all wheels, N s/m.
            wheel_tangential_ratio: Contact stiffness of all wheels along the surface relative to
                the normal one.
            wheel_relaxation_length: Way of rolling over which the deflection of all wheels along
                the surface is renewed, m.
            masses: Masses by name of the solid, or a list with one for each solid, kg. Inertias
                scale with them.
            steering_stiffness: Stiffness of every steering controller, N m/rad.
            steering_damping: Damping of every steering controller, N m s/rad.
            wheel_torque_limit: Largest torque of every wheel, N m.
            mass_scale: Factor of all masses and inertias.
            motor: The motor of all wheels: a `Motor`, a mapping of its fields, or None if the
                torque is to follow the command at any speed. By default the motors do not change.

        Raises:
            ModelError: A number is out of range, there is no solid of a given name, or
                `wheel_radius` is given and the solid of a wheel is not a disc.
        """
    def weld(self, joints: Mapping[str, float] | Sequence[str] | str) -> RoverModel:
        """Returns a copy of the model with joints locked. Their coordinates are removed.

        Args:
            joints: Names of joints to lock at 0, or a mapping of names to angles, rad.

        Returns:
            The new model. Its files and dictionaries contain the locks.

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
    def loops(self) -> list[dict[str, Any]]:
        """Closed loops, a dictionary for each.

        It has `name`, `kind`, `solid`, `other`, the number `rows` of equations, and of these the
        number `redundant`. An equation is redundant if, with all joints at zero, it follows from
        the joints and from earlier loops. Redundant equations are left out.
        """
    def close_loops(self, q: npt.ArrayLike, v: npt.ArrayLike | None = None) -> tuple[_Array, _Array]:
        """Closes the loops: the nearest state, in the sense that heavy parts move least.

        Args:
            q: Coordinates as `Simulation.q`, (nq,).
            v: Velocity as `Simulation.v`, (nv,); at rest by default.

        Returns:
            Coordinates that close all loops, (nq,), and the velocity without the part that would
            open them, (nv,). Without loops, `q` and `v`.

        Raises:
            StateError: An array has a wrong length or an entry that is not finite, or no
                coordinates near these close the loops.
        """
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
    def wheel_stiffnesses(self) -> _Array:
        """Normal stiffness of each wheel where it touches, (n_wheels,), N/m; 0 for a rigid wheel."""
    @property
    def clear_radius(self) -> float:
        """Radius of the circle that the rover needs to turn on the spot, m.

        The largest distance from the trunk's origin to a wheel's contact point, with all joints at
        zero, plus the wheel's radius and 0.1 m.
        """
    @property
    def wheel_torque_limits(self) -> _Array:
        """Largest torque of each wheel, (n_wheels,), N m."""
    @property
    def wheel_speed_gains(self) -> _Array:
        """Gain of each wheel's speed servo, (n_wheels,), N m s/rad; see `Simulation.set_wheel_speeds`."""
    @property
    def motors(self) -> list[Motor | None]:
        """The motor of each wheel; None for a wheel whose torque follows the command at any speed."""
    @property
    def wheel_joint_indices(self) -> list[int]:
        """Index in q of each wheel's rotation; -1 where it is locked.

        A wheel that is coupled with a ratio of 1 has the index of the joint that it follows, and
        shares its drive.
        """
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
        """Signed distance of each wheel from the terrain.

        Args:
            q: Coordinates, (nq,).
            terrain: A terrain, or a list of several.
            coordinates: "state" or "report".

        Returns:
            (n_wheels,), m, positive when apart.
        """
    def resting_pose(self, terrain: Terrain | _Terrains, position: Sequence[float], heading: float) -> _Array:
        """The coordinates of the rover at rest on a terrain.

        On a plane, the joints are at zero, the trunk's y axis is along the normal, its origin is
        above the position, and the lowest wheel touches the ground. If some wheels are then in the
        air, pitch, roll and the passive joints are adjusted, provided that more wheels touch the
        ground afterwards. On any other terrain, pitch, roll and the passive joints always bring as
        many wheels to the ground as possible. No wheel penetrates the ground.

        Args:
            terrain: A terrain, or a list of several; a plane must not be vertical.
            position: x and z, (2,), m.
            heading: Heading, rad.

        Returns:
            Coordinates of the state, (nq,).

        Raises:
            TerrainError: `terrain` is not a terrain, or the ground under the trunk or a wheel is
                unknown.
            StateError: A number is not finite, or the plane is vertical.
            ModelError: The model has no wheels, or several machines: place each by its own model.
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
        """The contact Jacobian J of each wheel: J v is the velocity of its contact point.

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
    def __eq__(self, other: object, /) -> bool: ...
    def __hash__(self) -> int: ...
    def __reduce__(self) -> Any: ...

@disjoint_base
class Terrain:
    """Base class of all grounds. Immutable.

    Its subclasses are `Plane`, `SphereField`, `HeightField`, `TriangleMesh`, `SoftGround` and
    `Union`.
    """
    def heights(self, points: npt.ArrayLike) -> _Array:
        """The height of the visible surface at places of the map.

        Args:
            points: Places (x, z), (m, 2), m.

        Returns:
            Heights y, (m,), m; NaN if there is no ground or no data.

        Raises:
            TerrainError: `points` has a wrong shape.
        """
    def cast_rays(
        self, origins: npt.ArrayLike, directions: npt.ArrayLike, max_range: float | None = None
    ) -> tuple[_Array, _Array]:
        """Finds the first point at which each ray hits the ground.

        Surfaces are hit from both sides. Use it to simulate depth cameras and laser scanners.

        Args:
            origins: Origins of the rays, world frame, (n, 3) or one (3,) for all, m.
            directions: Directions of the rays, world frame, (n, 3) or one (3,) for all, of any
                length.
            max_range: Largest distance, m; unlimited by default.

        Returns:
            Distances, (n,), m, and the surface's unit normals at the hits, world frame, (n, 3). A
            ray without a hit has an infinite distance and a NaN normal.

        Raises:
            OptionError: An array has a wrong shape or an entry that is not finite, a direction is
                zero, an origin is beyond 1e6 m, or `max_range` is not positive.
        """

@final
class Plane(Terrain):
    """A plane as ground. The half-space `normal · x + offset >= 0` is free.

    A normal of unit length is not normalised again, so the `normal` and `offset` of a plane
    reproduce the plane bit for bit.

    Args:
        normal: Normal out of the ground, (3,), of any length; straight up by default.
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
            TerrainError: An angle is not a finite number.
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
    """Sand, into which wheels sink. All other parts of a machine touch its surface as rigid ground.

    The ruts belong to a simulation and are part of its snapshots. For rocks on sand, use a `Union`
    of both. Beside firm ground other than spheres, contacts are found one rover at a time, which is
    slower in a batch.

    Args:
        surface: The undisturbed surface: a `Plane`, `HeightField` or `TriangleMesh`.
        soil: A `rover_gym.ground.sand.Soil`, or a mapping of its numbers.
        rut_cell: Size of a cell of the map of ruts, from 0.001 to 1 m.

    Raises:
        TerrainError: The surface is not a terrain, or a number of the soil is missing or out of
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
    def __getnewargs__(self) -> tuple[Any, ...]: ...

@final
class WheelBed:
    """A single wheel on a bed of soil, with prescribed speeds and vertical load.

    Args:
        soil: A `rover_gym.ground.sand.Soil`, or a mapping of its numbers.
        radius: Radius of the wheel without grousers, m.
        width: Its width, m.
        rounding: Radius of its edges, m.
        grouser_height: Height of its grousers, m.
        grousers: Number of its grousers.
        accuracy: Largest relative error of the forces that the discretisation of the wheel may
            cause.

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
        """Radius of the wheel including the sand held between its grousers, m."""
    def steady(self, drives: npt.ArrayLike) -> _Array:
        """Forces and sinkage in steady motion.

        Args:
            drives: Speed of travel (m/s), rate of the wheel (rad/s, positive forward), slip angle
                (rad, to the right), load (N) and gravity (m/s²) of each run, (n, 5).

        Returns:
            Sinkage (m), drawbar pull, force to the right and lift (N), and driving torque (N m) of
            each run, (n, 5); NaN if the soil cannot carry the load.

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
        """Simulates a run: the wheel starts on the surface, sinks in and drives.

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
            burial: Buried fraction of each rock's diameter, 0 to 0.5, or a range from which it is
                drawn for each rock; 0.5 by default.
            ground: Ground under the rocks; flat at height 0 by default. A plane becomes part of the
                field. Any other terrain only sets the height of the rocks; combine both as
                `Union([terrain, rocks])`.
            clear: Circles x, z, radius to keep free of rocks, (n, 3), m; none by default.
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
    """A height map as ground: two triangles in each cell, solid below. Immutable.

    Row j and column i stand at z = origin[1] + j spacing[1] and x = origin[0] + i spacing[0]. Each
    cell is cut along the diagonal from its corner (j, i) to (j + 1, i + 1). A height of NaN means
    unknown ground. If a rover comes near unknown ground or the border of the map, the step raises a
    `StepError` that gives the place. Heights are stored in single precision.
    `HeightField.from_file` reads a map, `HeightField.fractal` generates one from a seed.

    Args:
        heights: Heights y, (n_z, n_x), m; NaN where unknown.
        spacing: Distance of columns and of rows, m: one number, or (dx, dz).
        origin: Place (x, z) of the first height, m. By default the middle of the map is at the
            world's origin.
        material: Name of its material, for the laws of a `Simulation` by pair of materials.
        map_frame: Easting and northing of the world's origin in the coordinates of a map, and
            their change per metre along x and along z, (4,). `from_file` reads it from a GeoTIFF.

    Raises:
        TerrainError: The array has a wrong shape, a height is infinite or beyond 1e6 m, no cell
            has data, the spacing is not positive, or a change per metre is 0.
    """
    def __new__(
        cls,
        heights: npt.ArrayLike,
        spacing: float | tuple[float, float],
        origin: tuple[float, float] | None = None,
        material: str = "ground",
        map_frame: Sequence[float] | None = None,
    ) -> HeightField: ...
    from_file = staticmethod(terrain_files.height_field_from_file)
    fractal = staticmethod(fractal_map)
    @property
    def material(self) -> str:
        """Name of its material."""
    @property
    def grid(self) -> npt.NDArray[np.float32]:
        """Heights, (n_z, n_x) float32, m; NaN where unknown."""
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
    @property
    def map_frame(self) -> tuple[float, float, float, float] | None:
        """Easting and northing of the world's origin, and their change per metre; None without a map.

        Four numbers: the last two are the changes of easting along x and of northing along z.
        """
    def place_of(self, easting: float, northing: float) -> tuple[float, float]:
        """Place (x, z), m, of a point in map coordinates.

        Args:
            easting: Easting, in the unit of the map.
            northing: Northing, in the unit of the map.

        Raises:
            TerrainError: The ground has no map coordinates, or a number is not finite.
        """
    def coordinates_of(self, x: float, z: float) -> tuple[float, float]:
        """Easting and northing of a place, in the unit of the map.

        Args:
            x: Along x, m.
            z: Along z, m.

        Raises:
            TerrainError: The ground has no map coordinates, or a number is not finite.
        """
    def __getnewargs__(self) -> tuple[Any, ...]: ...

@final
class TriangleMesh(Terrain):
    """A triangle mesh as fixed ground, for instance a rock. Immutable.

    Corners are listed counterclockwise, seen from outside. A closed mesh is solid inside, an open
    one below.

    Corners at exactly equal positions are merged, so each triangle may have its own three corners,
    as in an STL file. Corners that differ by rounding are not merged, and wheels catch on the seam
    between them. `TriangleMesh.from_file` reads a mesh.

    Args:
        vertices: Corners, (n, 3), m.
        triangles: Numbers of the three corners of each triangle, (m, 3).
        material: Name of its material, for the laws of a `Simulation` by pair of materials.

    Raises:
        TerrainError: An array has a wrong shape, an entry is not finite, a triangle has no area or
            an index out of range, or neighbouring triangles have opposite orientations.
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
        """Whether the mesh is closed, so that no triangle has a free edge."""
    def __len__(self) -> int: ...
    def __getnewargs__(self) -> tuple[Any, ...]: ...

@final
class Union(Terrain):
    """Several terrains combined, for instance a map with rocks on it. Immutable.

    A rover can touch each of them. With a plane the ground is known everywhere; otherwise it is
    known where the parts together have it: height fields, and meshes beside them.

    Where parts meet, their borders are no edges: a box slides from one to the next, and a ridge
    between them is one ridge. Parts meet within 1e-5 of the length of an edge. Where they coincide,
    a contact counts once, with the material of the first. What lies inside another part is not
    touched.

    Args:
        parts: Terrains of any kind, at least one; at most one of them may have a plane.

    Raises:
        TerrainError: A part is not a terrain, the list is empty, or two parts contain a plane.
    """
    def __new__(cls, parts: _Terrains) -> Union: ...
    @property
    def parts(self) -> list[Terrain]:
        """The terrains, in the order they were given."""
    def __len__(self) -> int: ...
    def __getnewargs__(self) -> tuple[Any, ...]: ...

@final
class StepReport:
    """Summary of the time steps of one call: sums or worst values over the steps."""
    @property
    def status(self) -> Literal["converged", "not_converged"]:
        """Whether the steps "converged" or "not_converged".

        "converged" means that the contact solver met its tolerance in every step, or
        `acceptable` where it was slow.
        """
    @property
    def is_converged(self) -> bool:
        """Whether `status` is "converged"."""
    @property
    def budget_exhausted(self) -> bool:
        """Whether a contact problem stayed unsolved because the solver's `budget` was spent.

        With a larger `budget` it may be solved.
        """
    @property
    def acceptable(self) -> int:
        """Number of contact problems whose answer met the option `acceptable` alone."""
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

        If the energy audit slowed a rebound (`restitution` above 0), the residual includes the
        difference from Newton's law. `status` describes the solver alone.
        """
    @property
    def n_contacts(self) -> int:
        """Largest number of contacts in a step."""
    @property
    def immovable_contacts(self) -> int:
        """Largest number of contacts in a step along whose normal closed loops let nothing move.

        Example: the wheels of a machine that is welded to a stand. Such a contact bears no load,
        unless its wheel is elastic, and an overlap there cannot be removed.
        """
    @property
    def loop_gap(self) -> float:
        """Widest gap of a closed loop at the end of a step, m or rad; 0 without loops.

        Above 1e-6 the status is "not_converged".
        """
    @property
    def retaken(self) -> int:
        """Number of repeated steps.

        A step is repeated if a motor reached its torque-speed line, if the energy audit requires
        implicit gyroscopic terms, or if Newton's law of restitution had no solution.
        """
    @property
    def fallbacks(self) -> int:
        """Number of steps that took more than the usual effort.

        Its contacts are solved with every means, and where that fails or something else is in the
        way, the rover takes it alone, in halves if need be. Always 0 for planar machines, for
        grains and for the variant "newton", whose steps all are.
        """
    @property
    def energy_gain(self) -> float:
        """Largest energy gain of a step beyond the work done on it, relative to the kinetic energy."""
    @property
    def energy_removed(self) -> float:
        """Spurious energy gain of the scheme that the audit removed, summed over the steps, J."""
    @property
    def energy_supplied(self) -> float:
        """Work of torques, motors and wrenches, summed over the steps, J."""
    @property
    def energy_of_set_points(self) -> float:
        """Energy that commands since the last call have added to held joints, J.

        `Simulation.energy` contains it from the command on, so it is not part of the change over
        the call. 0 in the first call after the state was set or restored.
        """
    @property
    def energy_dissipated(self) -> float:
        """Energy dissipated by friction, impacts, dampers and sand, summed over the steps, J.

        It can be negative with Newton's law of restitution and friction. A new contact counts as an
        impact if it closes faster than gravity explains.
        """
    @property
    def energy_lost(self) -> float:
        """Numerical energy loss of the scheme, summed over the steps, J; negative if energy is gained.

        The change of the energy over the call is `energy_supplied` plus `energy_lifted` and
        `energy_released`, minus `energy_dissipated`, `energy_lost` and `energy_removed`.
        `energy_lost` therefore contains the errors of the time stepping and the work of reactions
        in persistent contacts. In smooth motion it shrinks with the square of the time step. Always
        0 for grains, whose energy is not audited.
        """
    @property
    def energy_lifted(self) -> float:
        """Work against gravity and springs by removing penetration, summed over the steps, J.

        The work of the actuators on the way is part of `energy_supplied`.
        """
    @property
    def energy_released(self) -> float:
        """Energy released by elastic wheels, summed over the steps, J; negative if they stored energy.

        Wheels are elastic if the model gives them a `stiffness`. The energy of their springs is
        part of neither the kinetic nor the potential energy. It is an account: a step enters what
        the wheels took from the machine, up to what their deflections can hold, and the sum over a
        run is no more than they held at its start.
        """
    @property
    def undetermined_loads(self) -> int:
        """Number of contacts whose impulses the motion of the last step does not determine.

        0 means that the motion determines the impulses of all contacts. Otherwise other
        impulses cause the same motion, and the step returns those of least norm within the
        cones of friction: four corners of a box share its weight like four equal springs.
        Friction counts: six rigid wheels that drive straight could push sideways against
        each other, so the number is 6. Contacts that yield, such as wheels with a
        `stiffness`, have determined impulses. Always 0 for grains. In a group of more than
        32 rigid contacts the solver chooses among the impulses.
        """
    def followed_by(self, later: StepReport) -> StepReport:
        """Combines this report with that of the following steps.

        Args:
            later: Report of the following steps.
        """

@final
class Contacts:
    """Contacts of a rover in the last step, as new arrays with one row for each contact."""
    @property
    def bodies(self) -> list[str]:
        """Name of the solid in each contact, or of the joint that is at its stop."""
    @property
    def others(self) -> list[str | None]:
        """Name of the other solid in each contact; None for the ground, a grain or a joint."""
    @property
    def kinds(self) -> list[str]:
        """Kind of each contact, "wheel", "box", "sphere", "collider", "limit" or "friction".

        "limit" is a joint at its stop, "friction" the dry friction of a joint.

        For these, the contact point is the origin of the solid that the joint carries, and the
        normal is the joint's axis in the direction that opens the gap. At a revolute joint, gap,
        impulse and velocity along the normal are in rad, N m s and rad/s. Tangential entries are
        zero. For dry friction, the entry along n of the impulse is its largest value, and the entry
        along t its value, positive if it accelerates the joint.
        """
    @property
    def wheels(self) -> npt.NDArray[np.int64]:
        """Index of the wheel in each contact, (n,); -1 for another solid or a joint's stop."""
    @property
    def points(self) -> _Array:
        """Contact points, world frame, (n, 3), m."""
    @property
    def frames(self) -> _Array:
        """Contact frames, world frame, (n, 3, 3).

        Rows are the unit vectors n (normal), t (rolling direction) and b (lateral). On rollers, t
        is the axis of the roller, and b is zero.
        """
    @property
    def gaps(self) -> _Array:
        """Gaps, (n,), m, at the configuration in which the step detected the contacts."""
    @property
    def impulses(self) -> _Array:
        """Impulses of the step along n, t, b, (n, 3), N s.

        If the step was split, these are sums over its parts.
        """
    @property
    def velocities(self) -> _Array:
        """Relative velocities after the step along n, t, b, (n, 3), m/s."""
    def __len__(self) -> int: ...

@final
class PathSearch:
    """Beam search for the cheapest path of a rover over a height scan.

    `rover_gym.drive.ScanPolicy` uses it; `rover_gym.drive.PathCosts` defines the cost of a path.
    A pose consists of the distance ahead, the distance to the right, m, and the turn to the left,
    rad.

    Args:
        scan: Rows, columns and spacing, m, of the height scan.
        outline: Geometry of the rover in the trunk's frame: `wheels` (n_wheels, 2) and `underside`
            (n, 2), x and z, m; `clearance` (n,) of the underside, m; `plane_fit` (3, n_wheels), the
            matrix from the heights under the wheels to height and slopes of the ground plane;
            `x_c`, x of the point that follows the path, m; `radius` of the wheels, m.
        costs: The fields of `PathCosts`.
        first: Arcs for the first segment of a path: `poses` (n, 4, 3), `direction` (n,), 1 or -1,
            and `commands` (n, 3), speed, curvature and sideways motion.
        further: Arcs for the following segments: `poses` and `direction`.
        reach: The rover's reach, m.
        arrival: Distance within which the goal is reached, m.

    Raises:
        OptionError: An argument is missing, not a number, or has a wrong shape.
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
        """Returns the first arc of the cheapest path.

        Args:
            heights: `(rows * columns,)` heights of the scan, m.
            goal: The goal ahead and to the right of the point that follows the path, m.
            command: `(3,)` the present command; its first entry is 0 if the rover starts to move.
            boldness: Factor on the costs of underside, climb and lean.
            traps: `(n, 3)` poses at which the rover got stuck.
            retreat: Required direction of the first arc, 1 or -1, while the rover backs off; 0 if
                both are allowed.
            extra: `(n,)` additional cost of each first arc, m; none by default.
            ways: `(rows * columns,)` cost-to-go from each point of the scan to the goal, m; the
                straight distance by default.

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
        """Cost-to-go to a goal from every cell of a map (Dijkstra 1959).

        The rover moves from a cell to one of its eight neighbours, with its heading towards it. The
        cost is the distance plus the costs of underside, climb and lean. A wheel over unknown
        ground gets the mean height of the other wheels; if the ground under all wheels is unknown,
        the cost is the distance alone.

        Args:
            heights: (rows, columns) heights, m, NaN where unknown; 3 to 2000 rows and columns. The
                first row is the farthest ahead; columns run from left to right.
            spacing: Distance of rows and columns, m.
            goal: Row and column of the goal. From the border to a goal outside the map, the
                straight distance counts.
            boldness: Factor on the costs of underside, climb and lean.
            extra: (rows, columns) additional cost per metre in each cell, at least 0; none by
                default.

        Returns:
            (rows, columns) costs-to-go, in metres of level ground.

        Raises:
            OptionError: An argument has a wrong shape or an entry out of range.
        """
    def under(self, heights: npt.ArrayLike, poses: npt.ArrayLike) -> npt.NDArray[np.float32]:
        """Features of the ground under the rover at given poses.

        Args:
            heights: `(rows * columns,)` heights of the scan, m.
            poses: `(..., 3)` poses.

        Returns:
            (n, n_wheels + 3), for each pose: the heights under the wheels minus the mean height
            under the wheels now, and the smallest gap under the rover, both divided by the wheel
            radius; then the slopes ahead and to the right of the plane fitted to the ground under
            the wheels.

        Raises:
            OptionError: An argument has a wrong shape or an entry that is not finite.
        """

@final
class Linearisation:
    """Derivatives of a time step, returned by `Simulation.linearise`.

    `x_next = next_state + a @ (x - state) + b @ (u - command)` to first order. The state is x = (q,
    v) as `Simulation.q` and `Simulation.v` return them, the command is u = (wheel torques, steering
    set-points). On soft ground seven numbers a wheel follow in x: the displacement of its centre
    (3) and its rotation (3) that the sand remembers, in units of its memory (1 and 1/m, world
    axes), and the energy that the sand may give back, J. All arrays are new.
    """
    @property
    def a(self) -> _Array:
        """Derivative of the next state by the state, (nx, nx) with nx = 2 nv, or 2 nv + 7 n_wheels."""
    @property
    def b(self) -> _Array:
        """Derivative of the next state by the command, (nx, nu) with nu = 2 n_wheels.

        Columns of wheels without a drive or without steering are 0.
        """
    @property
    def c(self) -> _Array:
        """Derivative of the next state by the parameters that were asked for, (nx, n_parameters)."""
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
        """For each contact, the name of the solid, or of the joint that is at its stop."""
    @property
    def modes(self) -> list[str]:
        """Mode of each contact, "open", "stick" or "slip".

        An open contact transmits no impulse. A contact without friction is "slip" while closed.
        """
    @property
    def margins(self) -> _Array:
        """Distance of each contact from a change of its mode, (n,), m/s; rad/s at a joint's stop.

        For an open contact it is the normal velocity. For a closed contact it is the smaller of two
        values: the normal impulse times the inverse effective mass along the normal, and, if
        sticking, mu p_N - |p_T| times the same factor, or, if slipping, the sliding speed.
        """
    @property
    def is_projected(self) -> bool:
        """Whether the step removes penetration. If so, the derivative includes this correction."""
    @property
    def holds(self) -> npt.NDArray[np.bool_] | None:
        """Whether each column of (a, b) is valid within the tested perturbation, (nx + nu,).

        None without `check`. A column is valid if two perturbed steps, one in each direction, have
        the same closed contacts in the same modes, the same projection and energy correction, the
        same wheels in sand, and agree with the column within 0.1%.
        """
    @property
    def errors(self) -> _Array | None:
        """Difference of each column of (a, b) from that of its two perturbed steps, (nx + nu,).

        None without `check`. The largest difference of an entry, relative to the column's largest
        entry.
        """
    @property
    def is_smooth(self) -> bool | None:
        """Whether all columns are valid; None without `check`."""

@final
class StepDerivatives:
    """Steps of trajectories with their derivatives, as `Simulation.differentiate` returns them."""
    @property
    def states(self) -> _Array:
        """States, (n, steps + 1, nx)."""
    @property
    def a(self) -> _Array:
        """Derivatives of each next state by the state, (n, steps, nx, nx)."""
    @property
    def b(self) -> _Array:
        """By the command, (n, steps, nx, nu); zero for torques beyond their limit."""
    @property
    def c(self) -> _Array:
        """By the parameters, (n, steps, nx, n_parameters)."""

@final
class Energy:
    """Kinetic and potential energy."""
    @property
    def kinetic(self) -> float:
        """Kinetic energy, J."""
    @property
    def potential(self) -> float:
        """Potential energy in gravity, springs and the stiffness of held joints, J.

        That in gravity is zero with all mass centres at the world's origin.
        """
    @property
    def total(self) -> float:
        """Sum of both, J."""

@final
class Snapshot:
    """Complete state of a simulation, from which it continues bit for bit. Picklable."""
    @staticmethod
    def from_bytes(data: bytes) -> Snapshot:
        """Reads a snapshot.

        Args:
            data: Bytes from `to_bytes`.

        Raises:
            StateError: The bytes are not a snapshot.
        """
    def to_bytes(self) -> bytes:
        """The snapshot as bytes, for `from_bytes`."""
    def __eq__(self, other: object, /) -> bool: ...
    def __hash__(self) -> int: ...
    def __reduce__(self) -> Any: ...

@disjoint_base
class AnySimulation:
    """Base class of all simulations. It cannot be instantiated.

    Its subclasses are `Simulation`, `PlanarSimulation`, `BedSimulation` and
    `RoverGrainSimulation`.

    Only one call may run at a time. A second call, from another thread or a signal handler, raises
    BusyError.
    """
    @property
    def time(self) -> float:
        """Time since the last call of `set_state`, s; among grains, the time of the grains."""
    @property
    def time_step(self) -> float:
        """Time step, s."""
    def step(self, n: int = 1) -> StepReport:
        """Takes n steps.

        Other Python threads run in the meantime. Ctrl-C, or another exception of a signal handler,
        ends the call after the current step; the state is that after the step. If the contact
        solver does not converge, no exception is raised: check the report's `status`.

        Args:
            n: Number of steps.

        Raises:
            StepError: A step failed. The state is the one before that step.
            OptionError: `n` is not a whole number from 0.
        """
    def energy(self) -> Energy:
        """Kinetic and potential energy now."""
    def snapshot(self) -> Snapshot:
        """Returns the complete state, from which `restore` continues bit for bit."""
    def restore(self, snapshot: Snapshot) -> None:
        """Restores the state of a snapshot.

        Args:
            snapshot: A snapshot of the same kind of simulation, with the same model or grains.

        Raises:
            StateError: The snapshot is damaged, or belongs to a simulation with another model or
                other grains. Nothing has changed.
        """

@final
class Simulation(AnySimulation):
    """A rover on a terrain, stepped through time.

    It starts at rest with all coordinates 0. The steering joints are held at 0; all other joints
    are free.

    Args:
        model: The machine, a name of the gallery, or a file; the built-in rover by default.
        terrain: A terrain, the file of a map or a mesh, or a list of several; flat ground at height
            0 by default.
        gravity: Gravity, world frame, (3,), m/s²; (0, -9.81, 0) by default.
        accuracy: Chooses `time_step`, `variant` and `tolerance` by `accuracy_options`: "fast",
            "balanced", "reference", or the allowed error on a path of 20 m on flat ground, m. These
            three options cannot be given beside it.
        friction: Coulomb's coefficient of every contact whose pair is not in `materials`.
        restitution: Newton's coefficient of every contact whose pair is not in `materials`, in
            [0, 1].
        materials: Friction and restitution by pair of materials, in any order, such as
            `{("wheel", "rock"): (0.5, 0.1)}`; or a list of rows (name, name, friction,
            restitution). None by default.
        time_step: Time step, s, from 1e-9 to 1000; 0.005 by default.
        variant: "linearised" evaluates the forces once in each step; "newton" solves for the forces
            at its end. "linearised" by default.
        theta: Implicitness of the time stepping: weight of the end of the step, in [0.5, 1].
        forecast: A contact is active in a step if gap + forecast * time_step * u_N <= 0, with u_N
            its normal velocity; in [0, 1].
        solver: Method for the contact problem, as in `solve_friction_contact`.
        tolerance: Largest relative residual of the contact problem; 1e-12 by default.
        acceptable: Violation at a contact, m/s, that is accepted where the contact solver is slow;
            `StepReport.acceptable` counts such solves. 0 accepts none.
        max_iterations: Largest number of iterations of the contact solver in a step.
        budget: Largest amount of work of the contact solver in a step, in the unit of
            `solve_friction_contact` (operations, not time). By default it grows with the
            number of contacts.
        stabilisation: Treatment of penetration: "projection" moves overlapping bodies apart, "none"
            leaves them.
        warm_start: Whether the contact solver starts from the last step's impulses.

    Raises:
        ModelError: `model` is none of these, or its file does not contain a model.
        TerrainError: `terrain` is none of these, or its file is damaged.
        OSError: A file cannot be read.
        OptionError: An option is out of range, or must not be given beside `accuracy`.
    """
    def __new__(
        cls,
        model: RoverModel | str | os.PathLike[str] | None = None,
        terrain: Terrain | _Terrains | None = None,
        *,
        gravity: npt.ArrayLike | None = None,
        accuracy: Literal["fast", "balanced", "reference"] | float | None = None,
        friction: float = 0.7,
        restitution: float = 0.0,
        materials: _Materials | None = None,
        time_step: float | None = None,
        variant: Literal["linearised", "newton"] | None = None,
        theta: float = 0.5,
        forecast: float = 0.5,
        solver: Literal["auto", "nsgs", "newton", "proximal", "admm"] = "auto",
        tolerance: float | None = None,
        acceptable: float = 1e-08,
        max_iterations: int = 1000,
        budget: int | None = None,
        stabilisation: Literal["projection", "none"] = "projection",
        warm_start: bool = True,
    ) -> Simulation: ...
    @property
    def model(self) -> RoverModel:
        """The machine."""
    @property
    def terrain(self) -> Terrain:
        """The ground."""
    def sand(self) -> dict[str, _Array] | None:
        """Forces, sinkage and ruts of the wheels on sand; None on rigid ground.

        Returns:
            Arrays by name. `force` (N) and `moment` about the wheel's centre (N m) of the sand on
            each wheel in the last step, (n_wheels, 3), world frame; `sinkage` of each wheel's
            lowest point below the undisturbed surface, (n_wheels,), m, negative above it;
            `absorbed`, energy that the sand has dissipated under each wheel, (n_wheels,), J;
            `slip`, rim slip of each wheel relative to the faster of rim and ground speed,
            (n_wheels,), 0 without contact; `ruts`, x, z and depth of each cell that a wheel has
            compacted, (n, 3), m.

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
        """Friction and restitution by pair of materials."""
    @property
    def settings(self) -> dict[str, Any]:
        """Keyword arguments for a simulation with the same options."""
    @property
    def lanes(self) -> Literal[1, 4, 8]:
        """Number of rovers that a batch steps together in one SIMD register of this computer.

        Either 8, 4 or 1; always 1 for the variant "newton". `StepReport.fallbacks` counts steps
        that take more than the usual effort.
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
        """Rotation matrix R_WB, (3, 3), from the trunk's frame to the world frame."""
    def set_state(
        self, q: npt.ArrayLike, qdot: npt.ArrayLike | None = None, *, coordinates: _Coordinates = "state"
    ) -> None:
        """Sets coordinates and velocities.

        Time starts at 0, and the next step has no warm start.

        Args:
            q: Coordinates, (nq,).
            qdot: Velocity in the same coordinates, (nv,); at rest by default.
            coordinates: "state", as `q` and `v` return them, or "report".

        The velocity loses the part that would open a closed loop, as in an impact.

        Raises:
            StateError: An array has a wrong length or an entry that is not finite, or a closed loop
                is open by more than 1e-6 m or rad; `RoverModel.close_loops` closes it. Nothing has
                changed.
            OptionError: `coordinates` is neither of the two.
        """
    def report_state(self) -> tuple[_Array, _Array]:
        """The state in the coordinates of the 2010 report.

        Returns:
            The report's q, (nq,), and its rate, (nv,).

        Raises:
            StateError: The heading is ±90 degrees, where these coordinates are singular.
        """
    @property
    def wheel_torques(self) -> _Array:
        """Commanded torques, limited by the model, (n_wheels,), N m, positive forward; 0 under servos."""
    @property
    def motor_torques(self) -> _Array:
        """Mean torques of the drives over the last step, (n_wheels,), N m, positive forward.

        Each is the command after the limit of the wheel's `Motor`, or the torque of its servo; 0
        before the first step. Wheels that share a drive have equal parts of its torque.
        """
    @property
    def loop_forces(self) -> dict[str, _Array]:
        """Mean reactions of the closed loops over the last step, by name.

        Of a connection the force on its first solid, (3,), N, in world axes; of a weld the force
        and the moment about the common point, (6,), N and N m; of a joint its force or torque,
        (1,). The second solid feels the opposite. Reactions of redundant equations count as 0.
        """
    def set_wheel_torques(self, torques: npt.ArrayLike) -> None:
        """Sets the driving torques; each saturates at its wheel's limit.

        Args:
            torques: Torques, (n_wheels,), N m, positive forward.

        Raises:
            CommandError: A wrong length, or an entry that is not finite. Nothing has changed.
        """
    @property
    def wheel_speeds(self) -> _Array | None:
        """Speeds that the wheels' servos hold, (n_wheels,), rad/s, positive forward.

        None while the wheels are driven by torques.
        """
    def set_wheel_speeds(self, speeds: npt.ArrayLike, set_points: npt.ArrayLike | None = None) -> None:
        """Holds the wheels at speeds by servos, until torques, other speeds or `brake` replace them.

        The torque of a wheel is `RoverModel.wheel_speed_gains` times the missing speed, within the
        wheel's torque limit and its motor's line. It is implicit in the step and stable at any gain
        and step. A motor is asked for its no-load speed at most, and its servo is at least as stiff
        as its line. Wheels that share a drive have the mean of their speeds; a wheel whose torque
        limit is 0 rolls freely.

        Args:
            speeds: Speeds, (n_wheels,), rad/s, positive forward.
            set_points: Angles for `set_steering`, (n_wheels,), rad, to set both or neither; the
                steering does not change by default.

        Raises:
            CommandError: A wrong length, an entry that is not finite, or a set-point that
                `set_steering` refuses. Nothing has changed.
        """
    @property
    def steering(self) -> _Array:
        """Steering set-points, (n_wheels,), rad; 0 for wheels without steering or released ones."""
    def set_steering(self, set_points: npt.ArrayLike) -> None:
        """Sets the steering set-points, which an implicit PD controller holds with the model's gains.

        Args:
            set_points: Angles, (n_wheels,), rad.

        Raises:
            CommandError: A wrong length, an entry that is not finite or beyond the wheel's limit,
                or one that is not 0 for a wheel that cannot be steered. Nothing has changed.
        """
    def set_commands(self, torques: npt.ArrayLike, set_points: npt.ArrayLike) -> None:
        """Sets torques and steering together. If one of them is invalid, neither changes.

        Args:
            torques: As for `set_wheel_torques`, (n_wheels,), N m.
            set_points: As for `set_steering`, (n_wheels,), rad.

        Raises:
            CommandError: As for these two methods. Nothing has changed.
        """
    def set_joint_torques(self, torques: npt.ArrayLike) -> None:
        """Sets torques about the joint axes.

        At a joint with its own drive, the torque is limited by the drive and by its motor's
        torque-speed line. At all other joints, wheels among them, it is added without limit.

        Args:
            torques: Torques, (n_joints,), N m, in the order of `RoverModel.joint_names`.

        Raises:
            CommandError: A wrong length, or an entry that is not finite. Nothing has changed.
        """
    def apply_wrench(
        self,
        solid: str,
        force: npt.ArrayLike | None = None,
        moment: npt.ArrayLike | None = None,
        *,
        point: npt.ArrayLike | None = None,
    ) -> None:
        """Applies a force and a moment to a solid in all further steps.

        Replaces the last wrench on this solid; one without force and moment removes it. A reset
        removes all wrenches, `set_state` keeps them.

        Args:
            solid: Name of the solid.
            force: Force in world axes, (3,), N; zero by default.
            moment: Moment in world axes, (3,), N m; zero by default.
            point: Where the force acts in the solid's frame, (3,), m; its origin by default.

        Raises:
            CommandError: There is no such solid, or an array has a wrong length or an entry that is
                not finite. Nothing has changed.
        """
    def clear_wrenches(self) -> None:
        """Removes all wrenches."""
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
            set_points: Angles, one for each joint, rad; the present angles by default.
            stiffness: Stiffness of the controllers, N m/rad; the model's by default.
            damping: Damping of the controllers, N m s/rad; the model's by default.

        Raises:
            CommandError: There is no such joint, the number of set-points differs, a number is
                negative or not finite, or neither model nor arguments give a stiffness or a
                damping. Nothing has changed.
        """
    def release(self, joints: str | Sequence[str]) -> None:
        """Releases joints that are held.

        Args:
            joints: Name of a joint, or names.

        Raises:
            CommandError: There is no such joint. Nothing has changed.
        """
    def brake(self) -> None:
        """Holds all wheels at their present angles, as `hold` does, and sets their torques to 0.

        Raises:
            CommandError: The model states no gains to hold a wheel. Nothing has changed.
        """
    @property
    def contacts(self) -> Contacts:
        """The contacts of the last step."""
    @property
    def wheel_gaps(self) -> _Array:
        """Gap of each wheel now, (n_wheels,), m, positive when apart."""
    @property
    def wheel_forces(self) -> _Array:
        """Mean contact force on each wheel over the last step, (n_wheels, 3), N.

        Sums over its contacts, each along its own normal, rolling and lateral direction; with
        rollers along the normal, along the roller's axis, and 0.
        """
    @property
    def trunk_force(self) -> float:
        """Mean normal force over the last step on all solids except the wheels, N.

        It is large when the rover is high-centred.
        """
    @property
    def deepest_overlap(self) -> float:
        """Deepest overlap of a wheel or a box with the ground now, as a gap, m; 0 without overlap."""
    def reading(self, target: Sequence[float] | None = None, scan: npt.ArrayLike | None = None) -> _Array:
        """All quantities for a controller, as one new array.

        Args:
            target: Place (x, z) of the target, to which the entry `target` refers, m; the origin by
                default.
            scan: Points of the height scan ahead and to the right of the trunk's origin in the
                heading frame, (n, 2), m; none by default.

        Returns:
            The array; `reading_layout` gives the slice of each quantity.

        Raises:
            OptionError: An argument has a wrong shape or an entry that is not finite.
        """
    def reading_layout(self, n_scan: int = 0) -> dict[str, slice]:
        """The slice of each quantity in a reading.

        - `pose`: q, with the angles of the wheels wrapped to one turn
        - `body_velocity`: linear and angular velocity of the trunk in its own frame, m/s and rad/s
        - `joint_rates`: rad/s
        - `wheel_gaps`: m, positive when apart
        - `wheel_contacts`: 1 where the wheel touches the ground, within 1 mm, else 0
        - `normal_forces`: mean over the last step, N
        - `tangential_forces`: mean over the last step, rolling and lateral for each wheel, N
        - `ground_normal`: normal of the ground plane in the trunk's frame; 0 without a plane
        - `target`: distance of the target ahead of the trunk's origin, to its right, and in total,
          all horizontal, m
        - `cos_tilt`: cosine of the angle between the trunk's y axis and up
        - `speed`: horizontal speed of the trunk's origin, m/s
        - `trunk_force`: as the property, N
        - `slip_ratio`: mean over the wheels in contact of the slip divided by the faster of rim and
          ground speed
        - `work`: absolute work of the wheel motors in the last call of `step`, driving or braking,
          J
        - `positive_work`: the driving part of it, J
        - `time`: s
        - `solver`: of the last call of `step`: 1 if it did not converge, iterations, residual,
          contacts
        - `heights`: height of the ground at the points of the scan relative to the trunk's origin,
          m; NaN where there is no ground

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
        """Finds the first point at which each ray hits the ground or the rover itself.

        Of the rover, the collision shapes are hit: wheels, boxes and balls.

        Args:
            origins: Origins of the rays, world frame, (n, 3) or one (3,) for all, m.
            directions: Directions of the rays, world frame, (n, 3) or one (3,) for all, of any
                length.
            max_range: Largest distance, m; unlimited by default.
            parts: Whether rays hit the rover's own parts.
            without: Names of solids that rays pass through, such as the one that carries the
                sensor.

        Returns:
            Distances, (n,), m, and the surface's unit normals at the hits, world frame, (n, 3). A
            ray without a hit has an infinite distance and a NaN normal.

        Raises:
            OptionError: As for `Terrain.cast_rays`, or `without` contains a name that is not a
                solid of the model.
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
        """The friction-contact problem of the last step; if the step was split, of its last part.

        Returns:
            Delassus operator W, (3 n_c, 3 n_c), 1/kg; free velocity, (3 n_c,), m/s; friction
            coefficients, (n_c,).
        """
    def linearise(
        self, check: bool = False, perturbation: float = 1e-06, parameters: Sequence[str] | str = ()
    ) -> Linearisation:
        """Derivatives of the next step with respect to state, command and parameters.

        The simulation does not change. The step is taken as after `set_state(q, v)`, without warm
        start. The active contacts, their modes and the branches of the motors' lines are held
        constant; the limits of the commands are not considered. Where the modes change, the
        derivative is not valid; with `check`, `Linearisation.holds` is False there.

        Args:
            check: Whether to test each column of (A, B) by two real steps, which takes ten
                times as long as the derivatives; False by default.
            perturbation: Change of each entry of (x, u) in these steps, m, rad, m/s or rad/s, and
                1000 times as many N m; from 1e-9 to 1e-3, 1e-6 by default.
            parameters: Names of parameters for C: "friction", the common coefficient; "mass" and
                "mass:<body>", a factor of mass and inertia of all bodies or of one;
                "damping:<joint>", N m s/rad or N s/m; "contact_stiffness" and "contact_damping",
                factors of those of wheels that yield; on soft ground "soil:<number>", a number of
                its soil in its own unit. None by default.

        Returns:
            The derivatives, the contact modes and their margins.

        Raises:
            OptionError: `perturbation` is out of its range, a parameter does not exist, or the
                variant is "newton".
            StateError: A pitch is 90 degrees, where the coordinates are singular.
            StepError: The step failed, was split, or did not converge, so that it has no
                derivative.
        """
    def differentiate(
        self,
        states: npt.ArrayLike,
        commands: npt.ArrayLike,
        parameters: Sequence[str] | str = (),
        threads: int | None = None,
    ) -> StepDerivatives:
        """Takes steps from given states under given commands, with the derivatives of each.

        The simulation does not change. Each step is taken as after `set_state`, without warm start,
        so that it is a function of state, command and parameters, as in `linearise`. Torques
        saturate at their limits. `rover_gym.derivatives` has products with these derivatives.

        Args:
            states: State at the start of each trajectory, (n, nx), as in `Linearisation`. On soft
                ground (n, 2 nv) serves too: the sand is then as it is in this simulation.
            commands: Wheel torques (N m) and steering set-points (rad) of each step,
                (n, steps, nu) with nu = 2 n_wheels.
            parameters: Names of parameters, as in `linearise`; none by default.
            threads: Number of threads; one a core by default.

        Returns:
            States and derivatives.

        Raises:
            StateError: A state has a wrong shape or an entry that is not finite, or a pitch is 90
                degrees.
            CommandError: Commands have a wrong shape or an entry that is refused.
            OptionError: A parameter does not exist, `threads` is out of its range, or the variant
                is "newton".
            StepError: A step failed, or has no derivative.
        """
    def profile(self, n: int = 1000) -> dict[str, float]:
        """Measures the computing time of each part of a step, on a copy of this simulation.

        Args:
            n: Number of steps.

        Returns:
            Mean time of each part (`kinematics`, `mass_matrix`, `solve` and so on) in a step, µs.

        Raises:
            StepError: A step failed.
            OptionError: `n` is not a whole number from 0.
        """
    def __reduce__(self) -> Any: ...

@disjoint_base
class PlanarGround:
    """Base class of the grounds of planar scenes: x forward, y up. Immutable.

    Its subclasses are `Line`, `Sine`, `Spline` and `Polyline`.
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
        slope: Slope, rise over run.
        offset: Height at x = 0, m.

    Raises:
        TerrainError: A number is not finite, the slope is beyond 1000 or the offset beyond 1e6 m.
    """
    def __new__(cls, slope: float = 0.0, offset: float = 0.0) -> Line: ...
    @property
    def slope(self) -> float:
        """Slope, rise over run."""
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
    """A natural cubic spline through points: ground with continuous curvature.

    Beyond the first and the last point it continues along its tangents.

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
    """Straight segments between points: ground with steps, ramps and kerbs.

    Two points may have the same x, for a vertical step.

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
    """Contacts of a planar simulation in the last step, as new arrays with one row for each contact."""
    @property
    def discs(self) -> npt.NDArray[np.int64]:
        """Index of the disc in each contact, (n,); 0 is the ball or wheel A, 1 is wheel B."""
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

        If the step was split, these are sums over its parts.
        """
    @property
    def velocities(self) -> _Array:
        """Velocities of the rim after the step along normal and tangent, (n, 2), m/s."""
    def __len__(self) -> int: ...

@disjoint_base
class PlanarSimulation(AnySimulation):
    """Base class of planar machines on a ground. It cannot be instantiated."""
    @property
    def ground(self) -> PlanarGround:
        """The ground."""
    @property
    def q(self) -> _Array:
        """Coordinates, (nv,), x and y, m, then angles, rad, positive counterclockwise."""
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
        """Keyword arguments for a simulation with the same options."""
    def set_state(self, q: npt.ArrayLike, v: npt.ArrayLike | None = None) -> None:
        """Sets coordinates and rates. Torques do not change.

        Time starts at 0, and the next step has no warm start.

        Args:
            q: Coordinates, (nv,), m and rad.
            v: Their rates, (nv,), m/s and rad/s; at rest by default.

        Raises:
            StateError: An array has a wrong length or an entry that is not finite. Nothing has
                changed.
        """
    def set_torques(self, torques: npt.ArrayLike) -> None:
        """Sets the driving torques; each saturates at its limit if the machine has one.

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
        """The friction-contact problem of the last step; if the step was split, of its last part.

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
        inertia: Inertia about the centre, kg m²; the inertia of a homogeneous disc by default.
        gravity: Gravity, (2,), m/s²; (0, -9.81) by default.
        contact: "nearest", the contact is the point of the ground nearest to the disc's
            centre, or "centre_height", the rule of the 2010 report, by which the centre itself
            stops at the ground.
        friction: Coulomb's coefficient of every contact whose pair is not in `materials`.
        restitution: Newton's coefficient of every contact whose pair is not in `materials`, in
            [0, 1].
        materials: Friction and restitution by pair of materials, in any order, such as
            `{("wheel", "rock"): (0.5, 0.1)}`; or a list of rows (name, name, friction,
            restitution). None by default.
        time_step: Time step, s, from 1e-9 to 1000; 0.005 by default.
        variant: "linearised" evaluates the forces once in each step; "newton" solves for the forces
            at its end. "linearised" by default.
        theta: Implicitness of the time stepping: weight of the end of the step, in [0.5, 1].
        forecast: A contact is active in a step if gap + forecast * time_step * u_N <= 0, with u_N
            its normal velocity; in [0, 1].
        solver: Method for the contact problem, as in `solve_friction_contact`.
        tolerance: Largest relative residual of the contact problem; 1e-12 by default.
        acceptable: Violation at a contact, m/s, that is accepted where the contact solver is slow;
            `StepReport.acceptable` counts such solves. 0 accepts none.
        max_iterations: Largest number of iterations of the contact solver in a step.
        budget: Largest amount of work of the contact solver in a step, in the unit of
            `solve_friction_contact` (operations, not time). By default it grows with the
            number of contacts.
        stabilisation: Treatment of penetration: "projection" moves overlapping bodies apart, "none"
            leaves them.
        warm_start: Whether the contact solver starts from the last step's impulses.

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
        gravity: npt.ArrayLike | None = None,
        contact: Literal["nearest", "centre_height"] = "nearest",
        friction: float = 0.7,
        restitution: float = 0.0,
        materials: _Materials | None = None,
        time_step: float | None = None,
        variant: Literal["linearised", "newton"] | None = None,
        theta: float = 0.5,
        forecast: float = 0.5,
        solver: Literal["auto", "nsgs", "newton", "proximal", "admm"] = "auto",
        tolerance: float | None = None,
        acceptable: float = 1e-08,
        max_iterations: int = 1000,
        budget: int | None = None,
        stabilisation: Literal["projection", "none"] = "projection",
        warm_start: bool = True,
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
        gravity: Gravity, (2,), m/s²; (0, -9.81) by default.
        contact: "nearest", the contact is the point of the ground nearest to the disc's
            centre, or "centre_height", the rule of the 2010 report, by which the centre itself
            stops at the ground.
        friction: Coulomb's coefficient of every contact whose pair is not in `materials`.
        restitution: Newton's coefficient of every contact whose pair is not in `materials`, in
            [0, 1].
        materials: Friction and restitution by pair of materials, in any order, such as
            `{("wheel", "rock"): (0.5, 0.1)}`; or a list of rows (name, name, friction,
            restitution). None by default.
        time_step: Time step, s, from 1e-9 to 1000; 0.005 by default.
        variant: "linearised" evaluates the forces once in each step; "newton" solves for the forces
            at its end. "linearised" by default.
        theta: Implicitness of the time stepping: weight of the end of the step, in [0.5, 1].
        forecast: A contact is active in a step if gap + forecast * time_step * u_N <= 0, with u_N
            its normal velocity; in [0, 1].
        solver: Method for the contact problem, as in `solve_friction_contact`.
        tolerance: Largest relative residual of the contact problem; 1e-12 by default.
        acceptable: Violation at a contact, m/s, that is accepted where the contact solver is slow;
            `StepReport.acceptable` counts such solves. 0 accepts none.
        max_iterations: Largest number of iterations of the contact solver in a step.
        budget: Largest amount of work of the contact solver in a step, in the unit of
            `solve_friction_contact` (operations, not time). By default it grows with the
            number of contacts.
        stabilisation: Treatment of penetration: "projection" moves overlapping bodies apart, "none"
            leaves them.
        warm_start: Whether the contact solver starts from the last step's impulses.

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
        gravity: npt.ArrayLike | None = None,
        contact: Literal["nearest", "centre_height"] = "nearest",
        friction: float = 0.7,
        restitution: float = 0.0,
        materials: _Materials | None = None,
        time_step: float | None = None,
        variant: Literal["linearised", "newton"] | None = None,
        theta: float = 0.5,
        forecast: float = 0.5,
        solver: Literal["auto", "nsgs", "newton", "proximal", "admm"] = "auto",
        tolerance: float | None = None,
        acceptable: float = 1e-08,
        max_iterations: int = 1000,
        budget: int | None = None,
        stabilisation: Literal["projection", "none"] = "projection",
        warm_start: bool = True,
    ) -> TwoWheelRoverSimulation: ...

@final
class MirroredRoverSimulation(PlanarSimulation):
    """The six-wheel rover driving straight ahead, as a planar machine in its plane of symmetry.

    Coordinates are x, y, m, theta, and the angle of each mirrored pair of joints, rad. Joints that
    do not turn about z are locked at 0. Only wheels touch the ground. Each torque acts on both
    wheels of a pair.

    Args:
        ground: A `Line`, `Sine`, `Spline` or `Polyline`.
        model: The machine: an object, a name of the gallery or a file. It must be symmetric about
            the trunk's x-y plane; the built-in rover by default.
        gravity: Gravity, (2,), m/s²; (0, -9.81) by default.
        contact: "nearest", the contact is the point of the ground nearest to the disc's
            centre, or "centre_height", the rule of the 2010 report, by which the centre itself
            stops at the ground.
        friction: Coulomb's coefficient of every contact whose pair is not in `materials`.
        restitution: Newton's coefficient of every contact whose pair is not in `materials`, in
            [0, 1].
        materials: Friction and restitution by pair of materials, in any order, such as
            `{("wheel", "rock"): (0.5, 0.1)}`; or a list of rows (name, name, friction,
            restitution). None by default.
        time_step: Time step, s, from 1e-9 to 1000; 0.005 by default.
        variant: "linearised" evaluates the forces once in each step; "newton" solves for the forces
            at its end. "linearised" by default.
        theta: Implicitness of the time stepping: weight of the end of the step, in [0.5, 1].
        forecast: A contact is active in a step if gap + forecast * time_step * u_N <= 0, with u_N
            its normal velocity; in [0, 1].
        solver: Method for the contact problem, as in `solve_friction_contact`.
        tolerance: Largest relative residual of the contact problem; 1e-12 by default.
        acceptable: Violation at a contact, m/s, that is accepted where the contact solver is slow;
            `StepReport.acceptable` counts such solves. 0 accepts none.
        max_iterations: Largest number of iterations of the contact solver in a step.
        budget: Largest amount of work of the contact solver in a step, in the unit of
            `solve_friction_contact` (operations, not time). By default it grows with the
            number of contacts.
        stabilisation: Treatment of penetration: "projection" moves overlapping bodies apart, "none"
            leaves them.
        warm_start: Whether the contact solver starts from the last step's impulses.

    Raises:
        ModelError: The model is not symmetric.
        TerrainError: `ground` is not a ground.
        OptionError: An option is out of its range.
        TypeError: An option is unknown.
    """
    def __new__(
        cls,
        ground: PlanarGround,
        *,
        model: RoverModel | str | os.PathLike[str] | None = None,
        gravity: npt.ArrayLike | None = None,
        contact: Literal["nearest", "centre_height"] = "nearest",
        friction: float = 0.7,
        restitution: float = 0.0,
        materials: _Materials | None = None,
        time_step: float | None = None,
        variant: Literal["linearised", "newton"] | None = None,
        theta: float = 0.5,
        forecast: float = 0.5,
        solver: Literal["auto", "nsgs", "newton", "proximal", "admm"] = "auto",
        tolerance: float | None = None,
        acceptable: float = 1e-08,
        max_iterations: int = 1000,
        budget: int | None = None,
        stabilisation: Literal["projection", "none"] = "projection",
        warm_start: bool = True,
    ) -> MirroredRoverSimulation: ...
    @property
    def joints(self) -> list[list[str]]:
        """Names of the joints of each coordinate from the fourth on."""
    @property
    def wheels(self) -> list[list[str]]:
        """Names of the wheels of each disc."""

@final
class SimulationBatch:
    """Steps many rovers on several threads. Each gives the same bits as it would alone.

    The batch copies the simulations. Only one call may run at a time; a second call raises
    BusyError.

    Args:
        simulations: Simulations whose models have the same number of coordinates.
        scan: Points of the height scan ahead and to the right of the trunk's origin in the heading
            frame, (n, 2), m; none by default.
        threads: Number of threads; one for each core by default.

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
        """Instruction set of the processor, "AVX-512", "AVX2" or "baseline".

        The widest that the processor has, unless the environment variable `ROVER_GYM_INSTRUCTIONS`
        names another. Results do not depend on it.
        """
    @property
    def reading_layout(self) -> dict[str, slice]:
        """The slice of each quantity in a row of readings; see `Simulation.reading_layout`."""
    def step(
        self,
        torques: npt.ArrayLike | None,
        set_points: npt.ArrayLike,
        n: int = 1,
        *,
        active: npt.NDArray[np.bool_] | None = None,
        speeds: npt.ArrayLike | None = None,
    ) -> tuple[_Array, dict[int, str]]:
        """Sets the commands of all rovers and takes n steps.

        Ctrl-C ends the call after the current step of each rover. The rovers may then have taken
        different numbers of steps.

        Args:
            torques: Commands for `Simulation.set_wheel_torques`, (n_rovers, n_wheels), N m; None
                with `speeds`.
            set_points: Commands for `Simulation.set_steering`, (n_rovers, n_wheels), rad.
            n: Number of steps.
            active: Which rovers move, (n_rovers,); all by default. The others do not change.
            speeds: Commands for `Simulation.set_wheel_speeds` in place of the torques, (n_rovers,
                n_wheels), rad/s.

        Returns:
            A row of readings for each rover, (n_rovers, size), and a mapping from the index of each
            rover whose step failed to the message of its StepError. The other rovers continue.

        Raises:
            CommandError: An array has a wrong shape or an entry that is invalid for a rover. No
                rover has moved.
            OptionError: `n` or `active` is invalid, or not one of `torques` and `speeds` is given.
        """
    def readings(self) -> _Array:
        """The readings of all rovers now, (n_rovers, size)."""
    def replace(self, index: int, simulation: Simulation, target: Sequence[float] | None = None) -> None:
        """Replaces a rover by a copy of a simulation, with its terrain.

        Args:
            index: Index of the rover.
            simulation: The new simulation, with the same number of coordinates.
            target: Place (x, z) to which the entry `target` of its readings refers, m; the origin
                by default.

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
    """Rules of a driving task, which all its episodes share.

    Args:
        model: The machine.
        substeps: Physics steps of a control period.
        dt: Control period, s.
        torque_limits: Torque for an action of 1, (n_wheels,), N m.
        max_steering: Steering set-point for an action of 1, rad. After the torques, actions have an
            entry for each steering joint, in the order of the wheels; none if this is 0.
        goal_tolerance: Distance within which the goal is reached, m.
        cos_max_tilt: Cosine of the tilt beyond which the rover has rolled over.
        stuck_time: Time after which an episode with a high-centred rover ends, s.
        weights: Weights of the terms of the reward, in the order of `terms`.
        gravity: Magnitude of gravity, m/s2. Forces in observations are divided by the mean weight
            on a wheel.
        noise: Standard deviation of the noise of observed entries without bounds; no noise by
            default.
        scan: Points of the height scan ahead and to the right of the trunk's origin in the heading
            frame, (n, 2), m; none by default.
        goals: Number of goals to reach in sequence. With more than one, the observation has three
            further entries before the heights: the goal after the present one, ahead and to the
            right, m, and the number of goals still to reach.
        battery: Energy of the battery, J; none by default. The work of the motors, driving or
            braking, discharges it, and the episode ends when it is empty. With a battery, the
            observation has one further entry after the time to high-centring: the state of charge,
            from 0 to 1.
        free_distance: Distance from the start at which the rover is free, m; none by default. The
            episode then ends, and progress is measured from the start.
        field_margin: How far the field reaches beyond the rectangle of start and goals, m; without
            an edge by default. An episode ends where the trunk's origin leaves it.

    Raises:
        ModelError: `model` is not a RoverModel.
        OptionError: A number is out of range, a list has a wrong length, or the number of weights
            differs from that of the terms.
    """
    def observation(self) -> list[tuple[str, int, int, str, tuple[float, ...], float, float, str]]:
        """The fields of an observation, in order.

        Returns:
            Name, first entry, size, unit, scale (size,), lower and upper bound of scaled entries,
            and meaning of each field.
        """
    @staticmethod
    def observation_rows() -> list[tuple[int, int, str, str, str, str]]:
        """First entry, size, name, meaning, unit and scale of the built-in rover's observed fields."""
    @staticmethod
    def info_rows() -> list[tuple[str, str, str]]:
        """Name, unit and meaning of each entry of an info."""
    @property
    def terms(self) -> tuple[str, ...]:
        """Names of the terms of the reward, in the order in which they are summed."""
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
        gravity: float,
        noise: float = 0.0,
        scan: npt.ArrayLike | None = None,
        goals: int = 1,
        battery: float | None = None,
        free_distance: float | None = None,
        field_margin: float | None = None,
    ) -> EpisodeRules: ...
    def __getnewargs_ex__(self) -> tuple[tuple[Any, ...], dict[str, Any]]: ...

@final
class EpisodeRun:
    """State of an episode of a driving task, beside its simulation.

    Create it by `begin` or `from_bytes`.
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
        """Begins an episode.

        Args:
            rules: Rules of the task.
            simulation: The rover at the start of the episode.
            goal: The goal (x, z), m.
            domain: Physical properties of the episode: mass_scale, friction, actuator_gain,
                gravity_scale.
            trunk_load_limit: Force on the trunk beyond which the rover is high-centred, N.
            difficulty: Difficulty of the rocks.
            normals: A standard normal number for each entry of the observation, (size,); needed if
                the rules have noise.
            further: Goals after the first, (n, 2), x and z, m; none by default.

        Returns:
            The episode; None if its first observation is not finite in float32.

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
        """The present goal (x, z), m; the last one if all are reached."""
    def info(self) -> dict[str, Any]:
        """The info of the last control period, or of the start."""
    def changed(
        self,
        *,
        goal: Sequence[float] | None = None,
        distance: float | None = None,
        domain: npt.ArrayLike | None = None,
        trunk_load_limit: float | None = None,
        seen: EpisodeRun | None = None,
    ) -> EpisodeRun:
        """Returns a copy of the episode with another goal, other properties, or other rules.

        Args:
            goal: The first goal, (x, z), m. No goal then counts as reached, and a terminated
                episode continues.
            distance: Horizontal distance to the present goal, m.
            domain: Physical properties, as for `begin`.
            trunk_load_limit: Force on the trunk beyond which the rover is high-centred, N.
            seen: An episode whose rules and observation are copied.

        Raises:
            OptionError: An argument has a wrong shape or a number that is not finite, or does not
                fit the rules.
        """
    def to_bytes(self) -> bytes:
        """The state of the episode as bytes, for `from_bytes`."""
    @staticmethod
    def from_bytes(rules: EpisodeRules, data: bytes) -> EpisodeRun:
        """Restores an episode.

        Args:
            rules: Rules of the task.
            data: Bytes from `to_bytes`.

        Raises:
            StateError: The bytes are not an episode.
            OptionError: The episode does not fit the rules.
        """
    def __reduce__(self) -> Any: ...

@final
class EpisodeDistribution:
    """Distribution of the episodes of a task.

    Random generators give the same numbers as NumPy's `PCG64`. A generator is four unsigned 64-bit
    numbers: high and low half of its state, high and low half of its increment.

    Args:
        rules: What all episodes share; rocks keep the goal's tolerance free.
        simulation: A rover with unscaled masses, which also sets the options of the time stepping.
        start: Ranges (low, high) of `slope`, `uphill`, `heading`, `goal_distance`, `goal_bearing`
            and `turn`, by name, rad and m. Each further goal lies at a distance drawn from
            `goal_distance` from the previous goal, in the direction of the last leg, turned by
            `turn`.
        domain: Ranges of `mass_scale`, `friction`, `actuator_gain` and `gravity_scale`, by name.
        trunk_load_limit: Force on the trunk beyond which the rover is high-centred, N, before
            scaling by masses and gravity.
        rocks: A mapping with the range of `difficulty`, and `abundance` and `max_radius`, each of
            which may be None; None for no rocks.
        slope_by_difficulty: Whether the difficulty of the rocks determines the slope.
        ground: A terrain for all episodes; None for a tilted plane.
        hills: Root mean square slope of fractal ground, rise over run, or NaN if the difficulty of
            the rocks determines it; None for no fractal ground. Not together with `ground`.
        sand: Soft grounds from which the soil of each episode is drawn; None for rigid ground. The
            surface is a tilted plane with ripples that grow with the difficulty of the rocks; the
            surfaces of the given grounds are not used. Not together with `ground` or `hills`.

    Raises:
        OptionError: An argument is missing, not a number, or out of range.
        TerrainError: `ground` is not a terrain.
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
    def __getnewargs_ex__(self) -> tuple[tuple[Any, ...], dict[str, Any]]: ...

@final
class DrawnEpisodes:
    """Drawn episodes, in the order of the generators."""
    @property
    def generators(self) -> _Rows:
        """States of the generators after the draws, (m, 4) uint64."""
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
    """Steps many rovers and their episodes. Each gives the same bits as it would alone.

    Only one call may run at a time; a second call raises BusyError. Methods that take the index of
    a rover raise OptionError if there is no such rover or if its episode has not begun.

    Args:
        rules: Rules of the task.
        simulation: A rover of the task. The batch starts with copies of it, without episodes.
        n: Number of rovers.
        max_steps: Control periods until an episode is truncated; no limit by default.
        threads: Number of threads; one for each core by default.

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
        info: int | Literal["all"] | None = None,
    ) -> tuple[_Observation, _Array, npt.NDArray[np.bool_], npt.NDArray[np.bool_], dict[str, Any]]:
        """Applies the actions of all rovers for one control period.

        Other Python threads run in the meantime. Ctrl-C, or another exception of a signal handler,
        ends the call after the current physics step of each rover. The rovers may then have taken
        different numbers of steps.

        Args:
            actions: Torques, then steering, within [-1, 1], (n_rovers, n_actions).
            active: Which rovers move, (n_rovers,); all by default. The others do not change.
            has_scan: Whether to update the height scans. If False, they are updated only in
                episodes that terminate or reach the time limit; the others keep the previous
                heights.
            among: A RoverGrainSimulation of each rover's `simulation`, if the rovers drive among
                grains; they are then stepped one after the other.
            info: Which infos to return: "all" as `infos`, an index as `info`; none by default.

        Returns:
            Observations (n_rovers, size) float32, rewards (n_rovers,), which episodes are
            terminated and which are truncated, (n_rovers,) each, and infos; an empty dictionary if
            none are asked for. A rover that is not active keeps the values of its last period.

        Raises:
            CommandError: The actions have a wrong shape or an entry that is not finite or outside
                [-1, 1]. No rover has moved.
            OptionError: `active`, `among` or `info` is invalid, or an episode has not begun. No
                rover has moved.
        """
    @property
    def over(self) -> list[int]:
        """Sorted indices of the rovers whose episode is over and whose next has not begun."""
    def infos(self) -> dict[str, Any]:
        """The infos of all rovers, each of its last control period or of its start.

        Returns:
            For each entry an array (n_rovers,), and under its name with a leading underscore a mask
            of the rovers that have the entry: all True.
        """
    def info(self, index: int) -> dict[str, Any]:
        """The info of one rover, of its last control period or of its start.

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
        """Draws one episode from each generator, on the threads of this batch.

        The rovers do not change. A scene is drawn again if the rover would penetrate the ground or
        a rock by more than 1 cm. The given generators do not change either:
        `DrawnEpisodes.generators` has their states after the draws.

        Args:
            distribution: Distribution of the episodes.
            generators: Generators, (m, 4) uint64.
            attempts: Largest number of scenes drawn for each episode.
            difficulties: For each generator, None or a range (low, high) of the rocks' difficulty
                that replaces the distribution's; None by default.
            fixed: Values that replace drawn ones, by name; the random numbers are drawn
                nevertheless: `slope`, `uphill`, `position` (x, z), `heading`, `goal` (x, z),
                `further` (n, 2) of the goals after it, `difficulty`, `field_seed`, `q`, `v`; one
                mapping for all, or a list with one for each generator; none by default.

        Returns:
            The episodes. They do not depend on the number of threads.

        Raises:
            TerrainError: In all of the `attempts` scenes the rover penetrates the ground, or a
                parameter of the ground is invalid.
            StateError: `q` or `v` has a wrong length or an entry that is not finite, or float32
                cannot hold the observation.
            ModelError: A scaled mass is out of its range.
            OptionError: Any other argument is invalid.
        """
    def begin(self, indices: Sequence[int], episodes: DrawnEpisodes) -> None:
        """Starts drawn episodes.

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
        """Replaces rovers by copies of a rover in the middle of its episode.

        With the `simulation`, `episode`, `origin`, `steps` and `generators` of one rover, the
        copies continue bit for bit.

        Args:
            indices: Indices of the rovers to replace.
            simulation: The rover.
            episode: Its episode, with the rules of the batch.
            origin: Start and ground of the episode, as returned by `origin`.
            generator: Generator of the noise, (1, 4) uint64.
            steps: Control periods since the episode began.
            message: Message of the StepError, if one has ended the episode.

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
        """The random generators of rovers, from which noise and next episodes are drawn.

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
        """Start and ground of a rover's episode.

        Args:
            index: Index of the rover.

        Returns:
            The start (5 + 2 n,), with n goals: slope, direction of steepest ascent, x and z,
            heading, x and z of each goal, rad and m; the rocks (3,), zeros if there are none:
            difficulty, abundance, radius of the largest rock in wheel radii; the seed of the rocks;
            and mass scale, friction, actuator gain and gravity scale (4,).
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

@disjoint_base
class BedSimulation(AnySimulation):
    """Base class of beds of grains. It cannot be instantiated.

    Its subclasses are `DiskSimulation` and `GrainSimulation`.
    """
    @property
    def radius(self) -> npt.NDArray[np.float64]:
        """Radii of the grains, (n,), m."""
    @property
    def mass(self) -> npt.NDArray[np.float64]:
        """Masses of the grains, (n,), kg."""
    @property
    def position(self) -> npt.NDArray[np.float64]:
        """Centres of balls, (n, 3), m, or centres and angles of disks, (n, 3), m and rad."""
    @property
    def velocity(self) -> npt.NDArray[np.float64]:
        """Velocities of the centres of balls, (n, 3), m/s, or rates of disks, (n, 3), m/s and rad/s."""
    @property
    def kinematic(self) -> npt.NDArray[np.bool_]:
        """Which grains have a prescribed velocity, (n,)."""
    @property
    def asleep(self) -> npt.NDArray[np.bool_]:
        """Which grains sleep, (n,); True for grains with a prescribed velocity."""
    @property
    def walls(self) -> _Array:
        """A point of each wall now and the normal to its free side, (m, 4) or (m, 6), m."""
    @property
    def settings(self) -> dict[str, Any]:
        """Options of contacts, gravity and solver, as keyword arguments."""
    def remove(self, which: npt.ArrayLike) -> None:
        """Removes grains. The others keep their order.

        Args:
            which: Which grains to remove, (n,) booleans.

        Raises:
            ModelError: The number of booleans differs from that of the grains, or no grain would be
                left. Nothing has changed.
        """
    @property
    def contacts(self) -> GrainContacts:
        """The contacts of the last step."""
    def momentum(self) -> npt.NDArray[np.float64]:
        """Momentum, kg m/s, then about the origin, kg m²/s: (3,) of disks, (6,) of balls.

        Grains with prescribed velocity are not included.
        """
    def penetration(self) -> float:
        """Deepest overlap now, m."""
    def wake(self) -> None:
        """Wakes all grains."""

@final
class DiskSimulation(BedSimulation):
    """Grains in the plane: free disks with friction, contained by walls or on a ground.

    A machine may drive on them.

    Args:
        radius: Radii of the disks, (n,), m.
        mass: Masses of the disks, which are homogeneous, (n,), kg.
        position: Centres, (n, 2), m, or centres and angles, (n, 3), m and rad.
        kinematic: Which disks have a prescribed velocity, (n,); none by default. Use it for grains
            glued to a rough floor, or for a piston with the velocity given to `set_state`. These
            disks may overlap each other and walls.
        walls: A point of each wall and the normal to its free side, (n, 4), m; none by default.
        ground: A `Line`, `Sine`, `Spline` or `Polyline` below the disks; none by default.
        rover: Keyword arguments of `TwoWheelRoverSimulation` that describe a rover, such as its
            `parameters`; none by default.
        rig: Mass (kg) and radius (m) of a single wheel with prescribed forward speed and turning
            rate; none by default.
        machine: Coordinates of the rover (x, y, theta, theta_A, theta_B) or of the rig (x, y, -,
            theta, -), (5,), m and rad.
        gravity: Gravity, (2,), m/s²; (0, -9.81) by default.
        friction: Coulomb's coefficient between grains.
        wall_friction: Coulomb's coefficient of grains on walls and on the ground, vessel or terrain.
        rolling_friction: Coefficient of rolling friction of grains: the largest resisting moment divided by
            the normal force and the rolling radius r. Between two grains 1/r = 1/r_1 + 1/r_2; on
            anything else r is the grain's radius. A grain stays at rest on a slope whose tangent is
            at most this coefficient. It does not act on wheels, nor if Coulomb's coefficient is 0.
        restitution: Newton's coefficient of all contacts, in [0, 1].
        time_step: Time step, s.
        tolerance: Largest relative residual of the contact problem. Errors of velocities are also
            limited: those of disks to ten times this value in m/s, times the square root of
            gravity / 9.81 m/s²; those of balls to 25 times this value, times the square root of
            gravity times the smallest radius. Without gravity 9.81 m/s² is used.
        max_iterations: Largest number of sweeps of the contact solver in a step.
        stabilisation: Treatment of overlaps: "projection" moves overlapping bodies apart, "push_out"
            removes a fifth of the excessive overlap in each step, "none" leaves it. The first two
            may add energy by lifting the bodies above. The default is "projection" with restitution
            or in a vessel, whose curved walls cause an overlap in every step; otherwise "push_out"
            for balls and "none" for disks.
        penetration_tolerance: Overlap that stabilisation does not correct, m; 0.5% of the smallest radius by
            default.
        sleep: Whether to skip grains that are at rest and far from moving bodies.
        sleep_speed: Speed below which a grain is at rest, m/s; 5e-4 by default.
        sleep_distance: A grain sleeps if no body within this distance moves, m; 0.2 by default.
        wheel_friction: Coulomb's coefficient of wheels.

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
        gravity: npt.ArrayLike | None = None,
        friction: float = 0.5,
        wall_friction: float = 0.5,
        rolling_friction: float = 0.0,
        restitution: float = 0.0,
        time_step: float = 0.001,
        tolerance: float = 0.0001,
        max_iterations: int = 2000,
        stabilisation: Literal["projection", "push_out", "none"] | None = None,
        penetration_tolerance: float | None = None,
        sleep: bool = False,
        sleep_speed: float | None = None,
        sleep_distance: float | None = None,
        wheel_friction: float = 0.9,
    ) -> DiskSimulation: ...
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
    def torques(self) -> npt.NDArray[np.float64]:
        """Commanded torques of the rover's wheels, (2,), N m, positive forward; empty without a rover."""
    @property
    def pull(self) -> tuple[float, float]:
        """External force at the machine's centre along x and y, N."""
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
            machine: Coordinates of the machine, (5,), m and rad; the present ones by default.
            machine_rate: Rates of the machine's coordinates, (5,), m/s and rad/s; at rest by
                default.

        Raises:
            StateError: An array has a wrong shape or an entry that is not finite, or bodies
                overlap. Nothing has changed.
        """
    def set_torques(self, torques: npt.ArrayLike) -> None:
        """Sets the torques of the rover's wheels.

        Args:
            torques: Torques of wheels A and B, (2,), N m, positive forward.

        Raises:
            CommandError: A wrong length, or an entry that is not finite. Nothing has changed.
        """
    def set_pull(self, pull: npt.ArrayLike) -> None:
        """Sets an external force at the machine's centre, such as a drawbar load.

        Args:
            pull: Force along x and y, (2,), N.

        Raises:
            CommandError: A wrong length, or an entry that is not finite. Nothing has changed.
        """
    def impulse_on_wheels(self) -> npt.NDArray[np.float64]:
        """Sum of the last step's contact impulses on the wheels, along x and y, (2,), N s."""

@final
class Drum:
    """A drum that rotates about its axis along z, with two fixed ends.

    Args:
        radius: Inner radius, m.
        length: Distance between the ends, m.
        rate: Angular velocity about +z, rad/s.
        centre: Centre of the drum, (3,), m; the origin by default.

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
        """Centre of the drum, m."""

@final
class Silo:
    """A vertical tube, open at the top, with an optional flat floor with a round hole.

    Without a floor the tube has infinite length. Grains that fall through the hole leave the silo.

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
        cls, radius: float, *, floor: float | None = None, hole: float = 0.0, axis: npt.ArrayLike | None = None
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
    """Contacts of grains in the last step, as new arrays with one row for each contact.

    Vectors have D entries: 2 for disks, 3 for balls. Contacts between sleeping grains are not
    included.
    """
    @property
    def bodies(self) -> npt.NDArray[np.int64]:
        """Indices of both bodies, (n, 2), grains from 0, then wheels; -1 for a wall or the ground."""
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

        Normal impulses include cohesion and are negative if a contact carries tension.
        """
    @property
    def velocities(self) -> _Array:
        """Relative velocities of the first body after the step along n, t, b, (n, D), m/s."""
    @property
    def world_impulses(self) -> _Array:
        """Impulses on the first body along x, y, z, (n, D), N s."""
    @property
    def world_moments(self) -> _Array:
        """Moments of rolling and drilling friction on the first body, (n, 3), N m s."""
    def __len__(self) -> int: ...

@final
class GrainSimulation(BedSimulation):
    """Grains in space: free balls with friction, contained by walls or a vessel, or on a terrain.

    World axes: x forward, y up, z to the right.

    Args:
        radius: Radii of the balls, (n,), m.
        mass: Masses of the balls, which are homogeneous, (n,), kg.
        position: Centres, (n, 3), m.
        kinematic: Which balls have a prescribed velocity, (n,); none by default. Use it for grains
            glued to a rough floor, or for a piston with the velocity given to `set_state`. These
            balls may overlap each other and walls.
        walls: A point of each wall and the normal to its free side, (m, 6), m; none by default.
        wall_velocity: Velocities of the walls, (m, 3), m/s; at rest by default. `walls` gives their
            places at time 0.
        vessel: A `Drum` or a `Silo` around the balls; none by default.
        terrain: A `Plane`, `SphereField`, `HeightField`, `TriangleMesh` or `Union`, or a list of
            them, below the balls; none by default. Balls fall where the ground is unknown. A vessel
            and a terrain cannot be combined.
        gravity: Gravity, (3,), m/s²; (0, -9.81, 0) by default.
        friction: Coulomb's coefficient between grains.
        wall_friction: Coulomb's coefficient of grains on walls and on the ground, vessel or terrain.
        rolling_friction: Coefficient of rolling friction of grains: the largest resisting moment divided by
            the normal force and the rolling radius r. Between two grains 1/r = 1/r_1 + 1/r_2; on
            anything else r is the grain's radius. A grain stays at rest on a slope whose tangent is
            at most this coefficient. It does not act on wheels, nor if Coulomb's coefficient is 0.
        restitution: Newton's coefficient of all contacts, in [0, 1].
        time_step: Time step, s.
        tolerance: Largest relative residual of the contact problem. Errors of velocities are also
            limited: those of disks to ten times this value in m/s, times the square root of
            gravity / 9.81 m/s²; those of balls to 25 times this value, times the square root of
            gravity times the smallest radius. Without gravity 9.81 m/s² is used.
        max_iterations: Largest number of sweeps of the contact solver in a step.
        stabilisation: Treatment of overlaps: "projection" moves overlapping bodies apart, "push_out"
            removes a fifth of the excessive overlap in each step, "none" leaves it. The first two
            may add energy by lifting the bodies above. The default is "projection" with restitution
            or in a vessel, whose curved walls cause an overlap in every step; otherwise "push_out"
            for balls and "none" for disks.
        penetration_tolerance: Overlap that stabilisation does not correct, m; 0.5% of the smallest radius by
            default.
        sleep: Whether to skip grains that are at rest and far from moving bodies.
        sleep_speed: Speed below which a grain is at rest, m/s; 5e-4 by default.
        sleep_distance: A grain sleeps if no body within this distance moves, m; 0.2 by default.
        drilling_friction: Coefficient of friction against rotation about the contact normal, as
            `rolling_friction`.
        cohesion: Attractive force between bodies in contact, N: the pull that separates them.
            The contact law is 0 <= u_N + gap/h, p_N + h cohesion >= 0, one of them 0; the
            tangential impulse is at most friction (p_N + h cohesion).
        cohesion_range: Gap up to which the attraction acts, m; 1% of the smallest radius by default, at
            most 20%.
        threads: Number of threads that solve the contact problem. The result does not depend on it.
            With fewer than some thousands of balls, a second thread gains little.

    Raises:
        ModelError: A radius or mass is not finite and positive.
        StateError: Positions have a wrong shape or an entry that is not finite, or balls, walls or
            terrain overlap.
        TerrainError: A wall has no direction, or `terrain` is not a terrain, or `vessel` is not a
            vessel.
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
        gravity: npt.ArrayLike | None = None,
        friction: float = 0.5,
        wall_friction: float = 0.5,
        rolling_friction: float = 0.0,
        restitution: float = 0.0,
        time_step: float = 0.002,
        tolerance: float = 0.001,
        max_iterations: int = 2000,
        stabilisation: Literal["projection", "push_out", "none"] | None = None,
        penetration_tolerance: float | None = None,
        sleep: bool = False,
        sleep_speed: float | None = None,
        sleep_distance: float | None = None,
        drilling_friction: float = 0.0,
        cohesion: float = 0.0,
        cohesion_range: float | None = None,
        threads: int = 1,
    ) -> GrainSimulation: ...
    @property
    def spin(self) -> _Array:
        """Angular velocities of the balls, world frame, (n, 3), rad/s."""
    @property
    def terrain(self) -> Terrain | None:
        """The terrain below the balls, or None."""
    @property
    def vessel(self) -> Drum | Silo | None:
        """The vessel around the balls, or None."""
    def set_state(
        self, position: npt.ArrayLike, velocity: npt.ArrayLike | None = None, spin: npt.ArrayLike | None = None
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
        """Replaces the balls. Time and options do not change.

        Balls that are kept stay asleep, and keep their contact impulses for the warm start of the
        next step. Overlaps are allowed, because they can arise in a run. An earlier snapshot can be
        restored once the simulation has the same balls again.

        Args:
            radius: Radii of the new set of balls, (n,), m.
            mass: Their masses, (n,), kg.
            position: Their centres, (n, 3), m.
            before: Index of each ball in the present set, (n,); -1 for a new ball. The kept balls
                must be in their present order.
            kinematic: Which balls have a prescribed velocity, (n,); none by default.
            velocity: Velocities of their centres, (n, 3), m/s; at rest by default.
            spin: Their angular velocities, (n, 3), rad/s; at rest by default.

        Raises:
            ModelError: A radius or mass is not finite and positive, or `before` does not increase.
                Nothing has changed.
            StateError: An array has a wrong shape or an entry that is not finite. Nothing has
                changed.
        """

@final
class RoverGrainSimulation(AnySimulation):
    """A rover and grains, stepped together with contact forces between them.

    Wheels, boxes and balls of the rover touch the grains with contact and friction, solved together
    in each step. Rover and grains keep their own simulations, which hold states, commands, contacts
    and forces; this class only takes the steps, with the solver settings of the grains and θ = 1.
    The walls of the grains do not stop the rover: for that, give both the same terrain.

    Args:
        rover: The simulation of the rover, with its model, terrain, friction and commands.
        grains: The simulation of the balls, with the same time step and gravity.
        wheel_friction: Coulomb's coefficient between the rover and grains.

    Raises:
        OptionError: The time steps or gravities differ, or the coefficient is negative or not
            finite.
        StateError: A part of the rover penetrates a grain.
    """
    def __new__(
        cls, rover: Simulation, grains: GrainSimulation, *, wheel_friction: float = 0.9
    ) -> RoverGrainSimulation: ...
    @property
    def rover(self) -> Simulation:
        """The rover's simulation. Calling its own `step` moves it without the grains."""
    @property
    def grains(self) -> GrainSimulation:
        """The grains' simulation. Calling its own `step` moves them without the rover."""
    @property
    def wheel_friction(self) -> float:
        """Coulomb's coefficient between the rover and grains."""
    @property
    def wheel_gaps(self) -> npt.NDArray[np.float64]:
        """Gap between each wheel and the nearest grain or the terrain now, (n_wheels,), m.

        Positive when apart. Grains farther from a wheel than its radius are not considered.
        """
    def penetration(self) -> float:
        """Deepest overlap of a grain with any body now, m."""

def seed_generators(seeds: Sequence[int]) -> _Rows:
    """Seeds random generators as `numpy.random.PCG64` does.

    Args:
        seeds: Whole numbers from 0, of any size.

    Returns:
        (m, 4) uint64: high and low half of each state, high and low half of each increment.

    Raises:
        OptionError: A seed is not a whole number from 0.
    """

def standard_normals(generators: _Rows, size: int) -> tuple[_Array, _Rows]:
    """Draws standard normal numbers as `numpy.random.Generator.standard_normal` does.

    Args:
        generators: Generators, (m, 4) uint64.
        size: Number of draws from each generator.

    Returns:
        The numbers, (m, size), and the generators after the draws, (m, 4) uint64.

    Raises:
        OptionError: An argument has a wrong shape or type.
    """

def disk_packing(
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
    """Initial state for a bed: disks in loose rows, without overlap.

    The radii are drawn uniformly from their range. The defaults give the bed of the 2010 report:
    three layers of 74 disks.

    Args:
        count: Number of disks, at most 1 000 000.
        radius_min: Smallest radius, m.
        radius_max: Largest radius, m.
        mass: Mass of a disk of the mean radius, kg; masses are proportional to area.
        left: Left edge, m.
        width: Width of the rows, m.
        bottom: Height of the lower edge, m.
        seed: Seed of the random numbers; equal seeds give equal disks.

    Returns:
        Radii, (n,), m, masses, (n,), kg, and centres, (n, 2), m.

    Raises:
        ModelError: A number is not finite or out of its range, `radius_max` is below `radius_min`,
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
    """Initial state for a bed: balls in loose layers over a rectangle, without overlap.

    The radii are drawn uniformly from their range.

    Args:
        count: Number of balls, at most 1 000 000.
        radius_min: Smallest radius, m.
        radius_max: Largest radius, m.
        mass: Mass of a ball of the mean radius, kg; masses are proportional to volume.
        width: Width of the rectangle along x, m.
        depth: Width of the rectangle along z, m.
        left: Smallest x, m.
        back: Smallest z, m.
        bottom: Height of the lower edge, m.
        seed: Seed of the random numbers; equal seeds give equal balls.

    Returns:
        Radii, (n,), m, masses, (n,), kg, and centres, (n, 3), m.

    Raises:
        ModelError: A number is not finite or out of its range, `radius_max` is below `radius_min`,
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

    Each ball gets a place as wide as the largest ball. Layers are filled in the order of `radius`.

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
    """Result report of the contact solver."""
    @property
    def status(self) -> Literal["converged", "relaxed", "not_converged", "budget_exhausted"]:
        """Outcome of the solve, "converged", "relaxed", "not_converged" or "budget_exhausted".

        "relaxed": the convex relaxation is solved, which differs from Coulomb's law.
        "budget_exhausted": the `budget` is spent, and the best solution found is returned.
        """
    @property
    def is_converged(self) -> bool:
        """Whether Coulomb's law holds to the tolerance."""
    @property
    def iterations(self) -> int:
        """Iterations of the stage that found the solution."""
    @property
    def residual(self) -> float:
        """Violation of Signorini's and Coulomb's laws by the impulses, relative to the data."""
    @property
    def velocity_error(self) -> float:
        """Largest violation of Signorini's and Coulomb's laws at one contact, m/s."""
    @property
    def solver(self) -> str:
        """Name of the method that found the solution; never "auto"."""
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
        "pyramids",
        "proximal",
        "restarts",
        "interior_point",
        "admm",
        "relaxed",
    ]:
        """Name of the stage that found the solution; "at_rest" if q = 0 needed none."""
    @property
    def stages(self) -> list[tuple[str, str, int]]:
        """All stages tried, in order, each with the reason why it ended and its iterations.

        Reasons are "converged", "max_iterations", "stalled", "budget_exhausted", "non_finite" and
        "relaxed".
        """
    @property
    def work(self) -> int:
        """Work done, in the unit of the argument `budget`."""
    @property
    def law(self) -> Literal["coulomb", "relaxed"]:
        """The friction law of the solution, "coulomb" or "relaxed"."""

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
        """Report of the solver."""
    @property
    def history(self) -> list[tuple[str, int, float]]:
        """Residuals during the iterations; empty without the argument `history`.

        Each entry is a tuple of the stage, the number of iterations and the relative residual.
        "nsgs" and "admm" measure it every few iterations, the other methods in every iteration. For
        "relaxed" it is the residual of the relaxed law.
        """

def accuracy_options(accuracy: Literal["fast", "balanced", "reference"] | float) -> dict[str, Any]:
    """Options of `Simulation` for a given accuracy.

    Args:
        accuracy: "fast", "balanced" or "reference", or the error allowed on a path of 20 m on flat
            ground, m.

    Returns:
        The keyword arguments `time_step` (s), `variant` and `tolerance`.

    Raises:
        OptionError: The name is unknown, or no options reach the given error.
    """

@overload
def sin_cos(x: float) -> tuple[float, float]:
    """Sine and cosine of angles.

    Unlike the functions of NumPy and `math`, the results have the same bits on every computer. They
    are accurate to 1 ulp. Infinite and NaN arguments give NaN.

    Args:
        x: An angle, or an array of any shape, rad.

    Returns:
        Sine and cosine: two numbers, or two new arrays of the shape of x.

    Raises:
        OptionError: x is neither a number nor an array of numbers.
    """

@overload
def sin_cos(x: npt.NDArray[Any]) -> tuple[_Array, _Array]: ...
@overload
def atan2(y: float, x: float) -> float:
    """Polar angles of the points (x, y), in [-pi, pi].

    Unlike the functions of NumPy and `math`, the results have the same bits on every computer. They
    are accurate to 1 ulp.

    Args:
        y: A number or an array of any shape.
        x: The same; the two shapes must be equal.

    Returns:
        The angle, rad: a number, or a new array.

    Raises:
        OptionError: An argument is neither a number nor an array of numbers, or the shapes differ.
    """

@overload
def atan2(y: npt.NDArray[Any], x: npt.NDArray[Any]) -> _Array: ...
@overload
def exp(x: float) -> float:
    """Exponentials.

    Unlike the functions of NumPy and `math`, the results have the same bits on every computer. They
    are accurate to 1 ulp.

    Args:
        x: A number or an array of any shape.

    Returns:
        The exponential: a number, or a new array of the shape of x.

    Raises:
        OptionError: x is neither a number nor an array of numbers.
    """

@overload
def exp(x: npt.NDArray[Any]) -> _Array: ...
def solve_friction_contact(
    W: npt.ArrayLike | _SparseArray | tuple[npt.ArrayLike, npt.ArrayLike, npt.ArrayLike],
    q: npt.ArrayLike,
    mu: npt.ArrayLike,
    tolerance: float = 1e-08,
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
        W: Delassus operator, (n_c d, n_c d), 1/kg. It may be singular or unsymmetric. For many
            contacts, give a SciPy sparse array, or block rows `(indptr, indices, data)` of shapes
            (n_c + 1,), (n_blocks,), (n_blocks, d, d), with ascending columns and the diagonal block
            in each row.
        q: Free velocity, (n_c d,), m/s, contact by contact: normal, tangents.
        mu: Friction coefficients, (n_c,), or one for all contacts.
        tolerance: Largest relative residual of a converged solution. Errors of its velocities are
            at most max(tolerance, 1e-9) m/s as well.
        dimension: Components d of a contact, 2 or 3.
        solver: "auto" tries cheap methods first and robust ones last; "nsgs", "newton", "proximal"
            and "admm" are single methods for Coulomb's law; "relaxed" solves the convex relaxation,
            which is another law, and its status is never "converged".
        max_iterations: Largest number of Newton steps, sweeps or ADMM iterations.
        initial: Impulses from which the solver starts, (n_c d,), N s; zero by default.
        budget: Largest amount of work, in operations rather than time: a unit is one multiplication
            and addition in a product with W. The default is 3e8 units, about 0.3 s, for up to 64
            contacts, 1.2e9 for up to 200, and proportional to the square of their number beyond.
            When the budget is spent, the solver stops with the status "budget_exhausted".
        history: Whether to record the residuals of the iterations.

    Returns:
        Impulses, velocities and the solver's report. If the solver does not converge, no exception
        is raised: check `report.status`.

    Raises:
        ProblemError: An array has a wrong shape or an invalid entry.
        OptionError: The solver or the dimension is unknown, or `tolerance`, `max_iterations` or
            `budget` is out of its range.

    Source: Acary and Brogliato 2008; Acary, Brémond and Huber 2018.
    """
