//! Force of sand on a wheel: the stress over what is under the surface, with its derivatives.
//!
//! The points of the wheel that may be in the sand (`points`) lie side by side in lanes,
//! eight at a time. A machine with fewer lanes takes them in turns and keeps a sum for each of the
//! eight: the bits do not depend on the lanes.

use nalgebra::{Matrix3, Matrix6, Vector3, Vector6};

use super::bekker::mobilised;
use super::memory::Memory;
use super::piece::{Piece, WheelConditions};
use super::points::{Feed, Group, Immersed, MemorySize};
use super::ruts::RutsNear;
use super::sliding::{OnRing, Rolling, Slid};
use super::soil::{Soil, StressLaw};
use super::wheel::{GaussRules, SandWheel, Skin};
#[cfg(target_arch = "x86_64")]
use friction_contact::scalar::{Eights, Fours, inlined};
use friction_contact::scalar::{Instructions, Lane, LaneMask, MAX_LANES, Single, Vec3};

/// Pose of a wheel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WheelPose {
    /// World, or relative to an origin that the bed shares, m.
    pub centre: Vector3<f64>,
    /// Unit vector.
    pub axle: Vector3<f64>,
}

/// Height of the undisturbed surface over x and z, world, m; none where there is no ground.
pub type Height<'a> = &'a dyn Fn(f64, f64) -> Option<f64>;

/// What the surface has beside the plane of a [`Bed`].
#[derive(Clone, Copy)]
pub struct Relief<'a> {
    /// The undisturbed surface; none if it is the plane.
    pub height: Option<Height<'a>>,
    /// What wheels have left.
    pub ruts: Option<RutsNear<'a>>,
}

/// The surface of the sand near a wheel.
#[derive(Clone, Copy)]
pub struct Bed<'a> {
    /// A point of its tangent plane, m.
    pub place: Vector3<f64>,
    /// Unit normal of that plane, out of the sand.
    pub normal: Vector3<f64>,
    /// None of a plane bed.
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
    /// Derivatives of the wrench, summed with the factors of [`Derivatives::Slopes`]; zeros for
    /// [`Derivatives::Wrench`].
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

/// A wheel relative to the bed, in its own axes: down and forward in its plane, and its axle.
struct Frame<'a> {
    immersed: Immersed<'a>,
    bed: &'a Bed<'a>,
    pose: &'a WheelPose,
    want: Derivatives,
    setting: WheelConditions,
    /// Columns: down, along and axle in world axes.
    axes: Matrix3<f64>,
}

/// Sums of six components, column by column, of each of eight lanes.
type Rows<const N: usize> = [[f64; MAX_LANES]; N];

/// Sums of a reaction in the wheel's axes: the wrench, and its derivatives by a translation and by
/// a rotation. The numbers of rows are rounded up to whole registers.
struct Sums<'a> {
    wrench: &'a mut Rows<WRENCH>,
    by_shift: &'a mut Rows<SLOPE>,
    by_turn: &'a mut Rows<SLOPE>,
    is_touching: bool,
}

const WRENCH: usize = 8;
const SLOPE: usize = 24;

/// Sums of a reaction over all lanes, in the wheel's axes: the wrench, and its derivatives by a
/// translation and by a rotation.
struct Totals {
    wrench: [f64; WRENCH],
    slopes: [[f64; SLOPE]; 2],
    is_touching: bool,
}

/// Components of a wrench.
const SIX: usize = 6;

