//! The mechanism: trees of bodies and joints, without their masses.
//!
//! Machines with the same mechanism can stand side by side in the lanes of a register. Bodies,
//! velocities, motions and joints are numbered as in the model. A *row* is a velocity of a joint,
//! counted over all trees without the velocities of their free roots. Lengths are in m.

use std::collections::BTreeSet;
use std::ops::Range;

use super::joint::{Coupling, Joint, Motion, free};
use crate::scalar::{Lane, Mat3, Vec3};

/// Number of velocities of a free root. Every path of its tree starts with them.
pub const BASE: usize = free::NV;

/// Trees of bodies.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Mechanism {
    /// The bodies, carriers before what they carry, tree after tree.
    pub links: Vec<Link>,
    /// The trees.
    pub trees: Vec<TreeSpan>,
    /// Joints with a coordinate of their own, in the model's order.
    pub joints: Vec<OwnJoint>,
    /// Joints with rotors, ascending.
    pub(crate) rotors: Vec<usize>,
    /// Bodies with coupled joints, ascending.
    pub(crate) coupled: Vec<usize>,
    /// Joints whose coordinates are rotations, and their first velocities.
    pub(super) rotating: Vec<(Joint, usize)>,
    /// Number of poses in a configuration: the first body's and those of all other free bodies.
    pub(super) n_poses: usize,
    /// Number of rotations in a configuration.
    pub(super) n_rotations: usize,
    /// Velocities that turn a frame, and the angular speed of the frame at a unit of each.
    pub(crate) turning: Vec<(usize, f64)>,
    /// Velocities of the spinners whose joints follow no other joint.
    pub(crate) spinning: Vec<usize>,
    /// Coordinates of the joints that a step turns, in the order of the bodies, and how those of
    /// coupled joints follow from them.
    pub(super) angles: Vec<usize>,
    pub(super) coupled_angles: Vec<(usize, Coupling)>,
    /// Range of each row's entries in `columns`.
    pub(super) rows: Vec<Range<usize>>,
    /// The columns of each row in the mass matrix, row after row: the rows of the velocities that
    /// precede it on its path, then its own, counted from the first row of its tree.
    pub(super) columns: Vec<usize>,
    /// The motion of each of these columns.
    pub(super) column_motions: Vec<usize>,
    /// Index of the diagonal entry of each velocity's row; not used for those of a free root.
    pub(super) diagonals: Vec<usize>,
    /// Tree of each velocity.
    pub(super) tree_of: Vec<usize>,
    /// Whether a base or a loop passes the momentum of each cluster on to the world. A cluster is a
    /// set of trees that closed loops tie together.
    pub(super) clusters: Vec<bool>,
    /// How far a unit of each velocity moves what it carries.
    pub(crate) levers: Vec<Lever>,
    /// Size of each cluster, m: the largest distance of anything in it from the origin of its tree.
    pub(super) sizes: Vec<f64>,
    pub(super) n_motions: usize,
    pub(super) paths: Vec<usize>,
    pub(super) movers: Vec<PathVelocity>,
}

/// Bodies, velocities and rows of a tree.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TreeSpan {
    /// Bodies of the tree; the first is the root.
    pub bodies: Range<usize>,
    /// Velocities of the tree; those of a free root come first.
    pub velocities: Range<usize>,
    /// Rows of the tree: its velocities without those of a free root.
    pub rows: Range<usize>,
    /// Whether the root is free; otherwise a joint connects it to the world.
    pub is_free: bool,
    /// Index of a free root's pose in a configuration.
    pub pose: usize,
    /// Index of the tree's cluster.
    pub(crate) cluster: usize,
}

/// Velocities that move what they carry together: the components of a vector, or one alone.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Lever {
    /// The first of them.
    pub first: usize,
    /// Their number.
    pub n: usize,
    /// Farthest displacement by a unit: 1 for a translation, for a rotation the largest distance
    /// from its axis, m.
    pub arm: f64,
    /// Their cluster.
    pub cluster: usize,
}

/// A joint with a coordinate of its own.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OwnJoint {
    /// The body that it carries.
    pub body: usize,
    /// Index of the joint's velocity.
    pub velocity: usize,
    /// The cluster of its tree.
    pub(crate) cluster: usize,
    /// [Lever arm](Lever::arm) of the joint: converts its coordinate and rate to m and m/s where
    /// they are compared with lengths and speeds.
    pub(crate) arm: f64,
}

