//! A wheel of a tree in sand, over lanes: its force along a tangent, and where that is taken.
//!
//! Forces are evaluated lane by lane, since their points fill the registers.
#![allow(clippy::inline_always)] // a call leaves the instructions that its caller is compiled for

use std::sync::Arc;

use nalgebra::{Matrix6, Vector3, Vector6};

use super::sand_tangent::{Evaluated, LaneEvaluated, TangentForce, TwistMap};
use super::sand_wheel::{LanePose, LaneWheel};
use super::six::{self, SIX, Six, minus, scaled, size};
use crate::contact::placed_wheel::PlacedWheel;
use crate::geometry::{SoftLayer, TangentPlane};
use crate::multibody::{Factor, Mechanism, Poses};
use crate::sand::memory::after_step;
use crate::sand::patch::{Height, Relief};
use crate::sand::ruts::RutsNear;
use crate::sand::{
    Bed, Derivatives, GaussRules, Memory, Reaction, RutMap, SandWheel, WheelPose, Window, react,
};
use crate::scalar::{Lane, LaneMask, MAX_LANES, Vec3, inlined};

/// Error of the linearised force of a wheel, relative to the force, at which it has settled.
const SETTLED: f64 = 2e-2;

/// Displacement in units of the sand's memory, and change of the force relative to it, by which a
/// solution may differ from where its force was linearised without a check. Under torques that jump
/// they save a seventh of all evaluations beside a quarter of these numbers, and 3% of the forces
/// that were more than 2% off are no longer found.
const UNTURNED: f64 = 2e-2;
const UNCHANGED: f64 = 3e-2;

/// Residual of a wheel's own problem, relative to the way from the last point, at which it is
/// solved. With half of it a step under torques that jump takes 4% more evaluations.
const LOCALLY_SETTLED: f64 = 0.1;

/// Part of the largest compliance that is added to all: a wheel may be held along an axis.
const HELD: f64 = 1e-9;

/// Most evaluations of the force in a wheel's own problem. With 12 a twentieth of the steps under
/// torques that jump was repeated until the limit, and the mean step took twice as many.
const MOST_EVALUATIONS: usize = 30;

/// Part of the gain of a linear problem that a step must bring.
const LEAST_GAIN: f64 = 1e-2;

/// Factor by which a step that does not bring it nearer is shortened, and the least share that is
/// tried: where the force changes otherwise than its derivative says, shorter ones gain nothing.
/// With 1e-8 random actions in sand take 1.7 times the time.
const SHORTER: f64 = 0.5;
const LEAST_SHARE: f64 = 1.0 / 16.0;

/// Cells around what of a wheel is in the sand in which ruts are looked for: it moves in a step.
const MARGIN: f64 = 2.0;

/// Soft ground of each lane; none where it is firm.
pub(crate) type Layers<'a> = [Option<SoftLayer<'a>>; MAX_LANES];

/// Ground and poses of a step.
#[derive(Clone, Copy)]
pub(crate) struct SandScene<'a, T: Lane> {
    /// Tree of the machine.
    pub mechanism: &'a Mechanism,
    /// Poses at which the step evaluates its forces.
    pub poses: &'a Poses<T>,
    /// The ground.
    pub layers: Layers<'a>,
    /// Where wheels have been, by lane.
    pub ruts: &'a [RutMap],
}

/// Ground under a lane's rover.
#[derive(Clone, Copy)]
pub(super) struct LaneGround<'a> {
    pub layer: SoftLayer<'a>,
    pub ruts: &'a RutMap,
}

impl<'a, T: Lane> SandScene<'a, T> {
    /// Ground under a lane's rover; none where it is firm.
    pub(super) fn ground(&self, lane: usize) -> Option<LaneGround<'a>> {
        let layer = self.layers[lane]?;
        Some(LaneGround {
            layer,
            ruts: &self.ruts[lane],
        })
    }
}

