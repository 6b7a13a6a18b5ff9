//! Sand under the wheels of a tree, implicit in the velocity at the end of the step; of one machine
//! or of several, over lanes.
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
//! ([`crate::integrator::Forces::revise`]), the wheel alone is solved first, with a
//! machine that answers linearly; the step is then repeated with the force and the tangent there. C
//! is then at least the secant of the last two points.
//!
//! The sand gives back no more energy than it has taken: [`SandContact::work`] counts what it gives
//! only up to what is stored, and the energy audit removes the rest from the motion. Sand that has
//! nothing left to give gives way: its memory, and with it its force, becomes smaller.
//!
//! For derivatives a step takes [given](SandContact::give) forces, which are repeated until they
//! are those at its end (`super::tangent`). M̂ is then that of firm ground.
#![allow(clippy::inline_always)] // a call leaves the instructions that its caller is compiled for

use std::sync::Arc;

use nalgebra::{Vector3, Vector6};

use super::sand_patch::{Layers, SandPatch, SandScene, SandStep, depth, each};
use super::sand_wheel::LaneWheel;
use super::six::{self, Six};
use crate::contact::placed_wheel::PlacedWheel;
use crate::geometry::SoftLayer;
use crate::multibody::{Factor, MassMatrix, Mechanism};
use crate::sand::memory::after_step;
use crate::sand::{RutMap, SandState, Soil};
use crate::scalar::{Lane, LaneMask, MAX_LANES, Vec3, inlined};

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
const ALONG: f64 = 0.25;
const DEEPER: f64 = 0.01;

/// Most repetitions of a step in sand. Wheels that fall and come to rest in a long step need them.
pub(crate) const MOST_REVISIONS_IN_SAND: usize = 24;

/// The sand of a step.
#[derive(Clone, Debug)]
pub(crate) struct SandContact<T: Lane> {
    token: T::Token,
    pub(super) patches: Vec<SandPatch<T>>,
    /// Velocity at which the forces are taken (nv); that of the last trial if they are given.
    pub(super) guess: Vec<T>,
    /// Soil of each lane; none on firm ground.
    soils: [Option<Arc<Soil>>; MAX_LANES],
    /// Length over which it forgets, m.
    memory: T,
    /// Lanes on soft ground.
    lanes: T::Mask,
    pub(super) step: SandStep<T>,
    /// Whether the forces are [given](Self::give).
    is_given: bool,
    /// Whether wheels leave no ruts.
    pub(super) ruts_stay: bool,
}

impl<T: Lane> SandContact<T> {
    /// Sand of a machine that is on firm ground in every lane.
    pub(crate) fn new(
        token: T::Token,
        mechanism: &Mechanism,
        wheels: impl Iterator<Item = PlacedWheel>,
    ) -> Self {
        let (zero, one) = (T::splat(token, 0.0), T::splat(token, 1.0));
        Self {
            token,
            patches: wheels
                .map(|wheel| SandPatch::new(token, mechanism, wheel))
                .collect(),
            guess: vec![zero; mechanism.nv()],
            soils: std::array::from_fn(|_| None),
            memory: one,
            lanes: T::mask(token, 0),
            step: SandStep {
                h: 0.0,
                theta: 0.5,
                gravity: Vec3::new(zero, zero, zero),
                length: one,
            },
            is_given: false,
            ruts_stay: false,
        }
    }

    /// Part of its memory that sand under a wheel keeps.
    pub(super) fn part_kept(is_empty: bool) -> f64 {
        if is_empty { GIVES_WAY } else { 1.0 }
    }

    /// Gives the next steps of a lane the forces and moments of their wheels, none where a wheel
    /// does not touch the sand; with `None`, steps find them again.
    pub(super) fn give(&mut self, lane: usize, wrenches: Option<&[Option<Vector6<f64>>]>) {
        self.is_given = wrenches.is_some();
        for (patch, wrench) in self.patches.iter_mut().zip(wrenches.into_iter().flatten()) {
            patch.force.give(lane, wrench.as_ref());
        }
    }

    /// Lanes on soft ground.
    pub(crate) fn lanes(&self) -> T::Mask {
        self.lanes
    }

