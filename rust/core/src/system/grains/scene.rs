//! The description of a bed: grains, walls, a ground, a machine, and their friction.

use std::sync::Arc;

use nalgebra::{SVector, Vector2};

use super::bodies::{COORDINATES, Grains, noun};
use super::contact::GrainContact;
use super::error::{GrainError, check_length};
use super::grid::Grid;
use super::wall::Wall;
use crate::geometry::{Facing, Support};
use crate::law::rolling::RollingFriction;
use crate::multibody::fingerprint;
use crate::planar::PlanarTree;
use crate::quantity::{QuantityError, finite, not_negative};
use crate::spatial::space::{body_velocities, length};

/// Coulomb's μ of each kind of contact, and rolling friction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GrainFriction {
    /// Between grains. Default 0.5, the original's.
    pub grains: f64,
    /// Grains against walls and ground. Default 0.5.
    pub walls: f64,
    /// Wheels against grains, walls and ground. Default 0.9, the original's.
    pub wheels: f64,
    /// Moments between grains, and of grains on walls and ground. Default none.
    pub rolling: RollingFriction,
}

impl Default for GrainFriction {
    fn default() -> Self {
        Self {
            grains: 0.5,
            walls: 0.5,
            wheels: 0.9,
            rolling: RollingFriction::default(),
        }
    }
}

impl GrainFriction {
    /// # Errors
    /// A coefficient that is not finite or negative.
    pub fn check(&self) -> Result<(), QuantityError> {
        for (field, value) in [
            ("friction", self.grains),
            ("wall_friction", self.walls),
            ("wheel_friction", self.wheels),
        ] {
            not_negative(field, value)?;
        }
        self.rolling.check()
    }
}

/// Grains and everything among them, immutable.
#[derive(Clone, Debug)]
pub struct GrainScene<const D: usize> {
    /// The grains.
    pub grains: Grains<D>,
    /// Straight walls.
    pub walls: Vec<Wall<D>>,
    /// A ground of any shape.
    pub ground: Option<Arc<dyn Support<D>>>,
    /// A planar machine. Among balls it keeps to the plane z = 0, and its discs are balls.
    pub machine: Option<Arc<PlanarTree>>,
    /// μ.
    pub friction: GrainFriction,
}

/// Allowed overlap at the start, as a fraction of the smallest radius: the rounding of a state that
/// was written to a file.
pub const OVERLAP: f64 = 0.01;

impl<const D: usize> GrainScene<D> {
    /// Number of velocities.
    #[must_use]
    pub fn nv(&self) -> usize {
        body_velocities(D) * self.grains.len() + self.machine.as_ref().map_or(0, |m| m.nv())
    }

    /// Number of coordinates.
    #[must_use]
    pub fn nq(&self) -> usize {
        COORDINATES * self.grains.len() + self.machine.as_ref().map_or(0, |m| m.nv())
    }

