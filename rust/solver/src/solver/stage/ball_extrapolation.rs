//! Extrapolation of drifts: where the impulses of [`super::ball_sweeps`] drift, they go on along
//! their drift at once.
//!
//! A heavy machine on light balls leaves the sweeps slow directions. A chain of balls that bears
//! the machine, or that no longer should, changes by about the mass of one ball times a residual
//! velocity in each sweep, and may have to change by the machine's weight. Each cluster of contacts
//! that drift and hang together through balls has its own drift `d = p − p_anchor` of the last
//! sweeps. The energy `½ pᵀWp + pᵀq` along it is least at the share `−dᵀu / dᵀWd`, `u = Wp + q`.
//! With the velocities `v` that belong to p, and `v_d` to d, both products are sums over balls:
//! `dᵀWd = v_dᵀ M v_d` and `dᵀu = dᵀq + v_dᵀ M v`.
//!
//! A share ends where the first contact of the cluster that loses much opens. The next sweep puts
//! impulses outside their cones back.

use super::ball_rows::{BallRow, BallVelocity, MachineBallRow};
use crate::problem::BodyPairs;
use crate::space::dot;

/// Largest and smallest share. A shorter one is not worth Nesterov's extrapolation of the
/// sweeps, which it ends.
const LONGEST: f64 = 1e3;
const SHORTEST: f64 = 5.0;

/// Contacts whose normal impulse falls by less than this part of the largest fall do not end
/// an extrapolation.
const SMALL: f64 = 0.3;

/// Contacts that drift by less than this part of the largest drift belong to no cluster.
const STILL: f64 = 0.1;

/// Where a drift starts, and scratch of its extrapolation.
#[derive(Clone, Debug, Default)]
pub(super) struct Anchor {
    /// Impulses of round contacts, then of the machine's.
    impulses: Vec<[f64; 3]>,
    drifts: Vec<[f64; 3]>,
    /// Places of each round contact's balls among all.
    places: Vec<[u32; 2]>,
    /// Union of balls into clusters.
    parents: Vec<u32>,
    /// Cluster and contact.
    members: Vec<(u32, u32)>,
    /// Velocities of a cluster's drift; zero between extrapolations.
    velocities: Vec<BallVelocity>,
    own: Vec<f64>,
    touched: Vec<u32>,
}

/// The iterate that an extrapolation changes.
pub(super) struct DriftTarget<'a> {
    pub pairs: &'a BodyPairs<3>,
    pub rows: &'a mut [BallRow],
    pub machine: &'a mut [MachineBallRow],
    pub balls: &'a mut [BallVelocity],
    /// Velocity of the machine due to the impulses, in its factor coordinates.
    pub own: &'a mut [f64],
    /// Where each slab's balls begin; the first of each is fixed.
    pub slabs: &'a [usize],
    /// Where each block's rows begin.
    pub blocks: &'a [usize],
}

/// The first of a ball's cluster.
fn root(parents: &mut [u32], mut k: u32) -> u32 {
    while parents[k as usize] != k {
        parents[k as usize] = parents[parents[k as usize] as usize];
        k = parents[k as usize];
    }
    k
}

impl Anchor {
    /// Remembers where a drift starts.
    pub(super) fn set(&mut self, rows: &[BallRow], machine: &[MachineBallRow]) {
        self.impulses.clear();
        self.impulses.extend(rows.iter().map(|row| row.p));
        self.impulses.extend(machine.iter().map(|row| row.p));
    }

    /// Adds a share of its drift to each cluster; whether any was extrapolated.
    pub(super) fn extrapolate(&mut self, at: &mut DriftTarget<'_>) -> bool {
        self.find_drifts(at);
        self.find_clusters(at);
        let members = std::mem::take(&mut self.members);
        let mut any = false;
        for cluster in members.chunk_by(|a, b| a.0 == b.0) {
            any |= self.extrapolate_cluster(cluster, at);
        }
        self.members = members;
        any
    }

    fn find_drifts(&mut self, at: &DriftTarget<'_>) {
        let now = (at.rows.iter().map(|row| row.p)).chain(at.machine.iter().map(|row| row.p));
        let both = now.zip(&self.impulses);
        self.drifts.clear();
        self.drifts
            .extend(both.map(|(p, old)| [p[0] - old[0], p[1] - old[1], p[2] - old[2]]));
    }