/// A velocity that moves a body, and the motion that a unit of it imparts to the body.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PathVelocity {
    /// Index among all velocities.
    pub velocity: usize,
    /// Index in [`Poses::motions`](super::poses::Poses::motions).
    pub motion: usize,
}

/// A body and its joint.
#[allow(clippy::struct_excessive_bools)] // facts that do not depend on each other
#[derive(Clone, Debug, PartialEq)]
pub struct Link {
    /// Index of the body's tree.
    pub(super) tree: usize,
    /// The body that carries it; a root itself.
    pub parent: usize,
    /// Origin of the joint in the carrier's frame.
    pub position: [f64; 3],
    /// The axis of the carrier's frame that it lies on.
    pub(super) along: Option<usize>,
    /// Columns of the fixed rotation from the joint's frame to the carrier's; `None` for the
    /// identity.
    pub rotation: Option<[[f64; 3]; 3]>,
    /// Joint that carries the body.
    pub joint: Joint,
    /// First velocity of the joint; for a coupled joint, the velocity that it follows.
    pub velocity: usize,
    /// Index of the joint's first motion.
    pub motion: usize,
    /// Whether a step need not turn it: [`Body::is_spinner`](super::Body::is_spinner).
    pub is_spinner: bool,
    /// Whether the body carries no other body.
    pub is_leaf: bool,
    /// Whether the body carries no other body and its joint follows no other joint.
    pub(super) is_plain_leaf: bool,
    /// Whether the body's carrier carries no body with a higher index.
    pub is_last: bool,
    /// Whether the body's mass centre is its frame's origin.
    pub is_centred: bool,
    /// What is known of its principal axes.
    pub symmetry: Symmetry,
    /// Number of its own rows; 0 for a free root and if the joint follows another one.
    pub(super) n_rows: usize,
    /// Where the last row of its path is in [`Mechanism::columns`].
    pub(super) row: Range<usize>,
    pub(super) path: Range<usize>,
    pub(super) movers: Range<usize>,
}

/// Principal axes of a body.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Symmetry {
    /// The frame's axes, with equal moments across x.
    AboutX,
    /// The frame's axes, with equal moments across y.
    AboutY,
    /// The frame's axes, with equal moments across z.
    AboutZ,
    /// The frame's axes, with three moments.
    None,
    /// Other axes than the frame's.
    Turned,
}

impl Mechanism {
    /// Number of bodies.
    #[inline]
    #[must_use]
    pub fn n_bodies(&self) -> usize {
        self.links.len()
    }

    /// Number of joints with a coordinate of their own.
    #[inline]
    #[must_use]
    pub fn n_joints(&self) -> usize {
        self.joints.len()
    }

    /// Number of velocities.
    #[inline]
    #[must_use]
    pub fn nv(&self) -> usize {
        self.diagonals.len()
    }

    /// Number of motions.
    #[inline]
    #[must_use]
    pub fn n_motions(&self) -> usize {
        self.n_motions
    }

    /// Index of a body's tree.
    #[inline]
    #[must_use]
    pub(crate) fn tree_of_body(&self, b: usize) -> usize {
        self.links[b].tree
    }

    /// Index of a velocity's tree.
    #[inline]
    #[must_use]
    pub(crate) fn tree_of_velocity(&self, k: usize) -> usize {
        self.tree_of[k]
    }

    /// Number of clusters: sets of trees that closed loops tie together.
    #[inline]
    #[must_use]
    pub(crate) fn n_clusters(&self) -> usize {
        self.clusters.len()
    }

    /// Whether a base or a loop passes the momentum of a cluster on to the world.
    #[inline]
    #[must_use]
    pub(crate) fn is_held(&self, cluster: usize) -> bool {
        self.clusters[cluster]
    }

    /// Size of a cluster, m: the largest distance of anything from the origin of its tree.
    #[inline]
    #[must_use]
    pub(crate) fn size(&self, cluster: usize) -> f64 {
        self.sizes[cluster]
    }

    /// Index of a body's cluster.
    #[inline]
    #[must_use]
    pub(crate) fn cluster_of_body(&self, b: usize) -> usize {
        self.trees[self.links[b].tree].cluster
    }

    /// Index of a velocity's cluster.
    #[inline]
    #[must_use]
    pub(crate) fn cluster_of_velocity(&self, k: usize) -> usize {
        self.trees[self.tree_of[k]].cluster
    }

