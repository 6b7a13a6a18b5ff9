//! `GrainSimulation` and `ball_packing`: grains in space.

use numpy::{PyArray1, PyArray2};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use rover_core::draw::DrawnGround;
use rover_core::nalgebra::Vector3;
use rover_core::simulation::GrainSimulation as CoreSimulation;
use rover_core::system::grains::{GrainContact, Packing, arranged};
use std::sync::{Arc, MutexGuard};

use crate::arguments::{Given, flags};
use crate::arrays::{fresh, fresh_rows, triple, vector};
use crate::balls::{self, BallArguments};
use crate::bed_arguments::{self, StepArguments, grain_error, setup_error};
use crate::contacts::GrainContacts;
use crate::errors::{BorderError, Kind};
use crate::report::{Energy, StepReport};
use crate::shared::Shared;
use crate::snapshot::{GrainSnapshot, belonging};
use crate::stepping::step;
use crate::union;
use crate::vessels::{Drum, Silo, Vessel};

type Core = CoreSimulation<3>;

/// Radii, masses and centres of a packing.
type Packed<'py> = (
    Bound<'py, PyArray1<f64>>,
    Bound<'py, PyArray1<f64>>,
    Bound<'py, PyArray2<f64>>,
);

/// Grains in space: free balls with friction, between walls or on a terrain.
///
/// World axes: x forward, y up, z to the right. One call at a time: a call during another one, from
/// another thread or a signal handler, raises BusyError.
///
/// Args:
///     radius: Radii of the balls, (n,), m.
///     mass: Masses of the balls, (n,), kg; they are homogeneous.
///     position: Centres, (n, 3), m.
///     kinematic: Balls whose velocity no force changes, (n,), such as grains glued to a rough
///         floor, or a piston with the velocity that `set_state` gives it; none by default. They
///         may overlap one another and walls.
///     walls: A point of each wall and the normal to its free side, (m, 6), m; none by default.
///     wall_velocity: Velocities of the walls, (m, 3), m/s; at rest by default. A wall is in its
///         place at time 0.
///     vessel: A `Drum` or a `Silo` around the balls; none by default.
///     terrain: A `Plane`, `SphereField`, `HeightField`, `TriangleMesh` or `Union`, or a list of
///         them, below the balls; none by default. Where it knows no ground, balls fall. Balls
///         have a vessel or a terrain, not both.
///     friction: Coulomb's coefficient between balls.
///     wall_friction: Coulomb's coefficient of balls on walls, vessel and terrain.
///     cohesion: Attraction of bodies that touch, N: the pull that breaks their contact. The law of
///         a contact is 0 <= u_N + gap/h, p_N + h cohesion >= 0, one of them 0; friction is bounded
///         by friction (p_N + h cohesion).
///     cohesion_range: Gap up to which the attraction acts, m; 1% of the smallest radius by
///         default, at most 20%.
///     restitution: Newton's coefficient of all contacts, in [0, 1].
///     gravity: Gravity, (3,), m/s²; (0, -9.81, 0) by default.
///     time_step: Time step, s.
///     tolerance: Largest relative residual of the contact problem. Its velocities are also right
///         to 25 times that, in units of the root of gravity times the smallest radius; without
///         gravity that of 9.81 m/s².
///     max_iterations: Largest number of sweeps of the contact solver in a step.
///     stabilisation: "projection" moves overlapping bodies apart, "push_out" lets them part by a
///         fifth of their excessive overlap in each step; both may add energy by lifting those
///         above. "none" leaves overlaps. By default "push_out", but "projection" with
///         restitution or in a vessel: a step along the inside of a curve leads into it.
///     penetration_tolerance: Overlap that stabilisation leaves alone, m; 0.5% of the smallest
///         radius by default.
///     sleep: Whether balls at rest far from anything that moves are left out of the step.
///     sleep_speed: Speed below which a ball is at rest, m/s; 5e-4 by default.
///     sleep_distance: Distance within which nothing may move for a ball to sleep, m; 0.2 by
///         default.
///     threads: Number of threads that solve the contact problem. The answer does not depend on
///         it; below some thousands of balls a second one gains little.
///
/// Raises:
///     ModelError: A radius or mass is not finite and positive.
///     StateError: Positions have a wrong shape or an entry that is not finite, or balls, walls or
///         terrain overlap.
///     TerrainError: A wall has no direction, or `terrain` or `vessel` is none.
///     OptionError: An option is out of its range, or both `terrain` and `vessel` are given.
#[pyclass(module = "rover_gym.mechanics", frozen)]
pub struct GrainSimulation {
    inner: Shared<Core>,
    terrain: Option<DrawnGround>,
    vessel: Option<Vessel>,
}

