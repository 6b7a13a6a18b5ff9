//! The paths of the trees: which velocities move which body.

use std::ops::Range;

use super::body::Body;
use crate::multibody::joint::{Joint, JointModel, free};

/// Bodies and velocities of a tree: one root and everything it carries.
#[derive(Clone, Debug)]
pub struct Tree {
    /// Bodies of the tree; the first is the root.
    pub bodies: Range<usize>,
    /// Velocities of the tree; those of a free root come first.
    pub velocities: Range<usize>,
    /// Whether the root is free. Positions in the tree are then relative to the root's origin,
    /// otherwise to the world's.
    pub is_free: bool,
    /// Whether parts of the tree collide with each other, except across a joint.
    pub self_contact: bool,
    /// kg.
    pub mass: f64,
    /// Largest distance of a joint from the root, m, without the displacements of prismatic joints.
    pub reach: f64,
}

impl Tree {
    /// Number of velocities of a free root at the start of every path: 6 or 0.
    #[inline]
    #[must_use]
    pub fn lead(&self) -> usize {
        if self.is_free { free::NV } else { 0 }
    }
}

/// Velocities and motions of all bodies, from the root outwards, as they are numbered.
#[derive(Clone, Debug, Default)]
pub(super) struct Paths {
    /// Path of each body.
    pub(super) of: Vec<BodyPath>,
    /// Number of velocities of a free root at the start of each body's path.
    leads: Vec<usize>,
    pub(super) n_motions: usize,
    pub(super) body_of_velocity: Vec<usize>,
}

/// Path of one body.
#[derive(Clone, Debug, Default)]
pub(super) struct BodyPath {
    pub(super) velocities: Vec<usize>,
    /// Motions of the path's velocities without those of a free root.
    pub(super) motions: Vec<usize>,
}

impl Paths {
    /// Numbers velocities and motions and writes the indices into the bodies. The error is the body
    /// of a coupling that no path allows.
    pub(super) fn number(bodies: &mut [Body]) -> Result<Self, usize> {
        let mut paths = Self::default();
        for b in 0..bodies.len() {
            let mut path = bodies[b]
                .parent
                .map_or(BodyPath::default(), |p| paths.of[p].clone());
            let lead = match (bodies[b].parent, &bodies[b].joint) {
                (Some(p), _) => paths.leads[p],
                (None, Joint::Free(_)) => free::NV,
                (None, _) => 0,
            };
            paths.leads.push(lead);
            let first = paths.body_of_velocity.len();
            let motion = paths.n_motions;
            bodies[b].velocity = first;
            bodies[b].motion = motion;
            paths.n_motions += bodies[b].joint.n_motions();
            if bodies[b].joint.coupling().is_some() {
                paths.follow(bodies, b, &mut path)?;
            } else {
                let nv = bodies[b].joint.nv();
                path.velocities.extend(first..first + nv);
                path.motions.extend(motion..paths.n_motions);
                paths.body_of_velocity.extend((0..nv).map(|_| b));
            }
            paths.of.push(path);
        }
        Ok(paths)
    }

    /// Continues the path of a body with a coupled joint.
    fn follow(&mut self, bodies: &mut [Body], b: usize, path: &mut BodyPath) -> Result<(), usize> {
        let motion = bodies[b].motion;
        let lead = self.leads[b];
        let coordinate = bodies[b].joint.coordinate().ok_or(b)?;
        let is_followed = |other: &&Body| {
            other.joint.coordinate() == Some(coordinate) && other.joint.coupling().is_none()
        };
        let leader = bodies[..b].iter().find(is_followed).ok_or(b)?;
        if leader.tree != bodies[b].tree {
            return Err(b);
        }
        let (k, leader) = (leader.velocity, self.body_of_velocity[leader.velocity]);
        let mut combined = None;
        if let Some(at) = path.velocities.iter().position(|&i| i == k) {
            let before = path.motions[at - lead];
            combined = Some((before, self.n_motions));
            path.motions[at - lead] = self.n_motions;
            self.n_motions += 1;
        } else if self.of[leader].velocities.split_last() == Some((&k, &path.velocities[..])) {
            path.velocities.push(k);
            path.motions.push(motion);
        } else {
            return Err(b);
        }
        bodies[b].velocity = k;
        if let Joint::Coupled(own) = &mut bodies[b].joint {
            own.coupling.combined = combined;
        }
        Ok(())
    }

    /// Number of leading entries that the paths of two bodies share, body by body.
    pub(super) fn common(&self, bodies: &[Body]) -> Vec<usize> {
        let n = bodies.len();
        let mut common = vec![0; n * n];
        for (a, body) in bodies.iter().enumerate() {
            let path = &self.of[a].velocities;
            common[a * n + a] = path.len();
            let Some(parent) = body.parent else {
                continue; // Shares nothing with the trees before it.
            };
            // A path ends with the body's own velocity, which occurs in no earlier path unless the
            // body follows another.
            let own = self.of[parent].velocities.len();
            let follows = path.get(own).filter(|_| body.is_coupled);
            for b in 0..a {
                let mut shared = common[parent * n + b];
                let is_same = follows.is_some() && self.of[b].velocities.get(own) == follows;
                if shared == own && is_same {
                    shared += 1;
                }
                common[a * n + b] = shared;
                common[b * n + a] = shared;
            }
        }
        common
    }
}
