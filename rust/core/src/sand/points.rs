//! Points of a wheel that may be in the sand, in groups that lie side by side in lanes.
//!
//! A surface that recedes feels nothing. Of a ring, only the part of the arc under the surface that
//! may push is integrated. Angles on it are `θ = 4 atan u`, so that sine and cosine are rational.
//! The arcs of drum and edges fill groups of eight points one after the other, and then those of
//! the side walls.

use nalgebra::Vector3;

use super::soil::{Law, Soil};
use super::wheel::{Gauss, Ring, Rules, SandWheel, Skin};
use crate::scalar::MAX_LANES;

/// A wheel in the sand, in its own axes: down and forward in its plane, and its axle.
pub(super) struct Immersed<'a> {
    pub wheel: &'a SandWheel,
    pub rules: &'a Rules,
    pub soil: &'a Soil,
    /// Into the sand.
    pub g: Vector3<f64>,
    /// What the sand remembers.
    pub shift: Vector3<f64>,
    pub turn: Vector3<f64>,
    pub motion: Motion,
    /// Height of the wheel's centre over the plane of the bed, m.
    pub height: f64,
    /// What no height of the surface over that plane exceeds, m.
    pub highest: f64,
    /// Radius from which on the side walls may be under the surface, m.
    pub dry: f64,
}

/// Sizes of what the sand remembers: of the shift and of the turn, and of the shift in the wheel's
/// plane and the turn out of it.
#[derive(Clone, Copy)]
pub(super) struct Motion {
    size: f64,
    spin: f64,
    speed: f64,
    tilt: f64,
}

/// Part of a ring, by the tangents of a quarter of the angles at its ends.
struct Arc {
    from: f64,
    to: f64,
    /// Of the angle at which the ring leaves the sand.
    cos: f64,
}

/// Points of one skin. Those behind the last one have no area.
pub(super) struct Group {
    pub skin: Skin,
    pub radius: [f64; MAX_LANES],
    /// Components of the normals along the radius and along the axle.
    pub radial: [f64; MAX_LANES],
    pub axial: [f64; MAX_LANES],
    /// Along the axle, m.
    pub offset: [f64; MAX_LANES],
    /// `tan(θ/4)`, and area per 1/(1 + u²), m².
    pub u: [f64; MAX_LANES],
    pub area: [f64; MAX_LANES],
    /// Cosines of the angles at which the rings leave the sand.
    pub end: [f64; MAX_LANES],
}

/// Fills one group after the other.
pub(super) struct Feed<'a> {
    wheel: &'a Immersed<'a>,
    /// The next ring.
    ring: usize,
    /// The arc of which points were taken, with its rule.
    now: Option<(Ring, Arc, &'a Gauss)>,
    /// Number of its points that were taken.
    taken: usize,
}

impl Motion {
    /// Of a shift and a turn.
    pub fn of(shift: &Vector3<f64>, turn: &Vector3<f64>) -> Self {
        Self {
            size: shift.norm(),
            spin: turn.norm(),
            speed: (shift.x * shift.x + shift.y * shift.y).sqrt(),
            tilt: (turn.x * turn.x + turn.y * turn.y).sqrt(),
        }
    }
}

impl Default for Group {
    fn default() -> Self {
        let none = [0.0; MAX_LANES];
        Self {
            skin: Skin::Rim,
            radius: none,
            radial: none,
            axial: none,
            offset: none,
            u: none,
            area: none,
            end: [1.0; MAX_LANES],
        }
    }
}

impl<'a> Feed<'a> {
    /// Of a wheel.
    pub fn of(wheel: &'a Immersed<'a>) -> Self {
        Self {
            wheel,
            ring: 0,
            now: None,
            taken: 0,
        }
    }

    /// The next points. False if there are none.
    pub fn fill(&mut self, group: &mut Group) -> bool {
        let mut n = 0;
        while n < MAX_LANES {
            if self.now.is_none() {
                (self.now, self.taken) = (self.next_arc(), 0);
            }
            let Some((ring, arc, rule)) = &self.now else {
                break;
            };
            if n == 0 {
                group.skin = ring.skin;
            } else if group.skin != ring.skin {
                break;
            }
            let left = rule.places.len() - self.taken;
            let more = left.min(MAX_LANES - n);
            group.put((ring, arc), n, (rule, self.taken..self.taken + more));
            n += more;
            self.taken += more;
            if more == left {
                self.now = None;
            }
        }
        group.area[n..].fill(0.0);
        n > 0
    }