impl GrainSimulation {
    /// The simulation, for one call.
    pub fn open(&self) -> Result<MutexGuard<'_, Core>, BorderError> {
        self.inner.open()
    }
}

fn n_balls(inner: &Core) -> usize {
    inner.soil().grains.len()
}

#[pymethods]
impl GrainSimulation {
    #[new]
    #[allow(clippy::too_many_arguments)] // keyword arguments of a Python class
    #[pyo3(signature = (radius, mass, position, *, kinematic = Given::MISSING, walls = None, wall_velocity = None, vessel = None, terrain = None,
        friction = Given::MISSING, wall_friction = Given::MISSING, cohesion = Given::MISSING, cohesion_range = Given::MISSING, restitution = Given::MISSING,
        gravity = None, time_step = Given::MISSING, tolerance = Given::MISSING, max_iterations = Given::MISSING,
        stabilisation = Given::MISSING, penetration_tolerance = Given::MISSING,
        sleep = Given::MISSING, sleep_speed = Given::MISSING, sleep_distance = Given::MISSING, threads = Given::MISSING),
        text_signature = "(radius, mass, position, *, kinematic=None, walls=None, wall_velocity=None, vessel=None, terrain=None, friction=0.5, wall_friction=0.5, cohesion=0.0, cohesion_range=None, restitution=0.0, gravity=None, time_step=0.002, tolerance=0.001, max_iterations=2000, stabilisation=None, penetration_tolerance=None, sleep=False, sleep_speed=None, sleep_distance=None, threads=1)")]
    fn new(
        radius: &Bound<'_, PyAny>,
        mass: &Bound<'_, PyAny>,
        position: &Bound<'_, PyAny>,
        kinematic: Given<'_>,
        walls: Option<&Bound<'_, PyAny>>,
        wall_velocity: Option<&Bound<'_, PyAny>>,
        vessel: Option<&Bound<'_, PyAny>>,
        terrain: Option<&Bound<'_, PyAny>>,
        friction: Given<'_>,
        wall_friction: Given<'_>,
        cohesion: Given<'_>,
        cohesion_range: Given<'_>,
        restitution: Given<'_>,
        gravity: Option<&Bound<'_, PyAny>>,
        time_step: Given<'_>,
        tolerance: Given<'_>,
        max_iterations: Given<'_>,
        stabilisation: Given<'_>,
        penetration_tolerance: Given<'_>,
        sleep: Given<'_>,
        sleep_speed: Given<'_>,
        sleep_distance: Given<'_>,
        threads: Given<'_>,
    ) -> PyResult<Self> {
        let gravity = gravity.map(|g| triple(g, Kind::Option, "gravity"));
        let balls = BallArguments {
            radius,
            mass,
            position,
            kinematic,
            walls,
            wall_velocity,
            vessel,
            terrain,
            friction,
            wall_friction,
            cohesion,
            cohesion_range,
            steps: StepArguments {
                restitution,
                gravity: gravity.transpose()?.map(Vector3::from),
                time_step,
                tolerance,
                max_iterations,
                stabilisation,
                is_hollow: vessel.is_some(),
                penetration_tolerance,
                threads,
            },
            sleep,
            sleep_speed,
            sleep_distance,
        }
        .read()?;
        let scene = Arc::new(balls.scene);
        let made = Core::new(scene, balls.options, balls.sleep, balls.q);
        Ok(Self {
            inner: Shared::new(made.map_err(setup_error)?),
            terrain: balls.terrain,
            vessel: balls.vessel,
        })
    }

    /// Time since the last call of `set_state`, s.
    #[getter]
    fn time(&self) -> PyResult<f64> {
        Ok(self.open()?.time())
    }

    /// Time step, s.
    #[getter]
    fn time_step(&self) -> PyResult<f64> {
        Ok(self.open()?.options().time_step)
    }

    /// Radii of the balls, (n,), m.
    #[getter]
    fn radius<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray1<f64>>> {
        Ok(fresh(py, self.open()?.soil().grains.radius()))
    }

    /// Masses of the balls, (n,), kg.
    #[getter]
    fn mass<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray1<f64>>> {
        Ok(fresh(py, self.open()?.soil().grains.mass()))
    }

    /// Centres of the balls, (n, 3), m.
    #[getter]
    fn position<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let inner = self.open()?;
        balls::centres(py, inner.q(), n_balls(&inner))
    }

    /// Velocities of the centres, (n, 3), m/s.
    #[getter]
    fn velocity<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let inner = self.open()?;
        balls::velocities(py, inner.v(), n_balls(&inner))
    }

    /// Angular velocities of the balls, world frame, (n, 3), rad/s.
    #[getter]
    fn spin<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let inner = self.open()?;
        balls::spins(py, inner.v(), n_balls(&inner))
    }

    /// Which balls are kinematic, (n,).
    #[getter]
    fn kinematic<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray1<bool>>> {
        let inner = self.open()?;
        Ok(PyArray1::from_slice(py, inner.soil().grains.kinematic()))
    }

    /// Which balls sleep, (n,); kinematic ones always do.
    #[getter]
    fn asleep<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray1<bool>>> {
        Ok(PyArray1::from_slice(py, self.open()?.asleep()))
    }

    /// The terrain below the balls, or None.
    #[getter]
    fn terrain<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyAny>>> {
        let terrain = self.terrain.as_ref();
        terrain.map(|ground| union::object(py, ground)).transpose()
    }

    /// The vessel around the balls, or None.
    #[getter]
    fn vessel<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyAny>>> {
        self.vessel.as_ref().map(|v| v.to_object(py)).transpose()
    }

    /// A point of each wall now and the normal to its free side, (m, 6), m.
    #[getter]
    fn walls<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let inner = self.open()?;
        let walls = inner.soil().walls.iter().map(|wall| {
            let (n, offset) = (wall.n(), wall.at(inner.time()).offset());
            let point = n * offset;
            [point.x, point.y, point.z, n.x, n.y, n.z]
        });
        fresh_rows(py, &walls.collect::<Vec<_>>())
    }

    /// The options of contacts, gravity and solver, by the names of the arguments.
    #[getter]
    fn settings<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let inner = self.open()?;
        let options = inner.options();
        let settings = bed_arguments::settings(py, options, &inner.soil().friction)?;
        let cohesion = inner.soil().grains.cohesion();
        settings.set_item("cohesion", cohesion.map_or(0.0, |c| c.force))?;
        settings.set_item("cohesion_range", cohesion.map(|c| c.range))?;
        let gravity = options.gravity;
        settings.set_item("gravity", (gravity.x, gravity.y, gravity.z))?;
        Ok(settings)
    }

    /// Sets positions and velocities; time starts at 0.
    ///
    /// Args:
    ///     position: Centres, (n, 3), m.
    ///     velocity: Velocities of the centres, (n, 3), m/s; at rest by default.
    ///     spin: Angular velocities, (n, 3), rad/s; at rest by default.
    ///
    /// Raises:
    ///     StateError: An array has a wrong shape or an entry that is not finite, or bodies
    ///         overlap. Nothing has changed.
    #[pyo3(signature = (position, velocity = None, spin = None))]
    fn set_state(
        &self,
        position: &Bound<'_, PyAny>,
        velocity: Option<&Bound<'_, PyAny>>,
        spin: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<()> {
        let mut inner = self.open()?;
        let (q, v) = balls::state(n_balls(&inner), position, velocity, spin)?;
        Ok(inner.set_state(&q, &v).map_err(|e| grain_error(&e))?)
    }

    /// Takes balls out; the others keep their order.
    ///
    /// Args:
    ///     which: Which balls go, (n,) truth values.
    ///
    /// Raises:
    ///     ModelError: The number of truth values differs, or no ball would be left. Nothing has
    ///         changed.
    fn remove(&self, which: &Bound<'_, PyAny>) -> PyResult<()> {
        let mut inner = self.open()?;
        let which = flags(which, Kind::Model, "which")?;
        Ok(inner.remove(&which).map_err(|e| grain_error(&e))?)
    }

    /// Puts other balls in the place of those so far; time and options stay.
    ///
    /// Balls that were there keep their sleep and the impulses of their contacts, from which the
    /// next step's solver starts. Overlaps are not refused: a run may have made them. Earlier
    /// snapshots fit again once the same balls are back.
    ///
    /// Args:
    ///     radius: Radii of all balls from here on, (n,), m.
    ///     mass: Their masses, (n,), kg.
    ///     position: Their centres, (n, 3), m.
    ///     before: The number of each among the balls so far, (n,); -1 for one that was not there.
    ///         Balls that stay keep their order.
    ///     kinematic: Which of them are kinematic, (n,); none by default.
    ///     velocity: Velocities of their centres, (n, 3), m/s; at rest by default.
    ///     spin: Their angular velocities, (n, 3), rad/s; at rest by default.
    ///
    /// Raises:
    ///     ModelError: A radius or mass is not finite and positive, or `before` does not increase.
    ///         Nothing has changed.
    ///     StateError: An array has a wrong shape or an entry that is not finite. Nothing has
    ///         changed.
    #[allow(clippy::too_many_arguments)] // keyword arguments of a Python method
    #[pyo3(signature = (radius, mass, position, before, *, kinematic = Given::MISSING, velocity = None, spin = None),
        text_signature = "($self, radius, mass, position, before, *, kinematic=None, velocity=None, spin=None)")]
    fn exchange(
        &self,
        radius: &Bound<'_, PyAny>,
        mass: &Bound<'_, PyAny>,
        position: &Bound<'_, PyAny>,
        before: &Bound<'_, PyAny>,
        kinematic: Given<'_>,
        velocity: Option<&Bound<'_, PyAny>>,
        spin: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<()> {
        let mut inner = self.open()?;
        let grains = bed_arguments::grains::<3>(radius, mass, kinematic)?;
        let (q, v) = balls::state(grains.len(), position, velocity, spin)?;
        let before = balls::numbers(before)?;
        let done = inner.exchange(grains, &q, &v, &before);
        Ok(done.map_err(|e| grain_error(&e))?)
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
        step(py, &mut *self.open()?, steps)
    }

    /// The contacts of the last step.
    #[getter]
    fn contacts(&self) -> PyResult<GrainContacts> {
        let inner = self.open()?;
        let (scene, h) = (inner.soil(), inner.options().time_step);
        let attraction = |contact: &GrainContact<3>| h * scene.attraction(contact);
        let n = n_balls(&inner);
        Ok(GrainContacts::new(inner.contacts(), n, attraction))
    }

    /// Kinetic and potential energy now.
    fn energy(&self) -> PyResult<Energy> {
        Ok(self.open()?.energy().into())
    }

    /// Momentum of the balls, (6,): along x, y, z, kg m/s, and about the origin, kg m²/s.
    ///
    /// Kinematic balls do not count.
    fn momentum<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let inner = self.open()?;
        let (linear, moment) = inner.soil().momentum(inner.q(), inner.v());
        let all: Vec<f64> = linear.iter().chain(&moment).copied().collect();
        Ok(fresh(py, &all))
    }

    /// Deepest overlap now, m.
    fn penetration(&self) -> PyResult<f64> {
        Ok(self.open()?.penetration())
    }

    /// Wakes all balls.
    fn wake(&self) -> PyResult<()> {
        self.open()?.wake();
        Ok(())
    }

    /// Everything that is needed to continue bit for bit.
    fn snapshot(&self) -> PyResult<GrainSnapshot> {
        let inner = self.open()?;
        Ok(GrainSnapshot {
            inner: inner.snapshot(),
        })
    }

    /// Goes back to a snapshot.
    ///
    /// Args:
    ///     snapshot: A snapshot of the same grains.
    ///
    /// Raises:
    ///     StateError: The snapshot belongs to other grains or is damaged. Nothing has changed.
    fn restore(&self, snapshot: &Bound<'_, PyAny>) -> PyResult<()> {
        let mut inner = self.open()?;
        let snapshot = belonging::<GrainSnapshot>(snapshot, "a GrainSnapshot")?;
        let restored = inner.restore(&snapshot.get().inner);
        Ok(restored.map_err(BorderError::from)?)
    }

    fn __repr__(&self) -> String {
        let Ok(inner) = self.open() else {
            return "GrainSimulation(stepping)".to_owned();
        };
        let (n, time) = (n_balls(&inner), inner.time());
        format!("GrainSimulation({n} balls, time={time} s)")
    }
}

