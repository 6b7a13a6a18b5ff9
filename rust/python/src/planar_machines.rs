//! `BallSimulation`, `TwoWheelRoverSimulation`, `MirroredRoverSimulation`: the planar machines.

use pyo3::prelude::*;
use pyo3::types::PyDict;
use rover_core::multibody::Model;
use rover_core::nalgebra::Vector2;
use rover_core::planar::{MirroredRover, PlanarBall, PlanarWheel, TwoWheelRover};
use std::sync::Arc;

use crate::arguments::Named;
use crate::arrays::one_or_two;
use crate::errors::{Kind, Result};
use crate::model::RoverModel;
use crate::planar::{PlanarSimulation, pair, planar_options};
use crate::planar_ground::border;

/// A disc on a ground: coordinates x, y of its centre, m, and its angle theta, rad.
///
/// Args:
///     ground: A `Line`, `Sine`, `Spline` or `Polyline`.
///     mass: Mass, kg.
///     radius: Radius, m.
///     inertia: Inertia about the centre, kg m²; the inertia of a homogeneous disc by default.
#[doc = planar_options!()]
/// Raises:
///     ModelError: `mass`, `radius` or `inertia` is not finite and positive.
///     TerrainError: `ground` is not a ground.
///     OptionError: An option is out of its range.
///     TypeError: An option is unknown.
#[pyclass(module = "rover_gym.core", extends = PlanarSimulation, frozen)]
pub struct BallSimulation;

#[pymethods]
impl BallSimulation {
    #[new]
    #[pyo3(signature = (ground, **options), text_signature = "(ground, *, mass=3.0, radius=1.5, inertia=None, gravity=None, contact='nearest', **options)")]
    fn new(
        ground: &Bound<'_, PyAny>,
        options: Option<&Bound<'_, PyDict>>,
    ) -> Result<PyClassInitializer<Self>> {
        let given = Named::keywords(ground.py(), options)?;
        let own = given.of(Kind::Model);
        let (mass, radius) = (own.number("mass", 3.0)?, own.number("radius", 1.5)?);
        let inertia = own
            .maybe("inertia")?
            .unwrap_or(0.5 * mass * radius * radius);
        let ball = PlanarBall::new(mass, radius, inertia).map_err(|e| border(Kind::Model, &e))?;
        let parameters = PyDict::new(ground.py());
        for (name, value) in [("mass", mass), ("radius", radius), ("inertia", inertia)] {
            parameters.set_item(name, value)?;
        }
        let base = PlanarSimulation::build(ball, ground, parameters, given)?;
        Ok(base.add_subclass(Self))
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
#[doc = planar_options!()]
/// Raises:
///     ModelError: A mass, radius or inertia is not finite and positive, or the wheels overlap.
///     TerrainError: `ground` is not a ground.
///     OptionError: An option is out of its range.
///     TypeError: An option is unknown.
#[pyclass(module = "rover_gym.core", extends = PlanarSimulation, frozen)]
pub struct TwoWheelRoverSimulation;

#[pymethods]
impl TwoWheelRoverSimulation {
    #[new]
    #[pyo3(signature = (ground, **options),
        text_signature = "(ground, *, mass=130.0, inertia=None, wheel_mass=None, wheel_radius=None, wheel_inertia=None, axle_a=None, axle_b=None, gravity=None, contact='nearest', **options)")]
    fn new(
        ground: &Bound<'_, PyAny>,
        options: Option<&Bound<'_, PyDict>>,
    ) -> Result<PyClassInitializer<Self>> {
        let given = Named::keywords(ground.py(), options)?;
        let parameters = PyDict::new(ground.py());
        let rover = two_wheel_rover(&given, &parameters)?;
        let base = PlanarSimulation::build(rover, ground, parameters, given)?;
        Ok(base.add_subclass(Self))
    }
}

