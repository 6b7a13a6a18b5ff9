//! The sweeps of [`super::body_sweeps`] over thousands of balls, in blocks.
//!
//! The balls stand in slabs ([`BodyPairs::slabs`]), each next to its neighbours in memory. A slab's
//! block of contacts are those among its own balls and with the next slab's. Blocks of even slabs
//! share no ball, nor do those of odd ones: a sweep visits all even blocks at the same time and
//! then all odd ones, on as many threads as there are. Contacts that reach farther, and those of
//! the machine, follow one by one. The order within a block, and so every bit of the answer,
//! depends on the slabs alone and not on the threads.
//!
//! A contact whose impulse has stopped changing rests for some sweeps. Its part of the extrapolated
//! velocities is taken back when it comes to rest, so that velocities and impulses still belong
//! together.
//!
//! Threads are those of the pool that the caller runs in; outside a pool there is one. In a problem
//! that is hard the impulses are extrapolated along their drift ([`super::ball_extrapolation`]).

#![allow(clippy::inline_always)] // a visit is one piece of code

use super::accelerated::{Relaxation, SolutionQuality};
use super::ball_extrapolation::{Anchor, DriftTarget};
use super::ball_rows::{
    BallRollRow, BallRow, BallVelocity, Judged, MachineBallRow, mass_of, to_frame,
};
use crate::cone::draw_in;
use crate::law::coulomb::violation;
use crate::problem::{BodyPairs, Magnitudes, RollingContact, ViolationSums};
use crate::solver::options::SolverOptions;
use crate::space::{body_velocities, dot};

/// Places of a block's list that are visited in turn, so that a contact need not wait for the
/// results of the one before it.
const PLACES: usize = 4;

/// Rows below which a part of a sweep is not worth another thread.
const FEW: usize = 400;

/// Most sweeps that a contact rests.
const LONGEST_REST: u8 = 7;

/// Change of an impulse below which a contact rests, as a fraction of the change that its share of
/// the tolerance allows. A hundred times less makes no difference to the number of visits.
const QUIET: f64 = 0.1;

/// Sweeps that a contact still rests, and rested last.
#[derive(Clone, Copy, Debug, Default)]
struct Rest {
    left: u8,
    length: u8,
    is_new: bool,
}

impl Rest {
    /// Visits a contact unless it rests; the square of its change.
    #[inline(always)]
    fn visit(
        &mut self,
        row: &mut BallRow,
        roll: Option<&mut BallRollRow>,
        (share, quiet): (f64, f64),
        balls: &mut [BallVelocity],
    ) -> f64 {
        if self.left > 0 {
            self.left -= 1;
            if self.is_new {
                self.is_new = false;
                row.take_back(share, balls);
                if let Some(roll) = roll {
                    roll.take_back(row, share, balls);
                }
            }
            return 0.0;
        }
        let mut change = row.visit(share, balls);
        if let Some(roll) = roll {
            change += roll.visit(row, share, balls);
        }
        if change <= quiet {
            self.length = (2 * self.length + 1).min(LONGEST_REST);
            self.left = self.length;
            self.is_new = true;
        } else {
            self.length = 0;
        }
        change
    }
}

/// Rows of contacts side by side, and what belongs to each.
struct Part<'a> {
    rows: &'a mut [BallRow],
    rests: &'a mut [Rest],
    /// None where no contact bears a moment.
    rolls: &'a mut [BallRollRow],
}

impl Part<'_> {
    /// The first `count`, and the others.
    fn split(self, count: usize) -> (Self, Self) {
        let (rows, more_rows) = self.rows.split_at_mut(count);
        let (rests, more_rests) = self.rests.split_at_mut(count);
        let (rolls, more_rolls) = self.rolls.split_at_mut(count.min(self.rolls.len()));
        let first = Self { rows, rests, rolls };
        let others = Self {
            rows: more_rows,
            rests: more_rests,
            rolls: more_rolls,
        };
        (first, others)
    }

    /// Each row with the one that rolls.
    fn rolling(&mut self) -> impl Iterator<Item = (&mut BallRow, &mut BallRollRow)> {
        self.rows.iter_mut().zip(&mut *self.rolls)
    }
}