/// What the wheels of a step share.
#[derive(Clone, Copy, Debug)]
pub(super) struct SandStep<T> {
    /// Step, s, and its weight on its end.
    pub(super) h: f64,
    pub(super) theta: f64,
    pub(super) gravity: Vec3<T>,
    /// Length over which the sand forgets, m.
    pub(super) length: T,
}

/// A wheel of a machine in sand: geometry, linearised force and trial.
#[derive(Clone, Debug)]
pub(super) struct SandPatch<T: Lane> {
    pub(super) wheel: PlacedWheel,
    /// Gauss rules for the points of the wheel, by lane.
    pub(super) rules: [Option<Arc<GaussRules>>; MAX_LANES],
    pub(super) map: TwistMap<T>,
    pub(super) pose: LanePose<T>,
    /// The pose at the end of the last trial.
    pub(super) end: LanePose<T>,
    pub(super) force: TangentForce<T>,
    found: LaneEvaluated<T>,
    /// All columns, for its compliance.
    rows: Vec<Six<T>>,
    /// Lanes whose force is to be evaluated at the velocity before the step.
    pub(super) is_stale: T::Mask,
    /// Ruts near the wheel, by lane; meaningless where there are none.
    windows: Vec<Window>,
    rutted: u32,
    /// Lanes whose sand should have given more than it has stored in this step.
    pub(super) is_empty: T::Mask,
    pub(super) begin: LaneWheel<T>,
    pub(super) tried: LaneWheel<T>,
}

impl<T: Lane> SandPatch<T> {
    /// Patch of a wheel that is clear of the ground.
    pub(super) fn new(token: T::Token, mechanism: &Mechanism, wheel: PlacedWheel) -> Self {
        let (map, nobody) = (
            TwistMap::new(token, mechanism, wheel.body),
            T::mask(token, 0),
        );
        Self {
            wheel,
            rules: std::array::from_fn(|_| None),
            rows: vec![[T::splat(token, 0.0); SIX]; map.path.len()],
            map,
            pose: LanePose::new(token),
            end: LanePose::new(token),
            force: TangentForce::new(token),
            found: LaneEvaluated::new(token),
            is_stale: nobody,
            windows: vec![Window::default(); T::LANES],
            rutted: 0,
            is_empty: nobody,
            begin: LaneWheel::new(token),
            tried: LaneWheel::new(token),
        }
    }

    pub(super) fn shape(&self) -> &SandWheel {
        &self.wheel.shape
    }

    /// Puts the wheel where the step evaluates its forces.
    #[inline(always)]
    fn place(&mut self, poses: &Poses<T>) {
        self.pose = self.map.place(&self.wheel, poses);
    }

    /// Puts the wheel there in a step with given forces.
    pub(super) fn place_given(&mut self, scene: &SandScene<'_, T>, lanes: T::Mask) {
        self.place(scene.poses);
        for lane in each(lanes) {
            if let Some(ground) = scene.ground(lane) {
                self.read_ruts(lane, &ground);
            }
        }
    }

    /// Evaluates force and tangent at the velocity `v` (nv) in some lanes.
    pub(super) fn linearise(
        &mut self,
        step: &SandStep<T>,
        scene: &SandScene<'_, T>,
        lanes: T::Mask,
        v: &[T],
    ) {
        let token = step.length.token();
        let at = inlined!(T::vectorize, token, {
            self.place(scene.poses);
            self.map.twist(v)
        });
        for lane in each(lanes) {
            if let Some(ground) = scene.ground(lane) {
                self.read_ruts(lane, &ground);
                let found = self.evaluate(step, lane, &ground, &six::get(&at, lane));
                self.found.enter(lane, &found);
            }
        }
        self.take(token, lanes);
    }

    fn take(&mut self, token: T::Token, lanes: T::Mask) {
        let arms = [self.wheel.shape.radius, self.wheel.shape.drum()];
        let Self { force, found, .. } = self;
        inlined!(T::vectorize, token, force.take(lanes, found, arms));
    }

