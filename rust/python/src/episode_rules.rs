//! `EpisodeRules`: what all episodes of a task share.

use std::sync::Arc;

use pyo3::prelude::*;
use pyo3::types::{PyDict, PyMapping, PyTuple};
use rover_core::episode::{Rules, Settings, TERMS, Weights};

use crate::arguments::{Given, count, number, refused};
use crate::arrays::{fresh, fresh_rows, vector};
use crate::errors::{BorderError, Kind};
use crate::model::RoverModel;
use crate::reading::scan_points;

/// What all episodes of a driving task share.
///
/// Args:
///     model: The machine.
///     substeps: Physics steps of a control period.
///     dt: Control period, s.
///     torque_limits: Torque of a torque action of 1, (n_wheels,), N m.
///     max_steering: Set-point of a steering action of 1, rad. Actions have an entry for each
///         steering joint, in the order of the wheels, after the torques; none if this is 0.
///     goal_tolerance: Distance within which the goal is reached, m.
///     cos_max_tilt: Cosine of the tilt beyond which the rover has rolled over.
///     stuck_time: Time until a high-centred rover ends the episode, s.
///     weights: Weights of the reward, one for each of its terms.
///     scale: Value of an entry of 1 of the observation, (size,).
///     noise: Standard deviation of each entry's noise, (size,); no noise by default.
///     scan: Points of the height scan ahead and to the right of the trunk's origin in the heading
///         frame, (n, 2), m; none by default.
///     goals: Number of goals that are reached one after the other. The observation of several has
///         three entries more before the heights: the goal after the present one, ahead and to the
///         right, m, and the number of goals still to reach.
///     battery: Work of the motors, driving or braking, after which the battery is empty and the
///         episode ends, J; none by default. The observation of a rover with a battery has one
///         entry more, after the time to high-centring: the fraction of its charge.
///
/// Raises:
///     ModelError: `model` is not a RoverModel.
///     OptionError: A number is out of its range, a list has a wrong length, or the weights are not
///         those of the terms.
#[pyclass(module = "rover_gym.mechanics", frozen)]
pub struct EpisodeRules {
    pub inner: Arc<Rules>,
}

impl EpisodeRules {
    pub fn of(inner: Arc<Rules>) -> Self {
        Self { inner }
    }
}

/// The weights in the order of the terms.
fn weights(given: &Bound<'_, PyAny>) -> PyResult<Weights> {
    let what = format!("a mapping of {} to numbers", TERMS.join(", "));
    let refuse = || refused(given, Kind::Option, "weights", &what);
    let map = given.cast::<PyMapping>().map_err(|_| refuse())?;
    if map.len()? != TERMS.len() {
        return Err(refuse().into());
    }
    let mut weights = Weights::default();
    for (own, name) in weights.iter_mut().zip(TERMS) {
        let weight = map.get_item(name).map_err(|_| refuse())?;
        *own = number(&weight, Kind::Option, &format!("weights.{name}"))?;
    }
    Ok(weights)
}

#[pymethods]
impl EpisodeRules {
    #[new]
    #[allow(clippy::too_many_arguments)] // keyword arguments of a Python class
    #[pyo3(signature = (model, *, substeps, dt, torque_limits, max_steering, goal_tolerance,
        cos_max_tilt, stuck_time, weights, scale, noise = None, scan = None, goals = Given::MISSING, battery = None),
        text_signature = "(model, *, substeps, dt, torque_limits, max_steering, goal_tolerance, cos_max_tilt, stuck_time, weights, scale, noise=None, scan=None, goals=1, battery=None)")]
    fn new(
        model: &Bound<'_, PyAny>,
        substeps: &Bound<'_, PyAny>,
        dt: &Bound<'_, PyAny>,
        torque_limits: &Bound<'_, PyAny>,
        max_steering: &Bound<'_, PyAny>,
        goal_tolerance: &Bound<'_, PyAny>,
        cos_max_tilt: &Bound<'_, PyAny>,
        stuck_time: &Bound<'_, PyAny>,
        weights: &Bound<'_, PyAny>,
        scale: &Bound<'_, PyAny>,
        noise: Option<&Bound<'_, PyAny>>,
        scan: Option<&Bound<'_, PyAny>>,
        goals: Given<'_>,
        battery: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let model = model
            .extract::<RoverModel>()
            .map_err(|_| refused(model, Kind::Model, "model", "a RoverModel"))?;
        let option = |given, field| number(given, Kind::Option, field);
        let list = |given, field| vector(given, Kind::Option, field);
        let settings = Settings {
            substeps: count(substeps, Kind::Option, "substeps")?,
            dt: option(dt, "dt")?,
            torque_limits: list(torque_limits, "torque_limits")?,
            max_steering: option(max_steering, "max_steering")?,
            goal_tolerance: option(goal_tolerance, "goal_tolerance")?,
            cos_max_tilt: option(cos_max_tilt, "cos_max_tilt")?,
            stuck_time: option(stuck_time, "stuck_time")?,
            weights: self::weights(weights)?,
            scale: list(scale, "scale")?,
            noise: noise.map_or(Ok(Vec::new()), |given| list(given, "noise"))?,
            scan: scan_points(scan)?,
            goals: goals.count(1, Kind::Option, "goals")?,
            battery: battery.map(|given| option(given, "battery")).transpose()?,
        };
        let inner = Rules::new(model.inner, settings).map_err(BorderError::from)?;
        Ok(Self::of(Arc::new(inner)))
    }

    fn __getnewargs_ex__<'py>(
        &self,
        py: Python<'py>,
    ) -> PyResult<((RoverModel,), Bound<'py, PyDict>)> {
        let settings = self.inner.settings();
        let named = PyDict::new(py);
        named.set_item("substeps", settings.substeps)?;
        named.set_item("dt", settings.dt)?;
        named.set_item("torque_limits", fresh(py, &settings.torque_limits))?;
        named.set_item("max_steering", settings.max_steering)?;
        named.set_item("goal_tolerance", settings.goal_tolerance)?;
        named.set_item("cos_max_tilt", settings.cos_max_tilt)?;
        named.set_item("stuck_time", settings.stuck_time)?;
        let weights = PyDict::new(py);
        for (name, weight) in TERMS.iter().zip(&settings.weights) {
            weights.set_item(name, weight)?;
        }
        named.set_item("weights", weights)?;
        named.set_item("scale", fresh(py, &settings.scale))?;
        if self.inner.is_noisy() {
            named.set_item("noise", fresh(py, &settings.noise))?;
        }
        named.set_item("scan", fresh_rows(py, &settings.scan)?)?;
        named.set_item("goals", settings.goals)?;
        named.set_item("battery", settings.battery)?;
        let model = RoverModel::from(self.inner.model().clone());
        Ok(((model,), named))
    }

    /// Names of the reward's terms, in the order of their sum.
    #[getter]
    #[allow(clippy::unused_self)] // an attribute of the object
    fn terms<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyTuple>> {
        PyTuple::new(py, TERMS)
    }

    fn __repr__(&self) -> String {
        let (actions, size) = (self.inner.n_actions(), self.inner.size());
        format!("EpisodeRules({actions} actions, {size} observed)")
    }
}
