"""Compiled core of rover-gym: the border to the Rust mechanics (`rover-core`).

SI units and radians everywhere. World frame: x forward, y up, z to the right. Wheels are always
listed FL, FR, ML, BL, MR, BR.
"""

from collections.abc import Mapping, Sequence
from os import PathLike
from typing import Any, Literal, TypeAlias, final, overload

import numpy as np
import numpy.typing as npt
from typing_extensions import disjoint_base

_Array: TypeAlias = npt.NDArray[np.float64]
_Coordinates: TypeAlias = Literal["report", "state"]

__all__ = [
    "BallSimulation",
    "BusyError",
    "CommandError",
    "Contacts",
    "Energy",
    "FrictionContactSolution",
    "Line",
    "MirroredRoverSimulation",
    "ModelError",
    "Motor",
    "OptionError",
    "PlanarContacts",
    "PlanarSimulation",
    "PlanarSnapshot",
    "Plane",
    "Polyline",
    "ProblemError",
    "RoverGymError",
    "RoverModel",
    "Simulation",
    "SimulationBatch",
    "Sine",
    "Snapshot",
    "SoilContacts",
    "SoilSimulation",
    "SoilSnapshot",
    "SolverReport",
    "SphereField",
    "Spline",
    "StateError",
    "StepError",
    "StepReport",
    "TerrainError",
    "TwoWheelRoverSimulation",
    "__version__",
    "accuracy_options",
    "soil_packing",
    "solve_friction_contact",
]

__version__: str

class RoverGymError(Exception):
    """Root of every error that rover-gym raises. `field` names the culprit, `value` is what was given."""

    field: str | None
    value: object

class ModelError(RoverGymError, ValueError):
    """A model description is not physical or not readable."""

class StateError(RoverGymError, ValueError):
    """A state (q, velocities, snapshot) has a wrong shape or a non-finite entry."""

class TerrainError(RoverGymError, ValueError):
    """A terrain description is invalid."""

class OptionError(RoverGymError, ValueError):
    """A simulation option or an argument is out of its range."""

class CommandError(RoverGymError, ValueError):
    """A torque, set-point or action is invalid."""

class ProblemError(RoverGymError, ValueError):
    """A friction-contact problem (W, q, mu) has wrong shapes or entries."""

class StepError(RoverGymError, RuntimeError):
    """A time step could not be taken; the state is as it was before the call."""

class BusyError(RoverGymError, RuntimeError):
    """An object was used while another call on it was still going on; nothing has changed."""

@final
class Motor:
    """The torque-speed line of a wheel's motor. Immutable.

    The torque is the command, but within `stall (1 - speed / no_load_speed)` forwards, `-stall (1 + speed /
    no_load_speed)` backwards, and `stall` either way.

    Args:
        stall_torque: Of the line at rest, N m.
        no_load_speed: Where the line reaches zero, rad/s; may be infinite: then the speed does not matter.
        regenerating: Whether it brakes when it is driven faster than that, by the line and at most by the stall torque;
            if not, it turns freely there.

    Raises:
        ModelError: `stall_torque` is not from 1e-9 to 1e9 N m, or `no_load_speed` neither from 1e-6 to 1e9 rad/s nor
            infinite.
    """

    def __new__(cls, stall_torque: float, no_load_speed: float, regenerating: bool = True) -> Motor: ...
    @property
    def stall_torque(self) -> float: ...
    @property
    def no_load_speed(self) -> float: ...
    @property
    def regenerating(self) -> bool: ...
    def torque(self, command: float, speed: float) -> float:
        """N m that a command (N m) gives at a speed (rad/s). Raises CommandError for what is not finite."""
    def __getnewargs__(self) -> tuple[float, float, bool]: ...
    def __eq__(self, other: object, /) -> bool: ...
    def __hash__(self) -> int: ...

