//! Moreau–Jean with positions projected until nothing penetrates, at the end of every step.
//!
//! The rover's own projection (`rover_core::integrator::projection`) treats the contacts
//! of the step, which the forecast chose at its start. A body that the impulses deflected may end
//! inside another one that was not a contact. Here all contacts are detected again at the end of
//! the step, and
//!
//! ```text
//! d = W λ + g_N,    0 ≤ d ⊥ λ ≥ 0,    q ← q ⊕ M⁻¹ H λ
//! ```
//!
//! is solved repeatedly, without friction, until no gap is below −[`DEPTH`]. For spheres one solve
//! suffices once the set is complete: their distance is a convex function of their displacement, so
//! the true gap is never below the linearised one. The next step, which has these contacts,
//! corrects the velocity.
//!
//! Source: Acary 2013, CMAME 256, 224–250.

use std::cell::RefCell;

use crate::whole::Whole;
use rover_core::integrator::{
    Integrator, KeyOf, Probe, ScratchOf, StateMut, StepError, StepOptions, StepReport, StepStatus,
    UnilateralContact, Variant, WarmStart,
};
use rover_core::solver::SolverWorkspace;

use crate::acceleration::{find, response};

/// Penetration that is left alone, m.
pub const DEPTH: f64 = 1e-10;

/// How far neighbours are taken into the set, in depths.
const REACH: f64 = 2.0;

/// Most passes of a step.
const MOST: usize = 50;

/// The scheme, with its memory.
#[derive(Debug, Default)]
pub struct ProjectedToConvergence {
    /// The step that comes first.
    pub variant: Variant,
    memory: RefCell<Memory>,
}

#[derive(Debug, Default)]
struct Memory {
    v_zero: Vec<f64>,
    u: Vec<f64>,
    gaps: Vec<f64>,
    mu: Vec<f64>,
    p: Vec<f64>,
    solver: SolverWorkspace,
}

impl Memory {
    /// Zeros for n contacts of d components.
    fn fit(&mut self, n: usize, d: usize) {
        for local in [&mut self.u, &mut self.gaps, &mut self.p] {
            local.clear();
            local.resize(d * n, 0.0);
        }
        self.mu.clear();
        self.mu.resize(n, 0.0);
    }
}

impl<S: Whole> Integrator<S> for ProjectedToConvergence {
    fn step(
        &self,
        system: &mut S,
        options: &StepOptions,
        state: StateMut<'_, S::Configuration>,
        warm_start: &mut WarmStart<KeyOf<S>>,
        scratch: &mut ScratchOf<S>,
        probe: &mut dyn Probe,
    ) -> Result<StepReport, StepError> {
        let StateMut {
            configuration: q,
            v,
            time,
        } = state;
        let first = StateMut {
            configuration: &mut *q,
            v,
            time,
        };
        let mut report = self
            .variant
            .step(system, options, first, warm_start, scratch, probe)?;
        let memory = &mut *self.memory.borrow_mut();
        let d = S::DIMENSION.components();
        let mut contacts = Vec::new();
        memory.v_zero.clear();
        memory.v_zero.resize(system.nv(), 0.0);
        for pass in 0..=MOST {
            find(system, q, &memory.v_zero, 0.0, 0.0, &mut contacts);
            let deepest = contacts
                .iter()
                .map(UnilateralContact::gap)
                .fold(0.0, f64::min);
            if deepest >= -DEPTH {
                break;
            }
            system.update_mass_matrix(options, true, true);
            if pass == MOST || !system.factorise(options) {
                report.status = StepStatus::NotConverged;
                break;
            }
            // A pass pushes bodies by about the depth, so neighbours within it belong to the set.
            let reach = -REACH * deepest;
            find(
                system,
                q,
                &memory.v_zero,
                reach,
                f64::INFINITY,
                &mut contacts,
            );
            memory.fit(contacts.len(), d);
            system.assemble(&contacts, &memory.v_zero, &mut memory.u);
            for (row, contact) in memory.gaps.chunks_exact_mut(d).zip(&contacts) {
                row[0] = contact.gap();
            }
            let (data, answer) = (
                (&memory.gaps[..], &memory.mu[..]),
                (&mut memory.p[..], &mut memory.u[..]),
            );
            let solved = system.solve(None, data, &options.solver, answer, &mut memory.solver);
            report.iterations += solved.iterations;
            let change = response(system, &memory.p);
            if change.iter().any(|x| !x.is_finite()) {
                report.status = StepStatus::NotConverged;
                break;
            }
            system.advance(q, &change, 1.0);
        }
        system.normalise(q);
        Ok(report)
    }
}