    /// The force at a lane's twist and its derivative by the twist.
    fn evaluate(
        &self,
        step: &SandStep<T>,
        lane: usize,
        ground: &LaneGround<'_>,
        at: &Vector6<f64>,
    ) -> Evaluated {
        let (end, memory, fresh) = self.ended(step, lane, at);
        // A memory that fades as a whole hardly changes the force.
        let want = Derivatives::Slopes {
            by_memory: fresh,
            by_pose: step.theta * step.h,
        };
        let gravity = Vector3::from(step.gravity.get(lane));
        let found = self.react(lane, (ground, &gravity), &end, &memory, want);
        let found = found.filter(|found| found.is_touching);
        Evaluated {
            at: *at,
            is_touching: found.is_some(),
            force: found.map_or_else(Vector6::zeros, |found| found.wrench),
            slope: found.map_or_else(Matrix6::zeros, |found| found.slope),
        }
    }

    /// Pose and memory at the end of a step with a twist in a lane, and the multiple of the
    /// identity in the derivative of the memory by the twist, s/m.
    pub(super) fn ended(
        &self,
        step: &SandStep<T>,
        lane: usize,
        twist: &Vector6<f64>,
    ) -> (WheelPose, Memory, f64) {
        let pose = self.pose.get(lane);
        let pose = LanePose::<f64> {
            centre: pose.centre.into(),
            axle: pose.axle.into(),
        };
        let twist: Six<f64> = (*twist).into();
        let end = pose.moved(&twist, step.theta * step.h).get(0);
        let memory = six::get(&self.begin.memory, lane).into();
        let times = (step.h, step.length.get(lane));
        let (memory, fresh) = after_step::<f64>(&memory, &twist, self.shape().drum(), times);
        (end, Memory::of(&memory.into()), fresh)
    }

    /// Compares the linearised force at a solution with the force there, in some lanes. Where they
    /// differ, the force is linearised anew, where the wheel would go if the rest of the machine
    /// answered it linearly. Returns those lanes.
    pub(super) fn revise(
        &mut self,
        step: &SandStep<T>,
        scene: &SandScene<'_, T>,
        lanes: T::Mask,
        factor: &Factor<T>,
        v_end: &[T],
    ) -> T::Mask {
        let token = step.length.token();
        let arm = self.wheel.shape.radius;
        let (twist, applied, is_open) = inlined!(T::vectorize, token, {
            let twist = self.map.twist(v_end);
            let applied = self.force.applied(&twist);
            (twist, applied, self.is_open(step, &twist, &applied))
        });
        let (mut compliance, mut is_new) = (None, 0);
        for lane in each(is_open & lanes) {
            let Some(ground) = scene.ground(lane) else {
                continue;
            };
            let found = self.evaluate(step, lane, &ground, &six::get(&twist, lane));
            let applied = six::get(&applied, lane);
            let sizes = [found.force - applied, found.force, applied]
                .map(|wrench| size::<f64>(&wrench.into(), arm));
            if sizes[0] <= SETTLED * sizes[1].max(sizes[2]) {
                continue;
            }
            let mechanism = scene.mechanism;
            let A = compliance.get_or_insert_with(|| {
                inlined!(T::vectorize, token, self.compliance(mechanism, factor))
            });
            let A = six::matrix_of(A, lane) * step.h;
            let found = self.settle(step, (lane, &ground), &A, &found);
            self.found.enter(lane, &found);
            is_new |= 1 << lane;
        }
        let is_new = T::mask(token, is_new);
        if is_new.any() {
            self.take(token, is_new);
        }
        is_new
    }

    /// Whether a solution is far from where the force was linearised.
    #[inline(always)]
    fn is_open(&self, step: &SandStep<T>, twist: &Six<T>, applied: &Six<T>) -> T::Mask {
        let (arm, h) = (self.wheel.shape.radius, step.length.like(step.h));
        let way = scaled(&minus(twist, &self.force.at), self.wheel.shape.drum());
        let turned = six::dot(&way, &way).sqrt() * h / step.length;
        let changed = size(&minus(applied, &self.force.force), arm);
        let most = h.like(UNCHANGED) * size(applied, arm);
        !(turned.lt(h.like(UNTURNED)) & changed.le(most))
    }