/// Scratch.
#[derive(Clone, Debug, Default)]
pub(super) struct BallSweeps {
    rows: Vec<BallRow>,
    rests: Vec<Rest>,
    /// Rolling friction of each row; none where no contact has any.
    rolls: Vec<BallRollRow>,
    /// Square of a change below which a contact rests, N² s².
    quiet: f64,
    /// Number of each row's contact.
    order: Vec<u32>,
    machine: Vec<MachineBallRow>,
    /// Slab by slab; the first of each is fixed and stands for everything that is.
    balls: Vec<BallVelocity>,
    before: Vec<BallVelocity>,
    /// Where each slab's balls begin.
    slabs: Vec<usize>,
    /// Where each block's rows begin, then those that reach farther than to the next slab.
    blocks: Vec<usize>,
    /// Place of each body.
    places: Vec<u32>,
    /// The contacts block by block.
    sorted: Vec<u32>,
    next: Vec<usize>,
    /// Velocity of the machine due to the impulses, in its factor coordinates.
    own: Vec<f64>,
    own_before: Vec<f64>,
    data: Magnitudes,
    anchor: Anchor,
    is_parallel: bool,
}

/// A solve under way.
pub(super) struct BallSolve<'a> {
    pub sweeps: &'a mut BallSweeps,
    pub pairs: &'a BodyPairs<3>,
}

/// Sums of a measurement.
#[derive(Clone, Copy, Default)]
struct Sums {
    violations: ViolationSums,
    work: f64,
    free: f64,
}

impl Sums {
    fn add(&mut self, judged: &Judged) {
        self.violations.add(judged.square, judged.mass);
        self.work += judged.work;
        self.free += judged.free;
    }

    fn plus(mut self, other: Self) -> Self {
        self.violations.join(&other.violations);
        self.work += other.work;
        self.free += other.free;
        self
    }
}

/// Both, at the same time if that is worth it.
fn both<A: Send, B: Send>(
    is_parallel: bool,
    a: impl FnOnce() -> A + Send,
    b: impl FnOnce() -> B + Send,
) -> (A, B) {
    if is_parallel {
        rayon::join(a, b)
    } else {
        (a(), b())
    }
}

/// Where slabs and blocks begin.
#[derive(Clone, Copy)]
struct Layout<'a> {
    slabs: &'a [usize],
    blocks: &'a [usize],
    is_parallel: bool,
}

