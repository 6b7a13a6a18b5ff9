//! `BedSimulation`: what beds of disks and beds of balls do alike.

use std::sync::Arc;

use pyo3::prelude::*;
use pyo3::types::PyDict;
use rover_core::problem::BodyPairs;
use rover_core::simulation::GrainSimulation;
use rover_core::solver::Swept;
use rover_core::spatial::space::body_velocities;
use rover_core::system::grains::COORDINATES;

use crate::arguments::flags;
use crate::arrays::{Array, fresh, fresh_rows};
use crate::bed_arguments::Described;
use crate::bed_options;
use crate::contacts::GrainContacts;
use crate::errors::{Kind, Result};
use crate::shared::{Open, Shared};
use crate::stepping::{AnySimulation, Stepped};

/// A bed of grains in D dimensions.
pub type SharedBed<const D: usize> = Shared<GrainSimulation<D>>;

/// Base class of beds of grains. It cannot be instantiated.
///
/// Its subclasses are `DiskSimulation` and `GrainSimulation`.
#[pyclass(module = "rover_gym.core", extends = AnySimulation, subclass, frozen)]
pub struct BedSimulation(AnyBed);

/// A bed in the plane or in space.
pub enum AnyBed {
    Disks(Arc<SharedBed<2>>),
    Balls(Arc<SharedBed<3>>),
}

impl From<Arc<SharedBed<2>>> for AnyBed {
    fn from(bed: Arc<SharedBed<2>>) -> Self {
        Self::Disks(bed)
    }
}

impl From<Arc<SharedBed<3>>> for AnyBed {
    fn from(bed: Arc<SharedBed<3>>) -> Self {
        Self::Balls(bed)
    }
}

/// Reads or changes an opened bed, whatever its dimension.
macro_rules! opened {
    ($own:expr, $bed:ident => $result:expr) => {
        match &$own.0 {
            AnyBed::Disks(bed) => {
                let $bed = &mut *bed.open()?;
                $result
            }
            AnyBed::Balls(bed) => {
                let $bed = &mut *bed.open()?;
                $result
            }
        }
    };
}

impl BedSimulation {
    /// The base of a class with this bed, and the bed.
    pub fn build<const D: usize>(
        given: Described<D>,
    ) -> Result<(PyClassInitializer<Self>, Arc<SharedBed<D>>)>
    where
        BodyPairs<D>: Swept<D>,
        SharedBed<D>: Stepped,
        AnyBed: From<Arc<SharedBed<D>>>,
    {
        let scene = Arc::new(given.scene);
        let made = GrainSimulation::new(scene, given.options, given.sleep, given.q)?;
        let inner = Arc::new(Shared::new(made));
        let base = AnySimulation::base(inner.clone()).add_subclass(Self(inner.clone().into()));
        Ok((base, inner))
    }

    /// How many grains there are, for `repr`.
    fn contents(&self) -> Result<String> {
        let noun = match self.0 {
            AnyBed::Disks(_) => "disks",
            AnyBed::Balls(_) => "balls",
        };
        opened!(self, bed => Ok(format!("{} {noun}", bed.description().grains.len())))
    }
}

/// Three columns of the grains' rows of `width` numbers, from one on, (n, 3).
pub fn columns(values: &[f64], n: usize, width: usize, from: usize) -> Array {
    let rows = values.chunks_exact(width).take(n);
    fresh_rows(rows.map(|row| [row[from], row[from + 1], row[from + 2]]))
}

/// Rates of disks, velocities of the centres of balls, (n, 3).
fn velocity<const D: usize>(bed: &GrainSimulation<D>) -> Array
where
    BodyPairs<D>: Swept<D>,
{
    let n = bed.description().grains.len();
    columns(bed.v(), n, body_velocities(D), 0)
}

/// A point of each wall now and its normal, (m, 2 D).
fn walls<const D: usize>(bed: &GrainSimulation<D>) -> Array
where
    BodyPairs<D>: Swept<D>,
{
    let (walls, now) = (&bed.description().walls, bed.time());
    let rows = walls
        .iter()
        .flat_map(|wall| [wall.n() * wall.at(now).offset(), wall.n()]);
    let numbers = rows.flat_map(<[f64; D]>::from).collect();
    Array::shaped(numbers, &[walls.len(), 2 * D])
}

