//! `BallSimulation`, `TwoWheelRoverSimulation`, `MirroredRoverSimulation`: the planar machines.

use pyo3::prelude::*;
use pyo3::types::PyDict;
use rover_core::multibody::Model;
use rover_core::nalgebra::Vector2;
use rover_core::planar::{Ball, MirroredRover, PlanarWheel, TwoWheelRover};
use std::sync::Arc;

use crate::arguments::{Given, number};
use crate::errors::Kind;
use crate::model::RoverModel;
use crate::planar::{PlanarSimulation, pair};
use crate::planar_ground::border;

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
        wheel_mass: Option<Bound<'_, PyAny>>,
        wheel_radius: Option<Bound<'_, PyAny>>,
        wheel_inertia: Option<Bound<'_, PyAny>>,
        axle_a: Option<Bound<'_, PyAny>>,
        axle_b: Option<Bound<'_, PyAny>>,
        options: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<PyClassInitializer<Self>> {
        let given = [
            ("mass", mass.given()),
            ("inertia", inertia.some()),
            ("wheel_mass", wheel_mass),
            ("wheel_radius", wheel_radius),
            ("wheel_inertia", wheel_inertia),
            ("axle_a", axle_a),
            ("axle_b", axle_b),
        ];
        let parameters = PyDict::new(ground.py());
        for (field, value) in given {
            if let Some(value) = value {
                parameters.set_item(field, value)?;
            }
        }
        let rover = two_wheel_rover(&parameters)?;
        let base = PlanarSimulation::build(rover, ground, parameters, options)?;
        Ok(PyClassInitializer::from(base).add_subclass(Self))
    }
}

/// One number for both, or two.
fn one_or_two(value: &Bound<'_, PyAny>, field: &str) -> PyResult<[f64; 2]> {
    if value.len().is_err() {
        return Ok([number(value, Kind::Model, field)?; 2]);
    }
    Ok(pair(value, Kind::Model, field)?.into())
}

/// The rover of these keyword arguments, each of which may be missing; on return none is.
pub fn two_wheel_rover(parameters: &Bound<'_, PyDict>) -> PyResult<TwoWheelRover> {
    let read = |field: &str, default: f64| match parameters.get_item(field)? {
        Some(value) => number(&value, Kind::Model, field),
        None => Ok(default),
    };
    let both = |field: &str, default: [f64; 2]| match parameters.get_item(field)? {
        Some(value) => one_or_two(&value, field),
        None => Ok(default),
    };
    let mass = read("mass", 130.0)?;
    let masses = both("wheel_mass", [60.0; 2])?;
    let radii = both("wheel_radius", [0.2; 2])?;
    // Discs, unless told otherwise.
    let of_disc = |i: usize| 0.5 * masses[i] * radii[i] * radii[i];
    let inertias = both("wheel_inertia", [of_disc(0), of_disc(1)])?;
    let axle = |field: &str, x: f64| match parameters.get_item(field)? {
        Some(value) => pair(&value, Kind::Model, field),
        None => Ok(Vector2::new(x, 0.0)),
    };
    let axles = [axle("axle_a", -0.4)?, axle("axle_b", 0.4)?];
    // A rod from axle to axle, unless told otherwise.
    let rod = mass * (axles[1] - axles[0]).norm_squared() / 12.0;
    let inertia = read("inertia", rod)?;
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
    Ok(made.map_err(|e| border(Kind::Model, &e))?)
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
///     ModelError: The model is not its own mirror image.
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
        let rover = MirroredRover::new(&inner).map_err(|e| border(Kind::Model, &e))?;
        let own = Self {
            joints: rover.joints(),
            wheels: rover.wheel_names().to_vec(),
        };
        let parameters = PyDict::new(ground.py());
        parameters.set_item("model", RoverModel::from(inner))?;
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