    /// Numbers the clusters in the order of their first trees. `loops`: the trees that each loop
    /// ties together, and whether it ties them to the world.
    pub(super) fn tie(&mut self, loops: &[(Vec<usize>, bool)]) {
        let mut of_tree: Vec<usize> = (0..self.trees.len()).collect();
        for (trees, _) in loops {
            let tied: Vec<usize> = trees.iter().map(|tree| of_tree[*tree]).collect();
            let first = tied.iter().copied().min();
            for own in of_tree.iter_mut().filter(|own| tied.contains(own)) {
                *own = first.unwrap_or(*own);
            }
        }
        let names: BTreeSet<usize> = of_tree.iter().copied().collect();
        self.clusters = vec![false; names.len()];
        for (tree, own) in self.trees.iter_mut().zip(&of_tree) {
            tree.cluster = names.range(..*own).count();
            self.clusters[tree.cluster] |= !tree.is_free;
        }
        for tree in (loops.iter()).filter_map(|(trees, is_held)| trees.first().filter(|_| *is_held))
        {
            self.clusters[self.trees[*tree].cluster] = true;
        }
        for own in &mut self.joints {
            own.cluster = self.trees[self.tree_of[own.velocity]].cluster;
        }
    }

    /// The rows of the velocities that move body `b`, in order, counted from the first row of its
    /// tree; empty for a free root.
    #[inline(always)]
    pub(super) fn row(&self, b: usize) -> &[usize] {
        &self.columns[self.links[b].row.clone()]
    }

    /// The row of a joint's velocity.
    #[inline(always)]
    pub(super) fn row_of(&self, velocity: usize) -> usize {
        let tree = &self.trees[self.tree_of[velocity]];
        velocity - (tree.velocities.start + tree.lead()) + tree.rows.start
    }

    /// First velocity of the free root of body `b`'s tree.
    #[inline(always)]
    #[must_use]
    pub fn base_of(&self, b: usize) -> Option<usize> {
        let tree = &self.trees[self.links[b].tree];
        tree.is_free.then_some(tree.velocities.start)
    }

    /// Velocity of the material point of body `b` at `x`, relative to its tree's origin. `motion`:
    /// of each joint velocity, by its index; `v`: each velocity.
    #[inline(always)]
    pub(crate) fn point_velocity<T: Lane>(
        &self,
        b: usize,
        x: Vec3<T>,
        motion: impl Fn(usize) -> Motion<T>,
        v: impl Fn(usize) -> T,
    ) -> Vec3<T> {
        let vector = |k| Vec3::new(v(k), v(k + 1), v(k + 2));
        let mut velocity = match self.base_of(b) {
            Some(first) => vector(first) + vector(first + 3).cross(x),
            None => Vec3::splat(x.x.token(), [0.0; 3]),
        };
        for mover in self.movers(b) {
            velocity += motion(mover.motion).velocity_at(x) * v(mover.velocity);
        }
        velocity
    }

    /// Velocities that move body `b`: those of a free root, then of the joints outwards.
    #[inline(always)]
    #[must_use]
    pub fn path(&self, b: usize) -> &[usize] {
        &self.paths[self.links[b].path.clone()]
    }

    /// The velocities of the joints that move body `b`, outwards.
    #[inline(always)]
    #[must_use]
    pub fn movers(&self, b: usize) -> &[PathVelocity] {
        &self.movers[self.links[b].movers.clone()]
    }
}

impl TreeSpan {
    /// Number of velocities of a free root: 6 or 0.
    #[inline(always)]
    #[must_use]
    pub fn lead(&self) -> usize {
        if self.is_free { BASE } else { 0 }
    }
}

impl Link {
    /// Whether the body's joint follows another one; has no meaning for a root.
    #[inline(always)]
    pub(super) fn is_coupled(&self) -> bool {
        self.n_rows == 0
    }

    /// `R p` for its joint's origin p.
    #[inline(always)]
    pub(crate) fn lever<T: Lane>(&self, R: &Mat3<T>) -> Vec3<T> {
        let one = |column: Vec3<T>, k: usize| column * column.x.like(self.position[k]);
        match self.along {
            Some(0) => one(R.x, 0),
            Some(1) => one(R.y, 1),
            Some(2) => one(R.z, 2),
            _ => R.times_shared(self.position),
        }
    }

    /// The frame of its joint, on a carrier with the attitude `R`.
    #[inline(always)]
    pub(super) fn frame<T: Lane>(&self, R: &Mat3<T>) -> Mat3<T> {
        match &self.rotation {
            None => *R,
            Some(fixed) => R.times_columns(fixed),
        }
    }
}
