//! Rolling and drilling friction of a bed's contacts: what a step tells the solver of them, and
//! what it remembers.
//!
//! The law ([`crate::law::rolling`]) holds between two grains, and between a grain and a wall or
//! the ground. The wheels of a machine have none, nor has a contact without Coulomb friction.

use super::contact::{GrainContact, GrainKey, WALL};
use super::scene::GrainScene;
use crate::law::rolling::RollingFriction;
use crate::problem::{RollingContact, RoundPair};
use crate::spatial::space::body_velocities;

/// Moments of the last step, from which the next solve starts: (key, M/ℓ in N s along the world's
/// axes), in the order of the keys.
pub type Moments = Vec<(GrainKey, [f64; 3])>;

/// Scratch of a step.
#[derive(Debug, Default)]
pub struct RollingParts {
    /// One for each contact of two grains, or of a grain with what is fixed; none without rolling
    /// friction.
    pub(super) contacts: Vec<RollingContact>,
    keys: Vec<GrainKey>,
}

/// Angular velocity among a body's velocities, rad/s: about the viewer's axis in the plane.
fn spin<const D: usize>(v: &[f64]) -> [f64; 3] {
    match D {
        2 => [0.0, 0.0, v[2]],
        _ => [v[3], v[4], v[5]],
    }
}

/// Rolling radius of a contact over the radius of each grain; 0 for what is no grain.
fn levers(radius: &[f64], key: GrainKey) -> [f64; 2] {
    if key.b >= WALL {
        return [1.0, 0.0];
    }
    let (r_a, r_b) = (radius[key.a as usize], radius[key.b as usize]);
    [r_b / (r_a + r_b), r_a / (r_a + r_b)]
}

/// Moment of a contact on its first body, N m s: zero where none is remembered.
#[must_use]
pub fn moment_of(radius: &[f64], moments: &Moments, key: GrainKey) -> [f64; 3] {
    let place = moments.binary_search_by_key(&key, |(key, _)| *key);
    let Ok(place) = place else {
        return [0.0; 3];
    };
    let lever = levers(radius, key)[0] * radius[key.a as usize];
    moments[place].1.map(|s| lever * s)
}

impl RollingParts {
    /// The moments that the last step found.
    pub fn remember(&self, moments: &mut Moments) {
        moments.clear();
        let found = self.keys.iter().zip(&self.contacts);
        moments.extend(found.map(|(key, contact)| (*key, contact.impulse)));
    }

    /// Lists the contacts that bear moments, with those of the last step.
    pub(super) fn assemble<const D: usize>(
        &mut self,
        scene: &GrainScene<D>,
        contacts: &[GrainContact<D>],
        moments: &Moments,
    ) {
        self.contacts.clear();
        self.keys.clear();
        let (friction, n) = (&scene.friction, scene.grains.len());
        if friction.rolling.is_none() {
            return;
        }
        let smooth = RollingFriction::default();
        let rough = |mu: f64| if mu > 0.0 { friction.rolling } else { smooth };
        let laws = [rough(friction.grains), rough(friction.walls)];
        let among = contacts.iter().map(|contact| contact.key);
        for key in among.filter(|key| (key.a as usize) < n) {
            // Mostly the contacts and their order are unchanged.
            let same = moments.get(self.keys.len());
            let known = same.filter(|(known, _)| *known == key).or_else(|| {
                let place = moments.binary_search_by_key(&key, |(key, _)| *key);
                place.ok().map(|k| &moments[k])
            });
            self.contacts.push(RollingContact {
                levers: levers(scene.grains.radius(), key),
                law: laws[usize::from(key.b >= WALL)],
                free: [0.0; 3],
                impulse: known.map_or([0.0; 3], |(_, impulse)| *impulse),
            });
            self.keys.push(key);
        }
    }

    /// Sets the free velocities of the step that leads from `v` by y (factor coordinates).
    ///
    /// `surface`: angular velocity of what a grain touches, rad/s, where that moves.
    pub(super) fn set_free<const D: usize>(
        &mut self,
        scene: &GrainScene<D>,
        (v, y): (&[f64], &[f64]),
        surface: impl Fn(GrainKey) -> Option<[f64; 3]>,
    ) {
        let V = body_velocities(D);
        let grains = &scene.grains;
        let rim = |body: u32| -> [f64; 3] {
            let body = body as usize;
            let at = V * body..V * (body + 1);
            let (v, y) = (spin::<D>(&v[at.clone()]), spin::<D>(&y[at]));
            let (radius, [_, root]) = (grains.radius()[body], grains.roots[body]);
            std::array::from_fn(|k| radius * (v[k] + y[k] / root))
        };
        for (key, contact) in self.keys.iter().zip(&mut self.contacts) {
            let [k_a, k_b] = contact.levers;
            let own = rim(key.a);
            let theirs = if key.b < WALL {
                rim(key.b).map(|x| k_b * x)
            } else {
                let radius = grains.radius()[key.a as usize];
                surface(*key).map_or([0.0; 3], |spin| spin.map(|x| radius * x))
            };
            contact.free = std::array::from_fn(|k| k_a * own[k] - theirs[k]);
        }
    }

    /// Adds the effect of the moments on these pairs of bodies to y (factor coordinates).
    pub(super) fn add<const D: usize>(&self, pairs: &[RoundPair<D>], y: &mut [f64]) {
        let V = body_velocities(D);
        for (pair, contact) in pairs.iter().zip(&self.contacts) {
            for (side, sign) in [1.0, -1.0].into_iter().enumerate() {
                let lever = sign * contact.levers[side] * pair.angular[side];
                let at = pair.bodies[side] as usize;
                let spin = &mut y[at + D..at + V];
                let moment = &contact.impulse[3 - (V - D)..];
                for (y, s) in spin.iter_mut().zip(moment) {
                    *y += lever * s;
                }
            }
        }
    }
}
