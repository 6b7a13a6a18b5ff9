//! `Line`, `Sine`, `Spline`, `Polyline`: the grounds of planar scenes.

use pyo3::prelude::*;
use pyo3::types::PyTuple;
use rover_core::planar::{
    Ground, Line as CoreLine, PlanarError, Polyline as CorePolyline, Sine as CoreSine,
    Spline as CoreSpline,
};
use rover_core::quantity::QuantityError;
use std::sync::Arc;

use crate::arguments::{Given, number, shown};
use crate::arrays::{fresh, vector};
use crate::errors::{BorderError, Kind, Value};

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
    BorderError {
        kind,
        message: e.to_string(),
        field: Some(e.field()),
        value,
    }
}

/// A number that cannot be, on its way to Python.
pub fn quantity(kind: Kind, e: &QuantityError) -> BorderError {
    BorderError {
        kind,
        message: e.to_string(),
        field: Some(e.field().to_owned()),
        value: Value::Number(e.value()),
    }
}

fn terrain<T>(made: Result<T, PlanarError>) -> Result<T, BorderError> {
    made.map_err(|e| border(Kind::Terrain, &e))
}

/// Height at one place or at many.
fn heights<'py>(ground: &dyn Ground, x: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
    let py = x.py();
    if x.len().is_err() {
        let x = number(x, Kind::Option, "x")?;
        return Ok(ground.height(x).into_pyobject(py)?.into_any());
    }
    let places = vector(x, Kind::Option, "x")?;
    let heights: Vec<f64> = places.iter().map(|x| ground.height(*x)).collect();
    Ok(fresh(py, &heights).into_any())
}

/// The ground y = slope x + offset of a planar scene: x forward, y up.
///
/// Args:
///     slope: Tangent of the inclination.
///     offset: Height at x = 0, m.
///
/// Raises:
///     TerrainError: A number is not finite, the slope is beyond 1000 or the offset beyond 1e6 m.
#[pyclass(module = "rover_gym.mechanics", frozen)]
pub struct Line {
    inner: CoreLine,
}

#[pymethods]
impl Line {
    #[new]
    #[pyo3(signature = (slope = Given::MISSING, offset = Given::MISSING), text_signature = "(slope=0.0, offset=0.0)")]
    fn new(slope: Given<'_>, offset: Given<'_>) -> PyResult<Self> {
        let slope = slope.number(0.0, Kind::Terrain, "slope")?;
        let offset = offset.number(0.0, Kind::Terrain, "offset")?;
        Ok(Self {
            inner: terrain(CoreLine::new(slope, offset))?,
        })
    }

    /// Tangent of the inclination.
    #[getter]
    fn slope(&self) -> f64 {
        self.inner.slope()
    }

    /// Height at x = 0, m.
    #[getter]
    fn offset(&self) -> f64 {
        self.inner.offset()
    }

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
    fn height<'py>(&self, x: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
        heights(&self.inner, x)
    }

    fn __repr__(&self) -> String {
        format!("Line(slope={}, offset={})", self.slope(), self.offset())
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> (Bound<'py, PyAny>, (f64, f64)) {
        let own = slf.get();
        (slf.get_type().into_any(), (own.slope(), own.offset()))
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
#[pyclass(module = "rover_gym.mechanics", frozen)]
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
    ) -> PyResult<Self> {
        let amplitude = number(amplitude, Kind::Terrain, "amplitude")?;
        let wavelength = number(wavelength, Kind::Terrain, "wavelength")?;
        let phase = phase.number(0.0, Kind::Terrain, "phase")?;
        let offset = offset.number(0.0, Kind::Terrain, "offset")?;
        Ok(Self {
            inner: terrain(CoreSine::new(amplitude, wavelength, phase, offset))?,
        })
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
    fn height<'py>(&self, x: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
        heights(&self.inner, x)
    }

    fn __repr__(&self) -> String {
        let [amplitude, wavelength, phase, offset] = self.inner.parameters();
        format!(
            "Sine(amplitude={amplitude}, wavelength={wavelength}, phase={phase}, offset={offset})"
        )
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> (Bound<'py, PyAny>, (f64, f64, f64, f64)) {
        (
            slf.get_type().into_any(),
            slf.get().inner.parameters().into(),
        )
    }
}

/// The natural cubic spline through points: a ground with continuous curvature.
///
/// It goes on along its tangents beyond the first and the last point.
///
/// Args:
///     x: Places of the points, (n,), m, increasing.
///     y: Their heights, (n,), m.
///
/// Raises:
///     TerrainError: There are fewer than two points or more than 2 000 000, the lengths differ, an
///         entry is not finite or beyond 1e6 m, or x does not increase.
#[pyclass(module = "rover_gym.mechanics", frozen)]
pub struct Spline {
    inner: CoreSpline,
}

#[pymethods]
impl Spline {
    #[new]
    fn new(x: &Bound<'_, PyAny>, y: &Bound<'_, PyAny>) -> PyResult<Self> {
        let (x, y) = (
            vector(x, Kind::Terrain, "x")?,
            vector(y, Kind::Terrain, "y")?,
        );
        Ok(Self {
            inner: terrain(CoreSpline::new(&x, &y))?,
        })
    }

    /// Places of the points, (n,), m.
    #[getter]
    fn x<'py>(&self, py: Python<'py>) -> Bound<'py, PyAny> {
        fresh(py, self.inner.x()).into_any()
    }

    /// Heights of the points, (n,), m.
    #[getter]
    fn y<'py>(&self, py: Python<'py>) -> Bound<'py, PyAny> {
        fresh(py, self.inner.y()).into_any()
    }

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
    fn height<'py>(&self, x: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
        heights(&self.inner, x)
    }

    fn __repr__(&self) -> String {
        format!("Spline({} points)", self.inner.x().len())
    }

    fn __reduce__<'py>(
        slf: &Bound<'py, Self>,
    ) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyTuple>)> {
        let (py, own) = (slf.py(), slf.get());
        let points = PyTuple::new(py, [own.x(py), own.y(py)])?;
        Ok((slf.get_type().into_any(), points))
    }
}

