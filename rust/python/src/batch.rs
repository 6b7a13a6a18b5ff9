//! `SimulationBatch`: many rovers stepped side by side, one call a control period.

use numpy::PyReadonlyArray1;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use rover_core::scalar::instructions::Instructions;
use rover_core::simulation::{Batch, WheelCommands};
use rover_task::draw::DrawnGround;

use crate::arguments::{self, Given, below, each, flags, refused};
use crate::arrays::{Array, shaped};
use crate::episode::{GivenSimulation, simulation};
use crate::errors::{Kind, Result};
use crate::reading::{place, scan_points, slices};
use crate::shared::{Open, Release, Shared, Watch};
use crate::simulation::Simulation;

/// Steps many rovers on several threads. Each gives the same bits as it would alone.
///
/// The batch copies the simulations. Only one call may run at a time; a second call raises
/// BusyError.
///
/// Args:
///     simulations: Simulations whose models have the same number of coordinates.
///     scan: Points of the height scan ahead and to the right of the trunk's origin in the heading
///         frame, (n, 2), m; none by default.
///     threads: Number of threads; one for each core by default.
///
/// Raises:
///     OptionError: There are no simulations or their models differ in size, `scan` has a wrong
///         shape, or `threads` is out of its range.
#[pyclass(module = "rover_gym.core", frozen)]
pub struct SimulationBatch(Shared<Inner>);

struct Inner {
    inner: Batch,
    grounds: Vec<DrawnGround>,
}

/// (n,) truth values: which rovers move.
pub fn mask(value: &Bound<'_, PyAny>, n: usize) -> Result<Vec<bool>> {
    let active = match value.extract::<PyReadonlyArray1<'_, bool>>() {
        Ok(ready) => ready.as_array().to_vec(),
        Err(_) => flags(value, Kind::Option, "active")?,
    };
    if active.len() == n {
        return Ok(active);
    }
    let what = format!("{n} booleans");
    Err(refused(value, Kind::Option, "active", &what))
}

/// (n, wheels) commands in row-major order.
fn commands(value: &Bound<'_, PyAny>, field: &'static str, shape: [usize; 2]) -> Result<Vec<f64>> {
    let what = format!("{shape:?}");
    Ok(shaped(value, Kind::Command, (field, &what), |own| own == shape)?.0)
}

#[pymethods]
impl SimulationBatch {
    #[new]
    #[pyo3(signature = (simulations, *, scan = None, threads = None))]
    fn new(
        simulations: &Bound<'_, PyAny>,
        scan: Option<&Bound<'_, PyAny>>,
        threads: Option<&Bound<'_, PyAny>>,
    ) -> Result<Self> {
        let field = "simulations";
        let given = each(
            simulations,
            Kind::Option,
            (field, field),
            |one, _, field| {
                let one = simulation(one, field)?.get();
                Ok((one.open()?.clone(), one.ground().clone()))
            },
        )?;
        let (rovers, grounds) = given.into_iter().unzip();
        let inner = Batch::new(rovers, scan_points(scan)?, arguments::threads(threads)?)?;
        Ok(Self(Shared::new(Inner { inner, grounds })))
    }

    /// Number of threads.
    #[getter]
    fn threads(&self) -> Result<usize> {
        Ok(self.0.open()?.inner.threads())
    }

