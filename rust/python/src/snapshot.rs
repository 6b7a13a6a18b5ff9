//! `Snapshot`.

use pyo3::prelude::*;
use pyo3::types::PyBytes;
use rover_core::simulation::Snapshot as CoreSnapshot;

use crate::errors::{BorderError, Kind, Value};

/// Everything that a simulation needs to continue bit for bit; picklable.
#[pyclass(module = "rover_gym._core", frozen)]
pub struct Snapshot {
    pub inner: CoreSnapshot,
}

impl Snapshot {
    fn bytes(&self) -> PyResult<Vec<u8>> {
        postcard::to_stdvec(&self.inner).map_err(|e| damaged(&e).into())
    }
}

/// A snapshot whose bytes cannot be read.
pub fn damaged(e: &postcard::Error) -> BorderError {
    let message = format!("snapshot: its bytes are damaged ({e})");
    BorderError {
        kind: Kind::State,
        message,
        field: Some("snapshot".to_owned()),
        value: Value::Nothing,
    }
}

#[pymethods]
impl Snapshot {
    #[staticmethod]
    fn from_bytes(data: &[u8]) -> PyResult<Self> {
        Ok(Self {
            inner: postcard::from_bytes(data).map_err(|e| damaged(&e))?,
        })
    }

    fn to_bytes<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyBytes>> {
        Ok(PyBytes::new(py, &self.bytes()?))
    }

    fn __eq__(&self, other: &Bound<'_, PyAny>) -> bool {
        other
            .cast::<Self>()
            .is_ok_and(|o| o.get().inner == self.inner)
    }

    fn __hash__(&self) -> PyResult<u64> {
        use std::hash::{DefaultHasher, Hasher};
        let mut hasher = DefaultHasher::new();
        hasher.write(&self.bytes()?);
        Ok(hasher.finish())
    }

    fn __reduce__<'py>(
        slf: &Bound<'py, Self>,
    ) -> PyResult<(Bound<'py, PyAny>, (Bound<'py, PyBytes>,))> {
        let bytes = slf.get().to_bytes(slf.py())?;
        Ok((slf.get_type().getattr("from_bytes")?, (bytes,)))
    }
}
