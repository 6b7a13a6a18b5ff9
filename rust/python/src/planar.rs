//! `PlanarSimulation` and its two kinds, `BallSimulation` and `TwoWheelRoverSimulation`.

use numpy::{PyArray1, PyArray2};
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict, PyTuple};
use rover_core::integrator::{StepError, StepOptions, StepReport as CoreReport};
use rover_core::multibody::{Energy as CoreEnergy, Model, StateError};
use rover_core::nalgebra::{DMatrix, Vector2};
use rover_core::planar::{
    Ball, ContactRule, Ground, MirroredRover, PlanarActiveContact, PlanarMachine,
    PlanarSimulation as Core, PlanarSnapshot as CoreSnapshot, PlanarWheel, TwoWheelRover,
};
use rover_core::simulation::{CommandError, SnapshotError};
use std::sync::{Arc, MutexGuard};

use crate::arguments::{Given, count, flag, number, text};
use crate::arrays::{fresh, fresh_matrix, fresh_rows, vector};
use crate::errors::{BorderError, Kind, Value};
use crate::friction_contact::{SIMULATION_SOLVERS, solver_options};
use crate::model::RoverModel;
use crate::planar_ground::{border, parse};
use crate::shared::{Shared, Watch};
use crate::simulation::{Energy, Problem, STABILISATIONS, StepReport, VARIANTS, choice, name_of};
use crate::snapshot::{belonging, damaged, read};

const RULES: [(&str, ContactRule); 2] = [
    ("nearest", ContactRule::Nearest),
    ("centre_height", ContactRule::CentreHeight),
];

/// What the border needs of a simulation, whatever its machine.
trait Run: Send + Sync {
    fn q(&self) -> &[f64];
    fn v(&self) -> &[f64];
    fn time(&self) -> f64;
    fn options(&self) -> &StepOptions;
    fn rule(&self) -> ContactRule;
    fn inputs(&self) -> &[f64];
    fn contacts(&self) -> &[PlanarActiveContact];
    fn centres(&self) -> Vec<[f64; 2]>;
    fn gaps(&self) -> Vec<f64>;
    fn energy(&self) -> CoreEnergy;
    fn mass_matrix(&self) -> DMatrix<f64>;
    fn last_problem(&self) -> (&[f64], &[f64], &[f64]);
    fn set_state(&mut self, q: &[f64], v: &[f64]) -> Result<(), StateError>;
    fn set_inputs(&mut self, inputs: &[f64]) -> Result<(), CommandError>;
    fn step_while(
        &mut self,
        n: usize,
        go_on: &mut dyn FnMut() -> bool,
    ) -> Result<CoreReport, StepError>;
    fn snapshot(&self) -> CoreSnapshot;
    fn restore(&mut self, snapshot: &CoreSnapshot) -> Result<(), SnapshotError>;
}

impl<const NV: usize, M: PlanarMachine<NV>> Run for Core<NV, M> {
    fn q(&self) -> &[f64] {
        self.q().as_slice()
    }
    fn v(&self) -> &[f64] {
        self.v().as_slice()
    }
    fn time(&self) -> f64 {
        self.time()
    }
    fn options(&self) -> &StepOptions {
        self.options()
    }
    fn rule(&self) -> ContactRule {
        self.rule()
    }
    fn inputs(&self) -> &[f64] {
        self.inputs()
    }
    fn contacts(&self) -> &[PlanarActiveContact] {
        self.contacts()
    }
    fn centres(&self) -> Vec<[f64; 2]> {
        let machine = self.machine();
        let centre = |i| machine.disc(i, self.q()).centre.into();
        (0..machine.n_discs()).map(centre).collect()
    }
    fn gaps(&self) -> Vec<f64> {
        self.gaps()
    }
    fn energy(&self) -> CoreEnergy {
        self.energy()
    }
    fn mass_matrix(&self) -> DMatrix<f64> {
        let M = self.mass_matrix();
        DMatrix::from_column_slice(NV, NV, M.as_slice())
    }
    fn last_problem(&self) -> (&[f64], &[f64], &[f64]) {
        self.last_problem()
    }
    fn set_state(&mut self, q: &[f64], v: &[f64]) -> Result<(), StateError> {
        self.set_state(q, v)
    }
    fn set_inputs(&mut self, inputs: &[f64]) -> Result<(), CommandError> {
        self.set_inputs(inputs)
    }
    fn step_while(
        &mut self,
        n: usize,
        go_on: &mut dyn FnMut() -> bool,
    ) -> Result<CoreReport, StepError> {
        self.step_while(n, go_on)
    }
    fn snapshot(&self) -> CoreSnapshot {
        self.snapshot()
    }
    fn restore(&mut self, snapshot: &CoreSnapshot) -> Result<(), SnapshotError> {
        self.restore(snapshot)
    }
}

