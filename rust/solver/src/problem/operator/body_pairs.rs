//! Contacts of many bodies that are coupled by contacts alone. Each contact acts on its two bodies
//! directly, without an operator W.
//!
//! A contact touches two bodies, so with `u = Zᵀ y + q` and `y = Z p` in factor coordinates
//! (M⁻¹ = F Fᵀ, Z = Fᵀ H) it reads and changes three numbers of each in the
//! plane, six in space. Two round bodies, disks for D = 2 and balls for D = 3, have a diagonal
//! block of W. [`solve_body_pairs`](crate::solver::solve_body_pairs) solves them.
//!
//! The arms from the centres to the point of contact are `∓r n`, so rotation moves the rims only
//! along the tangents t, b (`n = b × t`):
//!
//! ```text
//! u_N = n · (v_a − v_b)
//! u_t = t · (v_a − v_b) + b · (r_a ω_a + r_b ω_b)    in the plane b points to the viewer
//! u_b = b · (v_a − v_b) − t · (r_a ω_a + r_b ω_b)    in space only
//! ```
//!
//! Source: Jean 1999; Moreau 1999 (contact by contact on the bodies' velocities).

use super::BlockSparseDelassus;
use crate::space::{body_velocities, dot};

/// A contact of two round bodies, or of one with a fixed body.
///
/// In factor coordinates `v = c (y_1, …, y_D)` and `r ω = s (y_D+1, …)`, see the page above.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RoundPair<const D: usize> {
    /// Place of each body's factor coordinates; any place, with c = s = 0, for a fixed body.
    pub bodies: [u32; 2],
    /// Unit normal, from the second body into the first, then the tangents.
    pub frame: [[f64; D]; D],
    /// c: `1/√m` of each body, 0 for a fixed body.
    pub linear: [f64; 2],
    /// s: `r/√J` of each body, 0 for a fixed body.
    pub angular: [f64; 2],
    /// Whether the tangents are no unit vectors at right angles, as those of wheels with rollers;
    /// in space only.
    pub is_turned: bool,
}

/// All contacts of a step: first those among round bodies, then those of
/// the machine, a body of any number of coordinates.
///
/// A machine may have several trees: their coordinates follow one another.
#[derive(Clone, Debug, Default)]
pub struct BodyPairs<const D: usize> {
    /// Contacts among round bodies.
    pub round: Vec<RoundPair<D>>,
    /// Contacts of the machine; the second body is the round or the fixed one.
    pub machine: Vec<RoundPair<D>>,
    /// Rows n, t, (b) of Zᵀ of the machine's contacts in its own factor
    /// coordinates, contact by contact (D rows of `width`).
    pub rows: Vec<f64>,
    /// What W has on the diagonal of each of the machine's contacts beyond the squares of its rows,
    /// 1/kg: of rows that are zero, and of contacts that yield. Empty: nothing.
    pub beyond: Vec<[f64; D]>,
    /// Number of the machine's coordinates.
    pub width: usize,
    /// Place of the machine's coordinates.
    pub machine_at: usize,
    /// Number of factor coordinates.
    pub n_coordinates: usize,
    /// Slab of each round body, by the place of its coordinates, in space: slabs lie side by side,
    /// thick enough that most contacts are within one or between neighbours. Empty: one slab.
    /// Sweeps visit slabs on several threads; the answer depends on the slabs alone.
    pub slabs: Vec<u32>,
}

impl<const D: usize> RoundPair<D> {
    /// Square of tangent k (from 1).
    fn square(&self, k: usize) -> f64 {
        if self.is_turned {
            dot(&self.frame[k], &self.frame[k])
        } else {
            1.0
        }
    }

    /// `t × n` of tangent k (from 1), in space: the axis that moves a rim along it.
    #[inline]
    fn axis(&self, k: usize) -> [f64; D] {
        let (t, n) = (&self.frame[k], &self.frame[0]);
        let mut axis = self.frame[3 - k];
        if self.is_turned {
            for c in 0..D {
                let (e, f) = ((c + 1) % D, (c + 2) % D);
                axis[c] = t[e] * n[f] - t[f] * n[e];
            }
        } else if k == 2 {
            axis = axis.map(|x| -x);
        }
        axis
    }

    /// Velocity along tangent k (from 1) of a rim that rotates with `rim` = r ω.
    #[inline]
    fn rim_velocity(&self, k: usize, rim: &[f64]) -> f64 {
        if D == 2 {
            return rim[0];
        }
        let axis = self.axis(k);
        axis[0] * rim[0] + axis[1] * rim[1] + axis[2] * rim[2]
    }