    /// Coordinates of the machine among all (nq).
    #[must_use]
    pub fn machine_coordinates<'q>(&self, q: &'q [f64]) -> &'q [f64] {
        &q[COORDINATES * self.grains.len()..]
    }

    /// Velocities of the machine among all (nv).
    #[must_use]
    pub fn machine_velocities<'v>(&self, v: &'v [f64]) -> &'v [f64] {
        &v[body_velocities(D) * self.grains.len()..]
    }

    /// Centre (world, m) and radius (m) of each of the machine's wheels at a configuration (nq).
    #[must_use]
    pub fn wheels(&self, q: &[f64]) -> Vec<(SVector<f64, D>, f64)> {
        let Some(machine) = &self.machine else {
            return Vec::new();
        };
        let poses = machine.poses(self.machine_coordinates(q));
        let discs = (0..machine.n_wheels()).map(|k| machine.disc(k, &poses));
        discs
            .map(|disc| (embedded(&disc.centre), disc.radius))
            .collect()
    }

    /// No wall and no point of the ground is faster, m/s.
    #[must_use]
    pub fn fastest_surface(&self) -> f64 {
        let walls = self
            .walls
            .iter()
            .map(|wall| length(wall.velocity().as_slice()));
        let ground = self.ground.as_ref().map_or(0.0, Support::fastest);
        walls.fold(ground, f64::max)
    }

    /// Attraction of a contact, N: the pull that breaks it.
    #[must_use]
    pub fn attraction(&self, contact: &GrainContact<D>) -> f64 {
        let cohesion = self.grains.cohesion();
        cohesion.map_or(0.0, |cohesion| cohesion.at(contact.gap_start))
    }

    /// A number that is equal for two scenes only if their grains and their machine are; it ties a
    /// snapshot to its scene.
    #[must_use]
    pub fn fingerprint(&self) -> u64 {
        let grains = &self.grains;
        let numbers = grains.radius().iter().chain(grains.mass()).copied();
        let kinematic = grains.kinematic().iter().map(|k| f64::from(u8::from(*k)));
        let machine = self.machine.as_ref().map_or(0, |m| m.fingerprint());
        // The word that snapshots written so far carry.
        let kind = if D == 2 { "soil" } else { "balls" };
        let numbers = numbers
            .chain(kinematic)
            .flat_map(|x| x.to_bits().to_le_bytes());
        fingerprint(kind.bytes().chain(numbers)) ^ machine.rotate_left(1)
    }

    /// Checks the values.
    ///
    /// # Errors
    /// A friction coefficient that is not finite or negative.
    pub fn check(&self) -> Result<(), GrainError> {
        Ok(self.friction.check()?)
    }

    /// Checks a configuration (nq): finite, and nothing deeper in anything than [`OVERLAP`] of the
    /// smallest radius. Kinematic grains may overlap one another and walls.
    ///
    /// # Errors
    /// The first entry that is wrong, the first overlap.
    pub fn check_configuration(&self, q: &[f64]) -> Result<(), GrainError> {
        let n = self.grains.len();
        let (radius, kinematic) = (self.grains.radius(), self.grains.kinematic());
        check_length("position", self.nq(), q.len())?;
        self.check_finite("position", "machine", q, COORDINATES)?;
        let allowed = -OVERLAP * self.grains.smallest();
        let mut grid = Grid::<D>::default();
        grid.fill(q, radius, 2.0 * self.grains.largest());
        let mut facing = Vec::new();
        for (i, grain) in q.chunks_exact(COORDINATES).take(n).enumerate() {
            let centre = SVector::<f64, D>::from_fn(|k, _| grain[k]);
            let mut worst: Option<(usize, f64)> = None;
            grid.near(&centre.into(), 2.0 * self.grains.largest(), |item| {
                let j = item.index as usize;
                let gap = apart(&item.centre, &centre) - radius[i] - item.radius;
                let may_overlap = kinematic[i] && kinematic[j];
                if j > i && !may_overlap && gap < worst.map_or(allowed, |w| w.1) {
                    worst = Some((j, gap));
                }
            });
            if let Some((second, value)) = worst {
                return Err(GrainError::Overlap {
                    noun: noun(D),
                    first: i,
                    second,
                    value,
                });
            }
            if kinematic[i] {
                continue;
            }
            let found = self.deepest_fixed(&centre, radius[i], &mut facing);
            if let Some((what, value)) = found.filter(|(_, gap)| *gap < allowed) {
                return Err(GrainError::InWall {
                    grain: i,
                    what,
                    value,
                });
            }
        }
        for (wheel, (centre, radius)) in self.wheels(q).iter().enumerate() {
            let mut found = self.deepest_fixed(centre, *radius, &mut facing);
            let reach = radius + self.grains.largest();
            grid.near(&(*centre).into(), reach, |item| {
                let gap = apart(&item.centre, centre) - radius - item.radius;
                if gap < found.as_ref().map_or(0.0, |f| f.1) {
                    found = Some((format!("{} {}", noun(D), item.index), gap));
                }
            });
            if let Some((what, value)) = found.filter(|(_, gap)| *gap < allowed) {
                return Err(GrainError::WheelIn { wheel, what, value });
            }
        }
        Ok(())
    }

    /// Names the first entry that is not finite: of a grain, with `width`
    /// entries each, or of the machine.
    ///
    /// # Errors
    /// That entry.
    pub fn check_finite(
        &self,
        of_grain: &str,
        of_machine: &str,
        values: &[f64],
        width: usize,
    ) -> Result<(), GrainError> {
        let own = width * self.grains.len();
        if let Some(k) = values.iter().position(|x| !x.is_finite()) {
            let field = if k < own {
                format!("{of_grain}[{}]", k / width)
            } else {
                format!("{of_machine}[{}]", k - own)
            };
            finite(&field, values[k])?;
        }
        Ok(())
    }

    /// The wall, or the ground, that a round body is deepest in: its name and the gap.
    fn deepest_fixed(
        &self,
        centre: &SVector<f64, D>,
        radius: f64,
        facing: &mut Vec<Facing<D>>,
    ) -> Option<(String, f64)> {
        let walls = self.walls.iter().enumerate().map(|(k, wall)| {
            let gap = wall.distance(centre) - radius;
            (format!("wall {k}"), gap)
        });
        facing.clear();
        if let Some(ground) = &self.ground {
            ground.facing(centre, radius, facing);
        }
        let ground = facing
            .iter()
            .map(|f| ("the ground".to_owned(), f.distance - radius));
        walls.chain(ground).min_by(|(_, a), (_, b)| a.total_cmp(b))
    }
}

/// A vector of the plane among those of D dimensions.
pub(super) fn embedded<const D: usize>(x: &Vector2<f64>) -> SVector<f64, D> {
    SVector::from_fn(|k, _| if k < 2 { x[k] } else { 0.0 })
}

/// Part of a vector in the plane: x and y.
pub(super) fn flat<const D: usize>(x: &SVector<f64, D>) -> Vector2<f64> {
    Vector2::new(x[0], x[1])
}

/// Distance of two centres, m.
pub(super) fn apart<const D: usize>(a: &[f64; D], b: &SVector<f64, D>) -> f64 {
    let mut between = [0.0; D];
    for k in 0..D {
        between[k] = a[k] - b[k];
    }
    length(&between)
}
