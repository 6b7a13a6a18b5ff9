//! Sleep: the step leaves out grains that rest far from anything that moves, until something comes
//! near or loads them.
//!
//! A grain falls asleep after a number of steps below a speed limit, with nothing faster than the
//! limit within a distance. It wakes when something faster comes within the distance, or when the
//! impulse of an awake neighbour differs from that at falling asleep by more than a fraction of the
//! grain's weight. Impulses of sleeping contacts are stored, so a grain wakes with its previous
//! load. A kinematic grain counts as asleep and never wakes. Where a wall or the ground moves, no
//! other grain sleeps.

use serde::{Deserialize, Serialize};

use super::bodies::COORDINATES;
use super::contact::{GrainContact, GrainKey};
use super::removal::Renumbering;
use super::scene::{GrainScene, embedded};
use crate::integrator::{OptionsError, WarmStart};
use crate::planar::PlanarDisc;
use crate::spatial::space::{body_velocities, length};
use nalgebra::{SVector, Vector2};

/// When grains sleep.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SleepOptions {
    /// A grain slower than this (rim included) is still, m/s. Default 5e-4.
    pub speed: f64,
    /// Steps that a grain must have been still. Default 50.
    pub steps: u32,
    /// How far away anything that moves must be, m. Default 0.2: six
    /// diameters of the original's disks.
    pub distance: f64,
    /// Change of an impulse that wakes a grain, as a fraction of its weight times the step. Default
    /// 0.1.
    pub share: f64,
}

impl Default for SleepOptions {
    fn default() -> Self {
        Self {
            speed: 5e-4,
            steps: 50,
            distance: 0.2,
            share: 0.1,
        }
    }
}

impl SleepOptions {
    /// Checks every range.
    ///
    /// # Errors
    /// The first option out of its range.
    pub fn check(&self) -> Result<(), OptionsError> {
        for (field, value, range, is_in) in [
            (
                "sleep_speed",
                self.speed,
                "finite and positive",
                self.speed > 0.0,
            ),
            (
                "sleep_distance",
                self.distance,
                "from 1e-3 m to 1e6 m",
                (1e-3..=1e6).contains(&self.distance),
            ),
        ] {
            if !(value.is_finite() && is_in) {
                return Err(OptionsError::OutOfRange {
                    field,
                    range,
                    value,
                });
            }
        }
        Ok(())
    }
}

/// Sleeping grains and their loads.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Sleep {
    /// Steps that each grain has been still (n).
    still: Vec<u32>,
    /// Which grains sleep (n).
    asleep: Vec<bool>,
    /// Impulses of the contacts of those that sleep, in the order of the keys, N s.
    dormant: Vec<(GrainKey, [f64; 3])>,
}

/// Most cells that a wheel marks in each direction.
const MOST_CELLS: i64 = 1000;

/// Most cells that one mover marks; beyond this all cells are marked.
const MOST_MARKS: i64 = (2 * MOST_CELLS + 1) * (2 * MOST_CELLS + 1);

/// Steps between two updates of sleep, in which nothing crosses the distance.
const EVERY: usize = 5;

/// Input of the sleep update after a step.
pub struct StepTaken<'a, const D: usize> {
    /// The description.
    pub scene: &'a GrainScene<D>,
    /// Weight of 1 kg times the step, m/s.
    pub weight_impulse: f64,
    /// Coordinates after it, m and rad.
    pub q: &'a [f64],
    /// Velocities after it; those of grains that fall asleep become 0.
    pub v: &'a mut [f64],
    /// Contacts of the step.
    pub contacts: &'a [GrainContact<D>],
    /// Impulses of the contacts (D n_c), N s.
    pub impulses: &'a [f64],
    /// How many steps have been taken.
    pub count: usize,
    /// What moves among the grains, beside the scene's machine.
    pub movers: &'a [Mover<D>],
}

/// Something that moves among grains.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mover<const D: usize> {
    /// m.
    pub centre: SVector<f64, D>,
    /// Radius of a ball about the centre that holds the mover, m.
    pub radius: f64,
    /// Speed of its fastest point, m/s.
    pub speed: f64,
}

impl<const D: usize> GrainScene<D> {
    /// The machine's wheels as bodies that keep grains awake. q (nq), v (nv).
    #[must_use]
    pub fn movers(&self, q: &[f64], v: &[f64]) -> Vec<Mover<D>> {
        let Some(machine) = &self.machine else {
            return Vec::new();
        };
        let poses = machine.poses(self.machine_coordinates(q));
        let rate = self.machine_velocities(v);
        let mover = |k: usize| {
            let PlanarDisc { centre, radius } = machine.disc(k, &poses);
            let below = centre - Vector2::y() * radius;
            let speed = |x: &Vector2<f64>| machine.point_velocity(k, &poses, x, rate).norm();
            Mover {
                centre: embedded(&centre),
                radius,
                speed: speed(&centre).max(speed(&below)),
            }
        };
        (0..machine.n_wheels()).map(mover).collect()
    }
}

