//! Rocks of an episode: a number d in [0, 2], the difficulty, sets how hard it is.
//!
//! ```text
//!                  d from 0 to 1      d from 1 to 2
//! abundance    k   0.2 d              0.2 + 0.15 (d − 1)     fraction of the ground under rocks
//! largest rock r   (0.5 + 1.1 d) R    (1.6 + 1.4 (d − 1)²) R radius, with R the wheel radius
//! slope            0 to 10 d          0 to 10 d              degrees
//! ```
//!
//! Half of a rock is below the ground. The largest rock decides most: one of 1.6 R just reaches the
//! trunk of the built-in rover. Its square makes success fall evenly: a trained policy that reaches
//! 79% of its goals at d = 1 reaches 61, 38 and 20% at 1.25, 1.5 and 1.75. With a radius linear in
//! d it reached 45, 30 and 16%.

use super::pcg64::Pcg64;
use super::start::{Interval, Start};
use rover_core::contact::detection::wheel_contacts;
use rover_core::geometry::{Clearing, Plane, Rocks, SphereField, Terrain, TerrainError};
use rover_core::multibody::{Configuration, Kinematics, Model};

/// Abundance at the difficulties 1 and 2; landing sites on Mars have 0.03 to 0.2 (Golombek and Rapp
/// 1997).
const ABUNDANCE: [f64; 2] = [0.2, 0.35];
/// Radius of the largest rock at the difficulties 0, 1 and 2, in wheel radii.
const LARGEST_ROCK: [f64; 3] = [0.5, 1.6, 3.0];
/// Steepest slope at difficulty 1, degrees.
const SLOPE_DEG: f64 = 10.0;
/// Rocks lie up to this far beyond the rectangle that start and goals span, m.
const MARGIN: f64 = 4.0;
/// Free room that a clearing leaves around the rover, m.
const CLEARANCE: f64 = 0.1;

/// What the rocks are drawn from.
#[derive(Clone, Debug, PartialEq)]
pub struct RockDistribution {
    /// Range of the difficulty.
    pub difficulty: Interval,
    /// Abundance of rocks in place of the difficulty's.
    pub abundance: Option<f64>,
    /// Largest radius of a rock in place of the difficulty's, in wheel radii.
    pub max_radius: Option<f64>,
}

/// The rocks of an episode.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RockDraw {
    /// In [0, 2].
    pub difficulty: f64,
    /// Fraction of the ground that rocks cover.
    pub abundance: f64,
    /// Radius of the largest rocks, in wheel radii.
    pub max_radius: f64,
    /// Seed of the sizes and places, below 2⁶³.
    pub seed: u64,
}

impl RockDraw {
    /// Difficulty, abundance, radius of the largest rocks; zeros where there are none.
    #[must_use]
    pub fn row(rocks: Option<Self>) -> [f64; 3] {
        rocks.map_or([0.0; 3], |r| [r.difficulty, r.abundance, r.max_radius])
    }

    /// What [`Self::row`] tells; None of no rocks.
    #[must_use]
    pub fn from_row([difficulty, abundance, max_radius]: [f64; 3], seed: u64) -> Option<Self> {
        (max_radius > 0.0).then_some(Self {
            difficulty,
            abundance,
            max_radius,
            seed,
        })
    }
}

impl RockDistribution {
    /// Draws the rocks of an episode. `range` replaces the range of the difficulty, `fixed` the
    /// difficulty and the seed; all draws are made all the same.
    pub fn draw(
        &self,
        random: &mut Pcg64,
        range: Option<Interval>,
        fixed: (Option<f64>, Option<u64>),
    ) -> RockDraw {
        let drawn = random.uniform(range.unwrap_or(self.difficulty));
        let seed = random.below(1 << 63);
        let d = fixed.0.unwrap_or(drawn);
        RockDraw {
            difficulty: d,
            abundance: self.abundance.unwrap_or_else(|| abundance(d)),
            max_radius: self.max_radius.unwrap_or_else(|| largest_rock(d)),
            seed: fixed.1.unwrap_or(seed),
        }
    }
}

