//! `Snapshot`, `PlanarSnapshot`, `SoilSnapshot`, `GrainSnapshot`, `RoverGrainSnapshot`.

use pyo3::PyTypeInfo;
use pyo3::prelude::*;
use pyo3::types::PyBytes;
use rover_core::simulation::{GrainBed, PlanarScene, RoverScene, Snapshot as SnapshotOf};
use serde::de::DeserializeOwned;

use crate::arguments;
use crate::errors::{BorderError, Kind, Result, Value};

/// A snapshot of the class that a simulation takes. `what`: the class with its article.
pub fn belonging<'a, 'py, T: PyTypeInfo>(
    given: &'a Bound<'py, PyAny>,
    what: &str,
) -> Result<&'a Bound<'py, T>, BorderError> {
    let found = given.cast::<T>();
    found.map_err(|_| arguments::refused(given, Kind::State, "snapshot", what))
}

/// Reads a snapshot from exactly these bytes.
fn read<T: DeserializeOwned>(data: &Bound<'_, PyAny>) -> Result<T, BorderError> {
    let data: &[u8] = data
        .extract()
        .map_err(|_| arguments::refused(data, Kind::State, "data", "bytes"))?;
    let (snapshot, rest) = postcard::take_from_bytes(data).map_err(|e| damaged(&e))?;
    if rest.is_empty() {
        return Ok(snapshot);
    }
    Err(refused(&format!("{} bytes follow its end", rest.len())))
}

/// A snapshot whose bytes cannot be read.
fn damaged(e: &postcard::Error) -> BorderError {
    refused(&e.to_string())
}

fn refused(reason: &str) -> BorderError {
    let message = format!("snapshot: its bytes are damaged ({reason})");
    Kind::State.error("snapshot", message, Value::Nothing)
}

/// A class of snapshots: all of them are read, written, compared and pickled alike.
macro_rules! snapshot_class {
    ($(#[doc = $doc:literal])* $class:ident, $inner:ty) => {
        $(#[doc = $doc])*
        #[pyclass(module = "rover_gym.mechanics", frozen)]
        pub struct $class {
            pub inner: $inner,
        }

        #[pymethods]
        impl $class {
            /// Reads a snapshot.
            ///
            /// Args:
            ///     data: What `to_bytes` returned.
            ///
            /// Raises:
            ///     StateError: The bytes are not those of a snapshot.
            #[staticmethod]
            fn from_bytes(data: &Bound<'_, PyAny>) -> Result<Self> {
                Ok(Self { inner: read(data)? })
            }

            /// The snapshot as bytes, as `from_bytes` reads them.
            fn to_bytes<'py>(&self, py: Python<'py>) -> Result<Bound<'py, PyBytes>> {
                let bytes = postcard::to_stdvec(&self.inner).map_err(|e| damaged(&e))?;
                Ok(PyBytes::new(py, &bytes))
            }

            fn __eq__(&self, other: &Bound<'_, PyAny>) -> bool {
                let other = other.cast::<Self>();
                other.is_ok_and(|o| o.get().inner == self.inner)
            }

            fn __hash__(&self) -> Result<u64> {
                use std::hash::{DefaultHasher, Hasher};
                let mut hasher = DefaultHasher::new();
                hasher.write(&postcard::to_stdvec(&self.inner).map_err(|e| damaged(&e))?);
                Ok(hasher.finish())
            }

            fn __reduce__<'py>(
                slf: &Bound<'py, Self>,
            ) -> Result<(Bound<'py, PyAny>, (Bound<'py, PyBytes>,))> {
                let bytes = slf.get().to_bytes(slf.py())?;
                Ok((slf.get_type().getattr("from_bytes")?, (bytes,)))
            }
        }
    };
}

snapshot_class! {
    /// Everything that a simulation needs to continue bit for bit. Picklable.
    Snapshot, SnapshotOf<RoverScene>
}

snapshot_class! {
    /// Everything that a planar simulation needs to continue bit for bit. Picklable.
    PlanarSnapshot, SnapshotOf<PlanarScene>
}

snapshot_class! {
    /// Everything that a soil needs to continue bit for bit. Picklable.
    SoilSnapshot, SnapshotOf<GrainBed<2>>
}

snapshot_class! {
    /// Everything that grains in space need to continue bit for bit. Picklable.
    GrainSnapshot, SnapshotOf<GrainBed<3>>
}

snapshot_class! {
    /// Everything that a rover among grains needs to continue bit for bit. Picklable.
    RoverGrainSnapshot, (SnapshotOf<RoverScene>, SnapshotOf<GrainBed<3>>)
}