/// Everything that a planar simulation needs to continue bit for bit. Picklable.
#[pyclass(module = "rover_gym.mechanics", frozen)]
pub struct PlanarSnapshot {
    inner: CoreSnapshot,
}

#[pymethods]
impl PlanarSnapshot {
    /// Reads a snapshot.
    ///
    /// Args:
    ///     data: What `to_bytes` returned.
    ///
    /// Returns:
    ///     The snapshot.
    ///
    /// Raises:
    ///     StateError: The bytes are not those of a snapshot.
    #[staticmethod]
    fn from_bytes(data: &Bound<'_, PyAny>) -> PyResult<Self> {
        Ok(Self { inner: read(data)? })
    }

    /// The snapshot as bytes, as `from_bytes` reads them.
    fn to_bytes<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyBytes>> {
        let bytes = postcard::to_stdvec(&self.inner).map_err(|e| damaged(&e))?;
        Ok(PyBytes::new(py, &bytes))
    }

    fn __eq__(&self, other: &Bound<'_, PyAny>) -> bool {
        other
            .cast::<Self>()
            .is_ok_and(|o| o.get().inner == self.inner)
    }

    fn __hash__(&self) -> PyResult<u64> {
        use std::hash::{DefaultHasher, Hasher};
        let mut hasher = DefaultHasher::new();
        hasher.write(&postcard::to_stdvec(&self.inner).map_err(|e| damaged(&e))?);
        Ok(hasher.finish())
    }

    fn __reduce__<'py>(
        slf: &Bound<'py, Self>,
    ) -> PyResult<(Bound<'py, PyAny>, (Bound<'py, PyBytes>,))> {
        let bytes = slf.get().to_bytes(slf.py())?;
        Ok((slf.get_type().getattr("from_bytes")?, (bytes,)))
    }
}

/// The contacts of a planar simulation's last step, as new arrays with one row a contact.
#[pyclass(module = "rover_gym.mechanics", frozen)]
pub struct PlanarContacts {
    active: Vec<PlanarActiveContact>,
}

impl PlanarContacts {
    fn rows<'py>(
        &self,
        py: Python<'py>,
        f: impl Fn(&PlanarActiveContact) -> [f64; 2],
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        fresh_rows(py, &self.active.iter().map(f).collect::<Vec<_>>())
    }
}

#[pymethods]
impl PlanarContacts {
    /// Indices of the discs that touch, (n,); 0 is the ball or wheel A, 1 wheel B.
    #[getter]
    fn discs<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<i64>> {
        PyArray1::from_iter(
            py,
            self.active.iter().map(|a| i64::from(a.contact.key.disc)),
        )
    }

    /// Points of the ground, world frame, (n, 2), m.
    #[getter]
    fn points<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        self.rows(py, |a| a.contact.foot.into())
    }

    /// Unit normals out of the ground, (n, 2); the tangent is (n_y, -n_x).
    #[getter]
    fn normals<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        self.rows(py, |a| a.contact.n.into())
    }

    /// Gaps, (n,), m.
    #[getter]
    fn gaps<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_iter(py, self.active.iter().map(|a| a.contact.gap))
    }

    /// Impulses of the step along normal and tangent, (n, 2), N s.
    #[getter]
    fn impulses<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        self.rows(py, |a| a.impulse)
    }

    /// Velocities of the rim after the step along normal and tangent, (n, 2), m/s.
    #[getter]
    fn velocities<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        self.rows(py, |a| a.velocity)
    }

    fn __len__(&self) -> usize {
        self.active.len()
    }

    fn __repr__(&self) -> String {
        format!("PlanarContacts({})", self.active.len())
    }
}

/// A planar machine on a ground: what the machines share. Made by the classes derived from it.
///
/// One call at a time: a call during another one, from another thread or a signal handler, raises
/// BusyError.
#[pyclass(module = "rover_gym.mechanics", subclass, frozen)]
pub struct PlanarSimulation {
    inner: Shared<Box<dyn Run>>,
    ground: Py<PyAny>,
    parameters: Py<PyDict>,
    solver: String,
    max_iterations: usize,
}

