//! Energy audit: a step may gain no more energy than gravity and the actuators supply.
//!
//! ```text
//! excess = (K + V)(q⁺, v⁺) − (K + V)(q, v) − W
//! ```
//!
//! W is the work of torques, motors, held joints, springs and dampers. Inelastic contact with
//! friction only dissipates, so a positive excess is an error of the scheme. Its sources are the
//! linearisation (third order in the step), a solver that stopped early, and Newton's law of
//! restitution, which creates energy in some impacts with friction (Kane's paradox).
//!
//! - After a coarse excess the step is repeated, with implicit gyroscopic terms and then in halves.
//! - The remaining excess is removed by scaling the velocity, `v⁺ ← s v⁺`. Signorini's condition at
//!   e = 0 and Coulomb's law are homogeneous in the velocity, so both still hold. With restitution
//!   the rebounds are slower than Newton's law says, which the report's residual contains.
//! - Where nothing outside touches the system only the motion relative to the mass centre of the
//!   whole is scaled, so the linear momentum is kept. Contacts among its own parts feel relative
//!   velocities alone. Free flight conserves energy too: without any contact s may be above 1.
//!
//! - If even v⁺ = 0 leaves an excess, the displacement is shortened too: a contact ended the motion
//!   within the step.
//!
//! The correction is of the order of the excess, so the scheme keeps its order. Position projection
//! follows the audit; it keeps the kinetic energy (`carried_velocity`), and its work is
//! counted separately.
//!
//! What the scheme itself takes from the motion or adds to it is the rest of the balance
//! ([`super::work`]), with the work of friction and impacts by their law
//! (`step_contacts::contact_work`) and what contacts that yield release (`law::compliance`).
#![allow(clippy::inline_always)] // a call leaves the instructions that its caller is compiled for

use super::carried_velocity::Carried;
use super::mechanical_system::{
    KeyOf, MechanicalEnergy, MechanicalSystem, Start, UnilateralContact,
};
use super::options::StepOptions;
use super::report::StepReport;
use super::scratch::{Scratch, ScratchOf};
use super::step_contacts::{contact_work, place};
use super::warm_start::WarmStart;
use super::work::{Ledger, Work};
use crate::scalar::{Lane, Vec3};

/// Largest gain in a step that is tolerated, as a fraction of the kinetic energy.
pub const GAIN: f64 = 5e-10;

/// Excess, as a fraction of the kinetic energy, above which the step is repeated.
const COARSE: f64 = 1e-3;

/// Rounding errors allowed in the difference of two energies.
const ROUNDINGS: f64 = 64.0;

/// Largest relative increase of the energy of free motion in a step.
const RAISE: f64 = 1.0;

/// Fraction of the kinetic energy after a step that may be removed by scaling the velocity alone.
const SHORT: f64 = 0.5;

/// Fraction of the displacement that is kept where the energy allows all of it.
const SAFE: f64 = 0.999;

/// Fraction of the displacement below which none is kept.
const LEAST_WAY: f64 = 1e-3;

/// Most times that a velocity is shortened together with its displacement.
const MOST_SHORTENINGS: usize = 8;

/// Energy at the start of a step, remembered from the end of the last one if the state is the same.
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

/// Result of an audit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Verdict {
    /// The step is accepted; its velocity may have been corrected.
    Sound,
    /// The step should be repeated.
    Coarse,
}

/// Limits of an audit.
#[derive(Clone, Copy, Debug)]
pub(super) struct Audit {
    /// Energy before the step; none where the system is not audited.
    pub before: Option<MechanicalEnergy>,
    /// Whether no safer way to take the step is left.
    pub is_last: bool,
    /// Fraction of the kinetic energy that may be gained, see [`GAIN`].
    pub gain: f64,
    /// Fraction of the kinetic energy that free flight may gain or lose: an error of the scheme's
    /// order that does not accumulate.
    pub drift: f64,
}

