//! `PlanarGround` and its kinds `Line`, `Sine`, `Spline`, `Polyline`: the grounds of planar scenes.

use pyo3::prelude::*;
use rover_core::planar::{
    Line as CoreLine, PlanarError, PlanarGround as CoreGround, Polyline as CorePolyline,
    Sine as CoreSine, Spline as CoreSpline,
};
use rover_core::quantity::QuantityError;
use std::sync::Arc;

use crate::arguments::{Given, number, object};
use crate::arrays::{Array, fresh, vector};
use crate::errors::{BorderError, Kind, Result, Value};

/// A planar error on its way to Python, as a terrain's or a machine's.
pub fn border(kind: Kind, e: &PlanarError) -> BorderError {
    let value = match e {
        PlanarError::Number(number) => Value::Number(number.value()),
        PlanarError::WheelsOverlap { value, .. }
        | PlanarError::NotAFunction { value, .. }
        | PlanarError::RepeatedPoint { value, .. } => Value::Number(*value),
        PlanarError::TooFewPoints { count, .. }
        | PlanarError::TooManyPoints { count, .. }
        | PlanarError::MismatchedLengths { count, .. } => Value::Count(*count),
        PlanarError::NotMirrored { body } => Value::Text(body.clone()),
        _ => Value::Nothing,
    };
    kind.error(e.field(), e.to_string(), value)
}

/// A number that cannot be, on its way to Python.
pub fn quantity(kind: Kind, e: &QuantityError) -> BorderError {
    kind.error(e.field(), e.to_string(), Value::Number(e.value()))
}

/// Base class of the grounds of planar scenes: x forward, y up. Immutable.
///
/// Its subclasses are `Line`, `Sine`, `Spline` and `Polyline`.
#[pyclass(module = "rover_gym.core", subclass, frozen)]
pub struct PlanarGround(Arc<dyn CoreGround>);

#[pymethods]
impl PlanarGround {
    /// The height of the ground at one place or at many.
    ///
    /// Args:
    ///     x: Places, a number or (m,), m.
    ///
    /// Returns:
    ///     Heights, a number or (m,), m.
    ///
    /// Raises:
    ///     OptionError: `x` is not a number or an array of one dimension.
    fn height<'py>(&self, x: &Bound<'py, PyAny>) -> Result<Bound<'py, PyAny>> {
        if x.len().is_err() {
            let place = number(x, Kind::Option, "x")?;
            return Ok(self.0.height(place).into_pyobject(x.py())?.into_any());
        }
        let places = vector(x, Kind::Option, "x")?;
        let heights: Array = places.iter().map(|x| self.0.height(*x)).collect();
        Ok(heights.into_pyobject(x.py())?.into_any())
    }
}

impl PlanarGround {
    /// A ground of the core, for the class of its kind.
    fn base<G: CoreGround + Clone + 'static>(ground: &G) -> PyClassInitializer<Self> {
        PyClassInitializer::from(Self(Arc::new(ground.clone())))
    }
}

/// The class that is made with a ground of the core.
macro_rules! made {
    ($result:expr) => {{
        let inner = $result.map_err(|e| border(Kind::Terrain, &e))?;
        Ok(PlanarGround::base(&inner).add_subclass(Self { inner }))
    }};
}

/// Places and heights of points.
fn points(x: &Bound<'_, PyAny>, y: &Bound<'_, PyAny>) -> Result<[Vec<f64>; 2]> {
    Ok([
        vector(x, Kind::Terrain, "x")?,
        vector(y, Kind::Terrain, "y")?,
    ])
}

/// The ground y = slope x + offset of a planar scene.
///
/// Args:
///     slope: Slope, rise over run.
///     offset: Height at x = 0, m.
///
/// Raises:
///     TerrainError: A number is not finite, the slope is beyond 1000 or the offset beyond 1e6 m.
#[pyclass(module = "rover_gym.core", frozen, extends = PlanarGround)]
pub struct Line {
    inner: CoreLine,
}

#[pymethods]
impl Line {
    #[new]
    #[pyo3(signature = (slope = Given::MISSING, offset = Given::MISSING), text_signature = "(slope=0.0, offset=0.0)")]
    fn new(slope: Given<'_>, offset: Given<'_>) -> Result<PyClassInitializer<Self>> {
        let slope = slope.number(0.0, Kind::Terrain, "slope")?;
        let offset = offset.number(0.0, Kind::Terrain, "offset")?;
        made!(CoreLine::new(slope, offset))
    }

    /// Slope, rise over run.
    #[getter]
    fn slope(&self) -> f64 {
        self.inner.slope()
    }

    /// Height at x = 0, m.
    #[getter]
    fn offset(&self) -> f64 {
        self.inner.offset()
    }

    fn __repr__(&self) -> String {
        format!("Line(slope={}, offset={})", self.slope(), self.offset())
    }

    fn __getnewargs__(&self) -> (f64, f64) {
        (self.slope(), self.offset())
    }
}

/// The ground y = amplitude sin(2 pi x / wavelength + phase) + offset of a planar scene.
///
/// Args:
///     amplitude: Amplitude, m.
///     wavelength: Wavelength, m.
///     phase: Phase at x = 0, rad.
///     offset: Mean height, m.
///
/// Raises:
///     TerrainError: A number is not finite, the wavelength is below 1e-3 m, or the slope 2 pi
///         amplitude / wavelength is beyond 1000.
#[pyclass(module = "rover_gym.core", frozen, extends = PlanarGround)]
pub struct Sine {
    inner: CoreSine,
}

