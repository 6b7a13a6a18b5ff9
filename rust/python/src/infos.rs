//! The infos of control periods: one rover's as a dictionary, a batch's as arrays with masks.

use numpy::{Element, PyArray1};
use pyo3::intern;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyString};
use rover_core::episode::{Ending, Episode, TERMS};

use crate::errors::Result;

/// Names of the solver's status: converged, not converged, a step that failed.
const STATUSES: [&str; 3] = ["converged", "not_converged", "failed"];

/// An episode and the message of the physics step that failed in its last period.
pub type Told<'a> = (&'a Episode, Option<String>);

/// What an info says of the contact solver.
struct Solver {
    status: usize,
    iterations: i64,
    residual: f64,
    n_contacts: i64,
}

impl Solver {
    #[allow(clippy::cast_possible_truncation)] // counts far below 2^52
    fn of((episode, message): &Told<'_>) -> Self {
        if message.is_some() {
            return Self {
                status: 2,
                iterations: 0,
                residual: f64::INFINITY,
                n_contacts: 0,
            };
        }
        let now = &episode.outcome().now;
        Self {
            status: usize::from(now.not_converged != 0.0),
            iterations: now.iterations as i64,
            residual: now.residual,
            n_contacts: now.n_contacts as i64,
        }
    }
}

/// Charge of the battery, J.
fn charge(episode: &Episode) -> f64 {
    let battery = episode.rules().settings().battery.unwrap_or(0.0);
    (battery - episode.progress().energy).max(0.0)
}

/// Goals that have been reached, and those that remain.
#[allow(clippy::cast_possible_wrap)] // small numbers
fn waypoints(episode: &Episode) -> [i64; 2] {
    let (reached, goals) = (episode.progress().reached, episode.rules().settings().goals);
    [reached as i64, goals as i64 - reached as i64]
}

/// The info of one rover.
pub fn info<'py>(py: Python<'py>, told: &Told<'_>) -> Result<Bound<'py, PyDict>> {
    let (episode, message) = told;
    let (outcome, setting) = (episode.outcome(), episode.setting());
    let is_success = outcome.ending == Ending::Goal;
    let domain = PyDict::new(py);
    domain.set_item(intern!(py, "mass_scale"), setting.domain.mass_scale)?;
    domain.set_item(intern!(py, "friction"), setting.domain.friction)?;
    domain.set_item(intern!(py, "actuator_gain"), setting.domain.actuator_gain)?;
    domain.set_item(intern!(py, "gravity_scale"), setting.domain.gravity_scale)?;
    let terms = PyDict::new(py);
    for (name, term) in TERMS.iter().zip(outcome.terms) {
        terms.set_item(PyString::intern(py, name), term)?;
    }
    let told_solver = Solver::of(told);
    let solver = PyDict::new(py);
    let status = PyString::intern(py, STATUSES[told_solver.status]);
    solver.set_item(intern!(py, "status"), status)?;
    solver.set_item(intern!(py, "iterations"), told_solver.iterations)?;
    solver.set_item(intern!(py, "residual"), told_solver.residual)?;
    solver.set_item(intern!(py, "n_contacts"), told_solver.n_contacts)?;
    solver.set_item(intern!(py, "message"), message.as_deref().unwrap_or(""))?;
    let info = PyDict::new(py);
    info.set_item(intern!(py, "time"), outcome.now.time)?;
    info.set_item(intern!(py, "success"), is_success)?;
    info.set_item(intern!(py, "is_success"), is_success)?;
    let termination = PyString::intern(py, outcome.ending.name());
    info.set_item(intern!(py, "termination"), termination)?;
    info.set_item(intern!(py, "distance_to_goal"), outcome.now.distance)?;
    info.set_item(intern!(py, "energy"), outcome.energy)?;
    info.set_item(intern!(py, "energy_positive"), outcome.energy_positive)?;
    info.set_item(intern!(py, "slip_ratio"), outcome.now.slip_ratio)?;
    info.set_item(intern!(py, "tilt"), outcome.now.tilt())?;
    info.set_item(intern!(py, "difficulty"), setting.difficulty)?;
    info.set_item(intern!(py, "domain"), domain)?;
    info.set_item(intern!(py, "reward_terms"), terms)?;
    info.set_item(intern!(py, "solver"), solver)?;
    let settings = episode.rules().settings();
    if settings.battery.is_some() {
        info.set_item(intern!(py, "charge"), charge(episode))?;
    }
    if settings.has_course() {
        let [reached, remaining] = waypoints(episode);
        info.set_item(intern!(py, "waypoints_reached"), reached)?;
        info.set_item(intern!(py, "waypoints_remaining"), remaining)?;
        info.set_item(intern!(py, "distance_remaining"), episode.way())?;
    }
    Ok(info)
}

/// A dictionary of arrays with one entry a rover, each with the mask of those that have it: all.
struct Columns<'py, 'a> {
    py: Python<'py>,
    told: &'a [Told<'a>],
    everyone: &'a Bound<'py, PyArray1<bool>>,
    out: Bound<'py, PyDict>,
}

