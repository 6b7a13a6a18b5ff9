//! The exception tree: one root, shape and value mistakes also
//! `ValueError`, fields kept as attributes.

use pyo3::exceptions::{PyException, PyRuntimeError, PyValueError};
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::{PyDict, PyTuple, PyType};
use rover_core::draw::{DrawError, PlacementError, Unsuitable};
use rover_core::episode::EpisodeError;
use rover_core::geometry::TerrainError;
use rover_core::integrator::{OptionsError, StepError};
use rover_core::multibody::{ModelError, StateError};
use rover_core::problem::ProblemError;
use rover_core::simulation::{BatchError, CommandError, SnapshotError};

/// Characters of an exception's message.
const LONGEST_MESSAGE: usize = 1000;

/// Docstring of the root.
const ROOT: &str = "Root of every error that rover-gym raises.

Attributes:
    field: Name of the argument at fault, with the index of the entry; None where there is none.
    value: What was given there, or None.
";

/// Which exception.
#[derive(Clone, Copy, Debug)]
pub enum Kind {
    Model,
    State,
    Terrain,
    Option,
    Command,
    Problem,
    Step,
    Busy,
}

/// What was given where something else was needed.
#[derive(Debug)]
pub enum Value {
    Nothing,
    Number(f64),
    Numbers(Vec<f64>),
    Count(usize),
    Text(String),
    Object(Py<PyAny>),
}

/// An error on its way to Python. A newtype, since neither crate owns both
/// `ModelError` and `PyErr`.
#[derive(Debug)]
pub struct BorderError {
    pub kind: Kind,
    pub message: String,
    pub field: Option<String>,
    pub value: Value,
}

struct Classes {
    model: Py<PyType>,
    state: Py<PyType>,
    terrain: Py<PyType>,
    option: Py<PyType>,
    command: Py<PyType>,
    problem: Py<PyType>,
    step: Py<PyType>,
    busy: Py<PyType>,
}

static CLASSES: PyOnceLock<Classes> = PyOnceLock::new();

/// Makes the exception classes and adds them to the module.
pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    let py = module.py();
    let make = |name: &str, bases: Bound<'_, PyTuple>, doc: &str| -> PyResult<Py<PyType>> {
        let body = PyDict::new(py);
        body.set_item("__module__", "rover_gym.mechanics")?;
        body.set_item("__doc__", doc)?;
        body.set_item("field", py.None())?;
        body.set_item("value", py.None())?;
        let class = py
            .get_type::<PyType>()
            .call1((name, bases, body))?
            .cast_into::<PyType>()?;
        module.add(name, &class)?;
        Ok(class.unbind())
    };
    let exception = PyTuple::new(py, [py.get_type::<PyException>()])?;
    let root = make("RoverGymError", exception, ROOT)?;
    let root = root.bind(py);
    let value_error = || PyTuple::new(py, [root.clone(), py.get_type::<PyValueError>()]);
    let classes = Classes {
        model: make(
            "ModelError",
            value_error()?,
            "A model's description is unreadable or not physical.",
        )?,
        state: make(
            "StateError",
            value_error()?,
            "A state or a snapshot has a wrong shape or an entry that is not finite.",
        )?,
        terrain: make(
            "TerrainError",
            value_error()?,
            "A terrain's description is invalid.",
        )?,
        option: make(
            "OptionError",
            value_error()?,
            "An option or another argument is out of its range.",
        )?,
        command: make(
            "CommandError",
            value_error()?,
            "A torque, a set-point or an action is invalid.",
        )?,
        problem: make(
            "ProblemError",
            value_error()?,
            "A friction-contact problem has a wrong shape or an invalid entry.",
        )?,
        step: make(
            "StepError",
            PyTuple::new(py, [root.clone(), py.get_type::<PyRuntimeError>()])?,
            "A time step could not be taken; the state is as it was before that step.",
        )?,
        busy: make(
            "BusyError",
            PyTuple::new(py, [root.clone(), py.get_type::<PyRuntimeError>()])?,
            "An object was used while another call on it was still going on. Nothing has changed.",
        )?,
    };
    let _ = CLASSES.set(py, classes);
    Ok(())
}

