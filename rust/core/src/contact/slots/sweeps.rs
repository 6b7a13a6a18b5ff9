//! Impulses to start pivoting from: Gauss–Seidel sweeps over a block's contacts.
//!
//! When commands change, many of the contacts of a machine on lines change their modes, and
//! pivoting corrects little more than one of them a step. So it does where a position is projected,
//! whose problem has no impulses of an earlier step. A few sweeps find most modes for the price of
//! one step, for all lanes of the block at once.

use super::contacts::ContactSlots;
use super::rows::ContactMatrices;
use crate::contact::loops::Loops;
use crate::contact::rows::{add_scaled, along};
use crate::scalar::{Lane, LaneMask};
use crate::solver::batch::problem::Triple;

/// Newton steps on the multiplier of a slide.
const SLIDE_STEPS: usize = 2;

/// The impulse of a contact by its law, all others fixed, where it has the impulse `p` and the
/// velocity `u`; `w`: its block of W. The normal is solved first, with the tangents as they are.
#[inline(always)]
fn solve<T: Lane>(w: &[T; 9], mu: T, p: &Triple<T>, u: &Triple<T>) -> Triple<T> {
    let zero = mu.like(0.0);
    let mut free = *u;
    for (k, free) in free.iter_mut().enumerate() {
        *free -= along(&[w[3 * k], w[3 * k + 1], w[3 * k + 2]], p);
    }
    let inverse = mu.like(1.0) / w[0];
    let pushed = free[0] + (w[1] * p[1] + w[2] * p[2]);
    let normal = (-(pushed * inverse)).max(zero);
    let slip = [free[1] + w[3] * normal, free[2] + w[6] * normal];
    let [t, b] = friction([w[4], w[5], w[8]], slip, mu * normal);
    [normal, t, b]
}

/// The tangential impulse of at most `limit` against the slip `f` without it: `−(W + λ 1)⁻¹ f` with
/// `λ >= 0`, so that it opposes what remains of the slip. `w`: entries tt, tb, bb.
#[inline(always)]
fn friction<T: Lane>([a, b, c]: [T; 3], f: [T; 2], limit: T) -> [T; 2] {
    let (zero, one) = (limit.like(0.0), limit.like(1.0));
    let mut lambda = zero;
    let mut p = [zero; 2];
    let mut norm = zero;
    for step in 0..=SLIDE_STEPS {
        let (a, c) = (a + lambda, c + lambda);
        let inverse = one / (a * c - b * b);
        p = [
            (b * f[1] - c * f[0]) * inverse,
            (b * f[0] - a * f[1]) * inverse,
        ];
        let square = p[0] * p[0] + p[1] * p[1];
        norm = square.sqrt();
        let slides = limit.lt(norm);
        if step == SLIDE_STEPS || !slides.any() {
            break;
        }
        let two_b = b + b;
        let rate = (c * p[0] * p[0] - two_b * p[0] * p[1] + a * p[1] * p[1]) * inverse;
        let more = (norm - limit) / limit * (square / rate);
        lambda = T::select(slides, lambda + more, lambda);
    }
    let scale = T::select(limit.lt(norm), limit / norm, one);
    let holds = zero.lt(limit);
    [
        T::select(holds, p[0] * scale, zero),
        T::select(holds, p[1] * scale, zero),
    ]
}

impl<T: Lane> ContactMatrices<T> {
    /// Improves impulses by slot, N s, with `n` sweeps; `q`: free velocity by slot, m/s. Only slots
    /// with problems that have factors are swept; those that a lane does not use get zero.
    #[inline(always)]
    pub(crate) fn sweep(
        &mut self,
        contacts: &ContactSlots<T>,
        n: usize,
        (q, mu): (&[Triple<T>], &[T]),
        p: &mut [Triple<T>],
        loops: Option<&Loops<T>>,
    ) {
        let zero = T::splat(contacts.token, 0.0);
        let mut motion = std::mem::take(&mut self.swept);
        let mut of_loops = std::mem::take(&mut self.swept_loops);
        motion.fill(zero);
        of_loops.fill(zero);
        for slot in contacts.used_nearby() {
            let active = contacts.slot(slot).active;
            for p in &mut p[slot] {
                *p = T::select(active, *p, zero);
            }
            let (path, rows) = self.of(contacts, slot);
            path.push(active, rows, &p[slot], &mut motion);
            push_loops(loops, slot, &p[slot], &mut of_loops);
        }
        for _ in 0..n {
            for slot in contacts.used_nearby() {
                let (path, rows) = self.of(contacts, slot);
                let mut u = q[slot];
                for k in 0..3 {
                    u[k] += self.softness[slot][k] * p[slot][k];
                }
                u[0] += self.normal[slot] * p[slot][0];
                let mut u = path.add_local(rows, &motion, u);
                if let Some(loops) = loops {
                    for (row, z) in of_loops.iter().enumerate() {
                        add_scaled(&mut u, loops.product(row, slot), -*z);
                    }
                }
                let new = solve(&self.diagonal[slot], mu[slot], &p[slot], &u);
                let active = contacts.slot(slot).active;
                let mut change = [zero; 3];
                for k in 0..3 {
                    change[k] = T::select(active, new[k] - p[slot][k], zero);
                    p[slot][k] += change[k];
                }
                path.push(active, rows, &change, &mut motion);
                push_loops(loops, slot, &change, &mut of_loops);
            }
        }
        self.swept = motion;
        self.swept_loops = of_loops;
    }
}

/// `z += B p` of a slot's impulse, which is zero in lanes without a contact there.
#[inline(always)]
fn push_loops<T: Lane>(loops: Option<&Loops<T>>, slot: usize, p: &Triple<T>, z: &mut [T]) {
    if let Some(loops) = loops {
        for (row, z) in z.iter_mut().enumerate() {
            *z += along(loops.product(row, slot), p);
        }
    }
}

/// Writes impulses by slot as the start of the problems with factors of a mask's lanes. Those of
/// rigid discs start from the last step: parked wheels would press against each other with what
/// the sweeps leave.
#[inline(always)]
pub(crate) fn write_start<T: Lane>(
    contacts: &ContactSlots<T>,
    lanes: T::Mask,
    p: &[Triple<T>],
    problems: &mut [crate::solver::batch::problem::ContactProblem],
) {
    for &slot in contacts.used() {
        let near =
            contacts.slot(slot).active & lanes & T::mask(contacts.token, contacts.near(slot));
        let (problem_indices, places) = (contacts.problem_indices(slot), contacts.places(slot));
        for lane in (0..T::LANES).filter(|lane| near.get(*lane)) {
            let problem = &mut problems[usize::from(problem_indices[lane])];
            if problem.factored.is_multiplied {
                continue;
            }
            problem.has_start = true;
            let own = &mut problem.start[3 * usize::from(places[lane])..][..3];
            for k in 0..3 {
                own[k] = p[slot][k].get(lane);
            }
        }
    }
}
