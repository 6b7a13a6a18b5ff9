//! A wheel as sand meets it: a drum between two side walls, with rounded edges and grousers.
//!
//! Every part of it is a ring about the axle: a strip of the drum, a chamfer in place of a rounded
//! edge, a ring of a side wall. Of a ring in a plane bed, the arc under the surface is known in
//! closed form, and the integral over it is Gauss's: the points move with the arc, so the force is
//! continuous in the pose.
//!
//! Sand is held between grousers. Where they stand closer than three times their height the wheel
//! works as a drum of the radius of their tips, with the friction of sand on sand.

use crate::multibody::Wheel;
use crate::scalar::MAX_LANES;
use crate::scalar::elementary::sin_cos;

/// Length of rim over which a grouser holds sand, in heights of the grouser. Estimated from the
/// wedge of passive earth pressure in front of a plate, `h tan(π/4 + φ/2)`, on both of its sides.
const HOLD: f64 = 3.0;

/// Geometry of a wheel in sand.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SandWheel {
    /// Radius without grousers, m.
    pub radius: f64,
    /// Width with the rounded edges, m.
    pub width: f64,
    /// Radius of the edges, m.
    pub rounding: f64,
    /// Height of the grousers, m.
    pub grouser_height: f64,
    /// Number of grousers.
    pub grousers: u32,
}

impl SandWheel {
    /// Of a wheel of a model.
    #[must_use]
    pub fn of(wheel: &Wheel) -> Self {
        Self {
            radius: wheel.radius,
            width: wheel.width,
            rounding: wheel.rounding,
            grouser_height: wheel.grouser_height,
            grousers: wheel.grousers,
        }
    }

    /// Part of the rim at which grousers hold sand.
    #[must_use]
    pub fn held(&self) -> f64 {
        let rim = std::f64::consts::TAU * self.radius;
        (f64::from(self.grousers) * HOLD * self.grouser_height / rim).min(1.0)
    }

    /// Radius of the drum with the sand that it holds, m.
    #[must_use]
    pub fn drum(&self) -> f64 {
        self.radius + self.held() * self.grouser_height
    }
}

/// A surface of a wheel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Skin {
    /// Drum and edges.
    Rim,
    /// Side walls.
    Wall,
}

/// A ring about the axle.
#[derive(Clone, Copy, Debug)]
pub struct Ring {
    /// Along the axle from the wheel's centre, m.
    pub offset: f64,
    /// m.
    pub radius: f64,
    /// Components of the outward normal along the radius and along the axle.
    pub normal: [f64; 2],
    /// Across the ring, m.
    pub width: f64,
    /// What it is part of.
    pub skin: Skin,
}

/// Most points of a Gauss rule.
pub const MOST_POINTS: usize = 24;

/// Gauss–Legendre rule on (−1, 1).
#[derive(Clone, Debug, PartialEq)]
pub struct Gauss {
    /// Of its points.
    pub places: Vec<f64>,
    /// Of its points.
    pub weights: Vec<f64>,
}

impl Gauss {
    /// With `n` points.
    #[must_use]
    pub fn new(n: usize) -> Self {
        let n = n.clamp(1, MOST_POINTS);
        let points = (0..n).map(|i| {
            let guess = std::f64::consts::PI * (i as f64 + 0.75) / (n as f64 + 0.5);
            let (_, mut x) = sin_cos(guess);
            let mut slope = 1.0;
            for _ in 0..8 {
                let (mut p, mut before) = (x, 1.0);
                for k in 2..=n {
                    let k = k as f64;
                    (p, before) = (((2.0 * k - 1.0) * x * p - (k - 1.0) * before) / k, p);
                }
                slope = n as f64 * (x * p - before) / (x * x - 1.0);
                x -= p / slope;
            }
            (x, 2.0 / ((1.0 - x * x) * slope * slope))
        });
        let (places, weights) = points.unzip();
        Self { places, weights }
    }
}

/// Gauss rules of a wheel.
#[derive(Clone, Debug, PartialEq)]
pub struct Rules {
    /// Along an arc of the drum.
    pub arc: Gauss,
    /// Along an arc of an edge or of a side wall.
    pub side_arc: Gauss,
    /// Across the drum.
    pub across: Gauss,
    /// Along the radius of a side wall.
    pub radial: Gauss,
}

impl Rules {
    /// With these numbers of points. Those of arcs lie side by side in lanes, [`MAX_LANES`] at a
    /// time: of one arc, or half of them of each of the two sides. Their number is rounded up.
    #[must_use]
    pub fn new([arc, across, radial]: [usize; 3]) -> Self {
        let whole = arc.max(1).next_multiple_of(MAX_LANES);
        let side = if arc <= MAX_LANES / 2 {
            MAX_LANES / 2
        } else {
            whole
        };
        Self {
            arc: Gauss::new(whole),
            side_arc: Gauss::new(side),
            across: Gauss::new(across),
            radial: Gauss::new(radial),
        }
    }