@final
class RoverModel:
    """A tree of solids under a free base, read from data. Immutable."""

    def __new__(cls) -> RoverModel: ...
    @staticmethod
    def from_file(path: str | Any) -> RoverModel: ...
    @staticmethod
    def from_text(text: str) -> RoverModel: ...
    @staticmethod
    def from_dict(description: Mapping[str, Any]) -> RoverModel: ...
    def to_file(self, path: str | Any) -> None: ...
    def to_text(self) -> str: ...
    def to_dict(self) -> dict[str, Any]: ...
    def replace(
        self,
        *,
        wheel_radius: float | None = None,
        contact_radius: float | None = None,
        masses: Mapping[str, float] | Sequence[float] | None = None,
        steering_stiffness: float | None = None,
        steering_damping: float | None = None,
        wheel_torque_limit: float | None = None,
        mass_scale: float | None = None,
        motor: Motor | Mapping[str, Any] | None = ...,
    ) -> RoverModel:
        """A model that differs in what is given.

        Args:
            wheel_radius: Of all wheels, m: shape, inertia and contact change together.
            contact_radius: Radius at which the wheels touch the ground, m; shape and inertia stay as they are.
            masses: kg, by solid or one for each. Inertias go with them.
            steering_stiffness: N m/rad.
            steering_damping: N m s/rad.
            wheel_torque_limit: N m.
            mass_scale: Multiplies masses and inertias.
            motor: Of all wheels: a `Motor`, or its fields by name; None for none: each wheel gives its command at any
                speed. If it is not given, the motors stay.

        Raises:
            ModelError: A number out of its range, or a wheel radius where a wheel's solid is no disc.
        """
    def weld(self, joints: Mapping[str, float] | Sequence[str] | str) -> RoverModel:
        """The same machine with joints locked at 0, or at the given angles (rad), also in files and dictionaries."""
    @property
    def name(self) -> str: ...
    @property
    def nq(self) -> int: ...
    @property
    def nv(self) -> int: ...
    @property
    def mass(self) -> float: ...
    @property
    def dof_names(self) -> list[str]: ...
    @property
    def joint_names(self) -> list[str]: ...
    @property
    def solid_names(self) -> list[str]: ...
    @property
    def wheel_names(self) -> list[str]: ...
    @property
    def wheel_radii(self) -> _Array: ...
    @property
    def wheel_torque_limits(self) -> _Array: ...
    @property
    def motors(self) -> list[Motor | None]:
        """The motor of each wheel; None where the torque is the command at any speed."""
    @property
    def wheel_joint_indices(self) -> list[int]:
        """Index in q of each wheel's rotation (-1 where welded)."""
    @property
    def steering_joint_indices(self) -> list[int]:
        """Index in q of each wheel's steering joint (-1 where there is none or it is welded)."""
    @property
    def steering_limit(self) -> float:
        """Largest steering set-point, rad, either way."""
    def mass_matrix(self, q: npt.ArrayLike, coordinates: _Coordinates = "state") -> _Array: ...
    def bias(
        self,
        q: npt.ArrayLike,
        qdot: npt.ArrayLike,
        gravity: npt.ArrayLike | None = None,
        coordinates: _Coordinates = "state",
    ) -> _Array: ...
    def actuation_matrix(self) -> _Array: ...
    def kinetic_energy(self, q: npt.ArrayLike, qdot: npt.ArrayLike, coordinates: _Coordinates = "state") -> float: ...
    def tags(self, q: npt.ArrayLike, coordinates: _Coordinates = "state") -> dict[str, _Array]: ...
    def poses(self, q: npt.ArrayLike, coordinates: _Coordinates = "state") -> dict[str, tuple[_Array, _Array]]:
        """Origin (3,) and rotation matrix (3, 3) of every solid, world frame."""
    def wheel_gaps(
        self, q: npt.ArrayLike, terrain: Plane | SphereField, coordinates: _Coordinates = "state"
    ) -> _Array: ...
    def wheel_contact_points(
        self, q: npt.ArrayLike, terrain: Plane | SphereField, coordinates: _Coordinates = "state"
    ) -> _Array: ...
    def wheel_jacobians(
        self, q: npt.ArrayLike, terrain: Plane | SphereField, coordinates: _Coordinates = "state"
    ) -> _Array: ...
    def to_report(self, q: npt.ArrayLike, v: npt.ArrayLike) -> tuple[_Array, _Array]:
        """Public q and state velocity -> the report's q and qdot."""
    def from_report(self, q: npt.ArrayLike, qdot: npt.ArrayLike) -> tuple[_Array, _Array]:
        """The report's q and qdot -> public q and state velocity."""
    def __reduce__(self) -> Any: ...

@final
class Plane:
    """The half-space n.x + offset >= 0 is free; the ground is below. `normal` (default: up) is normalised.

    A normal of unit length is taken as it is, so a plane's own normal and offset make the same plane, to the bit.

    Raises:
        TerrainError: A number is not finite, the normal has no direction, the offset is beyond 1e6 m.
    """

    def __new__(cls, normal: npt.ArrayLike | None = None, offset: float = 0.0) -> Plane: ...
    @property
    def normal(self) -> _Array: ...
    @property
    def offset(self) -> float: ...
    def height(self, x: float, z: float) -> float: ...
    def __reduce__(self) -> Any: ...

@final
class SphereField:
    """Fixed spheres, with or without a plane under them. Immutable."""

    def __new__(cls, centres: npt.ArrayLike, radii: npt.ArrayLike, ground: Plane | None = None) -> SphereField:
        """From centres (n, 3) and radii (n,), m. Raises TerrainError by field."""
    @staticmethod
    def from_file(path: str | PathLike[str], ground: Plane | None = None) -> SphereField:
        """Reads a CSV file with the header x,y,z,radius (m)."""
    @staticmethod
    def rug() -> SphereField:
        """The report's Fig. 6.6: 50 x 25 spheres of radius 0.5 m on a wave, without a plane."""
    @staticmethod
    def rocks(
        abundance: float,
        area: Sequence[float],
        seed: int,
        *,
        max_diameter: float = 0.5,
        min_diameter: float = 0.05,
        burial: float | tuple[float, float] | None = None,
        ground: Plane | None = None,
        clear: npt.ArrayLike | None = None,
    ) -> SphereField:
        """Rocks with the size-frequency distribution of Mars on a plane (Golombek and Rapp 1997).

        Args:
            abundance: Fraction of the ground that rocks of all sizes cover, 0 to 0.5.
            area: x_min, z_min, x_max, z_max, m.
            seed: Equal seeds give equal rocks.
            max_diameter: m.
            min_diameter: m; the law has ever more, ever smaller rocks.
            burial: Fraction of its diameter that a rock is sunk into the ground, 0 to 0.5, or a range to draw it from
                for each rock; 0.5 by default.
            ground: The plane; flat ground at height 0 by default.
            clear: (n, 3) circles x, z, radius that no rock reaches into, m.
        """
    @property
    def centres(self) -> _Array: ...
    @property
    def radii(self) -> _Array: ...
    @property
    def ground(self) -> Plane | None: ...
    def heights(self, points: npt.ArrayLike) -> _Array:
        """(m,) height y of the visible surface at the points (x, z) (m, 2); nan where there is none."""
    def __len__(self) -> int: ...
    def __reduce__(self) -> Any: ...

