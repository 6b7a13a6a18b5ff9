//! The exception tree: one root, shape and value mistakes also
//! `ValueError`, fields kept as attributes.

use std::convert::Infallible;
use std::fmt::Display;

use pyo3::IntoPyObjectExt;
use pyo3::exceptions::{PyException, PyRuntimeError, PyValueError};
use pyo3::panic::PanicException;
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::{PyDict, PyList, PyTuple, PyType};
use rover_core::caught::Fault;
use rover_core::contact::placement::PlacementError;
use rover_core::geometry::TerrainError;
use rover_core::integrator::{OptionsError, StepError};
use rover_core::multibody::{ModelError, ModelFault, StateError};
use rover_core::problem::ProblemError;
use rover_core::quantity::legible;
use rover_core::simulation::{BatchError, CommandError, SnapshotError};
use rover_task::draw::{DrawError, Unsuitable};
use rover_task::episode::EpisodeError;

/// Result of a call that may raise a Python exception.
pub type Result<T, E = BorderError> = std::result::Result<T, E>;

/// Characters of an exception's message.
const LONGEST_MESSAGE: usize = 1000;

/// Docstring of the root.
const ROOT: &str = "Base class of all rover-gym errors.

Attributes:
    field: Name of the invalid argument, with the index of the entry; None if the error concerns no argument.
    value: The value given, or None.
";

/// Which exception, by its place in [`CLASSES`].
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
    Internal,
}

/// Name and docstring of each exception, in the order of [`Kind`].
const CLASSES: &str = "\
ModelError: The description of a model cannot be read or is not physical.
StateError: A state or a snapshot has a wrong shape or an entry that is not finite.
TerrainError: A terrain's description is invalid.
OptionError: An option or another argument is invalid or out of range.
CommandError: A torque, a set-point or an action is invalid.
ProblemError: A friction-contact problem has a wrong shape or an invalid entry.
StepError: A time step failed. The state is the one before that step.
BusyError: An object was used while another call on it was still running. Nothing has changed.
InternalError: A fault of rover-gym. Please report it, with what led to it and the message, which names the place.";

/// What is asked of whoever meets a fault.
const REPORT: &str = "This is a fault of rover-gym. Please report it, with what led to it.";

/// What was given where something else was needed.
#[derive(Debug)]
pub enum Value {
    Nothing,
    Number(f64),
    Numbers(Vec<f64>),
    Count(usize),
    Text(String),
    Object(Py<PyAny>),
    /// Python's own exception, which goes on as it is.
    Raised(Box<PyErr>),
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

impl BorderError {
    /// Another call on an object is going on.
    pub fn busy() -> Self {
        let message = "another call on this object is still going on, in another thread or under a \
                       signal handler: give each thread an object of its own, or wait for the \
                       call's end";
        Kind::Busy.refusal(message.to_owned(), Value::Nothing)
    }
}

static MADE: PyOnceLock<Vec<Py<PyType>>> = PyOnceLock::new();

/// Makes the exception classes and adds them to the module.
pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    let py = module.py();
    let make = |name: &str, bases: Bound<'_, PyTuple>, doc: &str| -> PyResult<Py<PyType>> {
        let body = PyDict::new(py);
        body.set_item("__module__", "rover_gym.core")?;
        body.set_item("__doc__", doc)?;
        body.set_item("field", py.None())?;
        body.set_item("value", py.None())?;
        // Instances are Python's own, as bases must be.
        body.set_item("__slots__", PyTuple::empty(py))?;
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
    let one = |line: &str| {
        let (name, doc) = line.split_once(": ").unwrap_or_default();
        let is_event = matches!(name, "StepError" | "BusyError" | "InternalError");
        let builtin = if is_event {
            py.get_type::<PyRuntimeError>()
        } else {
            py.get_type::<PyValueError>()
        };
        make(name, PyTuple::new(py, [root.clone(), builtin])?, doc)
    };
    let made: Vec<Py<PyType>> = CLASSES.lines().map(one).collect::<PyResult<_>>()?;
    adopt_panics(made[Kind::Internal as usize].bind(py))?;
    let _ = MADE.set(py, made);
    Ok(())
}

