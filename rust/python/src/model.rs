//! `RoverModel`: what the report had Maple generate, from data.

use std::collections::HashSet;
use std::sync::Arc;

use numpy::{PyArray1, PyArray2, PyArray3};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyMapping};
use rover_core::contact::{Contact, detection::wheel_contacts};
use rover_core::draw::{DrawnGround, resting_on, resting_pose, rocks::clear_radius};
use rover_core::multibody::{
    Configuration, Joint, Kinematics, Model, ModelDescription, ModelError, coordinates,
    description::MAX_TEXT, momentum,
};
use rover_core::nalgebra::{DMatrix, DVector, Vector3};

use crate::arguments::{self, Given, number};
use crate::arrays::{fresh, fresh_blocks, fresh_matrix, fresh_rows, triple, two, vector};
use crate::errors::{BorderError, Kind, Value};
use crate::files::{self, in_file, read_text, write_text};
use crate::model_files;
use crate::motor::{self, Motor};
use crate::terrain::parse;

/// A pair of fresh vectors.
pub type Pair<'py> = (Bound<'py, PyArray1<f64>>, Bound<'py, PyArray1<f64>>);

/// A machine: a tree of solids under a free base, read from data. Immutable.
///
/// `RoverModel()` is the built-in six-wheel rover. The other constructors are `named`,
/// `from_file`, `from_text`, `from_dict`, `from_urdf` and `from_mjcf`.
///
/// Methods that take coordinates understand two sets of them, by the argument `coordinates`:
/// "state", the `q` and `v` of `Simulation`, and "report", the Cardan angles of the 2010 report and
/// their rates.
#[pyclass(module = "rover_gym.mechanics", frozen, from_py_object)]
#[derive(Clone)]
pub struct RoverModel {
    pub inner: Arc<Model>,
    /// What an import reported.
    pub report: Option<Arc<Py<PyAny>>>,
}

impl From<Arc<Model>> for RoverModel {
    fn from(inner: Arc<Model>) -> Self {
        Self {
            inner,
            report: None,
        }
    }
}

impl RoverModel {
    /// The model that a reader of other programs' files returns, with the report of its import.
    fn imported<'py>(
        reader: &str,
        path: &Bound<'py, PyAny>,
        options: model_files::Options<'py>,
    ) -> PyResult<Self> {
        let found = model_files::read(reader, path, options)?;
        let (model, report): (Self, Py<PyAny>) = found.extract()?;
        Ok(Self {
            inner: model.inner,
            report: Some(Arc::new(report)),
        })
    }

    fn write<'py>(
        &self,
        writer: &str,
        path: &Bound<'py, PyAny>,
        options: model_files::Options<'py>,
    ) -> PyResult<()> {
        let model = self.clone().into_pyobject(path.py())?.into_any();
        model_files::write(writer, model, path, options)
    }
}

/// How a user's `q` and velocities are to be read.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Coordinates {
    /// The report's Cardan angles and their rates.
    Report,
    /// Public `q` and our velocity.
    State,
}

impl Coordinates {
    pub fn parse(name: &str) -> Result<Self, BorderError> {
        match name {
            "report" => Ok(Self::Report),
            "state" => Ok(Self::State),
            _ => Err(BorderError::option(
                "coordinates",
                format!("coordinates: must be \"report\" or \"state\", is {name:?}"),
                Value::Text(name.to_owned()),
            )),
        }
    }

    /// Those that a caller named; the state's by default, everywhere.
    pub fn given(name: Given<'_>) -> PyResult<Self> {
        Ok(Self::parse(&name.text(
            "state",
            Kind::Option,
            "coordinates",
        )?)?)
    }

    pub fn configuration(self, model: &Model, q: &[f64]) -> Result<Configuration, BorderError> {
        Ok(match self {
            Self::Report => coordinates::from_report(model, q)?,
            Self::State => coordinates::from_public(model, q)?,
        })
    }

    pub fn velocity(self, model: &Model, q: &[f64], qdot: &[f64]) -> Result<Vec<f64>, BorderError> {
        Ok(match self {
            Self::Report => coordinates::velocity_from_report(model, q, qdot)?,
            Self::State => coordinates::checked_velocity(model, qdot)?,
        })
    }
}

impl RoverModel {
    fn wrap(model: Result<Model, ModelError>) -> PyResult<Self> {
        Ok(Arc::new(model.map_err(BorderError::from)?).into())
    }

    fn placed(
        &self,
        q: &Bound<'_, PyAny>,
        coordinates: Given<'_>,
    ) -> PyResult<(Vec<f64>, Coordinates, Kinematics)> {
        let kind = Coordinates::given(coordinates)?;
        let q = vector(q, Kind::State, "q")?;
        let configuration = kind.configuration(&self.inner, &q)?;
        Ok((q, kind, Kinematics::of(&self.inner, &configuration)))
    }

    fn contacts(
        &self,
        q: &Bound<'_, PyAny>,
        terrain: &Bound<'_, PyAny>,
        coordinates: Given<'_>,
    ) -> PyResult<(Vec<f64>, Coordinates, Kinematics, Vec<Contact>)> {
        let (q, kind, kinematics) = self.placed(q, coordinates)?;
        let contacts = wheel_contacts(&self.inner, &kinematics, &*parse(terrain)?.terrain());
        Ok((q, kind, kinematics, contacts))
    }

    /// Velocity index of a joint; −1 where there is none.
    fn velocity_index(&self, joint: Option<usize>) -> i64 {
        let index = joint.map(|j| self.inner.joint_velocity(j));
        index.and_then(|k| i64::try_from(k).ok()).unwrap_or(-1)
    }