    /// `J M̂⁻¹ Jᵀ`: the twist per impulse on the wheel.
    #[inline(always)]
    fn compliance(&mut self, mechanism: &Mechanism, factor: &Factor<T>) -> six::Square<T> {
        let zero = self.map.arm.x.like(0.0);
        self.map.write_columns(&mut self.rows);
        factor.half_solve_path(mechanism, self.wheel.body, &mut self.rows);
        let mut sum = [[zero; SIX]; SIX];
        for row in &self.rows {
            for (column, x) in sum.iter_mut().zip(row) {
                *column = six::plus(column, *x, row);
            }
        }
        sum
    }

    /// Newton's method for `x − u = A (F(x) − F_lin(x))` in a lane, from the solution u of the
    /// linearised problem; A: what a force does to the twist in a step. A step that does not bring
    /// x nearer is shortened. A residual g counts `√(gᵀ A⁻¹ g)`, the root of twice the kinetic
    /// energy of the machine that moves so. By its length, the wheel's rotation counts most, whose
    /// inertia is small, and a step takes an eighth more evaluations.
    fn settle(
        &self,
        step: &SandStep<T>,
        (lane, ground): (usize, &LaneGround<'_>),
        A: &Matrix6<f64>,
        start: &Evaluated,
    ) -> Evaluated {
        let u = start.at;
        let (at, force) = (
            six::get(&self.force.at, lane),
            six::get(&self.force.force, lane),
        );
        let tangent = six::matrix_of(&self.force.tangent, lane);
        let residual = |x: &Evaluated| x.at - u - A * (x.force - force + tangent * (x.at - at));
        let root = self.root(A);
        let size = |g: &Vector6<f64>| {
            let mut g = *g;
            root.solve_lower_triangular_mut(&mut g);
            g.norm()
        };
        let near = LOCALLY_SETTLED * size(&(u - at));
        let mut best = *start;
        let mut rest = residual(&best);
        let mut evaluations = 1;
        while size(&rest) > near {
            let slope = Matrix6::identity() - product(A, &(best.slope + tangent));
            let Some(way) = slope.lu().solve(&rest) else {
                break;
            };
            let mut share = 1.0;
            loop {
                let found = self.evaluate(step, lane, ground, &(best.at - way * share));
                let left = residual(&found);
                evaluations += 1;
                if size(&left) < (1.0 - LEAST_GAIN * share) * size(&rest) {
                    (best, rest) = (found, left);
                    break;
                }
                share *= SHORTER;
                if evaluations >= MOST_EVALUATIONS || share < LEAST_SHARE {
                    return best;
                }
            }
        }
        best
    }

    /// The lower factor L of `A = L Lᵀ`.
    fn root(&self, A: &Matrix6<f64>) -> Matrix6<f64> {
        let arm = self.shape().drum();
        let scale = [1.0, 1.0, 1.0, arm, arm, arm];
        let largest = (0..6).fold(f64::MIN_POSITIVE, |most, k| {
            most.max(A[(k, k)] * scale[k] * scale[k])
        });
        let mut L = *A;
        for k in 0..6 {
            L[(k, k)] += HELD * largest / (scale[k] * scale[k]);
            for i in 0..k {
                let known = (0..i).fold(L[(k, i)], |sum, j| sum - L[(k, j)] * L[(i, j)]);
                L[(k, i)] = known / L[(i, i)];
            }
            let known = (0..k).fold(L[(k, k)], |sum, j| sum - L[(k, j)] * L[(k, j)]);
            L[(k, k)] = known.max(f64::MIN_POSITIVE).sqrt();
        }
        L
    }

    /// How far from its centre the wheel may be in the sand, m, along x and z.
    pub(super) fn reach(&self, layer: &SoftLayer<'_>, pose: &WheelPose) -> [f64; 2] {
        let radius = self.shape().drum();
        let Some(tangent) = layer.tangent(&pose.centre, 0.5 * radius) else {
            return [0.0; 2];
        };
        let above = radius - depth(self.shape(), pose, &tangent) - tangent.highest;
        let chord = (radius * radius - above.max(0.0) * above.max(0.0)).max(0.0);
        let n = tangent.normal;
        let tilt = (n.x * n.x + n.z * n.z).sqrt();
        let along = (chord.sqrt() + radius * tilt).min(radius);
        let across = 0.5 * self.shape().width.max(layer.cell);
        let a = pose.axle;
        let level = (a.x * a.x + a.z * a.z).sqrt().max(f64::MIN_POSITIVE);
        let (x, z) = (a.x.abs() / level, a.z.abs() / level);
        [along * z + across * x, along * x + across * z]
    }

    /// Reads the ruts near the wheel of a lane.
    fn read_ruts(&mut self, lane: usize, ground: &LaneGround<'_>) {
        let is_rutted = !ground.ruts.is_empty() && {
            let pose = self.pose.get(lane);
            let (cell, c) = (ground.layer.cell, pose.centre);
            let reach = self.reach(&ground.layer, &pose);
            let reach = reach.map(|reach| reach + MARGIN * cell);
            let window = &mut self.windows[lane];
            ground.ruts.read([c.x, c.z], reach, cell, window)
        };
        self.rutted = self.rutted & !(1 << lane) | u32::from(is_rutted) << lane;
    }

    /// The reaction of the sand under a lane; none where there is no ground.
    pub(super) fn react(
        &self,
        lane: usize,
        (place, gravity): (&LaneGround<'_>, &Vector3<f64>),
        pose: &WheelPose,
        memory: &Memory,
        want: Derivatives,
    ) -> Option<Reaction> {
        let ground = &place.layer;
        let radius = self.shape().drum();
        let tangent = ground.tangent(&pose.centre, 0.5 * radius)?;
        let n = tangent.normal;
        let is_rutted = self.rutted >> lane & 1 == 1;
        let height = |x: f64, z: f64| ground.surface.height(x, z);
        let height: Option<Height<'_>> = (!tangent.is_exact).then_some(&height);
        let ruts = is_rutted.then_some(RutsNear {
            map: place.ruts,
            window: &self.windows[lane],
            cell: ground.cell,
        });
        let has_relief = height.is_some() || ruts.is_some();
        let relief = has_relief.then_some(Relief { height, ruts });
        let bed = Bed {
            place: tangent.place,
            normal: n,
            relief,
            highest: tangent.highest,
            gravity: -gravity.dot(&n),
        };
        let rules = self.rules[lane].as_deref()?;
        let found = react((self.shape(), rules), ground.soil, &bed, pose, memory, want);
        Some(found)
    }
}

/// The lanes of a mask.
pub(super) fn each<M: LaneMask>(lanes: M) -> impl Iterator<Item = usize> {
    let bits = lanes.bits();
    (0..MAX_LANES).filter(move |lane| bits >> lane & 1 == 1)
}

/// `a b`. That of nalgebra multiplies matrices of this size by fused multiply-adds where the
/// processor has them.
fn product(a: &Matrix6<f64>, b: &Matrix6<f64>) -> Matrix6<f64> {
    Matrix6::from_fn(|i, j| (0..6).fold(0.0, |sum, k| sum + a[(i, k)] * b[(k, j)]))
}

/// Depth of the lowest point of a wheel under a tangent plane, m.
pub(super) fn depth(wheel: &SandWheel, pose: &WheelPose, tangent: &TangentPlane) -> f64 {
    let lean = pose.axle.dot(&tangent.normal);
    let upright = (1.0 - lean * lean).max(0.0).sqrt();
    let height = (pose.centre - tangent.place).dot(&tangent.normal);
    0.5 * wheel.width * lean.abs() + wheel.drum() * upright - height
}
