//! The infos of control periods, declared once: one rover's as a dictionary, a batch's as arrays
//! with masks, and the rows of the environment's card.

use numpy::PyArray1;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyString};
use rover_task::episode::{Episode, Settings, TERMS};

use crate::errors::Result;

/// Names of the solver's status: converged, not converged, a step that failed.
const STATUSES: [&str; 3] = ["converged", "not_converged", "failed"];

/// An episode and the message of the physics step that failed in its last period.
pub type InfoSource<'a> = (&'a Episode, Option<String>);

/// A value of an entry.
enum Value {
    Number(f64),
    Count(i64),
    Flag(bool),
    Name(&'static str),
    Text(String),
}
use Value::{Count, Flag, Name, Number, Text};

/// Where the value of an entry comes from.
enum Read {
    One(fn(&InfoSource<'_>) -> Value),
    /// A dictionary.
    Group(&'static [Entry]),
    /// The terms of the reward.
    Terms,
}
use Read::{Group, One, Terms};

/// An entry of an info.
struct Entry {
    name: &'static str,
    unit: &'static str,
    meaning: &'static str,
    /// Which tasks have it.
    is_present: fn(&Settings) -> bool,
    read: Read,
}

/// Entries: name, unit, meaning, which tasks have them, and what they read.
macro_rules! entries {
    ($($name:literal [$unit:literal] $meaning:literal if $is_present:expr => $read:expr;)*) => {
        &[$(Entry {
            name: $name,
            unit: $unit,
            meaning: $meaning,
            is_present: $is_present,
            read: $read,
        }),*]
    };
}

fn always(_: &Settings) -> bool {
    true
}

fn has_battery(settings: &Settings) -> bool {
    settings.battery.is_some()
}

fn has_trap(settings: &Settings) -> bool {
    settings.free_distance.is_some()
}

fn is_success(source: &InfoSource<'_>) -> Value {
    Flag(source.0.outcome().ending.is_success())
}

/// Goals that have been reached.
#[allow(clippy::cast_possible_wrap)] // small numbers
fn reached(source: &InfoSource<'_>) -> i64 {
    source.0.progress().reached as i64
}

/// A number of the solver's; what there is of a step that failed.
fn solved(source: &InfoSource<'_>, number: f64, failed: f64) -> f64 {
    if source.1.is_some() { failed } else { number }
}

#[allow(clippy::cast_possible_truncation)] // counts far below 2^52
fn solved_count(source: &InfoSource<'_>, number: f64) -> Value {
    Count(solved(source, number, 0.0) as i64)
}

/// Goals that remain.
#[allow(clippy::cast_possible_wrap)] // small numbers
fn remaining(source: &InfoSource<'_>) -> Value {
    Count(source.0.rules().settings().goals as i64 - reached(source))
}

/// Charge of the battery, J.
fn charge(source: &InfoSource<'_>) -> Value {
    let battery = source.0.rules().settings().battery.unwrap_or(0.0);
    Number((battery - source.0.progress().energy).max(0.0))
}

fn status(source: &InfoSource<'_>) -> Value {
    let not_converged = usize::from(source.0.outcome().now.not_converged != 0.0);
    Name(STATUSES[if source.1.is_some() { 2 } else { not_converged }])
}

const DOMAIN: &[Entry] = entries! {
    "mass_scale" [""] "" if always => One(|t| Number(t.0.setting().domain.mass_scale));
    "friction" [""] "" if always => One(|t| Number(t.0.setting().domain.friction));
    "actuator_gain" [""] "" if always => One(|t| Number(t.0.setting().domain.actuator_gain));
    "gravity_scale" [""] "" if always => One(|t| Number(t.0.setting().domain.gravity_scale));
};

const SOLVER: &[Entry] = entries! {
    "status" [""] "" if always => One(status);
    "iterations" [""] "" if always => One(|t| solved_count(t, t.0.outcome().now.iterations));
    "residual" [""] "" if always =>
        One(|t| Number(solved(t, t.0.outcome().now.residual, f64::INFINITY)));
    "n_contacts" [""] "" if always => One(|t| solved_count(t, t.0.outcome().now.n_contacts));
    "message" [""] "" if always => One(|t| Text(t.1.clone().unwrap_or_default()));
};

const ENTRIES: &[Entry] = entries! {
    "time" ["s"] "since the reset" if always => One(|t| Number(t.0.outcome().now.time));
    "success" [""] "whether the goal is reached" if always => One(is_success);
    "is_success" [""] "the same, by the name that stable-baselines3 looks for" if always =>
        One(is_success);
    "termination" [""] "how the episode has ended; \"\" while it runs" if always =>
        One(|t| Name(t.0.outcome().ending.name()));
    "distance_to_goal" ["m"] "horizontal" if always => One(|t| Number(t.0.outcome().now.distance));
    "energy" ["J"] "work of the wheel motors since the reset, braking counted" if always =>
        One(|t| Number(t.0.outcome().energy));
    "energy_positive" ["J"] "the same, driving only" if always =>
        One(|t| Number(t.0.outcome().energy_positive));
    "slip_ratio" [""]
        "mean over wheels in contact of rim slip over the faster of rim and ground, 0 to 2"
        if always => One(|t| Number(t.0.outcome().now.slip_ratio));
    "tilt" ["rad"] "angle between the trunk and the vertical" if always =>
        One(|t| Number(t.0.outcome().now.tilt()));
    "difficulty" [""] "of the rocks; 0 where none are drawn" if always =>
        One(|t| Number(t.0.setting().difficulty));
    "domain" [""] "the randomised properties, by argument" if always => Group(DOMAIN);
    "reward_terms" [""] "the terms of the step's reward, by name" if always => Terms;
    "solver" [""]
        "`status`, `iterations`, `residual`, `n_contacts`, `message`: the worst of the physics steps"
        if always => Group(SOLVER);
    "charge" ["J"] "" if has_battery => One(charge);
    "waypoints_reached" [""] "" if Settings::has_course => One(|t| Count(reached(t)));
    "waypoints_remaining" [""] "" if Settings::has_course => One(remaining);
    "distance_remaining" ["m"] "" if Settings::has_course => One(|t| Number(t.0.way()));
    "distance_from_trap" ["m"] "" if has_trap => One(|t| Number(t.0.progress().away));
};

/// Name, unit and meaning of the entries that all tasks have.
pub fn rows() -> Vec<(&'static str, &'static str, &'static str)> {
    let described = ENTRIES.iter().filter(|own| !own.meaning.is_empty());
    described
        .map(|own| (own.name, own.unit, own.meaning))
        .collect()
}

/// A value as Python has it.
fn object(py: Python<'_>, value: Value) -> Result<Bound<'_, PyAny>> {
    Ok(match value {
        Number(x) => x.into_pyobject(py)?.into_any(),
        Count(n) => n.into_pyobject(py)?.into_any(),
        Flag(is_so) => is_so.into_pyobject(py)?.to_owned().into_any(),
        Name(name) => PyString::intern(py, name).into_any(),
        Text(text) => text.into_pyobject(py)?.into_any(),
    })
}

/// The values of an entry of all rovers as an array.
fn column(py: Python<'_>, values: Vec<Value>) -> Result<Bound<'_, PyAny>> {
    macro_rules! array {
        ($kind:path) => {{
            let column = values.iter().map(|value| match value {
                $kind(own) => *own,
                _ => unreachable!("invariant: an entry has values of one kind"),
            });
            PyArray1::from_slice(py, &column.collect::<Vec<_>>()).into_any()
        }};
    }
    Ok(match values.first() {
        Some(Number(_)) => array!(Number),
        Some(Count(_)) => array!(Count),
        Some(Flag(_)) => array!(Flag),
        _ => {
            let texts = values.into_iter().map(|value| object(py, value));
            let texts = texts.map(|text| Ok(text?.unbind()));
            PyArray1::from_slice(py, &texts.collect::<Result<Vec<_>>>()?).into_any()
        }
    })
}

/// Makes a value of Python from what an entry reads.
type Take<'py, 'a> = dyn Fn(&dyn Fn(&InfoSource<'_>) -> Value) -> Result<Bound<'py, PyAny>> + 'a;

/// A dictionary of some entries, whose values a function takes from what they read.
fn dictionary<'py>(
    py: Python<'py>,
    entries: &[Entry],
    settings: &Settings,
    mask: Option<&Bound<'py, PyAny>>,
    take: &Take<'py, '_>,
) -> Result<Bound<'py, PyDict>> {
    let out = PyDict::new(py);
    let put = |out: &Bound<'py, PyDict>, name: &str, value: Bound<'py, PyAny>| -> Result<()> {
        out.set_item(PyString::intern(py, name), value)?;
        if let Some(mask) = mask {
            out.set_item(PyString::intern(py, &format!("_{name}")), mask)?;
        }
        Ok(())
    };
    for entry in entries.iter().filter(|entry| (entry.is_present)(settings)) {
        let value = match &entry.read {
            One(read) => take(read)?,
            Group(parts) => dictionary(py, parts, settings, mask, take)?.into_any(),
            Terms => {
                let terms = PyDict::new(py);
                for (i, name) in TERMS.iter().enumerate() {
                    put(
                        &terms,
                        name,
                        take(&|source| Number(source.0.outcome().terms[i]))?,
                    )?;
                }
                terms.into_any()
            }
        };
        put(&out, entry.name, value)?;
    }
    Ok(out)
}

/// The info of one rover.
pub fn info<'py>(py: Python<'py>, source: &InfoSource<'_>) -> Result<Bound<'py, PyDict>> {
    let settings = source.0.rules().settings();
    dictionary(py, ENTRIES, settings, None, &|read| {
        object(py, read(source))
    })
}

/// The infos of all rovers of a batch: for each entry an array, and the mask of those that have it,
/// all.
pub fn infos<'py>(py: Python<'py>, sources: &[InfoSource<'_>]) -> Result<Bound<'py, PyDict>> {
    let Some((first, _)) = sources.first() else {
        return Ok(PyDict::new(py));
    };
    let everyone = PyArray1::from_vec(py, vec![true; sources.len()]).into_any();
    let settings = first.rules().settings();
    dictionary(py, ENTRIES, settings, Some(&everyone), &|read| {
        column(py, sources.iter().map(read).collect())
    })
}
