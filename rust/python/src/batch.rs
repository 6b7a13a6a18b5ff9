//! `SimulationBatch`: many rovers stepped side by side, one call a control period.

use numpy::{PyArray2, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use rover_core::simulation::{Batch, Simulation as CoreSimulation};

use crate::arrays::array;
use crate::errors::{BorderError, Kind, Value};
use crate::reading::{place, scan_points, slices};
use crate::simulation::{Origin, Simulation};

/// Many rovers stepped side by side on several threads.
#[pyclass(module = "rover_gym._core")]
pub struct SimulationBatch {
    inner: Batch,
    origins: Vec<Origin>,
}

/// (n, wheels) commands in row-major order.
fn commands(
    value: &Bound<'_, PyAny>,
    field: &'static str,
    shape: [usize; 2],
) -> PyResult<Vec<f64>> {
    if let Ok(ready) = value.extract::<PyReadonlyArray2<'_, f64>>()
        && ready.as_array().shape() == shape
    {
        return Ok(ready.as_array().iter().copied().collect());
    }
    let given = array(value, Kind::Command, field)?;
    let view = given.as_array();
    if view.shape() != shape {
        let message = format!("{field}: needs shape {shape:?}, has {:?}", view.shape());
        return Err(BorderError {
            kind: Kind::Command,
            message,
            field: Some(field.to_owned()),
            value: Value::Count(view.ndim()),
        }
        .into());
    }
    Ok(view.iter().copied().collect())
}

#[pymethods]
impl SimulationBatch {
    #[new]
    #[allow(clippy::needless_pass_by_value)] // what pyo3 hands over
    #[pyo3(signature = (simulations, *, scan = None, threads = None))]
    fn new(
        simulations: Vec<Py<Simulation>>,
        scan: Option<&Bound<'_, PyAny>>,
        threads: Option<usize>,
        py: Python<'_>,
    ) -> PyResult<Self> {
        if threads == Some(0) {
            let message = "threads: must be at least 1, is 0".to_owned();
            return Err(BorderError::option("threads", message, Value::Count(0)).into());
        }
        let rovers: Vec<CoreSimulation> = simulations
            .iter()
            .map(|simulation| simulation.borrow(py).inner.clone())
            .collect();
        let origins = simulations
            .iter()
            .map(|simulation| simulation.borrow(py).origin.clone())
            .collect();
        let inner = Batch::new(rovers, scan_points(scan)?, threads).map_err(BorderError::from)?;
        Ok(Self { inner, origins })
    }

    #[getter]
    fn threads(&self) -> usize {
        self.inner.threads()
    }

    #[getter]
    fn reading_layout<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        slices(py, self.inner.layout())
    }

    #[pyo3(signature = (torques, set_points, n = 1, *, active = None))]
    fn step<'py>(
        &mut self,
        py: Python<'py>,
        torques: &Bound<'_, PyAny>,
        set_points: &Bound<'_, PyAny>,
        n: usize,
        active: Option<PyReadonlyArray1<'_, bool>>,
    ) -> PyResult<(Bound<'py, PyArray2<f64>>, Bound<'py, PyDict>)> {
        let n_rovers = self.inner.rovers().len();
        let shape = [n_rovers, self.inner.rovers()[0].model().wheels().len()];
        let torques = commands(torques, "torques", shape)?;
        let set_points = commands(set_points, "set_points", shape)?;
        let active: Option<Vec<bool>> = active.map(|a| a.as_array().to_vec());
        if let Some(active) = active.as_ref().filter(|active| active.len() != n_rovers) {
            let message = format!("active: needs {n_rovers} entries, has {}", active.len());
            return Err(BorderError::option("active", message, Value::Count(active.len())).into());
        }
        let rows = PyArray2::zeros(py, [n_rovers, self.inner.layout().size()], false);
        {
            let mut writable = rows.readwrite();
            let out = writable.as_slice_mut()?;
            let inner = &mut self.inner;
            py.detach(|| inner.step(&torques, &set_points, n, active.as_deref(), out))
                .map_err(BorderError::from)?;
        }
        let errors = PyDict::new(py);
        for (index, error) in self.inner.errors().iter().enumerate() {
            if let Some(error) = error {
                errors.set_item(index, error.to_string())?;
            }
        }
        Ok((rows, errors))
    }

    fn readings<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let shape = [self.inner.rovers().len(), self.inner.layout().size()];
        let rows = PyArray2::zeros(py, shape, false);
        self.inner.read(rows.readwrite().as_slice_mut()?);
        Ok(rows)
    }

    #[pyo3(signature = (index, simulation, target = None))]
    fn replace(
        &mut self,
        index: usize,
        simulation: &Simulation,
        target: Option<[f64; 2]>,
    ) -> PyResult<()> {
        self.inner
            .replace(index, simulation.inner.clone(), place(target)?)
            .map_err(BorderError::from)?;
        self.origins[index] = simulation.origin.clone();
        Ok(())
    }

    /// A copy of one rover, to look at.
    fn simulation(&self, index: usize) -> PyResult<Simulation> {
        let rovers = self.inner.rovers();
        let Some(rover) = rovers.get(index) else {
            let message = format!("index: must be below {}, is {index}", rovers.len());
            return Err(BorderError::option("index", message, Value::Count(index)).into());
        };
        Ok(Simulation {
            inner: rover.clone(),
            origin: self.origins[index].clone(),
        })
    }

    fn __len__(&self) -> usize {
        self.inner.rovers().len()
    }

    fn __repr__(&self) -> String {
        let (n, threads) = (self.inner.rovers().len(), self.inner.threads());
        format!("SimulationBatch({n} rovers, {threads} threads)")
    }
}
