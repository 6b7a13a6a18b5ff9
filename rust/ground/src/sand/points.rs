//! Points of a wheel that may be in the sand, in groups that lie side by side in lanes.
//!
//! A surface that recedes feels nothing. Of a ring, only the part of the arc under the surface that
//! may push is integrated. Angles on it are `θ = 4 atan u`, so that sine and cosine are rational.
//! The arcs of drum and edges fill groups of eight points one after the other, and then those of
//! the side walls.

use nalgebra::Vector3;

use super::sliding::Rolling;
use super::soil::{Resistive, Soil, StressLaw};
use super::wheel::{Gauss, GaussRules, Ring, SandWheel, Skin};
use friction_contact::scalar::elementary::{acos, sin_cos};
use friction_contact::scalar::{Lane, LaneMask, MAX_LANES};

/// A wheel in the sand, in its own axes: down and forward in its plane, and its axle.
pub(super) struct Immersed<'a> {
    pub wheel: &'a SandWheel,
    pub rules: &'a GaussRules,
    pub soil: &'a Soil,
    /// Into the sand.
    pub g: Vector3<f64>,
    /// What the sand remembers.
    pub shift: Vector3<f64>,
    pub turn: Vector3<f64>,
    pub motion: MemorySize,
    pub rolling: Rolling,
    /// Height of the wheel's centre over the plane of the bed, m.
    pub height: f64,
    /// What no height of the surface over that plane exceeds, m.
    pub highest: f64,
    /// Radius from which on the side walls may be under the surface, m.
    pub dry: f64,
}

/// Sizes of what the sand remembers: of all, of the shift and of the turn, and of the shift in the
/// wheel's plane and the turn out of it.
#[derive(Clone, Copy)]
pub(super) struct MemorySize {
    size: f64,
    spin: f64,
    speed: f64,
    tilt: f64,
}

/// Parts of eight rings, by the tangents of a quarter of the angles at their ends; empty where
/// `from` is not less than `to`.
struct Arcs {
    rings: [Option<Ring>; MAX_LANES],
    from: [f64; MAX_LANES],
    to: [f64; MAX_LANES],
    /// Cosines of the angles at which the rings leave the sand.
    cos: [f64; MAX_LANES],
}

/// Part of a ring.
#[derive(Clone, Copy)]
struct Arc {
    ring: Ring,
    from: f64,
    to: f64,
    cos: f64,
    /// Area by which the ring grows as the direction of the motion turns, m², at an end that moves
    /// with that direction; 0 for an arc.
    grows: f64,
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
    /// Area by which the surface that presses grows as the motion turns, m²; 0 but at its ends.
    pub grows: [f64; MAX_LANES],
}

/// Fills one group after the other.
pub(super) struct Feed<'a> {
    wheel: &'a Immersed<'a>,
    /// The next ring, and the eight with the last one.
    ring: usize,
    arcs: Arcs,
    /// The arc of which points were taken, with its rule.
    now: Option<(Arc, &'a Gauss)>,
    /// Number of its points that were taken.
    taken: usize,
    /// What else belongs to the last ring: in Bekker's law, the arc behind the angle of greatest
    /// stress, and the ends of the surface that presses.
    more: [Option<(Arc, &'a Gauss)>; 3],
}

impl MemorySize {
    /// Sizes of a remembered shift and turn, in the wheel's axes.
    pub fn of(shift: &Vector3<f64>, turn: &Vector3<f64>) -> Self {
        Self {
            size: shift.norm(),
            spin: turn.norm(),
            speed: (shift.x * shift.x + shift.y * shift.y).sqrt(),
            tilt: (turn.x * turn.x + turn.y * turn.y).sqrt(),
        }
    }
}

/// Sine that is none.
const TINY: f64 = 1e-150;

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
            grows: none,
        }
    }
}

impl<'a> Feed<'a> {
    /// Feed of a wheel's points, from the first ring on.
    pub fn of(wheel: &'a Immersed<'a>) -> Self {
        Self {
            wheel,
            ring: 0,
            arcs: Arcs {
                rings: [None; MAX_LANES],
                from: [0.0; MAX_LANES],
                to: [0.0; MAX_LANES],
                cos: [1.0; MAX_LANES],
            },
            now: None,
            taken: 0,
            more: [None; 3],
        }
    }