#[pymethods]
impl Sine {
    #[new]
    #[pyo3(signature = (amplitude, wavelength, phase = Given::MISSING, offset = Given::MISSING),
        text_signature = "(amplitude, wavelength, phase=0.0, offset=0.0)")]
    fn new(
        amplitude: &Bound<'_, PyAny>,
        wavelength: &Bound<'_, PyAny>,
        phase: Given<'_>,
        offset: Given<'_>,
    ) -> Result<PyClassInitializer<Self>> {
        let amplitude = number(amplitude, Kind::Terrain, "amplitude")?;
        let wavelength = number(wavelength, Kind::Terrain, "wavelength")?;
        let phase = phase.number(0.0, Kind::Terrain, "phase")?;
        let offset = offset.number(0.0, Kind::Terrain, "offset")?;
        made!(CoreSine::new(amplitude, wavelength, phase, offset))
    }

    /// Amplitude, m.
    #[getter]
    fn amplitude(&self) -> f64 {
        self.inner.parameters()[0]
    }

    /// Wavelength, m.
    #[getter]
    fn wavelength(&self) -> f64 {
        self.inner.parameters()[1]
    }

    /// Phase at x = 0, rad.
    #[getter]
    fn phase(&self) -> f64 {
        self.inner.parameters()[2]
    }

    /// Mean height, m.
    #[getter]
    fn offset(&self) -> f64 {
        self.inner.parameters()[3]
    }

    fn __repr__(&self) -> String {
        let [amplitude, wavelength, phase, offset] = self.inner.parameters();
        format!(
            "Sine(amplitude={amplitude}, wavelength={wavelength}, phase={phase}, offset={offset})"
        )
    }

    fn __getnewargs__(&self) -> (f64, f64, f64, f64) {
        self.inner.parameters().into()
    }
}

/// A natural cubic spline through points: ground with continuous curvature.
///
/// Beyond the first and the last point it continues along its tangents.
///
/// Args:
///     x: Places of the points, (n,), m, increasing.
///     y: Their heights, (n,), m.
///
/// Raises:
///     TerrainError: There are fewer than two points or more than 2 000 000, the lengths differ, an
///         entry is not finite or beyond 1e6 m, or x does not increase.
#[pyclass(module = "rover_gym.core", frozen, extends = PlanarGround)]
pub struct Spline {
    inner: CoreSpline,
}

#[pymethods]
impl Spline {
    #[new]
    fn new(x: &Bound<'_, PyAny>, y: &Bound<'_, PyAny>) -> Result<PyClassInitializer<Self>> {
        let [x, y] = points(x, y)?;
        made!(CoreSpline::new(&x, &y))
    }

    /// Places of the points, (n,), m.
    #[getter]
    fn x(&self) -> Array {
        fresh(self.inner.x())
    }

    /// Heights of the points, (n,), m.
    #[getter]
    fn y(&self) -> Array {
        fresh(self.inner.y())
    }

    fn __repr__(&self) -> String {
        format!("Spline({} points)", self.inner.x().len())
    }

    fn __getnewargs__(&self) -> (Array, Array) {
        (self.x(), self.y())
    }
}

/// Straight segments between points: ground with steps, ramps and kerbs.
///
/// Two points may have the same x, for a vertical step.
///
/// Args:
///     x: Places of the points, (n,), m, not decreasing.
///     y: Their heights, (n,), m.
///
/// Raises:
///     TerrainError: There are fewer than two points or more than 2 000 000, the lengths differ, an
///         entry is not finite or beyond 1e6 m, x decreases, or a point is given twice.
#[pyclass(module = "rover_gym.core", frozen, extends = PlanarGround)]
pub struct Polyline {
    inner: CorePolyline,
}

#[pymethods]
impl Polyline {
    #[new]
    fn new(x: &Bound<'_, PyAny>, y: &Bound<'_, PyAny>) -> Result<PyClassInitializer<Self>> {
        let [x, y] = points(x, y)?;
        made!(CorePolyline::new(&x, &y))
    }

    /// Level ground at height 0 with one step.
    ///
    /// Args:
    ///     x: Place of the step, m.
    ///     height: Height of the ground beyond it, m; negative for a step down.
    ///
    /// Raises:
    ///     TerrainError: A number is not finite or beyond 1e6 m, or the step has no height.
    #[staticmethod]
    fn step(x: &Bound<'_, PyAny>, height: &Bound<'_, PyAny>) -> Result<Py<Self>> {
        let place = number(x, Kind::Terrain, "x")?;
        let height = number(height, Kind::Terrain, "height")?;
        let made: Result<PyClassInitializer<Self>> = made!(CorePolyline::step(place, height));
        Ok(Py::new(x.py(), made?)?)
    }

    /// Places of the points, (n,), m.
    #[getter]
    fn x(&self) -> Array {
        self.inner.points().iter().map(|p| p.x).collect()
    }

    /// Heights of the points, (n,), m.
    #[getter]
    fn y(&self) -> Array {
        self.inner.points().iter().map(|p| p.y).collect()
    }

    fn __repr__(&self) -> String {
        format!("Polyline({} points)", self.inner.points().len())
    }

    fn __getnewargs__(&self) -> (Array, Array) {
        (self.x(), self.y())
    }
}

/// The ground in a Python object.
pub fn parse(given: &Bound<'_, PyAny>) -> Result<Arc<dyn CoreGround>> {
    let what = "a Line, Sine, Spline or Polyline";
    let ground = object::<PlanarGround>(given, Kind::Terrain, "ground", what)?;
    Ok(ground.get().0.clone())
}