    fn find_clusters(&mut self, at: &DriftTarget<'_>) {
        let n_slabs = at.slabs.len() - 1;
        self.places.clear();
        for block in 0..=n_slabs {
            let first = if block < n_slabs { at.slabs[block] } else { 0 };
            let rows = &at.rows[at.blocks[block]..at.blocks[block + 1]];
            #[allow(clippy::cast_possible_truncation)] // balls are numbered by u32
            let places = |row: &BallRow| row.bodies.map(|body| first as u32 + body);
            self.places.extend(rows.iter().map(places));
        }
        #[allow(clippy::cast_possible_truncation)]
        {
            self.parents.clear();
            self.parents.extend(0..at.balls.len() as u32);
        }
        let squares = self.drifts.iter().map(|d| dot(d, d));
        let least = STILL * STILL * squares.fold(0.0, f64::max);
        let moves = |d: &[f64; 3]| dot(d, d) > least;
        let is_free = |place: u32| at.balls[place as usize].linear[3] > 0.0;
        for ([a, b], d) in self.places.iter().zip(&self.drifts) {
            if moves(d) && is_free(*a) && is_free(*b) {
                let (a, b) = (root(&mut self.parents, *a), root(&mut self.parents, *b));
                self.parents[a.max(b) as usize] = a.min(b);
            }
        }
        self.members.clear();
        let round = at.rows.len();
        for (k, d) in self.drifts.iter().enumerate() {
            if moves(d) {
                let ball = if k < round {
                    let [a, b] = self.places[k];
                    if is_free(a) { a } else { b }
                } else {
                    at.machine[k - round].ball
                };
                #[allow(clippy::cast_possible_truncation)] // contacts are numbered by u32
                self.members.push((root(&mut self.parents, ball), k as u32));
            }
        }
        self.members.sort_unstable();
        self.velocities.clear();
        self.velocities.extend(at.balls.iter().map(|ball| {
            let mut still = *ball;
            still.linear[..3].fill(0.0);
            still.turning[..3].fill(0.0);
            still
        }));
    }

    /// Sums the velocities of a cluster's drift.
    fn sum(&mut self, cluster: &[(u32, u32)], at: &DriftTarget<'_>) {
        self.own.clear();
        self.own.resize(at.own.len(), 0.0);
        self.touched.clear();
        let round = at.rows.len();
        for &(_, k) in cluster {
            let k = k as usize;
            let d = self.drifts[k];
            if k < round {
                let row = BallRow {
                    bodies: self.places[k],
                    ..at.rows[k]
                };
                row.add(&d, &mut self.velocities);
                self.touched.extend(row.bodies);
            } else {
                let row = &at.machine[k - round];
                row.add(at.pairs, k - round, &d, &mut self.velocities, &mut self.own);
                self.touched.push(row.ball);
            }
        }
        self.touched.sort_unstable();
        self.touched.dedup();
    }

    fn extrapolate_cluster(&mut self, cluster: &[(u32, u32)], at: &mut DriftTarget<'_>) -> bool {
        self.sum(cluster, at);
        let share = self.share(cluster, at);
        for &place in &self.touched {
            let (ball, drift) = (
                &mut at.balls[place as usize],
                &mut self.velocities[place as usize],
            );
            for (x, d) in [
                (&mut ball.linear, &mut drift.linear),
                (&mut ball.turning, &mut drift.turning),
            ] {
                for k in 0..3 {
                    x[k] += share * d[k];
                    d[k] = 0.0;
                }
            }
        }
        for (x, d) in at.own.iter_mut().zip(&self.own) {
            *x += share * d;
        }
        let round = at.rows.len();
        for &(_, k) in cluster {
            let k = k as usize;
            let p = if k < round {
                &mut at.rows[k].p
            } else {
                &mut at.machine[k - round].p
            };
            for (p, d) in p.iter_mut().zip(&self.drifts[k]) {
                *p += share * d;
            }
        }
        share > 0.0
    }

    /// The share of a cluster's drift that is added to it; 0 where energy falls no further.
    fn share(&self, cluster: &[(u32, u32)], at: &DriftTarget<'_>) -> f64 {
        let (mut slope, mut curvature) = (0.0, 0.0);
        for &place in &self.touched {
            let (ball, drift) = (&at.balls[place as usize], &self.velocities[place as usize]);
            for (x, d) in [
                (&ball.linear, &drift.linear),
                (&ball.turning, &drift.turning),
            ] {
                if x[3] > 0.0 {
                    let [vx, vy, vz, inverse] = *x;
                    let [dx, dy, dz, _] = *d;
                    slope += (vx * dx + vy * dy + vz * dz) / inverse;
                    curvature += (dx * dx + dy * dy + dz * dz) / inverse;
                }
            }
        }
        for (v, d) in at.own.iter().zip(&self.own) {
            slope += v * d;
            curvature += d * d;
        }
        let round = at.rows.len();
        let mut largest = 0.0_f64;
        let normal = |k: usize| {
            let d = &self.drifts[k];
            if k < round {
                let row = &at.rows[k];
                (dot(&row.n, &row.p), dot(&row.n, d))
            } else {
                (at.machine[k - round].p[0], d[0])
            }
        };
        for &(_, k) in cluster {
            let k = k as usize;
            let d = &self.drifts[k];
            if k < round {
                slope += dot(&at.rows[k].q, d);
            } else {
                let row = &at.machine[k - round];
                slope += dot(&row.q, d);
                for (w, (p, d)) in row.beyond.iter().zip(row.p.iter().zip(d)) {
                    slope += w * p * d;
                    curvature += w * d * d;
                }
            }
            largest = largest.max(-normal(k).1);
        }
        let wanted = -slope / curvature;
        // A NaN is no share either.
        if !(wanted > 0.0 && wanted.is_finite()) {
            return 0.0;
        }
        let normals = cluster.iter().map(|&(_, k)| normal(k as usize));
        let falling = normals.filter(|(_, d)| -d > SMALL * largest);
        let opens = falling.map(|(p, d)| p / -d).fold(LONGEST, f64::min);
        let share = wanted.min(opens);
        if share < SHORTEST { 0.0 } else { share }
    }
}
