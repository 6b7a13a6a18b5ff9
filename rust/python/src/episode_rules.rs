//! `EpisodeRules`: what all episodes of a task share.

use std::sync::Arc;

use pyo3::prelude::*;
use pyo3::types::{PyDict, PyMapping, PyTuple};
use rover_core::multibody::Model;
use rover_task::episode::channels::{Field, Sizes, fields};
use rover_task::episode::{Rules, Settings, TERMS, Weights};

use crate::arguments::{Named, count, number, refused};
use crate::arrays::{fresh, fresh_rows, vector};
use crate::errors::{Kind, Result};
use crate::infos;
use crate::model::RoverModel;
use crate::reading::scan_points;

/// Rules of a driving task, which all its episodes share.
///
/// Args:
///     model: The machine.
///     substeps: Physics steps of a control period.
///     dt: Control period, s.
///     torque_limits: Torque for an action of 1, (n_wheels,), N m.
///     max_steering: Steering set-point for an action of 1, rad. After the torques, actions have an
///         entry for each steering joint, in the order of the wheels; none if this is 0.
///     goal_tolerance: Distance within which the goal is reached, m.
///     cos_max_tilt: Cosine of the tilt beyond which the rover has rolled over.
///     stuck_time: Time after which an episode with a high-centred rover ends, s.
///     weights: Weights of the terms of the reward, in the order of `terms`.
///     gravity: Magnitude of gravity, m/s2. Forces in observations are divided by the mean weight
///         on a wheel.
///     noise: Standard deviation of the noise of observed entries without bounds; no noise by
///         default.
///     scan: Points of the height scan ahead and to the right of the trunk's origin in the heading
///         frame, (n, 2), m; none by default.
///     goals: Number of goals to reach in sequence. With more than one, the observation has three
///         further entries before the heights: the goal after the present one, ahead and to the
///         right, m, and the number of goals still to reach.
///     battery: Energy of the battery, J; none by default. The work of the motors, driving or
///         braking, discharges it, and the episode ends when it is empty. With a battery, the
///         observation has one further entry after the time to high-centring: the state of charge,
///         from 0 to 1.
///     free_distance: Distance from the start at which the rover is free, m; none by default. The
///         episode then ends, and progress is measured from the start.
///     field_margin: How far the field reaches beyond the rectangle of start and goals, m; without
///         an edge by default. An episode ends where the trunk's origin leaves it.
///
/// Raises:
///     ModelError: `model` is not a RoverModel.
///     OptionError: A number is out of range, a list has a wrong length, or the number of weights
///         differs from that of the terms.
#[pyclass(module = "rover_gym.core", frozen)]
pub struct EpisodeRules {
    pub inner: Arc<Rules>,
}

impl EpisodeRules {
    pub fn of(inner: Arc<Rules>) -> Self {
        Self { inner }
    }
}

/// The weights in the order of the terms.
fn weights(given: &Bound<'_, PyAny>, kind: Kind, field: &str) -> Result<Weights> {
    let what = format!("a mapping of {} to numbers", TERMS.join(", "));
    let refuse = || refused(given, kind, field, &what);
    let map = given.cast::<PyMapping>().map_err(|_| refuse())?;
    if map.len()? != TERMS.len() {
        return Err(refuse());
    }
    let mut weights = Weights::default();
    for (own, name) in weights.iter_mut().zip(TERMS) {
        let weight = map.get_item(name).map_err(|_| refuse())?;
        *own = number(&weight, kind, &format!("{field}.{name}"))?;
    }
    Ok(weights)
}

