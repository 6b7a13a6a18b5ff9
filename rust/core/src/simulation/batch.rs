//! Many rovers stepped side by side.
//!
//! Rovers share models and terrains and nothing else. They never wait for each other, and their
//! motion depends neither on the number of rovers nor on the number of threads.

use super::error::BatchError;
use super::reading::{ReadingLayout, ReadingRequest, ReadingScratch};
use super::rover::RoverSimulation;
use super::rover_controls::WheelCommands;
use super::turns::{Done, Turn, Workers};
use crate::integrator::StepError;
use crate::multibody::Model;

/// Rovers with the threads that step them.
pub struct Batch {
    rovers: Vec<RoverSimulation>,
    targets: Vec<[f64; 2]>,
    scan: Vec<[f64; 2]>,
    layout: ReadingLayout,
    errors: Vec<Option<StepError>>,
    workers: Workers,
}

impl Batch {
    /// From rovers of models of one size.
    ///
    /// `scan`: points of the height scan, see [`RoverSimulation::read`]. `threads`: None for one
    /// per core.
    ///
    /// # Errors
    /// `Empty`, `Differs`, `Threads`.
    pub fn new(
        rovers: Vec<RoverSimulation>,
        scan: Vec<[f64; 2]>,
        threads: Option<usize>,
    ) -> Result<Self, BatchError> {
        let Some(first) = rovers.first() else {
            return Err(BatchError::Empty);
        };
        let layout = ReadingLayout::new(first.model(), scan.len());
        let batch = Self {
            errors: vec![None; rovers.len()],
            targets: vec![[0.0; 2]; rovers.len()],
            workers: Workers::new(rovers.len(), threads)?,
            rovers,
            scan,
            layout,
        };
        for (index, rover) in batch.rovers.iter().enumerate() {
            batch.fits(index, rover.model())?;
        }
        Ok(batch)
    }

    fn fits(&self, index: usize, model: &Model) -> Result<(), BatchError> {
        let own = ReadingLayout::new(model, self.scan.len());
        if own == self.layout {
            return Ok(());
        }
        Err(BatchError::Differs {
            index,
            expected: self.rovers[0].model().nv(),
            actual: model.nv(),
        })
    }

    /// The rovers.
    #[must_use]
    pub fn rovers(&self) -> &[RoverSimulation] {
        &self.rovers
    }

    /// Threads that step them.
    #[must_use]
    pub fn threads(&self) -> usize {
        self.workers.count()
    }

    /// Layout of the rows of readings.
    #[must_use]
    pub fn layout(&self) -> &ReadingLayout {
        &self.layout
    }

    /// Replaces a rover by another one with its own terrain; `target` (x, z, m) is the target of
    /// its readings.
    ///
    /// # Errors
    /// `NoSuchRover`, `Differs`; nothing is changed then.
    pub fn replace(
        &mut self,
        index: usize,
        rover: RoverSimulation,
        target: [f64; 2],
    ) -> Result<(), BatchError> {
        let len = self.rovers.len();
        if index >= len {
            return Err(BatchError::NoSuchRover { index, len });
        }
        self.fits(index, rover.model())?;
        self.rovers[index] = rover;
        self.targets[index] = target;
        self.errors[index] = None;
        Ok(())
    }

    /// Gives every rover its commands, takes `n` steps and writes the readings (n_rovers × size of
    /// the layout, row-major).
    ///
    /// `torques` and `set_points`: n_rovers × n_wheels, row-major, as
    /// [`RoverSimulation::set_wheel_torques`] and [`RoverSimulation::set_steering`] take them.
    /// `active`: rovers that move; the others keep state and commands. A failed step affects only
    /// its own rover: see [`Self::errors`].
    ///
    /// # Errors
    /// `Command`: the first command that a rover refuses; `Threads`: in a process forked from the
    /// one that made the batch, its threads could not be started anew. No rover has moved then.
    ///
    /// # Panics
    /// If a slice has a wrong length.
    pub fn step(
        &mut self,
        torques: &[f64],
        set_points: &[f64],
        n: usize,
        active: Option<&[bool]>,
        rows: &mut [f64],
    ) -> Result<(), BatchError> {
        let wheels = WheelCommands::Torques(torques);
        self.step_while(wheels, set_points, n, active, rows, &mut || true)
    }