@final
class StepReport:
    """What the solver says of the steps just taken (worst over the steps of one call)."""

    @property
    def status(self) -> Literal["converged", "not_converged"]: ...
    @property
    def is_converged(self) -> bool: ...
    @property
    def steps(self) -> int: ...
    @property
    def iterations(self) -> int: ...
    @property
    def newton_iterations(self) -> int: ...
    @property
    def residual(self) -> float: ...
    @property
    def n_contacts(self) -> int: ...
    @property
    def retaken(self) -> int:
        """Steps taken again: a motor changed its branch, or the energy asked for implicit gyroscopic terms."""
    @property
    def energy_gain(self) -> float:
        """Largest gain in a step beyond the work of gravity and actuators, over the kinetic energy."""
    @property
    def energy_removed(self) -> float:
        """J that the scheme would have gained and that the audit took out, summed over the steps."""
    @property
    def energy_lifted(self) -> float:
        """J that lifting out of penetration gave, summed over the steps."""

@final
class Contacts:
    """The contacts of the last step, as fresh arrays with one row a contact."""

    @property
    def bodies(self) -> list[str]:
        """Name of the solid that touches."""
    @property
    def wheels(self) -> npt.NDArray[np.int64]:
        """(n,) wheel index 0..5, or -1 for the trunk."""
    @property
    def points(self) -> _Array:
        """(n, 3) m, world."""
    @property
    def frames(self) -> _Array:
        """(n, 3, 3): rows are the unit vectors n, t, b, world."""
    @property
    def gaps(self) -> _Array:
        """(n,) m, at the configuration where the step's contact was evaluated."""
    @property
    def impulses(self) -> _Array:
        """(n, 3) N s, along n, t, b."""
    @property
    def velocities(self) -> _Array:
        """(n, 3) m/s after the step, along n, t, b."""
    def __len__(self) -> int: ...

@final
class Energy:
    @property
    def kinetic(self) -> float: ...
    @property
    def potential(self) -> float: ...
    @property
    def total(self) -> float: ...

@final
class Snapshot:
    """Everything that a simulation needs to continue bit for bit; picklable."""

    @staticmethod
    def from_bytes(data: bytes) -> Snapshot: ...
    def to_bytes(self) -> bytes: ...
    def __reduce__(self) -> Any: ...
    def __eq__(self, other: object, /) -> bool: ...
    def __hash__(self) -> int: ...