    /// Gives a lane its ground and what the sand remembers; none on firm ground.
    pub(crate) fn load(&mut self, lane: usize, ground: Option<(SoftLayer<'_>, &SandState)>) {
        let own = T::mask(self.token, 1 << lane);
        let Some((layer, state)) = ground else {
            self.lanes = self.lanes & !own;
            self.soils[lane] = None;
            for patch in &mut self.patches {
                patch.force.clear(lane);
            }
            return;
        };
        let is_known =
            (self.soils[lane].as_ref()).is_some_and(|soil| Arc::ptr_eq(soil, layer.soil));
        if !is_known {
            self.soils[lane] = Some(Arc::clone(layer.soil));
            self.memory.set(lane, layer.soil.memory);
            for patch in &mut self.patches {
                patch.rules[lane] = Some(layer.rules(&patch.wheel.shape));
            }
        }
        self.lanes = self.lanes | own;
        for (patch, wheel) in self.patches.iter_mut().zip(&state.wheels) {
            patch.begin.set(lane, wheel);
            patch.tried.set(lane, wheel);
        }
    }

    /// Writes what the sand of a lane remembers of the wheels.
    pub(crate) fn store(&self, lane: usize, state: &mut SandState) {
        for (wheel, patch) in state.wheels.iter_mut().zip(&self.patches) {
            *wheel = patch.begin.get(lane);
        }
    }

    /// The next solution starts from the velocity before the step.
    pub(crate) fn start_from(&mut self, v: &[T]) {
        self.guess.copy_from_slice(v);
        for patch in &mut self.patches {
            patch.force.begin();
            patch.is_stale = self.lanes;
            patch.is_empty = patch.is_empty & !patch.is_empty;
        }
    }

    /// Evaluates the forces and their tangents at the velocity before the step in some lanes,
    /// unless that was done: a repetition has its own. `times`: h and θ.
    pub(crate) fn linearise(
        &mut self,
        scene: &SandScene<'_, T>,
        lanes: T::Mask,
        (h, theta): (f64, f64),
        gravity: Vec3<T>,
    ) {
        let resolved = gravity.x.like(RESOLVED * h * h);
        self.step = SandStep {
            h,
            theta,
            gravity,
            length: self.memory + gravity.norm() * resolved,
        };
        for patch in &mut self.patches {
            if self.is_given {
                patch.place_given(scene, lanes);
                continue;
            }
            let lanes = patch.is_stale & lanes;
            if lanes.any() {
                patch.is_stale = patch.is_stale & !lanes;
                patch.linearise(&self.step, scene, lanes, &self.guess);
            }
        }
    }

    /// Takes the forces as they are, without their tangents.
    pub(crate) fn drop_tangents(&mut self) {
        for patch in &mut self.patches {
            patch.force.drop_tangent();
        }
    }

    /// `M += h Σ Jᵀ C J`.
    pub(crate) fn add_to_mass(&mut self, mechanism: &Mechanism, mass: &mut MassMatrix<T>) {
        let h = self.step.h;
        for patch in &mut self.patches {
            if !self.is_given && (patch.force.is_touching & self.lanes).any() {
                let (map, tangent) = (&mut patch.map, &patch.force.tangent);
                inlined!(
                    T::vectorize,
                    self.token,
                    map.add_to_mass(tangent, h, mechanism, mass)
                );
            }
        }
    }

    /// Whether the forces are given.
    pub(crate) fn is_given(&self) -> bool {
        self.is_given
    }

    /// Adds the impulse over a step of h that ends with the velocity `v`.
    #[inline(always)]
    pub(crate) fn add_impulse(&self, h: f64, v: &[T], y: &mut [T]) {
        for patch in &self.patches {
            if (patch.force.is_touching & self.lanes).any() {
                let force = patch.force.applied(&patch.map.twist(v));
                patch.map.add_impulse(&force, h, y);
            }
        }
    }

    /// Where the forces at a solution differ from those of the step, of some lanes; they are then
    /// linearised anew. `factor`: of M̂.
    pub(crate) fn revise(
        &mut self,
        scene: &SandScene<'_, T>,
        lanes: T::Mask,
        factor: &Factor<T>,
        v_end: &[T],
    ) -> T::Mask {
        let mut is_new = T::mask(self.token, 0);
        if self.is_given {
            return is_new;
        }
        for patch in &mut self.patches {
            let lanes = lanes & self.lanes;
            is_new = is_new | patch.revise(&self.step, scene, lanes, factor, v_end);
        }
        is_new
    }

    /// Adds to `out` the work of the sand on each cluster over a step between two velocities, J.
    pub(crate) fn work(
        &mut self,
        mechanism: &Mechanism,
        layers: &Layers<'_>,
        [v, v_end]: [&[T]; 2],
        out: &mut [T],
    ) {
        if self.is_given {
            self.guess.copy_from_slice(v_end);
        }
        for patch in &mut self.patches {
            let (step, lanes) = (&self.step, self.lanes);
            let twist = inlined!(T::vectorize, self.token, {
                let twist = patch.map.twist(v_end);
                patch.end = patch.pose.moved(&twist, step.theta * step.h);
                twist
            });
            let sinkage = patch.sinkage(layers, lanes);
            let own = &mut out[mechanism.cluster_of_body(patch.wheel.body)];
            inlined!(
                T::vectorize,
                self.token,
                *own += patch.try_work(step, lanes, v, (&twist, sinkage))
            );
        }
    }

    /// The step whose work was last computed becomes the state of some lanes.
    #[inline(always)]
    pub(crate) fn accept(&mut self, lanes: T::Mask) {
        let lanes = lanes & self.lanes;
        for patch in &mut self.patches {
            patch.begin = LaneWheel::select(lanes, &patch.tried, &patch.begin);
        }
    }

    /// Notes in the ruts of some lanes where wheels are that have moved.
    pub(crate) fn note(&mut self, layers: &Layers<'_>, lanes: T::Mask, ruts: &mut [RutMap]) {
        if self.ruts_stay {
            return;
        }
        for (w, patch) in self.patches.iter_mut().enumerate() {
            for lane in each(lanes & self.lanes) {
                if let Some(layer) = &layers[lane] {
                    patch.note(w, lane, layer, &mut ruts[lane]);
                }
            }
        }
    }
}

impl<T: Lane> SandPatch<T> {
    /// Depth of the lowest point at the end of a trial, m.
    pub(super) fn sinkage(&self, layers: &Layers<'_>, lanes: T::Mask) -> T {
        let radius = self.wheel.shape.radius;
        let mut sinkage = self.begin.sinkage;
        for lane in each(lanes) {
            let end = self.end.get(lane);
            let tangent = layers[lane].and_then(|layer| layer.tangent(&end.centre, radius));
            let own = tangent.map_or(-radius, |tangent| depth(&self.wheel.shape, &end, &tangent));
            sinkage.set(lane, own);
        }
        sinkage
    }