impl Sleep {
    /// All grains awake that are not kinematic (n).
    #[must_use]
    pub fn new(kinematic: &[bool]) -> Self {
        Self {
            still: vec![0; kinematic.len()],
            asleep: kinematic.to_vec(),
            dormant: Vec::new(),
        }
    }

    /// Sleep and loads of the grains that stay.
    #[must_use]
    pub fn without(&self, renumbering: &Renumbering) -> Self {
        let dormant = self.dormant.iter();
        Self {
            still: renumbering.keep(&self.still, 1),
            asleep: renumbering.keep(&self.asleep, 1),
            dormant: dormant
                .filter_map(|(key, p)| Some((renumbering.key(*key)?, *p)))
                .collect(),
        }
    }

    /// After an exchange: `before` (n) has the number of each grain so far, if it was there;
    /// those that were not are awake.
    #[must_use]
    pub fn exchanged(
        &self,
        renumbering: &Renumbering,
        before: &[Option<u32>],
        was_kinematic: &[bool],
        kinematic: &[bool],
    ) -> Self {
        let mut after = Self::new(kinematic);
        for (i, old) in before.iter().enumerate() {
            let Some(old) = old.map(|old| old as usize) else {
                continue;
            };
            if !was_kinematic[old] && !kinematic[i] {
                after.still[i] = self.still[old];
                after.asleep[i] = self.asleep[old];
            }
        }
        let dormant = self.dormant.iter();
        after.dormant = dormant
            .filter_map(|(key, p)| Some((renumbering.key(*key)?, *p)))
            .collect();
        after
    }

    /// Which grains sleep (n).
    #[must_use]
    pub fn asleep(&self) -> &[bool] {
        &self.asleep
    }

    /// Impulses of the contacts of those that sleep, N s.
    #[must_use]
    pub fn dormant(&self) -> &[(GrainKey, [f64; 3])] {
        &self.dormant
    }

    /// Whether this is the sleep of these grains (n).
    #[must_use]
    pub fn is_of(&self, kinematic: &[bool]) -> bool {
        self.still.len() == kinematic.len()
            && self.asleep.len() == kinematic.len()
            && self.asleep.iter().zip(kinematic).all(|(s, k)| *s || !k)
            && self.dormant.is_sorted_by_key(|(key, _)| *key)
            && self
                .dormant
                .iter()
                .all(|(_, p)| p.iter().all(|x| x.is_finite()))
    }

    /// Wakes all that are not kinematic (n).
    pub fn wake_all(&mut self, kinematic: &[bool], warm_start: &mut WarmStart<GrainKey>) {
        if self.asleep != kinematic {
            let before = std::mem::replace(&mut self.asleep, kinematic.to_vec());
            self.exchange(kinematic, &before, warm_start);
        }
        self.still.fill(0);
    }

    /// Lets grains sleep and wake after a step.
    pub fn update<const D: usize>(
        &mut self,
        options: &SleepOptions,
        step: StepTaken<'_, D>,
        warm_start: &mut WarmStart<GrainKey>,
    ) {
        let StepTaken {
            scene,
            weight_impulse,
            q,
            v,
            contacts,
            impulses,
            count,
            movers,
        } = step;
        let (n, V) = (scene.grains.len(), body_velocities(D));
        let kinematic = scene.grains.kinematic();
        let rows = v[..V * n].chunks_exact(V).zip(scene.grains.radius());
        for ((v, r), still) in rows.zip(&mut self.still) {
            let is_still = length(&v[..D]) + r * length(&v[D..]) < options.speed;
            *still = if is_still { still.saturating_add(1) } else { 0 };
        }
        let mut woken = Vec::new();
        if self.asleep.contains(&true) {
            for (contact, p) in contacts.iter().zip(impulses.chunks_exact(D)) {
                let GrainKey { a, b } = contact.key;
                let Some(grain) = [a, b]
                    .into_iter()
                    .map(|body| body as usize)
                    .find(|&body| body < n && self.asleep[body] && !kinematic[body])
                else {
                    continue;
                };
                let place = self
                    .dormant
                    .binary_search_by_key(&contact.key, |(key, _)| *key);
                let before = place.map_or([0.0; 3], |k| self.dormant[k].1);
                let mut change = [0.0; D];
                for k in 0..D {
                    change[k] = p[k] - before[k];
                }
                if length(&change) > options.share * scene.grains.mass()[grain] * weight_impulse {
                    woken.push(grain);
                }
            }
        }
        let looks = count % EVERY == 0;
        if !looks && woken.is_empty() {
            return;
        }
        let before = self.asleep.clone();
        for grain in woken {
            self.asleep[grain] = false;
            self.still[grain] = 0;
        }
        if looks {
            let near = self.near_movers(options, scene, q, movers);
            for i in (0..n).filter(|i| !kinematic[*i]) {
                if near[i] {
                    if self.asleep[i] {
                        self.still[i] = 0;
                    }
                    self.asleep[i] = false;
                } else if self.still[i] >= options.steps {
                    self.asleep[i] = true;
                    v[V * i..V * (i + 1)].fill(0.0);
                }
            }
        }
        if self.asleep != before {
            self.exchange(kinematic, &before, warm_start);
        }
    }

