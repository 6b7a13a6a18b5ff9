//! Sand under the wheels of a tree, implicit in the velocity at the end of the step.
//!
//! The force of the sand on a wheel at the end of the step is taken along its tangent there,
//!
//! ```text
//! F(v⁺) = F* − C (J v⁺ − V*),    M̂ = M + h Σ Jᵀ C J
//! ```
//!
//! J maps velocities to the twist of a wheel and V* is the twist at which F* was evaluated: first
//! at the velocity before the step, and then at the last solution
//! ([`crate::integrator::MechanicalSystem::revise`]). C is the symmetric part of the derivative by
//! the twist, over memory and pose, without its negative pivots: M̂ stays symmetric and positive,
//! and has the sparsity of M. What C leaves out is found by the repetitions; from the second one
//! on, C is at least the secant of the last two points.
//!
//! The sand gives back no more energy than it has taken: [`SandContact::work`] counts what it gives
//! only up to what is stored, and the energy audit removes the rest from the motion. Sand that has
//! nothing left to give gives way: its memory, and with it its force, becomes smaller.

use std::sync::Arc;

use nalgebra::{Matrix6, Vector3, Vector6};

use crate::geometry::{SoftLayer, Tangent};
use crate::integrator::StepOptions;
use crate::multibody::{Kinematics, MassMatrix, Model};
use crate::sand::patch::Relief;
use crate::sand::test_bed::rules_within;
use crate::sand::{
    Bed, Memory, Reaction, Rules, RutMap, SandState, SandWheel, Soil, Twist, Want, WheelInSand,
    WheelPose, Window, react,
};

/// Change of the force of a wheel by the last repetition, relative to the force, at which the
/// linearisation has settled.
const SETTLED: f64 = 1e-3;

/// Way in a step under gravity, in units of `|g| h²`, below which memory is not resolved.
///
/// A length that is much shorter makes the force of a wheel that comes to rest jump within a step:
/// at 20 ms and a millimetre the repetitions do not converge. With 2 a heavy wheel takes 1.2
/// solutions a step on average. It vanishes with h², so the scheme keeps its order.
const RESOLVED: f64 = 2.0;

/// Part of its memory that sand keeps in a step in which it should give more energy than it has
/// stored.
const GIVES_WAY: f64 = 0.5;

/// Cells around what of a wheel is in the sand in which ruts are looked for: it moves in a step.
const MARGIN: f64 = 2.0;

/// Twist, m/s, below which two points are the same.
const TINY: f64 = 1e-12;

/// Accuracy of the forces on a wheel, in the worst of several motions, for which the number of its
/// points is chosen: a few hundred points at 1%, 168 at 5%. Soils are not known better.
const ACCURACY: f64 = 0.05;

/// A wheel of a machine in sand: geometry, linearised force and trial.
#[derive(Clone, Debug)]
struct Patch {
    wheel: SandWheel,
    rules: Rules,
    body: usize,
    /// Velocities that move it, and the twist that each gives it.
    path: Vec<usize>,
    columns: Vec<Vector6<f64>>,
    pose: WheelPose,
    /// Twist at which the force was evaluated.
    at: Vector6<f64>,
    force: Vector6<f64>,
    tangent: Matrix6<f64>,
    /// Twist and force of the last linearisation in this step.
    last: Option<(Vector6<f64>, Vector6<f64>)>,
    is_touching: bool,
    /// Ruts near the wheel; meaningless where there are none.
    window: Window,
    is_rutted: bool,
    /// Whether the sand should have given more than it has stored in this step.
    is_empty: bool,
    begin: WheelInSand,
    tried: WheelInSand,
}

/// The sand of a step.
#[derive(Clone, Debug)]
pub(crate) struct SandContact {
    patches: Vec<Patch>,
    /// Velocity at which the forces are taken (nv).
    guess: Vec<f64>,
    soil: Arc<Soil>,
    /// Step, its weight on its end, and gravity of the last linearisation.
    step: (f64, f64),
    gravity: Vector3<f64>,
}

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

