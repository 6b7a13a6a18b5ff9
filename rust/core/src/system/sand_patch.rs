//! A wheel of a tree in sand: its force along a tangent, and where that is taken.

use std::sync::Arc;

use nalgebra::{ArrayStorage, Matrix6, Vector3, Vector6};

use crate::geometry::{SoftLayer, Tangent};
use crate::multibody::{Factor, Kinematics, MassMatrix, Model};
use crate::sand::patch::{Heights, Relief};
use crate::sand::ruts::Rut;
use crate::sand::{
    Bed, Derivatives, Memory, Reaction, Rules, RutMap, SandWheel, Twist, WheelInSand, WheelPose,
    Window, react,
};

/// Error of the linearised force of a wheel, relative to the force, at which it has settled.
const SETTLED: f64 = 2e-2;

/// Displacement in units of the sand's memory, and change of the force relative to it, by which a
/// solution may differ from where its force was linearised without a check. Under torques that jump
/// they save a seventh of all evaluations beside a quarter of these numbers, and 3% of the forces
/// that were more than 2% off are no longer found.
const UNTURNED: f64 = 2e-2;
const UNCHANGED: f64 = 3e-2;

/// Residual of a wheel's own problem, relative to the way from the last point, at which it is
/// solved.
const LOCALLY_SETTLED: f64 = 5e-2;

/// Most evaluations of the force in a wheel's own problem. With 12 a twentieth of the steps under
/// torques that jump was repeated until the limit, and the mean step took twice as many.
const MOST_EVALUATIONS: usize = 30;

/// Part of the gain of a linear problem that a step must bring.
const LEAST_GAIN: f64 = 1e-2;

/// Factor by which a step that does not bring it nearer is shortened.
const SHORTER: f64 = 0.5;

/// Cells around what of a wheel is in the sand in which ruts are looked for: it moves in a step.
const MARGIN: f64 = 2.0;

/// Twist, m/s, below which two points are the same: a secant between them would be noise.
const TINY: f64 = 1e-6;

/// Ground and poses of a step.
#[derive(Clone, Copy)]
pub(crate) struct SandScene<'a> {
    /// The machine.
    pub model: &'a Model,
    /// The ground.
    pub ground: SoftLayer<'a>,
    /// Where wheels have been.
    pub ruts: &'a RutMap,
    /// Poses at which the step evaluates its forces.
    pub kinematics: &'a Kinematics,
}

/// What the wheels of a step share.
#[derive(Clone, Debug)]
pub(super) struct SandStep {
    /// Step, s, and its weight on its end.
    pub(super) h: f64,
    pub(super) theta: f64,
    pub(super) gravity: Vector3<f64>,
    /// Length over which the sand forgets, m.
    pub(super) length: f64,
}

/// The force at a twist and its derivative by the twist.
#[derive(Clone, Copy)]
struct Evaluated {
    at: Vector6<f64>,
    force: Vector6<f64>,
    slope: Matrix6<f64>,
    is_touching: bool,
}

/// A wheel of a machine in sand: geometry, linearised force and trial.
#[derive(Clone, Debug)]
#[allow(clippy::struct_excessive_bools)] // facts that do not depend on each other
pub(super) struct Patch {
    pub(super) wheel: SandWheel,
    pub(super) rules: Arc<Rules>,
    pub(super) body: usize,
    /// Velocities that move it, and the twist that each gives it.
    pub(super) path: Vec<usize>,
    pub(super) columns: Vec<Vector6<f64>>,
    pub(super) pose: WheelPose,
    /// Twist at which the force was evaluated.
    pub(super) at: Vector6<f64>,
    pub(super) force: Vector6<f64>,
    pub(super) tangent: Matrix6<f64>,
    /// Columns along the path, for its compliance, and the products of the tangent with them.
    rows: Vec<[f64; 6]>,
    stiff: Vec<Vector6<f64>>,
    /// The latter as wrenches on the free base.
    on_base: Vec<Vector6<f64>>,
    /// From the origin of the tree to the wheel's centre, m.
    arm: Vector3<f64>,
    /// Whether the force is to be evaluated at the velocity before the step.
    pub(super) is_stale: bool,
    /// Twist and force of the last linearisation in this step.
    pub(super) last: Option<(Vector6<f64>, Vector6<f64>)>,
    pub(super) is_touching: bool,
    /// Ruts near the wheel; meaningless where there are none.
    pub(super) window: Window,
    pub(super) is_rutted: bool,
    /// Whether the sand should have given more than it has stored in this step.
    pub(super) is_empty: bool,
    pub(super) begin: WheelInSand,
    pub(super) tried: WheelInSand,
}

