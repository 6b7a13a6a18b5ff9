//! The search for the bodies that may touch within a step.

use nalgebra::SVector;

use super::contact::{GrainContact, GrainKey};
use super::grid::Grid;
use crate::contact::Activation;
use crate::spatial::space::dot;

/// Gap below which a pair is a contact even if it is not forecast to close, as a fraction of the
/// smallest radius: neighbours may push it.
const SKIN: f64 = 0.01;

/// Largest such gap, as a fraction of the smallest radius: if an impact throws a grain farther in
/// one step, the step is too long.
const FARTHEST_SKIN: f64 = 0.2;

/// A grain near a round body.
#[derive(Clone, Copy, Debug)]
pub(super) struct Neighbour<const D: usize> {
    pub index: u32,
    pub gap: f64,
    /// From its centre to the body's, m.
    pub between: [f64; D],
}

/// A round body as detection sees it.
#[derive(Clone, Copy)]
pub(super) struct Seeker<const D: usize> {
    /// Number of the body in [`GrainKey::a`].
    pub a: u32,
    pub centre: SVector<f64, D>,
    pub radius: f64,
    pub velocity: SVector<f64, D>,
}

/// How far detection looks in a step.
#[derive(Clone, Copy, Debug, Default)]
pub(in crate::system) struct Search {
    /// s.
    pub lead: f64,
    /// Speed of the fastest body, rim included, m/s.
    pub fastest: f64,
    /// Gap below which a pair is a contact, m.
    pub skin: f64,
    /// Gap up to which pairs are looked at, m.
    pub reach: f64,
}

impl Search {
    /// For bodies of these radii (smallest and largest, m), the fastest of this speed.
    pub fn new(activation: &Activation, [smallest, largest]: [f64; 2], fastest: f64) -> Self {
        let lead = activation.lead.abs();
        // Bodies that the fastest grain can reach within the step are contacts too, even if they
        // are not yet approaching.
        let skin = (SKIN * smallest)
            .max(lead * fastest)
            .min(FARTHEST_SKIN * smallest)
            .max(activation.hover);
        // Two bodies approach by at most twice that; the search ends at a diameter (a longer step
        // is too long).
        let reach = (skin + 2.0 * lead * fastest).min(2.0 * largest);
        Self {
            lead,
            fastest,
            skin,
            reach,
        }
    }

    /// Whether a pair is a contact of the step.
    #[inline]
    pub fn admits(&self, gap: f64, u_N: f64) -> bool {
        gap + self.lead * u_N.min(0.0) <= self.skin
    }
}

/// Finds grains near a round body of number above `after`, in the order of their numbers.
#[inline]
pub(super) fn gather<const D: usize>(
    grid: &Grid<D>,
    seeker: &Seeker<D>,
    reach: f64,
    largest: f64,
    after: Option<u32>,
    found: &mut Vec<Neighbour<D>>,
) {
    found.clear();
    let centre: [f64; D] = seeker.centre.into();
    let radius = seeker.radius;
    grid.near(&centre, radius + largest + reach, |item| {
        if after.is_some_and(|i| item.index <= i) {
            return;
        }
        let mut between = [0.0; D];
        for k in 0..D {
            between[k] = centre[k] - item.centre[k];
        }
        let square = dot(&between, &between);
        let limit = radius + item.radius + reach;
        if square <= limit * limit {
            let distance = square.sqrt();
            found.push(Neighbour {
                index: item.index,
                gap: distance - radius - item.radius,
                between,
            });
        }
    });
    found.sort_unstable_by_key(|neighbour| neighbour.index);
}

impl<const D: usize> Seeker<D> {
    /// The contact with the body that faces it along −n.
    #[inline]
    pub fn contact(&self, b: u32, n: SVector<f64, D>, gap: f64) -> GrainContact<D> {
        GrainContact {
            key: GrainKey { a: self.a, b },
            n,
            point: self.centre - n * self.radius,
            gap,
            gap_start: gap,
        }
    }
}
