//! Force of sand on a wheel: the stress over what is under the surface, with its derivatives.
//!
//! The points of arcs lie side by side in lanes, eight at a time. A machine with fewer lanes takes
//! them in turns and keeps a sum for each of the eight: the bits do not depend on the lanes.
//!
//! A surface that recedes feels nothing. Of a ring, only the part of the arc under the surface that
//! may push is integrated. Angles on it are `θ = 4 atan u`, so that sine and cosine are rational.

#[cfg(target_arch = "x86_64")]
use fearless_simd::{f64x4, f64x8};
use nalgebra::{Matrix3, Matrix6, Vector3, Vector6};

use super::memory::Memory;
use super::piece::{Piece, Setting};
use super::soil::{Law, Soil};
use super::wheel::{Gauss, Ring, Rules, SandWheel, Skin};
use crate::scalar::elementary::{acos, atan2};
use crate::scalar::{Instructions, Lane, LaneMask, MAX_LANES, Single, Vec3};

/// Pose of a wheel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WheelPose {
    /// World, or relative to an origin that the bed shares, m.
    pub centre: Vector3<f64>,
    /// Unit vector.
    pub axle: Vector3<f64>,
}

/// The surface over the plane of a [`Bed`] at a place.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Heights {
    /// Undisturbed, m.
    pub virgin: f64,
    /// As wheels have left it, m.
    pub left: f64,
    /// Gradient of `left` against `virgin`, world.
    pub slope: Vector3<f64>,
}

/// Heights at a place in the world.
pub type Relief<'a> = &'a dyn Fn(&Vector3<f64>) -> Heights;

/// The surface of the sand near a wheel.
#[derive(Clone, Copy)]
pub struct Bed<'a> {
    /// A point of its tangent plane, m.
    pub place: Vector3<f64>,
    /// Unit normal of that plane, out of the sand.
    pub normal: Vector3<f64>,
    /// Heights over the plane; none of a plane bed.
    pub relief: Option<Relief<'a>>,
    /// What no height near the wheel exceeds, m.
    pub highest: f64,
    /// Gravity against the normal, m/s².
    pub gravity: f64,
}

/// Force on a wheel and its derivatives.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reaction {
    /// Force, N, and moment about the centre, N m, in world axes.
    pub wrench: Vector6<f64>,
    /// Its derivatives, as they are wanted.
    pub slope: Matrix6<f64>,
    /// Whether a part that pushes, or may, is under the surface.
    pub is_touching: bool,
    /// Depth of the lowest point under the surface, m; negative where the wheel is clear of it.
    pub sinkage: f64,
}

/// Derivatives are not computed where they are not asked for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Derivatives {
    /// The wrench alone.
    Wrench,
    /// The wrench and a sum of its derivatives.
    Slopes {
        /// Factor of the derivative by the six numbers of the memory.
        by_memory: f64,
        /// Factor of the derivative by a translation and a rotation of the wheel, m and rad. The
        /// normals of the pieces are kept.
        by_pose: f64,
    },
}

/// Sine between axle and normal below which the wheel lies flat.
const FLAT: f64 = 1e-9;

/// How fast the side at which the rim enters changes with the direction of travel.
const ENTRY: f64 = 0.1;

/// A wheel relative to the bed, in its own axes: down and forward in its plane, and its axle.
struct Frame<'a> {
    wheel: &'a SandWheel,
    rules: &'a Rules,
    soil: &'a Soil,
    bed: &'a Bed<'a>,
    pose: &'a WheelPose,
    want: Derivatives,
    setting: Setting,
    /// Columns: down, along and axle in world axes.
    axes: Matrix3<f64>,
    /// Into the sand.
    g: Vector3<f64>,
    shift: Vector3<f64>,
    turn: Vector3<f64>,
    /// Height of the wheel's centre over the plane, m.
    height: f64,
    /// Radius from which on the side walls may be under the surface, m.
    dry: f64,
    /// From −1 to 1: which end of an arc enters the sand.
    entry: f64,
}

/// Sums of a reaction in the wheel's axes: wrench, and its derivative column by column.
#[derive(Clone, Copy)]
struct Sums {
    wrench: [f64; 6],
    slope: [f64; 36],
    is_touching: bool,
}

