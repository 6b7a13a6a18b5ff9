//! `RoverModel`: what the report had Maple generate, from data.

use std::sync::Arc;

use pyo3::prelude::*;
use pyo3::types::{PyDict, PyFloat, PyList, PyMapping};
use rover_core::contact::placement::{resting_on, resting_pose};
use rover_core::contact::{Contact, detection::wheel_contacts};
use rover_core::multibody::chart::actuation_matrix;
use rover_core::multibody::landmarks::{self, coordinate_names};
use rover_core::multibody::{
    Changes, Chart, Kinematics, Model, ModelDescription, ModelError, coordinates,
};
use rover_core::nalgebra::{DMatrix, DVector, Vector3};
use rover_task::draw::{DrawnGround, rocks::clear_radius};

use crate::arguments::{Named, number, refused, text, texts};
use crate::arrays::{Array, fresh, fresh_matrix, fresh_rows, triple, two, vector};
use crate::errors::{Kind, Result, Value};
use crate::loops;
use crate::machines;
use crate::motor::{self, Motor};
use crate::shared::Release;
use crate::terrain::parse;

/// A pair of new vectors.
pub type Pair = (Array, Array);

/// A machine: a tree of solids under a free base, read from data. Immutable.
///
/// `RoverModel()` is the built-in six-wheel rover. The other constructors are `named`, `from_text`
/// and `from_dict`, those that read files, `from_file`, `from_urdf` and `from_mjcf`, and `join` for
/// several machines.
///
/// Methods that take coordinates have an argument `coordinates`: "state" for the `q` and `v` of
/// `Simulation`, "report" for the Cardan angles of the 2010 report and their rates. They raise
/// StateError if `q` or `qdot` has a wrong length or an entry that is not finite, OptionError if
/// `coordinates` is neither of the two, and TerrainError if `terrain` is not a terrain.
#[pyclass(module = "rover_gym.core", frozen, from_py_object)]
#[derive(Clone)]
pub struct RoverModel {
    pub inner: Arc<Model>,
    /// What an import reported.
    report: Option<Arc<Py<PyAny>>>,
}

impl From<Arc<Model>> for RoverModel {
    fn from(inner: Arc<Model>) -> Self {
        Self {
            inner,
            report: None,
        }
    }
}

/// A set of coordinates as the argument `coordinates` names it; the state's by default, everywhere.
pub struct Coordinates(Chart);

impl Coordinates {
    pub const STATE: Self = Self(Chart::State);

    /// The set that was named.
    pub fn chart(self) -> Chart {
        self.0
    }
}

impl FromPyObject<'_, '_> for Coordinates {
    type Error = PyErr;

    fn extract(given: Borrowed<'_, '_, PyAny>) -> PyResult<Self> {
        match text(&given, Kind::Option, "coordinates")?.as_str() {
            "report" => Ok(Self(Chart::Report)),
            "state" => Ok(Self(Chart::State)),
            _ => {
                let what = "\"report\" or \"state\"";
                Err(refused(&given, Kind::Option, "coordinates", what).into())
            }
        }
    }
}

/// Coordinates that were given, and where they place a machine.
struct Placed {
    chart: Chart,
    q: Vec<f64>,
    kinematics: Kinematics,
}

impl RoverModel {
    fn wrap(model: Result<Model, ModelError>) -> Result<Self> {
        Ok(Arc::new(model?).into())
    }

    /// The model that an argument means: an object, a name of the gallery, or a file.
    pub fn opened(given: &Bound<'_, PyAny>, field: &str) -> Result<Self> {
        if let Ok(own) = given.extract::<Self>() {
            return Ok(own);
        }
        let class = given.py().get_type::<Self>();
        let found = class.call_method1("_opened", (field, given))?;
        let own = found.extract::<Self>();
        own.map_err(|_| refused(given, Kind::Model, field, "a RoverModel"))
    }

    fn placed(&self, q: &Bound<'_, PyAny>, coordinates: Coordinates) -> Result<Placed> {
        let chart = coordinates.chart();
        let q = vector(q, Kind::State, "q")?;
        let kinematics = Kinematics::of(&self.inner, &chart.configuration(&self.inner, &q)?);
        Ok(Placed {
            chart,
            q,
            kinematics,
        })
    }

    fn contacts(
        &self,
        q: &Bound<'_, PyAny>,
        terrain: &Bound<'_, PyAny>,
        coordinates: Coordinates,
    ) -> Result<(Placed, Vec<Contact>)> {
        let placed = self.placed(q, coordinates)?;
        let terrain = parse(terrain)?.terrain();
        let contacts = wheel_contacts(&self.inner, &placed.kinematics, &*terrain);
        Ok((placed, contacts))
    }

