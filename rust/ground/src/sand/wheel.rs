//! A wheel as sand meets it: a drum between two side walls, with rounded edges and grousers.
//!
//! Every part of it is a ring about the axle: a strip of the drum, a chamfer in place of a rounded
//! edge, a ring of a side wall. Of a ring in a plane bed, the arc under the surface is known in
//! closed form, and the integral over it is Gauss's: the points move with the arc, so the force is
//! continuous in the pose.
//!
//! Sand is held between grousers. Where they stand closer than three times their height the wheel
//! works as a drum of the radius of their tips, with the friction of sand on sand.

use friction_contact::scalar::elementary::sin_cos;

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
    /// Surface of the wheel that the ring belongs to.
    pub skin: Skin,
}

/// Most points of a Gauss rule.
pub const MOST_POINTS: usize = 24;

/// Gauss–Legendre rule on (−1, 1).
#[derive(Clone, Debug, PartialEq)]
pub struct Gauss {
    /// Places of the points in (−1, 1).
    pub places: Vec<f64>,
    /// Weights of the points.
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

/// Numbers of points of a wheel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Points {
    /// Along an arc of the drum, and across the drum.
    pub drum: [usize; 2],
    /// Along an arc of an edge.
    pub edge: usize,
    /// Along an arc of a side wall, and along its radius.
    pub wall: [usize; 2],
}

/// Gauss rules of a wheel.
#[derive(Clone, Debug, PartialEq)]
pub struct GaussRules {
    drum: [Gauss; 2],
    edge: Gauss,
    wall: [Gauss; 2],
    point: Gauss,
}

impl GaussRules {
    /// With these numbers of points.
    #[must_use]
    pub fn new(points: Points) -> Self {
        Self {
            drum: points.drum.map(Gauss::new),
            edge: Gauss::new(points.edge),
            wall: points.wall.map(Gauss::new),
            point: Gauss::new(1),
        }
    }

    /// The rule of one point.
    pub(super) fn point(&self) -> &Gauss {
        &self.point
    }

    /// Points of a wheel with edges.
    #[must_use]
    pub fn n_points(&self) -> usize {
        let number = |rules: &[Gauss; 2]| rules[0].places.len() * rules[1].places.len();
        number(&self.drum) + 2 * (self.edge.places.len() + number(&self.wall))
    }

    /// Rings of a wheel, with those that are empty.
    #[must_use]
    pub fn n_rings(&self) -> usize {
        let [drum, wall] = [&self.drum, &self.wall].map(|rules| rules[1].places.len());
        drum + 2 * (1 + wall)
    }

    /// A ring, none if it is empty: first those of the drum, then the edge of each side, then those
    /// of the walls, side after side. Of a wall, a part may be under the surface from the radius
    /// `dry` (m) on.
    #[must_use]
    pub fn ring(&self, wheel: &SandWheel, dry: f64, index: usize) -> Option<Ring> {
        let n_strips = self.drum[1].places.len();
        let Some(beside) = index.checked_sub(n_strips) else {
            return self.strip(wheel, index);
        };
        let ring = match (beside / 2).checked_sub(1) {
            None => Self::edge(wheel),
            Some(point) => self.wall(wheel, dry, point),
        };
        let is_left = beside % 2 == 1;
        ring.map(|ring| if is_left { ring.mirrored() } else { ring })
    }

    /// The rule along a ring.
    #[must_use]
    pub fn along(&self, index: usize) -> &Gauss {
        match index.checked_sub(self.drum[1].places.len()) {
            None => &self.drum[0],
            Some(0 | 1) => &self.edge,
            Some(_) => &self.wall[0],
        }
    }

    fn strip(&self, wheel: &SandWheel, index: usize) -> Option<Ring> {
        let flat = 0.5 * wheel.width - wheel.rounding;
        (flat > 0.0).then(|| Ring {
            offset: self.drum[1].places[index] * flat,
            radius: wheel.drum(),
            normal: [1.0, 0.0],
            width: self.drum[1].weights[index] * flat,
            skin: Skin::Rim,
        })
    }

    /// The edge on the right.
    fn edge(wheel: &SandWheel) -> Option<Ring> {
        let (half, edge) = (0.5 * wheel.width, wheel.rounding);
        let diagonal = std::f64::consts::FRAC_1_SQRT_2;
        (edge > 0.0).then(|| Ring {
            offset: half - edge + diagonal * edge,
            radius: wheel.drum() - edge + diagonal * edge,
            normal: [diagonal, diagonal],
            width: std::f64::consts::FRAC_PI_2 * edge,
            skin: Skin::Rim,
        })
    }

    /// A ring of the wall on the right.
    fn wall(&self, wheel: &SandWheel, dry: f64, point: usize) -> Option<Ring> {
        let inner = wheel.drum() - wheel.rounding;
        let depth = 0.5 * (inner - dry.max(0.0));
        (depth > 0.0).then(|| Ring {
            offset: 0.5 * wheel.width,
            radius: inner - depth * (1.0 - self.wall[1].places[point]),
            normal: [0.0, 1.0],
            width: self.wall[1].weights[point] * depth,
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
        let rules = GaussRules::new(Points {
            drum: [4, 2],
            edge: 2,
            wall: [2, 3],
        });
        for ring in (0..rules.n_rings()).filter_map(|k| rules.ring(&wheel, 0.0, k)) {
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