/// The force of a soil on a wheel in a pose, with what the sand remembers.
#[must_use]
pub fn react(
    wheel: (&SandWheel, &Rules),
    soil: &Soil,
    bed: &Bed<'_>,
    pose: &WheelPose,
    memory: &Memory,
    want: Derivatives,
) -> Reaction {
    let instructions = Instructions::of_this_machine();
    react_with(instructions, wheel, soil, bed, (pose, memory), want)
}

/// [`react`] with a set of instructions; the bits are the same.
#[must_use]
pub fn react_with(
    instructions: Instructions,
    (wheel, rules): (&SandWheel, &Rules),
    soil: &Soil,
    bed: &Bed<'_>,
    (pose, memory): (&WheelPose, &Memory),
    want: Derivatives,
) -> Reaction {
    let frame = Frame::new((wheel, rules), soil, bed, (pose, memory), want);
    let lean = pose.axle.dot(&bed.normal);
    let sinkage = 0.5 * wheel.width * lean.abs() + wheel.drum() * frame.g.x - frame.height;
    let mut reaction = Reaction {
        wrench: Vector6::zeros(),
        slope: Matrix6::zeros(),
        is_touching: false,
        sinkage,
    };
    if sinkage + bed.highest <= 0.0 {
        return reaction;
    }
    let mut sums = Sums {
        wrench: [0.0; 6],
        slope: [0.0; 36],
        is_touching: false,
    };
    match instructions {
        Instructions::Baseline => frame.sum::<f64>(Single::Baseline, &mut sums),
        #[cfg(target_arch = "x86_64")]
        Instructions::Avx2(token) => frame.sum::<f64x4<_>>(token, &mut sums),
        #[cfg(target_arch = "x86_64")]
        Instructions::Avx512(token) => frame.sum::<f64x8<_>>(token, &mut sums),
    }
    reaction.is_touching = sums.is_touching;
    let of = |k: usize| Vector3::from_fn(|i, _| sums.wrench[3 * k + i]);
    for k in 0..2 {
        let part = frame.axes * of(k);
        reaction.wrench.fixed_rows_mut::<3>(3 * k).copy_from(&part);
    }
    if want != Derivatives::Wrench {
        for (i, j) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
            let part = Matrix3::from_fn(|a, b| sums.slope[6 * (3 * j + b) + 3 * i + a]);
            let turned = frame.axes * part * frame.axes.transpose();
            let mut place = reaction.slope.fixed_view_mut::<3, 3>(3 * i, 3 * j);
            place.copy_from(&turned);
        }
    }
    reaction
}

/// A unit vector perpendicular to a given one.
fn perpendicular(axle: &Vector3<f64>) -> Vector3<f64> {
    let e = if axle.x.abs() < 0.7 {
        Vector3::x()
    } else {
        Vector3::y()
    };
    (e - axle * axle.dot(&e)).normalize()
}

/// `tan(θ/4)` of the angle of a unit vector, −π < θ <= π.
fn quarter(cos: f64, sin: f64) -> f64 {
    let half_cos = (0.5 * (1.0 + cos)).max(0.0).sqrt();
    let half_sin = (0.5 * (1.0 - cos)).max(0.0).sqrt();
    half_sin.copysign(sin) / (1.0 + half_cos)
}