/// Momentum and moment of momentum, which in the plane has one entry.
fn momentum<const D: usize>(bed: &GrainSimulation<D>) -> Array
where
    BodyPairs<D>: Swept<D>,
{
    let (linear, moment) = bed.momentum();
    let about = if D == 2 { 2 } else { 0 };
    let all: Vec<f64> = linear
        .iter()
        .chain(moment.iter().skip(about))
        .copied()
        .collect();
    fresh(&all)
}

#[pymethods]
impl BedSimulation {
    /// Radii of the grains, (n,), m.
    #[getter]
    fn radius(&self) -> Result<Array> {
        opened!(self, bed => Ok(fresh(bed.description().grains.radius())))
    }

    /// Masses of the grains, (n,), kg.
    #[getter]
    fn mass(&self) -> Result<Array> {
        opened!(self, bed => Ok(fresh(bed.description().grains.mass())))
    }

    /// Centres of balls, (n, 3), m, or centres and angles of disks, (n, 3), m and rad.
    #[getter]
    fn position(&self) -> Result<Array> {
        opened!(self, bed => {
            Ok(columns(bed.q(), bed.description().grains.len(), COORDINATES, 0))
        })
    }

    /// Velocities of the centres of balls, (n, 3), m/s, or rates of disks, (n, 3), m/s and rad/s.
    #[getter]
    fn velocity(&self) -> Result<Array> {
        opened!(self, bed => Ok(velocity(bed)))
    }

    /// Which grains have a prescribed velocity, (n,).
    #[getter]
    fn kinematic(&self) -> Result<Array<bool>> {
        opened!(self, bed => Ok(fresh(bed.description().grains.kinematic())))
    }

    /// Which grains sleep, (n,); True for grains with a prescribed velocity.
    #[getter]
    fn asleep(&self) -> Result<Array<bool>> {
        opened!(self, bed => Ok(fresh(bed.asleep())))
    }

    /// A point of each wall now and the normal to its free side, (m, 4) or (m, 6), m.
    #[getter]
    fn walls(&self) -> Result<Array> {
        opened!(self, bed => Ok(walls(bed)))
    }

    /// Options of contacts, gravity and solver, as keyword arguments.
    #[getter]
    fn settings<'py>(&self, py: Python<'py>) -> Result<Bound<'py, PyDict>> {
        opened!(self, bed => bed_options::settings(py, bed.options(), bed.description()))
    }

    /// Removes grains. The others keep their order.
    ///
    /// Args:
    ///     which: Which grains to remove, (n,) booleans.
    ///
    /// Raises:
    ///     ModelError: The number of booleans differs from that of the grains, or no grain would be
    ///         left. Nothing has changed.
    fn remove(&self, which: &Bound<'_, PyAny>) -> Result<()> {
        let which = flags(which, Kind::Model, "which")?;
        opened!(self, bed => Ok(bed.remove(&which)?))
    }

    /// The contacts of the last step.
    #[getter]
    fn contacts(&self) -> Result<GrainContacts> {
        opened!(self, bed => Ok(GrainContacts::of(bed)))
    }

    /// Momentum, kg m/s, then about the origin, kg m²/s: (3,) of disks, (6,) of balls.
    ///
    /// Grains with prescribed velocity are not included.
    fn momentum(&self) -> Result<Array> {
        opened!(self, bed => Ok(momentum(bed)))
    }

    /// Deepest overlap now, m.
    fn penetration(&self) -> Result<f64> {
        opened!(self, bed => Ok(bed.penetration()))
    }

    /// Wakes all grains.
    fn wake(&self) -> Result<()> {
        opened!(self, bed => {
            bed.wake();
            Ok(())
        })
    }

    fn __repr__(slf: &Bound<'_, Self>) -> Result<String> {
        let class = slf.get_type().name()?.to_string();
        Ok(slf.as_super().get().shown(&class, slf.get().contents()))
    }
}