/// Straight pieces between points, with corners: a ground of steps, ramps and kerbs.
///
/// Two points may stand above each other.
///
/// Args:
///     x: Places of the points, (n,), m, not decreasing.
///     y: Their heights, (n,), m.
///
/// Raises:
///     TerrainError: There are fewer than two points or more than 2 000 000, the lengths differ, an
///         entry is not finite or beyond 1e6 m, x decreases, or a point is given twice.
#[pyclass(module = "rover_gym.mechanics", frozen)]
pub struct Polyline {
    inner: CorePolyline,
}

#[pymethods]
impl Polyline {
    #[new]
    fn new(x: &Bound<'_, PyAny>, y: &Bound<'_, PyAny>) -> PyResult<Self> {
        let (x, y) = (
            vector(x, Kind::Terrain, "x")?,
            vector(y, Kind::Terrain, "y")?,
        );
        Ok(Self {
            inner: terrain(CorePolyline::new(&x, &y))?,
        })
    }

    /// Level ground at height 0 with one step.
    ///
    /// Args:
    ///     x: Place of the step, m.
    ///     height: Height of the ground beyond it, m; negative for a step down.
    ///
    /// Returns:
    ///     The ground.
    ///
    /// Raises:
    ///     TerrainError: A number is not finite or beyond 1e6 m, or the step has no height.
    #[staticmethod]
    fn step(x: &Bound<'_, PyAny>, height: &Bound<'_, PyAny>) -> PyResult<Self> {
        let x = number(x, Kind::Terrain, "x")?;
        let height = number(height, Kind::Terrain, "height")?;
        Ok(Self {
            inner: terrain(CorePolyline::step(x, height))?,
        })
    }

    /// Places of the points, (n,), m.
    #[getter]
    fn x<'py>(&self, py: Python<'py>) -> Bound<'py, PyAny> {
        let x: Vec<f64> = self.inner.points().iter().map(|p| p.x).collect();
        fresh(py, &x).into_any()
    }

    /// Heights of the points, (n,), m.
    #[getter]
    fn y<'py>(&self, py: Python<'py>) -> Bound<'py, PyAny> {
        let y: Vec<f64> = self.inner.points().iter().map(|p| p.y).collect();
        fresh(py, &y).into_any()
    }

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
    fn height<'py>(&self, x: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
        heights(&self.inner, x)
    }

    fn __repr__(&self) -> String {
        format!("Polyline({} points)", self.inner.points().len())
    }

    fn __reduce__<'py>(
        slf: &Bound<'py, Self>,
    ) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyTuple>)> {
        let (py, own) = (slf.py(), slf.get());
        let points = PyTuple::new(py, [own.x(py), own.y(py)])?;
        Ok((slf.get_type().into_any(), points))
    }
}

/// The ground in a Python object.
pub fn parse(given: &Bound<'_, PyAny>) -> PyResult<Arc<dyn Ground>> {
    if let Ok(line) = given.cast::<Line>() {
        return Ok(Arc::new(line.get().inner));
    }
    if let Ok(sine) = given.cast::<Sine>() {
        return Ok(Arc::new(sine.get().inner));
    }
    if let Ok(spline) = given.cast::<Spline>() {
        return Ok(Arc::new(spline.get().inner.clone()));
    }
    if let Ok(polyline) = given.cast::<Polyline>() {
        return Ok(Arc::new(polyline.get().inner.clone()));
    }
    let shown = shown(given);
    let message = format!("ground: must be a Line, Sine, Spline or Polyline, is {shown}");
    Err(BorderError {
        kind: Kind::Terrain,
        message,
        field: Some("ground".to_owned()),
        value: Value::Text(shown),
    }
    .into())
}
