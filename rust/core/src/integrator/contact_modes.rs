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
//! A contact that friction holds at the edge of its cone slips with |u_T| → 0 along −p_T.
//!
//! A change du⁰ of the velocity at held impulses is answered by dp, with `du = du⁰ + W dp`, and so
//! is a change dμ of the friction:
//!
//! ```text
//! slip    dp_T + μ t dp_N + (μ p_N / |u_T|) (1 − t tᵀ) du_T + p_N t dμ = 0
//! ```
//!
//! Redundant contacts make the system singular. Any of its solutions gives the same du, so that of
//! an elimination with complete pivoting is taken, with zeros where there is no pivot.

use crate::law::mode::ContactMode;

/// Velocity, relative to the largest at play, that counts as rounding.
///
/// A closed contact sticks if it slides no faster and its impulse is within its cone. At the edge
/// of the cone it slips, along its friction: redundant contacts leave wheels there that cannot
/// move, and their impulse stays at the edge with the load.
const ROUNDING: f64 = 1e-9;

/// Pivots below this fraction of the largest count as zero.
const RANK: f64 = 1e-10;

/// A solution with the modes of its contacts.
#[derive(Clone, Debug)]
pub(crate) struct HeldLaw {
    d: usize,
    pub(crate) modes: Vec<ContactMode>,
    pub(crate) p: Vec<f64>,
    pub(super) u: Vec<f64>,
    mu: Vec<f64>,
    /// Sliding velocity that is none, m/s.
    rounding: f64,
    /// W_NN of each contact, 1/kg, by which impulses are compared with velocities.
    weight: Vec<f64>,
}

fn norm(x: &[f64]) -> f64 {
    x.iter().map(|x| x * x).sum::<f64>().sqrt()
}

impl HeldLaw {
    /// Finds the modes of the solution p, u (d n_c) for friction μ (n_c) and the weights W_NN
    /// (n_c).
    pub(crate) fn new(p: Vec<f64>, u: Vec<f64>, mu: Vec<f64>, weight: Vec<f64>) -> Self {
        let d = p.len().checked_div(mu.len()).unwrap_or(1);
        let pushes = (0..mu.len()).map(|i| weight[i] * norm(&p[d * i..d * (i + 1)]));
        let rounding = ROUNDING * pushes.fold(norm(&u), f64::max);
        let mode = |i: usize| {
            let (p, u, w) = (&p[d * i..d * (i + 1)], &u[d * i..d * (i + 1)], weight[i]);
            let room = w * (mu[i] * p[0] - norm(&p[1..]));
            if w * p[0] <= u[0].max(rounding) {
                ContactMode::Open
            } else if room > norm(&u[1..]).max(rounding) && mu[i] > 0.0 {
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
            rounding,
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
                    // A little velocity turns the direction of a slow slide.
                    let (speed, friction) = (norm(&u[1..]), w * self.mu[i] * p[0]);
                    let share = speed / (speed + friction).max(f64::MIN_POSITIVE);
                    u[0].abs() + share * w * norm(&off.collect::<Vec<_>>())
                }
            };
            worst = worst.max(violation);
        }
        worst / size
    }

    /// Unit vector along which a contact slides (d − 1): that of its velocity, or against its
    /// friction where it is held; zero without both.
    fn direction(&self, i: usize) -> Vec<f64> {
        let (p, u) = self.parts(i);
        let (along, sign) = if norm(&u[1..]) > self.rounding {
            (&u[1..], 1.0)
        } else {
            (&p[1..], -1.0)
        };
        let size = norm(along);
        let scale = if size > 0.0 { sign / size } else { 0.0 };
        along.iter().map(|x| scale * x).collect()
    }

    /// How the impulses answer changes. `W`: row-major. `is_common`: contacts whose friction is the
    /// common coefficient.
    pub(crate) fn answer(&self, W: &[f64], is_common: &[bool]) -> ImpulseDerivative {
        let (d, size) = (self.d, self.p.len());
        let width = 2 * size + 1;
        // Rows of [law | −of_u | −of_mu] with law = of_u W + of_p.
        let mut rows = vec![0.0; size * width];
        for (i, (row, mode)) in rows
            .chunks_exact_mut(d * width)
            .zip(&self.modes)
            .enumerate()
        {
            let (first, w) = (d * i, self.weight[i]);
            let mut of_u = |k: usize, column: usize, x: f64| {
                let row = &mut row[k * width..][..width];
                for (own, w) in row.iter_mut().zip(&W[column * size..][..size]) {
                    *own += x * w;
                }
                row[size + column] -= x;
            };
            match mode {
                ContactMode::Open => (0..d).for_each(|k| row[k * width + first + k] = w),
                ContactMode::Stick => (0..d).for_each(|k| of_u(k, first + k, 1.0)),
                ContactMode::Slip => {
                    let ((p, u), t) = (self.parts(i), self.direction(i));
                    // The part across, with numbers of the size of 1 however slow it slides.
                    let (speed, friction) = (norm(&u[1..]), w * self.mu[i] * p[0]);
                    let held = friction / (speed + friction).max(f64::MIN_POSITIVE);
                    let across =
                        |k: usize, l: usize| f64::from(u8::from(k == l)) - t[k - 1] * t[l - 1];
                    of_u(0, first, 1.0);
                    for k in 1..d {
                        for l in 1..d {
                            of_u(k, first + l, held * across(k, l));
                        }
                    }
                    for k in 1..d {
                        let row = &mut row[k * width..][..width];
                        for l in 1..d {
                            let along = t[k - 1] * t[l - 1];
                            row[first + l] += w * (along + (1.0 - held) * across(k, l));
                        }
                        row[first] += w * self.mu[i] * t[k - 1];
                        if is_common[i] {
                            row[2 * size] = -w * p[0] * t[k - 1];
                        }
                    }
                }
            }
        }
        solve(size, rows)
    }
}