    /// The next points. False if there are none.
    #[inline(always)]
    pub fn fill<T: Lane>(&mut self, token: T::Token, group: &mut Group) -> bool {
        let mut n = 0;
        while n < MAX_LANES {
            if self.now.is_none() {
                (self.now, self.taken) = (self.next_arc::<T>(token), 0);
            }
            let Some((arc, rule)) = &self.now else {
                break;
            };
            let skin = arc.ring.skin;
            if n == 0 {
                group.skin = skin;
            } else if group.skin != skin {
                break;
            }
            let left = rule.places.len() - self.taken;
            let more = left.min(MAX_LANES - n);
            group.put(arc, n, (rule, self.taken..self.taken + more));
            n += more;
            self.taken += more;
            if more == left {
                self.now = None;
            }
        }
        group.area[n..].fill(0.0);
        group.grows[n..].fill(0.0);
        n > 0
    }

    #[inline(always)]
    fn next_arc<T: Lane>(&mut self, token: T::Token) -> Option<(Arc, &'a Gauss)> {
        let Immersed {
            wheel, rules, dry, ..
        } = *self.wheel;
        let n_rings = rules.n_rings();
        let soil = self.wheel.soil;
        if let Some(more) = self.more.iter_mut().find_map(Option::take) {
            return Some(more);
        }
        while self.ring < n_rings {
            let at = self.ring % MAX_LANES;
            if at == 0 {
                for (ring, index) in self.arcs.rings.iter_mut().zip(self.ring..) {
                    *ring = (index < n_rings)
                        .then(|| rules.ring(wheel, dry, index))
                        .flatten();
                }
                for part in 0..MAX_LANES / T::LANES {
                    self.arcs.find::<T>(self.wheel, (token, part * T::LANES));
                }
            }
            let (from, to) = (self.arcs.from[at], self.arcs.to[at]);
            self.ring += 1;
            let is_felt =
                |ring: &Ring| from < to && (ring.skin == Skin::Rim || !soil.spares_walls());
            if let Some(ring) = self.arcs.rings[at].filter(is_felt) {
                let cos = self.arcs.cos[at];
                let mut arc = Arc {
                    ring,
                    from,
                    to,
                    cos,
                    grows: 0.0,
                };
                let rule = rules.along(self.ring - 1);
                if let StressLaw::Bekker(_) = soil.law {
                    self.more = self.divide(&mut arc, rule);
                }
                return Some((arc, rule));
            }
        }
        None
    }

    /// Leaves the first part of an arc; returns the other, and its ends.
    fn divide(&self, arc: &mut Arc, rule: &'a Gauss) -> [Option<(Arc, &'a Gauss)>; 3] {
        let rolling = &self.wheel.rolling;
        let Arc {
            ring,
            from,
            to,
            cos,
            ..
        } = *arc;
        // Only an end before the surface moves.
        let surface = quarter::<f64>(cos, 1.0);
        let end = |u: f64, sign: f64| {
            let grows = sign * ring.radius * ring.width;
            let end = Arc {
                from: u,
                to: u,
                grows,
                ..*arc
            };
            (u.abs() < surface).then_some((end, self.wheel.rules.point()))
        };
        let ends = [end(from, -1.0), end(to, 1.0)];
        let kink = rolling.greatest.map(|share| {
            let (sin, cos) = sin_cos(share * acos(cos));
            quarter_of(cos, sin).copysign(rolling.entry)
        });
        let behind = kink.filter(|u| from < *u && *u < to).map(|u| {
            arc.from = u;
            (
                Arc {
                    to: u,
                    from,
                    ..*arc
                },
                rule,
            )
        });
        [behind, ends[0], ends[1]]
    }
}

impl Group {
    /// Writes some points of an arc, from a lane on.
    #[inline(always)]
    fn put(&mut self, arc: &Arc, lane: usize, (rule, points): (&Gauss, std::ops::Range<usize>)) {
        let ring = &arc.ring;
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
            self.grows[lane] = arc.grows;
        }
    }
}

impl Arcs {
    /// The parts of rings that may feel the sand, from a lane on.
    #[inline(always)]
    fn find<T: Lane>(&mut self, wheel: &Immersed<'_>, (token, first): (T::Token, usize)) {
        let lanes = first..first + T::LANES;
        let mut numbers = [[0.0; MAX_LANES]; 4];
        for (lane, ring) in self.rings[lanes.clone()].iter().enumerate() {
            if let Some(ring) = ring {
                let [n_r, n_a] = ring.normal;
                for (own, x) in numbers.iter_mut().zip([ring.radius, ring.offset, n_r, n_a]) {
                    own[lane] = x;
                }
            }
        }
        let [radius, offset, n_r, n_a] = numbers.map(|own| T::load(token, &own[..T::LANES]));
        let rings = LaneRings {
            radius,
            offset,
            n_r,
            n_a,
        };
        let (zero, one) = (radius.like(0.0), radius.like(1.0));
        let raised = radius.like(wheel.highest - wheel.height) + offset * radius.like(wheel.g.z);
        let swing = radius * radius.like(wheel.g.x);
        let is_clear = raised.le(-swing);
        let cos = T::select(raised.ge(swing), -one, -(raised / swing));
        let end = quarter(cos, one);
        let whole = [-end, end];
        let [from, to] = match &wheel.soil.law {
            StressLaw::Resistive(sand) => rings.pushing(wheel, sand, whole),
            StressLaw::Bekker(_) => pressing(wheel.rolling.front, whole),
        };
        T::select(is_clear, zero, from).store(&mut self.from[lanes.clone()]);
        T::select(is_clear, zero, to).store(&mut self.to[lanes.clone()]);
        cos.store(&mut self.cos[lanes]);
    }
}

