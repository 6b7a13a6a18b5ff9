//! Contacts of many bodies that share nothing but their contacts: what each reads and changes, and no operator W at all.
//!
//! A contact touches two bodies, so with `u = Zᵀ y + q` and `y = Z p` in factor coordinates
//! (see [`crate::integrator::mechanical_system`]) it reads six numbers and changes six numbers. A disc against a disc has a diagonal
//! block of W. [`solve_body_pairs`](crate::solver::solve_body_pairs) solves them.
//!
//! Source: Jean 1999; Moreau 1999 (contact by contact on the bodies' velocities).

/// Coordinates of the one body that is no disc.
pub const WIDE: usize = 5;

/// A contact of two discs, or of a disc with what does not move.
///
/// `u = (n·(w_a − w_b), t·(w_a − w_b) + s_a y_a3 + s_b y_b3)` with `w = c (y_1, y_2)`, t = n × e_z.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct DiscPair {
    /// Place of each body's three factor coordinates; any place, with c = s = 0, for one that does not move.
    pub bodies: [u32; 2],
    /// Unit normal, from the second body into the first.
    pub n: [f64; 2],
    /// c: `1/√m` of each body, 0 for one that does not move.
    pub linear: [f64; 2],
    /// s: `r/√J` of each body, 0 for one that does not move.
    pub angular: [f64; 2],
}

/// A contact of the wide body with a disc, or with what does not move.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct WidePair {
    /// Rows n and t of Zᵀ in the wide body's factor coordinates.
    pub rows: [[f64; WIDE]; 2],
    /// The disc as second body: its place, c, s and the normal from it into the wide body.
    pub disc: DiscPair,
}

/// All contacts of a step: first the discs' pairs, then the wide body's.
#[derive(Clone, Debug, Default)]
pub struct BodyPairs {
    /// Contacts among discs.
    pub discs: Vec<DiscPair>,
    /// Contacts of the wide body.
    pub wide: Vec<WidePair>,
    /// Place of the wide body's coordinates.
    pub wide_at: usize,
    /// Number of factor coordinates.
    pub n_coordinates: usize,
}

impl DiscPair {
    /// u without q.
    #[inline]
    #[must_use]
    pub fn local(&self, y: &[f64]) -> [f64; 2] {
        let (a, b) = (self.bodies[0] as usize, self.bodies[1] as usize);
        let (ya, yb) = (&y[a..a + 3], &y[b..b + 3]);
        let [n_x, n_y] = self.n;
        let [ca, cb] = self.linear;
        let [sa, sb] = self.angular;
        let (wx, wy) = (ca * ya[0] - cb * yb[0], ca * ya[1] - cb * yb[1]);
        [
            n_x * wx + n_y * wy,
            n_y * wx - n_x * wy + sa * ya[2] + sb * yb[2],
        ]
    }

    /// `y += Z p`.
    #[inline]
    pub fn add(&self, p: [f64; 2], y: &mut [f64]) {
        let (a, b) = (self.bodies[0] as usize, self.bodies[1] as usize);
        let [n_x, n_y] = self.n;
        let (fx, fy) = (n_x * p[0] + n_y * p[1], n_y * p[0] - n_x * p[1]);
        let ya = &mut y[a..a + 3];
        ya[0] += self.linear[0] * fx;
        ya[1] += self.linear[0] * fy;
        ya[2] += self.angular[0] * p[1];
        let yb = &mut y[b..b + 3];
        yb[0] -= self.linear[1] * fx;
        yb[1] -= self.linear[1] * fy;
        yb[2] += self.angular[1] * p[1];
    }

    /// `W_NN`, `W_TT`, 1/kg; `W_NT` is 0.
    #[inline]
    #[must_use]
    pub fn block(&self) -> [f64; 2] {
        let square = |[a, b]: [f64; 2]| a * a + b * b;
        let normal = square(self.linear);
        [normal, normal + square(self.angular)]
    }
}

impl WidePair {
    /// u without q.
    #[inline]
    #[must_use]
    pub fn local(&self, wide_at: usize, y: &[f64]) -> [f64; 2] {
        let mut u = self.disc.local(y);
        let own = &y[wide_at..wide_at + WIDE];
        for (u, row) in u.iter_mut().zip(&self.rows) {
            *u += row.iter().zip(own).map(|(a, b)| a * b).sum::<f64>();
        }
        u
    }

    /// `y += Z p`.
    #[inline]
    pub fn add(&self, wide_at: usize, p: [f64; 2], y: &mut [f64]) {
        self.disc.add(p, y);
        let own = &mut y[wide_at..wide_at + WIDE];
        for (row, p) in self.rows.iter().zip(p) {
            for (y, z) in own.iter_mut().zip(row) {
                *y += z * p;
            }
        }
    }

    /// Block of W, 1/kg.
    #[must_use]
    pub fn block(&self) -> [[f64; 2]; 2] {
        let dot = |a: &[f64; WIDE], b: &[f64; WIDE]| a.iter().zip(b).map(|(a, b)| a * b).sum();
        let [n, t] = &self.rows;
        let [disc_n, disc_t] = self.disc.block();
        let cross: f64 = dot(n, t);
        let (own_n, own_t): (f64, f64) = (dot(n, n), dot(t, t));
        [[own_n + disc_n, cross], [cross, own_t + disc_t]]
    }
}

impl BodyPairs {
    /// Number of contacts.
    #[must_use]
    pub fn len(&self) -> usize {
        self.discs.len() + self.wide.len()
    }

    /// Whether there is no contact.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// `y += Z p`.
    pub fn add_impulses(&self, p: &[f64], y: &mut [f64]) {
        let (discs, wide) = p.split_at(2 * self.discs.len());
        for (pair, p) in self.discs.iter().zip(discs.chunks_exact(2)) {
            pair.add([p[0], p[1]], y);
        }
        for (pair, p) in self.wide.iter().zip(wide.chunks_exact(2)) {
            pair.add(self.wide_at, [p[0], p[1]], y);
        }
    }

    /// `out = Zᵀ y`.
    pub fn local(&self, y: &[f64], out: &mut [f64]) {
        let (discs, wide) = out.split_at_mut(2 * self.discs.len());
        for (pair, out) in self.discs.iter().zip(discs.chunks_exact_mut(2)) {
            out.copy_from_slice(&pair.local(y));
        }
        for (pair, out) in self.wide.iter().zip(wide.chunks_exact_mut(2)) {
            out.copy_from_slice(&pair.local(self.wide_at, y));
        }
    }
}