impl Audit {
    /// Judges `ws.v` and `ws.end` before projection, and corrects `ws.v` if no safer way is left.
    pub(super) fn judge<S: MechanicalSystem>(
        &self,
        system: &mut S,
        options: &StepOptions,
        start: Start<'_, S::Configuration>,
        warm_start: &WarmStart<KeyOf<S>>,
        ws: &mut ScratchOf<S>,
        report: &mut StepReport,
    ) -> Verdict {
        system.normalise(&mut ws.end);
        let Some(before) = self.before else {
            system.work(options, start, &ws.v);
            return Verdict::Sound;
        };
        ws.audited.energy = None;
        let contact_work = contact_work::<S>(start.v, warm_start, ws);
        let Balance {
            after,
            excess,
            mut work,
            released,
        } = if self.is_last {
            shortened_balance(system, options, start, ws, &before)
        } else {
            balance(system, options, start, ws, &before)
        };
        let gained = excess.value;
        if !gained.is_finite() {
            return if self.is_last {
                Verdict::Sound // not finite: refused when the step ends
            } else {
                Verdict::Coarse
            };
        }
        // With θ > ½ the scheme itself dissipates.
        let is_free = ws.contacts.is_empty() && options.theta <= 0.5;
        if excess.is_balanced(is_free, [self.gain, self.drift]) {
            report.energy_gain = report.energy_gain.max(excess.relative());
            let ledger = Ledger {
                work,
                contact_work,
                released,
                ..Ledger::default()
            };
            enter(system, start, ws, [&before, &after], ledger, report);
            return Verdict::Sound;
        }
        if excess.is_coarse(is_free, self.gain) && !self.is_last {
            return Verdict::Coarse;
        }
        let d = S::DIMENSION.components();
        let nothing_outside = is_free || ws.contacts.iter().all(UnilateralContact::is_internal);
        let (share, is_enough) = excess.share_of_relative_motion(after.momentum.into(), after.mass);
        let is_relative = is_enough && nothing_outside && (is_free || gained > 0.0);
        if is_relative || gained > 0.0 {
            let share = if is_relative { share } else { excess.share() };
            if options.is_elastic() && !is_free {
                report.residual = report.residual.max(violation_by(share, ws, d));
            }
            if is_relative {
                scale_relative_motion(system, ws, share, &after);
            } else {
                shorten(ws, share);
            }
            if excess.is_left(self.gain) {
                work = self.hold_back(system, options, start, ws).unwrap_or(work);
            }
        }
        if let Some(corrected) = system.energy(options, &ws.end, &ws.v) {
            let ledger = Ledger {
                work,
                contact_work,
                released,
                removed: gained.max(0.0),
                ..Ledger::default()
            };
            enter(system, start, ws, [&before, &corrected], ledger, report);
        }
        Verdict::Sound
    }
}

impl Audit {
    /// Shortens the displacement of a step that ends at rest and still gained energy.
    ///
    /// Something stopped such a step before its end: the machine jammed while the actuators' work
    /// was counted to the end, or a contact closed on its way up. The largest fraction σ of the
    /// displacement that the energy allows is kept; σ = 0 is always allowed. Returns the work over
    /// it.
    fn hold_back<S: MechanicalSystem>(
        &self,
        system: &mut S,
        options: &StepOptions,
        start: Start<'_, S::Configuration>,
        ws: &mut ScratchOf<S>,
    ) -> Option<Work> {
        let before = self.before?;
        let (h, theta) = (options.time_step, options.theta);
        let d = S::DIMENSION.components();
        for ((mean, end), begin) in ws.v_mean.iter_mut().zip(&ws.v).zip(start.v) {
            *mean = theta * end + (1.0 - theta) * begin;
        }
        let work = system.work(options, start, &ws.v);
        let mut share = 1.0;
        for k in 0..MOST_SHORTENINGS {
            let after = system.energy(options, &ws.end, &ws.v).unwrap_or(before);
            let excess = after.above(&before) - share * work.total();
            if excess <= 0.0 {
                break;
            }
            // With no displacement the excess is minus the kinetic energy; in between it is nearly
            // linear.
            let shorter = SAFE * share * before.kinetic / (excess + before.kinetic);
            let back = h * (share - shorter);
            let is_last = k + 1 == MOST_SHORTENINGS;
            share = if shorter > LEAST_WAY && !is_last {
                shorter
            } else {
                0.0
            };
            let local = ws.u.chunks_exact(d).zip(ws.u_before.chunks_exact(d));
            for (gap, (u, before)) in ws.gap_end.iter_mut().zip(local) {
                *gap -= back * (theta * u[0] + (1.0 - theta) * before[0]);
            }
            system.set_moved(start.configuration, &ws.v_mean, share * h, &mut ws.end);
            system.close_end(&ws.p, &mut ws.end, &mut ws.v);
            system.normalise(&mut ws.end);
        }
        Some(work.times(share))
    }
}

/// Enters the `ledger` of a step between two energies into the report, with what the springs
/// stored.
fn enter<S: MechanicalSystem>(
    system: &S,
    start: Start<'_, S::Configuration>,
    ws: &mut ScratchOf<S>,
    [before, after]: [&MechanicalEnergy; 2],
    ledger: Ledger,
    report: &mut StepReport,
) {
    let ledger = Ledger {
        stored: system.stored(&ws.end) - system.stored(start.configuration),
        change: after.above(before),
        ..ledger
    };
    report.enter_energies(ledger.entries());
    ws.audited.is(&ws.end, &ws.v, *after);
}