    /// For each grain whether something that moves may be within the distance (n).
    fn near_movers<const D: usize>(
        &self,
        options: &SleepOptions,
        scene: &GrainScene<D>,
        q: &[f64],
        movers: &[Mover<D>],
    ) -> Vec<bool> {
        let n = scene.grains.len();
        if scene.fastest_surface() > 0.0 {
            return vec![true; n];
        }
        let mut marks = Marks::<D>::new(n, options.distance);
        let centre = |i: usize| SVector::from_fn(|k, _| q[COORDINATES * i + k]);
        for i in (0..n).filter(|i| self.still[*i] == 0) {
            marks.mark(&centre(i), 1);
        }
        for mover in movers.iter().filter(|m| m.speed >= options.speed) {
            let cells = 1 + marks.cell(mover.radius + options.distance);
            marks.mark(&mover.centre, cells.min(MOST_CELLS));
        }
        (0..n).map(|i| marks.is_marked(&centre(i))).collect()
    }

    /// After a change of sleep: stores the loads of grains that fell asleep, and returns those of
    /// woken grains to the warm start.
    fn exchange(
        &mut self,
        kinematic: &[bool],
        before: &[bool],
        warm_start: &mut WarmStart<GrainKey>,
    ) {
        let touches = |asleep: &[bool], key: &GrainKey| {
            let sleeps = |body: u32| {
                let body = body as usize;
                body < kinematic.len() && asleep[body] && !kinematic[body]
            };
            sleeps(key.a) || sleeps(key.b)
        };
        // The impulses of this step are newer than the stored ones, but the load that decides about
        // waking stays that of falling asleep.
        let mut all: Vec<(GrainKey, [f64; 3], bool)> = Vec::new();
        all.extend(warm_start.impulses.iter().map(|(k, p)| (*k, *p, false)));
        all.extend(self.dormant.iter().map(|(k, p)| (*k, *p, true)));
        all.sort_by_key(|(key, _, is_dormant)| (*key, *is_dormant));
        warm_start.impulses.clear();
        warm_start.persistent.clear();
        self.dormant.clear();
        for group in all.chunk_by(|a, b| a.0 == b.0) {
            let (key, latest, _) = group[0];
            warm_start.impulses.push((key, latest));
            if touches(&self.asleep, &key) {
                let old = group.iter().find(|g| g.2 && touches(before, &key));
                self.dormant.push((key, old.map_or(latest, |g| g.1)));
            }
        }
    }
}

/// Cells of the side `distance`, folded into a table: a mover marks its own and those around it.
struct Marks<const D: usize> {
    distance: f64,
    marked: Vec<bool>,
}

impl<const D: usize> Marks<D> {
    fn new(n: usize, distance: f64) -> Self {
        Self {
            distance,
            marked: vec![false; (4 * n).next_power_of_two().max(64)],
        }
    }

    fn cell(&self, x: f64) -> i64 {
        #[allow(clippy::cast_possible_truncation)] // saturates, and folds
        let cell = (x / self.distance).floor() as i64;
        cell
    }

    fn place(&self, cell: &[i64; D]) -> usize {
        let mask = i64::try_from(self.marked.len()).unwrap_or(i64::MAX) - 1;
        let mixed = cell.iter().rev().fold(0_i64, |mixed, cell| {
            mixed.wrapping_mul(0x9E37_79B1).wrapping_add(*cell)
        });
        usize::try_from(mixed & mask).unwrap_or(0)
    }

    fn cell_of(&self, x: &SVector<f64, D>) -> [i64; D] {
        std::array::from_fn(|k| self.cell(x[k]))
    }

    /// Marks the cell of `x` and those up to `cells` away along each axis.
    fn mark(&mut self, x: &SVector<f64, D>, cells: i64) {
        let side = 2 * cells + 1;
        let count = (1..D).fold(side, |count, _| count.saturating_mul(side));
        if count > MOST_MARKS {
            self.marked.fill(true);
            return;
        }
        let middle = self.cell_of(x);
        for number in 0..count {
            let (mut cell, mut rest) = (middle, number);
            for cell in &mut cell {
                *cell = cell.wrapping_add(rest % side - cells);
                rest /= side;
            }
            let place = self.place(&cell);
            self.marked[place] = true;
        }
    }

    fn is_marked(&self, x: &SVector<f64, D>) -> bool {
        self.marked[self.place(&self.cell_of(x))]
    }
}
