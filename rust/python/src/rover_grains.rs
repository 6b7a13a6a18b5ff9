//! `RoverGrainSimulation`: a rover among balls.

use std::sync::{Arc, MutexGuard};

use pyo3::prelude::*;
use rover_core::multibody::Energy as CoreEnergy;
use rover_core::simulation::{
    AnySnapshot, GrainSimulation as Grains, RoverInGrains, RoverSimulation, TogetherError,
};

use crate::arguments::{Given, object};
use crate::arrays::Array;
use crate::balls::GrainSimulation;
use crate::errors::{BorderError, Kind, Result, Value};
use crate::report::{Energy, StepReport};
use crate::shared::{Open, Release, Shared, Watch};
use crate::simulation::Simulation;
use crate::snapshot::other_kind;
use crate::stepping::{AnySimulation, Stepped};

impl From<TogetherError> for BorderError {
    fn from(e: TogetherError) -> Self {
        let message = e.to_string();
        match e {
            TogetherError::Differs { field, grains, .. } => {
                Kind::Option.error(field, message, Value::Number(grains))
            }
            TogetherError::Overlap { depth, .. } => {
                Kind::State.error("position", message, Value::Number(depth))
            }
            TogetherError::Friction(e) => e.into(),
        }
    }
}

/// A rover and grains, stepped together with contact forces between them.
///
/// Wheels, boxes and balls of the rover touch the grains with contact and friction, solved together
/// in each step. Rover and grains keep their own simulations, which hold states, commands, contacts
/// and forces; this class only takes the steps, with the solver settings of the grains and θ = 1.
/// The walls of the grains do not stop the rover: for that, give both the same terrain.
///
/// Args:
///     rover: The simulation of the rover, with its model, terrain, friction and commands.
///     grains: The simulation of the balls, with the same time step and gravity.
///     wheel_friction: Coulomb's coefficient between the rover and grains.
///
/// Raises:
///     OptionError: The time steps or gravities differ, or the coefficient is negative or not
///         finite.
///     StateError: A part of the rover penetrates a grain.
#[pyclass(module = "rover_gym.core", extends = AnySimulation, frozen)]
pub struct RoverGrainSimulation {
    pub together: Arc<Together>,
    rover: Py<Simulation>,
    grains: Py<GrainSimulation>,
}

/// A rover, grains and the contacts between them.
pub struct Together {
    link: Shared<RoverInGrains>,
    pub rover: Arc<Shared<RoverSimulation>>,
    grains: Arc<Shared<Grains<3>>>,
}

impl Together {
    /// What acts between rover and grains, and the grains, for one call; the rover is opened apart.
    pub fn open(&self) -> Result<(MutexGuard<'_, RoverInGrains>, MutexGuard<'_, Grains<3>>)> {
        Ok((self.link.open()?, self.grains.open()?))
    }

    /// What is read of all three.
    fn read<T>(
        &self,
        read: impl FnOnce(&RoverInGrains, &RoverSimulation, &Grains<3>) -> T,
    ) -> Result<T> {
        let link = self.link.open()?;
        Ok(read(&link, &*self.rover.open()?, &*self.grains.open()?))
    }
}

impl Stepped for Together {
    fn time(&self) -> Result<f64> {
        self.grains.time()
    }

    fn time_step(&self) -> Result<f64> {
        self.grains.time_step()
    }

    fn step(&self, py: Python<'_>, n: usize) -> Result<StepReport> {
        let mut rover = self.rover.open()?;
        let (mut link, mut grains) = self.open()?;
        let (moving, mut watch) = (&mut *rover, Watch::new());
        let (link, grains) = (&mut *link, &mut *grains);
        let report = py.release(|| link.step(moving, grains, n, &mut || watch.go_on()))?;
        Ok(StepReport::new(watch.result(report)?, 0))
    }

    fn energy(&self) -> Result<Energy> {
        self.read(|_, rover, grains| {
            let (rover, grains) = (rover.energy(), grains.energy());
            let (kinetic, potential) = (
                rover.kinetic + grains.kinetic,
                rover.potential + grains.potential,
            );
            CoreEnergy { kinetic, potential }.into()
        })
    }

    fn snapshot(&self) -> Result<AnySnapshot> {
        self.read(|_, rover, grains| {
            AnySnapshot::Among(Box::new((rover.snapshot(), grains.snapshot())))
        })
    }

    fn restore(&self, kept: &AnySnapshot) -> Result<()> {
        let AnySnapshot::Among(both) = kept else {
            return Err(other_kind());
        };
        let (of_rover, of_grains) = &**both;
        let (mut rover, mut grains) = (self.rover.open()?, self.grains.open()?);
        let before = rover.snapshot();
        rover.restore(of_rover)?;
        if let Err(e) = grains.restore(of_grains) {
            rover.restore(&before)?;
            return Err(e.into());
        }
        Ok(())
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
    ) -> Result<PyClassInitializer<Self>> {
        let rover = object::<Simulation>(rover, Kind::Model, "rover", "a Simulation")?;
        let what = "a GrainSimulation";
        let grains = object::<GrainSimulation>(grains, Kind::Model, "grains", what)?;
        let friction = wheel_friction.number(0.9, Kind::Option, "wheel_friction")?;
        let (moving, bed) = (rover.get().inner.clone(), grains.get().inner.clone());
        let link = RoverInGrains::new(&*moving.open()?, &*bed.open()?, friction)?;
        let together = Arc::new(Together {
            link: Shared::new(link),
            rover: moving,
            grains: bed,
        });
        Ok(AnySimulation::base(together.clone()).add_subclass(Self {
            together,
            rover: rover.clone().unbind(),
            grains: grains.clone().unbind(),
        }))
    }

    /// The rover's simulation. Calling its own `step` moves it without the grains.
    #[getter]
    fn rover(&self, py: Python<'_>) -> Py<Simulation> {
        self.rover.clone_ref(py)
    }

    /// The grains' simulation. Calling its own `step` moves them without the rover.
    #[getter]
    fn grains(&self, py: Python<'_>) -> Py<GrainSimulation> {
        self.grains.clone_ref(py)
    }

    /// Coulomb's coefficient between the rover and grains.
    #[getter]
    fn wheel_friction(&self) -> Result<f64> {
        Ok(self.together.link.open()?.friction())
    }

    /// Gap between each wheel and the nearest grain or the terrain now, (n_wheels,), m.
    ///
    /// Positive when apart. Grains farther from a wheel than its radius are not considered.
    #[getter]
    fn wheel_gaps(&self) -> Result<Array> {
        let read = |link: &RoverInGrains, rover: &_, grains: &_| link.wheel_gaps(rover, grains);
        Ok(self.together.read(read)?.into())
    }

    /// Deepest overlap of a grain with any body now, m.
    fn penetration(&self) -> Result<f64> {
        self.together.read(RoverInGrains::penetration)
    }

    fn __repr__(slf: PyRef<'_, Self>) -> String {
        let read = |_: &_, rover: &RoverSimulation, grains: &Grains<3>| {
            let name = &rover.model().description().name;
            format!("{name:?} among {} balls", grains.description().grains.len())
        };
        let what = slf.together.read(read);
        slf.as_super().shown("RoverGrainSimulation", what)
    }
}

/// Adds the class of a rover among grains to the module.
pub fn register(module: &Bound<'_, PyModule>) -> Result<()> {
    module.add_class::<RoverGrainSimulation>()?;
    Ok(())
}
