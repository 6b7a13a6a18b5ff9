//! The paths of the trees: which velocities move which body.

use std::ops::Range;

use super::body::Body;
use crate::multibody::joint::{Joint, Prismatic, Revolute, free};

/// Bodies and velocities of a tree: one root and everything it carries.
#[derive(Clone, Debug)]
pub struct Tree {
    /// Its bodies; the first is the root.
    pub bodies: Range<usize>,
    /// Its velocities; those of a free root come first.
    pub velocities: Range<usize>,
    /// Whether its root is free. Positions in the tree are then relative to the root's origin,
    /// otherwise to the world's.
    pub is_free: bool,
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

/// Velocities and motions of all bodies, from the root outwards.
#[derive(Clone, Debug, Default)]
pub(super) struct Paths {
    /// Those of body `b`: `velocities[b * stride..]`; the body's span holds their number.
    velocities: Vec<usize>,
    spans: Vec<Span>,
    leads: Vec<usize>,
    pub(super) stride: usize,
    /// Motions of the velocities beyond the lead, in the same layout.
    motions: Vec<usize>,
    pub(super) n_motions: usize,
    /// Body of each velocity, and the position of the velocity in that body's path.
    pub(super) body_of_velocity: Vec<usize>,
    up_to_velocity: Vec<(usize, usize)>,
    /// Number of leading entries that bodies `a` and `b` share: `common[a * n_bodies + b]`.
    common: Vec<usize>,
}

/// Location of a body's path.
#[derive(Clone, Copy, Debug)]
struct Span {
    start: usize,
    length: usize,
    /// Number of velocities of a free root at its start, and the first of them.
    lead: usize,
    first: usize,
}

/// Path of one body during construction.
#[derive(Clone, Default)]
struct Path {
    velocities: Vec<usize>,
    motions: Vec<usize>,
}

impl Paths {
    /// Numbers velocities and motions and writes the indices into the bodies. The error is the body
    /// of a coupling that no path allows.
    pub(super) fn number(bodies: &mut [Body]) -> Result<Self, usize> {
        let mut paths = Self::default();
        let mut grown: Vec<Path> = Vec::with_capacity(bodies.len());
        for b in 0..bodies.len() {
            let mut path = bodies[b]
                .parent
                .map_or(Path::default(), |p| grown[p].clone());
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
                paths.follow(bodies, &grown, b, &mut path)?;
            } else {
                let nv = bodies[b].joint.nv();
                path.velocities.extend(first..first + nv);
                path.motions.extend(motion..paths.n_motions);
                paths.body_of_velocity.extend((0..nv).map(|_| b));
            }
            grown.push(path);
        }
        paths.lay_out(bodies, &grown);
        Ok(paths)
    }

    /// Continues the path of a body with a coupled joint.
    fn follow(
        &mut self,
        bodies: &mut [Body],
        grown: &[Path],
        b: usize,
        path: &mut Path,
    ) -> Result<(), usize> {
        let motion = bodies[b].motion;
        let lead = self.leads[b];
        let coordinate = bodies[b].joint.coordinate().ok_or(b)?;
        let is_followed = |other: &&Body| {
            let own = other.joint.coordinate();
            own.is_some_and(|c| c.coupling.is_none() && c.joint == coordinate.joint)
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
        } else if grown[leader].velocities.split_last() == Some((&k, &path.velocities[..])) {
            path.velocities.push(k);
            path.motions.push(motion);
        } else {
            return Err(b);
        }
        bodies[b].velocity = k;
        if let Joint::Revolute(Revolute { coordinate, .. })
        | Joint::Prismatic(Prismatic { coordinate, .. }) = &mut bodies[b].joint
            && let Some(coupling) = &mut coordinate.coupling
        {
            coupling.combined = combined;
        }
        Ok(())
    }

    fn lay_out(&mut self, bodies: &[Body], grown: &[Path]) {
        let n = bodies.len();
        let longest = grown.iter().map(|path| path.velocities.len()).max();
        self.stride = longest.unwrap_or(0).max(1);
        self.velocities = vec![0; n * self.stride];
        self.motions = vec![0; n * self.stride];
        for (b, path) in grown.iter().enumerate() {
            let start = b * self.stride;
            self.velocities[start..][..path.velocities.len()].copy_from_slice(&path.velocities);
            self.motions[start..][..path.motions.len()].copy_from_slice(&path.motions);
            self.spans.push(Span {
                start,
                length: path.velocities.len(),
                lead: self.leads[b],
                first: path.velocities.first().copied().unwrap_or(0),
            });
        }
        for (k, &b) in self.body_of_velocity.iter().enumerate() {
            let at = grown[b].velocities.iter().position(|&i| i == k);
            self.up_to_velocity
                .push((b * self.stride, at.unwrap_or(0) + 1));
        }
        self.common = vec![0; n * n];
        for (a, body) in bodies.iter().enumerate() {
            self.common[a * n + a] = self.spans[a].length;
            let Some(parent) = body.parent else {
                continue; // Shares nothing with the trees before it.
            };
            // A path ends with the body's own velocity, which occurs in no earlier path unless the
            // body follows another.
            let own = &grown[parent].velocities.len();
            let follows = grown[a]
                .velocities
                .get(*own)
                .filter(|_| body.joint.coupling().is_some());
            for b in 0..a {
                let mut shared = self.common[parent * n + b];
                if shared == *own && follows.is_some() && grown[b].velocities.get(*own) == follows {
                    shared += 1;
                }
                self.common[a * n + b] = shared;
                self.common[b * n + a] = shared;
            }
        }
    }

    #[inline]
    pub(super) fn path(&self, b: usize) -> &[usize] {
        let span = &self.spans[b];
        &self.velocities[span.start..][..span.length]
    }

    #[inline]
    pub(super) fn lead(&self, b: usize) -> usize {
        self.spans[b].lead
    }

    #[inline]
    pub(super) fn split(&self, b: usize) -> (Range<usize>, &[usize]) {
        let span = &self.spans[b];
        let rest = &self.velocities[span.start + span.lead..][..span.length - span.lead];
        (span.first..span.first + span.lead, rest)
    }

    #[inline]
    pub(super) fn motions(&self, b: usize) -> &[usize] {
        let span = &self.spans[b];
        &self.motions[span.start..][..span.length - span.lead]
    }

    #[inline]
    pub(super) fn velocity_path(&self, k: usize) -> &[usize] {
        let (start, length) = self.up_to_velocity[k];
        &self.velocities[start..][..length]
    }

    #[inline]
    pub(super) fn common(&self, a: usize, b: usize) -> usize {
        self.common[a * self.spans.len() + b]
    }
}
