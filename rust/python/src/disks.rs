//! `DiskSimulation` and `disk_packing`: grains in the plane.

use std::sync::{Arc, MutexGuard};

use pyo3::prelude::*;
use pyo3::types::PyDict;
use rover_core::geometry::Support;
use rover_core::planar::{PlanarTree, WheelRig};
use rover_core::simulation::DiskSimulation as Core;
use rover_core::system::grains::Packing;

use crate::arguments::{Given, Named, refused};
use crate::arrays::{Array, fresh, fresh_rows, vector};
use crate::bed_arguments::{Described, Packed, coordinates, packed};
use crate::bed_options::disk_options;
use crate::beds::{BedSimulation, SharedBed};
use crate::errors::{Kind, Result, Value};
use crate::planar::pair;
use crate::planar_ground::{border, parse};
use crate::planar_machines::two_wheel_rover;
use crate::shared::Open;

/// Grains in the plane: free disks with friction, contained by walls or on a ground.
///
/// A machine may drive on them.
///
/// Args:
///     radius: Radii of the disks, (n,), m.
///     mass: Masses of the disks, which are homogeneous, (n,), kg.
///     position: Centres, (n, 2), m, or centres and angles, (n, 3), m and rad.
///     kinematic: Which disks have a prescribed velocity, (n,); none by default. Use it for grains
///         glued to a rough floor, or for a piston with the velocity given to `set_state`. These
///         disks may overlap each other and walls.
///     walls: A point of each wall and the normal to its free side, (n, 4), m; none by default.
///     ground: A `Line`, `Sine`, `Spline` or `Polyline` below the disks; none by default.
///     rover: Keyword arguments of `TwoWheelRoverSimulation` that describe a rover, such as its
///         `parameters`; none by default.
///     rig: Mass (kg) and radius (m) of a single wheel with prescribed forward speed and turning
///         rate; none by default.
///     machine: Coordinates of the rover (x, y, theta, theta_A, theta_B) or of the rig (x, y, -,
///         theta, -), (5,), m and rad.
///     gravity: Gravity, (2,), m/s²; (0, -9.81) by default.
#[doc = disk_options!(documented)]
/// Raises:
///     ModelError: A radius or mass is not finite and positive, or the machine's data are invalid.
///     StateError: Positions have a wrong shape or an entry that is not finite, or disks, walls or
///         wheels overlap.
///     TerrainError: A wall has no direction, or `ground` is not a ground.
///     OptionError: An option is out of its range, or both `rover` and `rig` are given.
#[pyclass(module = "rover_gym.core", extends = BedSimulation, frozen)]
pub struct DiskSimulation(Arc<SharedBed<2>>);

impl DiskSimulation {
    fn open(&self) -> Result<MutexGuard<'_, Core>> {
        self.0.open()
    }
}

/// The machine on the disks, if there is one.
fn machine(given: &Named<'_>) -> Result<Option<PlanarTree>> {
    let rover = given.of(Kind::Model).read("rover", |rover, kind, field| {
        let wrong = |_| refused(rover, kind, field, "a dict");
        let described = Named::keywords(rover.py(), Some(rover.cast().map_err(wrong)?))?;
        let made = two_wheel_rover(&described, &PyDict::new(rover.py()))?;
        described.finish()?;
        Ok(made.into())
    })?;
    let rig = given.of(Kind::Model).read("rig", |rig, kind, field| {
        let rig = pair(rig, kind, field)?;
        Ok(WheelRig::new(rig.x, rig.y)
            .map_err(|e| border(kind, &e))?
            .into())
    })?;
    if rover.is_some() && rig.is_some() {
        let message = "rig: disks carry a rover or a rig, not both".to_owned();
        return Err(Kind::Option.error("rig", message, Value::Nothing));
    }
    Ok(rover.or(rig))
}