/// The keyword arguments of a step, checked.
struct Options {
    step: StepOptions,
    rule: ContactRule,
    solver: String,
    max_iterations: usize,
}

/// Reads the options that both kinds of simulation take.
fn options(given: Option<&Bound<'_, PyDict>>) -> PyResult<Options> {
    let mut step = StepOptions::default();
    let mut rule = ContactRule::Nearest;
    let (mut solver, mut tolerance, mut max_iterations) = ("auto".to_owned(), 1e-12, 1000_usize);
    for (key, value) in given.into_iter().flatten() {
        let key: String = key.extract()?;
        let field = key.as_str();
        let number = || number(&value, Kind::Option, field);
        let text = || text(&value, Kind::Option, field);
        match field {
            "gravity" => step.gravity = pair(&value, Kind::Option, field)?.push(0.0),
            "friction" => step.friction_coefficient = number()?,
            "restitution" => step.restitution = number()?,
            "time_step" => step.time_step = number()?,
            "variant" => step.variant = choice(field, &text()?, &VARIANTS)?,
            "theta" => step.theta = number()?,
            "forecast" => step.forecast = number()?,
            "stabilisation" => step.stabilisation = choice(field, &text()?, &STABILISATIONS)?,
            "warm_start" => step.warm_start = flag(&value, Kind::Option, field)?,
            "contact" => rule = choice(field, &text()?, &RULES)?,
            "solver" => solver = text()?,
            "tolerance" => tolerance = number()?,
            "max_iterations" => max_iterations = count(&value, Kind::Option, field)?,
            _ => {
                let message = format!("{key}: is no option of a planar simulation");
                return Err(pyo3::exceptions::PyTypeError::new_err(message));
            }
        }
    }
    step.solver = solver_options(&solver, tolerance, max_iterations, &SIMULATION_SOLVERS)?;
    Ok(Options {
        step,
        rule,
        solver,
        max_iterations,
    })
}

/// Two numbers.
pub fn pair(value: &Bound<'_, PyAny>, kind: Kind, field: &str) -> PyResult<Vector2<f64>> {
    let values = vector(value, kind, field)?;
    match values[..] {
        [x, y] => Ok(Vector2::new(x, y)),
        _ => Err(BorderError {
            kind,
            message: format!("{field}: needs 2 entries, has {}", values.len()),
            field: Some(field.to_owned()),
            value: Value::Count(values.len()),
        }
        .into()),
    }
}

impl PlanarSimulation {
    fn open(&self) -> Result<MutexGuard<'_, Box<dyn Run>>, BorderError> {
        self.inner.open()
    }

    fn build<const NV: usize, M: PlanarMachine<NV> + 'static>(
        machine: M,
        ground: &Bound<'_, PyAny>,
        parameters: Bound<'_, PyDict>,
        given: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<Self> {
        let terrain: Arc<dyn Ground> = parse(ground)?;
        let options = options(given)?;
        let inner =
            Core::new(machine, terrain, options.rule, options.step).map_err(BorderError::from)?;
        Ok(Self {
            inner: Shared::new(Box::new(inner)),
            ground: ground.clone().unbind(),
            parameters: parameters.unbind(),
            solver: options.solver,
            max_iterations: options.max_iterations,
        })
    }
}

#[pymethods]
impl PlanarSimulation {
    /// The ground.
    #[getter]
    fn ground(&self, py: Python<'_>) -> Py<PyAny> {
        self.ground.clone_ref(py)
    }

    /// Time since the last call of `set_state`, s.
    #[getter]
    fn time(&self) -> PyResult<f64> {
        let inner = self.open()?;
        Ok(inner.time())
    }

    /// Time step, s.
    #[getter]
    fn time_step(&self) -> PyResult<f64> {
        let inner = self.open()?;
        Ok(inner.options().time_step)
    }

