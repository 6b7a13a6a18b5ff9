//! The audit of a step's energy: a step may gain what gravity and actuators
//! put in, and nothing else.
//!
//! ```text
//! excess = (K + V)(q⁺, v⁺) − (K + V)(q, v) − W
//! ```
//!
//! W is the work of torques, motors and held joints. Inelastic contact with friction only
//! takes energy away, so a positive excess is the scheme's own: the linearisation (of third
//! order in the step), a solver that stopped early, or Newton's law of restitution, which
//! creates energy in some impacts with friction (Kane's paradox).
//!
//! - A coarse excess asks for the step to be taken again, with implicit
//!   gyroscopic terms and then in halves.
//! - What is left is taken out by shortening the velocity, `v⁺ ← s v⁺`. Signorini's condition at
//!   e = 0 and Coulomb's law are homogeneous in the velocity, so both hold as before.
//! - In free flight energy is neither lost nor gained: there s goes both ways, and acts on the
//!   motion relative to the mass centre, which keeps its momentum.
//!
//! - Where even standing still does not give it back the way is shortened
//!   too: a step that a contact ends early.
//!
//! The correction is of the order of the excess, so the scheme keeps its order. Lifting out of
//! penetration happens after the audit and is counted apart.

use nalgebra::Vector3;

use super::ScratchOf;
use super::mechanical_system::{MechanicalSystem, Start};
use super::moreau_jean::place;
use super::options::StepOptions;
use super::report::StepReport;

/// Energy of a state, and its motion as a whole.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct MechanicalEnergy {
    /// J.
    pub kinetic: f64,
    /// J.
    pub potential: f64,
    /// Linear momentum, kg m/s.
    pub momentum: Vector3<f64>,
    /// kg.
    pub mass: f64,
}

/// Largest gain in a step that is let pass, as a part of the kinetic energy.
pub const GAIN: f64 = 5e-10;

/// Excess, as a part of the kinetic energy, from which on the step is taken again.
const COARSE: f64 = 1e-3;

/// Roundings of the energies that are subtracted from each other.
const ROUNDINGS: f64 = 64.0;

/// Largest part by which the energy of free motion is raised in a step.
const RAISE: f64 = 1.0;

/// Part of the kinetic energy after a step that may be taken out of its velocity alone.
const SHORT: f64 = 0.5;

/// Part of the way that is left where the energy allows all of it.
const SAFE: f64 = 0.999;

/// Part of the way below which none is left.
const LEAST_WAY: f64 = 1e-3;

/// Most times that a velocity is shortened with its way.
const MOST_SHORTENINGS: usize = 8;

/// A state whose energy is known: the end of a step is the start of the next.
#[derive(Clone, Debug)]
pub(super) struct Audited<Q> {
    configuration: Q,
    v: Vec<f64>,
    energy: Option<MechanicalEnergy>,
}

impl<Q> Audited<Q> {
    pub(super) fn new(configuration: Q, nv: usize) -> Self {
        Self {
            configuration,
            v: vec![f64::NAN; nv],
            energy: None,
        }
    }
}

impl<Q: Clone> Audited<Q> {
    /// Notes the energy of a state.
    fn is(&mut self, configuration: &Q, v: &[f64], energy: MechanicalEnergy) {
        self.configuration.clone_from(configuration);
        self.v.clear();
        self.v.extend_from_slice(v);
        self.energy = Some(energy);
    }
}

/// Energy at the start of a step: remembered from the end of the last one,
/// where this is the same state.
pub(super) fn energy_before<S: MechanicalSystem>(
    system: &mut S,
    options: &StepOptions,
    start: Start<'_, S::Configuration>,
    ws: &ScratchOf<S>,
) -> Option<MechanicalEnergy> {
    let known = &ws.audited;
    if known.energy.is_some() && known.v == *start.v && known.configuration == *start.configuration
    {
        return known.energy;
    }
    system.energy(options, start.configuration, start.v)
}