@final
class Simulation:
    def __new__(
        cls,
        model: RoverModel | None = None,
        terrain: Plane | SphereField | None = None,
        *,
        gravity: npt.ArrayLike | None = None,
        friction: float = 0.7,
        restitution: float = 0.0,
        time_step: float | None = None,
        variant: Literal["linearised", "newton"] | None = None,
        theta: float = 0.5,
        forecast: float = 0.5,
        solver: Literal["auto", "nsgs", "newton", "proximal", "admm"] = "auto",
        tolerance: float | None = None,
        max_iterations: int = 1000,
        stabilisation: Literal["projection", "none"] = "projection",
        warm_start: bool = True,
        accuracy: Literal["fast", "balanced", "reference"] | float | None = None,
    ) -> Simulation:
        """A rover on a terrain.

        Args:
            model: The machine; the built-in rover by default.
            terrain: Flat ground by default.
            gravity: (3,) m/s2; (0, -9.81, 0) by default.
            friction: Coulomb's coefficient of every contact.
            restitution: Newton's, in [0, 1].
            time_step: s; 0.005 by default.
            variant: "linearised" by default; "newton" solves for the forces at the end of the step.
            theta: Weight of the step's end, in [0.5, 1].
            forecast: A contact takes part where gap + forecast h u_N <= 0.
            solver: Of the contact problem.
            tolerance: Relative, of the contact solver; 1e-12 by default.
            max_iterations: Of the contact solver.
            stabilisation: What is done about penetration.
            warm_start: Whether the solver starts from the last step's impulses.
            accuracy: Chooses time_step, variant and tolerance, which then cannot be given: by name, or by the error (m)
                allowed on a path of 20 m on flat ground. docs/accuracy.md says what each costs and gives.

        Raises:
            OptionError: An option is out of its range, or is given beside `accuracy`.
        """
    @property
    def model(self) -> RoverModel: ...
    @property
    def terrain(self) -> Plane | SphereField: ...
    @property
    def time(self) -> float: ...
    @property
    def time_step(self) -> float: ...
    @property
    def gravity(self) -> _Array: ...
    @property
    def friction(self) -> float: ...
    @property
    def restitution(self) -> float: ...
    @property
    def settings(self) -> dict[str, Any]:
        """The keyword arguments that make a simulation with these options."""
    @property
    def q(self) -> _Array:
        """(nq,) x, y, z, roll, heading, pitch, joints."""
    @property
    def v(self) -> _Array:
        """(nv,) trunk velocity (world, m/s), angular velocity (world, rad/s), joint rates."""
    @property
    def rotation(self) -> _Array:
        """(3, 3) trunk attitude R_WB."""
    def set_state(
        self, q: npt.ArrayLike, qdot: npt.ArrayLike | None = None, *, coordinates: _Coordinates = "state"
    ) -> None:
        """Sets q and velocity ("state": as `q` and `v` return them). Time goes to 0, warm start is dropped."""
    def report_state(self) -> tuple[_Array, _Array]: ...
    @property
    def wheel_torques(self) -> _Array:
        """(6,) N m, positive drives forward: the commands, within the model's limits."""
    @property
    def motor_torques(self) -> _Array:
        """(6,) N m, positive drives forward: mean torque that each drive gave in the last step; 0 before any.

        It is the command, within the line of the wheel's `Motor`.
        """
    def set_wheel_torques(self, torques: npt.ArrayLike) -> None:
        """(6,) N m, positive drives forward; saturates at the model's limits."""
    @property
    def steering(self) -> _Array: ...
    def set_steering(self, set_points: npt.ArrayLike) -> None:
        """(6,) rad, held by the implicit PD with the model's gains."""
    def set_commands(self, torques: npt.ArrayLike, set_points: npt.ArrayLike) -> None:
        """`set_wheel_torques` and `set_steering` in one: both, or neither where either is refused."""
    def set_joint_torques(self, torques: npt.ArrayLike) -> None:
        """(nv - 6,) N m about the joint axes, added to what set_wheel_torques gives; no limit."""
    def hold(
        self,
        joints: str | Sequence[str],
        set_points: npt.ArrayLike | None = None,
        *,
        stiffness: float | None = None,
        damping: float | None = None,
    ) -> None:
        """Holds joints at set-points (default: where they are) by the implicit PD (default: the model's gains)."""
    def release(self, joints: str | Sequence[str]) -> None: ...
    def brake(self) -> None:
        """Holds the six wheels where they are (`hold` on the wheel joints), and zeroes their torques."""
    def step(self, n: int = 1) -> StepReport:
        """Takes n steps.

        Other threads run meanwhile; on this object their calls are refused with BusyError. Ctrl-C, or whatever a signal
        handler raises, ends the call after a whole step, whose state stays.

        Raises:
            StepError: A step could not be taken; the state before it stays.
        """
    @property
    def contacts(self) -> Contacts: ...
    @property
    def wheel_gaps(self) -> _Array:
        """(6,) m at the current state."""
    @property
    def wheel_forces(self) -> _Array:
        """(6, 3) N: mean contact force of the last step along n, t, b of each wheel's frame."""
    @property
    def trunk_force(self) -> float:
        """N: mean normal force on trunk and beams in the last step (high-centred if large)."""
    @property
    def deepest_overlap(self) -> float:
        """Deepest gap of any wheel or box with the ground now, m: 0 where nothing overlaps, else negative."""
    def reading(self, target: Sequence[float] | None = None, scan: npt.ArrayLike | None = None) -> _Array:
        """All that a controller looks at as one fresh row; `reading_layout` names its parts.

        `solver`, `work` and `positive_work` are those of the last call of `step`. `target`: a place on the map (x, z),
        m; the origin by default. `scan` (n, 2): points ahead and to the right of the trunk's origin in the heading
        frame, m, whose heights over the origin come last.
        """
    def reading_layout(self, n_scan: int = 0) -> dict[str, slice]:
        """Names and places of the numbers in a reading."""
    def energy(self) -> Energy: ...
    def momentum(self) -> tuple[_Array, _Array]:
        """Linear (3,) kg m/s and angular momentum about the world origin (3,) kg m2/s."""
    def centre_of_mass(self) -> _Array: ...
    def tags(self) -> dict[str, _Array]: ...
    def poses(self) -> dict[str, tuple[_Array, _Array]]: ...
    def snapshot(self) -> Snapshot: ...
    def restore(self, snapshot: Snapshot) -> None: ...
    def last_problem(self) -> tuple[_Array, _Array, _Array]:
        """W (n, n), free velocity (n,) and friction (n_c,) of the last step's friction-contact problem."""
    def profile(self, n: int = 1000) -> dict[str, float]:
        """Mean microseconds per step by part (kinematics, mass_matrix, factor, ...) over n steps of a copy."""
    def __reduce__(self) -> Any: ...

@final
class Line:
    """The ground y = slope x + offset (m) of a planar scene; x forward, y up.

    Raises:
        TerrainError: A number is not finite, the slope is beyond 1000 or the offset beyond 1e6 m.
    """

    def __new__(cls, slope: float = 0.0, offset: float = 0.0) -> Line: ...
    @property
    def slope(self) -> float: ...
    @property
    def offset(self) -> float: ...
    @overload
    def height(self, x: float) -> float: ...
    @overload
    def height(self, x: Sequence[float] | _Array) -> _Array: ...
    def __reduce__(self) -> Any: ...