    /// Coordinates, (nv,), x and y, m, then angles, rad, which turn to the left.
    #[getter]
    fn q<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let inner = self.open()?;
        Ok(fresh(py, inner.q()))
    }

    /// Rates of the coordinates, (nv,), m/s and rad/s.
    #[getter]
    fn v<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let inner = self.open()?;
        Ok(fresh(py, inner.v()))
    }

    /// Centres of the discs, world frame, (n_discs, 2), m.
    #[getter]
    fn centres<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let inner = self.open()?;
        fresh_rows(py, &inner.centres())
    }

    /// Gap of each disc now, (n_discs,), m; negative where it overlaps the ground.
    #[getter]
    fn gaps<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let inner = self.open()?;
        Ok(fresh(py, &inner.gaps()))
    }

    /// Commanded torques, (n_discs,), N m, positive forward.
    #[getter]
    fn torques<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let inner = self.open()?;
        Ok(fresh(py, inner.inputs()))
    }

    /// The keyword arguments that describe the machine.
    #[getter]
    fn parameters<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        self.parameters.bind(py).copy()
    }

    /// The keyword arguments that make a simulation with the same options.
    #[getter]
    fn settings<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let inner = self.open()?;
        let o = inner.options();
        let settings = PyDict::new(py);
        settings.set_item("gravity", (o.gravity.x, o.gravity.y))?;
        settings.set_item("friction", o.friction_coefficient)?;
        settings.set_item("restitution", o.restitution)?;
        settings.set_item("time_step", o.time_step)?;
        settings.set_item("variant", name_of(o.variant, &VARIANTS))?;
        settings.set_item("theta", o.theta)?;
        settings.set_item("forecast", o.forecast)?;
        settings.set_item("solver", &self.solver)?;
        settings.set_item("tolerance", o.solver.tolerance)?;
        settings.set_item("max_iterations", self.max_iterations)?;
        settings.set_item("stabilisation", name_of(o.stabilisation, &STABILISATIONS))?;
        settings.set_item("warm_start", o.warm_start)?;
        settings.set_item("contact", name_of(inner.rule(), &RULES))?;
        Ok(settings)
    }

    /// Sets coordinates and rates; torques stay.
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
    fn set_state(&self, q: &Bound<'_, PyAny>, v: Option<&Bound<'_, PyAny>>) -> PyResult<()> {
        let mut inner = self.open()?;
        let q = vector(q, Kind::State, "q")?;
        let rest = || Ok(vec![0.0; inner.v().len()]);
        let v = v.map_or_else(rest, |v| vector(v, Kind::State, "v"))?;
        Ok(inner.set_state(&q, &v).map_err(BorderError::from)?)
    }

    /// Sets the driving torques; each saturates at its limit, where the machine has one.
    ///
    /// Args:
    ///     torques: Torques between the body and each disc, (n_discs,), N m, positive forward.
    ///
    /// Raises:
    ///     CommandError: A wrong length, or an entry that is not finite. Nothing has changed.
    fn set_torques(&self, torques: &Bound<'_, PyAny>) -> PyResult<()> {
        let mut inner = self.open()?;
        let torques = vector(torques, Kind::Command, "torques")?;
        Ok(inner.set_inputs(&torques).map_err(BorderError::from)?)
    }

    /// Takes n steps, as `Simulation.step` does.
    ///
    /// Args:
    ///     n: Number of steps.
    ///
    /// Returns:
    ///     How the steps went.
    ///
    /// Raises:
    ///     StepError: A step could not be taken; the state before it stays.
    ///     OptionError: `n` is not a count.
    #[pyo3(signature = (n = Given::MISSING), text_signature = "($self, n=1)")]
    fn step(&self, py: Python<'_>, n: Given<'_>) -> PyResult<StepReport> {
        let steps = n.count(1, Kind::Option, "n")?;
        let mut held = self.open()?;
        let (inner, mut watch) = (&mut *held, Watch::new());
        let report = py.detach(|| inner.step_while(steps, &mut || watch.go_on()));
        Ok(watch.result(report)?.into())
    }

    /// The contacts of the last step.
    #[getter]
    fn contacts(&self) -> PyResult<PlanarContacts> {
        let inner = self.open()?;
        Ok(PlanarContacts {
            active: inner.contacts().to_vec(),
        })
    }

    /// Kinetic and potential energy now.
    fn energy(&self) -> PyResult<Energy> {
        let inner = self.open()?;
        Ok(inner.energy().into())
    }

    /// Mass matrix now, (nv, nv), in kg, kg m and kg m².
    fn mass_matrix<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let inner = self.open()?;
        fresh_matrix(py, &inner.mass_matrix())
    }

    /// The friction-contact problem of the last step.
    ///
    /// Returns:
    ///     Delassus operator W, (2 n_c, 2 n_c), 1/kg; free velocity, (2 n_c,), m/s; friction
    ///     coefficients, (n_c,).
    fn last_problem<'py>(&self, py: Python<'py>) -> PyResult<Problem<'py>> {
        let inner = self.open()?;
        let (W, q, mu) = inner.last_problem();
        let size = 2 * mu.len();
        let q = if size == 0 { &q[..0] } else { q };
        let W = DMatrix::from_row_slice(size, size, &W[..size * size]);
        Ok((fresh_matrix(py, &W)?, fresh(py, q), fresh(py, mu)))
    }

    /// Everything that is needed to continue bit for bit.
    fn snapshot(&self) -> PyResult<PlanarSnapshot> {
        let inner = self.open()?;
        Ok(PlanarSnapshot {
            inner: inner.snapshot(),
        })
    }

    /// Goes back to a snapshot.
    ///
    /// Args:
    ///     snapshot: A snapshot of a simulation of the same machine.
    ///
    /// Raises:
    ///     StateError: The snapshot belongs to another machine or is damaged. Nothing has changed.
    fn restore(&self, snapshot: &Bound<'_, PyAny>) -> PyResult<()> {
        let mut inner = self.open()?;
        let snapshot = belonging::<PlanarSnapshot>(snapshot, "a PlanarSnapshot")?;
        let restored = inner.restore(&snapshot.get().inner);
        Ok(restored.map_err(BorderError::from)?)
    }

    fn __repr__(slf: &Bound<'_, Self>) -> PyResult<String> {
        let own = slf.get();
        let (kind, ground) = (slf.get_type().name()?, own.ground.bind(slf.py()).repr()?);
        Ok(match own.time() {
            Ok(time) => format!("{kind}({ground}, time={time})"),
            Err(_) => format!("{kind}({ground}, stepping)"),
        })
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyTuple>> {
        let py = slf.py();
        let own = slf.get();
        let settings = own.settings(py)?;
        settings.update(own.parameters.bind(py).as_mapping())?;
        let rebuild = slf.get_type().getattr("_rebuild")?;
        let arguments = (slf.get_type(), own.ground(py), settings, own.snapshot()?);
        (rebuild, arguments).into_pyobject(py)
    }

    #[staticmethod]
    fn _rebuild<'py>(
        kind: &Bound<'py, PyAny>,
        ground: &Bound<'py, PyAny>,
        settings: &Bound<'py, PyDict>,
        snapshot: &Bound<'py, PyAny>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let made = kind.call((ground,), Some(settings))?;
        made.cast::<Self>()?.get().restore(snapshot)?;
        Ok(made)
    }
}

