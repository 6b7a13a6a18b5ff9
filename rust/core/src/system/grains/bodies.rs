//! The grains: radii and masses, and the factors of their diagonal mass matrix.

use super::error::{GrainError, check_length};
use super::removal::Renumbering;
use crate::law::cohesion::Cohesion;
use crate::quantity::{LENGTHS, MASSES, within};

/// Most grains: some hundred megabytes.
pub const MAX_GRAINS: usize = 1_000_000;

/// Coordinates of a grain: (x, y, angle) of a disk; the centre of a ball, which looks the same from
/// all sides. Their rates are the first of its velocities.
pub const COORDINATES: usize = 3;

/// A moment of inertia over m r²: of a solid disk, of a solid ball.
const fn share_of_inertia(dimensions: usize) -> f64 {
    if dimensions == 2 { 0.5 } else { 0.4 }
}

/// Word for a grain in messages.
pub(super) const fn noun(dimensions: usize) -> &'static str {
    if dimensions == 2 { "disk" } else { "ball" }
}

/// Refuses more grains than allowed, before any allocation.
pub(super) fn check_count<const D: usize>(count: usize) -> Result<(), GrainError> {
    if count > MAX_GRAINS {
        return Err(GrainError::TooMany {
            noun: noun(D),
            count,
            limit: MAX_GRAINS,
        });
    }
    Ok(())
}

/// Solid disks (D = 2, `J = m r²/2`) or balls (D = 3, `J = 2 m r²/5`), immutable. Some may be
/// kinematic: nothing changes their velocity, as grains glued to a rough floor or a piston.
#[derive(Clone, Debug, PartialEq)]
pub struct Grains<const D: usize> {
    radius: Vec<f64>,
    mass: Vec<f64>,
    /// `1/√m`.
    pub(super) linear: Vec<f64>,
    /// `r/√J`: `√(2/m)` of a disk, `√(5/(2m))` of a ball.
    pub(super) angular: Vec<f64>,
    /// `√m`, `√J`.
    pub(super) roots: Vec<[f64; 2]>,
    kinematic: Vec<bool>,
    cohesion: Option<Cohesion>,
    largest: f64,
    smallest: f64,
}

impl<const D: usize> Grains<D> {
    /// `radius` (n) in m, `mass` (n) in kg.
    ///
    /// # Errors
    /// No grain, a wrong number of masses, an entry that is not finite and positive.
    pub fn new(radius: Vec<f64>, mass: Vec<f64>) -> Result<Self, GrainError> {
        if radius.is_empty() {
            return Err(GrainError::Empty);
        }
        check_length("mass", radius.len(), mass.len())?;
        check_count::<D>(radius.len())?;
        for (name, values, range) in [("radius", &radius, LENGTHS), ("mass", &mass, MASSES)] {
            for (i, value) in values.iter().enumerate() {
                within(|| format!("{name}[{i}]"), *value, range)?;
            }
        }
        let share = share_of_inertia(D);
        let roots = radius.iter().zip(&mass);
        Ok(Self {
            linear: mass.iter().map(|m| 1.0 / m.sqrt()).collect(),
            angular: mass.iter().map(|m| (1.0 / share / m).sqrt()).collect(),
            roots: roots
                .map(|(r, m)| [m.sqrt(), r * (share * m).sqrt()])
                .collect(),
            largest: radius.iter().copied().fold(0.0, f64::max),
            smallest: radius.iter().copied().fold(f64::INFINITY, f64::min),
            kinematic: vec![false; radius.len()],
            cohesion: None,
            radius,
            mass,
        })
    }

    /// Makes the marked grains (n) kinematic: neither weight nor contact changes their velocity.
    ///
    /// # Errors
    /// Another number of marks.
    pub fn with_kinematic(self, kinematic: Vec<bool>) -> Result<Self, GrainError> {
        check_length("kinematic", self.len(), kinematic.len())?;
        Ok(Self { kinematic, ..self })
    }

    /// Adds cohesion: the grains attract each other and what they lie on.
    #[must_use]
    pub fn with_cohesion(self, cohesion: Cohesion) -> Self {
        let cohesion = Some(cohesion);
        Self { cohesion, ..self }
    }

    /// Grains that stay, with their new numbers.
    ///
    /// # Errors
    /// None would be left.
    pub fn without(&self, renumbering: &Renumbering) -> Result<Self, GrainError> {
        let [radius, mass] = [&self.radius, &self.mass].map(|all| renumbering.keep(all, 1));
        let kinematic = renumbering.keep(&self.kinematic, 1);
        Ok(Self {
            cohesion: self.cohesion,
            ..Self::new(radius, mass)?.with_kinematic(kinematic)?
        })
    }

    /// How many there are.
    #[must_use]
    pub fn len(&self) -> usize {
        self.radius.len()
    }

    /// Never: there is at least one.
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

    /// Whether a grain is kinematic: nothing changes its velocity.
    #[must_use]
    pub fn kinematic(&self) -> &[bool] {
        &self.kinematic
    }

    /// Their attraction, if they have one.
    #[must_use]
    pub fn cohesion(&self) -> Option<&Cohesion> {
        self.cohesion.as_ref()
    }

    /// J of grain i, kg m².
    #[must_use]
    pub fn inertia(&self, i: usize) -> f64 {
        share_of_inertia(D) * self.mass[i] * self.radius[i] * self.radius[i]
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