#[pymethods]
impl EpisodeRules {
    #[new]
    #[pyo3(signature = (model, **settings),
        text_signature = "(model, *, substeps, dt, torque_limits, max_steering, goal_tolerance, cos_max_tilt, stuck_time, weights, gravity, noise=0.0, scan=None, goals=1, battery=None, free_distance=None, field_margin=None)")]
    fn new(model: &Bound<'_, PyAny>, settings: Option<&Bound<'_, PyDict>>) -> Result<Self> {
        let given = Named::keywords(model.py(), settings)?;
        let wrong = |_| refused(model, Kind::Model, "model", "a RoverModel");
        let model = model.extract::<RoverModel>().map_err(wrong)?;
        let settings = Settings {
            substeps: given.need("substeps", count)?,
            dt: given.need("dt", number)?,
            torque_limits: given.need("torque_limits", vector)?,
            max_steering: given.need("max_steering", number)?,
            goal_tolerance: given.need("goal_tolerance", number)?,
            cos_max_tilt: given.need("cos_max_tilt", number)?,
            stuck_time: given.need("stuck_time", number)?,
            weights: given.need("weights", weights)?,
            gravity: given.need("gravity", number)?,
            noise: given.maybe("noise")?.unwrap_or_default(),
            scan: scan_points(given.some("scan")?.as_ref())?,
            goals: given.count("goals", 1)?,
            battery: given.maybe("battery")?,
            free_distance: given.maybe("free_distance")?,
            field_margin: given.maybe("field_margin")?,
        };
        given.finish()?;
        Ok(Self::of(Arc::new(Rules::new(model.inner, settings)?)))
    }

    fn __getnewargs_ex__<'py>(
        &self,
        py: Python<'py>,
    ) -> Result<((RoverModel,), Bound<'py, PyDict>)> {
        let settings = self.inner.settings();
        let named = PyDict::new(py);
        named.set_item("substeps", settings.substeps)?;
        named.set_item("dt", settings.dt)?;
        named.set_item("torque_limits", fresh(&settings.torque_limits))?;
        named.set_item("max_steering", settings.max_steering)?;
        named.set_item("goal_tolerance", settings.goal_tolerance)?;
        named.set_item("cos_max_tilt", settings.cos_max_tilt)?;
        named.set_item("stuck_time", settings.stuck_time)?;
        let weights = PyDict::new(py);
        for (name, weight) in TERMS.iter().zip(&settings.weights) {
            weights.set_item(name, weight)?;
        }
        named.set_item("weights", weights)?;
        named.set_item("gravity", settings.gravity)?;
        named.set_item("noise", settings.noise)?;
        named.set_item("scan", fresh_rows(settings.scan.iter().copied()))?;
        named.set_item("goals", settings.goals)?;
        named.set_item("battery", settings.battery)?;
        named.set_item("free_distance", settings.free_distance)?;
        named.set_item("field_margin", settings.field_margin)?;
        let model = RoverModel::from(self.inner.model().clone());
        Ok(((model,), named))
    }

    /// Names of the terms of the reward, in the order in which they are summed.
    #[getter]
    #[allow(clippy::unused_self)] // an attribute of the object
    fn terms<'py>(&self, py: Python<'py>) -> Result<Bound<'py, PyTuple>> {
        Ok(PyTuple::new(py, TERMS)?)
    }

    /// The fields of an observation, in order.
    ///
    /// Returns:
    ///     Name, first entry, size, unit, scale (size,), lower and upper bound of scaled entries,
    ///     and meaning of each field.
    fn observation<'py>(&self, py: Python<'py>) -> Result<Vec<Bound<'py, PyTuple>>> {
        let row = |field: Field| {
            let own = field.channel;
            let ([low, high], scale) = (own.bounds, PyTuple::new(py, field.scale)?);
            let (start, size) = (field.entries.start, field.entries.len());
            let (name, unit, meaning) = (own.name, own.unit, own.meaning);
            let row = (name, start, size, unit, scale, low, high, meaning);
            Ok(row.into_pyobject(py)?)
        };
        self.inner.observation().into_iter().map(row).collect()
    }

    /// First entry, size, name, meaning, unit and scale of the built-in rover's observed fields.
    #[staticmethod]
    fn observation_rows() -> Vec<(
        usize,
        usize,
        &'static str,
        &'static str,
        &'static str,
        String,
    )> {
        let sizes = Sizes {
            model: &Model::gallery_rover(),
            actions: 12,
            goals: 1,
            has_battery: false,
            points: 0,
            gravity: 9.81,
        };
        let row = |field: Field| {
            let (own, start, size) = (field.channel, field.entries.start, field.entries.len());
            let (name, meaning, unit, scale) = (own.name, own.meaning, own.unit, own.scale.words());
            (start, size, name, meaning, unit, scale)
        };
        fields(&sizes).into_iter().map(row).collect()
    }

    /// Name, unit and meaning of each entry of an info.
    #[staticmethod]
    fn info_rows() -> Vec<(&'static str, &'static str, &'static str)> {
        infos::rows()
    }

    fn __repr__(&self) -> String {
        let (actions, size) = (self.inner.n_actions(), self.inner.size());
        format!("EpisodeRules({actions} actions, {size} observed)")
    }
}