/// Balls in loose layers over a rectangle, without overlap: where a bed starts from.
///
/// The radii are drawn evenly from their range.
///
/// Args:
///     count: Number of balls, at most 1 000 000.
///     radius_min: Smallest radius, m.
///     radius_max: Largest radius, m.
///     mass: Mass of a ball of the mean radius, kg; the others' go with their volume.
///     width: Width of the rectangle along x, m.
///     depth: Width of the rectangle along z, m.
///     left: Smallest x, m.
///     back: Smallest z, m.
///     bottom: Height of the lower edge, m.
///     seed: Seed of the random numbers; equal seeds give equal balls.
///
/// Returns:
///     Radii, (n,), m, masses, (n,), kg, and centres, (n, 3), m.
///
/// Raises:
///     ModelError: A number is not finite or out of its range, the radii are the wrong way round,
///         or a ball does not fit.
#[pyfunction]
#[pyo3(signature = (count, *, radius_min, radius_max, mass, width, depth,
    left = Given::MISSING, back = Given::MISSING, bottom = Given::MISSING, seed = Given::MISSING),
    text_signature = "(count, *, radius_min, radius_max, mass, width, depth, left=0.0, back=0.0, bottom=0.0, seed=0)")]
#[allow(clippy::too_many_arguments)] // keyword arguments of a Python function
pub fn ball_packing<'py>(
    py: Python<'py>,
    count: Given<'_>,
    radius_min: Given<'_>,
    radius_max: Given<'_>,
    mass: Given<'_>,
    width: Given<'_>,
    depth: Given<'_>,
    left: Given<'_>,
    back: Given<'_>,
    bottom: Given<'_>,
    seed: Given<'_>,
) -> PyResult<Packed<'py>> {
    let kind = Kind::Model;
    let packing = Packing::<3> {
        count: count.count(0, kind, "count")?,
        radius_min: radius_min.number(0.0, kind, "radius_min")?,
        radius_max: radius_max.number(0.0, kind, "radius_max")?,
        mass: mass.number(0.0, kind, "mass")?,
        corner: [
            left.number(0.0, kind, "left")?,
            bottom.number(0.0, kind, "bottom")?,
            back.number(0.0, kind, "back")?,
        ],
        sides: [
            width.number(0.0, kind, "width")?,
            f64::INFINITY,
            depth.number(0.0, kind, "depth")?,
        ],
        seed: seed.whole(0, kind, "seed")?,
    };
    let built = py.detach(|| packing.build());
    let (balls, q) = built.map_err(|e| grain_error(&e))?;
    let centres: Vec<[f64; 3]> = q.chunks_exact(3).map(|c| [c[0], c[1], c[2]]).collect();
    Ok((
        fresh(py, balls.radius()),
        fresh(py, balls.mass()),
        fresh_rows(py, &centres)?,
    ))
}

