//! Contact forces at acceleration level: `M a = F(q, v) + H λ` with the law on `d/dt (Hᵀ v)`.
//!
//! The schemes of [`rover_core::integrator`] do not need these; schemes that treat persistent
//! contact as smooth motion do.

use crate::whole::Whole;
use rover_core::contact::Activation;
use rover_core::integrator::{StateMut, StepError, StepOptions, StepStart};
use rover_core::solver::{SolveReport, SolverWorkspace, solve};

/// Largest displacement of any cluster, m, that `y` (nv) causes away from the contact points.
pub(crate) fn largest_displacement<S: Whole>(system: &S, y: &[f64]) -> f64 {
    let clusters = 0..system.n_clusters();
    let own = clusters.map(|cluster| system.displacement(y, cluster));
    own.fold(0.0, f64::max)
}

/// Half width of the difference quotient of Hᵀ(q(t)) v, s. Its error is a 30th of the fifth
/// derivative times δ⁴. At a few metres per second over curves of metres this is 1e-10 of the
/// value, and so is rounding.
const DELTA: f64 = 1e-3;

/// Contacts no further than `reach` (m) and no faster than `slow` (m/s)
/// along the normal, and all that penetrate; placed at q.
pub(crate) fn find<S: Whole>(
    system: &mut S,
    q: &S::Configuration,
    v: &[f64],
    reach: f64,
    slow: f64,
    out: &mut Vec<S::Contact>,
) {
    system.place_middle(q);
    system.place_end(q);
    let activation = Activation {
        lead: 0.0,
        hover: reach,
        slow,
    };
    system.detect(v, activation, out);
    system.relocate(out);
}

/// Factors M where the middle of the step is placed.
pub(crate) fn factorise<S: Whole>(
    system: &mut S,
    options: &StepOptions,
    time: f64,
) -> Result<(), StepError> {
    system.update_mass_matrix(options, true, true);
    if system.factorise(options) {
        return Ok(());
    }
    Err(StepError::SingularMassMatrix { time })
}

/// `a = M⁻¹ F(q, v)`, m/s² and rad/s²; the factor of M(q) stays in the system.
pub(crate) fn free_acceleration<S: Whole>(
    system: &mut S,
    options: &StepOptions,
    q: &S::Configuration,
    v: &[f64],
    time: f64,
) -> Result<Vec<f64>, StepError> {
    system.place_middle(q);
    factorise(system, options, time)?;
    let mut a = vec![0.0; v.len()];
    system.load(options, StepStart::at(q, v), v, &mut a);
    system.half_solve(&mut a);
    system.half_solve_back(&mut a);
    for a in &mut a {
        *a /= options.time_step;
    }
    Ok(a)
}

/// `b = d/dt (Hᵀ(q(t)) v)` along q ⊕ t v, m/s²; leaves the contacts placed
/// and assembled at q, with `u = Hᵀ v`.
pub(crate) fn convective_acceleration<S: Whole>(
    system: &mut S,
    contacts: &mut [S::Contact],
    q: &S::Configuration,
    v: &[f64],
    u: &mut Vec<f64>,
    b: &mut Vec<f64>,
) {
    let n = S::DIMENSION.components() * contacts.len();
    u.resize(n, 0.0);
    b.clear();
    b.resize(n, 0.0);
    let mut at = q.clone();
    for (place, weight) in [(1.0, 8.0), (-1.0, -8.0), (2.0, -1.0), (-2.0, 1.0)] {
        system.set_moved(q, v, place * DELTA, &mut at);
        system.place_end(&at);
        system.relocate(contacts);
        system.assemble(contacts, v, u);
        for (b, u) in b.iter_mut().zip(&*u) {
            *b += weight * u / (12.0 * DELTA);
        }
    }
    system.place_end(q);
    system.relocate(contacts);
    system.assemble(contacts, v, u);
}

/// μ of every contact.
pub(crate) fn friction<S: Whole>(
    system: &S,
    options: &StepOptions,
    contacts: &[S::Contact],
) -> Vec<f64> {
    let mu = |contact| system.friction_coefficient(options, contact);
    contacts.iter().map(mu).collect()
}

/// Solves the contact law on the assembled operator from `p`; returns `u = W p + free` too.
pub(crate) fn solve_law<S: Whole>(
    system: &S,
    options: &StepOptions,
    contacts: &[S::Contact],
    free: &[f64],
    p: &mut [f64],
    workspace: &mut SolverWorkspace,
) -> (SolveReport, Vec<f64>) {
    let mut u = vec![0.0; free.len()];
    let mu = friction(system, options, contacts);
    let problem = system.problem(free, &mu);
    let report = solve(&problem, &options.solver, p, &mut u, workspace);
    (report, u)
}

/// `M⁻¹ H p`.
pub(crate) fn response<S: Whole>(system: &S, p: &[f64]) -> Vec<f64> {
    let mut change = vec![0.0; system.nv()];
    system.add_impulses(p, &mut change);
    system.half_solve_back(&mut change);
    change
}

/// Adds `M⁻¹ H p` to `v`.
pub(crate) fn add_response<S: Whole>(system: &S, p: &[f64], v: &mut [f64]) {
    for (v, change) in v.iter_mut().zip(response(system, p)) {
        *v += change;
    }
}

/// Makes (q, v) the state at the end of a step of h seconds, unless they are not finite.
pub(crate) fn accept<S: Whole>(
    system: &S,
    (mut q, v): (S::Configuration, &[f64]),
    h: f64,
    state: StateMut<'_, S::Configuration>,
) -> Result<(), StepError> {
    let StateMut {
        configuration,
        v: velocity,
        time,
    } = state;
    if !system.is_finite(&q) || v.iter().any(|x| !x.is_finite()) {
        return Err(StepError::NonFinite { time: *time });
    }
    system.normalise(&mut q);
    *configuration = q;
    velocity.copy_from_slice(v);
    *time += h;
    Ok(())
}

/// Acceleration with the reactions of these contacts: those that act over
/// the time step after (q, v), divided by it.
///
/// In persistent contact, where `Hᵀ v` is 0 in the locked directions, the reactions are exact. A
/// separating contact has none; that of a sliding contact opposes the slip.
pub(crate) fn smooth_acceleration<S: Whole>(
    system: &mut S,
    options: &StepOptions,
    contacts: &mut [S::Contact],
    state: (&S::Configuration, &[f64], f64),
    workspace: &mut SolverWorkspace,
) -> Result<Vec<f64>, StepError> {
    let (q, v, time) = state;
    let mut a = free_acceleration(system, options, q, v, time)?;
    if contacts.is_empty() {
        return Ok(a);
    }
    let (mut u, mut b) = (Vec::new(), Vec::new());
    convective_acceleration(system, contacts, q, v, &mut u, &mut b);
    system.add_local_of_velocity(contacts, &a, &mut b);
    let d = S::DIMENSION.components();
    for (i, (b, u)) in b.iter_mut().zip(&u).enumerate() {
        // An approaching contact is stopped by an impact, not by a force.
        let u = if i % d == 0 { u.max(0.0) } else { *u };
        *b += u / options.time_step;
    }
    let mut force = vec![0.0; b.len()];
    solve_law(system, options, contacts, &b, &mut force, workspace);
    add_response(system, &force, &mut a);
    Ok(a)
}