impl SandContact {
    /// Of a machine on soft ground.
    pub(crate) fn new(model: &Model, ground: SoftLayer<'_>) -> Self {
        let mut known: Vec<(SandWheel, Rules)> = Vec::new();
        let mut rules_of = |wheel: &SandWheel| {
            if let Some((_, rules)) = known.iter().find(|(same, _)| same == wheel) {
                return rules.clone();
            }
            let rules = rules_within(wheel, ground.soil, ACCURACY);
            known.push((*wheel, rules.clone()));
            rules
        };
        let patches = model.wheels().iter().map(|wheel| {
            let (lead, rest) = model.split_path(wheel.body);
            let path: Vec<usize> = lead.chain(rest.iter().copied()).collect();
            let wheel_in_sand = SandWheel::of(wheel);
            Patch {
                rules: rules_of(&wheel_in_sand),
                wheel: wheel_in_sand,
                body: wheel.body,
                columns: vec![Vector6::zeros(); path.len()],
                path,
                pose: WheelPose {
                    centre: Vector3::zeros(),
                    axle: Vector3::z(),
                },
                at: Vector6::zeros(),
                force: Vector6::zeros(),
                tangent: Matrix6::zeros(),
                last: None,
                is_touching: false,
                window: Window::default(),
                is_rutted: false,
                is_empty: false,
                begin: WheelInSand::default(),
                tried: WheelInSand::default(),
            }
        });
        Self {
            patches: patches.collect(),
            guess: vec![0.0; model.nv()],
            soil: ground.soil.clone(),
            step: (0.0, 0.5),
            gravity: Vector3::zeros(),
        }
    }

    /// Takes over the state at the start of a step.
    pub(crate) fn begin(&mut self, state: &SandState) {
        for (patch, wheel) in self.patches.iter_mut().zip(&state.wheels) {
            patch.begin = *wheel;
            patch.tried = *wheel;
        }
        self.guess.fill(0.0);
    }

    /// Whether it was made for the soil of a ground.
    pub(crate) fn is_of(&self, ground: SoftLayer<'_>) -> bool {
        Arc::ptr_eq(&self.soil, ground.soil)
    }

    /// Writes the state at the end of a step; the wheels' poses are those of `kinematics`.
    pub(crate) fn end(
        &self,
        model: &Model,
        ground: SoftLayer<'_>,
        kinematics: &Kinematics,
        state: &mut SandState,
    ) {
        for (w, patch) in self.patches.iter().enumerate() {
            state.wheels[w] = patch.begin;
            let pose = pose(model, kinematics, w);
            let cell = ground.cell;
            let (c, axle) = (pose.centre, pose.axle);
            let radius = patch.wheel.drum();
            if patch.begin.sinkage < -cell {
                state.ruts.pass(w, [c.x, c.z], ([0.0; 2], cell), |_| None);
                continue;
            }
            let flat = Vector3::new(axle.x, 0.0, axle.z);
            let flat = flat / flat.norm().max(f64::MIN_POSITIVE);
            let reach = patch.reach(ground, &pose);
            state.ruts.pass(w, [c.x, c.z], (reach, cell), |[x, z]| {
                let r = Vector3::new(x - c.x, 0.0, z - c.z);
                let (s, t) = (r.dot(&flat), (r.z * flat.x - r.x * flat.z));
                let inside = radius * radius - t * t;
                let is_over = s.abs() <= 0.5 * patch.wheel.width.max(cell) && inside > 0.0;
                let surface = ground.surface;
                is_over.then(|| surface.height(x, z).unwrap_or(c.y) - (c.y - inside.sqrt()))
            });
        }
    }

    /// Length over which the sand forgets in a step, m.
    fn memory_length(&self) -> f64 {
        let (h, _) = self.step;
        self.soil.memory + RESOLVED * self.gravity.norm() * h * h
    }

    /// The next solution starts from the velocity before the step.
    pub(crate) fn start_from(&mut self, v: &[f64]) {
        self.guess.copy_from_slice(v);
        for patch in &mut self.patches {
            patch.last = None;
            patch.is_empty = false;
        }
    }

    /// Evaluates the forces and their tangents at the guess.
    pub(crate) fn linearise(&mut self, place: SandScene<'_>, options: &StepOptions) {
        let (h, theta) = (options.time_step, options.theta);
        (self.step, self.gravity) = ((h, theta), options.gravity);
        let gravity = self.gravity;
        let length = self.memory_length();
        let Self { patches, guess, .. } = self;
        for (w, patch) in patches.iter_mut().enumerate() {
            patch.pose = pose(place.model, place.kinematics, w);
            patch.set_columns(place.model, place.kinematics);
            patch.read_ruts(place);
            patch.at = patch.twist(guess);
            let twist = Twist::of(&patch.at);
            let end = moved(&patch.pose, &twist, theta * h);
            let times = (h, length);
            let recalled = patch.begin.memory.after(&twist, patch.wheel.drum(), times);
            // A memory that fades as a whole hardly changes the force.
            let want = Want::Slopes {
                by_memory: recalled.fresh,
                by_pose: theta * h,
            };
            let found = patch.react((place, &gravity), &end, &recalled.memory, want);
            patch.is_touching = found.is_some_and(|found| found.is_touching);
            if let Some(found) = found.filter(|_| patch.is_touching) {
                patch.force = found.wrench;
                patch.tangent = dissipative(&-found.slope, patch.wheel.radius);
                patch.add_secant();
            }
        }
    }

