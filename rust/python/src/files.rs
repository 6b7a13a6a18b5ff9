//! Files in and out; whatever goes wrong names the path.

use std::fs::File;
use std::io::{self, Read};
use std::path::{Path, PathBuf};

use pyo3::exceptions::PyOSError;
use pyo3::prelude::*;

use crate::arguments::refused;
use crate::errors::{BorderError, Kind, Value};

/// A path: a text or what `os.fspath` takes.
pub fn path(value: &Bound<'_, PyAny>, kind: Kind) -> PyResult<PathBuf> {
    let found = value.extract::<PathBuf>();
    found.map_err(|_| refused(value, kind, "path", "a path").into())
}

/// An `OSError` with number, message and path, as Python's own: the
/// subclass follows from the number.
fn os_error(py: Python<'_>, e: &io::Error, path: &Path) -> PyErr {
    match e.raw_os_error() {
        Some(code) => {
            let words = py
                .import("os")
                .and_then(|os| os.call_method1("strerror", (code,)));
            let words = words.map_or_else(|_| e.to_string(), |w| w.to_string());
            PyOSError::new_err((code, words, path.display().to_string()))
        }
        None => PyOSError::new_err(format!("{e}: {}", path.display())),
    }
}

/// The same error with the path before its message.
pub fn in_file(error: BorderError, path: &Path) -> BorderError {
    BorderError {
        message: format!("{}: {}", path.display(), error.message),
        ..error
    }
}

/// Reads a text of at most `limit` bytes.
pub fn read_text(py: Python<'_>, path: &Path, kind: Kind, limit: usize) -> PyResult<String> {
    let refuse = |message: &str| BorderError {
        kind,
        message: format!("{}: {message}", path.display()),
        field: Some("path".to_owned()),
        value: Value::Text(path.display().to_string()),
    };
    let mut bytes = Vec::new();
    let read = py.detach(|| {
        let file = File::open(path)?;
        file.take(limit as u64 + 1).read_to_end(&mut bytes)
    });
    read.map_err(|e| os_error(py, &e, path))?;
    if bytes.len() > limit {
        return Err(refuse(&format!("the file is longer than {limit} bytes")).into());
    }
    String::from_utf8(bytes).map_err(|_| refuse("the file is not UTF-8 text").into())
}

/// Writes a text.
pub fn write_text(py: Python<'_>, path: &Path, text: &str) -> PyResult<()> {
    py.detach(|| std::fs::write(path, text))
        .map_err(|e| os_error(py, &e, path))
}