    fn from_json(text: &str) -> PyResult<Self> {
        Self::wrap(ModelDescription::from_json(text).and_then(Model::from_description))
    }
}

/// Points with names: solids, the model's tags, wheel axles, mass centre.
pub fn tags<'py>(
    py: Python<'py>,
    model: &Model,
    kinematics: &Kinematics,
) -> PyResult<Bound<'py, PyDict>> {
    let tags = PyDict::new(py);
    for frame in model.frames() {
        let x = kinematics.origin(frame.body) + kinematics.point(frame.body, &frame.position);
        tags.set_item(&frame.name, fresh(py, x.as_slice()))?;
    }
    for tag in &model.description().tags {
        if let Some(frame) = model.frames().iter().find(|f| f.name == tag.solid) {
            let local = frame.position + frame.rotation * Vector3::from(tag.position);
            let x = kinematics.origin(frame.body) + kinematics.point(frame.body, &local);
            tags.set_item(&tag.name, fresh(py, x.as_slice()))?;
        }
    }
    for wheel in model.wheels() {
        let s = kinematics.R(wheel.body) * wheel.axle;
        tags.set_item(format!("axle_{}", wheel.name), fresh(py, s.as_slice()))?;
    }
    let centre = momentum::centre_of_mass(model, kinematics);
    tags.set_item("centre_of_mass", fresh(py, centre.as_slice()))?;
    Ok(tags)
}

/// Origin and rotation matrix of every solid.
pub fn poses<'py>(
    py: Python<'py>,
    model: &Model,
    kinematics: &Kinematics,
) -> PyResult<Bound<'py, PyDict>> {
    let poses = PyDict::new(py);
    for frame in model.frames() {
        let x = kinematics.origin(frame.body) + kinematics.point(frame.body, &frame.position);
        let R = kinematics.R(frame.body) * frame.rotation;
        let R = DMatrix::from_iterator(3, 3, R.iter().copied());
        poses.set_item(
            &frame.name,
            (fresh(py, x.as_slice()), fresh_matrix(py, &R)?),
        )?;
    }
    Ok(poses)
}

#[pymethods]
impl RoverModel {
    #[new]
    fn new() -> Self {
        Arc::new(Model::rover()).into()
    }

    /// Reads a model file (TOML).
    ///
    /// Args:
    ///     path: Path of the file.
    ///
    /// Returns:
    ///     The model.
    ///
    /// Raises:
    ///     ModelError: The file does not describe a model; the message names the path.
    ///     OSError: The file cannot be read.
    #[staticmethod]
    fn from_file(path: &Bound<'_, PyAny>) -> PyResult<Self> {
        let py = path.py();
        let path = files::path(path, Kind::Model)?;
        let text = read_text(py, &path, Kind::Model, MAX_TEXT)?;
        let model = ModelDescription::from_toml(&text).and_then(Model::from_description);
        Ok(Arc::new(model.map_err(|e| in_file(e.into(), &path))?).into())
    }

    /// Reads a model from TOML text.
    ///
    /// Args:
    ///     text: What a model file holds.
    ///
    /// Returns:
    ///     The model.
    ///
    /// Raises:
    ///     ModelError: The text does not describe a model.
    #[staticmethod]
    fn from_text(text: &Bound<'_, PyAny>) -> PyResult<Self> {
        let text = arguments::text(text, Kind::Model, "text")?;
        Self::wrap(ModelDescription::from_toml(&text).and_then(Model::from_description))
    }

    /// Reads a model from nested dictionaries and lists.
    ///
    /// Args:
    ///     description: What `to_dict` returns.
    ///
    /// Returns:
    ///     The model.
    ///
    /// Raises:
    ///     ModelError: The dictionaries do not describe a model.
    #[staticmethod]
    fn from_dict(description: &Bound<'_, PyAny>) -> PyResult<Self> {
        let py = description.py();
        let options = PyDict::new(py);
        options.set_item("allow_nan", true)?;
        let refuse = |e: &PyErr| {
            let message = format!("the model description cannot be read: {}", e.value(py));
            BorderError {
                kind: Kind::Model,
                message,
                field: Some("text".to_owned()),
                value: Value::Nothing,
            }
        };
        let text: String = py
            .import("json")?
            .call_method("dumps", (description,), Some(&options))
            .map_err(|e| refuse(&e))?
            .extract()?;
        Self::from_json(&text)
    }

    /// Writes a model file (TOML), with locked joints.
    ///
    /// Args:
    ///     path: Path of the file.
    ///
    /// Raises:
    ///     OSError: The file cannot be written.
    fn to_file(&self, path: &Bound<'_, PyAny>) -> PyResult<()> {
        let py = path.py();
        write_text(py, &files::path(path, Kind::Model)?, &self.to_text()?)
    }

    /// The description as TOML text, as `from_text` reads it.
    fn to_text(&self) -> PyResult<String> {
        Ok(self
            .inner
            .description()
            .to_toml()
            .map_err(BorderError::from)?)
    }