    /// Component c of the moment of the tangential impulses, divided by r: the transpose of
    /// [`Self::rim_velocity`].
    #[inline]
    fn rim_impulse(&self, p: &[f64; D], c: usize) -> f64 {
        if D == 2 {
            return p[1];
        }
        self.axis(1)[c] * p[1] + self.axis(2)[c] * p[2]
    }

    /// u without q.
    #[inline]
    #[must_use]
    pub fn local(&self, y: &[f64]) -> [f64; D] {
        let V = body_velocities(D);
        let places = self.bodies.map(|at| at as usize);
        let [ya, yb] = places.map(|at| &y[at..at + V]);
        let [ca, cb] = self.linear;
        let mut between = [0.0; D];
        for k in 0..D {
            between[k] = ca * ya[k] - cb * yb[k];
        }
        let mut u = [0.0; D];
        for k in 0..D {
            u[k] = dot(&self.frame[k], &between);
        }
        for (y, s) in [ya, yb].into_iter().zip(self.angular) {
            for k in 1..D {
                u[k] += s * self.rim_velocity(k, &y[D..]);
            }
        }
        u
    }

    /// `y += Z p`.
    #[inline]
    pub fn add(&self, p: [f64; D], y: &mut [f64]) {
        let V = body_velocities(D);
        let force = self.force(&p);
        for (side, sign) in [1.0, -1.0].into_iter().enumerate() {
            let at = self.bodies[side] as usize;
            let (c, s) = (sign * self.linear[side], self.angular[side]);
            let y = &mut y[at..at + V];
            for k in 0..D {
                y[k] += c * force[k];
            }
            for k in D..V {
                y[k] += s * self.rim_impulse(&p, k - D);
            }
        }
    }

    /// The impulse in the world's axes.
    #[inline]
    fn force(&self, p: &[f64; D]) -> [f64; D] {
        let mut force = [0.0; D];
        for (k, force) in force.iter_mut().enumerate() {
            *force = self.frame[0][k] * p[0];
            for r in 1..D {
                *force += self.frame[r][k] * p[r];
            }
        }
        force
    }

    /// `W_NN` and `W_TT`, the same for each tangent, 1/kg; the rest of the block is 0. Tangents are
    /// unit vectors.
    #[inline]
    #[must_use]
    pub fn block(&self) -> [f64; 2] {
        let square = |[a, b]: [f64; 2]| a * a + b * b;
        let normal = square(self.linear);
        [normal, normal + square(self.angular)]
    }

    /// Whether either side moves.
    fn moves(&self, side: usize) -> bool {
        self.linear[side] > 0.0
    }

    /// Appends the rows of Zᵀ of one side (D rows of [`body_velocities`]).
    fn push_rows(&self, side: usize, out: &mut Vec<f64>) {
        let V = body_velocities(D);
        let sign = if side == 0 { 1.0 } else { -1.0 };
        let (c, s) = (sign * self.linear[side], self.angular[side]);
        for (k, row) in self.frame.iter().enumerate() {
            out.extend(row.iter().map(|x| c * x));
            for axis in 0..V - D {
                let mut unit = [0.0; 3];
                unit[axis] = 1.0;
                let turned = if k == 0 {
                    0.0
                } else {
                    self.rim_velocity(k, &unit)
                };
                out.push(s * turned);
            }
        }
    }
}

impl<const D: usize> BodyPairs<D> {
    /// Forgets all contacts, of a machine of `width` coordinates at
    /// `machine_at` among `n_coordinates`.
    pub fn clear(&mut self, width: usize, machine_at: usize, n_coordinates: usize) {
        self.round.clear();
        self.machine.clear();
        self.rows.clear();
        self.beyond.clear();
        self.slabs.clear();
        (self.width, self.machine_at, self.n_coordinates) = (width, machine_at, n_coordinates);
    }

    /// Number of contacts.
    #[must_use]
    pub fn len(&self) -> usize {
        self.round.len() + self.machine.len()
    }

    /// Whether there is no contact.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The machine's rows of its contact i.
    #[inline]
    pub(crate) fn rows_of(&self, i: usize) -> impl Iterator<Item = &[f64]> {
        let size = D * self.width;
        self.rows[size * i..size * (i + 1)].chunks_exact(self.width)
    }

    /// Block of W of the machine's contact i, 1/kg.
    #[must_use]
    pub fn machine_block(&self, i: usize) -> [[f64; D]; D] {
        let [normal, tangential] = self.machine[i].block();
        let mut block = [[0.0; D]; D];
        for (r, (out, row)) in block.iter_mut().zip(self.rows_of(i)).enumerate() {
            for (x, column) in out.iter_mut().zip(self.rows_of(i)) {
                *x = row.iter().zip(column).map(|(a, b)| a * b).sum();
            }
            let of_ball = if r == 0 {
                normal
            } else {
                tangential * self.machine[i].square(r)
            };
            out[r] += of_ball + self.beyond_of(i)[r];
        }
        block
    }

