//! Warm start: the impulses of one step, by contact, for the next.

use super::mechanical_system::UnilateralContact;
use serde::{Deserialize, Serialize};

use crate::contact::ContactKey;

/// Number of remembered contacts from which bisection is tried before a linear search.
const MANY: usize = 64;

/// Impulses of the last step by contact, from which the next solve starts. A snapshot contains
/// them.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct WarmStart<K = ContactKey> {
    /// (key, impulse along n, t, b in N s; b is 0 in the plane), in the order of detection.
    pub impulses: Vec<(K, [f64; 3])>,
    /// Generalized impulse of persistent contact in the last step (nv), N s and N m s: 0 for the
    /// velocities of a group of clusters of which a contact was new, separated or in impact, and
    /// empty if no group persisted.
    pub persistent: Vec<f64>,
    /// Energy that contacts which yield stored at the end of the last step, J, by cluster; that
    /// between two stands at the first of their group. Empty if it is not known.
    pub stored: Vec<f64>,
}

impl<K> Default for WarmStart<K> {
    fn default() -> Self {
        Self::with_capacity(0, 0)
    }
}

impl<K> WarmStart<K> {
    /// Room for so many contacts and velocities.
    #[must_use]
    pub fn with_capacity(n_contacts: usize, nv: usize) -> Self {
        Self {
            impulses: Vec::with_capacity(n_contacts),
            persistent: Vec::with_capacity(nv),
            stored: Vec::new(),
        }
    }

    /// Multiplies every impulse, as for a step of another length.
    pub(super) fn scale(&mut self, share: f64) {
        let impulses = self.impulses.iter_mut().flat_map(|(_, p)| p);
        for x in impulses.chain(&mut self.persistent) {
            *x *= share;
        }
    }

    /// Forgets everything.
    pub fn clear(&mut self) {
        self.impulses.clear();
        self.persistent.clear();
        self.stored.clear();
    }
}

impl<K: Copy + Ord> WarmStart<K> {
    /// Fills `p` (d n_c) with the remembered impulses of these contacts, zero for new ones.
    pub fn recall<C: UnilateralContact<Key = K>>(&self, contacts: &[C], d: usize, p: &mut [f64]) {
        // A linear search finds a few contacts, bisection many if detection lists them in the order
        // of their keys.
        let is_sorted =
            self.impulses.len() > MANY && self.impulses.is_sorted_by_key(|(key, _)| *key);
        for (i, (contact, out)) in contacts.iter().zip(p.chunks_exact_mut(d)).enumerate() {
            let wanted = contact.key();
            // Mostly the contacts and their order are unchanged: look at the same place first.
            let same = self.impulses.get(i).filter(|(key, _)| *key == wanted);
            let found = same.or_else(|| {
                if is_sorted {
                    let place = self.impulses.binary_search_by_key(&wanted, |(key, _)| *key);
                    place.ok().map(|k| &self.impulses[k])
                } else {
                    self.impulses.iter().find(|(key, _)| *key == wanted)
                }
            });
            out.copy_from_slice(&found.map_or([0.0; 3], |(_, p)| *p)[..d]);
        }
    }

    /// Whether the last step had exactly these contacts; many in this order.
    #[must_use]
    pub fn is_of<C: UnilateralContact<Key = K>>(&self, contacts: &[C]) -> bool {
        let n = self.impulses.len();
        let is_known = |(i, contact): (usize, &C)| {
            let wanted = contact.key();
            self.impulses[i].0 == wanted
                || (n <= MANY && self.impulses.iter().any(|(key, _)| *key == wanted))
        };
        n == contacts.len() && contacts.iter().enumerate().all(is_known)
    }

    /// Remembers the impulses `p` (d n_c).
    pub fn remember<C: UnilateralContact<Key = K>>(&mut self, contacts: &[C], d: usize, p: &[f64]) {
        self.impulses.clear();
        let remembered = contacts.iter().zip(p.chunks_exact(d)).map(|(c, p)| {
            let mut impulse = [0.0; 3];
            impulse[..d].copy_from_slice(p);
            (c.key(), impulse)
        });
        self.impulses.extend(remembered);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    struct Named(u32);

    impl UnilateralContact for Named {
        type Key = u32;
        type Local = [f64; 2];
        fn key(&self) -> u32 {
            self.0
        }
        fn gap(&self) -> f64 {
            0.0
        }
    }

    #[test]
    fn many_or_few_sorted_or_not_each_contact_gets_its_own_back() {
        for (n, is_reversed) in [(3, false), (3, true), (200, false), (200, true)] {
            let mut keys: Vec<u32> = (0..n).map(|k| 3 * k).collect();
            if is_reversed {
                keys.reverse();
            }
            let contacts: Vec<Named> = keys.iter().map(|&k| Named(k)).collect();
            let p: Vec<f64> = keys.iter().flat_map(|&k| [f64::from(k), 1.0]).collect();
            let mut memory = WarmStart::default();
            memory.remember(&contacts, 2, &p);
            assert!(memory.is_of(&contacts));
            // One lost, one new, the others shifted by one place.
            let later: Vec<Named> = keys[1..]
                .iter()
                .map(|&k| Named(k))
                .chain([Named(1)])
                .collect();
            let mut recalled = vec![f64::NAN; 2 * later.len()];
            memory.recall(&later, 2, &mut recalled);
            assert_eq!(recalled[..2 * later.len() - 2], p[2..]);
            assert_eq!(recalled[2 * later.len() - 2..], [0.0, 0.0]);
            assert!(!memory.is_of(&later));
        }
    }
}