/// A disc on a ground: coordinates x, y of its centre, m, and its angle theta, rad.
///
/// Args:
///     ground: A `Line`, `Sine`, `Spline` or `Polyline`.
///     mass: Mass, kg.
///     radius: Radius, m.
///     inertia: Inertia about the centre, kg m²; that of a homogeneous disc by default.
///     **options: Options as of `Simulation`, from `gravity`, here (2,), to `warm_start`, and
///         `contact`: "nearest", the disc touches where the ground is nearest to its centre, or
///         "centre_height", the 2010 report's rule, by which the centre itself stops at the ground.
///
/// Raises:
///     ModelError: `mass`, `radius` or `inertia` is not finite and positive.
///     TerrainError: `ground` is not a ground.
///     OptionError: An option is out of its range.
///     TypeError: An option is unknown.
#[pyclass(module = "rover_gym.mechanics", extends = PlanarSimulation, frozen)]
pub struct BallSimulation;

#[pymethods]
impl BallSimulation {
    #[new]
    #[pyo3(signature = (ground, *, mass = Given::MISSING, radius = Given::MISSING, inertia = Given::MISSING, **options),
        text_signature = "(ground, *, mass=3.0, radius=1.5, inertia=None, **options)")]
    fn new(
        ground: &Bound<'_, PyAny>,
        mass: Given<'_>,
        radius: Given<'_>,
        inertia: Given<'_>,
        options: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<PyClassInitializer<Self>> {
        let mass = mass.number(3.0, Kind::Model, "mass")?;
        let radius = radius.number(1.5, Kind::Model, "radius")?;
        let inertia = inertia.maybe(Kind::Model, "inertia")?;
        let inertia = inertia.unwrap_or(0.5 * mass * radius * radius);
        let ball = Ball::new(mass, radius, inertia).map_err(|e| border(Kind::Model, &e))?;
        let parameters = PyDict::new(ground.py());
        parameters.set_item("mass", mass)?;
        parameters.set_item("radius", radius)?;
        parameters.set_item("inertia", inertia)?;
        let base = PlanarSimulation::build(ball, ground, parameters, options)?;
        Ok(PyClassInitializer::from(base).add_subclass(Self))
    }
}

