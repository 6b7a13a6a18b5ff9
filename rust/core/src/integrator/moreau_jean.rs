//! Moreau–Jean, one linearised step ([`super::scheme`]) of one system, with all effort.
//!
//! A step that fails is repeated with implicit gyroscopic terms, and in halves. The last way to
//! take it is accepted, and its report says what is wrong with it.

use super::audit::note_energies;
use super::balance::{AuditLimits, GAIN};
use super::data::{MOST_TURN, Obstacle};
use super::dynamics::Dynamics;
use super::error::StepError;
use super::listed::{Listed, ListedData, PosedOf};
use super::mechanical_system::{ConfigurationOf, KeyOf, MechanicalSystem};
use super::options::{Stabilisation, StepOptions};
use super::probe::{Phase, Probe};
use super::projection::{measure, set_gaps};
use super::report::StepReport;
use super::scheme::{finish, prepare, retake, take_answers};
use super::scratch::{ScratchOf, StateMut, StepScratch};
use super::shortening::judge_at_last;
use super::stepping::Integrator;
use super::warm_start::WarmStart;

/// The linearised variant.
#[derive(Clone, Copy, Debug, Default)]
pub struct MoreauJean;

impl<S: MechanicalSystem> Integrator<S> for MoreauJean {
    fn step(
        &self,
        system: &mut S,
        options: &StepOptions,
        mut state: StateMut<'_, ConfigurationOf<S>>,
        warm_start: &mut WarmStart<KeyOf<S>>,
        scratch: &mut ScratchOf<S>,
        probe: &mut dyn Probe,
    ) -> Result<StepReport, StepError> {
        scratch.load(system, &state, warm_start);
        let report = advance(system, options, scratch, probe)?;
        scratch.store(&mut state, warm_start);
        Ok(report)
    }
}

/// Takes a step from the state that the scratch holds.
pub(super) fn advance<S: MechanicalSystem>(
    system: &mut S,
    options: &StepOptions,
    scratch: &mut ScratchOf<S>,
    probe: &mut dyn Probe,
) -> Result<StepReport, StepError> {
    let mut attempts = MOST_ATTEMPTS;
    let whole = Part {
        options,
        share: 1.0,
        depth: 0,
    };
    let is_unsolved = std::mem::take(&mut scratch.is_unsolved);
    // An elastic step may be solved as a whole once its impacts are taken as inelastic.
    if is_unsolved && !options.is_elastic() && system.solves_to_the_end() {
        return whole.divide(2.0, system, scratch, &mut attempts, probe);
    }
    whole.advance(system, scratch, &mut attempts, probe)
}

/// Most attempts at a step with all its parts, beyond repetitions for another branch and the parts
/// that fast turning asks for.
const MOST_ATTEMPTS: usize = 16;

/// Most times that a step is halved.
const MOST_HALVINGS: usize = 3;

/// Most parts of a step that fast rotation is given. Faster rotation is not resolved; the audit
/// controls its energy.
const MOST_PARTS: f64 = 64.0;

/// Takes a step or a part of one. A part that fails is repeated in halves, which are different and
/// mostly easier problems.
#[derive(Clone, Copy)]
struct Part<'a> {
    options: &'a StepOptions,
    /// Fraction of the whole step.
    share: f64,
    depth: usize,
}