impl Patch {
    /// Of a wheel of a model, clear of the ground.
    pub(super) fn new(model: &Model, body: usize, wheel: SandWheel, rules: Arc<Rules>) -> Self {
        let path = model.mechanism().path(body).to_vec();
        Self {
            rules,
            wheel,
            body,
            columns: vec![Vector6::zeros(); path.len()],
            rows: vec![[0.0; 6]; path.len()],
            stiff: vec![Vector6::zeros(); path.len()],
            on_base: vec![Vector6::zeros(); path.len()],
            arm: Vector3::zeros(),
            path,
            pose: WheelPose {
                centre: Vector3::zeros(),
                axle: Vector3::z(),
            },
            at: Vector6::zeros(),
            force: Vector6::zeros(),
            tangent: Matrix6::zeros(),
            is_stale: true,
            last: None,
            is_touching: false,
            window: Window::default(),
            is_rutted: false,
            is_empty: false,
            begin: WheelInSand::default(),
            tried: WheelInSand::default(),
        }
    }

    fn set_columns(&mut self, model: &Model, kinematics: &Kinematics) {
        let x = self.pose.centre - kinematics.origin(self.body);
        self.arm = x;
        let lead = model.lead(self.body);
        let (base, rest) = self.columns.split_at_mut(lead);
        for (k, column) in base.iter_mut().enumerate() {
            let mut unit = Vector3::zeros();
            unit[k % 3] = 1.0;
            *column = if k < 3 {
                six(&unit, &Vector3::zeros())
            } else {
                six(&unit.cross(&x), &unit)
            };
        }
        for (column, mover) in rest.iter_mut().zip(model.movers(self.body)) {
            let axis = kinematics.motions()[mover.motion].axis.into();
            *column = six(&kinematics.velocity_at(mover.motion, &x), &axis);
        }
    }

    pub(super) fn twist(&self, v: &[f64]) -> Vector6<f64> {
        let mut twist = Vector6::zeros();
        for (&k, column) in self.path.iter().zip(&self.columns) {
            twist += column * v[k];
        }
        twist
    }

    /// Puts the wheel where the step evaluates its forces.
    pub(super) fn place(&mut self, place: SandScene<'_>, w: usize) {
        self.pose = pose(place.model, place.kinematics, w);
        self.set_columns(place.model, place.kinematics);
        self.read_ruts(place);
    }

    /// The force at a twist and its derivative by the twist.
    fn evaluate(&self, step: &SandStep, place: SandScene<'_>, at: &Vector6<f64>) -> Evaluated {
        let twist = Twist::of(at);
        let lag = step.theta * step.h;
        let end = moved(&self.pose, &twist, lag);
        let times = (step.h, step.length);
        let recalled = self.begin.memory.after(&twist, self.wheel.drum(), times);
        // A memory that fades as a whole hardly changes the force.
        let want = Derivatives::Slopes {
            by_memory: recalled.fresh,
            by_pose: lag,
        };
        let found = self.react((place, &step.gravity), &end, &recalled.memory, want);
        let found = found.filter(|found| found.is_touching);
        Evaluated {
            at: *at,
            is_touching: found.is_some(),
            force: found.map_or_else(Vector6::zeros, |found| found.wrench),
            slope: found.map_or_else(Matrix6::zeros, |found| found.slope),
        }
    }

    /// Evaluates force and tangent at a twist.
    pub(super) fn linearise(&mut self, step: &SandStep, place: SandScene<'_>, at: &Vector6<f64>) {
        let found = self.evaluate(step, place, at);
        self.take(&found);
    }

    fn take(&mut self, found: &Evaluated) {
        (self.at, self.is_touching) = (found.at, found.is_touching);
        (self.force, self.tangent) = (found.force, Matrix6::zeros());
        if found.is_touching {
            self.tangent = dissipative(&-found.slope, self.wheel.radius);
            self.add_secant();
        }
    }

    /// Compares the linearised force at a solution with the force there. If they differ, the force
    /// is linearised anew, where the wheel would go if the rest of the machine answered it
    /// linearly.
    pub(super) fn revise(
        &mut self,
        step: &SandStep,
        place: SandScene<'_>,
        factor: &Factor<f64>,
        six: &Vector6<f64>,
    ) -> bool {
        let arm = self.wheel.radius;
        let applied = self.applied(six);
        let way = scaled(&(six - self.at), self.wheel.drum()).norm();
        let turned = way * step.h / step.length;
        let changed = size(&(applied - self.force), arm);
        if turned < UNTURNED && changed <= UNCHANGED * size(&applied, arm) {
            return false;
        }
        let found = self.evaluate(step, place, six);
        let error = size(&(found.force - applied), arm);
        if error <= SETTLED * size(&found.force, arm).max(size(&applied, arm)) {
            return false;
        }
        let compliance = self.compliance(place.model, factor) * step.h;
        let found = self.settle(step, place, &compliance, &found);
        self.take(&found);
        true
    }