/// A body on two driven wheels.
///
/// Coordinates are x, y of the body's mass centre, m, theta, theta_A and theta_B, rad. A is the
/// back wheel, B the front wheel. All angles are absolute. The defaults are the rover of the 2010
/// report's granular run.
///
/// Args:
///     ground: A `Line`, `Sine`, `Spline` or `Polyline`.
///     mass: Mass of the body, kg.
///     inertia: Inertia of the body about its mass centre, kg m²; that of a rod from axle to axle
///         by default.
///     wheel_mass: Mass of both wheels or of each, kg; 60 by default.
///     wheel_radius: Radius of both wheels or of each, m; 0.2 by default.
///     wheel_inertia: Inertia of both wheels or of each about the axle, kg m²; that of a
///         homogeneous disc by default.
///     axle_a: Back axle relative to the body's mass centre, body axes, (2,), m; (-0.4, 0) by
///         default.
///     axle_b: Front axle relative to the body's mass centre, body axes, (2,), m; (0.4, 0) by
///         default.
///     **options: Options as of `BallSimulation`.
///
/// Raises:
///     ModelError: A mass, radius or inertia is not finite and positive, or the wheels overlap.
///     TerrainError: `ground` is not a ground.
///     OptionError: An option is out of its range.
///     TypeError: An option is unknown.
#[pyclass(module = "rover_gym.mechanics", extends = PlanarSimulation, frozen)]
pub struct TwoWheelRoverSimulation;

/// One number for both wheels, or one for each.
fn both(value: Option<&Bound<'_, PyAny>>, field: &str, default: [f64; 2]) -> PyResult<[f64; 2]> {
    let Some(value) = value else {
        return Ok(default);
    };
    one_or_two(value, field)
}

/// One number for both, or two.
pub fn one_or_two(value: &Bound<'_, PyAny>, field: &str) -> PyResult<[f64; 2]> {
    if value.len().is_err() {
        return Ok([number(value, Kind::Model, field)?; 2]);
    }
    Ok(pair(value, Kind::Model, field)?.into())
}

#[pymethods]
impl TwoWheelRoverSimulation {
    #[new]
    #[allow(clippy::too_many_arguments)] // keyword arguments of a Python class
    #[pyo3(signature = (ground, *, mass = Given::MISSING, inertia = Given::MISSING, wheel_mass = None, wheel_radius = None,
        wheel_inertia = None, axle_a = None, axle_b = None, **options),
        text_signature = "(ground, *, mass=130.0, inertia=None, wheel_mass=None, wheel_radius=None, wheel_inertia=None, axle_a=None, axle_b=None, **options)")]
    fn new(
        ground: &Bound<'_, PyAny>,
        mass: Given<'_>,
        inertia: Given<'_>,
        wheel_mass: Option<&Bound<'_, PyAny>>,
        wheel_radius: Option<&Bound<'_, PyAny>>,
        wheel_inertia: Option<&Bound<'_, PyAny>>,
        axle_a: Option<&Bound<'_, PyAny>>,
        axle_b: Option<&Bound<'_, PyAny>>,
        options: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<PyClassInitializer<Self>> {
        let mass = mass.number(130.0, Kind::Model, "mass")?;
        let inertia = inertia.maybe(Kind::Model, "inertia")?;
        let masses = both(wheel_mass, "wheel_mass", [60.0; 2])?;
        let radii = both(wheel_radius, "wheel_radius", [0.2; 2])?;
        // Discs, unless told otherwise.
        let of_disc = |i: usize| 0.5 * masses[i] * radii[i] * radii[i];
        let inertias = both(wheel_inertia, "wheel_inertia", [of_disc(0), of_disc(1)])?;
        let axle = |given: Option<&Bound<'_, PyAny>>, field: &str, x: f64| {
            given.map_or(Ok(Vector2::new(x, 0.0)), |a| pair(a, Kind::Model, field))
        };
        let axles = [axle(axle_a, "axle_a", -0.4)?, axle(axle_b, "axle_b", 0.4)?];
        // A rod from axle to axle, unless told otherwise.
        let inertia = inertia.unwrap_or(mass * (axles[1] - axles[0]).norm_squared() / 12.0);
        let wheel = |i: usize| PlanarWheel {
            mass: masses[i],
            radius: radii[i],
            inertia: inertias[i],
            axle: axles[i],
        };
        let rover = TwoWheelRover::new(mass, inertia, wheel(0), wheel(1))
            .map_err(|e| border(Kind::Model, &e))?;
        let parameters = PyDict::new(ground.py());
        parameters.set_item("mass", mass)?;
        parameters.set_item("inertia", inertia)?;
        parameters.set_item("wheel_mass", (masses[0], masses[1]))?;
        parameters.set_item("wheel_radius", (radii[0], radii[1]))?;
        parameters.set_item("wheel_inertia", (inertias[0], inertias[1]))?;
        parameters.set_item("axle_a", (axles[0].x, axles[0].y))?;
        parameters.set_item("axle_b", (axles[1].x, axles[1].y))?;
        let base = PlanarSimulation::build(rover, ground, parameters, options)?;
        Ok(PyClassInitializer::from(base).add_subclass(Self))
    }
}

