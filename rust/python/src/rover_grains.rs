//! `RoverGrainSimulation`: a rover among balls.

use std::sync::MutexGuard;

use pyo3::prelude::*;
use rover_core::integrator::{StepError, StepReport as CoreReport};
use rover_core::simulation::{RoverInGrains, RoverSimulation, TogetherError};

use crate::arguments::{Given, refused};
use crate::arrays::Array;
use crate::bed_arguments::grain_error;
use crate::errors::{BorderError, Kind, Result, Value};
use crate::grains::GrainSimulation;
use crate::report::StepReport;
use crate::shared::{Shared, Watch};
use crate::simulation::Simulation;
use crate::snapshot::{RoverGrainSnapshot, belonging};

impl From<TogetherError> for BorderError {
    fn from(e: TogetherError) -> Self {
        let message = e.to_string();
        match e {
            TogetherError::Differs { field, grains, .. } => Self {
                kind: Kind::Option,
                message,
                field: Some(field.to_owned()),
                value: Value::Number(grains),
            },
            TogetherError::Overlap { depth, .. } => Self {
                kind: Kind::State,
                message,
                field: Some("position".to_owned()),
                value: Value::Number(depth),
            },
            TogetherError::Friction(e) => grain_error(&e),
        }
    }
}

/// A rover among grains in space, stepped together.
///
/// Wheels, boxes and balls of the rover meet the grains with exact contact and friction, and forces
/// go both ways within the step. The rover and the grains keep their own simulations, which have
/// their states, commands, contacts and forces; only the steps are taken here, with the solver
/// settings of the grains, θ = 1. Walls of the grains hold grains alone: what shall hold the rover
/// too is a terrain of both.
///
/// Args:
///     rover: The rover, with its model, terrain, friction and commands.
///     grains: The balls, with the same time step and gravity.
///     wheel_friction: Coulomb's coefficient between the rover and grains.
///
/// Raises:
///     OptionError: The time steps or gravities differ, or the coefficient is negative or not
///         finite.
///     StateError: A part of the rover is in a grain.
#[pyclass(module = "rover_gym.mechanics", frozen)]
pub struct RoverGrainSimulation {
    link: Shared<RoverInGrains>,
    rover: Py<Simulation>,
    grains: Py<GrainSimulation>,
}

impl RoverGrainSimulation {
    /// The rover.
    pub fn of_rover(&self) -> &Simulation {
        self.rover.get()
    }

    /// Takes n steps with both, as [`RoverInGrains::step`]; `rover` is the open simulation of
    /// [`Self::of_rover`].
    pub fn step_with(
        &self,
        rover: &mut RoverSimulation,
        n: usize,
        go_on: &mut dyn FnMut() -> bool,
    ) -> Result<Result<CoreReport, StepError>, BorderError> {
        let (mut link, mut grains) = (self.link()?, self.grains.get().open()?);
        Ok(link.step(rover, &mut grains, n, go_on))
    }

    fn link(&self) -> Result<MutexGuard<'_, RoverInGrains>, BorderError> {
        self.link.open()
    }
}

#[pymethods]
impl RoverGrainSimulation {
    #[new]
    #[pyo3(signature = (rover, grains, *, wheel_friction = Given::MISSING), text_signature = "(rover, grains, *, wheel_friction=0.9)")]
    fn new(
        rover: &Bound<'_, PyAny>,
        grains: &Bound<'_, PyAny>,
        wheel_friction: Given<'_>,
    ) -> Result<Self> {
        let rover = rover
            .cast::<Simulation>()
            .map_err(|_| refused(rover, Kind::Model, "rover", "a Simulation"))?;
        let grains = grains
            .cast::<GrainSimulation>()
            .map_err(|_| refused(grains, Kind::Model, "grains", "a GrainSimulation"))?;
        let friction = wheel_friction.number(0.9, Kind::Option, "wheel_friction")?;
        let link = RoverInGrains::new(&*rover.get().open()?, &*grains.get().open()?, friction);
        Ok(Self {
            link: Shared::new(link?),
            rover: rover.clone().unbind(),
            grains: grains.clone().unbind(),
        })
    }