    fn next_arc(&mut self) -> Option<(Ring, Arc, &'a Gauss)> {
        let Immersed {
            wheel, rules, dry, ..
        } = *self.wheel;
        while self.ring < rules.n_rings() {
            let (ring, rule) = rules.ring(wheel, dry, self.ring);
            self.ring += 1;
            if let Some((ring, arc)) = ring.and_then(|ring| Some((ring, self.wheel.arc(&ring)?))) {
                return Some((ring, arc, rule));
            }
        }
        None
    }
}

impl Group {
    /// Writes some points of an arc, from a lane on.
    #[inline]
    fn put(
        &mut self,
        (ring, arc): (&Ring, &Arc),
        lane: usize,
        (rule, points): (&Gauss, std::ops::Range<usize>),
    ) {
        let (middle, half) = (0.5 * (arc.from + arc.to), 0.5 * (arc.to - arc.from));
        let scale = 4.0 * half * ring.radius * ring.width;
        let lanes = lane..lane + points.len();
        let values = rule.places[points.clone()]
            .iter()
            .zip(&rule.weights[points]);
        for (lane, (x, weight)) in lanes.zip(values) {
            self.u[lane] = middle + half * x;
            self.area[lane] = scale * weight;
            self.radius[lane] = ring.radius;
            self.offset[lane] = ring.offset;
            self.radial[lane] = ring.normal[0];
            self.axial[lane] = ring.normal[1];
            self.end[lane] = arc.cos;
        }
    }
}

impl Immersed<'_> {
    /// The part of a ring that may feel the sand; none if there is none.
    #[inline]
    fn arc(&self, ring: &Ring) -> Option<Arc> {
        let raised = self.highest - self.height + ring.offset * self.g.z;
        let swing = ring.radius * self.g.x;
        if raised <= -swing {
            return None;
        }
        let cos = if raised >= swing {
            -1.0
        } else {
            -raised / swing
        };
        let end = quarter(cos, 1.0);
        let [from, to] = self.pushing(ring, end);
        (from < to).then_some(Arc { from, to, cos })
    }

    /// The part of an arc up to `tan(θ/4) = end` on both sides of its lowest point on which the
    /// surface may push: `x·n > −B`, where B is the most that leaves a stress.
    #[inline]
    fn pushing(&self, ring: &Ring, end: f64) -> [f64; 2] {
        let whole = [-end, end];
        let Law::Resistive(sand) = &self.soil.law else {
            return whole;
        };
        let [n_r, n_a] = ring.normal;
        let Motion {
            size,
            spin,
            speed,
            tilt,
        } = self.motion;
        let largest = size + spin * (ring.radius + ring.offset.abs());
        let sideways = self.shift.z.abs() + tilt * ring.radius;
        let bound = sand.flow.grip * sand.flow.width * largest
            + n_a.abs() * sideways
            + n_r * tilt * ring.offset.abs();
        if bound >= n_r * speed {
            return whole;
        }
        // The directions at which it ends, on both sides of that of the motion.
        let (cos, sin) = (self.shift.x / speed, self.shift.y / speed);
        let far = -bound / (n_r * speed);
        let across = (1.0 - far * far).max(0.0).sqrt();
        let [low, high] = [-across, across].map(|s| [cos * far - sin * s, sin * far + cos * s]);
        let [from, to] = [low, high].map(|[c, s]| quarter(c, s));
        // An end beyond θ = ±π lies on the other side of the circle.
        let is_over = [sin < 0.0 && low[1] > 0.0, sin > 0.0 && high[1] < 0.0];
        match is_over {
            [false, false] => [from.max(-end), to.min(end)],
            [true, _] if from >= end => [-end, to.min(end)],
            [_, true] if to <= -end => [from.max(-end), end],
            _ => whole,
        }
    }
}

/// `tan(θ/4)` of the angle of a unit vector, −π < θ <= π.
fn quarter(cos: f64, sin: f64) -> f64 {
    let half_cos = (0.5 * (1.0 + cos)).max(0.0).sqrt();
    let half_sin = (0.5 * (1.0 - cos)).max(0.0).sqrt();
    half_sin.copysign(sin) / (1.0 + half_cos)
}