    /// The description as nested dictionaries and lists, as `from_dict` reads it.
    fn to_dict<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let text = self
            .inner
            .description()
            .to_json()
            .map_err(BorderError::from)?;
        py.import("json")?.call_method1("loads", (text,))
    }

    /// The model of the gallery with this name.
    ///
    /// Args:
    ///     name: One of `names()`.
    ///
    /// Returns:
    ///     The model.
    ///
    /// Raises:
    ///     ModelError: There is no such model; the message lists those that there are.
    #[staticmethod]
    fn named(name: &Bound<'_, PyAny>) -> PyResult<Self> {
        let name = arguments::text(name, Kind::Model, "name")?;
        Self::wrap(ModelDescription::named(&name).and_then(Model::from_description))
    }

    /// Names of the models of the gallery; the first is the built-in rover.
    #[staticmethod]
    fn names() -> Vec<&'static str> {
        ModelDescription::names().to_vec()
    }

    /// Reads a URDF file.
    ///
    /// The file's axes (x forward, y left, z up) are converted to ours (x forward, y up, z right)
    /// in every frame. `import_report` says what was understood, assumed and left out.
    ///
    /// Args:
    ///     path: Path of the file.
    ///     wheels: Names of the wheels' links or joints, or their radii by name, m. None: found
    ///         from shapes and names. An empty list: none.
    ///     steering: Names of the steering links or joints, or those of each wheel by its name.
    ///         None: found from their axes. An empty list: none.
    ///     free_base: Whether the root moves freely; otherwise it is fixed to the world.
    ///     forward: The file's axis along which the machine drives: "x", "-x", "y" or "-y".
    ///     torque_limit: Largest torque of every wheel, N m; by default the file's.
    ///     steering_stiffness: Stiffness of every steering controller, N m/rad.
    ///     steering_damping: Damping of every steering controller, N m s/rad.
    ///     steering_limit: Largest steering set-point, rad; by default the joint's stop.
    ///     wheel_width: Width of every wheel, m, 0 for thin discs, which cost less to simulate; by
    ///         default that of the cylinder that touches for it in the file, or 0.
    ///     wheel_stiffness: Normal stiffness of every wheel where it touches, N/m, 0 for rigid
    ///         wheels. By default a wheel yields 0.03 mm under its share of the weight, which
    ///         decides how the ground shares the weight among the wheels of a rigid chassis.
    ///     ignore: Kinds of what changes the motion and is left out all the same: "friction",
    ///         "actuators", "closed loops", "tendons", "springs", "fluid".
    ///     package_paths: Folders that are searched for the packages of `package://` names, before
    ///         those of the environment variables `ROS_PACKAGE_PATH` and `AMENT_PREFIX_PATH` and
    ///         the folders above the file.
    ///
    /// Returns:
    ///     The model.
    ///
    /// Raises:
    ///     ModelError: The file is malformed, holds what cannot be simulated, or leaves open which
    ///         links are wheels; the message names file, element and value.
    ///     ImportError: The extra `models` is not installed.
    ///     OSError: The file cannot be read.
    #[staticmethod]
    #[pyo3(signature = (path, *, wheels = Given::MISSING, steering = Given::MISSING, free_base = Given::MISSING,
        forward = Given::MISSING, torque_limit = Given::MISSING, steering_stiffness = Given::MISSING,
        steering_damping = Given::MISSING, steering_limit = Given::MISSING,
        wheel_width = Given::MISSING, wheel_stiffness = Given::MISSING, ignore = Given::MISSING,
        package_paths = Given::MISSING),
        text_signature = "(path, *, wheels=None, steering=None, free_base=True, forward=\"x\", torque_limit=None, \
        steering_stiffness=None, steering_damping=None, steering_limit=None, wheel_width=None, wheel_stiffness=None, ignore=(), \
        package_paths=())")]
    #[allow(clippy::too_many_arguments)] // keyword arguments of a Python method
    fn from_urdf<'py>(
        path: &Bound<'py, PyAny>,
        wheels: Given<'py>,
        steering: Given<'py>,
        free_base: Given<'py>,
        forward: Given<'py>,
        torque_limit: Given<'py>,
        steering_stiffness: Given<'py>,
        steering_damping: Given<'py>,
        steering_limit: Given<'py>,
        wheel_width: Given<'py>,
        wheel_stiffness: Given<'py>,
        ignore: Given<'py>,
        package_paths: Given<'py>,
    ) -> PyResult<Self> {
        let options = vec![
            ("wheels", wheels),
            ("steering", steering),
            ("free_base", free_base),
            ("forward", forward),
            ("torque_limit", torque_limit),
            ("steering_stiffness", steering_stiffness),
            ("steering_damping", steering_damping),
            ("steering_limit", steering_limit),
            ("wheel_width", wheel_width),
            ("wheel_stiffness", wheel_stiffness),
            ("ignore", ignore),
            ("package_paths", package_paths),
        ];
        Self::imported("read_urdf", path, options)
    }

    /// Reads an MJCF file, which MuJoCo compiles.
    ///
    /// As `from_urdf`, but that the file says whether the base is free, and position servos become
    /// gains of held joints.
    ///
    /// Args:
    ///     path: Path of the file.
    ///     wheels: Names of the wheels' bodies or joints, or their radii by name, m. None: found
    ///         from shapes and names. An empty list: none.
    ///     steering: Names of the steering bodies or joints, or those of each wheel by its name.
    ///         None: found from their axes. An empty list: none.
    ///     free_base: Whether the root moves freely. None: as in the file.
    ///     forward: The file's axis along which the machine drives: "x", "-x", "y" or "-y".
    ///     torque_limit: Largest torque of every wheel, N m; by default the file's.
    ///     steering_stiffness: Stiffness of every steering controller, N m/rad.
    ///     steering_damping: Damping of every steering controller, N m s/rad.
    ///     steering_limit: Largest steering set-point, rad; by default the joint's stop.
    ///     wheel_width: Width of every wheel, m, 0 for thin discs, which cost less to simulate; by
    ///         default that of the cylinder that touches for it in the file, or 0.
    ///     wheel_stiffness: Normal stiffness of every wheel where it touches, N/m, 0 for rigid
    ///         wheels. By default a wheel yields 0.03 mm under its share of the weight, which
    ///         decides how the ground shares the weight among the wheels of a rigid chassis.
    ///     ignore: Kinds of what changes the motion and is left out all the same: "friction",
    ///         "actuators", "closed loops", "tendons", "springs", "fluid".
    ///
    /// Returns:
    ///     The model.
    ///
    /// Raises:
    ///     ModelError: MuJoCo refuses the file, it holds what cannot be simulated, or it leaves
    ///         open which bodies are wheels.
    ///     ImportError: MuJoCo is not installed.
    ///     OSError: The file cannot be read.
    #[staticmethod]
    #[pyo3(signature = (path, *, wheels = Given::MISSING, steering = Given::MISSING, free_base = Given::MISSING,
        forward = Given::MISSING, torque_limit = Given::MISSING, steering_stiffness = Given::MISSING,
        steering_damping = Given::MISSING, steering_limit = Given::MISSING,
        wheel_width = Given::MISSING, wheel_stiffness = Given::MISSING, ignore = Given::MISSING),
        text_signature = "(path, *, wheels=None, steering=None, free_base=None, forward=\"x\", torque_limit=None, \
        steering_stiffness=None, steering_damping=None, steering_limit=None, wheel_width=None, wheel_stiffness=None, ignore=())")]
    #[allow(clippy::too_many_arguments)] // keyword arguments of a Python method
    fn from_mjcf<'py>(
        path: &Bound<'py, PyAny>,
        wheels: Given<'py>,
        steering: Given<'py>,
        free_base: Given<'py>,
        forward: Given<'py>,
        torque_limit: Given<'py>,
        steering_stiffness: Given<'py>,
        steering_damping: Given<'py>,
        steering_limit: Given<'py>,
        wheel_width: Given<'py>,
        wheel_stiffness: Given<'py>,
        ignore: Given<'py>,
    ) -> PyResult<Self> {
        let options = vec![
            ("wheels", wheels),
            ("steering", steering),
            ("free_base", free_base),
            ("forward", forward),
            ("torque_limit", torque_limit),
            ("steering_stiffness", steering_stiffness),
            ("steering_damping", steering_damping),
            ("steering_limit", steering_limit),
            ("wheel_width", wheel_width),
            ("wheel_stiffness", wheel_stiffness),
            ("ignore", ignore),
        ];
        Self::imported("read_mjcf", path, options)
    }

    /// What the import of this model understood, assumed and left out.
    ///
    /// A `rover_gym.models.ImportReport`; None for a model that was not imported, and for one that
    /// was derived from an imported one.
    #[getter]
    fn import_report(&self, py: Python<'_>) -> Option<Py<PyAny>> {
        self.report.as_ref().map(|report| report.clone_ref(py))
    }

    /// Writes a URDF file, for other programs: x forward, y left, z up.
    ///
    /// Wheels are written as cylinders; a thin disc is a tenth of its radius wide and named so.
    ///
    /// Args:
    ///     path: Path of the file.
    ///     ignore: Kinds of what the format cannot express and is left out all the same: "springs",
    ///         "armature".
    ///
    /// Raises:
    ///     ModelError: The model has a spherical joint, several trees, or what the format cannot
    ///         express and `ignore` does not name.
    ///     OSError: The file cannot be written.
    #[pyo3(signature = (path, *, ignore = Given::MISSING), text_signature = "($self, path, *, ignore=())")]
    fn to_urdf<'py>(&self, path: &Bound<'py, PyAny>, ignore: Given<'py>) -> PyResult<()> {
        self.write("write_urdf", path, vec![("ignore", ignore)])
    }

    /// Writes an MJCF file, for MuJoCo: x forward, y left, z up.
    ///
    /// Wheels are written as cylinders, of which a thin disc is a tenth of its radius wide and
    /// named so, their drives as motors, held steering as position servos, and coupled joints as
    /// equality constraints, which MuJoCo satisfies approximately.
    ///
    /// Args:
    ///     path: Path of the file.
    ///
    /// Raises:
    ///     OSError: The file cannot be written.
    fn to_mjcf(&self, path: &Bound<'_, PyAny>) -> PyResult<()> {
        self.write("write_mjcf", path, Vec::new())
    }

    /// Returns a model that differs in what is given.
    ///
    /// Args:
    ///     wheel_radius: Radius of all wheels, m: shape, inertia and contact change together.
    ///     contact_radius: Radius at which the wheels touch the ground, m; shape and inertia stay
    ///         as they are.
    ///     wheel_stiffness: Normal stiffness of all wheels where they touch, N/m, 0 for rigid
    ///         wheels, which have no damping either.
    ///     wheel_damping: Normal damping beside the stiffness, N s/m.
    ///     masses: Masses by name of the solid, or one for each solid, kg. Inertias scale with
    ///         them.
    ///     steering_stiffness: Stiffness of every steering controller, N m/rad.
    ///     steering_damping: Damping of every steering controller, N m s/rad.
    ///     wheel_torque_limit: Largest torque of every wheel, N m.
    ///     mass_scale: Factor of all masses and inertias.
    ///     motor: The motor of all wheels: a `Motor`, its fields by name, or None for wheels that
    ///         give their command at any speed. Left out, the motors stay.
    ///
    /// Returns:
    ///     The new model; this one stays as it is.
    ///
    /// Raises:
    ///     ModelError: A number is out of its range, a solid has no such name, or a wheel radius is
    ///         given where a wheel's solid is no disc.
    #[pyo3(signature = (*, wheel_radius = None, contact_radius = None, wheel_stiffness = None, wheel_damping = None, masses = None, steering_stiffness = None, steering_damping = None,
        wheel_torque_limit = None, mass_scale = None, motor = Given::MISSING),
        text_signature = "($self, *, wheel_radius=None, contact_radius=None, wheel_stiffness=None, wheel_damping=None, masses=None, steering_stiffness=None, steering_damping=None, \
        wheel_torque_limit=None, mass_scale=None, motor=...)")]
    #[allow(clippy::too_many_arguments)] // keyword arguments of a Python method
    fn replace(
        &self,
        wheel_radius: Option<&Bound<'_, PyAny>>,
        contact_radius: Option<&Bound<'_, PyAny>>,
        wheel_stiffness: Option<&Bound<'_, PyAny>>,
        wheel_damping: Option<&Bound<'_, PyAny>>,
        masses: Option<&Bound<'_, PyAny>>,
        steering_stiffness: Option<&Bound<'_, PyAny>>,
        steering_damping: Option<&Bound<'_, PyAny>>,
        wheel_torque_limit: Option<&Bound<'_, PyAny>>,
        mass_scale: Option<&Bound<'_, PyAny>>,
        motor: Given<'_>,
    ) -> PyResult<Self> {
        let read = |given: Option<&Bound<'_, PyAny>>, field| {
            given.map(|x| number(x, Kind::Model, field)).transpose()
        };
        let mut description = self.inner.description().clone();
        if let Some(limit) = read(wheel_torque_limit, "wheel_torque_limit")? {
            for wheel in &mut description.wheels {
                wheel.torque_limit = limit;
            }
        }
        let (stiffness, damping) = (
            read(wheel_stiffness, "wheel_stiffness")?,
            read(wheel_damping, "wheel_damping")?,
        );
        for wheel in &mut description.wheels {
            if let Some(stiffness) = stiffness {
                let yields = stiffness != 0.0;
                wheel.stiffness = yields.then_some(stiffness);
                wheel.damping = wheel.damping.filter(|_| yields);
            }
            wheel.damping = damping.or(wheel.damping);
        }
        if let Some(motor) = motor.given() {
            let motor = motor::parse(&motor)?;
            for wheel in &mut description.wheels {
                wheel.motor = motor;
            }
        }
        if let Some(masses) = masses {
            replace_masses(&mut description, masses)?;
        }
        if let Some(scale) = read(mass_scale, "mass_scale")? {
            for solid in &mut description.solids {
                solid.set_mass(solid.mass * scale);
            }
        }
        let stiffness = read(steering_stiffness, "steering_stiffness")?;
        let damping = read(steering_damping, "steering_damping")?;
        let steering: HashSet<String> = description
            .wheels
            .iter()
            .filter_map(|w| w.steering.clone())
            .collect();
        for solid in &mut description.solids {
            if let (Some(hold), true) = (&mut solid.hold, steering.contains(&solid.name)) {
                hold.stiffness = stiffness.unwrap_or(hold.stiffness);
                hold.damping = damping.unwrap_or(hold.damping);
            }
        }
        let mut model = Model::from_description(description).map_err(BorderError::from)?;
        if let Some(radius) = read(wheel_radius, "wheel_radius")? {
            model = model.with_wheel_radius(radius).map_err(BorderError::from)?;
        }
        if let Some(radius) = read(contact_radius, "contact_radius")? {
            model = model
                .with_contact_radius(radius)
                .map_err(BorderError::from)?;
        }
        Self::wrap(Ok(model))
    }

    /// Returns the same machine with joints locked; their coordinates are gone.
    ///
    /// Args:
    ///     joints: Names of joints, which are locked at 0, or a mapping of names to angles, rad.
    ///
    /// Returns:
    ///     The new model. The locks are kept in its files and dictionaries.
    ///
    /// Raises:
    ///     ModelError: There is no such joint, or an angle is not finite.
    fn weld(&self, joints: &Bound<'_, PyAny>) -> PyResult<Self> {
        let joints: Vec<(String, f64)> = if let Ok(map) = joints.cast::<PyMapping>() {
            let angle = |item: Bound<'_, PyAny>| -> PyResult<(String, f64)> {
                let (name, angle): (Bound<'_, PyAny>, Bound<'_, PyAny>) = item.extract()?;
                let name = arguments::text(&name, Kind::Model, "joints")?;
                let angle = number(&angle, Kind::Model, &format!("joints[{name}]"))?;
                Ok((name, angle))
            };
            map.items()?.iter().map(angle).collect::<PyResult<_>>()?
        } else {
            let names = arguments::texts(joints, Kind::Model, "joints")?;
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

    /// Names of the coordinates, x, y, z, roll, heading, pitch, then the joints.
    #[getter]
    fn dof_names(&self) -> Vec<String> {
        let model = &self.inner;
        let mut names = Vec::with_capacity(model.nv());
        for (b, body) in model.bodies().iter().enumerate() {
            let of_body = |x: &str| {
                if b == 0 {
                    x.to_owned()
                } else {
                    format!("{}.{x}", body.name)
                }
            };
            match body.joint {
                Joint::Free(_) => {
                    names.extend(["x", "y", "z", "roll", "heading", "pitch"].map(of_body));
                }
                Joint::Spherical(_) => names.extend(["roll", "heading", "pitch"].map(of_body)),
                Joint::Revolute(_) | Joint::Prismatic(_) if !body.is_coupled => {
                    names.push(body.name.clone());
                }
                Joint::Revolute(_) | Joint::Prismatic(_) | Joint::Fixed => {}
            }
        }
        names
    }

    /// Names of the joints that are not locked, in the order of q.
    #[getter]
    fn joint_names(&self) -> Vec<String> {
        let joints = self.inner.joints().iter();
        joints
            .map(|joint| self.inner.bodies()[joint.body].name.clone())
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
    fn wheel_radii<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_iter(py, self.inner.wheels().iter().map(|w| w.radius))
    }

    /// Radius of the place that the rover needs to turn on the spot, m.
    ///
    /// It is the largest distance from the trunk's origin to a wheel's contact, joints at zero,
    /// plus the wheel's radius and 0.1 m.
    #[getter]
    fn clear_radius(&self) -> f64 {
        clear_radius(&self.inner)
    }

    /// Largest torque of each wheel, (n_wheels,), N m.
    #[getter]
    fn wheel_torque_limits<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_iter(py, self.inner.wheels().iter().map(|w| w.torque_limit))
    }

    /// The motor of each wheel; None where the torque is the command at any speed.
    #[getter]
    fn motors(&self) -> Vec<Option<Motor>> {
        let wheels = self.inner.wheels().iter();
        wheels.map(|wheel| wheel.motor.map(Motor::from)).collect()
    }

    /// Index in q of each wheel's rotation; -1 where it is locked.
    #[getter]
    fn wheel_joint_indices(&self) -> Vec<i64> {
        self.inner
            .wheels()
            .iter()
            .map(|w| self.velocity_index(w.joint))
            .collect()
    }

    /// Index in q of each wheel's steering joint; -1 where there is none or it is locked.
    #[getter]
    fn steering_joint_indices(&self) -> Vec<i64> {
        self.inner
            .wheels()
            .iter()
            .map(|w| self.velocity_index(w.steering))
            .collect()
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
    /// Raises:
    ///     StateError: `q` has a wrong length or an entry that is not finite.
    ///     OptionError: `coordinates` is neither of the two.
    ///
    /// Source: Featherstone 2008, ch. 6.
    #[pyo3(signature = (q, coordinates = Given::MISSING), text_signature = "($self, q, coordinates='state')")]
    fn mass_matrix<'py>(
        &self,
        py: Python<'py>,
        q: &Bound<'_, PyAny>,
        coordinates: Given<'py>,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let (q, kind, kinematics) = self.placed(q, coordinates)?;
        let dense = kinematics.mass_matrix(&self.inner);
        match kind {
            Coordinates::State => fresh_matrix(py, &dense),
            Coordinates::Report => fresh_matrix(
                py,
                &coordinates::congruence(&dense, &coordinates::report_angles(&self.inner, &q)),
            ),
        }
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
    ///     StateError: `q` or `qdot` has a wrong length or an entry that is not finite.
    ///     OptionError: `gravity` is not three finite numbers, or `coordinates` is neither of the
    ///         two.
    ///
    /// Source: Featherstone 2008, ch. 5.
    #[pyo3(signature = (q, qdot, gravity = None, coordinates = Given::MISSING), text_signature = "($self, q, qdot, gravity=None, coordinates='state')")]
    fn bias<'py>(
        &self,
        py: Python<'py>,
        q: &Bound<'_, PyAny>,
        qdot: &Bound<'_, PyAny>,
        gravity: Option<&Bound<'_, PyAny>>,
        coordinates: Given<'py>,
    ) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let (q, kind, kinematics) = self.placed(q, coordinates)?;
        let qdot = vector(qdot, Kind::State, "qdot")?;
        let v = kind.velocity(&self.inner, &q, &qdot)?;
        let gravity = checked_gravity(gravity)?;
        let out = kinematics.bias(&self.inner, &v, &gravity);
        if kind == Coordinates::State {
            return Ok(fresh(py, &out));
        }
        let angles = coordinates::report_angles(&self.inner, &q);
        let drift = kinematics.mass_matrix(&self.inner) * coordinates::rate_drift(&angles, &qdot);
        let pulled = coordinates::pull_back(&(DVector::from_vec(out) + drift), &angles);
        Ok(fresh(py, pulled.as_slice()))
    }

    /// The matrix that maps wheel torques and steering torques to generalized forces.
    ///
    /// Returns:
    ///     (nv, 2 n_wheels): a column for each wheel's torque, positive forward, then one for each
    ///     steering torque.
    fn actuation_matrix<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let wheels = self.inner.wheels();
        let mut T = DMatrix::zeros(self.inner.nv(), 2 * wheels.len());
        for (i, wheel) in wheels.iter().enumerate() {
            if let Some(j) = wheel.joint {
                T[(self.inner.joint_velocity(j), i)] = wheel.drive_sign;
            }
            if let Some(j) = wheel.steering {
                T[(self.inner.joint_velocity(j), wheels.len() + i)] = 1.0;
            }
        }
        fresh_matrix(py, &T)
    }

    /// The kinetic energy, half of v · M v.
    ///
    /// Args:
    ///     q: Coordinates, (nq,).
    ///     qdot: Velocity in the same coordinates, (nv,).
    ///     coordinates: "state" or "report".
    ///
    /// Returns:
    ///     The energy, J.
    ///
    /// Raises:
    ///     StateError: `q` or `qdot` has a wrong length or an entry that is not finite.
    ///     OptionError: `coordinates` is neither of the two.
    #[pyo3(signature = (q, qdot, coordinates = Given::MISSING), text_signature = "($self, q, qdot, coordinates='state')")]
    fn kinetic_energy(
        &self,
        q: &Bound<'_, PyAny>,
        qdot: &Bound<'_, PyAny>,
        coordinates: Given<'_>,
    ) -> PyResult<f64> {
        let (q, kind, kinematics) = self.placed(q, coordinates)?;
        let v = kind.velocity(&self.inner, &q, &vector(qdot, Kind::State, "qdot")?)?;
        Ok(kinematics
            .energy(&self.inner, &v, &Vector3::zeros())
            .kinetic)
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
    ///
    /// Raises:
    ///     StateError: `q` has a wrong length or an entry that is not finite.
    ///     OptionError: `coordinates` is neither of the two.
    #[pyo3(signature = (q, coordinates = Given::MISSING), text_signature = "($self, q, coordinates='state')")]
    fn tags<'py>(
        &self,
        py: Python<'py>,
        q: &Bound<'_, PyAny>,
        coordinates: Given<'py>,
    ) -> PyResult<Bound<'py, PyDict>> {
        tags(py, &self.inner, &self.placed(q, coordinates)?.2)
    }

    /// The pose of every solid in the world frame.
    ///
    /// Args:
    ///     q: Coordinates, (nq,).
    ///     coordinates: "state" or "report".
    ///
    /// Returns:
    ///     Origin (3,), m, and rotation matrix (3, 3) by name of the solid.
    ///
    /// Raises:
    ///     StateError: `q` has a wrong length or an entry that is not finite.
    ///     OptionError: `coordinates` is neither of the two.
    #[pyo3(signature = (q, coordinates = Given::MISSING), text_signature = "($self, q, coordinates='state')")]
    fn poses<'py>(
        &self,
        py: Python<'py>,
        q: &Bound<'_, PyAny>,
        coordinates: Given<'py>,
    ) -> PyResult<Bound<'py, PyDict>> {
        poses(py, &self.inner, &self.placed(q, coordinates)?.2)
    }

    /// The distance of each wheel to the terrain.
    ///
    /// Args:
    ///     q: Coordinates, (nq,).
    ///     terrain: A terrain, or a list of several.
    ///     coordinates: "state" or "report".
    ///
    /// Returns:
    ///     (n_wheels,), m, positive when apart.
    ///
    /// Raises:
    ///     StateError: `q` has a wrong length or an entry that is not finite.
    ///     TerrainError: `terrain` is not a terrain.
    ///     OptionError: `coordinates` is neither of the two.
    #[pyo3(signature = (q, terrain, coordinates = Given::MISSING), text_signature = "($self, q, terrain, coordinates='state')")]
    fn wheel_gaps<'py>(
        &self,
        py: Python<'py>,
        q: &Bound<'_, PyAny>,
        terrain: &Bound<'_, PyAny>,
        coordinates: Given<'py>,
    ) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let contacts = self.contacts(q, terrain, coordinates)?.3;
        Ok(PyArray1::from_iter(py, contacts.iter().map(|c| c.gap)))
    }

    /// The coordinates of the rover at rest on a terrain.
    ///
    /// On a plane the joints are at zero, the trunk is upright along the normal with its origin
    /// above the position, and the lowest wheel has gap zero. If that leaves wheels in the air,
    /// pitch, roll and the joints that nothing drives bring them down, where this puts more wheels
    /// on the ground. On any other terrain the same coordinates bring all wheels down to the ground
    /// as far as they can. No wheel is in the ground.
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
    ///     TerrainError: `terrain` is no terrain, or does not say what the ground is under the
    ///         trunk or a wheel.
    ///     StateError: A number is not finite, or the plane is vertical.
    fn resting_pose<'py>(
        &self,
        py: Python<'py>,
        terrain: &Bound<'_, PyAny>,
        position: &Bound<'_, PyAny>,
        heading: &Bound<'_, PyAny>,
    ) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let ground = parse(terrain)?;
        let place = two(position, Kind::State, "position")?;
        let heading = number(heading, Kind::State, "heading")?;
        let q = if let DrawnGround::Plane(plane) = &ground {
            resting_pose(&self.inner, plane, place, heading).map_err(BorderError::from)?
        } else {
            let terrain = ground.terrain();
            let q = py.detach(|| resting_on(&self.inner, &*terrain, place, heading));
            q.map_err(BorderError::from)?
        };
        Ok(fresh(py, &q))
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
    ///
    /// Raises:
    ///     StateError: `q` has a wrong length or an entry that is not finite.
    ///     TerrainError: `terrain` is not a terrain.
    ///     OptionError: `coordinates` is neither of the two.
    #[pyo3(signature = (q, terrain, coordinates = Given::MISSING), text_signature = "($self, q, terrain, coordinates='state')")]
    fn wheel_contact_points<'py>(
        &self,
        py: Python<'py>,
        q: &Bound<'_, PyAny>,
        terrain: &Bound<'_, PyAny>,
        coordinates: Given<'py>,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let (_, _, kinematics, contacts) = self.contacts(q, terrain, coordinates)?;
        let rows: Vec<[f64; 3]> = contacts
            .iter()
            .map(|c| (kinematics.origin(c.body) + c.point).into())
            .collect();
        fresh_rows(py, &rows)
    }

    /// The contact Jacobian of each wheel: u = J v is the velocity of its contact point.
    ///
    /// Args:
    ///     q: Coordinates, (nq,).
    ///     terrain: A terrain, or a list of several.
    ///     coordinates: "state" or "report".
    ///
    /// Returns:
    ///     (n_wheels, 3, nv): rows along the normal, the rolling direction and the lateral
    ///     direction.
    ///
    /// Raises:
    ///     StateError: `q` has a wrong length or an entry that is not finite.
    ///     TerrainError: `terrain` is not a terrain.
    ///     OptionError: `coordinates` is neither of the two.
    #[pyo3(signature = (q, terrain, coordinates = Given::MISSING), text_signature = "($self, q, terrain, coordinates='state')")]
    fn wheel_jacobians<'py>(
        &self,
        py: Python<'py>,
        q: &Bound<'_, PyAny>,
        terrain: &Bound<'_, PyAny>,
        coordinates: Given<'py>,
    ) -> PyResult<Bound<'py, PyArray3<f64>>> {
        let (q, kind, kinematics, contacts) = self.contacts(q, terrain, coordinates)?;
        let nv = self.inner.nv();
        let mut rows = Vec::with_capacity(contacts.len() * 3 * nv);
        for contact in &contacts {
            let path = self.inner.path(contact.body);
            for d in contact.frame.rows() {
                let mut along = vec![0.0; path.len()];
                kinematics.point_jacobian_row(
                    &self.inner,
                    contact.body,
                    &contact.point,
                    &d,
                    &mut along,
                );
                let mut full = DVector::zeros(nv);
                for (entry, &k) in along.iter().zip(path) {
                    full[k] = *entry;
                }
                if kind == Coordinates::Report {
                    full =
                        coordinates::pull_back(&full, &coordinates::report_angles(&self.inner, &q));
                }
                rows.extend_from_slice(full.as_slice());
            }
        }
        fresh_blocks(py, rows, [contacts.len(), 3, nv])
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
    fn to_report<'py>(
        &self,
        py: Python<'py>,
        q: &Bound<'_, PyAny>,
        v: &Bound<'_, PyAny>,
    ) -> PyResult<Pair<'py>> {
        let configuration =
            Coordinates::State.configuration(&self.inner, &vector(q, Kind::State, "q")?)?;
        let v = coordinates::checked_velocity(&self.inner, &vector(v, Kind::State, "v")?)
            .map_err(BorderError::from)?;
        let (q, qdot) =
            coordinates::to_report(&self.inner, &configuration, &v).map_err(BorderError::from)?;
        Ok((fresh(py, &q), fresh(py, &qdot)))
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
    fn from_report<'py>(
        &self,
        py: Python<'py>,
        q: &Bound<'_, PyAny>,
        qdot: &Bound<'_, PyAny>,
    ) -> PyResult<Pair<'py>> {
        let q = vector(q, Kind::State, "q")?;
        let configuration = Coordinates::Report.configuration(&self.inner, &q)?;
        let v =
            Coordinates::Report.velocity(&self.inner, &q, &vector(qdot, Kind::State, "qdot")?)?;
        Ok((
            fresh(py, &coordinates::to_public(&self.inner, &configuration)),
            fresh(py, &v),
        ))
    }

    fn __repr__(&self) -> String {
        let m = &self.inner;
        format!(
            "RoverModel({:?}, nv={}, mass={})",
            m.description().name,
            m.nv(),
            m.mass()
        )
    }

    fn __eq__(&self, other: &Bound<'_, PyAny>) -> bool {
        other
            .cast::<Self>()
            .is_ok_and(|o| o.get().inner.description() == self.inner.description())
    }

    fn __hash__(&self) -> PyResult<u64> {
        use std::hash::{DefaultHasher, Hash, Hasher};
        let mut hasher = DefaultHasher::new();
        self.inner
            .description()
            .to_json()
            .map_err(BorderError::from)?
            .hash(&mut hasher);
        Ok(hasher.finish())
    }

    #[staticmethod]
    fn _restore(text: &str) -> PyResult<Self> {
        Self::from_json(text)
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<(Bound<'py, PyAny>, (String,))> {
        let description = slf.get().inner.description();
        let text = description.to_json().map_err(BorderError::from)?;
        Ok((slf.get_type().getattr("_restore")?, (text,)))
    }
}

