//! Sleep: disks that rest far from anything that moves are left out of the step until something comes near or leans on them.
//!
//! A disk falls asleep after so many steps slower than a limit, with nothing faster than the limit within a distance. It wakes when something
//! faster comes within the distance, or when the impulse of a neighbour that is awake differs from the one it fell asleep under by more than a share of its own
//! weight. The impulses of sleeping contacts are kept, so a disk wakes with the load that it had. A kinematic disk counts as
//! asleep and never wakes.

use serde::{Deserialize, Serialize};

use super::contact::{SoilContact, SoilKey};
use super::removal::Renumbering;
use super::scene::SoilScene;
use crate::integrator::{OptionsError, WarmStart};

/// When disks sleep.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SleepOptions {
    /// A disk slower than this (rim included) is still, m/s. Default 5e-4.
    pub speed: f64,
    /// Steps that a disk must have been still. Default 50.
    pub steps: u32,
    /// How far away anything that moves must be, m. Default 0.2: six diameters of the original's disks.
    pub distance: f64,
    /// Change of an impulse that wakes, as a share of the disk's weight times the step. Default 0.1.
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

/// Who sleeps, and under what load.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Sleep {
    /// Steps that each disk has been still (n).
    still: Vec<u32>,
    /// Which disks sleep (n).
    asleep: Vec<bool>,
    /// Impulses of the contacts of those that sleep, in the order of the keys, N s.
    dormant: Vec<(SoilKey, [f64; 3])>,
}

/// Most cells that a wheel marks either way.
const MOST_CELLS: i64 = 1000;

/// Steps between two looks at who may sleep: nothing crosses the distance in them.
const EVERY: usize = 5;

/// What sleep looks at after a step.
pub(crate) struct StepTaken<'a> {
    pub scene: &'a SoilScene,
    pub weight_impulse: f64,
    pub q: &'a [f64],
    pub v: &'a mut [f64],
    pub contacts: &'a [SoilContact],
    pub impulses: &'a [f64],
    pub count: usize,
}

impl Sleep {
    /// All disks awake that are not kinematic (n).
    pub(crate) fn new(kinematic: &[bool]) -> Self {
        Self {
            still: vec![0; kinematic.len()],
            asleep: kinematic.to_vec(),
            dormant: Vec::new(),
        }
    }

    /// Of the disks that stay.
    pub(crate) fn without(&self, renumbering: &Renumbering) -> Self {
        let dormant = self.dormant.iter();
        Self {
            still: renumbering.keep(&self.still, 1),
            asleep: renumbering.keep(&self.asleep, 1),
            dormant: dormant
                .filter_map(|(key, p)| Some((renumbering.key(*key)?, *p)))
                .collect(),
        }
    }

    /// Which disks sleep (n).
    #[must_use]
    pub fn asleep(&self) -> &[bool] {
        &self.asleep
    }

    /// Impulses of the contacts of those that sleep, N s.
    #[must_use]
    pub fn dormant(&self) -> &[(SoilKey, [f64; 3])] {
        &self.dormant
    }