#[pymethods]
impl DiskSimulation {
    #[new]
    #[pyo3(signature = (radius, mass, position, **options),
        text_signature = "(radius, mass, position, *, kinematic=None, walls=None, ground=None, rover=None, rig=None, machine=None, gravity=None, **options)")]
    fn new(
        radius: &Bound<'_, PyAny>,
        mass: &Bound<'_, PyAny>,
        position: &Bound<'_, PyAny>,
        options: Option<&Bound<'_, PyDict>>,
    ) -> Result<PyClassInitializer<Self>> {
        let given = Named::keywords(radius.py(), options)?;
        let ground = given.some("ground")?.as_ref().map(parse).transpose()?;
        let ground = ground.map(|ground| ground as Arc<dyn Support<2>>);
        let mut bed = Described::read([radius, mass, position], &given, (ground, false))?;
        bed.scene.machine = machine(&given)?.map(Arc::new);
        if let Some(machine) = given.of(Kind::State).read("machine", vector)? {
            bed.q.extend(machine);
        }
        given.finish()?;
        let (base, inner) = BedSimulation::build(bed)?;
        Ok(base.add_subclass(Self(inner)))
    }

    /// Coordinates of the machine, (5,), m and rad; empty without one.
    #[getter]
    fn machine(&self) -> Result<Array> {
        let inner = self.open()?;
        Ok(fresh(inner.description().machine_coordinates(inner.q())))
    }

    /// Rates of the machine's coordinates, (5,), m/s and rad/s; empty without one.
    #[getter]
    fn machine_rate(&self) -> Result<Array> {
        let inner = self.open()?;
        Ok(fresh(inner.description().machine_velocities(inner.v())))
    }

    /// Centre and radius of each wheel, (n_wheels, 3), m.
    #[getter]
    fn wheels(&self) -> Result<Array> {
        let inner = self.open()?;
        let wheels = inner.description().wheels(inner.q()).into_iter();
        Ok(fresh_rows(
            wheels.map(|(centre, radius)| [centre.x, centre.y, radius]),
        ))
    }

    /// Commanded torques of the rover's wheels, (2,), N m, positive forward; empty without a rover.
    #[getter]
    fn torques(&self) -> Result<Array> {
        Ok(fresh(&self.open()?.command().torques))
    }

    /// External force at the machine's centre along x and y, N.
    #[getter]
    fn pull(&self) -> Result<(f64, f64)> {
        let inner = self.open()?;
        let pull = inner.command().pull;
        Ok((pull.x, pull.y))
    }

    /// Sets positions and rates; time starts at 0.
    ///
    /// Args:
    ///     position: Centres, (n, 2), m, or centres and angles, (n, 3), m and rad.
    ///     velocity: Rates, (n, 2), m/s, or (n, 3), m/s and rad/s; at rest by default.
    ///     machine: Coordinates of the machine, (5,), m and rad; the present ones by default.
    ///     machine_rate: Rates of the machine's coordinates, (5,), m/s and rad/s; at rest by
    ///         default.
    ///
    /// Raises:
    ///     StateError: An array has a wrong shape or an entry that is not finite, or bodies
    ///         overlap. Nothing has changed.
    #[pyo3(signature = (position, velocity = None, machine = None, machine_rate = None))]
    fn set_state(
        &self,
        position: &Bound<'_, PyAny>,
        velocity: Option<&Bound<'_, PyAny>>,
        machine: Option<&Bound<'_, PyAny>>,
        machine_rate: Option<&Bound<'_, PyAny>>,
    ) -> Result<()> {
        let mut inner = self.open()?;
        let mut q = coordinates::<2>(position, "position")?;
        let mut v = match velocity {
            Some(velocity) => coordinates::<2>(velocity, "velocity")?,
            None => vec![0.0; q.len()],
        };
        let present = inner.description().machine_coordinates(inner.q());
        match machine {
            Some(machine) => q.extend(vector(machine, Kind::State, "machine")?),
            None => q.extend(present),
        }
        match machine_rate {
            Some(rate) => v.extend(vector(rate, Kind::State, "machine_rate")?),
            None => v.resize(v.len() + present.len(), 0.0),
        }
        Ok(inner.set_state(&q, &v)?)
    }

    /// Sets the torques of the rover's wheels.
    ///
    /// Args:
    ///     torques: Torques of wheels A and B, (2,), N m, positive forward.
    ///
    /// Raises:
    ///     CommandError: A wrong length, or an entry that is not finite. Nothing has changed.
    fn set_torques(&self, torques: &Bound<'_, PyAny>) -> Result<()> {
        let torques = vector(torques, Kind::Command, "torques")?;
        Ok(self.open()?.set_inputs(&torques)?)
    }

    /// Sets an external force at the machine's centre, such as a drawbar load.
    ///
    /// Args:
    ///     pull: Force along x and y, (2,), N.
    ///
    /// Raises:
    ///     CommandError: A wrong length, or an entry that is not finite. Nothing has changed.
    fn set_pull(&self, pull: &Bound<'_, PyAny>) -> Result<()> {
        let pull = pair(pull, Kind::Command, "pull")?;
        Ok(self.open()?.set_pull(pull.into())?)
    }

    /// Sum of the last step's contact impulses on the wheels, along x and y, (2,), N s.
    fn impulse_on_wheels(&self) -> Result<Array> {
        Ok(fresh(&self.open()?.impulse_on_wheels()))
    }
}

/// Initial state for a bed: disks in loose rows, without overlap.
///
/// The radii are drawn uniformly from their range. The defaults give the bed of the 2010 report:
/// three layers of 74 disks.
///
/// Args:
///     count: Number of disks, at most 1 000 000.
///     radius_min: Smallest radius, m.
///     radius_max: Largest radius, m.
///     mass: Mass of a disk of the mean radius, kg; masses are proportional to area.
///     left: Left edge, m.
///     width: Width of the rows, m.
///     bottom: Height of the lower edge, m.
///     seed: Seed of the random numbers; equal seeds give equal disks.
///
/// Returns:
///     Radii, (n,), m, masses, (n,), kg, and centres, (n, 2), m.
///
/// Raises:
///     ModelError: A number is not finite or out of its range, `radius_max` is below `radius_min`,
///         or a disk does not fit.
#[pyfunction]
#[pyo3(signature = (count = Given::MISSING, **options),
    text_signature = "(count=222, *, radius_min=0.016, radius_max=0.0165, mass=0.7, left=0.0, width=2.4494, bottom=0.0, seed=0)")]
pub fn disk_packing(
    py: Python<'_>,
    count: Given<'_>,
    options: Option<&Bound<'_, PyDict>>,
) -> Result<Packed> {
    let given = Named::keywords(py, options)?.of(Kind::Model);
    let packing = Packing {
        count: count.count(222, Kind::Model, "count")?,
        radius_min: given.number("radius_min", 0.016)?,
        radius_max: given.number("radius_max", 0.0165)?,
        mass: given.number("mass", 0.7)?,
        corner: [given.number("left", 0.0)?, given.number("bottom", 0.0)?],
        sides: [given.number("width", 2.4494)?, f64::INFINITY],
        seed: given.whole("seed", 0)?,
    };
    given.finish()?;
    packed::<2>(py, &packing)
}

/// Adds the class of grains in the plane to the module.
pub fn register(module: &Bound<'_, PyModule>) -> Result<()> {
    module.add_class::<DiskSimulation>()?;
    module.add_function(wrap_pyfunction!(disk_packing, module)?)?;
    Ok(())
}