    /// Instruction set of the processor, "AVX-512", "AVX2" or "baseline".
    ///
    /// The widest that the processor has, unless the environment variable `ROVER_GYM_INSTRUCTIONS`
    /// names another. Results do not depend on it.
    #[getter]
    #[allow(clippy::unused_self)] // a property in Python
    fn instruction_set(&self) -> &'static str {
        Instructions::of_this_machine().name()
    }

    /// The slice of each quantity in a row of readings; see `Simulation.reading_layout`.
    #[getter]
    fn reading_layout<'py>(&self, py: Python<'py>) -> Result<Bound<'py, PyDict>> {
        slices(py, self.0.open()?.inner.layout())
    }

    /// Sets the commands of all rovers and takes n steps.
    ///
    /// Ctrl-C ends the call after the current step of each rover. The rovers may then have taken
    /// different numbers of steps.
    ///
    /// Args:
    ///     torques: Commands for `Simulation.set_wheel_torques`, (n_rovers, n_wheels), N m; None
    ///         with `speeds`.
    ///     set_points: Commands for `Simulation.set_steering`, (n_rovers, n_wheels), rad.
    ///     n: Number of steps.
    ///     active: Which rovers move, (n_rovers,); all by default. The others do not change.
    ///     speeds: Commands for `Simulation.set_wheel_speeds` in place of the torques, (n_rovers,
    ///         n_wheels), rad/s.
    ///
    /// Returns:
    ///     A row of readings for each rover, (n_rovers, size), and a mapping from the index of each
    ///     rover whose step failed to the message of its StepError. The other rovers continue.
    ///
    /// Raises:
    ///     CommandError: An array has a wrong shape or an entry that is invalid for a rover. No
    ///         rover has moved.
    ///     OptionError: `n` or `active` is invalid, or not one of `torques` and `speeds` is given.
    #[pyo3(signature = (torques, set_points, n = Given::MISSING, *, active = None, speeds = None),
        text_signature = "($self, torques, set_points, n=1, *, active=None, speeds=None)")]
    #[allow(clippy::too_many_arguments)] // named in Python
    fn step<'py>(
        &self,
        py: Python<'py>,
        torques: Option<&Bound<'_, PyAny>>,
        set_points: &Bound<'_, PyAny>,
        n: Given<'_>,
        active: Option<&Bound<'_, PyAny>>,
        speeds: Option<&Bound<'_, PyAny>>,
    ) -> Result<(Array, Bound<'py, PyDict>)> {
        let mut held = self.0.open()?;
        let inner = &mut held.inner;
        let n_rovers = inner.rovers().len();
        let shape = [n_rovers, inner.rovers()[0].model().wheels().len()];
        let (given, is_speed) = match (torques, speeds) {
            (Some(torques), None) => (commands(torques, "torques", shape)?, false),
            (None, Some(speeds)) => (commands(speeds, "speeds", shape)?, true),
            (Some(_), Some(both)) => {
                let what = "None where torques are given";
                return Err(refused(both, Kind::Option, "speeds", what));
            }
            (None, None) => {
                let what = "given, or speeds";
                return Err(refused(py.None().bind(py), Kind::Option, "torques", what));
            }
        };
        let wheels = if is_speed {
            WheelCommands::Speeds(&given)
        } else {
            WheelCommands::Torques(&given)
        };
        let set_points = commands(set_points, "set_points", shape)?;
        let n = n.count(1, Kind::Option, "n")?;
        let active = active.map(|given| mask(given, n_rovers)).transpose()?;
        let width = inner.layout().size();
        let mut rows = vec![0.0; n_rovers * width];
        let (mut watch, active, out) = (Watch::new(), active.as_deref(), &mut rows[..]);
        let done = py.release(|| {
            inner.step_while(wheels, &set_points, n, active, out, &mut || watch.go_on())
        })?;
        watch.result(done)?;
        let errors = PyDict::new(py);
        for (index, error) in inner.errors().iter().enumerate() {
            if let Some(error) = error {
                errors.set_item(index, error.to_string())?;
            }
        }
        Ok((Array::shaped(rows, &[n_rovers, width]), errors))
    }

    /// The readings of all rovers now, (n_rovers, size).
    fn readings(&self) -> Result<Array> {
        let held = self.0.open()?;
        let shape = [held.inner.rovers().len(), held.inner.layout().size()];
        let mut rows = vec![0.0; shape[0] * shape[1]];
        held.inner.read(&mut rows);
        Ok(Array::shaped(rows, &shape))
    }

    /// Replaces a rover by a copy of a simulation, with its terrain.
    ///
    /// Args:
    ///     index: Index of the rover.
    ///     simulation: The new simulation, with the same number of coordinates.
    ///     target: Place (x, z) to which the entry `target` of its readings refers, m; the origin
    ///         by default.
    ///
    /// Raises:
    ///     OptionError: There is no such rover, or an argument is invalid. Nothing has changed.
    #[pyo3(signature = (index, simulation, target = None))]
    fn replace(
        &self,
        index: &Bound<'_, PyAny>,
        simulation: GivenSimulation<'_>,
        target: Option<&Bound<'_, PyAny>>,
    ) -> Result<()> {
        let one = simulation.0.get();
        let target = place(target)?;
        let rover = one.open()?.clone();
        let mut held = self.0.open()?;
        let index = below(index, held.inner.rovers().len())?;
        held.inner.replace(index, rover, target)?;
        held.grounds[index] = one.ground().clone();
        Ok(())
    }

    /// Returns a copy of one rover.
    ///
    /// Args:
    ///     index: Index of the rover.
    ///
    /// Raises:
    ///     OptionError: There is no such rover.
    fn simulation(&self, index: &Bound<'_, PyAny>) -> Result<Py<Simulation>> {
        let held = self.0.open()?;
        let rovers = held.inner.rovers();
        let i = below(index, rovers.len())?;
        let copy = Simulation::of(rovers[i].clone(), held.grounds[i].clone());
        Ok(Py::new(index.py(), copy)?)
    }

    fn __len__(&self) -> Result<usize> {
        Ok(self.0.open()?.inner.rovers().len())
    }

    fn __repr__(&self) -> String {
        let Ok(held) = self.0.open() else {
            return "SimulationBatch(stepping)".to_owned();
        };
        let (n, threads) = (held.inner.rovers().len(), held.inner.threads());
        format!("SimulationBatch({n} rovers, {threads} threads)")
    }
}