/// Carries the velocity `ws.v` to the position `ws.end` that a projection displaced by `ws.dv`, see
/// [`super::carried_velocity`]. Counts the energy that this added beyond the actuators' work on the
/// way. `stored`: in springs and position controls before it, J.
pub(super) fn carry_velocity<S: MechanicalSystem>(
    system: &mut S,
    options: &StepOptions,
    start: Start<'_, S::Configuration>,
    stored: f64,
    ws: &mut ScratchOf<S>,
    report: &mut StepReport,
) {
    let Some(before) = ws.audited.energy else {
        return;
    };
    let work = system.work_of_displacement(options, start, &ws.v, &ws.dv);
    let Some(moved) = system.energy(options, &ws.end, &ws.v) else {
        return;
    };
    let is_alone = ws.contacts.iter().all(UnilateralContact::is_internal);
    let carried = Carried::new(before.moving(), moved.moving(), moved.mass, is_alone);
    let Vec3 { x, y, z } = carried.common;
    for (k, v) in ws.v.iter_mut().enumerate() {
        let common = system
            .translation_axis(k)
            .map_or(0.0, |axis| [x, y, z][axis]);
        *v = common + carried.share * *v;
    }
    for u in &mut ws.u {
        *u *= carried.share;
    }
    let after = system.energy(options, &ws.end, &ws.v).unwrap_or(moved);
    let lifted = after.above(&before) + (system.stored(&ws.end) - stored) - work;
    report.energy_supplied += work;
    report.energy_lifted += lifted.max(0.0);
    report.energy_lost += (-lifted).max(0.0);
    ws.audited.is(&ws.end, &ws.v, after);
}

/// Energy balance of a step.
#[derive(Clone, Copy, Debug)]
struct Balance {
    after: MechanicalEnergy,
    excess: Excess<f64>,
    work: Work,
    released: f64,
}

/// Excess of the change of the energy over what was supplied, and what it is compared with, J.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Excess<T> {
    pub value: T,
    /// Kinetic energy after the step.
    kinetic: T,
    /// The kinetic energy at hand. A machine at rest has none as a measure: at least what gravity
    /// adds in a step of free fall.
    size: T,
    /// Rounding of the balance.
    rounding: T,
}

impl<T: Lane> Excess<T> {
    /// `before` and `after`: kinetic and potential energy; `supplied`: work of the actuators, and
    /// what contacts release; `fall`: speed of a body that falls for the step from rest, m/s.
    #[inline(always)]
    pub(crate) fn new(
        before: [T; 2],
        after: [T; 2],
        [work, released]: [T; 2],
        (mass, fall): (T, T),
    ) -> Self {
        let [kinetic, _] = after;
        let change = (after[0] - before[0]) + (after[1] - before[1]);
        let least = work.like(0.5) * mass * fall * fall;
        let sizes = before[0].abs() + after[0].abs() + before[1].abs() + after[1].abs();
        Self {
            value: change - (work + released),
            kinetic,
            size: before[0].max(kinetic).max(least),
            rounding: work.like(ROUNDINGS * f64::EPSILON) * (sizes + work.abs()),
        }
    }

    /// Free flight may neither gain nor lose.
    #[inline(always)]
    fn measured(&self, is_free: T::Mask) -> T {
        T::select(is_free, self.value.abs(), self.value)
    }

    /// Where the step is accepted as it is; `gain` and, in free flight, `drift`: fractions of the
    /// kinetic energy.
    #[inline(always)]
    pub(crate) fn is_balanced(&self, is_free: T::Mask, [gain, drift]: [T; 2]) -> T::Mask {
        let allowed = self.rounding + T::select(is_free, drift, gain) * self.size;
        self.measured(is_free).le(allowed)
    }

    /// Where it is coarse, or an excess remains at v⁺ = 0. What is not finite is coarse.
    #[inline(always)]
    pub(crate) fn is_coarse(&self, is_free: T::Mask, gain: T) -> T::Mask {
        let coarse = self.size.like(COARSE) * self.size;
        !self.measured(is_free).le(coarse) | self.is_left(gain)
    }

    /// Where an excess remains at v⁺ = 0.
    #[inline(always)]
    fn is_left(&self, gain: T) -> T::Mask {
        !(self.value - self.kinetic).le(self.rounding + gain * self.size)
    }

    /// As a fraction of the kinetic energy.
    #[inline(always)]
    pub(crate) fn relative(&self) -> T {
        let (zero, tiny) = (self.value.like(0.0), self.value.like(f64::MIN_POSITIVE));
        (self.value - self.rounding).max(zero) / self.size.max(tiny)
    }