/// What an audit found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Verdict {
    /// The step may stand; its velocity may have been corrected.
    Sound,
    /// It should be taken again.
    Coarse,
}

/// How far an audit may go.
#[derive(Clone, Copy, Debug)]
pub(super) struct Audit {
    /// Energy before the step; none where the system is not audited.
    pub before: Option<MechanicalEnergy>,
    /// Whether there is no safer way left.
    pub is_last: bool,
    /// Part of the kinetic energy that may be gained, see [`GAIN`].
    pub gain: f64,
    /// Part of the kinetic energy that free flight may gain or lose: an
    /// error of the scheme's order that does not add up.
    pub drift: f64,
}

impl Audit {
    /// Judges `ws.v` and `ws.end`, before projection, and corrects `ws.v`
    /// where there is no safer way.
    pub(super) fn judge<S: MechanicalSystem>(
        &self,
        system: &mut S,
        options: &StepOptions,
        start: Start<'_, S::Configuration>,
        ws: &mut ScratchOf<S>,
        report: &mut StepReport,
    ) -> Verdict {
        system.normalise(&mut ws.end);
        let Some(before) = self.before else {
            return Verdict::Sound;
        };
        ws.audited.energy = None;
        let mut balance = balance(system, options, start, ws, &before);
        if self.is_last {
            for _ in 0..MOST_SHORTENINGS {
                let Balance { after, excess, .. } = balance;
                if excess.is_nan() || excess <= SHORT * after.kinetic {
                    break;
                }
                // Far off: the way that such a velocity leads is no better than
                // the velocity. Both are taken back together.
                let share = (before.kinetic / after.kinetic).min(SHORT).sqrt();
                shorten(ws, share);
                place(system, options, ws);
                system.normalise(&mut ws.end);
                balance = self::balance(system, options, start, ws, &before);
            }
        }
        let Balance {
            after,
            excess,
            work,
        } = balance;
        if !excess.is_finite() {
            return if self.is_last {
                Verdict::Sound // not finite: refused when the step ends
            } else {
                Verdict::Coarse
            };
        }
        // A machine at rest has no kinetic energy to measure by: what gravity gives in a step of
        // free fall is the least that counts.
        let fall = options.gravity.norm() * options.time_step;
        let least = 0.5 * after.mass * fall * fall;
        let size = before.kinetic.max(after.kinetic).max(least);
        let sum = before.kinetic.abs()
            + after.kinetic.abs()
            + before.potential.abs()
            + after.potential.abs()
            + work.abs();
        let rounding = ROUNDINGS * f64::EPSILON * sum;
        // With θ > ½ the scheme itself takes energy away.
        let is_free = ws.contacts.is_empty() && options.theta <= 0.5;
        let is_balanced = if is_free {
            excess.abs() <= rounding + self.drift * size
        } else {
            excess <= rounding + self.gain * size
        };
        if is_balanced {
            report.energy_gain = report.energy_gain.max(relative(excess - rounding, size));
            ws.audited.is(&ws.end, &ws.v, after);
            return Verdict::Sound;
        }
        let coarse = if is_free { excess.abs() } else { excess };
        // What not even standing still gives back.
        let left = excess - after.kinetic;
        let is_left = left > rounding + self.gain * size;
        if (coarse > COARSE * size || is_left) && !self.is_last {
            return Verdict::Coarse;
        }
        let whole = after.momentum.norm_squared() / (2.0 * after.mass);
        let relative_kinetic = after.kinetic - whole;
        let d = S::DIMENSION.components();
        if is_free && excess < relative_kinetic {
            let share = (1.0 - excess / relative_kinetic).min(1.0 + RAISE).sqrt();
            let translation = after.momentum / after.mass;
            for (k, v) in ws.v.iter_mut().enumerate() {
                let common = if k < d { translation[k] } else { 0.0 };
                *v = common + share * (*v - common);
            }
        } else if excess > 0.0 {
            let share = (1.0 - excess / after.kinetic).max(0.0).sqrt();
            shorten(ws, share);
            if is_left {
                self.hold_back(system, options, start, ws);
            }
        }
        report.energy_removed += excess.max(0.0);
        if let Some(corrected) = system.energy(options, &ws.end, &ws.v) {
            ws.audited.is(&ws.end, &ws.v, corrected);
        }
        Verdict::Sound
    }
}