/// The six-wheel rover driven straight, in its plane of symmetry.
///
/// Coordinates are x, y, m, theta, and the angle of each mirrored pair of joints, rad. Joints that
/// do not turn about z are locked at 0. Only wheels touch the ground. A torque is that of each
/// wheel of a pair.
///
/// Args:
///     ground: A `Line`, `Sine`, `Spline` or `Polyline`.
///     model: The machine, its own mirror image about the trunk's x-y plane; the built-in rover by
///         default.
///     **options: Options as of `BallSimulation`.
///
/// Raises:
///     ModelError: The model is not its own mirror image, or its planar image has not 7
///         coordinates.
///     TerrainError: `ground` is not a ground.
///     OptionError: An option is out of its range.
///     TypeError: An option is unknown.
#[pyclass(module = "rover_gym.mechanics", extends = PlanarSimulation, frozen)]
pub struct MirroredRoverSimulation {
    joints: Vec<Vec<String>>,
    wheels: Vec<Vec<String>>,
}

#[pymethods]
impl MirroredRoverSimulation {
    #[new]
    #[pyo3(signature = (ground, *, model = Given::MISSING, **options), text_signature = "(ground, *, model=None, **options)")]
    fn new(
        ground: &Bound<'_, PyAny>,
        model: Given<'_>,
        options: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<PyClassInitializer<Self>> {
        let model = model.object::<RoverModel>(Kind::Model, "model", "a RoverModel")?;
        let inner = model.map_or_else(|| Arc::new(Model::rover()), |m| m.inner);
        let rover = MirroredRover::<7>::new(&inner).map_err(|e| border(Kind::Model, &e))?;
        let own = Self {
            joints: rover.joints(),
            wheels: rover.wheel_names(),
        };
        let parameters = PyDict::new(ground.py());
        parameters.set_item("model", RoverModel { inner })?;
        let base = PlanarSimulation::build(rover, ground, parameters, options)?;
        Ok(PyClassInitializer::from(base).add_subclass(own))
    }

    /// Names of the joints that share each coordinate from the fourth on.
    #[getter]
    fn joints(&self) -> Vec<Vec<String>> {
        self.joints.clone()
    }

    /// Names of the wheels of each disc.
    #[getter]
    fn wheels(&self) -> Vec<Vec<String>> {
        self.wheels.clone()
    }
}

/// Adds the planar classes to the module.
pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<crate::planar_ground::Line>()?;
    module.add_class::<crate::planar_ground::Sine>()?;
    module.add_class::<crate::planar_ground::Spline>()?;
    module.add_class::<crate::planar_ground::Polyline>()?;
    module.add_class::<PlanarSnapshot>()?;
    module.add_class::<PlanarContacts>()?;
    module.add_class::<PlanarSimulation>()?;
    module.add_class::<BallSimulation>()?;
    module.add_class::<TwoWheelRoverSimulation>()?;
    module.add_class::<MirroredRoverSimulation>()?;
    Ok(())
}
