//! Options of a simulation's steps: one table reads them from the arguments of every class and
//! tells them again.

use pyo3::IntoPyObjectExt;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use rover_core::integrator::{Stabilisation, StepOptions, Variant};
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
pub const GRAIN_STABILISATIONS: [(&str, Stabilisation); 3] = [
    ("projection", Stabilisation::Projection),
    ("push_out", Stabilisation::PushOut),
    ("none", Stabilisation::None),
];

/// What a simulation may step with: the solvers of Coulomb's law.
const SIMULATION_SOLVERS: [Method; 5] = [
    Method::Auto,
    Method::GaussSeidel,
    Method::Newton,
    Method::ProximalPoint,
    Method::Admm,
];

/// What was asked of the solver, in the words and numbers of the arguments:
/// the core translates them.
#[derive(Clone)]
pub struct SolverWords {
    pub solver: String,
    pub max_iterations: usize,
}

/// Options as arguments and as `settings` returns them.
pub struct Options {
    pub step: StepOptions,
    words: SolverWords,
}

/// One option: its name, how it is read, and how `settings` returns it, if it was given.
struct Row {
    name: &'static str,
    read: fn(&mut Options, &Bound<'_, PyAny>) -> Result<()>,
    tell: fn(&Options, Python<'_>) -> PyResult<Option<Py<PyAny>>>,
}

/// An option that a function of the arguments reads, or a word for a value.
macro_rules! row {
    ($name:literal, word of $words:expr, $($place:ident).+) => {
        Row {
            name: $name,
            read: |options, given| {
                let word = text(given, Kind::Option, $name)?;
                options.$($place).+ = choice($name, &word, &$words)?;
                Ok(())
            },
            tell: |options, py| name_of(options.$($place).+, &$words).into_py_any(py).map(Some),
        }
    };
    ($name:literal, $read:expr, $($place:ident).+) => {
        Row {
            name: $name,
            read: |options, given| {
                options.$($place).+ = $read(given, Kind::Option, $name)?;
                Ok(())
            },
            tell: |options, py| options.$($place).+.clone().into_py_any(py).map(Some),
        }
    };
}

/// Every option but gravity, which is each class's own.
const TABLE: [Row; 13] = [
    row!("friction", number, step.friction_coefficient),
    row!("restitution", number, step.restitution),
    Row {
        name: "materials",
        read: |options, given| {
            options.step.materials = materials::parse(given)?;
            Ok(())
        },
        tell: |options, py| {
            let rows = materials::rows(py, &options.step.materials)?;
            Ok((!rows.is_empty()).then(|| rows.into_any().unbind()))
        },
    },
    row!("time_step", number, step.time_step),
    row!("variant", word of VARIANTS, step.variant),
    row!("theta", number, step.theta),
    row!("forecast", number, step.forecast),
    row!("solver", text, words.solver),
    row!("tolerance", number, step.solver.tolerance),
    row!("max_iterations", count, words.max_iterations),
    Row {
        name: "budget",
        read: |options, given| {
            options.step.solver.budget = Some(whole(given, Kind::Option, "budget")?);
            Ok(())
        },
        tell: |options, py| {
            let budget = options.step.solver.budget;
            budget.map(|budget| budget.into_py_any(py)).transpose()
        },
    },
    row!("stabilisation", word of STABILISATIONS, step.stabilisation),
    row!("warm_start", flag, step.warm_start),
];

/// Options for which `None` stands for the default.
const OPTIONAL: [&str; 5] = ["materials", "time_step", "variant", "tolerance", "budget"];

impl Options {
    /// No options given: the defaults of `step`.
    pub fn of(step: StepOptions) -> Self {
        let words = SolverWords {
            solver: "auto".to_owned(),
            max_iterations: 1000,
        };
        Self { step, words }
    }

    /// Reads all options that were given by their names.
    pub fn read(mut self, given: &Named<'_>) -> Result<(StepOptions, SolverWords)> {
        for row in &TABLE {
            if let Some(value) = given.get(row.name)?.given()
                && !(value.is_none() && OPTIONAL.contains(&row.name))
            {
                (row.read)(&mut self, &value)?;
            }
        }
        let SolverOptions {
            tolerance, budget, ..
        } = self.step.solver;
        let SolverWords {
            solver,
            max_iterations,
        } = &self.words;
        let solver = solver_options(solver, tolerance, *max_iterations, &SIMULATION_SOLVERS)?;
        self.step.solver = SolverOptions { budget, ..solver };
        Ok((self.step, self.words))
    }
}

/// The keyword arguments that make a simulation with these options.
///
/// `gravity`: as the class gives it, a pair or a triple.
pub fn settings<'py>(
    gravity: &Bound<'py, PyAny>,
    step: &StepOptions,
    words: &SolverWords,
) -> Result<Bound<'py, PyDict>> {
    let py = gravity.py();
    let settings = PyDict::new(py);
    settings.set_item("gravity", gravity)?;
    let options = Options {
        step: step.clone(),
        words: words.clone(),
    };
    for row in &TABLE {
        if let Some(value) = (row.tell)(&options, py)? {
            settings.set_item(row.name, value)?;
        }
    }
    Ok(settings)
}

/// Solver options of the public arguments; `known`: the methods that may be named.
pub fn solver_options(
    name: &str,
    tolerance: f64,
    max_iterations: usize,
    known: &[Method],
) -> Result<SolverOptions> {
    if !(tolerance.is_finite() && tolerance > 0.0) {
        let message = format!("tolerance: must be finite and positive, is {tolerance}");
        return Err(Kind::Option.error("tolerance", message, Value::Number(tolerance)));
    }
    if max_iterations == 0 {
        let message = "max_iterations: must be at least 1, is 0".to_owned();
        return Err(Kind::Option.error("max_iterations", message, Value::Count(0)));
    }
    let methods: Vec<_> = known
        .iter()
        .map(|method| (method.name(), *method))
        .collect();
    Ok(SolverOptions {
        method: choice("solver", name, &methods)?,
        tolerance,
        velocity_tolerance: tolerance.max(1e-9),
        max_newton_steps: max_iterations,
        max_sweeps: max_iterations,
        ..SolverOptions::default()
    })
}