    /// Points of a wheel.
    #[must_use]
    pub fn n_points(&self) -> usize {
        let [arc, side, across, radial] =
            [&self.arc, &self.side_arc, &self.across, &self.radial].map(|rule| rule.places.len());
        arc * across + 2 * side * radial
    }

    /// Rings of the drum.
    #[must_use]
    pub fn n_strips(&self) -> usize {
        self.across.places.len()
    }

    /// Rings of a side, with those that are empty: the edge, and then the wall.
    #[must_use]
    pub fn n_of_a_side(&self) -> usize {
        1 + self.radial.places.len()
    }

    /// A ring of the drum; none if it is empty.
    #[inline]
    #[must_use]
    pub fn strip(&self, wheel: &SandWheel, index: usize) -> Option<Ring> {
        let flat = 0.5 * wheel.width - wheel.rounding;
        (flat > 0.0).then(|| Ring {
            offset: self.across.places[index] * flat,
            radius: wheel.drum(),
            normal: [1.0, 0.0],
            width: self.across.weights[index] * flat,
            skin: Skin::Rim,
        })
    }

    /// A ring of the right side, of which a part may be under the surface: `dry` is the radius (m)
    /// from which on the wall may be. None if the ring is empty.
    #[inline]
    #[must_use]
    pub fn side(&self, wheel: &SandWheel, dry: f64, index: usize) -> Option<Ring> {
        let (half, edge) = (0.5 * wheel.width, wheel.rounding);
        let inner = wheel.drum() - edge;
        let diagonal = std::f64::consts::FRAC_1_SQRT_2;
        if index == 0 {
            return (edge > 0.0).then_some(Ring {
                offset: half - edge + diagonal * edge,
                radius: inner + diagonal * edge,
                normal: [diagonal, diagonal],
                width: std::f64::consts::FRAC_PI_2 * edge,
                skin: Skin::Rim,
            });
        }
        let depth = 0.5 * (inner - dry.max(0.0));
        let point = index - 1;
        (depth > 0.0).then(|| Ring {
            offset: half,
            radius: inner - depth * (1.0 - self.radial.places[point]),
            normal: [0.0, 1.0],
            width: self.radial.weights[point] * depth,
            skin: Skin::Wall,
        })
    }
}

impl Ring {
    /// The ring on the other side.
    #[must_use]
    pub fn mirrored(&self) -> Self {
        Self {
            offset: -self.offset,
            normal: [self.normal[0], -self.normal[1]],
            ..*self
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A rule of n points integrates polynomials up to the degree 2n − 1.
    #[test]
    fn gauss_rules_are_exact_for_polynomials() {
        for n in [1_usize, 2, 5, 12, 24] {
            let rule = Gauss::new(n);
            for degree in 0..2 * n {
                let power = i32::try_from(degree).unwrap();
                let sum: f64 = (rule.places.iter().zip(&rule.weights))
                    .map(|(x, w)| w * x.powi(power))
                    .sum();
                let exact = if degree % 2 == 0 {
                    2.0 / (f64::from(power) + 1.0)
                } else {
                    0.0
                };
                assert!((sum - exact).abs() < 1e-13, "{n} {degree}: {sum}");
            }
        }
    }

    #[test]
    fn the_rings_cover_the_surface_of_a_wheel() {
        let wheel = SandWheel {
            radius: 0.1,
            width: 0.06,
            rounding: 0.0,
            grouser_height: 0.0,
            grousers: 0,
        };
        let mut area = [0.0; 2];
        let rules = Rules::new([4, 2, 3]);
        let strips = (0..rules.n_strips()).filter_map(|k| rules.strip(&wheel, k));
        let sides = (0..rules.n_of_a_side()).filter_map(|k| rules.side(&wheel, 0.0, k));
        for ring in strips.chain(sides.flat_map(|ring| [ring, ring.mirrored()])) {
            let of_ring = std::f64::consts::TAU * ring.radius * ring.width;
            area[usize::from(ring.skin == Skin::Wall)] += of_ring;
        }
        let exact = std::f64::consts::TAU * 0.1 * 0.06;
        assert!((area[0] - exact).abs() < 1e-12);
        assert!((area[1] - std::f64::consts::TAU * 0.1 * 0.1).abs() < 1e-12);
    }

    #[test]
    fn grousers_that_stand_close_make_a_drum_of_their_tips() {
        let mut wheel = SandWheel {
            radius: 0.1,
            width: 0.06,
            rounding: 0.0,
            grouser_height: 0.01,
            grousers: 24,
        };
        assert!((wheel.drum() - 0.11).abs() < 1e-15);
        wheel.grousers = 2;
        assert!(0.1 < wheel.drum() && wheel.drum() < 0.102);
    }
}