/// The force of a soil on a wheel in a pose, with what the sand remembers.
#[must_use]
pub fn react(
    wheel: (&SandWheel, &GaussRules),
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
    (wheel, rules): (&SandWheel, &GaussRules),
    soil: &Soil,
    bed: &Bed<'_>,
    (pose, memory): (&WheelPose, &Memory),
    want: Derivatives,
) -> Reaction {
    let frame = Frame::new((wheel, rules), soil, bed, (pose, memory), want);
    let lean = pose.axle.dot(&bed.normal);
    let g = frame.immersed.g;
    let sinkage = 0.5 * wheel.width * lean.abs() + wheel.drum() * g.x - frame.immersed.height;
    let mut reaction = Reaction {
        wrench: Vector6::zeros(),
        slope: Matrix6::zeros(),
        is_touching: false,
        sinkage,
    };
    if sinkage + bed.highest <= 0.0 {
        return reaction;
    }
    let total = match instructions {
        Instructions::Baseline => frame.sum::<f64>(Single::Baseline),
        #[cfg(target_arch = "x86_64")]
        Instructions::Avx2(token) => frame.sum::<Fours>(token),
        #[cfg(target_arch = "x86_64")]
        Instructions::Avx512(token) => frame.sum::<Eights>(token),
    };
    reaction.is_touching = total.is_touching;
    for k in 0..2 {
        let part = frame.axes * Vector3::from_column_slice(&total.wrench[3 * k..3 * k + 3]);
        reaction.wrench.fixed_rows_mut::<3>(3 * k).copy_from(&part);
    }
    if want != Derivatives::Wrench {
        for (i, j) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
            let part = Matrix3::from_fn(|a, b| total.slopes[j][SIX * b + 3 * i + a]);
            let turned = frame.axes * part * frame.axes.transpose();
            let mut place = reaction.slope.fixed_view_mut::<3, 3>(3 * i, 3 * j);
            place.copy_from(&turned);
        }
    }
    if let StressLaw::Bekker(_) = soil.law {
        reaction.mobilise(wheel, memory, want);
    }
    reaction
}

impl Reaction {
    /// Takes the part of the force that a memory mobilises.
    fn mobilise(&mut self, wheel: &SandWheel, memory: &Memory, want: Derivatives) {
        let radius = wheel.drum();
        let size = memory.size(radius);
        let (part, by_size) = mobilised(size);
        if let Derivatives::Slopes { by_memory, .. } = want {
            let mut rise = memory.six() * (by_size * by_memory / size.max(f64::MIN_POSITIVE));
            for k in 3..6 {
                rise[k] *= radius * radius;
            }
            self.slope = self.slope * part + self.wrench * rise.transpose();
        }
        self.wrench *= part;
    }
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

impl<'a> Frame<'a> {
    fn new(
        (wheel, rules): (&'a SandWheel, &'a GaussRules),
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
        let turn = axes.tr_mul(&Vector3::from(memory.turn));
        let mut rolling = Rolling::new(
            (shift, turn),
            (wheel.drum(), memory.size(wheel.drum())),
            sine,
        );
        if let StressLaw::Bekker(law) = &soil.law {
            rolling.greatest = law.greatest(rolling.slip);
        }
        let height = (pose.centre - bed.place).dot(&bed.normal);
        let beyond = height - 0.5 * wheel.width * lean.abs() - bed.highest;
        Self {
            immersed: Immersed {
                wheel,
                rules,
                soil,
                g: Vector3::new(sine, 0.0, -lean),
                shift,
                turn,
                motion: MemorySize::of(&shift, &turn),
                rolling,
                height,
                highest: bed.highest,
                dry: beyond / sine.max(FLAT),
            },
            bed,
            pose,
            want,
            setting: WheelConditions {
                held: wheel.held(),
                width: wheel.width,
                gravity: bed.gravity,
                slip: rolling.slip,
            },
            axes,
        }
    }

    /// Sums the stresses over all points.
    #[inline(always)]
    fn sum<T: Lane>(&self, token: T::Token) -> Totals {
        inlined!(T::vectorize, token, {
            let (mut wrench, mut by_shift) = (zeros(), zeros());
            let mut by_turn = zeros();
            let mut sums = Sums {
                wrench: &mut wrench,
                by_shift: &mut by_shift,
                by_turn: &mut by_turn,
                is_touching: false,
            };
            let (mut feed, mut group) = (Feed::of(&self.immersed), Group::default());
            while feed.fill::<T>(token, &mut group) {
                for part in 0..MAX_LANES / T::LANES {
                    self.add::<T>(&group, (token, part * T::LANES), &mut sums);
                }
            }
            let is_touching = sums.is_touching;
            let slopes = if self.want == Derivatives::Wrench {
                [[0.0; SLOPE]; 2]
            } else {
                [
                    total::<T, _>(token, &by_shift),
                    total::<T, _>(token, &by_turn),
                ]
            };
            Totals {
                wrench: total::<T, _>(token, &wrench),
                slopes,
                is_touching,
            }
        })
    }

