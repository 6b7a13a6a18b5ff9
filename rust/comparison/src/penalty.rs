//! Penalty: contact as a spring and damper, regularised friction, semi-implicit Euler, as in most
//! current simulators.
//!
//! ```text
//! λ_N = max(0, −k g_N − c u_N) where g_N < 0,        λ_T = −μ λ_N u_T/√(|u_T|² + v_s²)
//! M(q) (v⁺ − v) = h (F(q, v) + H(q) λ),              q⁺ = q ⊕ h v⁺
//! ```
//!
//! It solves a different problem: a body sinks in by its weight over k and creeps down any slope at
//! `v_s tan α/√(μ² − tan² α)`, and the step is bounded by 2/√(k/m) whatever happens in the scene.
//! As h tends to 0 the error against rigid Coulomb contact does not.

use crate::whole::Whole;
use rover_core::integrator::{
    Integrator, KeyOf, Probe, ScratchOf, StateMut, StepError, StepOptions, StepReport,
    UnilateralContact, WarmStart,
};

use crate::acceleration::{accept, add_response, find, free_acceleration, friction};

/// Stiffness, damping, regularisation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Penalty {
    /// k, N/m.
    pub stiffness: f64,
    /// c, N s/m.
    pub damping: f64,
    /// v_s, m/s.
    pub slip_speed: f64,
}

impl Penalty {
    /// The damping that lets a mass (kg) rebound with e, in (0, 1], from a spring that may pull at
    /// the end: `e = exp(−π ζ/√(1 − ζ²))`; e = 0 is critical damping.
    #[must_use]
    pub fn with_restitution(stiffness: f64, mass: f64, e: f64, slip_speed: f64) -> Self {
        let ratio = if e > 0.0 {
            let log = e.ln();
            -log / log.hypot(std::f64::consts::PI)
        } else {
            1.0
        };
        Self {
            stiffness,
            damping: 2.0 * ratio * (stiffness * mass).sqrt(),
            slip_speed,
        }
    }
}

impl<S: Whole> Integrator<S> for Penalty {
    fn step(
        &self,
        system: &mut S,
        options: &StepOptions,
        state: StateMut<'_, S::Configuration>,
        _warm_start: &mut WarmStart<KeyOf<S>>,
        _scratch: &mut ScratchOf<S>,
        _probe: &mut dyn Probe,
    ) -> Result<StepReport, StepError> {
        let (h, time) = (options.time_step, *state.time);
        let d = S::DIMENSION.components();
        let (q, v) = (&*state.configuration, &*state.v);
        let mut contacts = Vec::new();
        find(system, q, v, 0.0, 0.0, &mut contacts);
        let mut a = free_acceleration(system, options, q, v, time)?;
        if !contacts.is_empty() {
            let mut u = vec![0.0; d * contacts.len()];
            system.assemble(&contacts, v, &mut u);
            let mu = friction(system, options, &contacts);
            for ((contact, mu), u) in contacts.iter().zip(&mu).zip(u.chunks_exact_mut(d)) {
                let normal = (-self.stiffness * contact.gap() - self.damping * u[0]).max(0.0);
                let slip = u[1..].iter().map(|u| u * u).sum::<f64>().sqrt();
                let share = -mu * normal / slip.hypot(self.slip_speed);
                u[0] = normal;
                for u in &mut u[1..] {
                    *u *= share;
                }
            }
            add_response(system, &u, &mut a);
        }
        let v_end: Vec<f64> = v.iter().zip(&a).map(|(v, a)| v + h * a).collect();
        let mut q_end = q.clone();
        system.set_moved(q, &v_end, h, &mut q_end);
        accept(system, (q_end, &v_end), h, state)?;
        Ok(StepReport {
            steps: 1,
            n_contacts: contacts.len(),
            ..StepReport::default()
        })
    }
}
