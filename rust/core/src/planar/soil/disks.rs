//! The disks: radii and masses, and the factors of their diagonal mass matrix.

use super::super::error::{LENGTHS, MASSES, within};
use super::error::SoilError;
use super::removal::Renumbering;

/// Most disks of a soil: some hundred megabytes.
pub const MAX_DISKS: usize = 1_000_000;

/// Refuses more disks than a soil may have, before anything is allocated for them.
pub(crate) fn check_count(count: usize) -> Result<(), SoilError> {
    if count > MAX_DISKS {
        return Err(SoilError::TooMany {
            count,
            limit: MAX_DISKS,
        });
    }
    Ok(())
}

/// Solid disks, immutable: `J = m r²/2`. Some may be kinematic: nothing changes their velocity, as grains
/// glued to a rough floor or a piston.
#[derive(Clone, Debug, PartialEq)]
pub struct Disks {
    radius: Vec<f64>,
    mass: Vec<f64>,
    /// `1/√m`.
    pub(crate) linear: Vec<f64>,
    /// `r/√J = √(2/m)`.
    pub(crate) angular: Vec<f64>,
    /// `√m`, `√J`.
    pub(crate) roots: Vec<[f64; 2]>,
    kinematic: Vec<bool>,
    largest: f64,
    smallest: f64,
}

impl Disks {
    /// `radius` (n) in m, `mass` (n) in kg.
    ///
    /// # Errors
    /// None at all, another number of masses, an entry that is not finite and positive.
    pub fn new(radius: Vec<f64>, mass: Vec<f64>) -> Result<Self, SoilError> {
        if radius.is_empty() {
            return Err(SoilError::Empty);
        }
        if mass.len() != radius.len() {
            return Err(SoilError::Length {
                field: "mass",
                expected: radius.len(),
                count: mass.len(),
            });
        }
        check_count(radius.len())?;
        for (name, values, range) in [("radius", &radius, LENGTHS), ("mass", &mass, MASSES)] {
            for (i, value) in values.iter().enumerate() {
                within(|| format!("{name}[{i}]"), *value, range)?;
            }
        }
        let roots = radius.iter().zip(&mass);
        Ok(Self {
            linear: mass.iter().map(|m| 1.0 / m.sqrt()).collect(),
            angular: mass.iter().map(|m| (2.0 / m).sqrt()).collect(),
            roots: roots
                .map(|(r, m)| [m.sqrt(), r * (0.5 * m).sqrt()])
                .collect(),
            largest: radius.iter().copied().fold(0.0, f64::max),
            smallest: radius.iter().copied().fold(f64::INFINITY, f64::min),
            kinematic: vec![false; radius.len()],
            radius,
            mass,
        })
    }

    /// The same disks, of which those marked (n) are kinematic: no weight and no contact changes their velocity.
    ///
    /// # Errors
    /// Another number of marks.
    pub fn with_kinematic(self, kinematic: Vec<bool>) -> Result<Self, SoilError> {
        if kinematic.len() != self.len() {
            return Err(SoilError::Length {
                field: "kinematic",
                expected: self.len(),
                count: kinematic.len(),
            });
        }
        Ok(Self { kinematic, ..self })
    }

    /// Those that stay.
    pub(crate) fn without(&self, renumbering: &Renumbering) -> Result<Self, SoilError> {
        let [radius, mass] = [&self.radius, &self.mass].map(|all| renumbering.keep(all, 1));
        Self::new(radius, mass)?.with_kinematic(renumbering.keep(&self.kinematic, 1))
    }

    /// Number of disks.
    #[must_use]
    pub fn len(&self) -> usize {
        self.radius.len()
    }

    /// Never: a soil has at least one disk.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.radius.is_empty()
    }

    /// Radii, m.
    #[must_use]
    pub fn radius(&self) -> &[f64] {
        &self.radius
    }

    /// Masses, kg.
    #[must_use]
    pub fn mass(&self) -> &[f64] {
        &self.mass
    }

    /// Disks whose velocity nothing changes.
    #[must_use]
    pub fn kinematic(&self) -> &[bool] {
        &self.kinematic
    }

    /// `J = m r²/2` of disk i, kg m².
    #[must_use]
    pub fn inertia(&self, i: usize) -> f64 {
        0.5 * self.mass[i] * self.radius[i] * self.radius[i]
    }

    /// Largest radius, m.
    #[must_use]
    pub fn largest(&self) -> f64 {
        self.largest
    }

    /// Smallest radius, m.
    #[must_use]
    pub fn smallest(&self) -> f64 {
        self.smallest
    }
}