    /// `J M̂⁻¹ Jᵀ`: the twist per impulse on the wheel.
    fn compliance(&mut self, model: &Model, factor: &Factor<f64>) -> Matrix6<f64> {
        for (row, column) in self.rows.iter_mut().zip(&self.columns) {
            *row = (*column).into();
        }
        factor.half_solve_path(model.mechanism(), self.body, &mut self.rows);
        let mut sum = Matrix6::zeros();
        for row in &self.rows {
            let row = Vector6::from(*row);
            sum += row * row.transpose();
        }
        sum
    }

    /// Newton's method for `x − u = A (F(x) − F_lin(x))`, from the solution u of the linearised
    /// problem; A: what a force does to the twist in a step. A step that does not bring x nearer is
    /// shortened.
    fn settle(
        &self,
        step: &SandStep,
        place: SandScene<'_>,
        A: &Matrix6<f64>,
        start: &Evaluated,
    ) -> Evaluated {
        let arm = self.wheel.drum();
        let u = start.at;
        let residual =
            |x: &Evaluated| x.at - u - A * (x.force - self.force + self.tangent * (x.at - self.at));
        let length = |g: &Vector6<f64>| scaled(g, arm).norm();
        let near = LOCALLY_SETTLED * length(&(u - self.at));
        let mut best = *start;
        let mut rest = residual(&best);
        let mut evaluations = 1;
        while length(&rest) > near {
            let slope = Matrix6::identity() - product(A, &(best.slope + self.tangent));
            let Some(way) = slope.lu().solve(&rest) else {
                break;
            };
            let mut share = 1.0;
            loop {
                let found = self.evaluate(step, place, &(best.at - way * share));
                let left = residual(&found);
                evaluations += 1;
                if length(&left) < (1.0 - LEAST_GAIN * share) * length(&rest) {
                    (best, rest) = (found, left);
                    break;
                }
                if evaluations >= MOST_EVALUATIONS {
                    return best;
                }
                share *= SHORTER;
            }
        }
        best
    }

    /// Stiffens the tangent along the way from the last point, so that it is at least the secant
    /// between both: where the sand yields its own tangent is nearly zero, and a step that reverses
    /// would leave the point where it stops far behind.
    fn add_secant(&mut self) {
        if let Some((twist, force)) = &self.last {
            let arm = self.wheel.drum();
            let lengths = |x: &Vector6<f64>| scaled(x, arm);
            let way = lengths(&(self.at - twist));
            let square = way.norm_squared();
            if square > TINY * TINY {
                let secant = -scaled(&(self.force - force), 1.0 / arm).dot(&way) / square;
                let own = (self.at - twist).dot(&(self.tangent * (self.at - twist))) / square;
                let more = (secant - own).max(0.0) / square;
                // LLVM 22.1 vectorises `w wᵀ more` beside `norm_squared` with w₁² in the place of
                // w₀ w₁ (docs/decisions/0019-same-bits.md).
                let stiff = scaled(&way, arm) * more.sqrt();
                self.tangent += stiff * stiff.transpose();
            }
        }
        self.last = Some((self.at, self.force));
    }

    /// `M += h Jᵀ C J`.
    ///
    /// The columns of a free base are those of a rigid body, `(e, 0)` and `(e × x, e)`, so products
    /// with them are sums of a few terms.
    pub(super) fn add_to_mass(&mut self, model: &Model, h: f64, mass: &mut MassMatrix<f64>) {
        let lead = model.lead(self.body);
        let x = self.arm;
        let tangent = self.tangent * h;
        let on_base = |six: &Vector6<f64>| {
            let force = six.fixed_rows::<3>(0);
            let turned = x.cross(&force) + six.fixed_rows::<3>(3);
            Vector6::new(six[0], six[1], six[2], turned.x, turned.y, turned.z)
        };
        for (k, (stiff, column)) in self.stiff.iter_mut().zip(&self.columns).enumerate() {
            *stiff = if k < lead {
                let mut product = tangent.column(k).into_owned();
                if k >= 3 {
                    for d in 0..3 {
                        product += tangent.column(d) * column[d];
                    }
                }
                product
            } else {
                times(&tangent, column)
            };
        }
        for (on_base_of, stiff) in self.on_base.iter_mut().zip(&self.stiff) {
            *on_base_of = on_base(stiff);
        }
        mass.add_quadratic(model.mechanism(), &self.path, |i, j| {
            if j < lead {
                self.on_base[i][j]
            } else {
                self.columns[j].dot(&self.stiff[i])
            }
        });
    }