    /// Velocity indices of joints; −1 where there is none.
    fn velocity_indices(&self, joints: impl Iterator<Item = Option<usize>>) -> Vec<i64> {
        let index = |joint: Option<usize>| {
            let index = joint.map(|j| self.inner.joint_velocity(j));
            index.and_then(|k| i64::try_from(k).ok()).unwrap_or(-1)
        };
        joints.map(index).collect()
    }

    fn json(&self) -> Result<String> {
        Ok(self.inner.description().to_json()?)
    }
}

/// Points with names: solids, the model's tags, wheel axles, mass centre.
pub fn tags<'py>(
    py: Python<'py>,
    model: &Model,
    kinematics: &Kinematics,
) -> Result<Bound<'py, PyDict>> {
    let tags = PyDict::new(py);
    for (name, x) in landmarks::tags(model, kinematics) {
        tags.set_item(name, fresh(x.as_slice()))?;
    }
    Ok(tags)
}

/// Origin and rotation matrix of every solid.
pub fn poses<'py>(
    py: Python<'py>,
    model: &Model,
    kinematics: &Kinematics,
) -> Result<Bound<'py, PyDict>> {
    let poses = PyDict::new(py);
    for (name, x, R) in landmarks::poses(model, kinematics) {
        let R = DMatrix::from_iterator(3, 3, R.iter().copied());
        poses.set_item(name, (fresh(x.as_slice()), fresh_matrix(&R)))?;
    }
    Ok(poses)
}

/// Field and value of the first number of a description that is not finite.
fn not_finite<'py>(
    value: &Bound<'py, PyAny>,
    field: String,
) -> Option<(String, Bound<'py, PyAny>)> {
    if let Ok(number) = value.cast::<PyFloat>() {
        return (!number.value().is_finite()).then(|| (field, value.clone()));
    }
    if let Ok(entries) = value.cast::<PyDict>() {
        let dot = if field.is_empty() { "" } else { "." };
        let mut entries = entries.iter();
        return entries.find_map(|(name, entry)| not_finite(&entry, format!("{field}{dot}{name}")));
    }
    let mut entries = value.cast::<PyList>().ok()?.iter().enumerate();
    entries.find_map(|(k, entry)| {
        let is_number = entry.is_instance_of::<PyFloat>();
        let place = if is_number {
            String::new()
        } else {
            format!("[{k}]")
        };
        not_finite(&entry, format!("{field}{place}"))
    })
}

#[pymethods]
impl RoverModel {
    #[new]
    fn new() -> Self {
        Arc::new(Model::gallery_rover()).into()
    }

    /// Reads a model from TOML text.
    ///
    /// Args:
    ///     text: Contents of a model file.
    ///
    /// Raises:
    ///     ModelError: The text does not describe a model.
    #[staticmethod]
    fn from_text(text: &Bound<'_, PyAny>) -> Result<Self> {
        let text = self::text(text, Kind::Model, "text")?;
        Self::wrap(ModelDescription::from_toml(&text).and_then(Model::from_description))
    }

    /// Reads a model from nested dictionaries and lists.
    ///
    /// Args:
    ///     description: A description as `to_dict` returns it.
    ///
    /// Raises:
    ///     ModelError: The dictionaries do not describe a model.
    #[staticmethod]
    fn from_dict(description: &Bound<'_, PyAny>) -> Result<Self> {
        let py = description.py();
        let options = PyDict::new(py);
        options.set_item("allow_nan", true)?;
        let text = py
            .import("json")?
            .call_method("dumps", (description,), Some(&options));
        let text: String = match text {
            Ok(text) => text.extract()?,
            Err(e) => {
                let message = format!("the model description cannot be read: {}", e.value(py));
                return Err(Kind::Model.error("text", message, Value::Nothing));
            }
        };
        // JSON has no such numbers.
        if (text.contains("NaN") || text.contains("Infinity"))
            && let Some((field, value)) = not_finite(description, String::new())
        {
            return Err(refused(&value, Kind::Model, &field, "finite"));
        }
        Self::_restore(&text)
    }

    /// The description as TOML text, for `from_text`.
    fn to_text(&self) -> Result<String> {
        Ok(self.inner.description().to_toml()?)
    }