    /// Adds the stress on a group of points: its lanes from `first` on.
    #[inline(always)]
    fn add<T: Lane>(&self, group: &Group, (token, first): (T::Token, usize), sums: &mut Sums<'_>) {
        let number = |value: f64| T::splat(token, value);
        let lanes = |values: &[f64; MAX_LANES]| T::load(token, &values[first..first + T::LANES]);
        let (zero, one, two) = (number(0.0), number(1.0), number(2.0));
        let u = lanes(&group.u);
        let per = one / (one + u * u);
        let (p, q) = ((one - u * u) * per, two * u * per);
        let (cos, sin) = (p * p - q * q, two * p * q);
        let (radius, radial) = (lanes(&group.radius), lanes(&group.radial));
        let elements = Elements {
            r: Vec3::new(cos * radius, sin * radius, lanes(&group.offset)),
            normal: Vec3::new(cos * radial, sin * radial, lanes(&group.axial)),
            area: lanes(&group.area) * per,
        };
        let (depth, by_place) = self.depth(elements.r);
        let grows = lanes(&group.grows);
        let is_under = depth.gt(zero) & (elements.area.gt(zero) | zero.lt(grows.abs()));
        if is_under.any() {
            sums.is_touching = true;
            // What is not under counts for nothing, whatever lies beside it in a register.
            let area = T::select(is_under, elements.area, zero);
            let elements = Elements { area, ..elements };
            let depth = T::select(is_under, depth, zero);
            let slid = self.slid(&OnRing {
                angle: [cos, sin],
                end: lanes(&group.end),
                radius,
                offset: elements.r.z,
                normal: [radial, elements.normal.z],
            });
            let depth = (depth + slid.deeper).max(zero);
            let at = (group.skin, first);
            self.add_pieces(at, &elements, (depth, by_place, slid, grows), sums);
        }
    }

    /// Way of pieces since they entered. Only Bekker's law needs it.
    #[inline(always)]
    fn slid<T: Lane>(&self, at: &OnRing<T>) -> Slid<T> {
        match &self.immersed.soil.law {
            StressLaw::Bekker(_) => self.immersed.rolling.slid(at),
            StressLaw::Resistive(_) => Slid::none(at.end.token()),
        }
    }

    /// Depth that counts of pieces at `r` from the centre, m, and its gradient.
    #[inline(always)]
    fn depth<T: Lane>(&self, r: Vec3<T>) -> (T, Vec3<T>) {
        let number = |value: f64| r.x.like(value);
        let g = Vec3::splat(r.x.token(), self.immersed.g.into());
        let mut below = r.dot(g) - number(self.immersed.height);
        let mut gradient = g;
        let Some(Relief { height, ruts }) = self.bed.relief else {
            return (below, gradient);
        };
        let shared = |v: Vector3<f64>| Vec3::<T>::splat(below.token(), v.into());
        let [down, along, axle] = [0, 1, 2].map(|k| shared(self.axes.column(k).into()));
        let place = shared(self.pose.centre) + down * r.x + along * r.y + axle * r.z;
        if let Some(height) = height {
            below += self.over(place, height);
        }
        if let Some(ruts) = ruts {
            let rut = ruts.at([place.x, place.z]);
            let (reload, up) = (number(self.immersed.soil.reload), number(self.bed.normal.y));
            let left = (below - up * rut.depth) * reload;
            let [by_x, by_z] = rut.slope.map(|slope| slope * up);
            let rise = |axis: Vec3<T>| axis.x * by_x + axis.z * by_z;
            let rise = Vec3::new(rise(down), rise(along), rise(axle));
            let is_left = left.lt(below);
            below = T::select(is_left, left, below);
            gradient = Vec3::select(is_left, (g - rise) * reload, gradient);
        }
        (below, gradient)
    }

    /// Height of the undisturbed surface over the plane at places, m.
    #[inline(always)]
    fn over<T: Lane>(&self, place: Vec3<T>, height: Height<'_>) -> T {
        let (n, mut over) = (&self.bed.normal, place.x);
        for lane in 0..T::LANES {
            let x = Vector3::from(place.get(lane));
            let plane = n.dot(&(x - self.bed.place));
            let own = height(x.x, x.z).map_or(0.0, |y| plane + n.y * (y - x.y));
            over.set(lane, own);
        }
        over
    }

