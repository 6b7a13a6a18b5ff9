//! Modes of a solved friction-contact problem, and its derivative while they hold.
//!
//! With the local velocity u (normal part shifted by the impact law) and the impulse p of a contact
//!
//! ```text
//! open    p = 0
//! stick   u = 0
//! slip    u_N = 0,    p_T + μ p_N t = 0,    t = u_T / |u_T|
//! ```
//!
//! A change du⁰ of the velocity at held impulses is answered by dp, with `du = du⁰ + W dp`:
//!
//! ```text
//! slip    dp_T + μ t dp_N + (μ p_N / |u_T|) (1 − t tᵀ) du_T = 0
//! ```
//!
//! Redundant contacts make the system singular. Any of its solutions gives the same du, so that of
//! an elimination with complete pivoting is taken, with zeros where there is no pivot.

use nalgebra::DMatrix;

/// What a contact does at the end of a step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ContactMode {
    /// It transmits no impulse.
    Open,
    /// Neither its normal nor its tangential velocity can change.
    Stick,
    /// It stays closed and slides, with the friction of Coulomb's cone.
    Slip,
}

/// Velocity, relative to the largest at play, that counts as rounding: a closed contact that slides
/// no faster sticks, be it at the edge of its cone.
const ROUNDING: f64 = 1e-9;

/// Pivots below this fraction of the largest count as zero.
const RANK: f64 = 1e-10;

/// A solution with the modes of its contacts.
#[derive(Clone, Debug)]
pub(crate) struct HeldLaw {
    d: usize,
    pub(crate) modes: Vec<ContactMode>,
    pub(crate) p: Vec<f64>,
    u: Vec<f64>,
    mu: Vec<f64>,
    /// W_NN of each contact, 1/kg, by which impulses are compared with velocities.
    weight: Vec<f64>,
}

fn norm(x: &[f64]) -> f64 {
    x.iter().map(|x| x * x).sum::<f64>().sqrt()
}

impl HeldLaw {
    /// Of the solution p, u (d n_c) for friction μ (n_c) and the weights W_NN (n_c).
    pub(crate) fn new(p: Vec<f64>, u: Vec<f64>, mu: Vec<f64>, weight: Vec<f64>) -> Self {
        let d = p.len().checked_div(mu.len()).unwrap_or(1);
        let pushes = (0..mu.len()).map(|i| weight[i] * norm(&p[d * i..d * (i + 1)]));
        let rounding = ROUNDING * pushes.fold(norm(&u), f64::max);
        let mode = |i: usize| {
            let (p, u, w) = (&p[d * i..d * (i + 1)], &u[d * i..d * (i + 1)], weight[i]);
            let room = w * (mu[i] * p[0] - norm(&p[1..]));
            if w * p[0] <= u[0].max(rounding) {
                ContactMode::Open
            } else if room.max(rounding) >= norm(&u[1..]) && mu[i] > 0.0 {
                ContactMode::Stick
            } else {
                ContactMode::Slip
            }
        };
        Self {
            d,
            modes: (0..mu.len()).map(mode).collect(),
            p,
            u,
            mu,
            weight,
        }
    }

    fn parts(&self, i: usize) -> (&[f64], &[f64]) {
        let own = self.d * i..self.d * (i + 1);
        (&self.p[own.clone()], &self.u[own])
    }

    /// Change of the velocity of each contact that would change its mode (n_c), m/s.
    pub(crate) fn margins(&self) -> Vec<f64> {
        let margin = |(i, mode): (usize, &ContactMode)| {
            let ((p, u), w) = (self.parts(i), self.weight[i]);
            match mode {
                ContactMode::Open => u[0],
                ContactMode::Stick => (w * p[0]).min(w * (self.mu[i] * p[0] - norm(&p[1..]))),
                ContactMode::Slip if self.mu[i] > 0.0 => (w * p[0]).min(norm(&u[1..])),
                ContactMode::Slip => w * p[0],
            }
        };
        self.modes.iter().enumerate().map(margin).collect()
    }

    /// Largest violation of the modes' equations, relative to the velocities at play.
    pub(crate) fn residual(&self) -> f64 {
        let mut worst = 0.0_f64;
        let mut size = f64::MIN_POSITIVE;
        for (i, mode) in self.modes.iter().enumerate() {
            let ((p, u), w) = (self.parts(i), self.weight[i]);
            size = size.max(norm(u)).max(w * norm(p));
            let violation = match mode {
                ContactMode::Open => w * norm(p),
                ContactMode::Stick => norm(u),
                ContactMode::Slip => {
                    let t = self.direction(i);
                    let off = (1..self.d).map(|k| p[k] + self.mu[i] * p[0] * t[k - 1]);
                    u[0].abs() + w * norm(&off.collect::<Vec<_>>())
                }
            };
            worst = worst.max(violation);
        }
        worst / size
    }

    /// Unit vector along the sliding velocity (d − 1); zero without sliding.
    fn direction(&self, i: usize) -> Vec<f64> {
        let (_, u) = self.parts(i);
        let speed = norm(&u[1..]);
        let scale = if speed > 0.0 { 1.0 / speed } else { 0.0 };
        u[1..].iter().map(|x| scale * x).collect()
    }