    /// Work over a step from the velocity `v` to one with a twist, J; it is then tried. The wheel's
    /// sinkage there in m.
    #[inline(always)]
    fn try_work(
        &mut self,
        step: &SandStep<T>,
        lanes: T::Mask,
        v: &[T],
        (twist, sinkage): (&Six<T>, T),
    ) -> T {
        let zero = sinkage.like(0.0);
        let (h, theta) = (zero.like(step.h), zero.like(step.theta));
        let touching = self.force.is_touching & lanes;
        let drum = self.wheel.shape.drum();
        let (after, _) = after_step(&self.begin.memory, twist, drum, (h, step.length));
        let applied = self.force.applied(twist);
        let force = six::select(touching, &applied, &[zero; six::SIX]);
        let before = self.map.twist(v);
        let rest = zero.like(1.0) - theta;
        let mean = six::plus(&twist.map(|x| x * theta), rest, &before);
        let wanted = h * six::dot(&force, &mean);
        let given = T::select(touching, wanted.min(self.begin.stored), zero);
        self.is_empty = self.is_empty | (touching & given.lt(wanted));
        let most = step.length * six::linear(&force).norm();
        let part = T::select(
            touching,
            T::select(self.is_empty, zero.like(GIVES_WAY), zero.like(1.0)),
            T::select(zero.lt(sinkage), zero.like(1.0), zero),
        );
        self.tried = LaneWheel {
            memory: after.map(|x| x * part),
            stored: T::select(touching, (self.begin.stored - given).min(most), zero),
            absorbed: self.begin.absorbed - given,
            wrench: force,
            velocity: six::linear(twist),
            sinkage,
            noted: self.begin.noted,
        };
        given
    }

    /// Notes where the wheel of a lane is, if it has moved.
    fn note(&mut self, w: usize, lane: usize, layer: &SoftLayer<'_>, ruts: &mut RutMap) {
        let (numbers, before) = (self.end.numbers(), &mut self.begin.noted);
        let noted = six::get(&numbers, lane);
        let (shape, cell) = (&self.wheel.shape, layer.cell);
        let moved = (noted - six::get(before, lane)).abs();
        let turned = (moved[3] + moved[4] + moved[5]) * (shape.drum() + 0.5 * shape.width);
        let along = moved[0] + moved[2] + turned;
        if along <= ALONG * cell && moved[1] + turned <= DEEPER * cell {
            return;
        }
        six::set(before, lane, &noted);
        let end = self.end.get(lane);
        let (c, axle) = (end.centre, end.axle);
        if self.begin.sinkage.get(lane) < -cell {
            ruts.pass(w, [c.x, c.z], ([0.0; 2], cell), |_| None);
            return;
        }
        let flat = Vector3::new(axle.x, 0.0, axle.z);
        let flat = flat / flat.norm().max(f64::MIN_POSITIVE);
        let (reach, radius) = (self.reach(layer, &end), self.wheel.shape.drum());
        ruts.pass(w, [c.x, c.z], (reach, cell), |[x, z]| {
            let r = Vector3::new(x - c.x, 0.0, z - c.z);
            let (s, t) = (r.dot(&flat), (r.z * flat.x - r.x * flat.z));
            let inside = radius * radius - t * t;
            let is_over = s.abs() <= 0.5 * self.wheel.shape.width.max(cell) && inside > 0.0;
            is_over.then(|| layer.surface.height(x, z).unwrap_or(c.y) - (c.y - inside.sqrt()))
        });
    }
}