impl Layout<'_> {
    /// Visits the blocks `parity + 2 k` for k in `range`; the sum of what they return, in an order
    /// that does not depend on threads. `rows` and `balls` begin with those of the first.
    fn each<T: Send>(
        self,
        parity: usize,
        range: std::ops::Range<usize>,
        rows: Part<'_>,
        balls: &mut [BallVelocity],
        visit: &(impl Fn(Part<'_>, &mut [BallVelocity]) -> T + Sync),
        plus: &(impl Fn(T, T) -> T + Sync),
    ) -> T {
        let first = parity + 2 * range.start;
        if range.len() == 1 {
            let count = self.blocks[first + 1] - self.blocks[first];
            return visit(rows.split(count).0, balls);
        }
        let middle = range.start + range.len() / 2;
        let second = parity + 2 * middle;
        let is_worth_it = self.is_parallel && rows.rows.len() >= FEW;
        let (left, right) = rows.split(self.blocks[second] - self.blocks[first]);
        let (near, far) = balls.split_at_mut(self.slabs[second] - self.slabs[first]);
        let (left, right) = both(
            is_worth_it,
            || self.each(parity, range.start..middle, left, near, visit, plus),
            || self.each(parity, middle..range.end, right, far, visit, plus),
        );
        plus(left, right)
    }
}

impl BallSweeps {
    /// Takes over a problem with its start.
    pub(super) fn fit(
        &mut self,
        pairs: &BodyPairs<3>,
        (q, mu, p): (&[f64], &[f64], &[f64]),
        rolling: &[RollingContact],
        options: &SolverOptions,
    ) {
        self.is_parallel =
            rayon::current_thread_index().is_some() && rayon::current_num_threads() > 1;
        let (q, p) = (q.as_chunks::<3>().0, p.as_chunks::<3>().0);
        self.place_balls(pairs);
        self.place_rows(pairs, q, mu, p);
        let round = pairs.round.len();
        self.rolls.clear();
        if !rolling.is_empty() {
            self.rolls
                .extend(self.order.iter().zip(&self.rows).map(|(&i, row)| {
                    let i = i as usize;
                    let mut roll = BallRollRow::new(&rolling[i], &pairs.round[i]);
                    roll.s = roll.admissible(row, &roll.s);
                    roll.before = roll.s;
                    roll
                }));
        }
        self.machine.clear();
        let machine = pairs.machine.iter().enumerate();
        let places = &self.places;
        self.machine.extend(machine.map(|(k, pair)| {
            let i = round + k;
            let ball = if pair.linear[1] > 0.0 {
                places[pair.bodies[1] as usize / body_velocities(3)]
            } else {
                0
            };
            MachineBallRow::new(pairs, k, ball, &q[i], mu[i], &p[i])
        }));
        self.data = Magnitudes::default();
        let (mut lightest, mut sum) = (f64::INFINITY, 0.0);
        for row in &self.rows {
            let mass = mass_of(row.inverse);
            self.data.add(&row.q, mass);
            sum += mass * mass * dot(&row.q, &row.q);
            lightest = lightest.min(mass);
        }
        let each = options.tolerance.powi(2) * sum / round.max(1) as f64;
        let most = (options.velocity_tolerance * lightest).powi(2);
        self.quiet = QUIET * QUIET * each.min(most);
        self.rests.clear();
        self.rests.resize(round, Rest::default());
        for row in &self.machine {
            self.data.add(&row.q, mass_of(row.inverse()));
        }
        self.own.clear();
        self.own.resize(pairs.width, 0.0);
        self.sum(pairs);
        self.before.clone_from(&self.balls);
        self.own_before.clone_from(&self.own);
    }

    /// Places the balls slab by slab.
    fn place_balls(&mut self, pairs: &BodyPairs<3>) {
        let V = body_velocities(3);
        let n = pairs.n_coordinates / V;
        let slab = |body: usize| pairs.slabs.get(body).map_or(0, |slab| *slab as usize);
        let n_slabs = 1 + (0..pairs.slabs.len().min(n)).map(slab).max().unwrap_or(0);
        self.slabs.clear();
        self.slabs.resize(n_slabs + 1, 0);
        for body in 0..n {
            self.slabs[slab(body) + 1] += 1;
        }
        for k in 0..n_slabs {
            // One more for what is fixed.
            self.slabs[k + 1] += self.slabs[k] + 1;
        }
        self.balls.clear();
        self.balls
            .resize(self.slabs[n_slabs], BallVelocity::default());
        self.next.clear();
        let firsts = self.slabs[..n_slabs].iter();
        self.next.extend(firsts.map(|first| first + 1));
        self.places.clear();
        for body in 0..n {
            let next = &mut self.next[slab(body)];
            #[allow(clippy::cast_possible_truncation)] // bodies are numbered by u32
            self.places.push(*next as u32);
            *next += 1;
        }
        for pair in pairs.round.iter().chain(&pairs.machine) {
            for side in 0..2 {
                if pair.linear[side] > 0.0 {
                    let place = self.places[pair.bodies[side] as usize / V];
                    let ball = &mut self.balls[place as usize];
                    ball.linear[3] = pair.linear[side].powi(2);
                    ball.turning[3] = pair.angular[side].powi(2);
                }
            }
        }
    }

    /// Lists the contacts block by block.
    fn place_rows(&mut self, pairs: &BodyPairs<3>, q: &[[f64; 3]], mu: &[f64], p: &[[f64; 3]]) {
        let V = body_velocities(3);
        let n_slabs = self.slabs.len() - 1;
        let slab = |body: u32| {
            let slab = pairs.slabs.get(body as usize / V);
            slab.map_or(0, |slab| *slab as usize)
        };
        // The block of a contact; the last for those that reach farther.
        let block = |i: usize| {
            let pair = &pairs.round[i];
            let [a, b] = pair.bodies.map(slab);
            match pair.linear.map(|c| c > 0.0) {
                [true, true] if a.abs_diff(b) <= 1 => a.min(b),
                [true, true] => n_slabs,
                [true, false] => a,
                [false, true] => b,
                [false, false] => 0,
            }
        };
        let round = pairs.round.len();
        self.blocks.clear();
        self.blocks.resize(n_slabs + 2, 0);
        for i in 0..round {
            self.blocks[block(i) + 1] += 1;
        }
        for k in 0..=n_slabs {
            self.blocks[k + 1] += self.blocks[k];
        }
        self.sorted.resize(round, 0);
        self.next.clear();
        self.next.extend_from_slice(&self.blocks);
        for i in 0..round {
            let next = &mut self.next[block(i)];
            #[allow(clippy::cast_possible_truncation)] // contacts are numbered by u32
            {
                self.sorted[*next] = i as u32;
            }
            *next += 1;
        }
        self.order.clear();
        for ends in self.blocks.windows(2) {
            let block = &self.sorted[ends[0]..ends[1]];
            let length = block.len().div_ceil(PLACES);
            for k in 0..length {
                self.order.extend(block[k..].iter().step_by(length));
            }
        }
        self.rows.clear();
        let mut at = 0;
        let (places, blocks, slabs) = (&self.places, &self.blocks, &self.slabs);
        self.rows
            .extend(self.order.iter().enumerate().map(|(k, &i)| {
                while k >= blocks[at + 1] {
                    at += 1;
                }
                let first = if at < n_slabs { slabs[at] } else { 0 };
                let i = i as usize;
                let pair = &pairs.round[i];
                let place = |side: usize| {
                    if pair.linear[side] > 0.0 {
                        let place = places[pair.bodies[side] as usize / V] as usize;
                        #[allow(clippy::cast_possible_truncation)]
                        {
                            (place - first) as u32
                        }
                    } else {
                        0
                    }
                };
                BallRow::new(pair, [place(0), place(1)], &q[i], mu[i], &p[i])
            }));
    }

    /// Visits all contacts but the machine's: the sum of what they return.
    fn each<T: Send + Default>(
        &mut self,
        visit: impl Fn(Part<'_>, &mut [BallVelocity]) -> T + Sync,
        plus: impl Fn(T, T) -> T + Sync,
    ) -> T {
        let n_slabs = self.slabs.len() - 1;
        let layout = Layout {
            slabs: &self.slabs,
            blocks: &self.blocks,
            is_parallel: self.is_parallel,
        };
        let mut sum = T::default();
        for parity in 0..n_slabs.min(2) {
            let count = (n_slabs - parity).div_ceil(2);
            let first = self.blocks[parity];
            let (near, _) = all_rows(&mut self.rows, &mut self.rests, &mut self.rolls)
                .split(self.blocks[n_slabs]);
            let (_, rows) = near.split(first);
            let balls = &mut self.balls[self.slabs[parity]..];
            let found = layout.each(parity, 0..count, rows, balls, &visit, &plus);
            sum = plus(sum, found);
        }
        let (_, far) =
            all_rows(&mut self.rows, &mut self.rests, &mut self.rolls).split(self.blocks[n_slabs]);
        if !far.rows.is_empty() {
            sum = plus(sum, visit(far, &mut self.balls));
        }
        sum
    }

    /// Recomputes the velocities from the impulses.
    fn sum(&mut self, pairs: &BodyPairs<3>) {
        for ball in &mut self.balls {
            ball.linear[..3].fill(0.0);
            ball.turning[..3].fill(0.0);
        }
        self.own.fill(0.0);
        let add = |mut rows: Part<'_>, balls: &mut [BallVelocity]| {
            for row in &*rows.rows {
                row.add(&row.p, balls);
            }
            for (row, roll) in rows.rolling() {
                roll.add(&roll.s, row, balls);
            }
        };
        self.each(add, |(), ()| ());
        for (i, row) in self.machine.iter().enumerate() {
            row.add(pairs, i, &row.p, &mut self.balls, &mut self.own);
        }
    }

    /// Extrapolates the velocities, and remembers them.
    fn extrapolate(&mut self, share: f64) {
        let is_parallel = self.is_parallel;
        extrapolate(&mut self.balls, &mut self.before, share, is_parallel);
        for (v, before) in self.own.iter_mut().zip(&mut self.own_before) {
            let now = *v;
            *v += share * (now - *before);
            *before = now;
        }
    }

    /// Writes impulses and velocities in the contacts' frames.
    pub(super) fn write(
        &self,
        pairs: &BodyPairs<3>,
        (p, u): (&mut [f64], &mut [f64]),
        rolling: &mut [RollingContact],
    ) {
        let (p, u) = (p.as_chunks_mut::<3>().0, u.as_chunks_mut::<3>().0);
        let n_slabs = self.slabs.len() - 1;
        for block in 0..=n_slabs {
            let first = if block < n_slabs {
                self.slabs[block]
            } else {
                0
            };
            for k in self.blocks[block]..self.blocks[block + 1] {
                let (row, i) = (&self.rows[k], self.order[k] as usize);
                let frame = &pairs.round[i].frame;
                p[i] = to_frame(frame, &row.p);
                // Rounding may leave the cone.
                p[i][0] = p[i][0].max(0.0);
                let limit = row.mu * p[i][0];
                draw_in(&mut p[i], limit);
                u[i] = to_frame(frame, &row.velocity(&self.balls[first..]));
            }
        }
        for ((roll, row), &i) in self.rolls.iter().zip(&self.rows).zip(&self.order) {
            rolling[i as usize].impulse = roll.admissible(row, &roll.s);
        }
        for (k, row) in self.machine.iter().enumerate() {
            let i = pairs.round.len() + k;
            p[i] = row.p;
            u[i] = row.velocity(pairs, (k, &row.p), &self.balls, &self.own);
        }
    }
}

/// All rows of the contacts but the machine's.
fn all_rows<'a>(
    rows: &'a mut [BallRow],
    rests: &'a mut [Rest],
    rolls: &'a mut [BallRollRow],
) -> Part<'a> {
    Part { rows, rests, rolls }
}

