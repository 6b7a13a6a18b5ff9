//! `Simulation`: one rover on one terrain.

use numpy::{PyArray1, PyArray2};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple};
use rover_core::integrator::{
    Accuracy, Stabilisation, StepOptions, StepReport as CoreReport, Variant,
};
use rover_core::multibody::{Energy as CoreEnergy, Model, coordinates};
use rover_core::nalgebra::DMatrix;
use rover_core::simulation::{Look, ReadingLayout, Simulation as CoreSimulation};
use std::sync::{Arc, MutexGuard};

use crate::accuracy;
use crate::arguments::{Given, number, text, texts};
use crate::arrays::{fresh, fresh_matrix, fresh_rows, vector};
use crate::contacts::Contacts;
use crate::errors::{BorderError, Kind, Value};
use crate::friction_contact::{SIMULATION_SOLVERS, solver_options};
use crate::model::{Coordinates, Pair, RoverModel, checked_gravity, poses, tags};
use crate::plane::Plane;
use crate::reading::{place, scan_points, slices};
use crate::shared::{Shared, Watch};
use crate::snapshot::{Snapshot, belonging};
use crate::sphere_field::Ground;

/// What the solver says of the steps just taken (worst over the steps of one call).
#[pyclass(module = "rover_gym._core", frozen)]
pub struct StepReport {
    inner: CoreReport,
}

#[pymethods]
impl StepReport {
    #[getter]
    fn status(&self) -> &'static str {
        if self.inner.is_converged() {
            "converged"
        } else {
            "not_converged"
        }
    }

    #[getter]
    fn is_converged(&self) -> bool {
        self.inner.is_converged()
    }

    #[getter]
    fn steps(&self) -> usize {
        self.inner.steps
    }

    #[getter]
    fn iterations(&self) -> usize {
        self.inner.iterations
    }

    #[getter]
    fn newton_iterations(&self) -> usize {
        self.inner.newton_iterations
    }

    #[getter]
    fn residual(&self) -> f64 {
        self.inner.residual
    }

    #[getter]
    fn n_contacts(&self) -> usize {
        self.inner.n_contacts
    }

    #[getter]
    fn retaken(&self) -> usize {
        self.inner.retaken
    }

    #[getter]
    fn energy_gain(&self) -> f64 {
        self.inner.energy_gain
    }

    #[getter]
    fn energy_removed(&self) -> f64 {
        self.inner.energy_removed
    }

    #[getter]
    fn energy_lifted(&self) -> f64 {
        self.inner.energy_lifted
    }

    fn __repr__(&self) -> String {
        let r = &self.inner;
        format!(
            "StepReport(status={:?}, steps={}, iterations={}, residual={:.3e}, n_contacts={})",
            self.status(),
            r.steps,
            r.iterations,
            r.residual,
            r.n_contacts
        )
    }
}

/// Kinetic and potential energy, J.
#[pyclass(module = "rover_gym._core", frozen)]
pub struct Energy {
    inner: CoreEnergy,
}

#[pymethods]
impl Energy {
    #[getter]
    fn kinetic(&self) -> f64 {
        self.inner.kinetic
    }

    #[getter]
    fn potential(&self) -> f64 {
        self.inner.potential
    }

    #[getter]
    fn total(&self) -> f64 {
        self.inner.total()
    }

    fn __repr__(&self) -> String {
        format!(
            "Energy(kinetic={}, potential={})",
            self.inner.kinetic, self.inner.potential
        )
    }
}

/// A rover on a terrain, stepped through time.
#[pyclass(module = "rover_gym._core", frozen)]
pub struct Simulation {
    inner: Shared<CoreSimulation>,
    model: Arc<Model>,
    options: StepOptions,
    origin: Origin,
}

/// What a simulation was made with and the core does not keep, for pickling.
#[derive(Clone)]
pub struct Origin {
    terrain: Ground,
    solver: String,
    max_iterations: usize,
}

/// W, free velocity and friction coefficients.
pub type Problem<'py> = (
    Bound<'py, PyArray2<f64>>,
    Bound<'py, PyArray1<f64>>,
    Bound<'py, PyArray1<f64>>,
);

fn names(joints: &Bound<'_, PyAny>) -> PyResult<Vec<String>> {
    texts(joints, Kind::Command, "joints")
}

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