impl<'py, 'a> Columns<'py, 'a> {
    fn new(told: &'a [Told<'a>], everyone: &'a Bound<'py, PyArray1<bool>>) -> Self {
        let py = everyone.py();
        Self {
            py,
            told,
            everyone,
            out: PyDict::new(py),
        }
    }

    /// Adds an array. `mask`: the name after an underscore.
    fn add<T: Element>(
        &self,
        name: &Bound<'py, PyString>,
        mask: &Bound<'py, PyString>,
        of: impl Fn(&Told<'a>) -> T,
    ) -> Result<()> {
        let column: Vec<T> = self.told.iter().map(of).collect();
        self.out
            .set_item(name, PyArray1::from_slice(self.py, &column))?;
        self.mask(mask)
    }

    /// Adds a dictionary of arrays.
    fn nest(
        &self,
        name: &Bound<'py, PyString>,
        mask: &Bound<'py, PyString>,
        inner: &Self,
    ) -> Result<()> {
        self.out.set_item(name, &inner.out)?;
        self.mask(mask)
    }

    fn mask(&self, name: &Bound<'py, PyString>) -> Result<()> {
        Ok(self.out.set_item(name, self.everyone)?)
    }
}

/// `$columns.add("name", "_name", of)` with both names interned.
macro_rules! add {
    ($columns:ident, $name:literal, $of:expr) => {
        $columns.add(
            intern!($columns.py, $name),
            intern!($columns.py, concat!("_", $name)),
            $of,
        )?
    };
}

/// The infos of all rovers of a batch.
pub fn infos<'py>(py: Python<'py>, told: &[Told<'_>]) -> Result<Bound<'py, PyDict>> {
    let text = |name: &str| PyString::intern(py, name).into_any().unbind();
    let endings = Ending::ALL.map(|ending| text(ending.name()));
    let statuses = STATUSES.map(text);
    let empty = text("");

    let everyone = PyArray1::from_slice(py, &vec![true; told.len()]);
    let domain = Columns::new(told, &everyone);
    add!(domain, "mass_scale", |t| t.0.setting().domain.mass_scale);
    add!(domain, "friction", |t| t.0.setting().domain.friction);
    add!(domain, "actuator_gain", |t| t
        .0
        .setting()
        .domain
        .actuator_gain);
    add!(domain, "gravity_scale", |t| t
        .0
        .setting()
        .domain
        .gravity_scale);
    let terms = Columns::new(told, &everyone);
    for (i, name) in TERMS.iter().enumerate() {
        let mask = PyString::intern(py, &format!("_{name}"));
        let name = PyString::intern(py, name);
        terms.add(&name, &mask, |t| t.0.outcome().terms[i])?;
    }
    let solver = Columns::new(told, &everyone);
    add!(solver, "status", |t| statuses[Solver::of(t).status]
        .clone_ref(py));
    add!(solver, "iterations", |t| Solver::of(t).iterations);
    add!(solver, "residual", |t| Solver::of(t).residual);
    add!(solver, "n_contacts", |t| Solver::of(t).n_contacts);
    add!(solver, "message", |t| match &t.1 {
        Some(message) => PyString::new(py, message).into_any().unbind(),
        None => empty.clone_ref(py),
    });

    let all = Columns::new(told, &everyone);
    let is_success = |t: &Told<'_>| t.0.outcome().ending == Ending::Goal;
    add!(all, "time", |t| t.0.outcome().now.time);
    add!(all, "success", is_success);
    add!(all, "is_success", is_success);
    add!(all, "termination", |t| endings
        [t.0.outcome().ending as usize]
        .clone_ref(py));
    add!(all, "distance_to_goal", |t| t.0.outcome().now.distance);
    add!(all, "energy", |t| t.0.outcome().energy);
    add!(all, "energy_positive", |t| t.0.outcome().energy_positive);
    add!(all, "slip_ratio", |t| t.0.outcome().now.slip_ratio);
    add!(all, "tilt", |t| t.0.outcome().now.tilt());
    add!(all, "difficulty", |t| t.0.setting().difficulty);
    all.nest(intern!(py, "domain"), intern!(py, "_domain"), &domain)?;
    all.nest(
        intern!(py, "reward_terms"),
        intern!(py, "_reward_terms"),
        &terms,
    )?;
    all.nest(intern!(py, "solver"), intern!(py, "_solver"), &solver)?;
    let settings = told.first().map(|one| one.0.rules().settings());
    if settings.is_some_and(|settings| settings.battery.is_some()) {
        add!(all, "charge", |t| charge(t.0));
    }
    if settings.is_some_and(rover_core::episode::Settings::has_course) {
        add!(all, "waypoints_reached", |t| waypoints(t.0)[0]);
        add!(all, "waypoints_remaining", |t| waypoints(t.0)[1]);
        add!(all, "distance_remaining", |t| t.0.way());
    }
    Ok(all.out)
}
