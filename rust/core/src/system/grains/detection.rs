//! Detection: the bodies that may touch within a step, and their gaps.

use nalgebra::SVector;

use super::bodies::COORDINATES;
use super::contact::{GROUND, GrainContact, WALL};
use super::scene::embedded;
use super::search::{Neighbour, Search, Seeker, gather};
use super::struck_pairs::Struck;
use super::system::{Driven, GrainParts, GrainSystem};
use crate::contact::Activation;
use crate::problem::BodyPairs;
use crate::solver::Swept;
use crate::spatial::space::{axis, body_velocities, length};

/// Unit vector along `x`; up where there is no direction.
#[inline]
pub(super) fn direction<const D: usize>(x: &[f64; D]) -> SVector<f64, D> {
    let length = length(x);
    if length > 0.0 {
        SVector::from_fn(|k, _| x[k] / length)
    } else {
        axis(1)
    }
}

/// The first D entries.
#[inline]
fn head<const D: usize>(x: &[f64]) -> SVector<f64, D> {
    SVector::from_column_slice(&x[..D])
}

impl<const D: usize> GrainSystem<'_, D>
where
    BodyPairs<D>: Swept<D>,
{
    /// See [`crate::integrator::MechanicalSystem::detect`].
    pub(super) fn find_contacts(
        &mut self,
        v: &[f64],
        activation: Activation,
        out: &mut Vec<GrainContact<D>>,
    ) {
        out.clear();
        let (n, V) = (self.n(), body_velocities(D));
        let q = std::mem::take(&mut self.parts.middle);
        let mut found = std::mem::take(&mut self.parts.found);
        let mut grid = std::mem::take(&mut self.parts.grid);
        let scene = self.scene;
        let (radius, largest) = (scene.grains.radius(), scene.grains.largest());
        let sum = |x: &[f64]| x[1..].iter().fold(x[0].abs(), |sum, x| sum + x.abs());
        let mut fastest = v[..V * n]
            .chunks_exact(V)
            .zip(radius)
            .map(|(v, r)| sum(&v[..D]) + r * sum(&v[D..]))
            .fold(0.0, f64::max);
        let mut wheels = Vec::new();
        if let Some(machine) = scene.machine.as_deref() {
            let (own, poses) = (scene.machine_velocities(v), &self.parts.machine_poses[0]);
            #[allow(clippy::cast_possible_truncation)] // grains are numbered by u32
            for (k, a) in (0..machine.n_wheels()).zip(n as u32..) {
                let disc = machine.disc(k, poses);
                let velocity = machine.point_velocity(k, poses, &disc.centre, own);
                fastest = fastest.max(velocity.norm());
                wheels.push(Seeker {
                    a,
                    centre: embedded(&disc.centre),
                    radius: disc.radius,
                    velocity: embedded(&velocity),
                });
            }
        }
        let fastest = fastest.max(scene.fastest_surface());
        let mut rule = Search::new(&activation, [scene.grains.smallest(), largest], fastest);
        if let Some(cohesion) = scene.grains.cohesion() {
            rule.skin = rule.skin.max(cohesion.range);
            rule.reach = rule.reach.max(cohesion.range);
        }
        rule.reach = rule.reach.max(self.parts.struck.reach);
        let reach = rule.reach;
        self.parts.driven.clear();
        self.parts.search = rule;
        grid.fill(&q, radius, 2.0 * largest + reach);
        #[allow(clippy::cast_possible_truncation)] // grains are numbered by u32
        for i in 0..n as u32 {
            let k = i as usize;
            let seeker = Seeker {
                a: i,
                centre: head(&q[COORDINATES * k..]),
                radius: radius[k],
                velocity: head(&v[V * k..]),
            };
            let sleeps = self.asleep[k];
            gather(&grid, &seeker, reach, largest, Some(i), &mut found);
            let met = found
                .iter()
                .filter(|other| !(sleeps && self.asleep[other.index as usize]));
            meet_grains(&seeker, met, v, (&rule, &self.parts.struck), out);
            if !sleeps {
                self.meet_fixed(&seeker, &rule, out);
            }
        }
        for seeker in &wheels {
            gather(&grid, seeker, reach, largest, None, &mut found);
            meet_grains(seeker, found.iter(), v, (&rule, &self.parts.struck), out);
            self.meet_fixed(seeker, &rule, out);
        }
        self.parts.middle = q;
        self.parts.found = found;
        self.parts.grid = grid;
    }

    /// Adds the contacts of a round body with walls and ground.
    fn meet_fixed(&mut self, seeker: &Seeker<D>, rule: &Search, out: &mut Vec<GrainContact<D>>) {
        let GrainParts {
            facing,
            driven,
            wall_time,
            struck,
            ..
        } = &mut *self.parts;
        let is_struck = struck.has(seeker.a, WALL);
        let still = [0.0; 3];
        let mut push = |b: u32, n: SVector<f64, D>, gap: f64, motion| {
            let (velocity, spin): (SVector<f64, D>, [f64; 3]) = motion;
            let is_near = is_struck && gap <= struck.reach;
            if is_near || rule.admits(gap, n.dot(&(seeker.velocity - velocity))) {
                let contact = seeker.contact(b, n, gap);
                if velocity.iter().chain(&spin).any(|x| *x != 0.0) {
                    driven.push(Driven {
                        key: contact.key,
                        velocity,
                        spin,
                    });
                }
                out.push(contact);
            }
        };
        for (k, wall) in (WALL..).zip(&self.scene.walls) {
            let gap = wall.at(*wall_time).distance(&seeker.centre) - seeker.radius;
            if gap <= rule.reach {
                push(k, wall.n(), gap, (wall.velocity(), still));
            }
        }
        if let Some(ground) = &self.scene.ground {
            facing.clear();
            ground.facing(&seeker.centre, seeker.radius + rule.reach, facing);
            for (k, facing) in (GROUND..).zip(&*facing) {
                let gap = facing.distance - seeker.radius;
                let motion = (ground.velocity(facing), ground.spin(facing));
                push(k, facing.n, gap, motion);
            }
        }
    }

    /// Keeps the frames of the start of the step; the gap becomes the one predicted from the
    /// velocities before the step.
    pub(super) fn forecast_gaps(&self, contacts: &mut [GrainContact<D>]) {
        let n = self.n();
        let (middle, end) = (&self.parts.middle, &self.parts.end);
        let wheels: Vec<SVector<f64, D>> =
            self.scene
                .machine
                .as_ref()
                .map_or_else(Vec::new, |machine| {
                    let poses = &self.parts.machine_poses;
                    let moved = |k| {
                        let [from, to] = poses.each_ref().map(|at| machine.disc(k, at).centre);
                        embedded(&(to - from))
                    };
                    (0..machine.n_wheels()).map(moved).collect()
                });
        let moved = |body: u32| {
            let body = body as usize;
            if body < n {
                let k = COORDINATES * body;
                head::<D>(&end[k..]) - head::<D>(&middle[k..])
            } else {
                wheels.get(body - n).copied().unwrap_or_else(SVector::zeros)
            }
        };
        for contact in contacts {
            let mut motion = moved(contact.key.a);
            if contact.is_with_grain() {
                motion -= moved(contact.key.b);
            } else if let Some(surface) = self.parts.surface(contact.key) {
                motion -= surface.velocity * self.parts.search.lead;
            }
            contact.gap = contact.gap_start + contact.n.dot(&motion);
        }
    }
}

/// Adds the contacts of a round body with its neighbours.
#[inline]
fn meet_grains<'a, const D: usize>(
    seeker: &Seeker<D>,
    found: impl Iterator<Item = &'a Neighbour<D>>,
    v: &[f64],
    (rule, struck): (&Search, &Struck),
    out: &mut Vec<GrainContact<D>>,
) {
    for other in found {
        let n = direction(&other.between);
        let theirs = head::<D>(&v[body_velocities(D) * other.index as usize..]);
        let u_N = n.dot(&(seeker.velocity - theirs));
        if rule.admits(other.gap, u_N) || struck.has(seeker.a, other.index) {
            out.push(seeker.contact(other.index, n, other.gap));
        }
    }
}