    /// The linearised force at a twist.
    pub(super) fn applied(&self, twist: &Vector6<f64>) -> Vector6<f64> {
        self.force - self.tangent * (twist - self.at)
    }

    /// How far from its centre the wheel may be in the sand, m, along x and z.
    pub(super) fn reach(&self, ground: SoftLayer<'_>, pose: &WheelPose) -> [f64; 2] {
        let radius = self.wheel.drum();
        let Some(tangent) = ground.tangent(&pose.centre, 0.5 * radius) else {
            return [0.0; 2];
        };
        let above = radius - depth(&self.wheel, pose, &tangent) - tangent.highest;
        let chord = (radius * radius - above.max(0.0) * above.max(0.0)).max(0.0);
        let n = tangent.normal;
        let tilt = (n.x * n.x + n.z * n.z).sqrt();
        let along = (chord.sqrt() + radius * tilt).min(radius);
        let across = 0.5 * self.wheel.width.max(ground.cell);
        let a = pose.axle;
        let level = (a.x * a.x + a.z * a.z).sqrt().max(f64::MIN_POSITIVE);
        let (x, z) = (a.x.abs() / level, a.z.abs() / level);
        [along * z + across * x, along * x + across * z]
    }

    /// Reads the ruts near the wheel.
    fn read_ruts(&mut self, place: SandScene<'_>) {
        let reach = self.reach(place.ground, &self.pose);
        let (cell, c) = (place.ground.cell, self.pose.centre);
        let reach = reach.map(|reach| reach + MARGIN * cell);
        self.is_rutted = (place.ruts).read([c.x, c.z], reach, cell, &mut self.window);
    }

    fn react(
        &self,
        (place, gravity): (SandScene<'_>, &Vector3<f64>),
        pose: &WheelPose,
        memory: &Memory,
        want: Derivatives,
    ) -> Option<Reaction> {
        let ground = place.ground;
        let radius = self.wheel.drum();
        let tangent = ground.tangent(&pose.centre, 0.5 * radius)?;
        let (cell, n) = (ground.cell, tangent.normal);
        let is_rutted = self.is_rutted;
        let heights = |x: &Vector3<f64>| {
            let over = if tangent.is_exact {
                0.0
            } else {
                let plane = n.dot(&(x - tangent.place));
                let height = ground.surface.height(x.x, x.z);
                height.map_or(0.0, |y| plane + n.y * (y - x.y))
            };
            let rut = if is_rutted {
                place.ruts.rut_in(&self.window, [x.x, x.z], cell)
            } else {
                Rut::default()
            };
            Heights {
                virgin: over,
                left: over - n.y * rut.depth,
                slope: Vector3::new(rut.slope[0], 0.0, rut.slope[1]) * -n.y,
            }
        };
        let relief: Option<Relief<'_>> = if tangent.is_exact && !is_rutted {
            None
        } else {
            Some(&heights)
        };
        let bed = Bed {
            place: tangent.place,
            normal: n,
            relief,
            highest: tangent.highest,
            gravity: -gravity.dot(&n),
        };
        let found = react(
            (&self.wheel, &self.rules),
            ground.soil,
            &bed,
            pose,
            memory,
            want,
        );
        Some(found)
    }
}

/// The same with its angular part multiplied by `arm`.
fn scaled(x: &Vector6<f64>, arm: f64) -> Vector6<f64> {
    Vector6::new(x[0], x[1], x[2], arm * x[3], arm * x[4], arm * x[5])
}

fn six(linear: &Vector3<f64>, angular: &Vector3<f64>) -> Vector6<f64> {
    Vector6::new(
        linear.x, linear.y, linear.z, angular.x, angular.y, angular.z,
    )
}

/// Size of a wrench, N, with moments at an arm, m.
fn size(wrench: &Vector6<f64>, arm: f64) -> f64 {
    let moment = wrench.fixed_rows::<3>(3).norm_squared() / (arm * arm);
    (wrench.fixed_rows::<3>(0).norm_squared() + moment).sqrt()
}

/// `a x`, column by column.
fn times(a: &Matrix6<f64>, x: &Vector6<f64>) -> Vector6<f64> {
    let mut sum = a.column(0) * x[0];
    for k in 1..6 {
        sum += a.column(k) * x[k];
    }
    sum
}