    /// `M += h Σ Jᵀ C J`.
    pub(crate) fn add_to_mass(&self, model: &Model, h: f64, mass: &mut MassMatrix<f64>) {
        for patch in self.patches.iter().filter(|patch| patch.is_touching) {
            mass.add_quadratic(model.mechanism(), &patch.path, |i, j| {
                h * patch.columns[i].dot(&(patch.tangent * patch.columns[j]))
            });
        }
    }

    /// Adds the impulse over a step of h that ends with the velocity `v`.
    pub(crate) fn add_impulse(&self, h: f64, v: &[f64], y: &mut [f64]) {
        for patch in self.patches.iter().filter(|patch| patch.is_touching) {
            let force = patch.applied(&patch.twist(v));
            for (&k, column) in patch.path.iter().zip(&patch.columns) {
                y[k] += h * column.dot(&force);
            }
        }
    }

    /// Takes a solution as the next guess; whether the forces there differ from those of the step.
    pub(crate) fn revise(&mut self, place: SandScene<'_>, v_end: &[f64]) -> bool {
        let (h, theta) = self.step;
        let length = self.memory_length();
        let mut is_new = false;
        for patch in &mut self.patches {
            let six = patch.twist(v_end);
            let twist = Twist::of(&six);
            let end = moved(&patch.pose, &twist, theta * h);
            let times = (h, length);
            let memory = patch
                .begin
                .memory
                .after(&twist, patch.wheel.drum(), times)
                .memory;
            let found = patch.react(
                (place, &self.gravity),
                &end,
                &memory,
                Want::Wrench,
            );
            let exact = found.map_or_else(Vector6::zeros, |found| found.wrench);
            let applied = if patch.is_touching {
                patch.applied(&six)
            } else {
                Vector6::zeros()
            };
            let arm = patch.wheel.radius;
            let change = size(&(exact - applied), arm);
            is_new |= change > SETTLED * size(&exact, arm).max(size(&applied, arm));
        }
        self.guess.copy_from_slice(v_end);
        is_new
    }

    /// Work of the sand on the machine over a step between two velocities, J.
    pub(crate) fn work(&mut self, place: SandScene<'_>, v: &[f64], v_end: &[f64]) -> f64 {
        let (h, theta) = self.step;
        let length = self.memory_length();
        let mut total = 0.0;
        for patch in &mut self.patches {
            let six = patch.twist(v_end);
            let twist = Twist::of(&six);
            let times = (h, length);
            let after = patch.begin.memory.after(&twist, patch.wheel.drum(), times);
            let end = moved(&patch.pose, &twist, theta * h);
            let tangent = place.ground.tangent(&end.centre, patch.wheel.radius);
            let sinkage = tangent.map_or(-patch.wheel.radius, |t| depth(&patch.wheel, &end, &t));
            if !patch.is_touching {
                patch.tried = WheelInSand {
                    memory: if sinkage > 0.0 {
                        after.memory
                    } else {
                        Memory::default()
                    },
                    absorbed: patch.begin.absorbed,
                    sinkage,
                    ..WheelInSand::default()
                };
                continue;
            }
            let force = patch.applied(&six);
            let mean = six * theta + patch.twist(v) * (1.0 - theta);
            let wanted = h * force.dot(&mean);
            let given = wanted.min(patch.begin.stored);
            let most = length * force.fixed_rows::<3>(0).norm();
            total += given;
            patch.is_empty |= wanted > given;
            let memory = if patch.is_empty {
                after.memory.scaled(GIVES_WAY)
            } else {
                after.memory
            };
            patch.tried = WheelInSand {
                memory,
                stored: (patch.begin.stored - given).min(most),
                absorbed: patch.begin.absorbed - given,
                force: [force[0], force[1], force[2]],
                moment: [force[3], force[4], force[5]],
                sinkage,
            };
        }
        total
    }