impl From<BorderError> for PyErr {
    fn from(error: BorderError) -> Self {
        Python::attach(|py| {
            let Some(classes) = CLASSES.get(py) else {
                return PyRuntimeError::new_err(error.message);
            };
            let class = match error.kind {
                Kind::Model => &classes.model,
                Kind::State => &classes.state,
                Kind::Terrain => &classes.terrain,
                Kind::Option => &classes.option,
                Kind::Command => &classes.command,
                Kind::Problem => &classes.problem,
                Kind::Step => &classes.step,
                Kind::Busy => &classes.busy,
            };
            let raise = || -> PyResult<PyErr> {
                let instance = class.bind(py).call1((shortened(error.message),))?;
                instance.setattr("field", error.field)?;
                match error.value {
                    Value::Nothing => instance.setattr("value", py.None())?,
                    Value::Number(x) => instance.setattr("value", x)?,
                    Value::Numbers(x) => instance.setattr("value", x)?,
                    Value::Count(x) => instance.setattr("value", x)?,
                    Value::Text(x) => instance.setattr("value", x)?,
                    Value::Object(x) => instance.setattr("value", x)?,
                }
                Ok(PyErr::from_value(instance))
            };
            raise().unwrap_or_else(|e| e)
        })
    }
}

/// A message that may hold a long text that was given.
fn shortened(message: String) -> String {
    if message.chars().count() <= LONGEST_MESSAGE {
        return message;
    }
    let start = message.chars().take(LONGEST_MESSAGE);
    start.chain("…".chars()).collect()
}

impl BorderError {
    /// An option or argument that is not what it must be.
    pub fn option(field: &str, message: String, value: Value) -> Self {
        Self {
            kind: Kind::Option,
            message,
            field: Some(field.to_owned()),
            value,
        }
    }
}

impl BorderError {
    /// A goal that does not suit the ground; the message is still to be written.
    fn of_goal(x: f64, z: f64) -> Self {
        Self {
            kind: Kind::Terrain,
            message: String::new(),
            field: Some("goal".to_owned()),
            value: Value::Numbers(vec![x, z]),
        }
    }
}

impl From<ModelError> for BorderError {
    fn from(e: ModelError) -> Self {
        let value = match &e {
            ModelError::Unreadable { .. }
            | ModelError::NoSolids
            | ModelError::Missing { .. }
            | ModelError::NotForJoint { .. }
            | ModelError::OtherTree { .. }
            | ModelError::CoupledApart { .. }
            | ModelError::CannotCollide { .. }
            | ModelError::NotWithShapes { .. }
            | ModelError::HalfGiven { .. }
            | ModelError::NoVolume { .. } => Value::Nothing,
            ModelError::DuplicateName { name, .. }
            | ModelError::UnknownParent { name, .. }
            | ModelError::UnknownName { name, .. }
            | ModelError::NotADisc { solid: name, .. }
            | ModelError::UnknownModel { name, .. }
            | ModelError::MaterialName { name, .. }
            | ModelError::SteeringNotAbove { name, .. } => Value::Text(name.clone()),
            ModelError::NotFinite { value, .. }
            | ModelError::NotPositive { value, .. }
            | ModelError::NotBelow { value, .. }
            | ModelError::Negative { value, .. }
            | ModelError::OutOfRange { value, .. }
            | ModelError::MassesContradict { value, .. }
            | ModelError::RadiusContradictsShape { value, .. }
            | ModelError::NotASign { value, .. } => Value::Number(*value),
            #[allow(clippy::cast_precision_loss)] // a number to show
            ModelError::UnknownFormat { format } => Value::Number(*format as f64),
            ModelError::TooMany { count, .. } => Value::Count(*count),
            ModelError::NoDirection { value, .. } => Value::Numbers(value.to_vec()),
            ModelError::ImpossibleInertia { principal, .. } => Value::Numbers(principal.to_vec()),
        };
        Self {
            kind: Kind::Model,
            message: e.to_string(),
            field: Some(e.field().to_owned()),
            value,
        }
    }
}

impl From<StateError> for BorderError {
    fn from(e: StateError) -> Self {
        let (field, value) = match &e {
            StateError::Length { field, actual, .. } => {
                ((*field).to_owned(), Value::Count(*actual))
            }
            StateError::NotFinite {
                field,
                index,
                value,
            } => (format!("{field}[{index}]"), Value::Number(*value)),
            StateError::SingularCardan { index, heading } => {
                (format!("q[{index}]"), Value::Number(*heading))
            }
        };
        Self {
            kind: Kind::State,
            message: e.to_string(),
            field: Some(field),
            value,
        }
    }
}