    /// See [`Self::beyond`].
    #[inline]
    pub(crate) fn beyond_of(&self, i: usize) -> [f64; D] {
        self.beyond.get(i).copied().unwrap_or([0.0; D])
    }

    /// `y += Z p`.
    pub fn add_impulses(&self, p: &[f64], y: &mut [f64]) {
        let (p, of_machine) = p.as_chunks::<D>().0.split_at(self.round.len());
        for (pair, p) in self.round.iter().zip(p) {
            pair.add(*p, y);
        }
        for (i, (pair, p)) in self.machine.iter().zip(of_machine).enumerate() {
            pair.add(*p, y);
            let own = &mut y[self.machine_at..self.machine_at + self.width];
            self.add_to_machine(i, p, own);
        }
    }

    /// `own += Z p` of the machine's contact i.
    #[inline]
    pub(crate) fn add_to_machine(&self, i: usize, p: &[f64; D], own: &mut [f64]) {
        for (row, p) in self.rows_of(i).zip(p) {
            for (y, z) in own.iter_mut().zip(row) {
                *y += z * p;
            }
        }
    }

    /// `u += Zᵀ own` of the machine's contact i.
    #[inline]
    pub(crate) fn add_local_of_machine(&self, i: usize, own: &[f64], u: &mut [f64; D]) {
        for (u, row) in u.iter_mut().zip(self.rows_of(i)) {
            *u += row.iter().zip(own).map(|(a, b)| a * b).sum::<f64>();
        }
    }

    /// `out = Zᵀ y`.
    pub fn local(&self, y: &[f64], out: &mut [f64]) {
        let (out, of_machine) = out.as_chunks_mut::<D>().0.split_at_mut(self.round.len());
        for (pair, out) in self.round.iter().zip(out) {
            *out = pair.local(y);
        }
        for (i, (pair, out)) in self.machine.iter().zip(of_machine).enumerate() {
            *out = pair.local(y);
            let own = &y[self.machine_at..self.machine_at + self.width];
            self.add_local_of_machine(i, own, out);
        }
    }

    /// The operator `W = Zᵀ Z`, block by block, 1/kg.
    #[must_use]
    pub fn operator(&self) -> BlockSparseDelassus {
        let V = body_velocities(D);
        let machine = self.machine_at / V;
        let n_round = self.round.len();
        let of_machine = (V + self.width) * self.machine.len();
        let mut rows = Vec::with_capacity(D * (2 * V * n_round + of_machine));
        // Where the rows of both sides of each contact begin.
        let mut starts = Vec::with_capacity(2 * self.len());
        for (i, pair) in self.round.iter().chain(&self.machine).enumerate() {
            starts.push(rows.len());
            match i.checked_sub(n_round) {
                Some(own) => self
                    .rows_of(own)
                    .for_each(|row| rows.extend_from_slice(row)),
                None => pair.push_rows(0, &mut rows),
            }
            starts.push(rows.len());
            pair.push_rows(1, &mut rows);
        }
        let pair = |i: usize| match i.checked_sub(n_round) {
            Some(own) => &self.machine[own],
            None => &self.round[i],
        };
        let body = |pair: &RoundPair<D>, side: usize| {
            pair.moves(side).then_some(pair.bodies[side] as usize / V)
        };
        let width = |i: usize, side: usize| {
            if i >= n_round && side == 0 {
                self.width
            } else {
                V
            }
        };
        let mut operator = BlockSparseDelassus::new();
        operator.assemble_with::<D>(
            self.len(),
            machine + 1,
            |i| {
                let second = body(pair(i), 1);
                if i < n_round {
                    [body(pair(i), 0), second]
                } else {
                    [Some(machine), second]
                }
            },
            |block, (i, side), (j, at)| {
                let width = width(i, side);
                let of = |i: usize, side: usize| {
                    let start = starts[2 * i + side];
                    rows[start..start + D * width].chunks_exact(width)
                };
                for (out, row) in block.iter_mut().zip(of(i, side)) {
                    for (x, column) in out.iter_mut().zip(of(j, at)) {
                        *x += row.iter().zip(column).map(|(a, b)| a * b).sum::<f64>();
                    }
                }
                if let Some(own) = i.checked_sub(n_round).filter(|_| i == j && side + at == 0) {
                    for (k, beyond) in self.beyond_of(own).into_iter().enumerate() {
                        block[k][k] += beyond;
                    }
                }
            },
        );
        operator
    }
}