    /// The step whose work was last computed becomes the state.
    pub(crate) fn accept(&mut self) {
        for patch in &mut self.patches {
            patch.begin = patch.tried;
        }
    }
}

impl Patch {
    fn set_columns(&mut self, model: &Model, kinematics: &Kinematics) {
        let x = self.pose.centre - kinematics.origin(self.body);
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

    fn twist(&self, v: &[f64]) -> Vector6<f64> {
        let mut twist = Vector6::zeros();
        for (&k, column) in self.path.iter().zip(&self.columns) {
            twist += column * v[k];
        }
        twist
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
                let weights = scaled(&way, arm);
                let own = (self.at - twist).dot(&(self.tangent * (self.at - twist))) / square;
                let more = (secant - own).max(0.0) / square;
                self.tangent += weights * weights.transpose() * more;
            }
        }
        self.last = Some((self.at, self.force));
    }

    /// The linearised force at a twist.
    fn applied(&self, twist: &Vector6<f64>) -> Vector6<f64> {
        self.force - self.tangent * (twist - self.at)
    }

    /// How far from its centre the wheel may be in the sand, m, along x and z.
    fn reach(&self, ground: SoftLayer<'_>, pose: &WheelPose) -> [f64; 2] {
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
        want: Want,
    ) -> Option<Reaction> {
        let ground = place.ground;
        let radius = self.wheel.drum();
        let tangent = ground.tangent(&pose.centre, 0.5 * radius)?;
        let (cell, n) = (ground.cell, tangent.normal);
        let is_rutted = self.is_rutted;
        let heights = |x: &Vector3<f64>| {
            let plane = n.dot(&(x - tangent.place));
            let over = if tangent.is_exact {
                0.0
            } else {
                let height = ground.surface.height(x.x, x.z);
                height.map_or(0.0, |y| plane + n.y * (y - x.y))
            };
            let rut = if is_rutted {
                place.ruts.depth_in(&self.window, [x.x, x.z], cell)
            } else {
                0.0
            };
            [over, over - n.y * rut]
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

/// Pose of a wheel, world.
fn pose(model: &Model, kinematics: &Kinematics, wheel: usize) -> WheelPose {
    let wheel = &model.wheels()[wheel];
    WheelPose {
        centre: kinematics.origin(wheel.body) + kinematics.point(wheel.body, &wheel.centre),
        axle: kinematics.R(wheel.body) * wheel.axle,
    }
}

/// The pose after a time with a twist, to first order.
fn moved(pose: &WheelPose, twist: &Twist, time: f64) -> WheelPose {
    let axle = pose.axle + twist.angular.cross(&pose.axle) * time;
    WheelPose {
        centre: pose.centre + twist.linear * time,
        axle: axle / axle.norm(),
    }
}

/// Depth of the lowest point of a wheel under a tangent plane, m.
fn depth(wheel: &SandWheel, pose: &WheelPose, tangent: &Tangent) -> f64 {
    let lean = pose.axle.dot(&tangent.normal);
    let upright = (1.0 - lean * lean).max(0.0).sqrt();
    let height = (pose.centre - tangent.place).dot(&tangent.normal);
    0.5 * wheel.width * lean.abs() + wheel.drum() * upright - height
}

/// Pivot, relative to the largest, below which it is dropped.
const DROPPED: f64 = 1e-9;

/// The symmetric part of a matrix without its negative pivots: `Σ d_k l_k l_kᵀ` over the positive
/// pivots d_k of its factor `L D Lᵀ`. Rotations are scaled to lengths by `arm`, m.
fn dissipative(matrix: &Matrix6<f64>, arm: f64) -> Matrix6<f64> {
    let scale = |i: usize| if i < 3 { 1.0 } else { arm };
    let mut rest =
        Matrix6::from_fn(|i, j| 0.5 * (matrix[(i, j)] + matrix[(j, i)]) / (scale(i) * scale(j)));
    let largest = (0..6).fold(0.0_f64, |m, i| m.max(rest[(i, i)]));
    let mut sum = Matrix6::zeros();
    for k in 0..6 {
        let pivot = rest[(k, k)];
        if pivot <= DROPPED * largest {
            continue;
        }
        let column = rest.column(k) / pivot;
        let part = column * column.transpose() * pivot;
        sum += part;
        rest -= part;
    }
    Matrix6::from_fn(|i, j| sum[(i, j)] * scale(i) * scale(j))
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
}