impl From<TerrainError> for BorderError {
    fn from(e: TerrainError) -> Self {
        let (index, value) = match &e {
            TerrainError::NotFinite { value, .. } | TerrainError::OutOfRange { value, .. } => {
                (None, Value::Number(*value))
            }
            TerrainError::NoDirection { value } => (None, Value::Numbers(value.to_vec())),
            TerrainError::EntryNotFinite { index, value, .. }
            | TerrainError::TooFar { index, value, .. }
            | TerrainError::NonPositiveRadius {
                index,
                radius: value,
            } => (Some(index), Value::Number(*value)),
            TerrainError::MismatchedLengths { radii, .. } => (None, Value::Count(*radii)),
            TerrainError::TooMany { count, .. } | TerrainError::WrongCount { count, .. } => {
                (None, Value::Count(*count))
            }
            TerrainError::Empty | TerrainError::NoTriangles | TerrainError::NoParts => {
                (None, Value::Count(0))
            }
            TerrainError::BadHeight { value, .. } => (None, Value::Number(*value)),
            TerrainError::NoSuchVertex { index, vertex, .. } => {
                (Some(index), Value::Count(*vertex))
            }
            TerrainError::FlatTriangle { index }
            | TerrainError::NotASurface { index, .. }
            | TerrainError::SecondPlane { index }
            | TerrainError::SecondSand { index } => (Some(index), Value::Count(*index)),
            TerrainError::MapSize { .. } | TerrainError::NoData | TerrainError::TooManyPieces => {
                (None, Value::Nothing)
            }
        };
        Self {
            kind: Kind::Terrain,
            message: e.to_string(),
            field: Some(index.map_or_else(
                || e.field().to_owned(),
                |index| format!("{}[{index}]", e.field()),
            )),
            value,
        }
    }
}

impl From<OptionsError> for BorderError {
    fn from(e: OptionsError) -> Self {
        let message = e.to_string();
        match e {
            OptionsError::OutOfRange { field, value, .. } => {
                Self::option(field, message, Value::Number(value))
            }
            OptionsError::BetweenMaterials { value, .. } => {
                Self::option("materials", message, Value::Number(value))
            }
            OptionsError::MaterialsTwice { materials } => {
                Self::option("materials", message, Value::Text(materials.join(", ")))
            }
            OptionsError::MaterialName { name } => {
                Self::option("materials", message, Value::Text(name))
            }
        }
    }
}

impl From<CommandError> for BorderError {
    fn from(e: CommandError) -> Self {
        let (field, value) = match &e {
            CommandError::Length { field, actual, .. } => {
                ((*field).to_owned(), Value::Count(*actual))
            }
            CommandError::NotFinite {
                field,
                index,
                value,
            }
            | CommandError::BeyondLimit {
                field,
                index,
                value,
                ..
            } => (format!("{field}[{index}]"), Value::Number(*value)),
            CommandError::Negative { field, value } => ((*field).to_owned(), Value::Number(*value)),
            CommandError::UnknownJoint { field, name } => {
                ((*field).to_owned(), Value::Text(name.clone()))
            }
        };
        Self {
            kind: Kind::Command,
            message: e.to_string(),
            field: Some(field),
            value,
        }
    }
}

impl From<BatchError> for BorderError {
    fn from(e: BatchError) -> Self {
        let message = e.to_string();
        let (field, value) = match e {
            BatchError::Command { index, error } => {
                let inner = Self::from(error);
                let field = inner.field.map(|field| match field.split_once('[') {
                    Some((name, entry)) => format!("{name}[{index}, {entry}"),
                    None => format!("{field}[{index}]"),
                });
                return Self {
                    message,
                    field,
                    ..inner
                };
            }
            BatchError::Options { index, error } => {
                let inner = Self::from(error);
                let field = inner.field.map(|field| format!("{field}[{index}]"));
                return Self {
                    message,
                    field,
                    ..inner
                };
            }
            BatchError::Empty => ("simulations".to_owned(), Value::Count(0)),
            BatchError::Differs { index, actual, .. } => {
                (format!("simulations[{index}]"), Value::Count(actual))
            }
            BatchError::NoSuchRover { index, .. } => ("index".to_owned(), Value::Count(index)),
            BatchError::Threads { count, .. } => ("threads".to_owned(), Value::Count(count)),
        };
        Self::option(&field, message, value)
    }
}

