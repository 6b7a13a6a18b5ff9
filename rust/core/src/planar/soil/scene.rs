//! What there is: disks, walls, a ground, a machine, and how rough they are.

use std::sync::Arc;

use nalgebra::SVector;

use super::super::error::{PlanarError, finite};
use super::super::ground::Ground;
use super::super::machine::{PlanarMachine, fingerprint};
use super::disks::Disks;
use super::error::SoilError;
use super::grid::Grid;
use super::wall::Wall;

/// Whatever drives on a soil: five coordinates, wheels that are discs.
pub type Machine = dyn PlanarMachine<5>;

/// Coulomb's μ of each kind of contact.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SoilFriction {
    /// Between disks. Default 0.5, the original's.
    pub disks: f64,
    /// Disks against walls and ground. Default 0.5.
    pub walls: f64,
    /// Wheels against disks, walls and ground. Default 0.9, the original's.
    pub wheels: f64,
}

impl Default for SoilFriction {
    fn default() -> Self {
        Self {
            disks: 0.5,
            walls: 0.5,
            wheels: 0.9,
        }
    }
}

impl SoilFriction {
    /// # Errors
    /// A coefficient that is not finite or negative.
    fn check(&self) -> Result<(), PlanarError> {
        for (field, value) in [
            ("friction", self.disks),
            ("wall_friction", self.walls),
            ("wheel_friction", self.wheels),
        ] {
            if finite(field, value)? < 0.0 {
                return Err(PlanarError::Negative {
                    field: field.to_owned(),
                    value,
                });
            }
        }
        Ok(())
    }
}

/// A soil's description, immutable.
#[derive(Clone, Debug)]
pub struct SoilScene {
    /// The disks.
    pub disks: Disks,
    /// Straight walls.
    pub walls: Vec<Wall>,
    /// A ground of any shape.
    pub ground: Option<Arc<dyn Ground>>,
    /// What drives.
    pub machine: Option<Arc<Machine>>,
    /// μ.
    pub friction: SoilFriction,
}

/// How far bodies may overlap at the start, as a share of the smallest radius: rounding of a state that was written to a file.
pub const OVERLAP: f64 = 0.01;

impl SoilScene {
    /// Number of velocities.
    #[must_use]
    pub fn nv(&self) -> usize {
        3 * self.disks.len() + if self.machine.is_some() { 5 } else { 0 }
    }

    /// A number that two scenes share only if their disks and their machine do: what a snapshot belongs to.
    #[must_use]
    pub fn fingerprint(&self) -> u64 {
        let disks = &self.disks;
        let numbers = disks.radius().iter().chain(disks.mass()).copied();
        let kinematic = disks.kinematic().iter().map(|k| f64::from(u8::from(*k)));
        let machine = self.machine.as_ref().map_or(0, |m| m.fingerprint());
        fingerprint("soil", numbers.chain(kinematic)) ^ machine.rotate_left(1)
    }

    /// Checks what the types do not.
    ///
    /// # Errors
    /// A friction coefficient that is not finite or negative.
    pub fn check(&self) -> Result<(), SoilError> {
        Ok(self.friction.check()?)
    }

    /// Checks a configuration (nv): finite, and nothing deeper in anything than [`OVERLAP`] of the smallest radius. Kinematic disks may
    /// overlap one another and walls.
    ///
    /// # Errors
    /// The first entry that is wrong, the first overlap.
    pub fn check_configuration(&self, q: &[f64]) -> Result<(), SoilError> {
        let n = self.disks.len();
        let (radius, kinematic) = (self.disks.radius(), self.disks.kinematic());
        if q.len() != self.nv() {
            return Err(SoilError::Length {
                field: "position",
                expected: self.nv(),
                count: q.len(),
            });
        }
        for (k, value) in q.iter().enumerate() {
            if !value.is_finite() {
                let field = if k < 3 * n {
                    format!("position[{}]", k / 3)
                } else {
                    format!("machine[{}]", k - 3 * n)
                };
                finite(&field, *value)?;
            }
        }
        let allowed = -OVERLAP * self.disks.smallest();
        let mut grid = Grid::default();
        grid.fill(q, radius, 2.0 * self.disks.largest());
        let mut facing = Vec::new();
        for (i, disk) in q.chunks_exact(3).take(n).enumerate() {
            let mut worst: Option<(usize, f64)> = None;
            grid.near(disk[0], disk[1], 2.0 * self.disks.largest(), |item| {
                let j = item.index as usize;
                let gap = (item.x - disk[0]).hypot(item.y - disk[1]) - radius[i] - item.radius;
                let may_overlap = kinematic[i] && kinematic[j];
                if j > i && !may_overlap && gap < worst.map_or(allowed, |w| w.1) {
                    worst = Some((j, gap));
                }
            });
            if let Some((second, value)) = worst {
                return Err(SoilError::Overlap {
                    first: i,
                    second,
                    value,
                });
            }
            if kinematic[i] {
                continue;
            }
            let found = self.deepest_fixed([disk[0], disk[1]], radius[i], &mut facing);
            if let Some((what, value)) = found.filter(|(_, gap)| *gap < allowed) {
                return Err(SoilError::InWall {
                    disk: i,
                    what,
                    value,
                });
            }
        }
        let Some(machine) = &self.machine else {
            return Ok(());
        };
        let pose = SVector::<f64, 5>::from_column_slice(&q[3 * n..]);
        for wheel in 0..machine.n_discs() {
            let disc = machine.disc(wheel, &pose);
            let mut found = self.deepest_fixed(disc.centre.into(), disc.radius, &mut facing);
            let reach = disc.radius + self.disks.largest();
            grid.near(disc.centre.x, disc.centre.y, reach, |item| {
                let apart = (item.x - disc.centre.x).hypot(item.y - disc.centre.y);
                let gap = apart - disc.radius - item.radius;
                if gap < found.as_ref().map_or(0.0, |f| f.1) {
                    found = Some((format!("disk {}", item.index), gap));
                }
            });
            if let Some((what, value)) = found.filter(|(_, gap)| *gap < allowed) {
                return Err(SoilError::WheelIn { wheel, what, value });
            }
        }
        Ok(())
    }

    /// The wall, or the ground, that a disc is deepest in: its name and the gap.
    fn deepest_fixed(
        &self,
        centre: [f64; 2],
        radius: f64,
        facing: &mut Vec<super::super::ground::Facing>,
    ) -> Option<(String, f64)> {
        let walls = self.walls.iter().enumerate().map(|(k, wall)| {
            let gap = wall.distance(centre[0], centre[1]) - radius;
            (format!("wall {k}"), gap)
        });
        facing.clear();
        if let Some(ground) = &self.ground {
            ground.facing(&centre.into(), radius, facing);
        }
        let ground = facing
            .iter()
            .map(|f| ("the ground".to_owned(), f.distance - radius));
        walls.chain(ground).min_by(|(_, a), (_, b)| a.total_cmp(b))
    }
}