/// Masses by name, or one for each solid.
fn replace_masses(description: &mut ModelDescription, masses: &Bound<'_, PyAny>) -> PyResult<()> {
    if let Ok(map) = masses.cast::<PyMapping>() {
        for item in map.items()?.iter() {
            let (name, mass): (Bound<'_, PyAny>, Bound<'_, PyAny>) = item.extract()?;
            let name = arguments::text(&name, Kind::Model, "masses")?;
            let mass = number(&mass, Kind::Model, &format!("masses[{name}]"))?;
            let Some(solid) = description.solids.iter_mut().find(|s| s.name == name) else {
                let field = "masses".to_owned();
                return Err(BorderError::from(ModelError::UnknownName { field, name }).into());
            };
            solid.set_mass(mass);
        }
        return Ok(());
    }
    let values = vector(masses, Kind::Model, "masses")?;
    if values.len() != description.solids.len() {
        let message = format!(
            "masses: needs {} entries, has {}",
            description.solids.len(),
            values.len()
        );
        return Err(BorderError {
            kind: Kind::Model,
            message,
            field: Some("masses".to_owned()),
            value: Value::Count(values.len()),
        }
        .into());
    }
    for (solid, mass) in description.solids.iter_mut().zip(values) {
        solid.set_mass(mass);
    }
    Ok(())
}

/// Three finite numbers, by default Earth's.
pub fn checked_gravity(gravity: Option<&Bound<'_, PyAny>>) -> PyResult<Vector3<f64>> {
    let given = gravity.map_or(Ok([0.0, -9.81, 0.0]), |g| {
        triple(g, Kind::Option, "gravity")
    })?;
    for value in given {
        if !value.is_finite() {
            let message = format!("gravity: must be finite, is {given:?}");
            return Err(
                BorderError::option("gravity", message, Value::Numbers(given.to_vec())).into(),
            );
        }
    }
    Ok(given.into())
}