/// See [`BallSweeps::extrapolate`].
fn extrapolate(
    balls: &mut [BallVelocity],
    before: &mut [BallVelocity],
    share: f64,
    is_parallel: bool,
) {
    if is_parallel && balls.len() > FEW {
        let middle = balls.len() / 2;
        let (left, right) = balls.split_at_mut(middle);
        let (old_left, old_right) = before.split_at_mut(middle);
        both(
            true,
            || extrapolate(left, old_left, share, true),
            || extrapolate(right, old_right, share, true),
        );
        return;
    }
    for (ball, before) in balls.iter_mut().zip(before) {
        let now = *ball;
        for k in 0..3 {
            ball.linear[k] += share * (now.linear[k] - before.linear[k]);
            ball.turning[k] += share * (now.turning[k] - before.turning[k]);
        }
        *before = now;
    }
}

impl Relaxation for BallSolve<'_> {
    /// Beds in flow take 5 to 30% fewer sweeps than with a new start; with 0.7 slow flow takes
    /// more, with 0.85 some solves never end.
    const KEPT: f64 = 0.5;
    const PATIENCE: usize = 20;

    fn sweep(&mut self, share: f64, is_hard: bool) -> f64 {
        self.sweeps.extrapolate(share);
        // No change is below that.
        let quiet = if is_hard { -1.0 } else { self.sweeps.quiet };
        let shares = (share, quiet);
        let visit = |rows: Part<'_>, balls: &mut [BallVelocity]| {
            let Part { rows, rests, rolls } = rows;
            let mut change = 0.0;
            let both = rows.iter_mut().zip(rests);
            if rolls.is_empty() {
                for (row, rest) in both {
                    change += rest.visit(row, None, shares, balls);
                }
            } else {
                for ((row, rest), roll) in both.zip(rolls) {
                    change += rest.visit(row, Some(roll), shares, balls);
                }
            }
            change
        };
        let mut change = self.sweeps.each(visit, |a, b| a + b);
        let BallSweeps {
            machine,
            balls,
            own,
            ..
        } = &mut *self.sweeps;
        for (i, row) in machine.iter_mut().enumerate() {
            change += row.visit(self.pairs, i, share, balls, own);
        }
        change
    }

    fn measure(&mut self) -> SolutionQuality {
        self.sweeps.sum(self.pairs);
        let judge = |mut rows: Part<'_>, balls: &mut [BallVelocity]| {
            let mut sums = Sums::default();
            for row in &*rows.rows {
                sums.add(&row.judge(balls));
            }
            for (row, roll) in rows.rolling() {
                sums.add(&roll.judge(row, balls));
            }
            sums
        };
        let mut sums = self.sweeps.each(judge, Sums::plus);
        for (i, row) in self.sweeps.machine.iter().enumerate() {
            let (balls, own) = (&self.sweeps.balls, &self.sweeps.own);
            let u = row.velocity(self.pairs, (i, &row.p), balls, own);
            let inverse = row.inverse();
            let mass = mass_of(inverse);
            let scales = inverse.map(|i| if i > 0.0 { i } else { mass });
            let off = violation(&row.p, &u, row.mu, scales);
            sums.violations.add(dot(&off, &off), mass);
            sums.work += dot(&row.p, &u);
            sums.free += dot(&row.p, &row.q);
        }
        let [inverse_speed, inverse_data] = self.sweeps.data.inverses();
        SolutionQuality {
            residual: sums.violations.residual(inverse_speed, inverse_data),
            work: sums.work,
            free: sums.free,
        }
    }

    fn anchor(&mut self) {
        let BallSweeps {
            rows,
            machine,
            anchor,
            ..
        } = &mut *self.sweeps;
        anchor.set(rows, machine);
    }

    fn extrapolate_drift(&mut self) -> bool {
        let BallSweeps {
            rows,
            rolls,
            machine,
            balls,
            own,
            slabs,
            blocks,
            anchor,
            before,
            own_before,
            ..
        } = &mut *self.sweeps;
        let has_moved = anchor.extrapolate(&mut DriftTarget {
            pairs: self.pairs,
            rows,
            machine,
            balls,
            own,
            slabs,
            blocks,
        });
        if has_moved {
            // The next sweep extrapolates nothing.
            for row in rows {
                row.before = row.p;
            }
            for roll in rolls {
                roll.before = roll.s;
            }
            for row in machine {
                row.before = row.p;
            }
            before.clone_from(balls);
            own_before.clone_from(own);
        }
        has_moved
    }

    fn scale(&mut self, share: f64) {
        for row in &mut self.sweeps.rows {
            row.p = row.p.map(|p| share * p);
        }
        for roll in &mut self.sweeps.rolls {
            roll.s = roll.s.map(|s| share * s);
        }
        self.sweeps.rests.fill(Rest::default());
        for row in &mut self.sweeps.machine {
            row.p = row.p.map(|p| share * p);
        }
    }
}