impl<'a> Frame<'a> {
    fn new(
        (wheel, rules): (&'a SandWheel, &'a Rules),
        soil: &'a Soil,
        bed: &'a Bed<'a>,
        (pose, memory): (&'a WheelPose, &Memory),
        want: Derivatives,
    ) -> Self {
        let lean = pose.axle.dot(&bed.normal);
        let flat = pose.axle * lean - bed.normal;
        let sine = flat.norm();
        let down = if sine > FLAT {
            flat / sine
        } else {
            perpendicular(&pose.axle)
        };
        let axes = Matrix3::from_columns(&[down, pose.axle.cross(&down), pose.axle]);
        let shift = axes.tr_mul(&Vector3::from(memory.shift));
        let height = (pose.centre - bed.place).dot(&bed.normal);
        let beyond = height - 0.5 * wheel.width * lean.abs() - bed.highest;
        Self {
            wheel,
            rules,
            soil,
            bed,
            pose,
            want,
            setting: Setting {
                held: wheel.held(),
                width: wheel.width,
                gravity: bed.gravity,
            },
            axes,
            g: Vector3::new(sine, 0.0, -lean),
            shift,
            turn: axes.tr_mul(&Vector3::from(memory.turn)),
            height,
            dry: beyond / sine.max(FLAT),
            entry: shift.y / (shift.y * shift.y + ENTRY * ENTRY).sqrt(),
        }
    }

    /// Adds the stresses over all rings.
    #[inline(always)]
    fn sum<T: Lane>(&self, token: T::Token, sums: &mut Sums) {
        T::vectorize(
            token,
            #[inline(always)]
            || {
                for lanes in 0..MAX_LANES / T::LANES {
                    let zero = T::splat(token, 0.0);
                    let mut own = Own {
                        wrench: [zero; 6],
                        slope: [zero; 36],
                        is_touching: false,
                    };
                    self.visit_groups(
                        #[inline(always)]
                        |group| self.add(group, (token, lanes * T::LANES), &mut own),
                    );
                    sums.is_touching |= own.is_touching;
                    for (total, own) in sums.wrench.iter_mut().zip(own.wrench) {
                        add_lanes(total, own);
                    }
                    if self.want != Derivatives::Wrench {
                        for (total, own) in sums.slope.iter_mut().zip(own.slope) {
                            add_lanes(total, own);
                        }
                    }
                }
            },
        );
    }

    /// Visits the points of the wheel that may be in the sand, [`MAX_LANES`] at a time.
    #[inline(always)]
    fn visit_groups(&self, mut visit: impl FnMut(&Group)) {
        let (strips, sides) = (self.rules.n_strips(), self.rules.n_of_a_side());
        for index in 0..strips + sides {
            let (pair, rule) = if index < strips {
                let ring = self.rules.strip(self.wheel, index);
                ([ring, None], &self.rules.arc)
            } else {
                let ring = self.rules.side(self.wheel, self.dry, index - strips);
                (
                    [ring, ring.map(|ring| ring.mirrored())],
                    &self.rules.side_arc,
                )
            };
            let pair = pair.map(|ring| ring.and_then(|ring| self.arc(ring)));
            let n = rule.places.len();
            let groups = if n < MAX_LANES { 1 } else { 2 * n / MAX_LANES };
            for k in 0..groups {
                let group = if n < MAX_LANES {
                    Group::of_two(&pair, rule)
                } else {
                    let part = k % (n / MAX_LANES) * MAX_LANES;
                    let one = &pair[usize::from(k >= n / MAX_LANES)];
                    Group::of_one(one.as_ref(), rule, part)
                };
                if let Some(group) = group {
                    visit(&group);
                }
            }
        }
    }

    /// The part of a ring that may feel the sand; none if there is none.
    #[inline]
    fn arc(&self, ring: Ring) -> Option<(Ring, Arc)> {
        let raised = self.bed.highest - self.height + ring.offset * self.g.z;
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
        let [from, to] = self.pushing(&ring, end);
        (from < to).then_some((ring, Arc { from, to, cos }))
    }

    /// The part of an arc up to `tan(θ/4) = end` on both sides of its lowest point on which the
    /// surface may push: `x·n > −B`, where B is the most that leaves a stress.
    #[inline]
    fn pushing(&self, ring: &Ring, end: f64) -> [f64; 2] {
        let whole = [-end, end];
        let Law::Resistive(sand) = &self.soil.law else {
            return whole;
        };
        let (x, w) = (&self.shift, &self.turn);
        let (speed, tilt) = (
            (x.x * x.x + x.y * x.y).sqrt(),
            (w.x * w.x + w.y * w.y).sqrt(),
        );
        let [n_r, n_a] = ring.normal;
        let largest = x.norm() + w.norm() * (ring.radius + ring.offset.abs());
        let sideways = x.z.abs() + tilt * ring.radius;
        let bound = sand.flow.grip * sand.flow.width * largest
            + n_a.abs() * sideways
            + n_r * tilt * ring.offset.abs();
        if bound >= n_r * speed {
            return whole;
        }
        // The directions at which it ends, on both sides of that of the motion.
        let (cos, sin) = (x.x / speed, x.y / speed);
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

    /// Adds the stress on a group of points: its lanes from `first` on.
    #[inline(always)]
    fn add<T: Lane>(&self, group: &Group, (token, first): (T::Token, usize), own: &mut Own<T>) {
        let number = |value: f64| T::splat(token, value);
        let lanes = |values: &[f64; MAX_LANES]| T::load(token, &values[first..first + T::LANES]);
        let (zero, one, two) = (number(0.0), number(1.0), number(2.0));
        let u = lanes(&group.u);
        let per = one / (one + u * u);
        let (p, q) = ((one - u * u) * per, two * u * per);
        let (cos, sin) = (p * p - q * q, two * p * q);
        let (radius, radial) = (number(group.radius), number(group.radial));
        let elements = Elements {
            r: Vec3::new(cos * radius, sin * radius, lanes(&group.offset)),
            normal: Vec3::new(cos * radial, sin * radial, lanes(&group.axial)),
            area: lanes(&group.area) * per,
        };
        let (depth, by_place) = self.depth(elements.r);
        let is_under = depth.gt(zero) & elements.area.gt(zero);
        if is_under.any() {
            own.is_touching = true;
            // What is not under counts for nothing, whatever lies beside it in a register.
            let area = T::select(is_under, elements.area, zero);
            let elements = Elements { area, ..elements };
            let depth = T::select(is_under, depth, zero);
            let ends = lanes(&group.end);
            let way = self.way(group.radius, ends, (cos, sin));
            self.add_pieces(group.skin, &elements, (depth, by_place, way), own);
        }
    }

    /// Way from where pieces entered, m. Only Bekker's law needs it.
    #[inline(always)]
    fn way<T: Lane>(&self, radius: f64, end: T, (cos, sin): (T, T)) -> T {
        let mut way = cos;
        if matches!(self.soil.law, Law::Bekker(_)) {
            for lane in 0..T::LANES {
                let theta = atan2(sin.get(lane), cos.get(lane));
                way.set(lane, radius * (acos(end.get(lane)) - self.entry * theta));
            }
        }
        way
    }

    /// Depth that counts of pieces at `r` from the centre, m, and its gradient.
    #[inline(always)]
    fn depth<T: Lane>(&self, r: Vec3<T>) -> (T, Vec3<T>) {
        let number = |value: f64| r.x.like(value);
        let g = Vec3::splat(r.x.token(), self.g.into());
        let mut below = r.dot(g) - number(self.height);
        let mut gradient = g;
        let Some(relief) = self.bed.relief else {
            return (below, gradient);
        };
        let reload = self.soil.reload;
        for lane in 0..T::LANES {
            let place = self.pose.centre + self.axes * Vector3::from(r.get(lane));
            let heights = relief(&place);
            let depth = below.get(lane);
            let (virgin, left) = (depth + heights.virgin, (depth + heights.left) * reload);
            if left < virgin {
                below.set(lane, left);
                let steep = (self.g + self.axes.tr_mul(&heights.slope)) * reload;
                gradient.set(lane, steep.into());
            } else {
                below.set(lane, virgin);
            }
        }
        (below, gradient)
    }

    #[inline(always)]
    fn add_pieces<T: Lane>(
        &self,
        skin: Skin,
        elements: &Elements<T>,
        (depth, by_place, arc): (T, Vec3<T>, T),
        own: &mut Own<T>,
    ) {
        let (r, area, token) = (elements.r, elements.area, depth.token());
        let shared = |v: Vector3<f64>| Vec3::<T>::splat(token, v.into());
        let g = shared(self.g);
        let piece = Piece {
            normal: elements.normal,
            x: shared(self.shift) + shared(self.turn).cross(r),
            down: g,
            depth,
            arc,
            skin,
        };
        let wants_slopes = self.want != Derivatives::Wrench;
        let stress = self.soil.stress(&piece, &self.setting, wants_slopes);
        let force = stress.value * area;
        add_wrench(&mut own.wrench, r, force);
        let Derivatives::Slopes { by_memory, by_pose } = self.want else {
            return;
        };
        let fresh = area * depth.like(by_memory);
        let memory = stress.by_x.map(|column| column * fresh);
        let sunk = stress.by_depth * (area * depth.like(by_pose));
        let [a, b, c] = [
            memory[0] + sunk * by_place.x,
            memory[1] + sunk * by_place.y,
            memory[2] + sunk * by_place.z,
        ];
        // Displacements by a rotation: e × r. The wheel may turn about its axle without a change
        // of depth.
        let columns = [
            a,
            b,
            c,
            c * r.y - b * r.z,
            a * r.z - c * r.x,
            memory[1] * r.x - memory[0] * r.y,
        ];
        for (slope, column) in own.slope.chunks_exact_mut(6).zip(columns) {
            add_wrench(slope, r, column);
        }
    }
}

/// Part of a ring, by the tangents of a quarter of the angles at its ends.
struct Arc {
    from: f64,
    to: f64,
    /// Of the angle at which the ring leaves the sand.
    cos: f64,
}

/// Points of one ring, or of two on both sides of a wheel.
struct Group {
    radius: f64,
    /// Component of the normal along the radius, and of each point along the axle.
    radial: f64,
    axial: [f64; MAX_LANES],
    skin: Skin,
    /// Along the axle, m.
    offset: [f64; MAX_LANES],
    /// `tan(θ/4)`, and area per 1/(1 + u²), m².
    u: [f64; MAX_LANES],
    area: [f64; MAX_LANES],
    /// Cosines of the angles at which the rings leave the sand.
    end: [f64; MAX_LANES],
}

impl Group {
    fn new(ring: &Ring) -> Self {
        Self {
            radius: ring.radius,
            radial: ring.normal[0],
            axial: [0.0; MAX_LANES],
            skin: ring.skin,
            offset: [0.0; MAX_LANES],
            u: [0.0; MAX_LANES],
            area: [0.0; MAX_LANES],
            end: [1.0; MAX_LANES],
        }
    }

    /// Writes points of an arc, from a lane on.
    #[inline]
    fn put(&mut self, (ring, arc): &(Ring, Arc), lane: usize, places: &[f64], weights: &[f64]) {
        let (middle, half) = (0.5 * (arc.from + arc.to), 0.5 * (arc.to - arc.from));
        let scale = 4.0 * half * ring.radius * ring.width;
        for (k, (x, weight)) in places.iter().zip(weights).enumerate() {
            let k = lane + k;
            self.u[k] = middle + half * x;
            self.area[k] = scale * weight;
            self.offset[k] = ring.offset;
            self.axial[k] = ring.normal[1];
            self.end[k] = arc.cos;
        }
    }

    /// Points of an arc from one of a rule on.
    #[inline]
    fn of_one(arc: Option<&(Ring, Arc)>, rule: &Gauss, first: usize) -> Option<Self> {
        let arc = arc?;
        let mut group = Self::new(&arc.0);
        let at = first..first + MAX_LANES;
        group.put(arc, 0, &rule.places[at.clone()], &rule.weights[at]);
        Some(group)
    }

    /// All points of two arcs; one that there is none of has no area.
    #[inline]
    fn of_two(pair: &[Option<(Ring, Arc)>; 2], rule: &Gauss) -> Option<Self> {
        let (first, _) = pair[0].as_ref().or(pair[1].as_ref())?;
        let mut group = Self::new(first);
        for (k, arc) in pair.iter().enumerate() {
            if let Some(arc) = arc {
                group.put(arc, k * MAX_LANES / 2, &rule.places, &rule.weights);
            }
        }
        Some(group)
    }
}

/// Elements of the surface, side by side in lanes: where they are, in the wheel's axes, and how
/// large, m².
struct Elements<T> {
    r: Vec3<T>,
    normal: Vec3<T>,
    area: T,
}

/// Sums of some lanes.
struct Own<T> {
    wrench: [T; 6],
    slope: [T; 36],
    is_touching: bool,
}

/// Adds the lanes of a sum one after the other, in the same order for any number of lanes.
#[inline(always)]
fn add_lanes<T: Lane>(total: &mut f64, own: T) {
    let mut lanes = [0.0; MAX_LANES];
    own.store(&mut lanes[..T::LANES]);
    for lane in &lanes[..T::LANES] {
        *total += lane;
    }
}

/// Adds a force at r and its moment.
#[inline(always)]
fn add_wrench<T: Lane>(sum: &mut [T], r: Vec3<T>, force: Vec3<T>) {
    let moment = r.cross(force);
    let parts = [force.x, force.y, force.z, moment.x, moment.y, moment.z];
    for (sum, part) in sum.iter_mut().zip(parts) {
        *sum += part;
    }
}