/// `dp = of_u du⁰ + of_mu dμ`.
#[derive(Clone, Debug)]
pub(crate) struct ImpulseDerivative {
    size: usize,
    /// Rows of of_u with the entry of of_mu behind.
    rows: Vec<f64>,
}

impl ImpulseDerivative {
    /// The rows of of_u, each with its entry of of_mu.
    pub(crate) fn rows(&self) -> impl Iterator<Item = (&[f64], f64)> {
        let rows = self.rows.chunks_exact(self.size + 1);
        rows.map(|row| (&row[..self.size], row[self.size]))
    }
}

/// A solution X of `A X = B` with A square, be it singular; B must then be in its range. `rows`:
/// those of [A | B].
fn solve(n: usize, mut rows: Vec<f64>) -> ImpulseDerivative {
    let width = rows.len().checked_div(n).unwrap_or(0);
    let mut order: Vec<usize> = (0..n).collect();
    let (mut rank, mut largest) = (0, 0.0_f64);
    for k in 0..n {
        let (mut pivot, mut at) = (0.0_f64, (k, k));
        for i in k..n {
            for (j, x) in rows[i * width..][..n].iter().enumerate().skip(k) {
                if x.abs() > pivot {
                    (pivot, at) = (x.abs(), (i, j));
                }
            }
        }
        largest = largest.max(pivot);
        if pivot <= RANK * largest {
            break;
        }
        if at.0 != k {
            let (above, below) = rows.split_at_mut(at.0 * width);
            above[k * width..][..width].swap_with_slice(&mut below[..width]);
        }
        if at.1 != k {
            rows.chunks_exact_mut(width)
                .for_each(|row| row.swap(k, at.1));
            order.swap(k, at.1);
        }
        rank = k + 1;
        let (above, below) = rows.split_at_mut(rank * width);
        let own = &above[k * width..][k..width];
        for row in below.chunks_exact_mut(width) {
            let row = &mut row[k..];
            let factor = row[0] / own[0];
            if factor != 0.0 {
                for (x, own) in row.iter_mut().zip(own) {
                    *x -= factor * own;
                }
            }
        }
    }
    let m = width - n.min(width);
    let mut X = vec![0.0; n * m];
    for k in (0..rank).rev() {
        let row = &rows[k * width..][..width];
        let mut sum = row[n..].to_vec();
        for l in k + 1..rank {
            let known = &X[order[l] * m..][..m];
            for (sum, x) in sum.iter_mut().zip(known) {
                *sum -= row[l] * x;
            }
        }
        for (x, sum) in X[order[k] * m..][..m].iter_mut().zip(&sum) {
            *x = sum / row[k];
        }
    }
    ImpulseDerivative {
        size: m.saturating_sub(1),
        rows: X,
    }
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
        let unit = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0];
        let answer = law.answer(&unit, &[true]);
        let rows: Vec<_> = answer.rows().collect();
        let is = |found: f64, expected: f64| assert!((found - expected).abs() < 1e-14, "{found}");
        // Pressed harder it brakes harder: du_N = −1 gives dp = (1, −μ, 0).
        is(-rows[0].0[0], 1.0);
        is(-rows[1].0[0], -0.5);
        // Pushed across: dp_b = −k (1 + dp_b), k = μ p_N / |u_T| = ¼.
        is(rows[2].0[2], -0.2);
        // Rougher ground brakes with p_N a unit of μ.
        is(rows[1].1, -1.0);
    }

    #[test]
    fn a_singular_system_is_solved_where_it_can_be() {
        // Rows of [A | B] with A of rank 2.
        let rows = [
            [1.0, 1.0, 0.0, 3.0],
            [1.0, 1.0, 0.0, 3.0],
            [0.0, 2.0, 1.0, 4.0],
        ];
        let found = solve(3, rows.as_flattened().to_vec()).rows;
        for [a, b, c, right] in rows {
            let off = a * found[0] + b * found[1] + c * found[2] - right;
            assert!(off.abs() < 1e-15, "{found:?}");
        }
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