/// The word that stands for a value.
pub fn name_of<T: PartialEq + Copy>(value: T, choices: &[(&'static str, T)]) -> &'static str {
    choices
        .iter()
        .find(|(_, v)| *v == value)
        .map_or("", |(name, _)| name)
}

impl From<CoreReport> for StepReport {
    fn from(inner: CoreReport) -> Self {
        Self { inner }
    }
}

impl From<CoreEnergy> for Energy {
    fn from(inner: CoreEnergy) -> Self {
        Self { inner }
    }
}

impl Simulation {
    /// A simulation, and what it was made with.
    pub fn of(inner: CoreSimulation, origin: Origin) -> Self {
        Self {
            model: inner.model().clone(),
            options: inner.options().clone(),
            inner: Shared::new(inner),
            origin,
        }
    }

    /// The simulation, for one call.
    pub fn open(&self) -> Result<MutexGuard<'_, CoreSimulation>, BorderError> {
        self.inner.open()
    }

    /// What it was made with and the core does not keep.
    pub fn origin(&self) -> &Origin {
        &self.origin
    }
}

#[pymethods]
impl Simulation {
    #[new]
    #[allow(clippy::too_many_arguments)] // keyword arguments of a Python class
    #[pyo3(signature = (model = Given::MISSING, terrain = None, *, gravity = None, friction = Given::MISSING, restitution = Given::MISSING,
        time_step = Given::MISSING, variant = Given::MISSING, theta = Given::MISSING, forecast = Given::MISSING,
        solver = Given::MISSING, tolerance = Given::MISSING, max_iterations = Given::MISSING,
        stabilisation = Given::MISSING, warm_start = Given::MISSING, accuracy = None),
        text_signature = "(model=None, terrain=None, *, gravity=None, friction=0.7, restitution=0.0, time_step=None, variant=None, theta=0.5, forecast=0.5, solver='auto', tolerance=None, max_iterations=1000, stabilisation='projection', warm_start=True, accuracy=None)")]
    fn new(
        model: Given<'_>,
        terrain: Option<&Bound<'_, PyAny>>,
        gravity: Option<&Bound<'_, PyAny>>,
        friction: Given<'_>,
        restitution: Given<'_>,
        time_step: Given<'_>,
        variant: Given<'_>,
        theta: Given<'_>,
        forecast: Given<'_>,
        solver: Given<'_>,
        tolerance: Given<'_>,
        max_iterations: Given<'_>,
        stabilisation: Given<'_>,
        warm_start: Given<'_>,
        accuracy: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let option = Kind::Option;
        let time_step = time_step.maybe(option, "time_step")?;
        let tolerance = tolerance.maybe(option, "tolerance")?;
        let variant = (variant.some())
            .map(|v| {
                choice("variant", &text(&v, option, "variant")?, &VARIANTS).map_err(PyErr::from)
            })
            .transpose()?;
        let solver = solver.text("auto", option, "solver")?;
        let max_iterations = max_iterations.count(1000, option, "max_iterations")?;
        let stabilisation = stabilisation.text("projection", option, "stabilisation")?;
        let model = model.object::<RoverModel>(Kind::Model, "model", "a RoverModel")?;
        let model = model.map_or_else(|| Arc::new(Model::rover()), |m| m.inner);
        let terrain = match terrain {
            None => Ground::Plane(Plane {
                inner: rover_core::geometry::Plane::ground(),
            }),
            Some(given) => Ground::parse(given)?,
        };
        let chosen = match accuracy {
            None => Accuracy::BALANCED,
            Some(given) => {
                let chosen = accuracy::parse(given)?;
                let clash = [
                    ("time_step", time_step.is_some()),
                    ("variant", variant.is_some()),
                    ("tolerance", tolerance.is_some()),
                ];
                if let Some((field, _)) = clash.iter().find(|(_, given)| *given) {
                    let message =
                        format!("{field}: accuracy chooses it, so it cannot be given beside");
                    return Err(BorderError::option(field, message, Value::Nothing).into());
                }
                chosen
            }
        };
        let tolerance = tolerance.unwrap_or(chosen.tolerance);
        let options = StepOptions {
            gravity: checked_gravity(gravity)?,
            friction_coefficient: friction.number(0.7, option, "friction")?,
            restitution: restitution.number(0.0, option, "restitution")?,
            time_step: time_step.unwrap_or(chosen.time_step),
            theta: theta.number(0.5, option, "theta")?,
            forecast: forecast.number(0.5, option, "forecast")?,
            variant: variant.unwrap_or(chosen.variant),
            stabilisation: choice("stabilisation", &stabilisation, &STABILISATIONS)?,
            warm_start: warm_start.flag(true, option, "warm_start")?,
            solver: solver_options(&solver, tolerance, max_iterations, &SIMULATION_SOLVERS)?,
            ..StepOptions::default()
        };
        let inner =
            CoreSimulation::new(model, terrain.terrain(), options).map_err(BorderError::from)?;
        let origin = Origin {
            terrain,
            solver,
            max_iterations,
        };
        Ok(Self::of(inner, origin))
    }

    #[getter]
    fn model(&self) -> RoverModel {
        RoverModel {
            inner: self.model.clone(),
        }
    }

    #[getter]
    fn terrain<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.origin.terrain.to_object(py)
    }

    #[getter]
    fn time(&self) -> PyResult<f64> {
        Ok(self.open()?.state().time)
    }

    #[getter]
    fn time_step(&self) -> f64 {
        self.options.time_step
    }

    #[getter]
    fn gravity<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        fresh(py, self.options.gravity.as_slice())
    }

    #[getter]
    fn friction(&self) -> f64 {
        self.options.friction_coefficient
    }

    #[getter]
    fn restitution(&self) -> f64 {
        self.options.restitution
    }

    /// The keyword arguments that make a simulation with these options.
    #[getter]
    fn settings<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let o = &self.options;
        let settings = PyDict::new(py);
        settings.set_item("gravity", (o.gravity.x, o.gravity.y, o.gravity.z))?;
        settings.set_item("friction", o.friction_coefficient)?;
        settings.set_item("restitution", o.restitution)?;
        settings.set_item("time_step", o.time_step)?;
        settings.set_item("variant", name_of(o.variant, &VARIANTS))?;
        settings.set_item("theta", o.theta)?;
        settings.set_item("forecast", o.forecast)?;
        settings.set_item("solver", &self.origin.solver)?;
        settings.set_item("tolerance", o.solver.tolerance)?;
        settings.set_item("max_iterations", self.origin.max_iterations)?;
        settings.set_item("stabilisation", name_of(o.stabilisation, &STABILISATIONS))?;
        settings.set_item("warm_start", o.warm_start)?;
        Ok(settings)
    }

    #[getter]
    fn q<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let q = {
            let simulation = self.open()?;
            coordinates::to_public(simulation.model(), &simulation.state().configuration)
        };
        Ok(fresh(py, &q))
    }

    #[getter]
    fn v<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray1<f64>>> {
        Ok(fresh(py, &self.open()?.state().v))
    }

    #[getter]
    fn rotation<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let R = self
            .open()?
            .state()
            .configuration
            .attitude
            .to_rotation_matrix();
        fresh_matrix(
            py,
            &DMatrix::from_iterator(3, 3, R.matrix().iter().copied()),
        )
    }

    #[pyo3(signature = (q, qdot = None, *, coordinates = Given::MISSING), text_signature = "($self, q, qdot=None, *, coordinates='state')")]
    fn set_state(
        &self,
        q: &Bound<'_, PyAny>,
        qdot: Option<&Bound<'_, PyAny>>,
        coordinates: Given<'_>,
    ) -> PyResult<()> {
        let kind = Coordinates::given(coordinates)?;
        let q = vector(q, Kind::State, "q")?;
        let configuration = kind.configuration(&self.model, &q)?;
        let qdot = qdot.map_or_else(
            || Ok(vec![0.0; self.model.nv()]),
            |v| vector(v, Kind::State, "qdot"),
        )?;
        let v = kind.velocity(&self.model, &q, &qdot)?;
        self.open()?.set_state(configuration, v);
        Ok(())
    }

    fn report_state<'py>(&self, py: Python<'py>) -> PyResult<Pair<'py>> {
        let held = self.open()?;
        let state = held.state();
        let (q, qdot) = coordinates::to_report(&self.model, &state.configuration, &state.v)
            .map_err(BorderError::from)?;
        Ok((fresh(py, &q), fresh(py, &qdot)))
    }

    #[getter]
    fn wheel_torques<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray1<f64>>> {
        Ok(fresh(py, self.open()?.wheel_torques()))
    }

    #[getter]
    fn motor_torques<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray1<f64>>> {
        Ok(fresh(py, self.open()?.motor_torques()))
    }

    fn set_wheel_torques(&self, torques: &Bound<'_, PyAny>) -> PyResult<()> {
        let torques = vector(torques, Kind::Command, "torques")?;
        Ok(self
            .open()?
            .set_wheel_torques(&torques)
            .map_err(BorderError::from)?)
    }

    #[getter]
    fn steering<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray1<f64>>> {
        Ok(fresh(py, &self.open()?.steering()))
    }

    fn set_steering(&self, set_points: &Bound<'_, PyAny>) -> PyResult<()> {
        let set_points = vector(set_points, Kind::Command, "set_points")?;
        Ok(self
            .open()?
            .set_steering(&set_points)
            .map_err(BorderError::from)?)
    }

    fn set_commands(
        &self,
        torques: &Bound<'_, PyAny>,
        set_points: &Bound<'_, PyAny>,
    ) -> PyResult<()> {
        let torques = vector(torques, Kind::Command, "torques")?;
        let set_points = vector(set_points, Kind::Command, "set_points")?;
        Ok(self
            .open()?
            .set_commands(&torques, &set_points)
            .map_err(BorderError::from)?)
    }

    fn set_joint_torques(&self, torques: &Bound<'_, PyAny>) -> PyResult<()> {
        let torques = vector(torques, Kind::Command, "torques")?;
        Ok(self
            .open()?
            .set_joint_torques(&torques)
            .map_err(BorderError::from)?)
    }

    #[pyo3(signature = (joints, set_points = None, *, stiffness = None, damping = None))]
    fn hold(
        &self,
        joints: &Bound<'_, PyAny>,
        set_points: Option<&Bound<'_, PyAny>>,
        stiffness: Option<&Bound<'_, PyAny>>,
        damping: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<()> {
        let one = |x: &Bound<'_, PyAny>, field| number(x, Kind::Command, field);
        let read = |s: &Bound<'_, PyAny>| match s.len() {
            Ok(_) => vector(s, Kind::Command, "set_points"),
            Err(_) => one(s, "set_points").map(|x| vec![x]),
        };
        let set_points = set_points.map(read).transpose()?;
        let stiffness = stiffness.map(|x| one(x, "stiffness")).transpose()?;
        let damping = damping.map(|x| one(x, "damping")).transpose()?;
        let joints = names(joints)?;
        let mut inner = self.open()?;
        let held = inner.hold(&joints, set_points.as_deref(), stiffness, damping);
        Ok(held.map_err(BorderError::from)?)
    }

    fn release(&self, joints: &Bound<'_, PyAny>) -> PyResult<()> {
        Ok(self
            .open()?
            .release(&names(joints)?)
            .map_err(BorderError::from)?)
    }

    fn brake(&self) -> PyResult<()> {
        self.open()?.brake();
        Ok(())
    }

    #[pyo3(signature = (n = Given::MISSING), text_signature = "($self, n=1)")]
    fn step(&self, py: Python<'_>, n: Given<'_>) -> PyResult<StepReport> {
        let steps = n.count(1, Kind::Option, "n")?;
        let mut held = self.open()?;
        let (inner, mut watch) = (&mut *held, Watch::new());
        let report = py.detach(|| inner.step_while(steps, &mut || watch.go_on()));
        Ok(watch.result(report)?.into())
    }

    #[getter]
    fn contacts(&self) -> PyResult<Contacts> {
        Ok(Contacts::new(&self.model, self.open()?.contacts()))
    }

    #[getter]
    fn wheel_gaps<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let contacts = self.open()?.wheel_contacts();
        Ok(PyArray1::from_iter(py, contacts.iter().map(|c| c.gap)))
    }

    #[getter]
    fn wheel_forces<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        fresh_rows(py, &self.open()?.wheel_forces())
    }

    #[getter]
    fn trunk_force(&self) -> PyResult<f64> {
        Ok(self.open()?.body_force())
    }

    #[getter]
    fn deepest_overlap(&self) -> PyResult<f64> {
        Ok(self.open()?.deepest_overlap())
    }

    #[pyo3(signature = (target = None, scan = None))]
    fn reading<'py>(
        &self,
        py: Python<'py>,
        target: Option<&Bound<'_, PyAny>>,
        scan: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let scan = scan_points(scan)?;
        let look = Look {
            target: place(target)?,
            scan: &scan,
        };
        let mut row = vec![0.0; ReadingLayout::new(&self.model, scan.len()).size()];
        self.open()?.read(&look, &mut row);
        Ok(PyArray1::from_vec(py, row))
    }

    #[pyo3(signature = (n_scan = Given::MISSING), text_signature = "($self, n_scan=0)")]
    #[allow(clippy::needless_pass_by_value)] // what pyo3 hands over
    fn reading_layout<'py>(
        &self,
        py: Python<'py>,
        n_scan: Given<'_>,
    ) -> PyResult<Bound<'py, PyDict>> {
        let n_scan = n_scan.count(0, Kind::Option, "n_scan")?;
        slices(py, &ReadingLayout::new(&self.model, n_scan))
    }

    fn energy(&self) -> PyResult<Energy> {
        Ok(self.open()?.energy().into())
    }

    fn momentum<'py>(&self, py: Python<'py>) -> PyResult<Pair<'py>> {
        let momentum = self.open()?.momentum();
        Ok((
            fresh(py, momentum.linear.as_slice()),
            fresh(py, momentum.angular.as_slice()),
        ))
    }

    fn centre_of_mass<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray1<f64>>> {
        Ok(fresh(py, self.open()?.centre_of_mass().as_slice()))
    }

    fn tags<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        tags(py, &self.model, &self.open()?.kinematics())
    }

    fn poses<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        poses(py, &self.model, &self.open()?.kinematics())
    }

    fn snapshot(&self) -> PyResult<Snapshot> {
        Ok(Snapshot {
            inner: self.open()?.snapshot(),
        })
    }

    fn restore(&self, snapshot: &Bound<'_, PyAny>) -> PyResult<()> {
        let snapshot = belonging::<Snapshot>(snapshot, "a Snapshot")?;
        let restored = self.open()?.restore(&snapshot.get().inner);
        Ok(restored.map_err(BorderError::from)?)
    }

    /// W (n, n), free velocity (n,) and friction (n_c,) of the last step's friction-contact problem.
    fn last_problem<'py>(&self, py: Python<'py>) -> PyResult<Problem<'py>> {
        let held = self.open()?;
        let (W, q, mu) = held.last_problem();
        let (n, size) = (mu.len(), 3 * mu.len());
        let q = if n == 0 { &q[..0] } else { q };
        let W = DMatrix::from_row_slice(size, size, &W[..size * size]);
        Ok((fresh_matrix(py, &W)?, fresh(py, q), fresh(py, mu)))
    }

    #[pyo3(signature = (n = Given::MISSING), text_signature = "($self, n=1000)")]
    fn profile<'py>(&self, py: Python<'py>, n: Given<'_>) -> PyResult<Bound<'py, PyDict>> {
        let steps = n.count(1000, Kind::Option, "n")?;
        let (held, mut watch) = (self.open()?, Watch::new());
        let inner = &*held;
        let stopwatch = py.detach(|| inner.profile(steps, &mut || watch.go_on()));
        let stopwatch = watch.result(stopwatch)?;
        let parts = PyDict::new(py);
        for (phase, microseconds) in stopwatch.microseconds() {
            parts.set_item(snake_case(&format!("{phase:?}")), microseconds)?;
        }
        Ok(parts)
    }

    fn __repr__(&self) -> String {
        let (name, nv) = (&self.model.description().name, self.model.nv());
        match self.open() {
            Ok(inner) => format!("Simulation({name:?}, nv={nv}, time={})", inner.state().time),
            Err(_) => format!("Simulation({name:?}, nv={nv}, stepping)"),
        }
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyTuple>> {
        let py = slf.py();
        let own = slf.get();
        let rebuild = slf.get_type().getattr("_rebuild")?;
        let arguments = (
            own.model(),
            own.terrain(py)?,
            own.settings(py)?,
            own.snapshot()?,
        );
        (rebuild, arguments).into_pyobject(py)
    }

    #[staticmethod]
    fn _rebuild<'py>(
        py: Python<'py>,
        model: &Bound<'py, PyAny>,
        terrain: &Bound<'py, PyAny>,
        settings: &Bound<'py, PyDict>,
        snapshot: &Bound<'py, PyAny>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let made = py
            .get_type::<Self>()
            .call((model, terrain), Some(settings))?;
        made.cast::<Self>()?.get().restore(snapshot)?;
        Ok(made)
    }
}

fn snake_case(camel: &str) -> String {
    let mut out = String::new();
    for c in camel.chars() {
        if c.is_uppercase() && !out.is_empty() {
            out.push('_');
        }
        out.extend(c.to_lowercase());
    }
    out
}