/// Makes the exception of a panic that nothing else has caught one of ours. pyo3 raises it under
/// `BaseException`, past every `except Exception`.
fn adopt_panics(internal: &Bound<'_, PyType>) -> PyResult<()> {
    let py = internal.py();
    let panics = py.get_type::<PanicException>();
    panics.setattr("__bases__", PyTuple::new(py, [internal])?)?;
    panics.setattr("__notes__", PyList::new(py, [REPORT])?)
}

impl From<BorderError> for PyErr {
    fn from(error: BorderError) -> Self {
        let value = match error.value {
            Value::Raised(raised) => return *raised,
            value => value,
        };
        Python::attach(|py| {
            let Some(classes) = MADE.get(py) else {
                return PyRuntimeError::new_err(error.message);
            };
            let raise = || -> PyResult<PyErr> {
                let class = classes[error.kind as usize].bind(py);
                let instance = class.call1((shortened(&error.message),))?;
                instance.setattr("field", error.field)?;
                let value = match value {
                    Value::Nothing | Value::Raised(_) => py.None(),
                    Value::Number(x) => x.into_py_any(py)?,
                    Value::Numbers(x) => x.into_py_any(py)?,
                    Value::Count(x) => x.into_py_any(py)?,
                    Value::Text(x) => x.into_py_any(py)?,
                    Value::Object(x) => x,
                };
                instance.setattr("value", value)?;
                Ok(PyErr::from_value(instance))
            };
            raise().unwrap_or_else(|e| e)
        })
    }
}

impl From<PyErr> for BorderError {
    fn from(raised: PyErr) -> Self {
        Self {
            value: Value::Raised(Box::new(raised)),
            ..Kind::Option.refusal(String::new(), Value::Nothing)
        }
    }
}

impl From<Infallible> for BorderError {
    fn from(never: Infallible) -> Self {
        match never {}
    }
}

/// A message that may hold a long text that was given.
fn shortened(message: &str) -> String {
    let message = legible(message);
    if message.chars().count() <= LONGEST_MESSAGE {
        return message;
    }
    let start = message.chars().take(LONGEST_MESSAGE);
    start.chain("…".chars()).collect()
}

impl Kind {
    /// An invalid argument.
    pub fn error(self, field: impl Into<String>, message: String, value: Value) -> BorderError {
        let field = Some(field.into());
        BorderError {
            field,
            ..self.refusal(message, value)
        }
    }

    /// What is wrong with no argument in particular.
    pub fn refusal(self, message: String, value: Value) -> BorderError {
        BorderError {
            kind: self,
            message,
            field: None,
            value,
        }
    }

    /// What the core says of an argument.
    fn of(self, e: &impl Display, field: impl Into<String>, value: Value) -> BorderError {
        self.error(field, e.to_string(), value)
    }
}

/// A field and the index of its entry, if there is one.
pub fn entry(field: &str, index: Option<&usize>) -> String {
    index.map_or_else(|| field.to_owned(), |index| format!("{field}[{index}]"))
}

/// What a field of a model held.
fn value_of(fault: &ModelFault) -> Value {
    use ModelFault as F;
    match fault {
        F::DuplicateName(name)
        | F::UnknownParent(name)
        | F::UnknownName(name)
        | F::NotADisc(name)
        | F::UnknownModel { name, .. }
        | F::MaterialName(name)
        | F::SteeringNotAbove(name) => Value::Text(name.clone()),
        F::NotFinite(value)
        | F::NotPositive(value)
        | F::Negative(value)
        | F::NotASign(value)
        | F::NotBelow { value, .. }
        | F::OutOfRange { value, .. }
        | F::MassesContradict { value, .. }
        | F::RadiusContradictsShape { value, .. } => Value::Number(*value),
        #[allow(clippy::cast_precision_loss)] // a number to show
        F::UnknownFormat(format) => Value::Number(*format as f64),
        F::TooMany { count, .. } => Value::Count(*count),
        F::NoDirection(value) | F::ImpossibleInertia(value) => Value::Numbers(value.to_vec()),
        _ => Value::Nothing,
    }
}