/// Rings side by side.
struct LaneRings<T> {
    radius: T,
    offset: T,
    n_r: T,
    n_a: T,
}

impl<T: Lane> LaneRings<T> {
    /// The part of an arc up to `tan(θ/4) = end` on both sides of its lowest point on which the
    /// surface may push: `x·n > −B`, where B is the most that leaves a stress.
    #[inline(always)]
    fn pushing(&self, wheel: &Immersed<'_>, sand: &Resistive, whole: [T; 2]) -> [T; 2] {
        let number = |value: f64| self.radius.like(value);
        let (zero, one) = (number(0.0), number(1.0));
        let MemorySize {
            size,
            spin,
            speed,
            tilt,
            ..
        } = wheel.motion;
        let reach = self.radius + self.offset.abs();
        let largest = number(size) + number(spin) * reach;
        let sideways = number(wheel.shift.z.abs()) + number(tilt) * self.radius;
        let bound = number(sand.flow.grip * sand.flow.width) * largest
            + self.n_a.abs() * sideways
            + self.n_r * number(tilt) * self.offset.abs();
        let normal = self.n_r * number(speed);
        let all_push = bound.ge(normal);
        if all_push.all() {
            return whole;
        }
        // The directions at which it ends, on both sides of that of the motion.
        let (cos, sin) = (wheel.shift.x / speed, wheel.shift.y / speed);
        let (c, s) = (number(cos), number(sin));
        let far = -(bound / normal);
        let across = (one - far * far).max(zero).sqrt();
        let low = [c * far + s * across, s * far - c * across];
        let high = [c * far - s * across, s * far + c * across];
        let [from, to] = [low, high].map(|[cos, sin]| quarter(cos, sin));
        let [start, end] = whole;
        let (later, sooner) = (from.max(start), to.min(end));
        // An end beyond θ = ±π lies on the other side of the circle.
        let none = all_push & !all_push;
        let before = if sin < 0.0 { low[1].gt(zero) } else { none };
        let behind = if sin > 0.0 { high[1].lt(zero) } else { none };
        let (only_end, only_start) = (before & from.ge(end), behind & to.le(start));
        let is_whole = all_push | (before & !only_end) | (behind & !only_start);
        [
            T::select(is_whole | only_end, start, later),
            T::select(is_whole | only_start, end, sooner),
        ]
    }
}

/// The part of an arc within a right angle of a direction.
#[inline(always)]
fn pressing<T: Lane>([x, y]: [f64; 2], [start, end]: [T; 2]) -> [T; 2] {
    let size = (x * x + y * y).sqrt();
    let (x, y) = (x / size, y / size);
    let [from, to] = [[y, -x], [-y, x]].map(|[cos, sin]| start.like(quarter_of(cos, sin)));
    [
        if x > 0.0 || y > 0.0 {
            from.max(start)
        } else {
            start
        },
        if x > 0.0 || y < 0.0 { to.min(end) } else { end },
    ]
}

/// [`quarter`], to rounding where the angle is small.
fn quarter_of(cos: f64, sin: f64) -> f64 {
    let half = if cos >= 0.0 {
        sin / (1.0 + cos)
    } else {
        (1.0 - cos) / sin.abs().max(TINY).copysign(sin)
    };
    half / (1.0 + (1.0 + half * half).sqrt())
}

/// `tan(θ/4)` of the angle of a unit vector, −π < θ <= π.
#[inline(always)]
fn quarter<T: Lane>(cos: T, sin: T) -> T {
    let (zero, one, half) = (cos.like(0.0), cos.like(1.0), cos.like(0.5));
    let half_cos = (half * (one + cos)).max(zero).sqrt();
    let half_sin = (half * (one - cos)).max(zero).sqrt();
    T::select(sin.lt(zero), -half_sin, half_sin) / (one + half_cos)
}