    /// Takes `n` steps as [`Self::step`] does, under torques or speeds of the wheels, but asks
    /// `go_on` from time to time; once it returns false, each rover stops after a whole step.
    ///
    /// # Errors
    /// As [`Self::step`].
    ///
    /// # Panics
    /// As [`Self::step`].
    pub fn step_while(
        &mut self,
        wheels: WheelCommands<'_>,
        set_points: &[f64],
        n: usize,
        active: Option<&[bool]>,
        rows: &mut [f64],
        go_on: &mut dyn FnMut() -> bool,
    ) -> Result<(), BatchError> {
        let width = self.layout.size();
        assert_eq!(rows.len(), self.rovers.len() * width, "one row a rover");
        if let Some(active) = active {
            assert_eq!(active.len(), self.rovers.len(), "one flag a rover");
        }
        let is_active = |index: usize| active.is_none_or(|active| active[index]);
        self.workers.pool()?;
        give_commands(&mut self.rovers, wheels, set_points, is_active)?;
        let places = rows.chunks_exact_mut(width).zip(&self.targets).enumerate();
        let mut places: Vec<_> = places
            .map(|(index, (row, target))| ReadingPlace {
                is_active: is_active(index),
                target: *target,
                row,
            })
            .collect();
        let turn = ReadingTurn { scan: &self.scan };
        let rovers = self.rovers.iter_mut().zip(&mut self.errors);
        let slots = rovers.zip(&mut places);
        self.workers.take_turns(slots, n, &turn, go_on)
    }

    /// Writes the current readings, without a step.
    ///
    /// # Panics
    /// If `rows` has a wrong length.
    pub fn read(&self, rows: &mut [f64]) {
        let width = self.layout.size();
        assert_eq!(rows.len(), self.rovers.len() * width, "one row a rover");
        let mut scratch = ReadingScratch::default();
        let rovers = self.rovers.iter().zip(&self.targets);
        for ((rover, target), row) in rovers.zip(rows.chunks_exact_mut(width)) {
            let look = ReadingRequest {
                target: *target,
                scan: &self.scan,
            };
            rover.read(&look, &mut scratch, row);
        }
    }

    /// Error of the last step of each rover.
    #[must_use]
    pub fn errors(&self) -> &[Option<StepError>] {
        &self.errors
    }
}

/// Where a rover's reading goes.
struct ReadingPlace<'a> {
    is_active: bool,
    target: [f64; 2],
    row: &'a mut [f64],
}

/// Steps and a reading; the commands have been given.
struct ReadingTurn<'a> {
    scan: &'a [[f64; 2]],
}

impl Turn<ReadingPlace<'_>> for ReadingTurn<'_> {
    fn is_moving(&self, place: &ReadingPlace<'_>) -> bool {
        place.is_active
    }

    fn begin(&self, _: &mut RoverSimulation, _: &mut ReadingPlace<'_>) {}

    fn end(
        &self,
        rover: &RoverSimulation,
        _: Done<'_>,
        place: &mut ReadingPlace<'_>,
        scratch: &mut ReadingScratch,
    ) {
        let look = ReadingRequest {
            target: place.target,
            scan: self.scan,
        };
        rover.read(&look, scratch, place.row);
    }
}

/// All commands are checked before any is applied.
fn give_commands(
    rovers: &mut [RoverSimulation],
    wheels: WheelCommands<'_>,
    set_points: &[f64],
    is_active: impl Fn(usize) -> bool,
) -> Result<(), BatchError> {
    let n_wheels = rovers[0].model().wheels().len();
    let n = rovers.len() * n_wheels;
    assert_eq!(wheels.len(), n, "one command a wheel");
    assert_eq!(set_points.len(), n, "one set-point a wheel");
    let own = |index: usize| index * n_wheels..(index + 1) * n_wheels;
    for (index, rover) in rovers.iter().enumerate() {
        if is_active(index) {
            rover
                .check_commands(wheels.of(own(index)), &set_points[own(index)])
                .map_err(|error| BatchError::Command { index, error })?;
        }
    }
    for (index, rover) in rovers.iter_mut().enumerate() {
        if is_active(index) {
            rover.take_commands(wheels.of(own(index)), &set_points[own(index)]);
        }
    }
    Ok(())
}