impl From<ModelError> for BorderError {
    fn from(e: ModelError) -> Self {
        let value = match &e {
            ModelError::Unreadable { .. } => Value::Nothing,
            ModelError::Invalid { fault, .. } => value_of(fault),
        };
        Kind::Model.of(&e, e.field(), value)
    }
}

impl From<StateError> for BorderError {
    fn from(e: StateError) -> Self {
        let (field, index, value) = match &e {
            StateError::Length { field, actual, .. } => (*field, None, Value::Count(*actual)),
            StateError::NotFinite {
                field,
                index,
                value,
            } => (*field, Some(index), Value::Number(*value)),
            StateError::SingularCardan { index, heading } => {
                ("q", Some(index), Value::Number(*heading))
            }
            StateError::LoopOpen { gap, .. } | StateError::LoopStaysOpen { gap, .. } => {
                ("q", None, Value::Number(*gap))
            }
        };
        Kind::State.of(&e, entry(field, index), value)
    }
}

impl From<TerrainError> for BorderError {
    fn from(e: TerrainError) -> Self {
        use TerrainError as E;
        let (index, value) = match &e {
            E::NotFinite { value, .. }
            | E::OutOfRange { value, .. }
            | E::BadHeight { value, .. } => (None, Value::Number(*value)),
            E::NoDirection { value } => (None, Value::Numbers(value.to_vec())),
            E::EntryNotFinite { index, value, .. }
            | E::TooFar { index, value, .. }
            | E::NonPositiveRadius {
                index,
                radius: value,
            } => (Some(index), Value::Number(*value)),
            E::MismatchedLengths { radii: count, .. }
            | E::TooMany { count, .. }
            | E::WrongCount { count, .. } => (None, Value::Count(*count)),
            E::Empty | E::NoTriangles | E::NoParts => (None, Value::Count(0)),
            E::NoSuchVertex { index, vertex, .. } => (Some(index), Value::Count(*vertex)),
            E::FlatTriangle { index }
            | E::NotASurface { index, .. }
            | E::SecondPlane { index }
            | E::SecondSand { index } => (Some(index), Value::Count(*index)),
            E::MapSize { .. } | E::NoData | E::TooManyPieces => (None, Value::Nothing),
        };
        Kind::Terrain.of(&e, entry(e.field(), index), value)
    }
}

impl From<OptionsError> for BorderError {
    fn from(e: OptionsError) -> Self {
        let (field, value) = match &e {
            OptionsError::OutOfRange { field, value, .. } => (*field, Value::Number(*value)),
            OptionsError::BetweenMaterials { value, .. } => ("materials", Value::Number(*value)),
            OptionsError::MaterialsTwice { materials } => {
                ("materials", Value::Text(materials.join(", ")))
            }
            OptionsError::MaterialName { name } => ("materials", Value::Text(name.clone())),
        };
        Kind::Option.of(&e, field, value)
    }
}

impl From<CommandError> for BorderError {
    fn from(e: CommandError) -> Self {
        let (field, index, value) = match &e {
            CommandError::Length { field, actual, .. } => (*field, None, Value::Count(*actual)),
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
            } => (*field, Some(index), Value::Number(*value)),
            CommandError::NoGains { solid, name } => {
                let field = format!("solids[{solid}].hold");
                return Kind::Command.of(&e, field, Value::Text(name.clone()));
            }
            CommandError::Negative { field, value } => (*field, None, Value::Number(*value)),
            CommandError::UnknownJoint { field, name }
            | CommandError::UnknownSolid { field, name } => {
                (*field, None, Value::Text(name.clone()))
            }
        };
        Kind::Command.of(&e, entry(field, index), value)
    }
}

