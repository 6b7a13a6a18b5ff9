//! `Motor`: the torque–speed line of a wheel's motor.

use pyo3::prelude::*;
use pyo3::types::PyMapping;
use rover_core::multibody::Motor as CoreMotor;

use crate::arguments::{Given, flag, number, refused, text};
use crate::errors::{BorderError, Kind, Value};

/// What `replace(motor=...)` takes, in words.
const WHAT: &str = "a Motor, a mapping of its fields, or None";

/// The torque-speed line of a wheel's motor. Immutable.
///
/// The torque is the command, but at most `stall_torque * (1 - speed / no_load_speed)` forwards and
/// `stall_torque * (1 + speed / no_load_speed)` backwards, and at most `stall_torque` either way.
///
/// Args:
///     stall_torque: Torque of the line at rest, N m.
///     no_load_speed: Speed at which the line reaches zero, rad/s. If infinite, the torque does not
///         depend on the speed.
///     regenerating: Whether the motor brakes when it is driven faster than `no_load_speed`, along
///         the line and with at most the stall torque. Otherwise it turns freely there.
///
/// Raises:
///     ModelError: `stall_torque` is not from 1e-9 to 1e9 N m, or `no_load_speed` is neither from
///         1e-6 to 1e9 rad/s nor infinite.
#[pyclass(module = "rover_gym.mechanics", frozen, eq, from_py_object)]
#[derive(Clone, Copy, PartialEq)]
pub struct Motor {
    inner: CoreMotor,
}

impl From<CoreMotor> for Motor {
    fn from(inner: CoreMotor) -> Self {
        Self { inner }
    }
}

/// Reads what stands for a motor, or for none.
pub fn parse(given: &Bound<'_, PyAny>) -> PyResult<Option<CoreMotor>> {
    if given.is_none() {
        return Ok(None);
    }
    if let Ok(motor) = given.cast::<Motor>() {
        return Ok(Some(motor.get().inner));
    }
    let Ok(fields) = given.cast::<PyMapping>() else {
        return Err(refused(given, Kind::Model, "motor", WHAT).into());
    };
    let (mut stall_torque, mut no_load_speed, mut regenerating) = (None, None, true);
    for item in fields.items()?.iter() {
        let (name, value): (Bound<'_, PyAny>, Bound<'_, PyAny>) = item.extract()?;
        let name = text(&name, Kind::Model, "motor")?;
        let field = format!("motor.{name}");
        match name.as_str() {
            "stall_torque" => stall_torque = Some(number(&value, Kind::Model, &field)?),
            // A dictionary of the model says None, since JSON has no infinity.
            "no_load_speed" if value.is_none() => no_load_speed = Some(f64::INFINITY),
            "no_load_speed" => no_load_speed = Some(number(&value, Kind::Model, &field)?),
            "regenerating" => regenerating = flag(&value, Kind::Model, &field)?,
            _ => {
                let known = "stall_torque, no_load_speed, regenerating";
                let message = format!("{field}: unknown; known are {known}");
                return Err(wrong(field, message, Value::Object(value.unbind())).into());
            }
        }
    }
    let known = |value: Option<f64>, name| {
        value.ok_or_else(|| {
            let field = format!("motor.{name}");
            let message = format!("{field}: missing");
            wrong(field, message, Value::Nothing)
        })
    };
    let motor = CoreMotor {
        stall_torque: known(stall_torque, "stall_torque")?,
        no_load_speed: known(no_load_speed, "no_load_speed")?,
        regenerating,
    };
    (motor.check(|field| format!("motor.{field}"))).map_err(BorderError::from)?;
    Ok(Some(motor))
}

fn wrong(field: String, message: String, value: Value) -> BorderError {
    BorderError {
        kind: Kind::Model,
        message,
        field: Some(field),
        value,
    }
}

#[pymethods]
impl Motor {
    #[new]
    #[pyo3(signature = (stall_torque, no_load_speed, regenerating = Given::MISSING), text_signature = "(stall_torque, no_load_speed, regenerating=True)")]
    fn new(
        stall_torque: &Bound<'_, PyAny>,
        no_load_speed: &Bound<'_, PyAny>,
        regenerating: Given<'_>,
    ) -> PyResult<Self> {
        let inner = CoreMotor {
            stall_torque: number(stall_torque, Kind::Model, "stall_torque")?,
            no_load_speed: number(no_load_speed, Kind::Model, "no_load_speed")?,
            regenerating: regenerating.flag(true, Kind::Model, "regenerating")?,
        };
        inner.check(str::to_owned).map_err(BorderError::from)?;
        Ok(Self { inner })
    }

    /// Torque of the line at rest, N m.
    #[getter]
    fn stall_torque(&self) -> f64 {
        self.inner.stall_torque
    }

    /// Speed at which the line reaches zero, rad/s; may be infinite.
    #[getter]
    fn no_load_speed(&self) -> f64 {
        self.inner.no_load_speed
    }

    /// Whether the motor brakes when it is driven faster than `no_load_speed`.
    #[getter]
    fn regenerating(&self) -> bool {
        self.inner.regenerating
    }

    /// The torque that the motor gives under a command at a speed.
    ///
    /// Args:
    ///     command: Commanded torque, N m.
    ///     speed: Speed of the wheel in the direction of positive torque, rad/s.
    ///
    /// Returns:
    ///     The torque, N m.
    ///
    /// Raises:
    ///     CommandError: A number is not finite.
    fn torque(&self, command: &Bound<'_, PyAny>, speed: &Bound<'_, PyAny>) -> PyResult<f64> {
        let finite = |given: &Bound<'_, PyAny>, field| {
            let value = number(given, Kind::Command, field)?;
            if value.is_finite() {
                return Ok(value);
            }
            Err(PyErr::from(refused(given, Kind::Command, field, "finite")))
        };
        Ok(self
            .inner
            .torque(finite(command, "command")?, finite(speed, "speed")?))
    }

    fn __repr__(&self) -> String {
        let m = &self.inner;
        let regenerating = if m.regenerating { "True" } else { "False" };
        format!(
            "Motor(stall_torque={}, no_load_speed={}, regenerating={regenerating})",
            m.stall_torque, m.no_load_speed
        )
    }

    fn __hash__(&self) -> u64 {
        use std::hash::{DefaultHasher, Hash, Hasher};
        let mut hasher = DefaultHasher::new();
        let m = &self.inner;
        (
            m.stall_torque.to_bits(),
            m.no_load_speed.to_bits(),
            m.regenerating,
        )
            .hash(&mut hasher);
        hasher.finish()
    }

    fn __getnewargs__(&self) -> (f64, f64, bool) {
        let m = &self.inner;
        (m.stall_torque, m.no_load_speed, m.regenerating)
    }
}
