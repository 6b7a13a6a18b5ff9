//! `PlanarSimulation`: what the planar machines share.

use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple};
use rover_core::integrator::StepOptions;
use rover_core::nalgebra::{DMatrix, Vector2};
use rover_core::planar::{ContactRule, PlanarGround, PlanarTree};
use rover_core::simulation::PlanarSimulation as Core;
use std::sync::{Arc, MutexGuard};

use crate::arguments::{Named, text};
use crate::arrays::{Array, fresh, fresh_matrix, fresh_rows, two, vector};
use crate::contacts::PlanarContacts;
use crate::errors::{BorderError, Kind, Result};
use crate::options::{self, Options, choice, name_of};
use crate::planar_ground::parse;
use crate::shared::{Open, Shared};
use crate::stepping::{AnySimulation, Problem, problem};

/// Rules of contact by name.
pub const RULES: [(&str, ContactRule); 2] = [
    ("nearest", ContactRule::Nearest),
    ("centre_height", ContactRule::CentreHeight),
];

/// Entries of a docstring's section "Args": the options that all planar machines take.
macro_rules! planar_options {
    () => {
        concat!(
            "    gravity: Gravity, (2,), m/s²; (0, -9.81) by default.\n",
            "    contact: \"nearest\", the contact is the point of the ground nearest to the disc's\n",
            "        centre, or \"centre_height\", the rule of the 2010 report, by which the centre itself\n",
            "        stops at the ground.\n",
            $crate::options::step_options!(documented)
        )
    };
}
pub(crate) use planar_options;

/// Base class of planar machines on a ground. It cannot be instantiated.
#[pyclass(module = "rover_gym.core", extends = AnySimulation, subclass, frozen)]
pub struct PlanarSimulation {
    inner: Arc<Shared<Core>>,
    ground: Py<PyAny>,
    parameters: Py<PyDict>,
}

/// Two numbers.
pub fn pair(value: &Bound<'_, PyAny>, kind: Kind, field: &str) -> Result<Vector2<f64>> {
    Ok(two(value, kind, field)?.into())
}

/// Reads the options that all planar simulations take.
fn step_options(given: &Named<'_>) -> Result<(StepOptions, ContactRule)> {
    let mut step = StepOptions::usual();
    if let Some(gravity) = given.read("gravity", pair)? {
        step.gravity = gravity.push(0.0);
    }
    let rule = |value: &Bound<'_, PyAny>, kind, field: &str| {
        choice(field, &text(value, kind, field)?, &RULES)
    };
    let rule = given.read("contact", rule)?.unwrap_or(ContactRule::Nearest);
    Ok((options::read_step(step, given)?, rule))
}

impl PlanarSimulation {
    fn open(&self) -> Result<MutexGuard<'_, Core>, BorderError> {
        self.inner.open()
    }

    /// A machine on a ground. `parameters`: the arguments that describe it; `given`: the options.
    pub fn build(
        machine: impl Into<PlanarTree>,
        ground: &Bound<'_, PyAny>,
        parameters: Bound<'_, PyDict>,
        given: Named<'_>,
    ) -> Result<PyClassInitializer<Self>> {
        let terrain: Arc<dyn PlanarGround> = parse(ground)?;
        let (step, rule) = step_options(&given)?;
        given.finish()?;
        let inner = Arc::new(Shared::new(Core::new(machine, terrain, rule, step)?));
        Ok(AnySimulation::base(inner.clone()).add_subclass(Self {
            inner,
            ground: ground.clone().unbind(),
            parameters: parameters.unbind(),
        }))
    }
}

#[pymethods]
impl PlanarSimulation {
    /// The ground.
    #[getter]
    fn ground(&self, py: Python<'_>) -> Py<PyAny> {
        self.ground.clone_ref(py)
    }

    /// Coordinates, (nv,), x and y, m, then angles, rad, positive counterclockwise.
    #[getter]
    fn q(&self) -> Result<Array> {
        Ok(fresh(self.open()?.q()))
    }

    /// Rates of the coordinates, (nv,), m/s and rad/s.
    #[getter]
    fn v(&self) -> Result<Array> {
        Ok(fresh(self.open()?.v()))
    }

    /// Centres of the discs, world frame, (n_discs, 2), m.
    #[getter]
    fn centres(&self) -> Result<Array> {
        Ok(fresh_rows(
            self.open()?.discs().iter().map(|disc| disc.centre.into()),
        ))
    }

    /// Gap of each disc now, (n_discs,), m; negative where it overlaps the ground.
    #[getter]
    fn gaps(&self) -> Result<Array> {
        Ok(fresh(&self.open()?.gaps()))
    }