    /// Whether this is the sleep of these disks (n).
    pub(crate) fn is_of(&self, kinematic: &[bool]) -> bool {
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
    pub(crate) fn wake_all(&mut self, kinematic: &[bool], warm_start: &mut WarmStart<SoilKey>) {
        if self.asleep != kinematic {
            let before = std::mem::replace(&mut self.asleep, kinematic.to_vec());
            self.exchange(kinematic, &before, warm_start);
        }
        self.still.fill(0);
    }

    /// Lets disks sleep and wake after a step.
    pub(crate) fn update(
        &mut self,
        options: &SleepOptions,
        step: StepTaken<'_>,
        warm_start: &mut WarmStart<SoilKey>,
    ) {
        let StepTaken {
            scene,
            weight_impulse,
            q,
            v,
            contacts,
            impulses,
            count,
        } = step;
        let n = scene.disks.len();
        let kinematic = scene.disks.kinematic();
        let rows = v[..3 * n].chunks_exact(3).zip(scene.disks.radius());
        for ((v, r), still) in rows.zip(&mut self.still) {
            let is_still = v[0].hypot(v[1]) + r * v[2].abs() < options.speed;
            *still = if is_still { still.saturating_add(1) } else { 0 };
        }
        let mut woken = Vec::new();
        if self.asleep.contains(&true) {
            for (contact, p) in contacts.iter().zip(impulses.chunks_exact(2)) {
                let SoilKey { a, b } = contact.key;
                let Some(disk) = [a, b]
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
                let change = (p[0] - before[0]).hypot(p[1] - before[1]);
                if change > options.share * scene.disks.mass()[disk] * weight_impulse {
                    woken.push(disk);
                }
            }
        }
        let looks = count % EVERY == 0;
        if !looks && woken.is_empty() {
            return;
        }
        let before = self.asleep.clone();
        for disk in woken {
            self.asleep[disk] = false;
            self.still[disk] = 0;
        }
        if looks {
            let near = self.near_movers(options, scene, q, v);
            for i in (0..n).filter(|i| !kinematic[*i]) {
                if near[i] {
                    if self.asleep[i] {
                        self.still[i] = 0;
                    }
                    self.asleep[i] = false;
                } else if self.still[i] >= options.steps {
                    self.asleep[i] = true;
                    v[3 * i..3 * i + 3].fill(0.0);
                }
            }
        }
        if self.asleep != before {
            self.exchange(kinematic, &before, warm_start);
        }
    }

    /// For each disk whether something that moves may be within the distance (n).
    fn near_movers(
        &self,
        options: &SleepOptions,
        scene: &SoilScene,
        q: &[f64],
        v: &[f64],
    ) -> Vec<bool> {
        let n = scene.disks.len();
        // Cells of that side, folded into a table: a mover marks its cell and the eight around it.
        let size = (4 * n).next_power_of_two().max(64);
        let mask = i64::try_from(size).unwrap_or(i64::MAX) - 1;
        let cell = |x: f64| {
            #[allow(clippy::cast_possible_truncation)] // saturates, and folds
            let cell = (x / options.distance).floor() as i64;
            cell
        };
        let place = |column: i64, row: i64| {
            let mixed = row.wrapping_mul(0x9E37_79B1).wrapping_add(column);
            usize::try_from(mixed & mask).unwrap_or(0)
        };
        let mut marked = vec![false; size];
        let mut mark = |x: f64, y: f64, cells: i64| {
            for row in -cells..=cells {
                for column in -cells..=cells {
                    marked[place(cell(x).wrapping_add(column), cell(y).wrapping_add(row))] = true;
                }
            }
        };
        for i in 0..n {
            if self.still[i] == 0 {
                mark(q[3 * i], q[3 * i + 1], 1);
            }
        }
        if let Some(machine) = &scene.machine {
            let pose = nalgebra::SVector::<f64, 5>::from_column_slice(&q[3 * n..]);
            let rate = nalgebra::SVector::<f64, 5>::from_column_slice(&v[3 * n..]);
            for k in 0..machine.n_discs() {
                let disc = machine.disc(k, &pose);
                let below = disc.centre - nalgebra::Vector2::y() * disc.radius;
                let speed = (machine.point_jacobian(k, &pose, &disc.centre) * rate).norm();
                let turning = (machine.point_jacobian(k, &pose, &below) * rate).norm();
                if speed.max(turning) >= options.speed {
                    let cells = 1 + cell(disc.radius + options.distance);
                    mark(disc.centre.x, disc.centre.y, cells.min(MOST_CELLS));
                }
            }
        }
        (0..n)
            .map(|i| marked[place(cell(q[3 * i]), cell(q[3 * i + 1]))])
            .collect()
    }

    /// After a change of who sleeps: loads of those that fell asleep are put away, those of the woken given back to the warm start.
    fn exchange(
        &mut self,
        kinematic: &[bool],
        before: &[bool],
        warm_start: &mut WarmStart<SoilKey>,
    ) {
        let touches = |asleep: &[bool], key: &SoilKey| {
            let sleeps = |body: u32| {
                let body = body as usize;
                body < kinematic.len() && asleep[body] && !kinematic[body]
            };
            sleeps(key.a) || sleeps(key.b)
        };
        // What the step just did is newer than what was put away, but the load to wake at stays the one of falling asleep.
        let mut all: Vec<(SoilKey, [f64; 3], bool)> = Vec::new();
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
