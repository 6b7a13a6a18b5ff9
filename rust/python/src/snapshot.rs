//! `Snapshot`: everything that a simulation needs to continue.

use std::hash::{DefaultHasher, Hasher};

use pyo3::prelude::*;
use pyo3::types::PyBytes;
use rover_core::simulation::sealed::{seal, unseal};
use rover_core::simulation::{
    AnySnapshot, GrainBed, PlanarScene, RoverScene, Scene, Simulation, Snapshot as SnapshotOf,
};
use serde::Serialize;
use serde::de::DeserializeOwned;

use crate::arguments;
use crate::errors::{BorderError, Kind, Result, Value};

/// A scene whose snapshots Python keeps.
pub trait KeptScene: Scene {
    fn keep(snapshot: SnapshotOf<Self>) -> AnySnapshot;
    /// The snapshot, if it is of such a scene.
    fn kept(kept: &AnySnapshot) -> Option<&SnapshotOf<Self>>;
    /// Contacts whose impulses the motion of the last step leaves open.
    fn undetermined_loads(_: &Simulation<Self>) -> usize {
        0
    }
}

macro_rules! kept_scene {
    ($scene:ty, $variant:ident $(, $more:item)?) => {
        impl KeptScene for $scene {
            fn keep(snapshot: SnapshotOf<Self>) -> AnySnapshot {
                AnySnapshot::$variant(snapshot)
            }

            fn kept(kept: &AnySnapshot) -> Option<&SnapshotOf<Self>> {
                match kept {
                    AnySnapshot::$variant(own) => Some(own),
                    _ => None,
                }
            }

            $($more)?
        }
    };
}

kept_scene!(
    RoverScene,
    Rover,
    fn undetermined_loads(rover: &Simulation<Self>) -> usize {
        rover.undetermined_loads()
    }
);
kept_scene!(
    PlanarScene,
    Planar,
    fn undetermined_loads(machine: &Simulation<Self>) -> usize {
        machine.undetermined_loads()
    }
);
kept_scene!(GrainBed<2>, Disks);
kept_scene!(GrainBed<3>, Balls);

/// Complete state of a simulation, from which it continues bit for bit. Picklable.
#[pyclass(module = "rover_gym.core", frozen)]
pub struct Snapshot(pub AnySnapshot);

/// A snapshot of another kind of simulation.
pub fn other_kind() -> BorderError {
    let message = "snapshot: is of another kind of simulation".to_owned();
    Kind::State.error("snapshot", message, Value::Nothing)
}

/// The argument `snapshot`.
pub fn snapshot<'a, 'py>(given: &'a Bound<'py, PyAny>) -> Result<&'a Bound<'py, Snapshot>> {
    arguments::object(given, Kind::State, "snapshot", "a Snapshot")
}

/// Bytes of a snapshot or an episode that cannot be read.
pub fn damaged(field: &str, reason: &impl ToString) -> BorderError {
    let message = format!("{field}: its bytes are damaged ({})", reason.to_string());
    Kind::State.error(field, message, Value::Nothing)
}

/// A value as bytes, for [`read_bytes`].
pub fn written_bytes<T: Serialize>(value: &T, field: &str) -> Result<Vec<u8>> {
    let bytes = postcard::to_stdvec(value).map_err(|e| damaged(field, &e))?;
    Ok(seal(bytes))
}

/// Reads exactly these bytes.
pub fn read_bytes<T: DeserializeOwned>(data: &Bound<'_, PyAny>, field: &str) -> Result<T> {
    let wrong = |_| arguments::refused(data, Kind::State, "data", "bytes");
    let data: &[u8] = data.extract().map_err(wrong)?;
    let data = unseal(data).map_err(|e| damaged(field, &e))?;
    match postcard::take_from_bytes(data).map_err(|e| damaged(field, &e))? {
        (kept, []) => Ok(kept),
        (_, rest) => {
            let reason = format!("{} bytes follow its end", rest.len());
            Err(damaged(field, &reason))
        }
    }
}

impl Snapshot {
    fn bytes(&self) -> Result<Vec<u8>> {
        written_bytes(&self.0, "snapshot")
    }
}

#[pymethods]
impl Snapshot {
    /// Reads a snapshot.
    ///
    /// Args:
    ///     data: Bytes from `to_bytes`.
    ///
    /// Raises:
    ///     StateError: The bytes are not a snapshot.
    #[staticmethod]
    fn from_bytes(data: &Bound<'_, PyAny>) -> Result<Self> {
        Ok(Self(read_bytes(data, "snapshot")?))
    }

    /// The snapshot as bytes, for `from_bytes`.
    fn to_bytes<'py>(&self, py: Python<'py>) -> Result<Bound<'py, PyBytes>> {
        Ok(PyBytes::new(py, &self.bytes()?))
    }

    fn __eq__(&self, other: &Bound<'_, PyAny>) -> bool {
        other.cast::<Self>().is_ok_and(|o| o.get().0 == self.0)
    }

    fn __hash__(&self) -> Result<u64> {
        let mut hasher = DefaultHasher::new();
        hasher.write(&self.bytes()?);
        Ok(hasher.finish())
    }

    fn __reduce__<'py>(
        slf: &Bound<'py, Self>,
    ) -> Result<(Bound<'py, PyAny>, (Bound<'py, PyBytes>,))> {
        let bytes = slf.get().to_bytes(slf.py())?;
        Ok((slf.get_type().getattr("from_bytes")?, (bytes,)))
    }
}