    /// Commanded torques, (n_discs,), N m, positive forward.
    #[getter]
    fn torques(&self) -> Result<Array> {
        Ok(fresh(self.open()?.command()))
    }

    /// The keyword arguments that describe the machine.
    #[getter]
    fn parameters<'py>(&self, py: Python<'py>) -> Result<Bound<'py, PyDict>> {
        Ok(self.parameters.bind(py).copy()?)
    }

    /// Keyword arguments for a simulation with the same options.
    #[getter]
    fn settings<'py>(&self, py: Python<'py>) -> Result<Bound<'py, PyDict>> {
        let inner = self.open()?;
        let step = inner.options();
        let gravity = (step.gravity.x, step.gravity.y).into_pyobject(py)?;
        let settings = options::settings(&gravity, step.clone())?;
        settings.set_item("contact", name_of(inner.scene().rule, &RULES))?;
        Ok(settings)
    }

    /// Sets coordinates and rates. Torques do not change.
    ///
    /// Time starts at 0, and the next step has no warm start.
    ///
    /// Args:
    ///     q: Coordinates, (nv,), m and rad.
    ///     v: Their rates, (nv,), m/s and rad/s; at rest by default.
    ///
    /// Raises:
    ///     StateError: An array has a wrong length or an entry that is not finite. Nothing has
    ///         changed.
    #[pyo3(signature = (q, v = None))]
    fn set_state(&self, q: &Bound<'_, PyAny>, v: Option<&Bound<'_, PyAny>>) -> Result<()> {
        let mut inner = self.open()?;
        let q = vector(q, Kind::State, "q")?;
        let rest = || Ok(vec![0.0; inner.v().len()]);
        let v = v.map_or_else(rest, |v| vector(v, Kind::State, "v"))?;
        Ok(inner.set_state(&q, &v)?)
    }

    /// Sets the driving torques; each saturates at its limit if the machine has one.
    ///
    /// Args:
    ///     torques: Torques between the body and each disc, (n_discs,), N m, positive forward.
    ///
    /// Raises:
    ///     CommandError: A wrong length, or an entry that is not finite. Nothing has changed.
    fn set_torques(&self, torques: &Bound<'_, PyAny>) -> Result<()> {
        let mut inner = self.open()?;
        let torques = vector(torques, Kind::Command, "torques")?;
        Ok(inner.set_inputs(&torques)?)
    }

    /// The contacts of the last step.
    #[getter]
    fn contacts(&self) -> Result<PlanarContacts> {
        Ok(PlanarContacts::new(self.open()?.contacts()))
    }

    /// Mass matrix now, (nv, nv), in kg, kg m and kg m².
    fn mass_matrix(&self) -> Result<Array> {
        let inner = self.open()?;
        let nv = inner.v().len();
        let M = DMatrix::from_row_slice(nv, nv, &inner.mass_matrix());
        Ok(fresh_matrix(&M))
    }

    /// The friction-contact problem of the last step; if the step was split, of its last part.
    ///
    /// Returns:
    ///     Delassus operator W, (2 n_c, 2 n_c), 1/kg; free velocity, (2 n_c,), m/s; friction
    ///     coefficients, (n_c,).
    fn last_problem(&self) -> Result<Problem> {
        Ok(problem(&*self.open()?))
    }

    fn __repr__(slf: &Bound<'_, Self>) -> Result<String> {
        let ground = slf.get().ground.bind(slf.py()).repr()?.to_string();
        let kind = slf.get_type().name()?.to_string();
        Ok(slf.as_super().get().shown(&kind, Ok(ground)))
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> Result<Bound<'py, PyTuple>> {
        let (py, own, base) = (slf.py(), slf.get(), slf.as_super().get());
        let settings = own.settings(py)?;
        settings.update(own.parameters.bind(py).as_mapping())?;
        let given = (slf.get_type(), own.ground(py), settings, base.snapshot()?);
        Ok((slf.get_type().getattr("_rebuild")?, given).into_pyobject(py)?)
    }

    #[staticmethod]
    fn _rebuild<'py>(
        kind: &Bound<'py, PyAny>,
        ground: &Bound<'py, PyAny>,
        settings: &Bound<'py, PyDict>,
        snapshot: &Bound<'py, PyAny>,
    ) -> Result<Bound<'py, PyAny>> {
        let made = kind.call((ground,), Some(settings))?;
        let base = made.cast::<AnySimulation>().map_err(PyErr::from)?;
        base.get().restore(snapshot)?;
        Ok(made)
    }
}
