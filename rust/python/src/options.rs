//! Options of a simulation: read from the arguments of every class in one
//! way, and told again in one way.

use pyo3::prelude::*;
use pyo3::types::PyDict;
use rover_core::integrator::{Stabilisation, StepOptions, Variant};
use rover_core::solver::SolverOptions;

use crate::arguments::{count, flag, number, text, whole};
use crate::errors::{BorderError, Kind, Value};
use crate::friction_contact::{SIMULATION_SOLVERS, solver_options};
use crate::materials;

/// The value that a word stands for.
pub fn choice<T: Copy>(field: &str, given: &str, choices: &[(&str, T)]) -> Result<T, BorderError> {
    let found = choices
        .iter()
        .find(|(name, _)| *name == given)
        .map(|(_, value)| *value);
    found.ok_or_else(|| {
        let known: Vec<String> = choices
            .iter()
            .map(|(name, _)| format!("{name:?}"))
            .collect();
        let message = format!("{field}: must be one of {}, is {given:?}", known.join(", "));
        BorderError::option(field, message, Value::Text(given.to_owned()))
    })
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

/// The word that stands for a value.
pub fn name_of<T: PartialEq + Copy>(value: T, choices: &[(&'static str, T)]) -> &'static str {
    choices
        .iter()
        .find(|(_, v)| *v == value)
        .map_or("", |(name, _)| name)
}

/// What was asked of the solver, in the words and numbers of the arguments:
/// the core translates them.
#[derive(Clone)]
pub struct SolverWords {
    pub solver: String,
    pub max_iterations: usize,
}

/// Options as they come in.
pub struct Options {
    pub step: StepOptions,
    tolerance: f64,
    budget: Option<u64>,
    words: SolverWords,
}

impl Options {
    /// None given yet: those of `step`.
    pub fn of(step: StepOptions) -> Self {
        Self {
            tolerance: step.solver.tolerance,
            budget: step.solver.budget,
            words: SolverWords {
                solver: "auto".to_owned(),
                max_iterations: 1000,
            },
            step,
        }
    }

    /// Takes an option by its name; false where no simulation has one of
    /// this name. Gravity is each class's own.
    pub fn take(&mut self, field: &str, value: &Bound<'_, PyAny>) -> PyResult<bool> {
        let number = || number(value, Kind::Option, field);
        let text = || text(value, Kind::Option, field);
        let step = &mut self.step;
        match field {
            "friction" => step.friction_coefficient = number()?,
            "restitution" => step.restitution = number()?,
            "materials" => step.materials = materials::parse(value)?,
            "time_step" => step.time_step = number()?,
            "variant" => step.variant = choice(field, &text()?, &VARIANTS)?,
            "theta" => step.theta = number()?,
            "forecast" => step.forecast = number()?,
            "stabilisation" => step.stabilisation = choice(field, &text()?, &STABILISATIONS)?,
            "warm_start" => step.warm_start = flag(value, Kind::Option, field)?,
            "solver" => self.words.solver = text()?,
            "tolerance" => self.tolerance = number()?,
            "max_iterations" => self.words.max_iterations = count(value, Kind::Option, field)?,
            "budget" if value.is_none() => self.budget = None,
            "budget" => self.budget = Some(whole(value, Kind::Option, field)?),
            _ => return Ok(false),
        }
        Ok(true)
    }

    /// All have been given.
    pub fn finish(mut self) -> PyResult<(StepOptions, SolverWords)> {
        let SolverWords {
            solver,
            max_iterations,
        } = &self.words;
        let known = &SIMULATION_SOLVERS;
        self.step.solver = SolverOptions {
            budget: self.budget,
            ..solver_options(solver, self.tolerance, *max_iterations, known)?
        };
        Ok((self.step, self.words))
    }
}

/// The keyword arguments that make a simulation with these options.
///
/// `gravity`: as the class gives it, a pair or a triple.
pub fn settings<'py>(
    gravity: &Bound<'py, PyAny>,
    options: &StepOptions,
    words: &SolverWords,
) -> PyResult<Bound<'py, PyDict>> {
    let settings = PyDict::new(gravity.py());
    settings.set_item("gravity", gravity)?;
    settings.set_item("friction", options.friction_coefficient)?;
    settings.set_item("restitution", options.restitution)?;
    if !options.materials.is_empty() {
        let rows = materials::rows(settings.py(), &options.materials)?;
        settings.set_item("materials", rows)?;
    }
    settings.set_item("time_step", options.time_step)?;
    settings.set_item("variant", name_of(options.variant, &VARIANTS))?;
    settings.set_item("theta", options.theta)?;
    settings.set_item("forecast", options.forecast)?;
    settings.set_item("solver", &words.solver)?;
    settings.set_item("tolerance", options.solver.tolerance)?;
    settings.set_item("max_iterations", words.max_iterations)?;
    if let Some(budget) = options.solver.budget {
        settings.set_item("budget", budget)?;
    }
    let stabilisation = name_of(options.stabilisation, &STABILISATIONS);
    settings.set_item("stabilisation", stabilisation)?;
    settings.set_item("warm_start", options.warm_start)?;
    Ok(settings)
}