/// `a b`. That of nalgebra multiplies matrices of this size by fused multiply-adds where the
/// processor has them.
fn product(a: &Matrix6<f64>, b: &Matrix6<f64>) -> Matrix6<f64> {
    Matrix6::from_fn(|i, j| (0..6).fold(0.0, |sum, k| sum + a[(i, k)] * b[(k, j)]))
}

/// Pose of a wheel, world.
pub(super) fn pose(model: &Model, kinematics: &Kinematics, wheel: usize) -> WheelPose {
    let wheel = &model.wheels()[wheel];
    WheelPose {
        centre: kinematics.origin(wheel.body) + kinematics.point(wheel.body, &wheel.centre),
        axle: kinematics.R(wheel.body) * wheel.axle,
    }
}

/// The pose after a time with a twist, to first order.
pub(super) fn moved(pose: &WheelPose, twist: &Twist, time: f64) -> WheelPose {
    let axle = pose.axle + twist.angular.cross(&pose.axle) * time;
    WheelPose {
        centre: pose.centre + twist.linear * time,
        axle: axle / axle.norm(),
    }
}

/// Depth of the lowest point of a wheel under a tangent plane, m.
pub(super) fn depth(wheel: &SandWheel, pose: &WheelPose, tangent: &Tangent) -> f64 {
    let lean = pose.axle.dot(&tangent.normal);
    let upright = (1.0 - lean * lean).max(0.0).sqrt();
    let height = (pose.centre - tangent.place).dot(&tangent.normal);
    0.5 * wheel.width * lean.abs() + wheel.drum() * upright - height
}

/// Pivot, relative to the largest, below which it is dropped.
const DROPPED: f64 = 1e-9;

/// The symmetric part of a matrix without its negative pivots: `Σ d_k l_k l_kᵀ` over the positive
/// pivots d_k of its factor `L D Lᵀ`, with entries of l_k that leave no diagonal negative. Angles
/// are scaled to lengths by `arm`, m.
fn dissipative(matrix: &Matrix6<f64>, arm: f64) -> Matrix6<f64> {
    let scale = [1.0, 1.0, 1.0, arm, arm, arm];
    let per = scale.map(|scale| 1.0 / scale);
    let m = &matrix.data.0;
    // Lower triangles; what stands above them is not read.
    let (mut rest, mut sum) = ([[0.0; 6]; 6], [[0.0; 6]; 6]);
    let mut largest = 0.0_f64;
    for i in 0..6 {
        for j in 0..=i {
            rest[i][j] = 0.5 * (m[j][i] + m[i][j]) * (per[i] * per[j]);
        }
        largest = largest.max(rest[i][i]);
    }
    for k in 0..6 {
        let pivot = rest[k][k];
        if pivot <= DROPPED * largest {
            continue;
        }
        // Of a positive matrix no entry is larger; of another one, a small pivot would give an
        // arbitrarily large part.
        let mut column = [0.0; 6];
        column[k] = 1.0;
        let per_pivot = 1.0 / pivot;
        for i in k + 1..6 {
            let most = (pivot * rest[i][i].max(0.0)).sqrt();
            column[i] = rest[i][k].min(most).max(-most) * per_pivot;
        }
        for i in k..6 {
            let part = column[i] * pivot;
            for j in 0..6 {
                sum[i][j] += part * column[j];
                rest[i][j] -= part * column[j];
            }
        }
    }
    for i in 0..6 {
        for j in 0..=i {
            sum[i][j] *= scale[i] * scale[j];
            sum[j][i] = sum[i][j];
        }
    }
    Matrix6::from_data(ArrayStorage(sum))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_dissipative_matrix_is_kept_and_a_negative_one_dropped() {
        let a = Matrix6::from_fn(|i, j| ((i * 7 + j * 3) % 5) as f64 * 0.2);
        let positive = a * a.transpose() + Matrix6::identity();
        assert!((dissipative(&positive, 0.1) - positive).norm() < 1e-9);
        assert_eq!(dissipative(&-positive, 0.1), Matrix6::zeros());
    }

    /// A wheel that hardly touches had a tangent of 5e19 N s/m, and the mass matrix no factor.
    #[test]
    fn a_matrix_that_is_not_positive_gives_no_part_beyond_its_diagonal() {
        let mut saddle = Matrix6::from_diagonal_element(1e-22);
        (saddle[(0, 1)], saddle[(1, 0)]) = (0.1, 0.1);
        saddle[(2, 2)] = 1e-23;
        let found = dissipative(&saddle, 0.1);
        assert!(
            (0..6).all(|k| found[(k, k)] <= 2.0 * saddle[(k, k)]),
            "{found}"
        );
    }
}