    /// The rover's simulation. Its own `step` moves it without the grains.
    #[getter]
    fn rover(&self, py: Python<'_>) -> Py<Simulation> {
        self.rover.clone_ref(py)
    }

    /// The grains' simulation. Its own `step` moves them without the rover.
    #[getter]
    fn grains(&self, py: Python<'_>) -> Py<GrainSimulation> {
        self.grains.clone_ref(py)
    }

    /// Coulomb's coefficient between the rover and grains.
    #[getter]
    fn wheel_friction(&self) -> Result<f64> {
        Ok(self.link()?.friction())
    }

    /// Time of the grains, s.
    #[getter]
    fn time(&self) -> Result<f64> {
        Ok(self.grains.get().open()?.time())
    }

    /// Time step, s.
    #[getter]
    fn time_step(&self) -> Result<f64> {
        Ok(self.grains.get().open()?.options().time_step)
    }

    /// Takes n steps with both, as `Simulation.step` does.
    ///
    /// Args:
    ///     n: Number of steps.
    ///
    /// Raises:
    ///     StepError: A step could not be taken; the state before it stays.
    #[pyo3(signature = (n = Given::MISSING), text_signature = "($self, n=1)")]
    fn step(&self, py: Python<'_>, n: Given<'_>) -> Result<StepReport> {
        let steps = n.count(1, Kind::Option, "n")?;
        let mut rover = self.of_rover().open()?;
        let moving = &mut *rover;
        let mut watch = Watch::new();
        let report = py.detach(|| self.step_with(moving, steps, &mut || watch.go_on()))?;
        Ok(watch.result(report)?.into())
    }

    /// Gap of each wheel now to the nearest grain or the terrain, (n_wheels,), m.
    ///
    /// Positive when apart. A wheel without a grain within its radius has the gap to the terrain.
    #[getter]
    fn wheel_gaps(&self) -> Result<Array> {
        let link = self.link()?;
        let gaps = link.wheel_gaps(&*self.rover.get().open()?, &*self.grains.get().open()?);
        Ok(Array::from(gaps))
    }

    /// Deepest overlap now, m: of grains with anything, and of the rover with grains.
    fn penetration(&self) -> Result<f64> {
        let link = self.link()?;
        Ok(link.penetration(&*self.rover.get().open()?, &*self.grains.get().open()?))
    }

    /// Everything that is needed to continue bit for bit.
    fn snapshot(&self) -> Result<RoverGrainSnapshot> {
        let rover = self.rover.get().open()?.snapshot();
        let grains = self.grains.get().open()?.snapshot();
        Ok(RoverGrainSnapshot {
            inner: (rover, grains),
        })
    }

    /// Goes back to a snapshot.
    ///
    /// Args:
    ///     snapshot: A snapshot of the same rover among the same grains.
    ///
    /// Raises:
    ///     StateError: The snapshot belongs to another rover or other grains, or is damaged.
    ///         Nothing has changed.
    fn restore(&self, snapshot: &Bound<'_, PyAny>) -> Result<()> {
        let mut rover = self.rover.get().open()?;
        let mut grains = self.grains.get().open()?;
        let snapshot = belonging::<RoverGrainSnapshot>(snapshot, "a RoverGrainSnapshot")?;
        let (of_rover, of_grains) = &snapshot.get().inner;
        let before = rover.snapshot();
        rover.restore(of_rover)?;
        if let Err(e) = grains.restore(of_grains) {
            rover.restore(&before)?;
            return Err(BorderError::from(e));
        }
        Ok(())
    }

    fn __repr__(&self) -> String {
        let (Ok(rover), Ok(grains)) = (self.rover.get().open(), self.grains.get().open()) else {
            return "RoverGrainSimulation(stepping)".to_owned();
        };
        let name = &rover.model().description().name;
        let (n, time) = (grains.soil().grains.len(), grains.time());
        format!("RoverGrainSimulation({name:?} among {n} balls, time={time} s)")
    }
}

/// Adds the class of a rover among grains to the module.
pub fn register(module: &Bound<'_, PyModule>) -> Result<()> {
    module.add_class::<RoverGrainSimulation>()?;
    module.add_class::<RoverGrainSnapshot>()?;
    Ok(())
}