impl Part<'_> {
    fn advance<S: MechanicalSystem>(
        self,
        system: &mut S,
        scratch: &mut ScratchOf<S>,
        attempts: &mut usize,
        probe: &mut dyn Probe,
    ) -> Result<StepReport, StepError> {
        let d = &mut scratch.data;
        d.is_gyroscopic.fill(false);
        let turning = system
            .machine_mut()
            .turning(self.options, &d.v, &mut d.is_gyroscopic);
        let turn = self.options.time_step * turning.unwrap_or(0.0);
        if self.depth == 0 && turn > MOST_TURN {
            let n = (turn / MOST_TURN).min(MOST_PARTS).ceil();
            return self.divide(n, system, scratch, attempts, probe);
        }
        match self.attempt(system, scratch, attempts, probe)? {
            Some(report) => Ok(report),
            None => self.divide(2.0, system, scratch, attempts, probe),
        }
    }

    /// Takes the part as one; none if it should be halved.
    fn attempt<S: MechanicalSystem>(
        self,
        system: &mut S,
        scratch: &mut ScratchOf<S>,
        attempts: &mut usize,
        probe: &mut dyn Probe,
    ) -> Result<Option<StepReport>, StepError> {
        // Where sweeps end early by design they would do so in a smaller step too.
        let may_halve = self.depth < MOST_HALVINGS && system.solves_to_the_end();
        let StepScratch {
            data: d,
            list,
            problems,
            gaps,
            ..
        } = &mut *scratch;
        let s = &mut Listed {
            system,
            options: self.options,
            list,
        };
        let limits = AuditLimits {
            gain: GAIN * self.share,
            drift: 0.0,
        };
        begin(s, d);
        d.is_at_end = false;
        *attempts = attempts.saturating_sub(1);
        d.is_last = !(may_halve && *attempts > 1 && s.has_work_left());
        prepare(s, d, problems, probe);
        loop {
            if !d.going {
                return give_up(d.obstacles[0], d.is_last, d.time);
            }
            s.list.may_halve = !d.is_last;
            s.solve(&d.v, (&d.y, &d.laws), problems);
            probe.end(Phase::Solve);
            if take_answers(s, d, problems, probe) {
                d.is_last = !(may_halve && *attempts > 1 && s.has_work_left());
                continue;
            }
            if !d.going {
                return give_up(d.obstacles[0], d.is_last, d.time);
            }
            if judge_at_last(s, d, problems, limits) {
                break;
            }
            if !make_implicit(s, d) {
                return Ok(None);
            }
            *attempts = attempts.saturating_sub(1);
            d.is_last = !(may_halve && *attempts > 1 && s.has_work_left());
            d.retaken = true;
            retake(s, d, problems, probe);
        }
        probe.end(Phase::Update);
        project_and_accept(s, d, gaps, probe)?;
        let report = d.reports[0];
        if self.depth > 0 {
            scratch.add_part();
        }
        Ok(Some(report))
    }

    /// Takes the step in `n` equal parts, or leaves the state as it was. The remembered impulses
    /// are those of a part meanwhile.
    fn divide<S: MechanicalSystem>(
        self,
        n: f64,
        system: &mut S,
        scratch: &mut ScratchOf<S>,
        attempts: &mut usize,
        probe: &mut dyn Probe,
    ) -> Result<StepReport, StepError> {
        let kept = scratch.data.keep();
        let time = scratch.data.time;
        let options = StepOptions {
            time_step: self.options.time_step / n,
            ..self.options.clone()
        };
        let part = Part {
            options: &options,
            share: self.share / n,
            depth: self.depth + 1,
        };
        let mut total = StepReport::default();
        scratch.data.scale_memory(1.0 / n);
        let mut k = 0.0;
        while k < n {
            match part.advance(system, scratch, attempts, probe) {
                Ok(report) => total.merge(&report),
                Err(error) => {
                    scratch.data.restore(kept);
                    return Err(error);
                }
            }
            k += 1.0;
        }
        scratch.data.scale_memory(n);
        scratch.data.time = time + self.options.time_step;
        total.steps = 1;
        total.retaken += 1;
        Ok(total)
    }
}

/// Options of the step, and energies at its start if they are not known.
pub(super) fn begin<S: MechanicalSystem>(s: &mut Listed<'_, S>, d: &mut ListedData<S>) {
    d.occupied = true;
    d.options.clone_from(s.options);
    d.most_turn = f64::INFINITY;
    note_energies(s, d);
}

/// What follows where the step cannot be taken as it is: halves, or none.
fn give_up(
    why: Option<Obstacle>,
    is_last: bool,
    time: f64,
) -> Result<Option<StepReport>, StepError> {
    match why {
        Some(Obstacle::MassMatrix) if is_last => Err(StepError::SingularMassMatrix { time }),
        _ => Ok(None),
    }
}

/// Asks for implicit gyroscopic terms in the groups that are lost without; whether there is one.
fn make_implicit<S: MechanicalSystem>(s: &Listed<'_, S>, d: &mut ListedData<S>) -> bool {
    let mut is_any = false;
    for (cluster, own) in d.is_gyroscopic.iter_mut().enumerate() {
        if d.balances[s.list.leader_of(cluster)].is_lost && !*own {
            (*own, is_any) = (true, true);
        }
    }
    is_any
}

/// Projects the position, checks that everything is finite, and makes the end of the step the
/// state.
pub(super) fn project_and_accept<S: MechanicalSystem>(
    s: &mut Listed<'_, S>,
    d: &mut ListedData<S>,
    gaps: &mut PosedOf<S>,
    probe: &mut dyn Probe,
) -> Result<(), StepError> {
    if let Some([x, z]) = s.system.unknown_ground() {
        return Err(StepError::NoGround { time: d.time, x, z });
    }
    d.is_last = true;
    s.list.may_halve = false;
    let is_deep = s.options.stabilisation == Stabilisation::Projection && measure(s, d);
    if is_deep {
        set_gaps(s, d, gaps);
        s.solve_gaps(d, gaps);
    }
    let time = d.time;
    finish(s, d, is_deep.then_some(gaps), probe);
    match d.obstacles[0] {
        None => Ok(()),
        Some(_) => Err(StepError::NonFinite { time }),
    }
}