    /// The description as nested dictionaries and lists, for `from_dict`.
    fn to_dict<'py>(&self, py: Python<'py>) -> Result<Bound<'py, PyAny>> {
        Ok(py.import("json")?.call_method1("loads", (self.json()?,))?)
    }

    /// Joins several machines to one model, in which they meet, push and tow each other.
    ///
    /// The names of their solids, joints, wheels, tags and loops get the machine's name and a slash
    /// in front, such as "tug/trunk". Coordinates, joints and wheels are those of the machines, one
    /// machine after another: a state is `numpy.concatenate` of the states of all machines, a
    /// command likewise, and `machines` has the part of each.
    ///
    /// Args:
    ///     models: Machines by name: objects, names of the gallery or files.
    ///     loops: Constraints between machines, dictionaries with the fields of a closed loop in a
    ///         model file. Between free machines `other_position` is required, and in a weld
    ///         `other_rotation`. None by default.
    ///     name: Name of the model; by default the machines' names.
    ///
    /// Raises:
    ///     ModelError: `models` are not models by name, or a loop is invalid.
    #[staticmethod]
    #[pyo3(signature = (models, *, loops = None, name = None))]
    fn join(
        models: &Bound<'_, PyAny>,
        loops: Option<&Bound<'_, PyAny>>,
        name: Option<&Bound<'_, PyAny>>,
    ) -> Result<Self> {
        let machines = machines_by_name(models)?;
        let names = || machines.iter().map(|(name, _)| name.as_str());
        let name = name.map_or_else(
            || Ok(names().collect::<Vec<_>>().join(" and ")),
            |name| text(name, Kind::Model, "name"),
        )?;
        let loops = loops.map_or_else(|| Ok(Vec::new()), machines::read_loops)?;
        Self::wrap(Model::joined(&name, machines, loops))
    }

    /// Machines of the model by name; one, of the model's own name, unless several were joined.
    #[getter]
    fn machines<'py>(&self, py: Python<'py>) -> Result<Bound<'py, PyDict>> {
        machines::by_name(py, &self.inner)
    }

    /// Returns a model of the gallery by name.
    ///
    /// Args:
    ///     name: One of `names()`.
    ///
    /// Raises:
    ///     ModelError: There is no such model; the message lists the available ones.
    #[staticmethod]
    fn named(name: &Bound<'_, PyAny>) -> Result<Self> {
        let name = text(name, Kind::Model, "name")?;
        Self::wrap(ModelDescription::named(&name).and_then(Model::from_description))
    }

    /// Names of the models of the gallery; the first is the built-in rover.
    #[staticmethod]
    fn names() -> Vec<&'static str> {
        ModelDescription::names().to_vec()
    }

    /// What the importer read, assumed and left out of the source file.
    ///
    /// A `rover_gym.models.ImportReport`. None for models that were not imported, and for models
    /// derived from an imported one, for instance by `replace`.
    #[getter]
    fn import_report(&self, py: Python<'_>) -> Option<Py<PyAny>> {
        self.report.as_ref().map(|report| report.clone_ref(py))
    }

    /// Copy of the model with the report of its import.
    fn _with_import_report(&self, report: Py<PyAny>) -> Self {
        Self {
            inner: self.inner.clone(),
            report: Some(Arc::new(report)),
        }
    }

    /// Returns a copy of the model with the given properties changed.
    ///
    /// The stiffness of the wheels does not follow masses and radii.
    ///
    /// Args:
    ///     wheel_radius: Radius of all wheels, m. Shape, inertia and contact radius change
    ///         together.
    ///     contact_radius: Radius at which the wheels touch the ground, m. Shape and inertia do not
    ///         change.
    ///     wheel_stiffness: Normal contact stiffness of all wheels, N/m; 0 for rigid wheels, which
    ///         have no damping, tangential ratio and relaxation length either.
    ///     wheel_damping: Normal contact damping of all wheels, N s/m.
    ///     wheel_tangential_ratio: Contact stiffness of all wheels along the surface relative to
    ///         the normal one.
    ///     wheel_relaxation_length: Way of rolling over which the deflection of all wheels along
    ///         the surface is renewed, m.
    ///     masses: Masses by name of the solid, or a list with one for each solid, kg. Inertias
    ///         scale with them.
    ///     steering_stiffness: Stiffness of every steering controller, N m/rad.
    ///     steering_damping: Damping of every steering controller, N m s/rad.
    ///     wheel_torque_limit: Largest torque of every wheel, N m.
    ///     mass_scale: Factor of all masses and inertias.
    ///     motor: The motor of all wheels: a `Motor`, a mapping of its fields, or None if the
    ///         torque is to follow the command at any speed. By default the motors do not change.
    ///
    /// Raises:
    ///     ModelError: A number is out of range, there is no solid of a given name, or
    ///         `wheel_radius` is given and the solid of a wheel is not a disc.
    #[pyo3(signature = (**changes), text_signature = "($self, *, wheel_radius=None, contact_radius=None, wheel_stiffness=None, wheel_damping=None, wheel_tangential_ratio=None, wheel_relaxation_length=None, masses=None, steering_stiffness=None, steering_damping=None, \
        wheel_torque_limit=None, mass_scale=None, motor=...)")]
    fn replace(&self, py: Python<'_>, changes: Option<&Bound<'_, PyDict>>) -> Result<Self> {
        let given = Named::keywords(py, changes)?.of(Kind::Model);
        let masses = given
            .some("masses")?
            .map(|masses| self.masses(&masses))
            .transpose()?;
        let motor = given.get("motor")?.given();
        let changes = Changes {
            wheel_radius: given.maybe("wheel_radius")?,
            contact_radius: given.maybe("contact_radius")?,
            wheel_stiffness: given.maybe("wheel_stiffness")?,
            wheel_damping: given.maybe("wheel_damping")?,
            wheel_tangential_ratio: given.maybe("wheel_tangential_ratio")?,
            wheel_relaxation_length: given.maybe("wheel_relaxation_length")?,
            masses: masses.unwrap_or_default(),
            mass_scale: given.maybe("mass_scale")?,
            steering_stiffness: given.maybe("steering_stiffness")?,
            steering_damping: given.maybe("steering_damping")?,
            wheel_torque_limit: given.maybe("wheel_torque_limit")?,
            motor: motor.map(|motor| motor::parse(&motor)).transpose()?,
        };
        given.finish()?;
        Self::wrap(self.inner.changed(&changes))
    }

    /// Returns a copy of the model with joints locked. Their coordinates are removed.
    ///
    /// Args:
    ///     joints: Names of joints to lock at 0, or a mapping of names to angles, rad.
    ///
    /// Returns:
    ///     The new model. Its files and dictionaries contain the locks.
    ///
    /// Raises:
    ///     ModelError: There is no such joint, or an angle is not finite.
    fn weld(&self, joints: &Bound<'_, PyAny>) -> Result<Self> {
        let joints = if let Ok(map) = joints.cast::<PyMapping>() {
            numbers_by_name(map, "joints")?
        } else {
            let names = texts(joints, Kind::Model, "joints")?;
            names.into_iter().map(|name| (name, 0.0)).collect()
        };
        Self::wrap(self.inner.with_locked_joints(&joints))
    }

    /// Name of the model.
    #[getter]
    fn name(&self) -> &str {
        &self.inner.description().name
    }

    /// Number of coordinates.
    #[getter]
    fn nq(&self) -> usize {
        self.inner.nv()
    }

    /// Number of velocities.
    #[getter]
    fn nv(&self) -> usize {
        self.inner.nv()
    }

    /// Total mass, kg.
    #[getter]
    fn mass(&self) -> f64 {
        self.inner.mass()
    }

    /// Closed loops, a dictionary for each.
    ///
    /// It has `name`, `kind`, `solid`, `other`, the number `rows` of equations, and of these the
    /// number `redundant`. An equation is redundant if, with all joints at zero, it follows from
    /// the joints and from earlier loops. Redundant equations are left out.
    #[getter]
    fn loops<'py>(&self, py: Python<'py>) -> Result<Vec<Bound<'py, PyDict>>> {
        loops::list(py, &self.inner)
    }

    /// Closes the loops: the nearest state, in the sense that heavy parts move least.
    ///
    /// Args:
    ///     q: Coordinates as `Simulation.q`, (nq,).
    ///     v: Velocity as `Simulation.v`, (nv,); at rest by default.
    ///
    /// Returns:
    ///     Coordinates that close all loops, (nq,), and the velocity without the part that would
    ///     open them, (nv,). Without loops, `q` and `v`.
    ///
    /// Raises:
    ///     StateError: An array has a wrong length or an entry that is not finite, or no
    ///         coordinates near these close the loops.
    #[pyo3(signature = (q, v = None))]
    fn close_loops(&self, q: &Bound<'_, PyAny>, v: Option<&Bound<'_, PyAny>>) -> Result<Pair> {
        let q = vector(q, Kind::State, "q")?;
        let rest = || Ok(vec![0.0; self.inner.nv()]);
        let v = v.map_or_else(rest, |v| vector(v, Kind::State, "v"))?;
        let mut v = coordinates::checked_velocity(&self.inner, &v)?;
        loops::closed(&self.inner, &q, &mut v)
    }

    /// Names of the coordinates, x, y, z, roll, heading, pitch, then the joints.
    #[getter]
    fn dof_names(&self) -> Vec<String> {
        coordinate_names(&self.inner)
    }

    /// Names of the joints that are not locked, in the order of q.
    #[getter]
    fn joint_names(&self) -> Vec<String> {
        let bodies = self.inner.bodies();
        self.inner
            .joints()
            .iter()
            .map(|joint| bodies[joint.body].name.clone())
            .collect()
    }

    /// Names of the solids.
    #[getter]
    fn solid_names(&self) -> Vec<String> {
        self.inner.frames().iter().map(|f| f.name.clone()).collect()
    }

    /// Names of the wheels, in the order of every array with one entry a wheel.
    #[getter]
    fn wheel_names(&self) -> Vec<String> {
        self.inner.wheels().iter().map(|w| w.name.clone()).collect()
    }

    /// Radius at which each wheel touches the ground, (n_wheels,), m.
    #[getter]
    fn wheel_radii(&self) -> Array {
        self.inner.wheels().iter().map(|w| w.radius).collect()
    }

    /// Normal stiffness of each wheel where it touches, (n_wheels,), N/m; 0 for a rigid wheel.
    #[getter]
    fn wheel_stiffnesses(&self) -> Array {
        let treads = self.inner.wheels().iter().map(|w| w.tread);
        treads
            .map(|own| own.map_or(0.0, |own| own.stiffness))
            .collect()
    }

    /// Radius of the circle that the rover needs to turn on the spot, m.
    ///
    /// The largest distance from the trunk's origin to a wheel's contact point, with all joints at
    /// zero, plus the wheel's radius and 0.1 m.
    #[getter]
    fn clear_radius(&self) -> f64 {
        clear_radius(&self.inner)
    }

    /// Largest torque of each wheel, (n_wheels,), N m.
    #[getter]
    fn wheel_torque_limits(&self) -> Array {
        self.inner.wheels().iter().map(|w| w.torque_limit).collect()
    }

    /// Gain of each wheel's speed servo, (n_wheels,), N m s/rad; see `Simulation.set_wheel_speeds`.
    #[getter]
    fn wheel_speed_gains(&self) -> Array {
        self.inner.wheels().iter().map(|w| w.speed_gain).collect()
    }

    /// The motor of each wheel; None for a wheel whose torque follows the command at any speed.
    #[getter]
    fn motors(&self) -> Vec<Option<Motor>> {
        self.inner
            .wheels()
            .iter()
            .map(|wheel| wheel.motor.map(Motor::from))
            .collect()
    }

    /// Index in q of each wheel's rotation; -1 where it is locked.
    ///
    /// A wheel that is coupled with a ratio of 1 has the index of the joint that it follows, and
    /// shares its drive.
    #[getter]
    fn wheel_joint_indices(&self) -> Vec<i64> {
        self.velocity_indices(self.inner.wheels().iter().map(|w| w.joint))
    }

    /// Index in q of each wheel's steering joint; -1 where there is none or it is locked.
    #[getter]
    fn steering_joint_indices(&self) -> Vec<i64> {
        self.velocity_indices(self.inner.wheels().iter().map(|w| w.steering))
    }

    /// Largest steering set-point either way, rad.
    #[getter]
    fn steering_limit(&self) -> f64 {
        self.inner
            .wheels()
            .iter()
            .map(|w| w.steering_limit)
            .fold(0.0, f64::max)
    }

    /// The mass matrix M(q).
    ///
    /// Args:
    ///     q: Coordinates, (nq,).
    ///     coordinates: "state" or "report".
    ///
    /// Returns:
    ///     (nv, nv), in kg, kg m and kg m².
    ///
    /// Source: Featherstone 2008, ch. 6.
    #[pyo3(signature = (q, coordinates = Coordinates::STATE), text_signature = "($self, q, coordinates='state')")]
    fn mass_matrix(&self, q: &Bound<'_, PyAny>, coordinates: Coordinates) -> Result<Array> {
        let at = self.placed(q, coordinates)?;
        let M = at.chart.mass_matrix(&self.inner, &at.q, &at.kinematics);
        Ok(fresh_matrix(&M))
    }

    /// The bias N(q, v) v + G(q) of the equations of motion, M dv/dt + bias = generalized forces.
    ///
    /// Args:
    ///     q: Coordinates, (nq,).
    ///     qdot: Velocity in the same coordinates, (nv,).
    ///     gravity: Gravity, world frame, (3,), m/s²; (0, -9.81, 0) by default.
    ///     coordinates: "state" or "report".
    ///
    /// Returns:
    ///     (nv,), in N and N m.
    ///
    /// Raises:
    ///     OptionError: `gravity` is not three finite numbers.
    ///
    /// Source: Featherstone 2008, ch. 5.
    #[pyo3(signature = (q, qdot, gravity = None, coordinates = Coordinates::STATE), text_signature = "($self, q, qdot, gravity=None, coordinates='state')")]
    fn bias(
        &self,
        q: &Bound<'_, PyAny>,
        qdot: &Bound<'_, PyAny>,
        gravity: Option<&Bound<'_, PyAny>>,
        coordinates: Coordinates,
    ) -> Result<Array> {
        let at = self.placed(q, coordinates)?;
        let qdot = vector(qdot, Kind::State, "qdot")?;
        at.chart.velocity(&self.inner, &at.q, &qdot)?;
        let (gravity, state) = (checked_gravity(gravity)?, (&at.q[..], &qdot[..]));
        let bias = (at.chart).bias(&self.inner, state, &at.kinematics, &gravity)?;
        Ok(fresh(bias.as_slice()))
    }

    /// The matrix that maps wheel torques and steering torques to generalized forces.
    ///
    /// Returns:
    ///     (nv, 2 n_wheels): a column for each wheel's torque, positive forward, then one for each
    ///     steering torque.
    fn actuation_matrix(&self) -> Array {
        fresh_matrix(&actuation_matrix(&self.inner))
    }

    /// The kinetic energy, half of v · M v, J.
    ///
    /// Args:
    ///     q: Coordinates, (nq,).
    ///     qdot: Velocity in the same coordinates, (nv,).
    ///     coordinates: "state" or "report".
    #[pyo3(signature = (q, qdot, coordinates = Coordinates::STATE), text_signature = "($self, q, qdot, coordinates='state')")]
    fn kinetic_energy(
        &self,
        q: &Bound<'_, PyAny>,
        qdot: &Bound<'_, PyAny>,
        coordinates: Coordinates,
    ) -> Result<f64> {
        let at = self.placed(q, coordinates)?;
        let qdot = vector(qdot, Kind::State, "qdot")?;
        let v = at.chart.velocity(&self.inner, &at.q, &qdot)?;
        let energy = at.kinematics.energy(&self.inner, &v, &Vector3::zeros());
        Ok(energy.kinetic)
    }

    /// Named points and axes of the machine in the world frame.
    ///
    /// Args:
    ///     q: Coordinates, (nq,).
    ///     coordinates: "state" or "report".
    ///
    /// Returns:
    ///     Vectors (3,) by name: the origin of every solid and the tags of the model, m; the unit
    ///     axle of every wheel, `axle_FL` and so on; the mass centre, `centre_of_mass`, m.
    #[pyo3(signature = (q, coordinates = Coordinates::STATE), text_signature = "($self, q, coordinates='state')")]
    fn tags<'py>(
        &self,
        q: &Bound<'py, PyAny>,
        coordinates: Coordinates,
    ) -> Result<Bound<'py, PyDict>> {
        let at = self.placed(q, coordinates)?;
        tags(q.py(), &self.inner, &at.kinematics)
    }

    /// The pose of every solid in the world frame.
    ///
    /// Args:
    ///     q: Coordinates, (nq,).
    ///     coordinates: "state" or "report".
    ///
    /// Returns:
    ///     Origin (3,), m, and rotation matrix (3, 3) by name of the solid.
    #[pyo3(signature = (q, coordinates = Coordinates::STATE), text_signature = "($self, q, coordinates='state')")]
    fn poses<'py>(
        &self,
        q: &Bound<'py, PyAny>,
        coordinates: Coordinates,
    ) -> Result<Bound<'py, PyDict>> {
        let at = self.placed(q, coordinates)?;
        poses(q.py(), &self.inner, &at.kinematics)
    }

    /// Signed distance of each wheel from the terrain.
    ///
    /// Args:
    ///     q: Coordinates, (nq,).
    ///     terrain: A terrain, or a list of several.
    ///     coordinates: "state" or "report".
    ///
    /// Returns:
    ///     (n_wheels,), m, positive when apart.
    #[pyo3(signature = (q, terrain, coordinates = Coordinates::STATE), text_signature = "($self, q, terrain, coordinates='state')")]
    fn wheel_gaps(
        &self,
        q: &Bound<'_, PyAny>,
        terrain: &Bound<'_, PyAny>,
        coordinates: Coordinates,
    ) -> Result<Array> {
        let (_, contacts) = self.contacts(q, terrain, coordinates)?;
        Ok(contacts.iter().map(|c| c.gap).collect())
    }

    /// The coordinates of the rover at rest on a terrain.
    ///
    /// On a plane, the joints are at zero, the trunk's y axis is along the normal, its origin is
    /// above the position, and the lowest wheel touches the ground. If some wheels are then in the
    /// air, pitch, roll and the passive joints are adjusted, provided that more wheels touch the
    /// ground afterwards. On any other terrain, pitch, roll and the passive joints always bring as
    /// many wheels to the ground as possible. No wheel penetrates the ground.
    ///
    /// Args:
    ///     terrain: A terrain, or a list of several; a plane must not be vertical.
    ///     position: x and z, (2,), m.
    ///     heading: Heading, rad.
    ///
    /// Returns:
    ///     Coordinates of the state, (nq,).
    ///
    /// Raises:
    ///     TerrainError: `terrain` is not a terrain, or the ground under the trunk or a wheel is
    ///         unknown.
    ///     StateError: A number is not finite, or the plane is vertical.
    ///     ModelError: The model has no wheels, or several machines: place each by its own model.
    fn resting_pose(
        &self,
        terrain: &Bound<'_, PyAny>,
        position: &Bound<'_, PyAny>,
        heading: &Bound<'_, PyAny>,
    ) -> Result<Array> {
        let ground = parse(terrain)?;
        let place = two(position, Kind::State, "position")?;
        let heading = number(heading, Kind::State, "heading")?;
        machines::check_standing(&self.inner)?;
        if let DrawnGround::Plane(plane) = &ground {
            return Ok(resting_pose(&self.inner, plane, place, heading)?.into());
        }
        let surface = ground.terrain();
        let q = terrain
            .py()
            .release(|| resting_on(&self.inner, &*surface, place, heading))?;
        Ok(q?.into())
    }

    /// The point of each wheel's rim that is nearest to the terrain.
    ///
    /// Args:
    ///     q: Coordinates, (nq,).
    ///     terrain: A terrain, or a list of several.
    ///     coordinates: "state" or "report".
    ///
    /// Returns:
    ///     (n_wheels, 3), world frame, m.
    #[pyo3(signature = (q, terrain, coordinates = Coordinates::STATE), text_signature = "($self, q, terrain, coordinates='state')")]
    fn wheel_contact_points(
        &self,
        q: &Bound<'_, PyAny>,
        terrain: &Bound<'_, PyAny>,
        coordinates: Coordinates,
    ) -> Result<Array> {
        let (placed, contacts) = self.contacts(q, terrain, coordinates)?;
        let point = |c: &Contact| (placed.kinematics.origin(c.body) + c.point).into();
        Ok(fresh_rows(contacts.iter().map(point)))
    }

    /// The contact Jacobian J of each wheel: J v is the velocity of its contact point.
    ///
    /// Args:
    ///     q: Coordinates, (nq,).
    ///     terrain: A terrain, or a list of several.
    ///     coordinates: "state" or "report".
    ///
    /// Returns:
    ///     (n_wheels, 3, nv): rows along the normal, the rolling direction and the lateral
    ///     direction.
    #[pyo3(signature = (q, terrain, coordinates = Coordinates::STATE), text_signature = "($self, q, terrain, coordinates='state')")]
    fn wheel_jacobians(
        &self,
        q: &Bound<'_, PyAny>,
        terrain: &Bound<'_, PyAny>,
        coordinates: Coordinates,
    ) -> Result<Array> {
        let (at, contacts) = self.contacts(q, terrain, coordinates)?;
        let model = &self.inner;
        let mut rows = Vec::with_capacity(contacts.len() * 3 * model.nv());
        for Contact {
            body, point, frame, ..
        } in &contacts
        {
            let path = model.path(*body);
            let mut along = vec![0.0; path.len()];
            for d in frame.rows() {
                (at.kinematics).point_jacobian_row(model, *body, point, &d, &mut along);
                let mut full = DVector::zeros(model.nv());
                for (entry, &k) in along.iter().zip(path) {
                    full[k] = *entry;
                }
                rows.extend_from_slice(at.chart.covector(model, &at.q, full).as_slice());
            }
        }
        Ok(Array::shaped(rows, &[contacts.len(), 3, model.nv()]))
    }

    /// Converts a state to the report's coordinates.
    ///
    /// Args:
    ///     q: Coordinates as `Simulation.q`, (nq,).
    ///     v: Velocity as `Simulation.v`, (nv,).
    ///
    /// Returns:
    ///     The report's q, (nq,), and its rate, (nv,).
    ///
    /// Raises:
    ///     StateError: An array has a wrong length or an entry that is not finite, or the heading
    ///         is ±90 degrees, where the report's angles are singular.
    fn to_report(&self, q: &Bound<'_, PyAny>, v: &Bound<'_, PyAny>) -> Result<Pair> {
        let model = &self.inner;
        let configuration = coordinates::from_public(model, &vector(q, Kind::State, "q")?)?;
        let v = coordinates::checked_velocity(model, &vector(v, Kind::State, "v")?)?;
        let (q, qdot) = coordinates::to_report(model, &configuration, &v)?;
        Ok((q.into(), qdot.into()))
    }

    /// Converts the report's coordinates to a state.
    ///
    /// Args:
    ///     q: The report's coordinates, (nq,).
    ///     qdot: Their rates, (nv,).
    ///
    /// Returns:
    ///     Coordinates as `Simulation.q`, (nq,), and velocity as `Simulation.v`, (nv,).
    ///
    /// Raises:
    ///     StateError: An array has a wrong length or an entry that is not finite.
    #[allow(clippy::wrong_self_convention)] // the Python name: from the report's coordinates
    fn from_report(&self, q: &Bound<'_, PyAny>, qdot: &Bound<'_, PyAny>) -> Result<Pair> {
        let model = &self.inner;
        let q = vector(q, Kind::State, "q")?;
        let configuration = coordinates::from_report(model, &q)?;
        let qdot = vector(qdot, Kind::State, "qdot")?;
        let v = coordinates::velocity_from_report(model, &q, &qdot)?;
        Ok((
            coordinates::to_public(model, &configuration).into(),
            v.into(),
        ))
    }

    fn __repr__(&self) -> String {
        let (name, m) = (self.name(), &self.inner);
        format!("RoverModel({name:?}, nv={}, mass={})", m.nv(), m.mass())
    }

    fn __eq__(&self, other: &Bound<'_, PyAny>) -> bool {
        let other = other.cast::<Self>();
        other.is_ok_and(|o| o.get().inner.description() == self.inner.description())
    }

    fn __hash__(&self) -> Result<u64> {
        use std::hash::{DefaultHasher, Hash, Hasher};
        let mut hasher = DefaultHasher::new();
        self.json()?.hash(&mut hasher);
        Ok(hasher.finish())
    }

    #[staticmethod]
    fn _restore(text: &str) -> Result<Self> {
        Self::wrap(ModelDescription::from_json(text).and_then(Model::from_description))
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> Result<(Bound<'py, PyAny>, (String,))> {
        Ok((slf.get_type().getattr("_restore")?, (slf.get().json()?,)))
    }
}

