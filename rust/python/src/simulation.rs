//! `Simulation`: one rover on one terrain.

use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple};
use rover_core::contact::Part;
use rover_core::contact::loops::check_closed;
use rover_core::geometry::Plane;
use rover_core::integrator::StepOptions;
use rover_core::multibody::{Model, coordinates};
use rover_core::nalgebra::DMatrix;
use rover_core::simulation::{
    ReadingLayout, ReadingRequest, ReadingScratch, RoverSimulation as CoreSimulation, Shown,
    TrajectoryBatch, state_size, with_sand,
};
use rover_task::draw::DrawnGround;
use std::sync::{Arc, MutexGuard};

use crate::accuracy;
use crate::arguments::{self, Given, Named, number, text, texts};
use crate::arrays::{
    Array, at_most, finite_shaped, fresh, fresh_matrix, fresh_rows, triple, vector,
};
use crate::contacts::Contacts;
use crate::errors::{BorderError, Kind, Result, Value};
use crate::linearisation::{Linearisation, StepDerivatives, named_parameters, of_trajectory};
use crate::model::{Coordinates, Pair, RoverModel, checked_gravity, poses, tags};
use crate::options::{self, Options, step_options};
use crate::picture::{self, Picture, PictureLook, pixels, shot};
use crate::rays::{Met, met, rays};
use crate::reading::{place, scan_points, slices};
use crate::sand::sand_to_dict;
use crate::shared::{Open, Release, Shared, Watch};
use crate::sphere_field::SphereField;
use crate::stepping::{AnySimulation, Problem, problem};
use crate::{terrain, union};

/// A rover on a terrain, stepped through time.
///
/// It starts at rest with all coordinates 0. The steering joints are held at 0; all other joints
/// are free.
///
/// Args:
///     model: The machine, a name of the gallery, or a file; the built-in rover by default.
///     terrain: A terrain, the file of a map or a mesh, or a list of several; flat ground at height
///         0 by default.
///     gravity: Gravity, world frame, (3,), m/s²; (0, -9.81, 0) by default.
///     accuracy: Chooses `time_step`, `variant` and `tolerance` by `accuracy_options`: "fast",
///         "balanced", "reference", or the allowed error on a path of 20 m on flat ground, m. These
///         three options cannot be given beside it.
#[doc = step_options!(documented)]
/// Raises:
///     ModelError: `model` is none of these, or its file does not contain a model.
///     TerrainError: `terrain` is none of these, or its file is damaged.
///     OSError: A file cannot be read.
///     OptionError: An option is out of range, or must not be given beside `accuracy`.
#[pyclass(module = "rover_gym.core", extends = AnySimulation, frozen)]
pub struct Simulation {
    pub inner: Arc<Shared<CoreSimulation>>,
    model: Arc<Model>,
    options: StepOptions,
    ground: DrawnGround,
}

fn names(joints: &Bound<'_, PyAny>) -> Result<Vec<String>> {
    texts(joints, Kind::Command, "joints")
}

impl Simulation {
    /// A simulation and its ground.
    pub fn of(inner: CoreSimulation, ground: DrawnGround) -> PyClassInitializer<Self> {
        let parts = (inner.model().clone(), inner.options().clone());
        Self::with(Arc::new(Shared::new(inner)), parts, ground)
    }

    fn with(
        inner: Arc<Shared<CoreSimulation>>,
        (model, options): (Arc<Model>, StepOptions),
        ground: DrawnGround,
    ) -> PyClassInitializer<Self> {
        AnySimulation::base(inner.clone()).add_subclass(Self {
            inner,
            model,
            options,
            ground,
        })
    }

    /// A simulation that others hold, too.
    pub fn shared(
        inner: Arc<Shared<CoreSimulation>>,
        ground: DrawnGround,
    ) -> Result<PyClassInitializer<Self>> {
        let open = inner.open()?;
        let parts = (open.model().clone(), open.options().clone());
        drop(open);
        Ok(Self::with(inner, parts, ground))
    }

    /// The simulation, for one call.
    pub fn open(&self) -> Result<MutexGuard<'_, CoreSimulation>, BorderError> {
        self.inner.open()
    }

    /// Names of the model's solids, as given.
    fn solids(&self, without: Option<&Bound<'_, PyAny>>) -> Result<Vec<String>> {
        let named = without.map(|given| texts(given, Kind::Option, "without"));
        let named = named.transpose()?.unwrap_or_default();
        let frames = self.model.frames();
        let is_unknown = |name: &&String| !frames.iter().any(|frame| frame.name == **name);
        if let Some(name) = named.iter().find(is_unknown) {
            let message = format!("without: the model has no solid {name:?}");
            return Err(Kind::Option.error("without", message, Value::Text(name.clone())));
        }
        Ok(named)
    }

    /// The ground as it was given, of which the core keeps less.
    pub fn ground(&self) -> &DrawnGround {
        &self.ground
    }

    /// Commands, one for each wheel.
    fn commands(&self, value: &Bound<'_, PyAny>, field: &str) -> Result<Vec<f64>> {
        at_most(value, self.model.wheels().len(), Kind::Command, field)
    }
}

