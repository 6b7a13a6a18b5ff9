//! `Contacts`: the contacts of the last step as arrays.

use numpy::{PyArray1, PyArray2, PyArray3};
use pyo3::prelude::*;
use rover_core::contact::Part;
use rover_core::multibody::Model;
use rover_core::system::ActiveContact;

use crate::arrays::{fresh_blocks, fresh_rows};

/// The contacts of a rover's last step, as new arrays with one row a contact.
#[pyclass(module = "rover_gym._core", frozen)]
pub struct Contacts {
    active: Vec<ActiveContact>,
    bodies: Vec<String>,
}

impl Contacts {
    pub fn new(model: &Model, active: &[ActiveContact]) -> Self {
        let name = |a: &ActiveContact| match a.contact.part {
            Part::Wheel(i) => model.description().wheels[i].solid.clone(),
            Part::Box(i) => model.boxes()[i].name.clone(),
            Part::Sphere(i) => model.spheres()[i].name.clone(),
        };
        Self {
            active: active.to_vec(),
            bodies: active.iter().map(name).collect(),
        }
    }

    fn rows<'py>(
        &self,
        py: Python<'py>,
        f: impl Fn(&ActiveContact) -> [f64; 3],
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        fresh_rows(py, &self.active.iter().map(f).collect::<Vec<_>>())
    }
}

#[pymethods]
impl Contacts {
    /// Names of the solids that touch the ground.
    #[getter]
    fn bodies(&self) -> Vec<String> {
        self.bodies.clone()
    }

    /// Indices of the wheels that touch, (n,); -1 where it is another solid.
    #[getter]
    fn wheels<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<i64>> {
        let index = |a: &ActiveContact| match a.contact.part {
            Part::Wheel(i) => i64::try_from(i).unwrap_or(-1),
            Part::Box(_) | Part::Sphere(_) => -1,
        };
        PyArray1::from_iter(py, self.active.iter().map(index))
    }

    /// Contact points, world frame, (n, 3), m.
    #[getter]
    fn points<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        self.rows(py, |a| a.position.into())
    }

    /// Contact frames, world frame, (n, 3, 3).
    ///
    /// Rows are the unit vectors n (normal), t (rolling direction) and b (lateral).
    #[getter]
    fn frames<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray3<f64>>> {
        let values = self
            .active
            .iter()
            .flat_map(|a| a.contact.frame.rows().map(<[f64; 3]>::from))
            .flatten()
            .collect();
        fresh_blocks(py, values, [self.active.len(), 3, 3])
    }

    /// Gaps, (n,), m, at the configuration where the step evaluated the contacts.
    #[getter]
    fn gaps<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_iter(py, self.active.iter().map(|a| a.contact.gap))
    }

    /// Impulses of the step along n, t, b, (n, 3), N s.
    #[getter]
    fn impulses<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        self.rows(py, |a| a.impulse)
    }

    /// Relative velocities after the step along n, t, b, (n, 3), m/s.
    #[getter]
    fn velocities<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        self.rows(py, |a| a.velocity)
    }

    fn __len__(&self) -> usize {
        self.active.len()
    }

    fn __repr__(&self) -> String {
        format!("Contacts({})", self.bodies.join(", "))
    }
}