    #[inline(always)]
    fn add_pieces<T: Lane>(
        &self,
        (skin, first): (Skin, usize),
        elements: &Elements<T>,
        (depth, by_place, slid, grows): (T, Vec3<T>, Slid<T>, T),
        sums: &mut Sums<'_>,
    ) {
        let (r, area, token) = (elements.r, elements.area, depth.token());
        let shared = |v: Vector3<f64>| Vec3::<T>::splat(token, v.into());
        let Immersed { g, shift, turn, .. } = self.immersed;
        let piece = Piece {
            normal: elements.normal,
            x: shared(shift) + shared(turn).cross(r),
            down: shared(g),
            depth,
            slid,
            skin,
        };
        let wants_slopes = self.want != Derivatives::Wrench;
        let stress = self
            .immersed
            .soil
            .stress(&piece, &self.setting, wants_slopes);
        let force = stress.value * area;
        add_wrench((sums.wrench, first), r, force);
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
        let by_turn = [
            c * r.y - b * r.z,
            a * r.z - c * r.x,
            memory[1] * r.x - memory[0] * r.y,
        ];
        let mut columns = [[a, b, c], by_turn];
        if let StressLaw::Bekker(_) = &self.immersed.soil.law {
            let by_way = stress.by_way.map(|column| column * fresh);
            let six = columns.iter_mut().flatten().zip(piece.slid.by_memory);
            for (column, [along, across]) in six {
                *column = *column + by_way[0] * along + by_way[1] * across;
            }
            let turned = stress.value * (grows * depth.like(by_memory));
            let [down, along, turn] = self.immersed.rolling.front_turns;
            for (column, by) in [((0, 0), down), ((0, 1), along), ((1, 2), turn)] {
                columns[column.0][column.1] += turned * depth.like(by);
            }
        }
        let [by_shift, by_turn] = columns;
        for (columns, rows) in [
            (by_shift, &mut *sums.by_shift),
            (by_turn, &mut *sums.by_turn),
        ] {
            for (rows, column) in rows.chunks_exact_mut(SIX).zip(columns) {
                add_wrench((rows, first), r, column);
            }
        }
    }
}

/// No sums yet. Of one kind at a time: the compiler would clear more than two kilobytes at once by
/// an instruction that starts slowly.
#[inline(always)]
fn zeros<const N: usize>() -> Rows<N> {
    [[0.0; MAX_LANES]; N]
}

/// Sums over the lanes, from the first to the last for any number of them.
#[inline(always)]
fn total<T: Lane, const N: usize>(token: T::Token, rows: &Rows<N>) -> [f64; N] {
    let mut totals = [0.0; N];
    let blocks = rows.chunks_exact(MAX_LANES);
    for (rows, totals) in blocks.zip(totals.chunks_exact_mut(MAX_LANES)) {
        for part in 0..MAX_LANES / T::LANES {
            let first = part * T::LANES;
            let own = std::array::from_fn(
                #[inline(always)]
                |k: usize| T::load(token, &rows[k][first..first + T::LANES]),
            );
            let mut lanes = [[0.0; 8]; MAX_LANES];
            T::transpose(&own, &mut lanes);
            for lane in &lanes[..T::LANES] {
                for (total, own) in totals.iter_mut().zip(lane) {
                    *total += own;
                }
            }
        }
    }
    totals
}

/// Elements of the surface, side by side in lanes: where they are, in the wheel's axes, and how
/// large, m².
struct Elements<T> {
    r: Vec3<T>,
    normal: Vec3<T>,
    area: T,
}

/// Adds a force at r and its moment to the lanes of six sums from one on.
#[inline(always)]
fn add_wrench<T: Lane>(
    (sums, first): (&mut [[f64; MAX_LANES]], usize),
    r: Vec3<T>,
    force: Vec3<T>,
) {
    let moment = r.cross(force);
    let parts = [force.x, force.y, force.z, moment.x, moment.y, moment.z];
    for (sum, part) in sums.iter_mut().zip(parts) {
        let lanes = &mut sum[first..first + T::LANES];
        (T::load(part.token(), lanes) + part).store(lanes);
    }
}