@final
class Sine:
    """The ground y = amplitude sin(2 pi x / wavelength + phase) + offset, m.

    Raises:
        TerrainError: A number is not finite, the wavelength is below 1e-3 m, the slope 2 pi amplitude / wavelength
            beyond 1000.
    """

    def __new__(cls, amplitude: float, wavelength: float, phase: float = 0.0, offset: float = 0.0) -> Sine: ...
    @property
    def amplitude(self) -> float: ...
    @property
    def wavelength(self) -> float: ...
    @property
    def phase(self) -> float: ...
    @property
    def offset(self) -> float: ...
    @overload
    def height(self, x: float) -> float: ...
    @overload
    def height(self, x: Sequence[float] | _Array) -> _Array: ...
    def __reduce__(self) -> Any: ...

@final
class Spline:
    """The natural cubic spline through points (m), continued by its tangents: a ground with continuous curvature.

    Raises:
        TerrainError: Fewer than two points or more than 2 000 000, lengths that differ, an entry that is not finite or
            beyond 1e6 m, x that does not increase.
    """

    def __new__(cls, x: npt.ArrayLike, y: npt.ArrayLike) -> Spline: ...
    @property
    def x(self) -> _Array: ...
    @property
    def y(self) -> _Array: ...
    @overload
    def height(self, x: float) -> float: ...
    @overload
    def height(self, x: Sequence[float] | _Array) -> _Array: ...
    def __reduce__(self) -> Any: ...

@final
class Polyline:
    """Straight pieces between points (m), which may stand above each other: steps, ramps, kerbs, with corners.

    Raises:
        TerrainError: Fewer than two points or more than 2 000 000, lengths that differ, an entry that is not finite or
            beyond 1e6 m, x that decreases, a point twice.
    """

    def __new__(cls, x: npt.ArrayLike, y: npt.ArrayLike) -> Polyline: ...
    @staticmethod
    def step(x: float, height: float) -> Polyline:
        """Level ground at height 0 with a step up (or down, if negative) at x, m."""
    @property
    def x(self) -> _Array: ...
    @property
    def y(self) -> _Array: ...
    @overload
    def height(self, x: float) -> float: ...
    @overload
    def height(self, x: Sequence[float] | _Array) -> _Array: ...
    def __reduce__(self) -> Any: ...

@final
class PlanarContacts:
    """The contacts of a planar simulation's last step, as fresh arrays with one row a contact."""

    @property
    def discs(self) -> npt.NDArray[np.int64]:
        """(n,) which disc touches: 0 the ball or wheel A, 1 wheel B."""
    @property
    def points(self) -> _Array:
        """(n, 2) points of the ground, world, m."""
    @property
    def normals(self) -> _Array:
        """(n, 2) unit normals out of the ground; the tangent is (n_y, -n_x)."""
    @property
    def gaps(self) -> _Array:
        """(n,) m."""
    @property
    def impulses(self) -> _Array:
        """(n, 2) along normal and tangent, N s."""
    @property
    def velocities(self) -> _Array:
        """(n, 2) of the rim against the ground after the step, along normal and tangent, m/s."""
    def __len__(self) -> int: ...

@final
class PlanarSnapshot:
    """Everything that a planar simulation needs to continue bit for bit; picklable."""

    @staticmethod
    def from_bytes(data: bytes) -> PlanarSnapshot: ...
    def to_bytes(self) -> bytes: ...
    def __eq__(self, other: object, /) -> bool: ...
    def __hash__(self) -> int: ...
    def __reduce__(self) -> Any: ...

@disjoint_base
class PlanarSimulation:
    """A planar machine on a ground, stepped by the rover's own schemes: what the two kinds below share."""

    @property
    def ground(self) -> Line | Sine | Spline | Polyline: ...
    @property
    def time(self) -> float: ...
    @property
    def time_step(self) -> float: ...
    @property
    def q(self) -> _Array:
        """(nv,) coordinates: m, m, then rad; angles turn to the left."""
    @property
    def v(self) -> _Array:
        """(nv,) their rates."""
    @property
    def centres(self) -> _Array:
        """(n_discs, 2) centres of the ball or of wheels A, B, world, m."""
    @property
    def gaps(self) -> _Array:
        """(n_discs,) distance to the ground now, m; negative where they overlap."""
    @property
    def torques(self) -> _Array: ...
    @property
    def parameters(self) -> dict[str, Any]:
        """The keyword arguments that describe the machine."""
    @property
    def settings(self) -> dict[str, Any]:
        """The keyword arguments that make a simulation with these options."""
    def set_state(self, q: npt.ArrayLike, v: npt.ArrayLike | None = None) -> None:
        """Sets coordinates and rates (default: at rest). Time goes to 0, warm start is dropped, torques stay."""
    def set_torques(self, torques: npt.ArrayLike) -> None:
        """(n_discs,) N m, positive drives forward; the rover's act between body and wheels."""
    def step(self, n: int = 1) -> StepReport: ...
    @property
    def contacts(self) -> PlanarContacts: ...
    def energy(self) -> Energy: ...
    def mass_matrix(self) -> _Array:
        """(nv, nv) at the current state."""
    def last_problem(self) -> tuple[_Array, _Array, _Array]:
        """W (n, n), free velocity (n,) and friction (n_c,) of the last step's friction-contact problem."""
    def snapshot(self) -> PlanarSnapshot: ...
    def restore(self, snapshot: PlanarSnapshot) -> None: ...
    def __reduce__(self) -> Any: ...