impl Audit {
    /// Shortens the way of a step at whose end nothing moves any more, and
    /// which still gained energy.
    ///
    /// Such a step was stopped within its time: by a jam, while the actuators' work was counted to
    /// its end, or on its way up by a contact that closes before the end. As long a part σ of the
    /// way is left as its energy allows; none always does.
    fn hold_back<S: MechanicalSystem>(
        &self,
        system: &mut S,
        options: &StepOptions,
        start: Start<'_, S::Configuration>,
        ws: &mut ScratchOf<S>,
    ) {
        let Some(before) = self.before else {
            return;
        };
        let (h, theta) = (options.time_step, options.theta);
        let d = S::DIMENSION.components();
        for ((mean, end), begin) in ws.v_mean.iter_mut().zip(&ws.v).zip(start.v) {
            *mean = theta * end + (1.0 - theta) * begin;
        }
        let work = system.work(options, start, &ws.v);
        let mut share = 1.0;
        for _ in 0..MOST_SHORTENINGS {
            let after = system.energy(options, &ws.end, &ws.v).unwrap_or(before);
            let excess = (after.kinetic - before.kinetic) + (after.potential - before.potential)
                - share * work;
            if excess <= 0.0 {
                break;
            }
            // Without a way the excess is minus the kinetic energy; between
            // both it is nearly straight.
            let shorter = SAFE * share * before.kinetic / (excess + before.kinetic);
            let back = h * (share - shorter);
            share = if shorter > LEAST_WAY { shorter } else { 0.0 };
            let local = ws.u.chunks_exact(d).zip(ws.u_before.chunks_exact(d));
            for (gap, (u, before)) in ws.gap_end.iter_mut().zip(local) {
                *gap -= back * (theta * u[0] + (1.0 - theta) * before[0]);
            }
            system.set_moved(start.configuration, &ws.v_mean, share * h, &mut ws.end);
            system.normalise(&mut ws.end);
        }
    }
}

/// Counts what a projection that has moved `ws.end` did to the energy.
pub(super) fn count_lift<S: MechanicalSystem>(
    system: &mut S,
    options: &StepOptions,
    ws: &mut ScratchOf<S>,
    report: &mut StepReport,
) {
    let Some(before) = ws.audited.energy else {
        return;
    };
    let Some(after) = system.energy(options, &ws.end, &ws.v) else {
        return;
    };
    let lifted = (after.kinetic - before.kinetic) + (after.potential - before.potential);
    report.energy_lifted += lifted.max(0.0);
    ws.audited.is(&ws.end, &ws.v, after);
}

/// What a step did to the energy.
#[derive(Clone, Copy, Debug)]
struct Balance {
    after: MechanicalEnergy,
    excess: f64,
    work: f64,
}

/// Of the step to `ws.end` and `ws.v`.
fn balance<S: MechanicalSystem>(
    system: &mut S,
    options: &StepOptions,
    start: Start<'_, S::Configuration>,
    ws: &ScratchOf<S>,
    before: &MechanicalEnergy,
) -> Balance {
    let work = system.work(options, start, &ws.v);
    let after = system.energy(options, &ws.end, &ws.v).unwrap_or(*before);
    Balance {
        after,
        excess: (after.kinetic - before.kinetic) + (after.potential - before.potential) - work,
        work,
    }
}

/// `v⁺ ← share v⁺`, also as the contacts see it.
fn shorten<Q, C>(ws: &mut super::Scratch<Q, C>, share: f64) {
    for x in ws.v.iter_mut().chain(&mut ws.u) {
        *x *= share;
    }
}

fn relative(excess: f64, size: f64) -> f64 {
    if excess > 0.0 {
        excess / size.max(f64::MIN_POSITIVE)
    } else {
        0.0
    }
}