/// Descriptions of machines by their names.
fn machines_by_name(models: &Bound<'_, PyAny>) -> Result<Vec<(String, ModelDescription)>> {
    let Ok(given) = models.cast::<PyMapping>() else {
        return Err(refused(models, Kind::Model, "models", "models by name"));
    };
    let read = |item: Bound<'_, PyAny>| {
        let (name, model): (Bound<'_, PyAny>, Bound<'_, PyAny>) = item.extract()?;
        let name = text(&name, Kind::Model, "models")?;
        let given = RoverModel::opened(&model, &format!("models[{name}]"))?;
        Ok((name, given.inner.description().clone()))
    };
    given.items()?.iter().map(read).collect()
}

/// Numbers by names.
fn numbers_by_name(map: &Bound<'_, PyMapping>, field: &str) -> Result<Vec<(String, f64)>> {
    let read = |item: Bound<'_, PyAny>| {
        let (name, value): (Bound<'_, PyAny>, Bound<'_, PyAny>) = item.extract()?;
        let name = text(&name, Kind::Model, field)?;
        let value = number(&value, Kind::Model, &format!("{field}[{name}]"))?;
        Ok((name, value))
    };
    map.items()?.iter().map(read).collect()
}

impl RoverModel {
    /// Masses by name, from those or from one for each solid.
    fn masses(&self, masses: &Bound<'_, PyAny>) -> Result<Vec<(String, f64)>> {
        if let Ok(map) = masses.cast::<PyMapping>() {
            return numbers_by_name(map, "masses");
        }
        let values = vector(masses, Kind::Model, "masses")?;
        let (n, given) = (self.inner.description().solids.len(), values.len());
        if n != given {
            let message = format!("masses: needs {n} entries, has {given}");
            return Err(Kind::Model.error("masses", message, Value::Count(given)));
        }
        let solids = self.inner.description().solids.iter();
        Ok(solids.map(|solid| solid.name.clone()).zip(values).collect())
    }
}

/// Three finite numbers, by default Earth's.
pub fn checked_gravity(gravity: Option<&Bound<'_, PyAny>>) -> Result<Vector3<f64>> {
    let read = |given| triple(given, Kind::Option, "gravity");
    let given = gravity.map_or(Ok([0.0, -9.81, 0.0]), read)?;
    if given.iter().any(|value| !value.is_finite()) {
        let message = format!("gravity: must be finite, is {given:?}");
        return Err(Kind::Option.error("gravity", message, Value::Numbers(given.to_vec())));
    }
    Ok(given.into())
}
