//! Rolling and drilling friction of a bed's contacts: what a step tells the solver of them, and
//! what it remembers.
//!
//! The law ([`crate::law::rolling`]) holds between two grains, and between a grain and a wall or
//! the ground. The wheels of a machine have none.

use super::contact::{GrainContact, GrainKey, WALL};
use super::system::GrainSystem;
use crate::problem::RollingContact;
use crate::spatial::space::body_velocities;

/// Moments of the last step, from which the next solve starts: (key, M/ℓ in N s along the world's
/// axes), in the order of the keys.
pub type Moments = Vec<(GrainKey, [f64; 3])>;

/// Scratch of a step.
#[derive(Debug, Default)]
pub struct RollingParts {
    /// One for each contact of two grains, or of a grain with what is fixed; none without rolling
    /// friction.
    pub(in crate::system) contacts: Vec<RollingContact>,
    keys: Vec<GrainKey>,
}

impl RollingParts {
    /// The moments that the last step found.
    pub fn remember(&self, moments: &mut Moments) {
        moments.clear();
        let found = self.keys.iter().zip(&self.contacts);
        moments.extend(found.map(|(key, contact)| (*key, contact.impulse)));
    }
}

/// Angular velocity among a body's velocities, rad/s: about the viewer's axis in the plane.
fn spin<const D: usize>(v: &[f64]) -> [f64; 3] {
    match D {
        2 => [0.0, 0.0, v[2]],
        _ => [v[3], v[4], v[5]],
    }
}

impl<const D: usize> GrainSystem<'_, D> {
    /// Whether contacts bear moments.
    pub(in crate::system) fn rolls(&self) -> bool {
        !self.scene.friction.rolling.is_none()
    }

    /// Rolling radius of a contact over the radius of each grain; 0 for what is no grain.
    fn levers(&self, key: GrainKey) -> [f64; 2] {
        let radius = self.scene.grains.radius();
        let r_a = radius[key.a as usize];
        if key.b >= WALL {
            return [1.0, 0.0];
        }
        let r_b = radius[key.b as usize];
        [r_b / (r_a + r_b), r_a / (r_a + r_b)]
    }

    /// Lists the contacts that bear moments, with those of the last step.
    pub(super) fn assemble_rolling(&mut self, contacts: &[GrainContact<D>]) {
        let mut parts = std::mem::take(&mut self.parts.rolling);
        parts.contacts.clear();
        parts.keys.clear();
        if self.rolls() {
            let n = self.n();
            let among = contacts.iter().map(|contact| contact.key);
            for key in among.filter(|key| (key.a as usize) < n) {
                // Mostly the contacts and their order are unchanged.
                let same = self.moments.get(parts.keys.len());
                let known = same.filter(|(known, _)| *known == key).or_else(|| {
                    let place = self.moments.binary_search_by_key(&key, |(key, _)| *key);
                    place.ok().map(|k| &self.moments[k])
                });
                parts.contacts.push(RollingContact {
                    levers: self.levers(key),
                    law: self.scene.friction.rolling,
                    free: [0.0; 3],
                    impulse: known.map_or([0.0; 3], |(_, impulse)| *impulse),
                });
                parts.keys.push(key);
            }
        }
        self.parts.rolling = parts;
    }

    /// Sets the free velocities for the step that leads from `v` by y (factor coordinates).
    pub(in crate::system) fn set_free_rolling(&mut self, v: &[f64], y: &[f64]) {
        let mut parts = std::mem::take(&mut self.parts.rolling);
        let V = body_velocities(D);
        let (n, grains) = (self.n(), &self.scene.grains);
        let rim = |body: usize| -> [f64; 3] {
            let at = V * body..V * (body + 1);
            let (v, y) = (spin::<D>(&v[at.clone()]), spin::<D>(&y[at]));
            let (radius, [_, root]) = (grains.radius()[body], grains.roots[body]);
            std::array::from_fn(|k| radius * (v[k] + y[k] / root))
        };
        for (key, contact) in parts.keys.iter().zip(&mut parts.contacts) {
            let [k_a, k_b] = contact.levers;
            contact.free = rim(key.a as usize).map(|x| k_a * x);
            if (key.b as usize) < n {
                let other = rim(key.b as usize);
                for k in 0..3 {
                    contact.free[k] -= k_b * other[k];
                }
            } else if let Some(surface) = self.parts.surface(*key) {
                let radius = grains.radius()[key.a as usize];
                for k in 0..3 {
                    contact.free[k] -= radius * surface.spin[k];
                }
            }
        }
        self.parts.rolling = parts;
    }

    /// Adds the effect of the moments that a solve found, in factor coordinates.
    pub(in crate::system) fn add_rolling(&self, y: &mut [f64]) {
        let V = body_velocities(D);
        let parts = &self.parts.rolling;
        for (pair, contact) in self.parts.pairs.round.iter().zip(&parts.contacts) {
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