/// Places balls of given radii in loose layers over a rectangle, without overlap.
///
/// Each has a place as wide as the largest ball, and they fill the layers in the order given.
///
/// Args:
///     radius: Radii, (n,), m.
///     width: Width of the rectangle along x, m.
///     depth: Width of the rectangle along z, m.
///     left: Smallest x, m.
///     back: Smallest z, m.
///     bottom: Height of the lower edge, m.
///     seed: Seed of the random numbers; equal seeds give equal places.
///
/// Returns:
///     Centres, (n, 3), m.
///
/// Raises:
///     ModelError: A number is not finite or out of its range, or a ball does not fit.
#[pyfunction]
#[pyo3(signature = (radius, *, width, depth, left = Given::MISSING, back = Given::MISSING, bottom = Given::MISSING, seed = Given::MISSING),
    text_signature = "(radius, *, width, depth, left=0.0, back=0.0, bottom=0.0, seed=0)")]
#[allow(clippy::too_many_arguments)] // keyword arguments of a Python function
pub fn arrange_balls<'py>(
    py: Python<'py>,
    radius: &Bound<'py, PyAny>,
    width: Given<'_>,
    depth: Given<'_>,
    left: Given<'_>,
    back: Given<'_>,
    bottom: Given<'_>,
    seed: Given<'_>,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let kind = Kind::Model;
    let radius = vector(radius, kind, "radius")?;
    let corner = [
        left.number(0.0, kind, "left")?,
        bottom.number(0.0, kind, "bottom")?,
        back.number(0.0, kind, "back")?,
    ];
    let width = width.number(0.0, kind, "width")?;
    let sides = [width, f64::INFINITY, depth.number(0.0, kind, "depth")?];
    let seed = seed.whole(0, kind, "seed")?;
    let q = py.detach(|| arranged::<3>(&radius, corner, sides, seed));
    let q = q.map_err(|e| grain_error(&e))?;
    balls::centres(py, &q, radius.len())
}

/// Adds the classes of grains in space to the module.
pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<GrainSimulation>()?;
    module.add_class::<GrainContacts>()?;
    module.add_class::<GrainSnapshot>()?;
    module.add_class::<Drum>()?;
    module.add_class::<Silo>()?;
    module.add_function(wrap_pyfunction!(arrange_balls, module)?)?;
    module.add_function(wrap_pyfunction!(ball_packing, module)?)?;
    Ok(())
}
