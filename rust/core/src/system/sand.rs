//! Sand under the wheels of a tree, implicit in the velocity at the end of the step.
//!
//! The force of the sand on a wheel at the end of the step is taken along its tangent there,
//!
//! ```text
//! F(v⁺) = F* − C (J v⁺ − V*),    M̂ = M + h Σ Jᵀ C J
//! ```
//!
//! J maps velocities to the twist of a wheel and V* is the twist at which F* was evaluated: first
//! at the velocity before the step. C is the symmetric part of the derivative by
//! the twist, over memory and pose, without its negative pivots: M̂ stays symmetric and positive,
//! and has the sparsity of M. Where the force at the solution is another
//! ([`crate::integrator::MechanicalSystem::revise`]), the wheel alone is solved first, with a
//! machine that answers linearly; the step is then repeated with the force and the tangent there. C
//! is then at least the secant of the last two points.
//!
//! The sand gives back no more energy than it has taken: [`SandContact::work`] counts what it gives
//! only up to what is stored, and the energy audit removes the rest from the motion. Sand that has
//! nothing left to give gives way: its memory, and with it its force, becomes smaller.

use std::sync::Arc;

use nalgebra::Vector3;

use super::sand_patch::{Patch, SandScene, SandStep, depth, moved, pose};
use crate::geometry::SoftLayer;
use crate::integrator::StepOptions;
use crate::multibody::{Factor, Kinematics, MassMatrix, Model};
use crate::sand::{Memory, SandState, SandWheel, Soil, Twist, WheelInSand};

/// Way in a step under gravity, in units of `|g| h²`, below which memory is not resolved.
///
/// A length that is much shorter makes the force of a wheel that comes to rest jump within a step:
/// at 20 ms and a millimetre the repetitions do not converge. With 2 a heavy wheel takes 1.2
/// solutions a step on average. It vanishes with h², so the scheme keeps its order.
const RESOLVED: f64 = 2.0;

/// Part of its memory that sand keeps in a step in which it should give more energy than it has
/// stored.
const GIVES_WAY: f64 = 0.5;

/// Ways, in cells of the ruts, along the ground and up or down, after which a wheel's place is
/// noted again: a rut is known to 1% of a cell.
const ALONG: f64 = 0.1;
const DEEPER: f64 = 0.01;

/// The sand of a step.
#[derive(Clone, Debug)]
pub(crate) struct SandContact {
    patches: Vec<Patch>,
    /// Velocity at which the forces are taken (nv).
    guess: Vec<f64>,
    soil: Arc<Soil>,
    step: SandStep,
}

impl SandContact {
    /// Of a machine on soft ground.
    pub(crate) fn new(model: &Model, ground: SoftLayer<'_>) -> Self {
        let patches = model.wheels().iter().map(|wheel| {
            let in_sand = SandWheel::of(wheel);
            Patch::new(model, wheel.body, in_sand, ground.rules(&in_sand))
        });
        Self {
            patches: patches.collect(),
            guess: vec![0.0; model.nv()],
            soil: ground.soil.clone(),
            step: SandStep {
                h: 0.0,
                theta: 0.5,
                gravity: Vector3::zeros(),
                length: 1.0,
            },
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
            let noted = [c.x, c.y, c.z, axle.x, axle.y, axle.z];
            if !is_elsewhere(&patch.begin.noted, &noted, &patch.wheel, cell) {
                continue;
            }
            state.wheels[w].noted = noted;
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

    /// The next solution starts from the velocity before the step.
    pub(crate) fn start_from(&mut self, v: &[f64]) {
        self.guess.copy_from_slice(v);
        for patch in &mut self.patches {
            patch.last = None;
            patch.is_stale = true;
            patch.is_empty = false;
        }
    }

    /// Evaluates the forces and their tangents at the velocity before the step, unless that was
    /// done: a repetition has its own.
    pub(crate) fn linearise(&mut self, place: SandScene<'_>, options: &StepOptions) {
        let (h, gravity) = (options.time_step, options.gravity);
        self.step = SandStep {
            h,
            theta: options.theta,
            gravity,
            length: self.soil.memory + RESOLVED * gravity.norm() * h * h,
        };
        for (w, patch) in self.patches.iter_mut().enumerate() {
            if std::mem::take(&mut patch.is_stale) {
                patch.place(place, w);
                let at = patch.twist(&self.guess);
                patch.linearise(&self.step, place, &at);
            }
        }
    }

    /// Takes the forces as they are, without their tangents.
    pub(crate) fn drop_tangents(&mut self) {
        for patch in &mut self.patches {
            patch.tangent.fill(0.0);
        }
    }

    /// `M += h Σ Jᵀ C J`.
    pub(crate) fn add_to_mass(&mut self, model: &Model, h: f64, mass: &mut MassMatrix<f64>) {
        for patch in self.patches.iter_mut().filter(|patch| patch.is_touching) {
            patch.add_to_mass(model, h, mass);
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

    /// Whether the forces at a solution differ from those of the step, which are then linearised
    /// anew. `factor`: of M̂.
    pub(crate) fn revise(
        &mut self,
        place: SandScene<'_>,
        factor: &Factor<f64>,
        v_end: &[f64],
    ) -> bool {
        let mut is_new = false;
        for patch in &mut self.patches {
            let six = patch.twist(v_end);
            is_new |= patch.revise(&self.step, place, factor, &six);
        }
        is_new
    }

    /// Work of the sand on the machine over a step between two velocities, J.
    pub(crate) fn work(&mut self, place: SandScene<'_>, v: &[f64], v_end: &[f64]) -> f64 {
        let SandStep {
            h, theta, length, ..
        } = self.step;
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
                    velocity: twist.linear.into(),
                    sinkage,
                    noted: patch.begin.noted,
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
                velocity: twist.linear.into(),
                sinkage,
                noted: patch.begin.noted,
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

/// Whether a wheel has moved away from where it was last noted: centre and axle.
fn is_elsewhere(before: &[f64; 6], now: &[f64; 6], wheel: &SandWheel, cell: f64) -> bool {
    let moved = |k: usize| (now[k] - before[k]).abs();
    let reach = wheel.drum() + 0.5 * wheel.width;
    let turned = (moved(3) + moved(4) + moved(5)) * reach;
    let along = moved(0) + moved(2) + turned;
    along > ALONG * cell || moved(1) + turned > DEEPER * cell
}