/// The rover of these keyword arguments. `parameters` receives all of them, defaults included.
pub fn two_wheel_rover(given: &Named<'_>, parameters: &Bound<'_, PyDict>) -> Result<TwoWheelRover> {
    let given = given.of(Kind::Model);
    let both = |field: &str, usual: [f64; 2]| -> Result<[f64; 2]> {
        Ok(given.read(field, one_or_two)?.unwrap_or(usual))
    };
    let mass = given.number("mass", 130.0)?;
    let masses = both("wheel_mass", [60.0; 2])?;
    let radii = both("wheel_radius", [0.2; 2])?;
    // Discs by default.
    let of_disc = |i: usize| 0.5 * masses[i] * radii[i] * radii[i];
    let inertias = both("wheel_inertia", [of_disc(0), of_disc(1)])?;
    let axle = |field: &str, x: f64| -> Result<Vector2<f64>> {
        Ok(given.read(field, pair)?.unwrap_or(Vector2::new(x, 0.0)))
    };
    let axles = [axle("axle_a", -0.4)?, axle("axle_b", 0.4)?];
    // A rod from axle to axle by default.
    let rod = mass * (axles[1] - axles[0]).norm_squared() / 12.0;
    let inertia = given.maybe("inertia")?.unwrap_or(rod);
    let wheel = |i: usize| PlanarWheel {
        mass: masses[i],
        radius: radii[i],
        inertia: inertias[i],
        axle: axles[i],
    };
    parameters.set_item("mass", mass)?;
    parameters.set_item("inertia", inertia)?;
    for (field, [a, b]) in [
        ("wheel_mass", masses),
        ("wheel_radius", radii),
        ("wheel_inertia", inertias),
        ("axle_a", axles[0].into()),
        ("axle_b", axles[1].into()),
    ] {
        parameters.set_item(field, (a, b))?;
    }
    let made = TwoWheelRover::new(mass, inertia, wheel(0), wheel(1));
    made.map_err(|e| border(Kind::Model, &e))
}

/// The six-wheel rover driving straight ahead, as a planar machine in its plane of symmetry.
///
/// Coordinates are x, y, m, theta, and the angle of each mirrored pair of joints, rad. Joints that
/// do not turn about z are locked at 0. Only wheels touch the ground. Each torque acts on both
/// wheels of a pair.
///
/// Args:
///     ground: A `Line`, `Sine`, `Spline` or `Polyline`.
///     model: The machine: an object, a name of the gallery or a file. It must be symmetric about
///         the trunk's x-y plane; the built-in rover by default.
#[doc = planar_options!()]
/// Raises:
///     ModelError: The model is not symmetric.
///     TerrainError: `ground` is not a ground.
///     OptionError: An option is out of its range.
///     TypeError: An option is unknown.
#[pyclass(module = "rover_gym.core", extends = PlanarSimulation, frozen, get_all)]
pub struct MirroredRoverSimulation {
    /// Names of the joints of each coordinate from the fourth on.
    joints: Vec<Vec<String>>,
    /// Names of the wheels of each disc.
    wheels: Vec<Vec<String>>,
}

#[pymethods]
impl MirroredRoverSimulation {
    #[new]
    #[pyo3(signature = (ground, **options), text_signature = "(ground, *, model=None, gravity=None, contact='nearest', **options)")]
    fn new(
        ground: &Bound<'_, PyAny>,
        options: Option<&Bound<'_, PyDict>>,
    ) -> Result<PyClassInitializer<Self>> {
        let given = Named::keywords(ground.py(), options)?;
        let model = given.some("model")?;
        let inner = model
            .map(|model| RoverModel::opened(&model, "model"))
            .transpose()?
            .map_or_else(|| Arc::new(Model::gallery_rover()), |m| m.inner);
        let rover = MirroredRover::new(&inner).map_err(|e| border(Kind::Model, &e))?;
        let own = Self {
            joints: rover.joints(),
            wheels: rover.wheel_names().to_vec(),
        };
        let parameters = PyDict::new(ground.py());
        parameters.set_item("model", RoverModel::from(inner))?;
        let base = PlanarSimulation::build(rover, ground, parameters, given)?;
        Ok(base.add_subclass(own))
    }
}