    /// Scale of the velocity that removes it.
    #[inline(always)]
    pub(crate) fn share(&self) -> T {
        let (zero, one) = (self.value.like(0.0), self.value.like(1.0));
        (one - self.value / self.kinetic).max(zero).sqrt()
    }

    /// Scale of the motion relative to the mass centre that removes it, and where it is no larger
    /// than the energy of that motion.
    #[inline(always)]
    pub(crate) fn share_of_relative_motion(&self, momentum: Vec3<T>, mass: T) -> (T, T::Mask) {
        let one = mass.like(1.0);
        let whole = momentum.dot(momentum) / (mass.like(2.0) * mass);
        let relative = self.kinetic - whole;
        let share = (one - self.value / relative)
            .min(mass.like(1.0 + RAISE))
            .sqrt();
        (share, self.value.lt(relative))
    }
}

/// The balance of the step to `ws.end` and `ws.v`.
fn balance<S: MechanicalSystem>(
    system: &mut S,
    options: &StepOptions,
    start: Start<'_, S::Configuration>,
    ws: &ScratchOf<S>,
    before: &MechanicalEnergy,
) -> Balance {
    let work = system.work(options, start, &ws.v);
    let after = system.energy(options, &ws.end, &ws.v).unwrap_or(*before);
    let released = supplied_by_contacts::<S>(options, ws);
    let both = |energy: &MechanicalEnergy| [energy.kinetic, energy.potential];
    let fall = options.gravity.norm() * options.time_step;
    let (before, ends) = (both(before), both(&after));
    Balance {
        after,
        excess: Excess::new(before, ends, [work.total(), released], (after.mass, fall)),
        work,
        released,
    }
}

/// Energy that the step may gain by contacts that yield, J.
fn supplied_by_contacts<S: MechanicalSystem>(options: &StepOptions, ws: &ScratchOf<S>) -> f64 {
    let d = S::DIMENSION.components();
    let laws = ws.yielding.iter().enumerate();
    laws.filter(|(_, law)| law.is_soft())
        .map(|(i, law)| {
            let mut p = [0.0; 3];
            p[..d].copy_from_slice(&ws.p[d * i..][..d]);
            law.supplied(options.time_step, [ws.u_before[d * i], ws.u[d * i]], p)
        })
        .sum()
}

/// The same, after the velocity and its displacement are shortened while the excess is a large part
/// of the kinetic energy.
fn shortened_balance<S: MechanicalSystem>(
    system: &mut S,
    options: &StepOptions,
    start: Start<'_, S::Configuration>,
    ws: &mut ScratchOf<S>,
    before: &MechanicalEnergy,
) -> Balance {
    let mut found = balance(system, options, start, ws, before);
    for _ in 0..MOST_SHORTENINGS {
        let Balance { after, excess, .. } = found;
        if excess.value.is_nan() || excess.value <= SHORT * after.kinetic {
            break;
        }
        // The velocity is far off, and so is the displacement that it caused. Shorten both
        // together.
        let share = (before.kinetic / after.kinetic).min(SHORT).sqrt();
        shorten(ws, share);
        place(system, options, ws);
        system.normalise(&mut ws.end);
        found = balance(system, options, start, ws, before);
    }
    found
}

/// Scales the motion relative to the mass centre, in the local velocities too.
fn scale_relative_motion<S: MechanicalSystem>(
    system: &S,
    ws: &mut ScratchOf<S>,
    share: f64,
    after: &MechanicalEnergy,
) {
    let translation = after.momentum / after.mass;
    for (k, v) in ws.v.iter_mut().enumerate() {
        let axis = system.translation_axis(k);
        let common = axis.map_or(0.0, |axis| translation[axis]);
        *v = common + share * (*v - common);
    }
    for u in &mut ws.u {
        *u *= share;
    }
}

/// Violation of the contacts' law by `v⁺ ← share v⁺`, relative to the free velocity.
///
/// A closed contact that is to rebound at u_N separates at `share u_N`. At e = 0 a rigid contact
/// has u_N = 0, and the law holds.
fn violation_by<Q, C>(share: f64, ws: &Scratch<Q, C>, d: usize) -> f64 {
    let squares = |x: &[f64]| x.iter().map(|x| x * x).sum::<f64>();
    let local = ws.u.chunks_exact(d).zip(ws.p.chunks_exact(d));
    let closed = local.filter(|(_, p)| p[0] > 0.0);
    let lost = closed.map(|(u, _)| squares(&u[..1])).sum::<f64>();
    relative((1.0 - share) * lost.sqrt(), squares(&ws.q_free).sqrt())
}

/// `v⁺ ← share v⁺`, in the local velocities too.
fn shorten<Q, C>(ws: &mut Scratch<Q, C>, share: f64) {
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