    /// The impulses' answer dp (d n_c, m) to changes du⁰ (d n_c, m) at held impulses.
    pub(crate) fn respond(&self, W: &DMatrix<f64>, du: &DMatrix<f64>) -> DMatrix<f64> {
        let size = self.p.len();
        // law = of_u du + of_p dp
        let mut of_u = DMatrix::<f64>::zeros(size, size);
        let mut of_p = DMatrix::<f64>::zeros(size, size);
        for (i, mode) in self.modes.iter().enumerate() {
            let (first, w) = (self.d * i, self.weight[i]);
            match mode {
                ContactMode::Open => (0..self.d).for_each(|k| of_p[(first + k, first + k)] = w),
                ContactMode::Stick => (0..self.d).for_each(|k| of_u[(first + k, first + k)] = 1.0),
                ContactMode::Slip => {
                    of_u[(first, first)] = 1.0;
                    let ((p, u), t) = (self.parts(i), self.direction(i));
                    let speed = norm(&u[1..]);
                    let stiffness = if speed > 0.0 {
                        w * self.mu[i] * p[0] / speed
                    } else {
                        0.0
                    };
                    for k in 1..self.d {
                        of_p[(first + k, first + k)] = w;
                        of_p[(first + k, first)] = w * self.mu[i] * t[k - 1];
                        for l in 1..self.d {
                            let unit = f64::from(u8::from(k == l));
                            let across = unit - t[k - 1] * t[l - 1];
                            of_u[(first + k, first + l)] = stiffness * across;
                        }
                    }
                }
            }
        }
        let law = product(&of_u, W) + of_p;
        solve(law, -product(&of_u, du))
    }
}

/// `A B`, by sums in a fixed order: the same bits on every machine.
pub(crate) fn product(A: &DMatrix<f64>, B: &DMatrix<f64>) -> DMatrix<f64> {
    let mut out = DMatrix::zeros(A.nrows(), B.ncols());
    for (mut column, b) in out.column_iter_mut().zip(B.column_iter()) {
        for (a, b) in A.column_iter().zip(b.iter()) {
            for (out, a) in column.iter_mut().zip(a.iter()) {
                *out += a * b;
            }
        }
    }
    out
}

/// A solution of `A X = B` with A square, be it singular; B must then be in its range.
fn solve(mut A: DMatrix<f64>, mut B: DMatrix<f64>) -> DMatrix<f64> {
    let n = A.nrows();
    let mut order: Vec<usize> = (0..n).collect();
    let (mut rank, mut largest) = (0, 0.0_f64);
    for k in 0..n {
        let rest = A.view((k, k), (n - k, n - k));
        let (i, j) = rest.iamax_full();
        let pivot = rest[(i, j)].abs();
        largest = largest.max(pivot);
        if pivot <= RANK * largest {
            break;
        }
        A.swap_rows(k, k + i);
        B.swap_rows(k, k + i);
        A.swap_columns(k, k + j);
        order.swap(k, k + j);
        rank = k + 1;
        for row in k + 1..n {
            let factor = A[(row, k)] / A[(k, k)];
            for column in k..n {
                A[(row, column)] -= factor * A[(k, column)];
            }
            for column in 0..B.ncols() {
                B[(row, column)] -= factor * B[(k, column)];
            }
        }
    }
    let mut X = DMatrix::zeros(n, B.ncols());
    for column in 0..B.ncols() {
        for k in (0..rank).rev() {
            let known = (k + 1..rank).map(|l| A[(k, l)] * X[(order[l], column)]);
            let known: f64 = known.sum();
            X[(order[k], column)] = (B[(k, column)] - known) / A[(k, k)];
        }
    }
    X
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A unit mass on a plane: W = 1, pressed with p_N = 1.
    fn held(u: [f64; 3], p: [f64; 3], mu: f64) -> HeldLaw {
        HeldLaw::new(p.to_vec(), u.to_vec(), vec![mu], vec![1.0])
    }

    #[test]
    fn a_sliding_block_turns_its_friction_with_its_velocity() {
        let law = held([0.0, 2.0, 0.0], [1.0, -0.5, 0.0], 0.5);
        assert_eq!(law.modes, [ContactMode::Slip]);
        assert!(law.residual() < 1e-15);
        let du = DMatrix::from_column_slice(3, 2, &[-1.0, 0.0, 0.0, 0.0, 0.0, 1.0]);
        let dp = law.respond(&DMatrix::identity(3, 3), &du);
        // Pressed harder it brakes harder: dp = (1, −μ, 0).
        assert!((dp[(0, 0)] - 1.0).abs() < 1e-14 && (dp[(1, 0)] + 0.5).abs() < 1e-14);
        // Pushed across: dp_b = −k (1 + dp_b), k = μ p_N / |u_T| = ¼.
        assert!((dp[(2, 1)] + 0.2).abs() < 1e-14);
    }

    #[test]
    fn a_singular_system_is_solved_where_it_can_be() {
        let A = DMatrix::from_row_slice(3, 3, &[1.0, 1.0, 0.0, 1.0, 1.0, 0.0, 0.0, 2.0, 1.0]);
        let B = DMatrix::from_column_slice(3, 1, &[3.0, 3.0, 4.0]);
        assert!((product(&A, &solve(A.clone(), B.clone())) - B).amax() < 1e-15);
    }

    #[test]
    fn modes_and_margins_follow_from_the_nearer_of_the_two_sides() {
        assert_eq!(
            held([0.3, 0.0, 0.0], [0.0; 3], 0.5).modes,
            [ContactMode::Open]
        );
        let stick = held([0.0; 3], [1.0, 0.0, 0.4], 0.5);
        assert_eq!(stick.modes, [ContactMode::Stick]);
        assert!((stick.margins()[0] - 0.1).abs() < 1e-15);
        let smooth = held([0.0; 3], [1.0, 0.0, 0.0], 0.0);
        assert_eq!(smooth.modes, [ContactMode::Slip]);
        assert!((smooth.margins()[0] - 1.0).abs() < 1e-15);
    }
}