@final
class BallSimulation(PlanarSimulation):
    """A disc on a ground: coordinates x, y (centre, m) and theta (rad).

    `inertia` (kg m2) is a homogeneous disc's if not given. Options as `Simulation`'s, but for gravity (x, y), and
    `contact`: "nearest" (the disc touches where the ground is nearest to its centre) or "centre_height" (the
    report's: the centre itself stops at the ground).

    Raises:
        ModelError: Mass, radius or inertia is not finite and positive.
        TerrainError: `ground` is none.
        OptionError: An option is out of its range.
    """

    def __new__(
        cls,
        ground: Line | Sine | Spline | Polyline,
        *,
        mass: float = 3.0,
        radius: float = 1.5,
        inertia: float | None = None,
        **options: Any,
    ) -> BallSimulation: ...

@final
class TwoWheelRoverSimulation(PlanarSimulation):
    """Body and two driven wheels: coordinates x, y (body's mass centre, m), theta, theta_A, theta_B (rad).

    A is the back wheel, B the front one; their angles are absolute. `wheel_*` take one number or one a wheel. `axle_a`,
    `axle_b`: axles relative to the body's mass centre in its own axes, m; (-0.4, 0) and (0.4, 0) if not given.
    `inertia` is a rod's from axle to axle and `wheel_inertia` a disc's if not given. Defaults are the scale of the
    report's granular run. Options as `BallSimulation`'s.

    Raises:
        ModelError: A mass, radius or inertia is not finite and positive, or the wheels overlap.
        TerrainError: `ground` is none.
        OptionError: An option is out of its range.
    """

    def __new__(
        cls,
        ground: Line | Sine | Spline | Polyline,
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
    """The six-wheel rover driven straight, in its plane of symmetry: x, y, theta, then a joint angle a pair.

    `model` must be its own mirror image about the trunk's x-y plane; the built-in rover if not given. Its joints that
    do not turn about z are locked at zero. Torques: one a pair, of each of its wheels; they saturate at the model's
    limits. Only wheels touch the ground. Options as `BallSimulation`'s.

    Raises:
        ModelError: The model has no planar image, or one that has not 7 coordinates.
        TerrainError: `ground` is none.
        OptionError: An option is out of its range.
    """

    def __new__(
        cls, ground: Line | Sine | Spline | Polyline, *, model: RoverModel | None = None, **options: Any
    ) -> MirroredRoverSimulation: ...
    @property
    def joints(self) -> list[list[str]]:
        """Names of the joints that share each coordinate from the fourth on."""
    @property
    def wheels(self) -> list[list[str]]:
        """Names of the wheels of each disc."""

@final
class SimulationBatch:
    """Many rovers stepped side by side on several threads, bit for bit as each would be alone."""

    def __new__(
        cls, simulations: Sequence[Simulation], *, scan: npt.ArrayLike | None = None, threads: int | None = None
    ) -> SimulationBatch:
        """Copies the simulations, whose models must be of one size. `threads`: None for one a core."""
    @property
    def threads(self) -> int: ...
    @property
    def reading_layout(self) -> dict[str, slice]:
        """Names and places of the numbers in a row of readings."""
    def step(
        self,
        torques: npt.ArrayLike,
        set_points: npt.ArrayLike,
        n: int = 1,
        *,
        active: npt.NDArray[np.bool_] | None = None,
    ) -> tuple[_Array, dict[int, str]]:
        """Commands (n_rovers, 6) as `set_wheel_torques` and `set_steering` take them, then n steps.

        Rovers that are not `active` keep still. Returns a fresh row of readings a rover, and why a rover could not
        take a step, by its number; the others have gone on. Ctrl-C ends the call after a whole step of each rover, not
        the same one for all.
        """
    def readings(self) -> _Array:
        """(n_rovers, size) as the rovers are now."""
    def replace(self, index: int, simulation: Simulation, target: Sequence[float] | None = None) -> None:
        """Puts a copy of a simulation, with its own terrain, in a place. `target` (x, z): what its readings look at."""
    def simulation(self, index: int) -> Simulation:
        """A copy of one rover, to look at."""
    def __len__(self) -> int: ...

@final
class SoilContacts:
    """Contacts of a soil's last step, one row each; those between disks that sleep are not in it."""

    @property
    def bodies(self) -> npt.NDArray[np.int64]:
        """(n, 2) numbers of both bodies: disks from 0, then the wheels; -1 for a wall or the ground."""
    @property
    def points(self) -> npt.NDArray[np.float64]:
        """(n, 2) where the first body's rim touches, m."""
    @property
    def normals(self) -> npt.NDArray[np.float64]:
        """(n, 2) unit normals, from the second body into the first."""
    @property
    def gaps(self) -> npt.NDArray[np.float64]:
        """(n,) at the start of the step, m; negative where bodies overlap."""
    @property
    def impulses(self) -> npt.NDArray[np.float64]:
        """(n, 2) on the first body along the normal and the tangent (n_y, -n_x), N s."""
    @property
    def velocities(self) -> npt.NDArray[np.float64]:
        """(n, 2) of the first body against the second after the step, along normal and tangent, m/s."""
    @property
    def world_impulses(self) -> npt.NDArray[np.float64]:
        """(n, 2) on the first body along x and y, N s."""
    def __len__(self) -> int: ...

@final
class SoilSnapshot:
    """Everything that a soil needs to continue bit for bit; picklable."""

    @staticmethod
    def from_bytes(data: bytes) -> SoilSnapshot: ...
    def to_bytes(self) -> bytes: ...

@final
class SoilSimulation:
    """Free disks with friction, between walls or on a ground, and perhaps a machine that drives over them.

    Args:
        radius: (n,) m.
        mass: (n,) kg; the disks are solid.
        position: (n, 2) centres or (n, 3) with angles, m and rad.
        kinematic: (n,) disks whose velocity nothing changes, as grains glued to a rough floor, or a piston with the
            velocity that `set_state` gives it; none if not given. They may overlap one another and walls.
        walls: (n, 4) a point of each wall and the normal to its free side.
        ground: A ground of any shape.
        rover: Keyword arguments of `TwoWheelRoverSimulation` that describe a rover, such as its `parameters`.
        rig: Mass (kg) and radius (m) of one wheel whose forward speed and turning rate nothing changes.
        machine: (5,) coordinates of the rover (x, y, theta, theta_A, theta_B) or the rig (x, y, -, theta, -).
        friction: Coulomb's coefficient between disks.
        wall_friction: Of disks against walls and ground.
        wheel_friction: Of wheels.
        restitution: Newton's coefficient of all contacts.
        gravity: (2,) m/s^2; (0, -9.81) if not given.
        time_step: s.
        tolerance: Of the contact solver, relative; its velocities are also right to ten times that in m/s, times the
            root of gravity over 9.81 m/s^2.
        max_iterations: Most sweeps of the contact solver in a step.
        stabilisation: "none" or "projection", which takes overlaps away and may add energy by lifting what lies above;
            if not given, "none" without restitution and "projection" with it, for what is struck away may hit others.
        penetration_tolerance: From which overlap on it projects, m; 0.5% of the smallest radius if not given.
        sleep: Whether disks sleep that rest far from anything that moves.
        sleep_speed: m/s below which a disk is still; 5e-4 if not given.
        sleep_distance: m within which nothing may move; 0.2 if not given.

    Raises:
        ModelError: A radius or mass is not finite and positive.
        StateError: Positions of a wrong shape or not finite; disks, walls, wheels that overlap.
        TerrainError: A wall without direction, or a ground that is none.
        OptionError: An option is out of its range.
    """

    def __new__(
        cls,
        radius: npt.ArrayLike,
        mass: npt.ArrayLike,
        position: npt.ArrayLike,
        *,
        kinematic: npt.ArrayLike | None = None,
        walls: npt.ArrayLike | None = None,
        ground: Line | Sine | Spline | Polyline | None = None,
        rover: dict[str, Any] | None = None,
        rig: npt.ArrayLike | None = None,
        machine: npt.ArrayLike | None = None,
        friction: float = 0.5,
        wall_friction: float = 0.5,
        wheel_friction: float = 0.9,
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
    def time(self) -> float: ...
    @property
    def time_step(self) -> float: ...
    @property
    def radius(self) -> npt.NDArray[np.float64]: ...
    @property
    def mass(self) -> npt.NDArray[np.float64]: ...
    @property
    def position(self) -> npt.NDArray[np.float64]:
        """(n, 3) x, y (m) and angle (rad) of each disk."""
    @property
    def velocity(self) -> npt.NDArray[np.float64]:
        """(n, 3) their rates, m/s and rad/s."""
    @property
    def kinematic(self) -> npt.NDArray[np.bool_]:
        """(n,) disks whose velocity nothing changes."""
    @property
    def asleep(self) -> npt.NDArray[np.bool_]:
        """(n,) which disks sleep; kinematic ones always do."""
    @property
    def machine(self) -> npt.NDArray[np.float64]:
        """(5,) the machine's coordinates; empty without one."""
    @property
    def machine_rate(self) -> npt.NDArray[np.float64]:
        """(5,) their rates; empty without a machine."""
    @property
    def wheels(self) -> npt.NDArray[np.float64]:
        """(n, 3) centre and radius of each wheel, m."""
    @property
    def torques(self) -> npt.NDArray[np.float64]: ...
    @property
    def pull(self) -> tuple[float, float]:
        """Force at the machine's centre, N."""
    @property
    def settings(self) -> dict[str, Any]:
        """The options, by the names of the arguments."""
    def set_state(
        self,
        position: npt.ArrayLike,
        velocity: npt.ArrayLike | None = None,
        machine: npt.ArrayLike | None = None,
        machine_rate: npt.ArrayLike | None = None,
    ) -> None:
        """Sets the state at time 0; rates are 0 and the machine stays where it is if not given."""
    def remove(self, which: npt.ArrayLike) -> None:
        """Takes the disks that `which` (n,) marks out; the others go on under new numbers in the same order.

        Raises:
            ModelError: Another number of marks, or no disk would be left.
        """
    def set_torques(self, torques: npt.ArrayLike) -> None:
        """(2,) N m of the rover's wheels, positive forward."""
    def set_pull(self, pull: npt.ArrayLike) -> None:
        """(2,) N at the machine's centre: a drawbar."""
    def step(self, n: int = 1) -> StepReport: ...
    @property
    def contacts(self) -> SoilContacts: ...
    def energy(self) -> Energy: ...
    def momentum(self) -> npt.NDArray[np.float64]:
        """(3,) momentum of the disks but kinematic ones (kg m/s), and its moment about the origin (kg m^2/s)."""
    def impulse_on_wheels(self) -> npt.NDArray[np.float64]:
        """(2,) of the last step's contacts, N s."""
    def penetration(self) -> float:
        """Deepest overlap now, m."""
    def wake(self) -> None:
        """Wakes all disks."""
    def snapshot(self) -> SoilSnapshot: ...
    def restore(self, snapshot: SoilSnapshot) -> None: ...

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
    """Radii (n,), masses (n,) and centres (n, 2) of disks in loose rows over a width, without overlap.

    Radii are drawn evenly from the range; `mass` is a disk's of the mean radius, others go with the area. The
    defaults are the original's soil: three layers of 74.

    Raises:
        ModelError: No disk or more than 1 000 000, a number that is not finite, of the wrong sign or out of its range,
            radii the wrong way round, no room for a disk.
    """

@final
class SolverReport:
    @property
    def status(self) -> Literal["converged", "relaxed", "not_converged", "budget_exhausted"]:
        """ "relaxed": the convex relaxation is solved, not Coulomb's law. "budget_exhausted": the work that `budget`
        allows was done; the answer is the nearest one known by then."""
    @property
    def is_converged(self) -> bool: ...
    @property
    def iterations(self) -> int: ...
    @property
    def residual(self) -> float:
        """Violation of Signorini's and Coulomb's laws relative to the data, computed from the returned impulses."""
    @property
    def velocity_error(self) -> float:
        """Largest violation of Signorini's and Coulomb's laws at one contact, m/s."""
    @property
    def solver(self) -> str:
        """The method that answered; never "auto"."""
    @property
    def stage(
        self,
    ) -> Literal[
        "at_rest",
        "sweeps",
        "body_sweeps",
        "islands",
        "warm_newton",
        "pivoting",
        "guided_newton",
        "newton",
        "proximal",
        "restarts",
        "admm",
        "relaxed",
    ]:
        """The stage that answered; "at_rest" where q = 0 left nothing to do."""
    @property
    def stages(self) -> list[tuple[str, str, int]]:
        """Every stage that was tried, in order: its name, why it ended ("converged", "max_iterations", "stalled",
        "budget_exhausted", "non_finite", "relaxed") and its iterations."""
    @property
    def work(self) -> int:
        """Work done, in the unit of `budget`."""
    @property
    def law(self) -> Literal["coulomb", "relaxed"]:
        """The law that the answer obeys."""

@final
class FrictionContactSolution:
    @property
    def impulses(self) -> _Array: ...
    @property
    def velocities(self) -> _Array: ...
    @property
    def report(self) -> SolverReport: ...

def accuracy_options(accuracy: Literal["fast", "balanced", "reference"] | float) -> dict[str, Any]:
    """The keyword arguments time_step, variant and tolerance of `Simulation` that an accuracy stands for."""

def solve_friction_contact(
    W: npt.ArrayLike | tuple[npt.ArrayLike, npt.ArrayLike, npt.ArrayLike],
    q: npt.ArrayLike,
    mu: npt.ArrayLike,
    tolerance: float = 1e-8,
    *,
    dimension: Literal[2, 3] = 3,
    solver: Literal["auto", "nsgs", "newton", "proximal", "admm", "relaxed"] = "auto",
    max_iterations: int = 1000,
    initial: npt.ArrayLike | None = None,
    budget: int = 300000000,
) -> FrictionContactSolution:
    """Solves K* contains W p + q + mu |u_T| n, perpendicular to p in K, for any W (n_c d, n_c d).

    Args:
        W: Delassus operator, 1/kg, used as it is (it need not be symmetric or regular). For many contacts its block
            rows ``(indptr (n_c + 1,), indices (n_blocks,), data (n_blocks, d, d))``: each row ascending, with its
            diagonal block.
        q: Free velocity (n_c d,), m/s, contact by contact: normal, tangent (, tangent).
        mu: Friction coefficients (n_c,).
        tolerance: Largest relative residual of a converged answer; its velocities are also right to
            max(tolerance, 1e-9) m/s.
        dimension: Components of a contact, 2 or 3.
        solver: "auto" escalates from what is cheap to what is robust; "nsgs", "newton", "proximal", "admm" are single
            methods of Coulomb's law; "relaxed" solves its convex relaxation, another law, and so never counts as
            converged.
        max_iterations: Most Newton steps, sweeps or ADMM iterations.
        initial: Warm start (n_c d,), N s.
        budget: Most work, counted and not timed: one unit is a multiplication with its addition in a product with W.
            The default takes about 0.3 s. What it does not allow is left undone, and the report says so.

    Raises:
        ProblemError: Wrong shapes or entries.
        OptionError: Unknown solver or dimension; tolerance, max_iterations or budget out of range.
    """