impl RockDraw {
    /// Range of the ground's slope, rad.
    #[must_use]
    pub fn slope(&self) -> Interval {
        [
            0.0,
            SLOPE_DEG * (std::f64::consts::PI / 180.0) * self.difficulty,
        ]
    }

    /// The rocks around start and goals, with a clearing at each. `radius`: of the clearing at the
    /// start, see [`clear_radius`]; the others have at least `goal_tolerance` (m).
    ///
    /// # Errors
    /// As [`SphereField::rocks`].
    pub fn lay_out(
        &self,
        model: &Model,
        start: &Start,
        ground: &Plane,
        radius: f64,
        goal_tolerance: f64,
    ) -> Result<SphereField, TerrainError> {
        SphereField::rocks(&Rocks {
            ground: *ground,
            ..self.rocks(model, start, radius, goal_tolerance)
        })
    }

    /// The rocks as in [`Self::lay_out`], on a ground of any shape, which is not part of the field;
    /// None if there is no rock.
    ///
    /// # Errors
    /// As [`SphereField::rocks_on`].
    pub fn lay_on(
        &self,
        model: &Model,
        start: &Start,
        ground: &dyn Terrain,
        radius: f64,
        goal_tolerance: f64,
    ) -> Result<Option<SphereField>, TerrainError> {
        let rocks = self.rocks(model, start, radius, goal_tolerance);
        match SphereField::rocks_on(&rocks, ground) {
            Err(TerrainError::Empty) => Ok(None),
            other => other.map(Some),
        }
    }

    fn rocks(&self, model: &Model, start: &Start, radius: f64, goal_tolerance: f64) -> Rocks {
        let [along, across] = start
            .bounds()
            .map(|[low, high]| [low - MARGIN, high + MARGIN]);
        let wheels = model.wheels().iter().map(|wheel| wheel.radius);
        let clearing = |[x, z]: [f64; 2], radius| Clearing { x, z, radius };
        Rocks {
            abundance: self.abundance,
            area: [along[1] - along[0], across[1] - across[0]],
            middle: [0.5 * (along[0] + along[1]), 0.5 * (across[0] + across[1])],
            seed: self.seed,
            max_diameter: 2.0 * self.max_radius * wheels.fold(0.0, f64::max),
            clearings: std::iter::once(clearing(start.position, radius))
                .chain(
                    start
                        .goals()
                        .map(|goal| clearing(goal, radius.max(goal_tolerance))),
                )
                .collect(),
            ..Rocks::default()
        }
    }
}

/// Abundance at difficulty `d`.
fn abundance(d: f64) -> f64 {
    let [hard, hardest] = ABUNDANCE;
    if d <= 1.0 {
        hard * d
    } else {
        hard + (hardest - hard) * (d - 1.0)
    }
}

/// Radius of the largest rock at difficulty `d`, in wheel radii.
fn largest_rock(d: f64) -> f64 {
    let [smallest, hard, hardest] = LARGEST_ROCK;
    if d <= 1.0 {
        smallest + (hard - smallest) * d
    } else {
        hard + (hardest - hard) * (d - 1.0) * (d - 1.0)
    }
}

/// Radius of a clearing in which a rover has room to turn, m: the wheels' largest reach from the
/// trunk's origin and a margin.
#[must_use]
pub fn clear_radius(model: &Model) -> f64 {
    let kinematics = Kinematics::of(model, &Configuration::zero(model));
    let wheels = wheel_contacts(model, &kinematics, &Plane::ground());
    let reach = wheels.iter().zip(model.wheels()).map(|(contact, wheel)| {
        let point = kinematics.origin(contact.body) + contact.point;
        (point.x * point.x + point.z * point.z).sqrt() + wheel.bound()
    });
    reach.fold(0.0, f64::max) + CLEARANCE
}
