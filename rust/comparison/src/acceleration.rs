//! Contact forces at acceleration level: `M a = F(q, v) + H λ` with the law on `d/dt (Hᵀ v)`.
//!
//! The schemes of [`rover_core::integrator`] do not need these; schemes that treat persistent
//! contact as smooth motion do.

use crate::whole::Whole;
use rover_core::contact::Activation;
use rover_core::integrator::{StepError, StepOptions, StepStart};
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

/// `a = M⁻¹ F(q, v)`, m/s² and rad/s²; the factor of M(q) stays in the system.
pub(crate) fn free_acceleration<S: Whole>(
    system: &mut S,
    options: &StepOptions,
    q: &S::Configuration,
    v: &[f64],
    time: f64,
    a: &mut Vec<f64>,
) -> Result<(), StepError> {
    system.place_middle(q);
    system.update_mass_matrix(options, true, true);
    if !system.factorise(options) {
        return Err(StepError::SingularMassMatrix { time });
    }
    a.resize(v.len(), 0.0);
    let start = StepStart {
        configuration: q,
        v,
    };
    system.load(options, start, v, a);
    system.half_solve(a);
    system.half_solve_back(a);
    for a in a {
        *a /= options.time_step;
    }
    Ok(())
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

/// Solves the contact law on the assembled operator from `p`; `u = W p + q_free`.
pub(crate) fn solve_law<S: Whole>(
    system: &S,
    options: &StepOptions,
    contacts: &[S::Contact],
    q_free: &[f64],
    p: &mut [f64],
    u: &mut Vec<f64>,
    workspace: &mut SolverWorkspace,
) -> SolveReport {
    u.resize(q_free.len(), 0.0);
    let mu = friction(system, options, contacts);
    let problem = system.problem(q_free, &mu);
    solve(&problem, &options.solver, p, u, workspace)
}

/// `change = M⁻¹ H p`.
pub(crate) fn response<S: Whole>(system: &S, p: &[f64], change: &mut Vec<f64>) {
    change.clear();
    change.resize(system.nv(), 0.0);
    system.add_impulses(p, change);
    system.half_solve_back(change);
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
    let mut a = Vec::new();
    free_acceleration(system, options, q, v, time, &mut a)?;
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
    solve_law(system, options, contacts, &b, &mut force, &mut u, workspace);
    let mut change = Vec::new();
    response(system, &force, &mut change);
    for (a, change) in a.iter_mut().zip(&change) {
        *a += change;
    }
    Ok(a)
}
