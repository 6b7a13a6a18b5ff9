//! The compiled module. A crate of its own, so that the border is compiled beside the core and not
//! after it: cargo begins a shared library only when all that it links is finished.
#![forbid(unsafe_code)]

use pyo3::prelude::*;

/// Compiled core of rover-gym: the border to the Rust mechanics (`rover-core`).
///
/// SI units and radians everywhere. World frame: x forward, y up, z to the right. Wheels are always
/// listed FL, FR, ML, BL, MR, BR. Every array returned is new.
#[pymodule]
fn _core(module: &Bound<'_, PyModule>) -> PyResult<()> {
    rover_python::add_to(module)
}