impl From<BatchError> for BorderError {
    fn from(e: BatchError) -> Self {
        let message = e.to_string();
        let of_rover = |index: usize, inner: Self| Self {
            message: message.clone(),
            field: inner.field.map(|field| match field.split_once('[') {
                Some((name, entry)) => format!("{name}[{index}, {entry}"),
                None => entry(&field, Some(&index)),
            }),
            ..inner
        };
        let (field, value) = match e {
            BatchError::Command { index, error } => return of_rover(index, error.into()),
            BatchError::Options { index, error } => return of_rover(index, error.into()),
            BatchError::Empty => ("simulations".to_owned(), Value::Count(0)),
            BatchError::Differs { index, actual, .. } => {
                (entry("simulations", Some(&index)), Value::Count(actual))
            }
            BatchError::NoSuchRover { index, .. } => ("index".to_owned(), Value::Count(index)),
            BatchError::Threads { count, .. } => ("threads".to_owned(), Value::Count(count)),
        };
        Kind::Option.error(field, message, value)
    }
}

impl From<DrawError> for BorderError {
    fn from(e: DrawError) -> Self {
        match e {
            DrawError::NoRoom { depth, .. } => {
                Kind::Terrain.of(&e, "terrain", Value::Number(depth))
            }
            DrawError::Unsuitable { why, attempts } => {
                let message = format!("{why}, in the last of {attempts} scenes");
                match why {
                    Unsuitable::Placement(why) => Self {
                        message,
                        ..why.into()
                    },
                    Unsuitable::NoGoal { x, z } | Unsuitable::NoWay { to: [x, z], .. } => {
                        Kind::Terrain.error("goal", message, Value::Numbers(vec![x, z]))
                    }
                }
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
        use EpisodeError as E;
        let message = e.to_string();
        let (kind, field, value) = match e {
            E::Action { place, value } => {
                let field = format!("action{place}");
                return Kind::Command.error(field, message, Value::Number(value));
            }
            E::Length { field, actual, .. } => (Kind::Option, field, Value::Count(actual)),
            E::OutOfRange { field, value, .. } => (Kind::Option, field, Value::Number(value)),
            E::OtherRules => (Kind::Option, "episode", Value::Nothing),
            E::Busy => return Self::busy(),
            E::NotBegun { index } => (Kind::Option, "index", Value::Count(index)),
            E::NotObservable => (Kind::State, "q", Value::Nothing),
            E::Draw(error) => return error.into(),
            E::Batch(error) => return error.into(),
        };
        kind.error(field, message, value)
    }
}

impl From<SnapshotError> for BorderError {
    fn from(e: SnapshotError) -> Self {
        Kind::State.of(&e, "snapshot", Value::Nothing)
    }
}

impl From<StepError> for BorderError {
    fn from(e: StepError) -> Self {
        match e {
            StepError::NoGround { x, z, .. } => {
                Kind::Step.of(&e, "terrain", Value::Numbers(vec![x, z]))
            }
            StepError::Internal { .. } => Kind::Internal.refusal(e.to_string(), Value::Nothing),
            _ => Kind::Step.refusal(e.to_string(), Value::Nothing),
        }
    }
}

impl From<Fault> for BorderError {
    fn from(e: Fault) -> Self {
        Kind::Internal.refusal(format!("{e}. {REPORT}"), Value::Nothing)
    }
}

impl From<PlacementError> for BorderError {
    fn from(e: PlacementError) -> Self {
        match e {
            PlacementError::State(e) => e.into(),
            PlacementError::NoGround { x, z } => {
                Kind::Terrain.of(&e, "position", Value::Numbers(vec![x, z]))
            }
        }
    }
}

impl From<ProblemError> for BorderError {
    fn from(e: ProblemError) -> Self {
        use ProblemError as E;
        let value = match &e {
            E::VelocityShape { found, .. }
            | E::OperatorShape { found, .. }
            | E::OperatorComponents { found, .. } => Value::Count(*found),
            E::NonFiniteOperator { value, .. }
            | E::NonFiniteVelocity { value, .. }
            | E::InvalidFrictionCoefficient { value, .. }
            | E::NonPositiveNormal { value, .. }
            | E::NegativeTangential { value, .. } => Value::Number(*value),
            // Also of the variants that may come: the enum is not exhaustive.
            _ => Value::Nothing,
        };
        Kind::Problem.of(&e, e.field(), value)
    }
}