#[pymethods]
impl Simulation {
    #[new]
    #[pyo3(signature = (model = Given::MISSING, terrain = None, **options),
        text_signature = "(model=None, terrain=None, *, gravity=None, accuracy=None, **options)")]
    fn new(
        py: Python<'_>,
        model: Given<'_>,
        terrain: Option<&Bound<'_, PyAny>>,
        options: Option<&Bound<'_, PyDict>>,
    ) -> Result<PyClassInitializer<Self>> {
        let given = Named::keywords(py, options)?;
        let model = match model.some() {
            None => Arc::new(Model::gallery_rover()),
            Some(given) => RoverModel::opened(&given, "model")?.inner,
        };
        let terrain = match terrain {
            None => DrawnGround::Plane(Plane::ground()),
            Some(given) => terrain::parse(given)?,
        };
        let chosen = accuracy::chosen(&given)?;
        let mut step = StepOptions::usual();
        step.gravity = checked_gravity(given.some("gravity")?.as_ref())?;
        (step.time_step, step.variant) = (chosen.time_step, chosen.variant);
        step.solver.tolerance = chosen.tolerance;
        let options = options::read_step(step, &given)?;
        given.finish()?;
        let inner = CoreSimulation::new(model, terrain.terrain(), options)?;
        Ok(Self::of(inner, terrain))
    }

    /// The machine.
    #[getter]
    fn model(&self) -> RoverModel {
        self.model.clone().into()
    }

    /// The ground.
    #[getter]
    fn terrain<'py>(&self, py: Python<'py>) -> Result<Bound<'py, PyAny>> {
        union::object(py, &self.ground)
    }

    /// Forces, sinkage and ruts of the wheels on sand; None on rigid ground.
    ///
    /// Returns:
    ///     Arrays by name. `force` (N) and `moment` about the wheel's centre (N m) of the sand on
    ///     each wheel in the last step, (n_wheels, 3), world frame; `sinkage` of each wheel's
    ///     lowest point below the undisturbed surface, (n_wheels,), m, negative above it;
    ///     `absorbed`, energy that the sand has dissipated under each wheel, (n_wheels,), J;
    ///     `slip`, rim slip of each wheel relative to the faster of rim and ground speed,
    ///     (n_wheels,), 0 without contact; `ruts`, x, z and depth of each cell that a wheel has
    ///     compacted, (n, 3), m.
    ///
    /// Raises:
    ///     BusyError: Another thread is stepping this simulation.
    fn sand<'py>(&self, py: Python<'py>) -> Result<Option<Bound<'py, PyDict>>> {
        let open = self.open()?;
        let Some(sand) = open.sand() else {
            return Ok(None);
        };
        let cell = open.terrain().soft().map_or(1.0, |soft| soft.cell);
        let mut slip = vec![0.0; sand.wheels.len()];
        for contact in open.wheels_in_sand() {
            slip[contact.wheel] = contact.slip;
        }
        Ok(Some(sand_to_dict(py, sand, &slip, cell)?))
    }

    /// Gravity, world frame, (3,), m/s².
    #[getter]
    fn gravity(&self) -> Array {
        fresh(self.options.gravity.as_slice())
    }

    /// Coulomb's coefficient of every contact whose pair is not in `materials`.
    #[getter]
    fn friction(&self) -> f64 {
        self.options.friction_coefficient
    }

    /// Newton's coefficient of every contact whose pair is not in `materials`.
    #[getter]
    fn restitution(&self) -> f64 {
        self.options.restitution
    }

    /// Friction and restitution by pair of materials.
    #[getter]
    fn materials<'py>(&self, py: Python<'py>) -> Result<Bound<'py, PyDict>> {
        let laws = PyDict::new(py);
        for pair in self.options.materials.pairs() {
            let [first, second] = &pair.materials;
            let law = (pair.friction_coefficient, pair.restitution);
            laws.set_item((first, second), law)?;
        }
        Ok(laws)
    }

    /// Keyword arguments for a simulation with the same options.
    #[getter]
    fn settings<'py>(&self, py: Python<'py>) -> Result<Bound<'py, PyDict>> {
        let gravity = &self.options.gravity;
        let gravity = (gravity.x, gravity.y, gravity.z).into_pyobject(py)?;
        options::settings(&gravity, self.options.clone())
    }

    /// Number of rovers that a batch steps together in one SIMD register of this computer.
    ///
    /// Either 8, 4 or 1; always 1 for the variant "newton". `StepReport.fallbacks` counts steps
    /// that take more than the usual effort.
    #[getter]
    fn lanes(&self) -> Result<usize> {
        Ok(self.open()?.lanes())
    }

    /// Coordinates, (nq,), m and rad.
    ///
    /// x, y, z of the trunk's origin; roll, heading, pitch; joints.
    #[getter]
    fn q(&self) -> Result<Array> {
        let held = self.open()?;
        Ok(coordinates::to_public(&self.model, &held.state().configuration).into())
    }

    /// Velocities, (nv,), m/s and rad/s.
    ///
    /// Velocity of the trunk, world frame; its angular velocity, world frame; joint rates.
    #[getter]
    fn v(&self) -> Result<Array> {
        Ok(fresh(&self.open()?.state().v))
    }

    /// Rotation matrix R_WB, (3, 3), from the trunk's frame to the world frame.
    #[getter]
    fn rotation(&self) -> Result<Array> {
        let held = self.open()?;
        let R = held.state().configuration.attitude.to_rotation_matrix();
        let R = DMatrix::from_iterator(3, 3, R.matrix().iter().copied());
        Ok(fresh_matrix(&R))
    }

    /// Sets coordinates and velocities.
    ///
    /// Time starts at 0, and the next step has no warm start.
    ///
    /// Args:
    ///     q: Coordinates, (nq,).
    ///     qdot: Velocity in the same coordinates, (nv,); at rest by default.
    ///     coordinates: "state", as `q` and `v` return them, or "report".
    ///
    /// The velocity loses the part that would open a closed loop, as in an impact.
    ///
    /// Raises:
    ///     StateError: An array has a wrong length or an entry that is not finite, or a closed loop
    ///         is open by more than 1e-6 m or rad; `RoverModel.close_loops` closes it. Nothing has
    ///         changed.
    ///     OptionError: `coordinates` is neither of the two.
    #[pyo3(signature = (q, qdot = None, *, coordinates = Coordinates::STATE), text_signature = "($self, q, qdot=None, *, coordinates='state')")]
    fn set_state(
        &self,
        q: &Bound<'_, PyAny>,
        qdot: Option<&Bound<'_, PyAny>>,
        coordinates: Coordinates,
    ) -> Result<()> {
        let chart = coordinates.chart();
        let q = vector(q, Kind::State, "q")?;
        let configuration = chart.configuration(&self.model, &q)?;
        check_closed(&self.model, &configuration)?;
        let rest = || Ok(vec![0.0; self.model.nv()]);
        let qdot = qdot.map_or_else(rest, |v| vector(v, Kind::State, "qdot"))?;
        let v = chart.velocity(&self.model, &q, &qdot)?;
        self.open()?.set_state(configuration, v);
        Ok(())
    }

    /// The state in the coordinates of the 2010 report.
    ///
    /// Returns:
    ///     The report's q, (nq,), and its rate, (nv,).
    ///
    /// Raises:
    ///     StateError: The heading is ±90 degrees, where these coordinates are singular.
    fn report_state(&self) -> Result<Pair> {
        let held = self.open()?;
        let state = held.state();
        let (q, qdot) = coordinates::to_report(&self.model, &state.configuration, &state.v)?;
        Ok((q.into(), qdot.into()))
    }

    /// Commanded torques, limited by the model, (n_wheels,), N m, positive forward; 0 under servos.
    #[getter]
    fn wheel_torques(&self) -> Result<Array> {
        Ok(fresh(self.open()?.wheel_torques()))
    }

    /// Mean torques of the drives over the last step, (n_wheels,), N m, positive forward.
    ///
    /// Each is the command after the limit of the wheel's `Motor`, or the torque of its servo; 0
    /// before the first step. Wheels that share a drive have equal parts of its torque.
    #[getter]
    fn motor_torques(&self) -> Result<Array> {
        Ok(fresh(self.open()?.motor_torques()))
    }

    /// Mean reactions of the closed loops over the last step, by name.
    ///
    /// Of a connection the force on its first solid, (3,), N, in world axes; of a weld the force
    /// and the moment about the common point, (6,), N and N m; of a joint its force or torque,
    /// (1,). The second solid feels the opposite. Reactions of redundant equations count as 0.
    #[getter]
    fn loop_forces<'py>(&self, py: Python<'py>) -> Result<Bound<'py, PyDict>> {
        let forces = self.open()?.loop_forces();
        crate::loops::forces(py, &self.model, &forces)
    }

    /// Sets the driving torques; each saturates at its wheel's limit.
    ///
    /// Args:
    ///     torques: Torques, (n_wheels,), N m, positive forward.
    ///
    /// Raises:
    ///     CommandError: A wrong length, or an entry that is not finite. Nothing has changed.
    fn set_wheel_torques(&self, torques: &Bound<'_, PyAny>) -> Result<()> {
        let torques = self.commands(torques, "torques")?;
        Ok(self.open()?.set_wheel_torques(&torques)?)
    }

    /// Speeds that the wheels' servos hold, (n_wheels,), rad/s, positive forward.
    ///
    /// None while the wheels are driven by torques.
    #[getter]
    fn wheel_speeds(&self) -> Result<Option<Array>> {
        Ok(self.open()?.wheel_speeds().map(fresh))
    }

    /// Holds the wheels at speeds by servos, until torques, other speeds or `brake` replace them.
    ///
    /// The torque of a wheel is `RoverModel.wheel_speed_gains` times the missing speed, within the
    /// wheel's torque limit and its motor's line. It is implicit in the step and stable at any gain
    /// and step. A motor is asked for its no-load speed at most, and its servo is at least as stiff
    /// as its line. Wheels that share a drive have the mean of their speeds; a wheel whose torque
    /// limit is 0 rolls freely.
    ///
    /// Args:
    ///     speeds: Speeds, (n_wheels,), rad/s, positive forward.
    ///     set_points: Angles for `set_steering`, (n_wheels,), rad, to set both or neither; the
    ///         steering does not change by default.
    ///
    /// Raises:
    ///     CommandError: A wrong length, an entry that is not finite, or a set-point that
    ///         `set_steering` refuses. Nothing has changed.
    #[pyo3(signature = (speeds, set_points = None))]
    fn set_wheel_speeds(
        &self,
        speeds: &Bound<'_, PyAny>,
        set_points: Option<&Bound<'_, PyAny>>,
    ) -> Result<()> {
        let speeds = self.commands(speeds, "speeds")?;
        let Some(set_points) = set_points else {
            return Ok(self.open()?.set_wheel_speeds(&speeds)?);
        };
        let set_points = self.commands(set_points, "set_points")?;
        Ok(self.open()?.set_speed_commands(&speeds, &set_points)?)
    }

    /// Steering set-points, (n_wheels,), rad; 0 for wheels without steering or released ones.
    #[getter]
    fn steering(&self) -> Result<Array> {
        Ok(fresh(&self.open()?.steering()))
    }

    /// Sets the steering set-points, which an implicit PD controller holds with the model's gains.
    ///
    /// Args:
    ///     set_points: Angles, (n_wheels,), rad.
    ///
    /// Raises:
    ///     CommandError: A wrong length, an entry that is not finite or beyond the wheel's limit,
    ///         or one that is not 0 for a wheel that cannot be steered. Nothing has changed.
    fn set_steering(&self, set_points: &Bound<'_, PyAny>) -> Result<()> {
        let set_points = self.commands(set_points, "set_points")?;
        Ok(self.open()?.set_steering(&set_points)?)
    }

    /// Sets torques and steering together. If one of them is invalid, neither changes.
    ///
    /// Args:
    ///     torques: As for `set_wheel_torques`, (n_wheels,), N m.
    ///     set_points: As for `set_steering`, (n_wheels,), rad.
    ///
    /// Raises:
    ///     CommandError: As for these two methods. Nothing has changed.
    fn set_commands(
        &self,
        torques: &Bound<'_, PyAny>,
        set_points: &Bound<'_, PyAny>,
    ) -> Result<()> {
        let torques = self.commands(torques, "torques")?;
        let set_points = self.commands(set_points, "set_points")?;
        Ok(self.open()?.set_commands(&torques, &set_points)?)
    }

    /// Sets torques about the joint axes.
    ///
    /// At a joint with its own drive, the torque is limited by the drive and by its motor's
    /// torque-speed line. At all other joints, wheels among them, it is added without limit.
    ///
    /// Args:
    ///     torques: Torques, (n_joints,), N m, in the order of `RoverModel.joint_names`.
    ///
    /// Raises:
    ///     CommandError: A wrong length, or an entry that is not finite. Nothing has changed.
    fn set_joint_torques(&self, torques: &Bound<'_, PyAny>) -> Result<()> {
        let n_joints = self.model.n_joints();
        let torques = at_most(torques, n_joints, Kind::Command, "torques")?;
        Ok(self.open()?.set_joint_torques(&torques)?)
    }

    /// Applies a force and a moment to a solid in all further steps.
    ///
    /// Replaces the last wrench on this solid; one without force and moment removes it. A reset
    /// removes all wrenches, `set_state` keeps them.
    ///
    /// Args:
    ///     solid: Name of the solid.
    ///     force: Force in world axes, (3,), N; zero by default.
    ///     moment: Moment in world axes, (3,), N m; zero by default.
    ///     point: Where the force acts in the solid's frame, (3,), m; its origin by default.
    ///
    /// Raises:
    ///     CommandError: There is no such solid, or an array has a wrong length or an entry that is
    ///         not finite. Nothing has changed.
    #[pyo3(signature = (solid, force = None, moment = None, *, point = None))]
    fn apply_wrench(
        &self,
        solid: &Bound<'_, PyAny>,
        force: Option<&Bound<'_, PyAny>>,
        moment: Option<&Bound<'_, PyAny>>,
        point: Option<&Bound<'_, PyAny>>,
    ) -> Result<()> {
        let solid = text(solid, Kind::Command, "solid")?;
        let read = |given: Option<&Bound<'_, PyAny>>, field| {
            given.map_or(Ok([0.0; 3]), |given| triple(given, Kind::Command, field))
        };
        let (force, moment) = (read(force, "force")?, read(moment, "moment")?);
        let point = read(point, "point")?;
        Ok(self.open()?.apply_wrench(&solid, force, moment, point)?)
    }

    /// Removes all wrenches.
    fn clear_wrenches(&self) -> Result<()> {
        self.open()?.clear_wrenches();
        Ok(())
    }

    /// Holds joints at set-points by an implicit PD controller.
    ///
    /// Args:
    ///     joints: Name of a joint, or names.
    ///     set_points: Angles, one for each joint, rad; the present angles by default.
    ///     stiffness: Stiffness of the controllers, N m/rad; the model's by default.
    ///     damping: Damping of the controllers, N m s/rad; the model's by default.
    ///
    /// Raises:
    ///     CommandError: There is no such joint, the number of set-points differs, a number is
    ///         negative or not finite, or neither model nor arguments give a stiffness or a
    ///         damping. Nothing has changed.
    #[pyo3(signature = (joints, set_points = None, *, stiffness = None, damping = None))]
    fn hold(
        &self,
        joints: &Bound<'_, PyAny>,
        set_points: Option<&Bound<'_, PyAny>>,
        stiffness: Option<&Bound<'_, PyAny>>,
        damping: Option<&Bound<'_, PyAny>>,
    ) -> Result<()> {
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
        Ok(held?)
    }

    /// Releases joints that are held.
    ///
    /// Args:
    ///     joints: Name of a joint, or names.
    ///
    /// Raises:
    ///     CommandError: There is no such joint. Nothing has changed.
    fn release(&self, joints: &Bound<'_, PyAny>) -> Result<()> {
        Ok(self.open()?.release(&names(joints)?)?)
    }

    /// Holds all wheels at their present angles, as `hold` does, and sets their torques to 0.
    ///
    /// Raises:
    ///     CommandError: The model states no gains to hold a wheel. Nothing has changed.
    fn brake(&self) -> Result<()> {
        let mut open = self.open()?;
        open.check_brakes()?;
        open.brake();
        Ok(())
    }

    /// The contacts of the last step.
    #[getter]
    fn contacts(&self) -> Result<Contacts> {
        Ok(Contacts::new(&self.model, self.open()?.contacts()))
    }

    /// Gap of each wheel now, (n_wheels,), m, positive when apart.
    #[getter]
    fn wheel_gaps(&self) -> Result<Array> {
        let contacts = self.open()?.wheel_contacts();
        Ok(contacts.iter().map(|c| c.gap).collect())
    }

    /// Mean contact force on each wheel over the last step, (n_wheels, 3), N.
    ///
    /// Sums over its contacts, each along its own normal, rolling and lateral direction; with
    /// rollers along the normal, along the roller's axis, and 0.
    #[getter]
    fn wheel_forces(&self) -> Result<Array> {
        Ok(fresh_rows(self.open()?.wheel_forces()))
    }

    /// Mean normal force over the last step on all solids except the wheels, N.
    ///
    /// It is large when the rover is high-centred.
    #[getter]
    fn trunk_force(&self) -> Result<f64> {
        Ok(self.open()?.body_force())
    }

    /// Deepest overlap of a wheel or a box with the ground now, as a gap, m; 0 without overlap.
    #[getter]
    fn deepest_overlap(&self) -> Result<f64> {
        Ok(self.open()?.deepest_overlap())
    }

    /// All quantities for a controller, as one new array.
    ///
    /// Args:
    ///     target: Place (x, z) of the target, to which the entry `target` refers, m; the origin by
    ///         default.
    ///     scan: Points of the height scan ahead and to the right of the trunk's origin in the
    ///         heading frame, (n, 2), m; none by default.
    ///
    /// Returns:
    ///     The array; `reading_layout` gives the slice of each quantity.
    ///
    /// Raises:
    ///     OptionError: An argument has a wrong shape or an entry that is not finite.
    #[pyo3(signature = (target = None, scan = None))]
    fn reading(
        &self,
        target: Option<&Bound<'_, PyAny>>,
        scan: Option<&Bound<'_, PyAny>>,
    ) -> Result<Array> {
        let scan = scan_points(scan)?;
        let look = ReadingRequest {
            target: place(target)?,
            scan: &scan,
        };
        let mut row = vec![0.0; ReadingLayout::new(&self.model, scan.len()).size()];
        let mut scratch = ReadingScratch::default();
        self.open()?.read(&look, &mut scratch, &mut row);
        Ok(row.into())
    }

    /// The slice of each quantity in a reading.
    ///
    /// - `pose`: q, with the angles of the wheels wrapped to one turn
    /// - `body_velocity`: linear and angular velocity of the trunk in its own frame, m/s and rad/s
    /// - `joint_rates`: rad/s
    /// - `wheel_gaps`: m, positive when apart
    /// - `wheel_contacts`: 1 where the wheel touches the ground, within 1 mm, else 0
    /// - `normal_forces`: mean over the last step, N
    /// - `tangential_forces`: mean over the last step, rolling and lateral for each wheel, N
    /// - `ground_normal`: normal of the ground plane in the trunk's frame; 0 without a plane
    /// - `target`: distance of the target ahead of the trunk's origin, to its right, and in total,
    ///   all horizontal, m
    /// - `cos_tilt`: cosine of the angle between the trunk's y axis and up
    /// - `speed`: horizontal speed of the trunk's origin, m/s
    /// - `trunk_force`: as the property, N
    /// - `slip_ratio`: mean over the wheels in contact of the slip divided by the faster of rim and
    ///   ground speed
    /// - `work`: absolute work of the wheel motors in the last call of `step`, driving or braking,
    ///   J
    /// - `positive_work`: the driving part of it, J
    /// - `time`: s
    /// - `solver`: of the last call of `step`: 1 if it did not converge, iterations, residual,
    ///   contacts
    /// - `heights`: height of the ground at the points of the scan relative to the trunk's origin,
    ///   m; NaN where there is no ground
    ///
    /// Args:
    ///     n_scan: Number of points of the height scan.
    ///
    /// Returns:
    ///     Slices by name.
    ///
    /// Raises:
    ///     OptionError: `n_scan` is not a count.
    #[pyo3(signature = (n_scan = Given::MISSING), text_signature = "($self, n_scan=0)")]
    fn reading_layout<'py>(
        &self,
        py: Python<'py>,
        n_scan: Given<'_>,
    ) -> Result<Bound<'py, PyDict>> {
        let n_scan = n_scan.count(0, Kind::Option, "n_scan")?;
        slices(py, &ReadingLayout::new(&self.model, n_scan))
    }

    /// Finds the first point at which each ray hits the ground or the rover itself.
    ///
    /// Of the rover, the collision shapes are hit: wheels, boxes and balls.
    ///
    /// Args:
    ///     origins: Origins of the rays, world frame, (n, 3) or one (3,) for all, m.
    ///     directions: Directions of the rays, world frame, (n, 3) or one (3,) for all, of any
    ///         length.
    ///     max_range: Largest distance, m; unlimited by default.
    ///     parts: Whether rays hit the rover's own parts.
    ///     without: Names of solids that rays pass through, such as the one that carries the
    ///         sensor.
    ///
    /// Returns:
    ///     Distances, (n,), m, and the surface's unit normals at the hits, world frame, (n, 3). A
    ///     ray without a hit has an infinite distance and a NaN normal.
    ///
    /// Raises:
    ///     OptionError: As for `Terrain.cast_rays`, or `without` contains a name that is not a
    ///         solid of the model.
    #[pyo3(signature = (origins, directions, max_range = Given::MISSING, *, parts = Given::MISSING, without = None),
        text_signature = "($self, origins, directions, max_range=None, *, parts=False, without=())")]
    fn cast_rays(
        &self,
        origins: &Bound<'_, PyAny>,
        directions: &Bound<'_, PyAny>,
        max_range: Given<'_>,
        parts: Given<'_>,
        without: Option<&Bound<'_, PyAny>>,
    ) -> Result<Met> {
        let (rays, range) = rays(origins, directions, max_range)?;
        let sees_parts = parts.flag(false, Kind::Option, "parts")?;
        let without = self.solids(without)?;
        let is_seen =
            |part: &Part| sees_parts && !without.iter().any(|name| name == part.name(&self.model));
        let seen: Vec<Part> = Part::all(&self.model).filter(is_seen).collect();
        let held = self.open()?;
        let inner = &*held;
        Ok(met(&origins
            .py()
            .release(|| inner.cast(&rays, range, &seen))?))
    }

    /// Takes a picture of the ground and of the rover in the light of Sun and sky, pixel by pixel.
    ///
    /// Every ray of a pixel that meets a surface casts another towards the Sun. Ruts in sand are
    /// shown as a relief.
    ///
    /// Args:
    ///     look: Colours and light, and what is drawn of the rover.
    ///     place: Of the camera, world frame, (3,), m.
    ///     directions: Of the pixels, world frame, (n, 3), of any length.
    ///     max_range: Largest distance, m; unlimited by default.
    ///     pixel: Angle between neighbouring pixels, rad, at which textures are smoothed.
    ///     sun: Direction to the Sun, world frame, (3,); without it the colours are 0.
    ///     balls: Grains around the rover.
    ///     without: Names of solids that are not seen, such as the one that carries the camera;
    ///         they cast shadows.
    ///
    /// Returns:
    ///     Colours, (n, 3) float32, 1 for white; kinds, (n,) uint8: 0 nothing, 1 ground or grains,
    ///     2 rocks, 3 the rover; distances along the rays, (n,), m, infinite without a hit.
    ///
    /// Raises:
    ///     OptionError: As for `cast_rays`, `pixel` is not positive, or the Sun is not above the
    ///         horizon.
    #[pyo3(signature = (look, place, directions, **options),
        text_signature = "($self, look, place, directions, *, max_range=None, pixel=0.001, sun=None, balls=None, without=())")]
    fn take_picture(
        &self,
        look: &Bound<'_, PyAny>,
        place: &Bound<'_, PyAny>,
        directions: &Bound<'_, PyAny>,
        options: Option<&Bound<'_, PyDict>>,
    ) -> Result<Picture> {
        let py = look.py();
        let given = Named::keywords(py, options)?;
        let look = arguments::object::<PictureLook>(look, Kind::Option, "look", "a PictureLook")?;
        picture::numbers::<3>(place, Kind::Option, "place")?;
        let (rays, range) = rays(place, directions, given.get("max_range")?)?;
        let pixel = given.read("pixel", arguments::positive)?.unwrap_or(0.001);
        let shot = shot(given.some("sun")?.as_ref(), pixel, range)?;
        let balls = given.get("balls")?;
        let balls = balls.object::<Bound<'_, SphereField>>(
            Kind::Option,
            "balls",
            "a SphereField or None",
        )?;
        let hidden = self.solids(given.some("without")?.as_ref())?;
        given.finish()?;
        let look = look.get();
        let shown = Shown {
            drawings: &look.drawings,
            hidden: &hidden,
            balls: balls.as_ref().map(|balls| &*balls.get().inner),
        };
        let held = self.open()?;
        let inner = &*held;
        Ok(pixels(&py.release(|| {
            inner.take_picture(&look.look, &shown, &rays, &shot)
        })?))
    }

    /// Momentum of the rover.
    ///
    /// Returns:
    ///     Linear momentum, (3,), kg m/s, and angular momentum about the origin, (3,), kg m²/s,
    ///     world frame.
    fn momentum(&self) -> Result<Pair> {
        let momentum = self.open()?.momentum();
        Ok((
            fresh(momentum.linear.as_slice()),
            fresh(momentum.angular.as_slice()),
        ))
    }

    /// Mass centre, world frame, (3,), m.
    fn centre_of_mass(&self) -> Result<Array> {
        Ok(fresh(self.open()?.centre_of_mass().as_slice()))
    }

    /// Named points and axes of the machine now, world frame, (3,) by name, as `RoverModel.tags`.
    fn tags<'py>(&self, py: Python<'py>) -> Result<Bound<'py, PyDict>> {
        tags(py, &self.model, &self.open()?.kinematics())
    }

    /// Origin (3,), m, and rotation matrix (3, 3) of every solid now, world frame, by name.
    fn poses<'py>(&self, py: Python<'py>) -> Result<Bound<'py, PyDict>> {
        poses(py, &self.model, &self.open()?.kinematics())
    }

    /// The friction-contact problem of the last step; if the step was split, of its last part.
    ///
    /// Returns:
    ///     Delassus operator W, (3 n_c, 3 n_c), 1/kg; free velocity, (3 n_c,), m/s; friction
    ///     coefficients, (n_c,).
    fn last_problem(&self) -> Result<Problem> {
        Ok(problem(&*self.open()?))
    }

    /// Derivatives of the next step with respect to state, command and parameters.
    ///
    /// The simulation does not change. The step is taken as after `set_state(q, v)`, without warm
    /// start. The active contacts, their modes and the branches of the motors' lines are held
    /// constant; the limits of the commands are not considered. Where the modes change, the
    /// derivative is not valid; with `check`, `Linearisation.holds` is False there.
    ///
    /// Args:
    ///     check: Whether to test each column of (A, B) by two real steps, which takes ten
    ///         times as long as the derivatives; False by default.
    ///     perturbation: Change of each entry of (x, u) in these steps, m, rad, m/s or rad/s, and
    ///         1000 times as many N m; from 1e-9 to 1e-3, 1e-6 by default.
    ///     parameters: Names of parameters for C: "friction", the common coefficient; "mass" and
    ///         "mass:<body>", a factor of mass and inertia of all bodies or of one;
    ///         "damping:<joint>", N m s/rad or N s/m; "contact_stiffness" and "contact_damping",
    ///         factors of those of wheels that yield; on soft ground "soil:<number>", a number of
    ///         its soil in its own unit. None by default.
    ///
    /// Returns:
    ///     The derivatives, the contact modes and their margins.
    ///
    /// Raises:
    ///     OptionError: `perturbation` is out of its range, a parameter does not exist, or the
    ///         variant is "newton".
    ///     StateError: A pitch is 90 degrees, where the coordinates are singular.
    ///     StepError: The step failed, was split, or did not converge, so that it has no
    ///         derivative.
    #[pyo3(
        signature = (check = Given::MISSING, perturbation = Given::MISSING, parameters = None),
        text_signature = "($self, check=False, perturbation=1e-6, parameters=())"
    )]
    fn linearise(
        &self,
        py: Python<'_>,
        check: Given<'_>,
        perturbation: Given<'_>,
        parameters: Option<&Bound<'_, PyAny>>,
    ) -> Result<Linearisation> {
        let check = check.flag(false, Kind::Option, "check")?;
        let perturbation = perturbation.number(1e-6, Kind::Option, "perturbation")?;
        let held = self.open()?;
        let inner = &*held;
        let parameters = named_parameters(inner, parameters)?;
        let perturbation = check.then_some(perturbation);
        let found = py.release(|| inner.linearise(&parameters, perturbation))??;
        Ok(Linearisation::new(&self.model, found))
    }

    /// Takes steps from given states under given commands, with the derivatives of each.
    ///
    /// The simulation does not change. Each step is taken as after `set_state`, without warm start,
    /// so that it is a function of state, command and parameters, as in `linearise`. Torques
    /// saturate at their limits. `rover_gym.derivatives` has products with these derivatives.
    ///
    /// Args:
    ///     states: State at the start of each trajectory, (n, nx), as in `Linearisation`. On soft
    ///         ground (n, 2 nv) serves too: the sand is then as it is in this simulation.
    ///     commands: Wheel torques (N m) and steering set-points (rad) of each step,
    ///         (n, steps, nu) with nu = 2 n_wheels.
    ///     parameters: Names of parameters, as in `linearise`; none by default.
    ///     threads: Number of threads; one a core by default.
    ///
    /// Returns:
    ///     States and derivatives.
    ///
    /// Raises:
    ///     StateError: A state has a wrong shape or an entry that is not finite, or a pitch is 90
    ///         degrees.
    ///     CommandError: Commands have a wrong shape or an entry that is refused.
    ///     OptionError: A parameter does not exist, `threads` is out of its range, or the variant
    ///         is "newton".
    ///     StepError: A step failed, or has no derivative.
    #[pyo3(
        signature = (states, commands, parameters = None, threads = None),
        text_signature = "($self, states, commands, parameters=(), threads=None)"
    )]
    fn differentiate(
        &self,
        py: Python<'_>,
        states: &Bound<'_, PyAny>,
        commands: &Bound<'_, PyAny>,
        parameters: Option<&Bound<'_, PyAny>>,
        threads: Option<&Bound<'_, PyAny>>,
    ) -> Result<StepDerivatives> {
        let held = self.open()?;
        let inner = &*held;
        let (nx, nu) = (state_size(inner), 2 * self.model.wheels().len());
        let (mut states, shape) = finite_shaped(states, Kind::State, ("states", "(n, nx)"), |s| {
            s.len() == 2 && (s[1] == nx || s[1] == 2 * self.model.nv())
        })?;
        let n = shape[0];
        if shape[1] < nx {
            states = with_sand(inner, &states);
        }
        let (commands, shape) = finite_shaped(
            commands,
            Kind::Command,
            ("commands", "(n, steps, nu)"),
            |s| s.len() == 3 && s[0] == n && s[2] == nu,
        )?;
        let cores = || std::thread::available_parallelism().map_or(1, usize::from);
        let threads = arguments::threads(threads)?.unwrap_or_else(cores);
        let parameters = named_parameters(inner, parameters)?;
        let mut watch = Watch::new();
        let batch = TrajectoryBatch {
            states: &states,
            commands: &commands,
            steps: shape[1],
            parameters: &parameters,
        };
        let found = py.release(|| batch.take(inner, threads, &mut || watch.go_on()))?;
        let found = watch.result(found.map_err(of_trajectory))?;
        let sizes = [nx, nu, parameters.len()];
        Ok(StepDerivatives::new(&found, shape[1], sizes))
    }

    /// Measures the computing time of each part of a step, on a copy of this simulation.
    ///
    /// Args:
    ///     n: Number of steps.
    ///
    /// Returns:
    ///     Mean time of each part (`kinematics`, `mass_matrix`, `solve` and so on) in a step, µs.
    ///
    /// Raises:
    ///     StepError: A step failed.
    ///     OptionError: `n` is not a whole number from 0.
    #[pyo3(signature = (n = Given::MISSING), text_signature = "($self, n=1000)")]
    fn profile<'py>(&self, py: Python<'py>, n: Given<'_>) -> Result<Bound<'py, PyDict>> {
        let steps = n.count(1000, Kind::Option, "n")?;
        let (held, mut watch) = (self.open()?, Watch::new());
        let inner = &*held;
        let stopwatch = py.release(|| inner.profile(steps, &mut || watch.go_on()))?;
        let stopwatch = watch.result(stopwatch)?;
        let parts = PyDict::new(py);
        for (phase, microseconds) in stopwatch.microseconds() {
            parts.set_item(phase.name(), microseconds)?;
        }
        Ok(parts)
    }

    fn __repr__(slf: PyRef<'_, Self>) -> String {
        let (name, nv) = (&slf.model.description().name, slf.model.nv());
        let what = format!("{name:?}, nv={nv}");
        slf.as_super().shown("Simulation", Ok(what))
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> Result<Bound<'py, PyTuple>> {
        let (py, own, base) = (slf.py(), slf.get(), slf.as_super().get());
        let (terrain, settings) = (own.terrain(py)?, own.settings(py)?);
        let given = (own.model(), terrain, settings, base.snapshot()?);
        Ok((slf.get_type().getattr("_rebuild")?, given).into_pyobject(py)?)
    }

    #[staticmethod]
    fn _rebuild<'py>(
        model: &Bound<'py, PyAny>,
        terrain: &Bound<'py, PyAny>,
        settings: &Bound<'py, PyDict>,
        snapshot: &Bound<'py, PyAny>,
    ) -> Result<Bound<'py, Self>> {
        let class = model.py().get_type::<Self>();
        let made = class.call((model, terrain), Some(settings))?;
        let made = made.cast_into::<Self>().map_err(PyErr::from)?;
        made.as_super().get().restore(snapshot)?;
        Ok(made)
    }
}
