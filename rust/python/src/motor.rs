//! `Motor`: the torque–speed line of a wheel's motor.

use pyo3::prelude::*;
use pyo3::types::PyMapping;
use rover_core::multibody::Motor as CoreMotor;

use crate::arguments::{Given, Named, finite, number, refused, text};
use crate::errors::{Kind, Result, Value};

/// Names of a motor's fields.
const FIELDS: [&str; 3] = ["stall_torque", "no_load_speed", "regenerating"];

/// What `replace(motor=...)` takes, in words.
const WHAT: &str = "a Motor, a mapping of its fields, or None";

/// The torque-speed line of a wheel's motor. Immutable.
///
/// The motor gives the commanded torque, limited to `stall_torque * (1 - speed / no_load_speed)`
/// forwards and `stall_torque * (1 + speed / no_load_speed)` backwards, and at most `stall_torque`
/// either way.
///
/// Args:
///     stall_torque: Largest torque at standstill, N m.
///     no_load_speed: Speed at which the available torque reaches zero, rad/s. If infinite, the
///         limit does not depend on the speed.
///     regenerating: Whether the motor brakes when it is driven faster than `no_load_speed`,
///         following the same line up to the stall torque. Otherwise it turns freely there.
///
/// Raises:
///     ModelError: `stall_torque` is not from 1e-9 to 1e9 N m, or `no_load_speed` is neither from
///         1e-6 to 1e9 rad/s nor infinite.
#[pyclass(module = "rover_gym.core", frozen, eq, from_py_object)]
#[derive(Clone, Copy, PartialEq)]
pub struct Motor {
    inner: CoreMotor,
}

impl From<CoreMotor> for Motor {
    fn from(inner: CoreMotor) -> Self {
        Self { inner }
    }
}

/// Reads a motor, a mapping of its fields, or None.
pub fn parse(given: &Bound<'_, PyAny>) -> Result<Option<CoreMotor>> {
    if given.is_none() {
        return Ok(None);
    }
    if let Ok(motor) = given.cast::<Motor>() {
        return Ok(Some(motor.get().inner));
    }
    if given.cast::<PyMapping>().is_err() {
        return Err(refused(given, Kind::Model, "motor", WHAT));
    }
    let fields = given;
    let named = Named::mapping(fields, "motor", Kind::Model)?;
    for name in fields.try_iter()? {
        let name = text(&name?, Kind::Model, "motor")?;
        if !FIELDS.contains(&name.as_str()) {
            let field = named.path(&name);
            let message = format!("{field}: unknown; known are {}", FIELDS.join(", "));
            let value = named.get(&name)?.given().map(Bound::unbind);
            return Err(Kind::Model.error(
                field,
                message,
                value.map_or(Value::Nothing, Value::Object),
            ));
        }
    }
    let [stall_torque, no_load_speed, regenerating] = FIELDS;
    // A dictionary of the model says None for an infinite speed, since JSON has no infinity.
    let speed = |value: &Bound<'_, PyAny>, kind, field: &str| {
        if value.is_none() {
            Ok(f64::INFINITY)
        } else {
            number(value, kind, field)
        }
    };
    let motor = CoreMotor {
        stall_torque: named.need(stall_torque, number)?,
        no_load_speed: named.need(no_load_speed, speed)?,
        regenerating: named.flag(regenerating, true)?,
    };
    motor.check(|field| format!("motor.{field}"))?;
    Ok(Some(motor))
}

#[pymethods]
impl Motor {
    #[new]
    #[pyo3(signature = (stall_torque, no_load_speed, regenerating = Given::MISSING), text_signature = "(stall_torque, no_load_speed, regenerating=True)")]
    fn new(
        stall_torque: &Bound<'_, PyAny>,
        no_load_speed: &Bound<'_, PyAny>,
        regenerating: Given<'_>,
    ) -> Result<Self> {
        let inner = CoreMotor {
            stall_torque: number(stall_torque, Kind::Model, "stall_torque")?,
            no_load_speed: number(no_load_speed, Kind::Model, "no_load_speed")?,
            regenerating: regenerating.flag(true, Kind::Model, "regenerating")?,
        };
        inner.check(str::to_owned)?;
        Ok(Self { inner })
    }

    /// Largest torque at standstill, N m.
    #[getter]
    fn stall_torque(&self) -> f64 {
        self.inner.stall_torque
    }

    /// Speed at which the available torque reaches zero, rad/s; may be infinite.
    #[getter]
    fn no_load_speed(&self) -> f64 {
        self.inner.no_load_speed
    }

    /// Whether the motor brakes when it is driven faster than `no_load_speed`.
    #[getter]
    fn regenerating(&self) -> bool {
        self.inner.regenerating
    }

    /// Motor torque for a command at a speed.
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
    fn torque(&self, command: &Bound<'_, PyAny>, speed: &Bound<'_, PyAny>) -> Result<f64> {
        let command = finite(command, Kind::Command, "command")?;
        Ok(self
            .inner
            .torque(command, finite(speed, Kind::Command, "speed")?))
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
        let (torque, speed, regenerating) = self.__getnewargs__();
        (torque.to_bits(), speed.to_bits(), regenerating).hash(&mut hasher);
        hasher.finish()
    }

    fn __getnewargs__(&self) -> (f64, f64, bool) {
        let m = &self.inner;
        (m.stall_torque, m.no_load_speed, m.regenerating)
    }
}
