//! Options of simulations, declared once: `step_options!` lists those of machines, and
//! `disk_options!` and `ball_options!` of [`crate::bed_options`] those of grains. Arguments are
//! read and told again, and docstrings, signatures and the types of the stub made, from these
//! lists.

use pyo3::IntoPyObjectExt;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use rover_core::integrator::{Stabilisation, StepOptions, Variant};
use rover_core::law::materials::Materials;
use rover_core::solver::{Method, SolverOptions};

use crate::arguments::{Named, count, flag, number, text, whole};
use crate::errors::{BorderError, Kind, Result, Value};
use crate::materials;

/// The value that a word stands for.
pub fn choice<T: Copy>(field: &str, given: &str, choices: &[(&str, T)]) -> Result<T, BorderError> {
    let found = choices.iter().find(|(name, _)| *name == given);
    found.map(|(_, value)| *value).ok_or_else(|| {
        let known: Vec<_> = choices
            .iter()
            .map(|(name, _)| format!("{name:?}"))
            .collect();
        let message = format!("{field}: must be one of {}, is {given:?}", known.join(", "));
        Kind::Option.error(field, message, Value::Text(given.to_owned()))
    })
}

/// The word that stands for a value.
pub fn name_of<T: PartialEq + Copy>(value: T, choices: &[(&'static str, T)]) -> &'static str {
    choices
        .iter()
        .find(|(_, v)| *v == value)
        .map_or("", |(name, _)| name)
}

/// Schemes by name.
pub const VARIANTS: [(&str, Variant); 2] = [
    ("linearised", Variant::Linearised),
    ("newton", Variant::Newton),
];
/// Stabilisations by name.
pub const STABILISATIONS: [(&str, Stabilisation); 2] = [
    ("projection", Stabilisation::Projection),
    ("none", Stabilisation::None),
];
/// Stabilisations of grains by name.
pub const GRAIN_STABILISATIONS: [(&str, GrainStabilisation); 3] = [
    ("projection", GrainStabilisation(Stabilisation::Projection)),
    ("push_out", GrainStabilisation(Stabilisation::PushOut)),
    ("none", GrainStabilisation(Stabilisation::None)),
];

/// A stabilisation of grains.
#[derive(Clone, Copy, Default, PartialEq)]
pub struct GrainStabilisation(pub Stabilisation);

/// Methods for the contact problem by name.
pub const METHODS: [(&str, Method); 6] = by_name(Method::ALL);
/// Methods that a simulation may step with: those for Coulomb's law.
const SOLVERS: [(&str, Method); 5] = by_name([
    Method::Auto,
    Method::GaussSeidel,
    Method::Newton,
    Method::ProximalPoint,
    Method::Admm,
]);

const fn by_name<const N: usize>(methods: [Method; N]) -> [(&'static str, Method); N] {
    let mut named = [("", Method::Auto); N];
    let mut i = 0;
    while i < N {
        named[i] = (methods[i].name(), methods[i]);
        i += 1;
    }
    named
}

/// Largest number of iterations of the contact solver in a step, unless given.
const MAX_ITERATIONS: usize = 1000;

/// Every option but gravity, which is each class's own: its meaning, its name, its marks, and its
/// place in `StepOptions`. The type of the place tells how it is read; the core has its default and
/// its range. Of an option with the mark `None`, `None` stands for the default; one with the mark
/// `untold` is not among the `settings`.
///
/// `rows` makes a table of them, `documented` the entries of a docstring.
macro_rules! step_options {
    ($then:ident) => {
        $crate::options::$then! {
            /// Coulomb's coefficient of every contact whose pair is not in `materials`.
            friction => friction_coefficient;
            /// Newton's coefficient of every contact whose pair is not in `materials`, in
            /// [0, 1].
            restitution => restitution;
            /// Friction and restitution by pair of materials, in any order, such as
            /// `{("wheel", "rock"): (0.5, 0.1)}`; or a list of rows (name, name, friction,
            /// restitution). None by default.
            materials | None => materials;
            /// Time step, s, from 1e-9 to 1000; 0.005 by default.
            time_step | None => time_step;
            /// "linearised" evaluates the forces once in each step; "newton" solves for the forces
            /// at its end. "linearised" by default.
            variant | None => variant;
            /// Implicitness of the time stepping: weight of the end of the step, in [0.5, 1].
            theta => theta;
            /// A contact is active in a step if gap + forecast * time_step * u_N <= 0, with u_N
            /// its normal velocity; in [0, 1].
            forecast => forecast;
            /// Method for the contact problem, as in `solve_friction_contact`.
            solver => solver.method;
            /// Largest relative residual of the contact problem; 1e-12 by default.
            tolerance | None => solver.tolerance;
            /// Violation at a contact, m/s, that is accepted where the contact solver is slow;
            /// `StepReport.acceptable` counts such solves. 0 accepts none.
            acceptable => solver.acceptable;
            /// Largest number of iterations of the contact solver in a step.
            max_iterations => solver.max_sweeps;
            /// Largest amount of work of the contact solver in a step, in the unit of
            /// `solve_friction_contact` (operations, not time). By default it grows with the
            /// number of contacts.
            budget | None => solver.budget;
            /// Treatment of penetration: "projection" moves overlapping bodies apart, "none"
            /// leaves them.
            stabilisation => stabilisation;
            /// Whether the contact solver starts from the last step's impulses.
            warm_start => warm_start;
        }
    };
}
pub(crate) use step_options;

/// The last entries of a docstring's section "Args", and the line break after the section.
macro_rules! documented {
    ($(
        #[doc = $first:literal] $(#[doc = $more:literal])*
        $name:ident $(| $mark:ident)* => $($place:ident).+;
    )+) => {
        concat!($("    ", stringify!($name), ":", $first $(, "\n       ", $more)*, "\n"),+)
    };
}
pub(crate) use documented;

/// The rows of a table.
macro_rules! rows {
    ($($(#[doc = $doc:literal])+ $name:ident $(| $mark:ident)* => $($place:ident).+;)+) => {
        &[$($crate::options::OptionRow {
            name: stringify!($name),
            marks: &[$(stringify!($mark)),*],
            place: |options| &mut options.$($place).+,
        }),+]
    };
}
pub(crate) use rows;

/// One option among options `T`.
pub struct OptionRow<T> {
    pub name: &'static str,
    pub marks: &'static [&'static str],
    pub place: fn(&mut T) -> &mut dyn Argument,
}

impl<T> OptionRow<T> {
    fn has(&self, mark: &str) -> bool {
        self.marks.contains(&mark)
    }
}

/// Options of a class of simulations.
pub trait Options: Sized + 'static {
    /// All of them.
    const TABLE: &'static [OptionRow<Self>];

    /// The options that hold where none are given.
    fn usual() -> Self;
}

impl Options for StepOptions {
    const TABLE: &'static [OptionRow<Self>] = step_options!(rows);

    fn usual() -> Self {
        let mut step = Self::default();
        step.solver.max_sweeps = MAX_ITERATIONS;
        step
    }
}

/// The value of an option.
pub trait Argument {
    /// Takes what was given for the option of this name.
    fn read(&mut self, given: &Bound<'_, PyAny>, name: &str) -> Result<()>;
    /// The value in Python, which is read again as this one.
    fn tell(&self, py: Python<'_>) -> PyResult<Py<PyAny>>;
    /// Type of the value in Python.
    fn python(&self) -> String;
}

macro_rules! argument {
    ($type:ty, $python:literal, $read:ident) => {
        impl Argument for $type {
            fn read(&mut self, given: &Bound<'_, PyAny>, name: &str) -> Result<()> {
                *self = $read(given, Kind::Option, name)?;
                Ok(())
            }
            fn tell(&self, py: Python<'_>) -> PyResult<Py<PyAny>> {
                self.into_py_any(py)
            }
            fn python(&self) -> String {
                $python.to_owned()
            }
        }
    };
    ($type:ty, $words:ident) => {
        impl Argument for $type {
            fn read(&mut self, given: &Bound<'_, PyAny>, name: &str) -> Result<()> {
                *self = choice(name, &text(given, Kind::Option, name)?, &$words)?;
                Ok(())
            }
            fn tell(&self, py: Python<'_>) -> PyResult<Py<PyAny>> {
                name_of(*self, &$words).into_py_any(py)
            }
            fn python(&self) -> String {
                literal(&$words)
            }
        }
    };
}

argument!(f64, "float", number);
argument!(u64, "int", whole);
argument!(usize, "int", count);
argument!(bool, "bool", flag);
argument!(Variant, VARIANTS);
argument!(Method, SOLVERS);
argument!(Stabilisation, STABILISATIONS);
argument!(GrainStabilisation, GRAIN_STABILISATIONS);

impl<T: Argument + Default> Argument for Option<T> {
    fn read(&mut self, given: &Bound<'_, PyAny>, name: &str) -> Result<()> {
        self.insert(T::default()).read(given, name)
    }
    fn tell(&self, py: Python<'_>) -> PyResult<Py<PyAny>> {
        self.as_ref()
            .map_or_else(|| Ok(py.None()), |own| own.tell(py))
    }
    fn python(&self) -> String {
        T::default().python()
    }
}

impl Argument for Materials {
    fn read(&mut self, given: &Bound<'_, PyAny>, _: &str) -> Result<()> {
        *self = materials::parse(given)?;
        Ok(())
    }
    fn tell(&self, py: Python<'_>) -> PyResult<Py<PyAny>> {
        let rows = materials::rows(py, self)?;
        (!rows.is_empty()).then_some(rows).into_py_any(py)
    }
    fn python(&self) -> String {
        "_Materials".to_owned()
    }
}

/// Reads the options that were given by their names.
pub fn read<T: Options>(options: &mut T, given: &Named<'_>) -> Result<()> {
    for row in T::TABLE {
        if let Some(value) = given.get(row.name)?.given()
            && !(value.is_none() && row.has("None"))
        {
            (row.place)(options).read(&value, row.name)?;
        }
    }
    Ok(())
}

/// Reads the options of a machine that were given by their names.
pub fn read_step(mut step: StepOptions, given: &Named<'_>) -> Result<StepOptions> {
    read(&mut step, given)?;
    step.solver = checked(step.solver)?;
    Ok(step)
}

/// The keyword arguments that make a simulation with these options.
///
/// `gravity`: as the class gives it, a pair or a triple.
pub fn settings<'py, T: Options>(
    gravity: &Bound<'py, PyAny>,
    mut options: T,
) -> Result<Bound<'py, PyDict>> {
    let py = gravity.py();
    let settings = PyDict::new(py);
    settings.set_item("gravity", gravity)?;
    for row in T::TABLE.iter().filter(|row| !row.has("untold")) {
        let value = (row.place)(&mut options).tell(py)?;
        if !value.is_none(py) {
            settings.set_item(row.name, value)?;
        }
    }
    Ok(settings)
}

/// Solver options whose tolerance and number of iterations are in range, and hold for every method.
pub fn checked(options: SolverOptions) -> Result<SolverOptions> {
    let SolverOptions {
        tolerance,
        max_sweeps,
        ..
    } = options;
    if !(tolerance.is_finite() && tolerance > 0.0) {
        let message = format!("tolerance: must be finite and positive, is {tolerance}");
        return Err(Kind::Option.error("tolerance", message, Value::Number(tolerance)));
    }
    if max_sweeps == 0 {
        let message = "max_iterations: must be at least 1, is 0".to_owned();
        return Err(Kind::Option.error("max_iterations", message, Value::Count(0)));
    }
    Ok(SolverOptions {
        velocity_tolerance: tolerance.max(1e-9),
        max_newton_steps: max_sweeps,
        ..options
    })
}

/// The type of an argument that is one of these words, in Python.
pub fn literal<T>(choices: &[(&str, T)]) -> String {
    let words: Vec<_> = choices
        .iter()
        .map(|(word, _)| format!("{word:?}"))
        .collect();
    format!("Literal[{}]", words.join(", "))
}

/// Name, default and type of each option in Python.
pub fn described<T: Options>(py: Python<'_>) -> PyResult<Vec<(&'static str, Py<PyAny>, String)>> {
    let mut usual = T::usual();
    let described = T::TABLE.iter().map(|row| {
        let value = (row.place)(&mut usual);
        Ok(if row.has("None") {
            (row.name, py.None(), value.python() + " | None")
        } else {
            (row.name, value.tell(py)?, value.python())
        })
    });
    described.collect()
}