impl From<DrawError> for BorderError {
    fn from(e: DrawError) -> Self {
        match e {
            DrawError::NoRoom { depth, .. } => Self {
                kind: Kind::Terrain,
                message: e.to_string(),
                field: Some("terrain".to_owned()),
                value: Value::Number(depth),
            },
            DrawError::Unsuitable { why, attempts } => {
                let message = format!("{why}, in the last of {attempts} scenes");
                let own = match why {
                    Unsuitable::Placement(why) => why.into(),
                    Unsuitable::NoGoal { x, z } | Unsuitable::NoWay { to: [x, z], .. } => {
                        Self::of_goal(x, z)
                    }
                };
                Self { message, ..own }
            }
            DrawError::Terrain(e) => e.into(),
            DrawError::Model(e) => e.into(),
            DrawError::State(e) => e.into(),
            DrawError::Options(e) => e.into(),
        }
    }
}

impl From<EpisodeError> for BorderError {
    fn from(e: EpisodeError) -> Self {
        let message = e.to_string();
        match e {
            EpisodeError::Action { place, value } => Self {
                kind: Kind::Command,
                message,
                field: Some(format!("action{place}")),
                value: Value::Number(value),
            },
            EpisodeError::Length { field, actual, .. } => {
                Self::option(field, message, Value::Count(actual))
            }
            EpisodeError::OutOfRange { field, value, .. } => {
                Self::option(field, message, Value::Number(value))
            }
            EpisodeError::OtherRules => Self::option("episode", message, Value::Nothing),
            EpisodeError::NotBegun { index } => Self::option("index", message, Value::Count(index)),
            EpisodeError::NotObservable => Self {
                kind: Kind::State,
                message,
                field: Some("q".to_owned()),
                value: Value::Nothing,
            },
            EpisodeError::Draw(error) => Self::from(error),
            EpisodeError::Batch(error) => Self::from(error),
        }
    }
}

impl From<SnapshotError> for BorderError {
    fn from(e: SnapshotError) -> Self {
        Self {
            kind: Kind::State,
            message: e.to_string(),
            field: Some("snapshot".to_owned()),
            value: Value::Nothing,
        }
    }
}

impl From<StepError> for BorderError {
    fn from(e: StepError) -> Self {
        let (field, value) = match &e {
            StepError::NoGround { x, z, .. } => {
                (Some("terrain".to_owned()), Value::Numbers(vec![*x, *z]))
            }
            _ => (None, Value::Nothing),
        };
        Self {
            kind: Kind::Step,
            message: e.to_string(),
            field,
            value,
        }
    }
}

impl From<PlacementError> for BorderError {
    fn from(e: PlacementError) -> Self {
        match e {
            PlacementError::State(e) => Self::from(e),
            PlacementError::NoGround { x, z } => Self {
                kind: Kind::Terrain,
                message: e.to_string(),
                field: Some("position".to_owned()),
                value: Value::Numbers(vec![x, z]),
            },
        }
    }
}

impl From<ProblemError> for BorderError {
    fn from(e: ProblemError) -> Self {
        let value = match &e {
            ProblemError::VelocityShape { found, .. }
            | ProblemError::OperatorShape { found, .. }
            | ProblemError::OperatorComponents { found, .. } => Value::Count(*found),
            ProblemError::NonFiniteOperator { value, .. }
            | ProblemError::NonFiniteVelocity { value, .. }
            | ProblemError::InvalidFrictionCoefficient { value, .. }
            | ProblemError::NonPositiveNormal { value, .. }
            | ProblemError::NegativeTangential { value, .. } => Value::Number(*value),
            // Also of the variants that may come: the enum is not exhaustive.
            _ => Value::Nothing,
        };
        Self {
            kind: Kind::Problem,
            message: e.to_string(),
            field: Some(e.field()),
            value,
        }
    }
}
