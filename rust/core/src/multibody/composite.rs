//! Composite bodies: a body and everything it carries, as one rigid body.

use super::inertias::Inertia;
use super::joint::Motion;
use super::mechanism::{BASE, Link};
use super::poses::Pose;
use crate::scalar::{Lane, Vec3};

/// Entries of the lower triangle of a free root's block in the mass matrix.
pub(super) const BLOCK: usize = BASE * (BASE + 1) / 2;

/// Momentum, and angular momentum about the tree's origin.
#[derive(Clone, Copy, Debug)]
pub(super) struct TreeMomentum<T> {
    pub linear: Vec3<T>,
    pub angular: Vec3<T>,
}

/// Mass, first moment and inertia of a body and everything it carries, about the tree's origin.
#[derive(Clone, Copy, Debug)]
pub(super) struct Composite<T> {
    pub mass: T,
    pub moment: Vec3<T>,
    pub inertia: Symmetric<T>,
}

/// A symmetric matrix.
#[derive(Clone, Copy, Debug)]
pub(super) struct Symmetric<T> {
    pub xx: T,
    pub yy: T,
    pub zz: T,
    pub xy: T,
    pub xz: T,
    pub yz: T,
}

impl<T: Lane> Symmetric<T> {
    pub(super) fn zero(zero: T) -> Self {
        Self {
            xx: zero,
            yy: zero,
            zz: zero,
            xy: zero,
            xz: zero,
            yz: zero,
        }
    }

    #[inline(always)]
    pub(super) fn plus(&self, other: &Self) -> Self {
        Self {
            xx: self.xx + other.xx,
            yy: self.yy + other.yy,
            zz: self.zz + other.zz,
            xy: self.xy + other.xy,
            xz: self.xz + other.xz,
            yz: self.yz + other.yz,
        }
    }

    #[inline(always)]
    pub(super) fn times(&self, v: Vec3<T>) -> Vec3<T> {
        Vec3::new(
            self.xx * v.x + self.xy * v.y + self.xz * v.z,
            self.xy * v.x + self.yy * v.y + self.yz * v.z,
            self.xz * v.x + self.yz * v.y + self.zz * v.z,
        )
    }

    /// Adds `k a aᵀ`.
    #[inline(always)]
    fn add_square(&mut self, k: T, a: Vec3<T>) {
        let ka = a * k;
        self.xx += ka.x * a.x;
        self.yy += ka.y * a.y;
        self.zz += ka.z * a.z;
        self.xy += ka.x * a.y;
        self.xz += ka.x * a.z;
        self.yz += ka.y * a.z;
    }
}

impl<T: Lane> Composite<T> {
    /// Nothing.
    pub(super) fn zero(zero: T) -> Self {
        Self {
            mass: zero,
            moment: Vec3::new(zero, zero, zero),
            inertia: Symmetric::zero(zero),
        }
    }

    /// A single body.
    #[inline(always)]
    pub(super) fn of(link: &Link, inertia: &Inertia<T>, pose: &Pose<T>) -> Self {
        let Inertia { mass, rest, .. } = *inertia;
        let Vec3 { x, y, z } = pose.c;
        let moment = pose.c * mass;
        let (xx, yy, zz) = (moment.x * x, moment.y * y, moment.z * z);
        // About the tree's origin: m (|c|² 1 − c cᵀ) more than about the mass centre.
        let mut sum = Symmetric {
            xx: rest + (yy + zz),
            yy: rest + (xx + zz),
            zz: rest + (xx + yy),
            xy: -(moment.x * y),
            xz: -(moment.x * z),
            yz: -(moment.y * z),
        };
        let (a, b) = inertia.axes(link.symmetry, &pose.R);
        sum.add_square(inertia.first, a);
        if let Some(b) = b {
            sum.add_square(inertia.second, b);
        }
        Self {
            mass,
            moment,
            inertia: sum,
        }
    }

    /// Momentum at unit rate of a motion.
    #[inline(always)]
    pub(super) fn momentum(&self, motion: &Motion<T>) -> TreeMomentum<T> {
        TreeMomentum {
            linear: motion.swing * self.mass + motion.axis.cross(self.moment),
            angular: self.inertia.times(motion.axis) + self.moment.cross(motion.swing),
        }
    }

    /// Block of a free root in the mass matrix: the lower triangle by rows.
    #[inline(always)]
    pub(super) fn block(&self) -> [T; BLOCK] {
        let (m, s, I) = (self.mass, self.moment, self.inertia);
        let o = m.like(0.0);
        [
            m, //
            o, m, //
            o, o, m, //
            o, -s.z, s.y, I.xx, //
            s.z, o, -s.x, I.xy, I.yy, //
            -s.y, s.x, o, I.xz, I.yz, I.zz,
        ]
    }

    /// With another body.
    #[inline(always)]
    pub(super) fn plus(&self, other: &Self) -> Self {
        Self {
            mass: self.mass + other.mass,
            moment: self.moment + other.moment,
            inertia: self.inertia.plus(&other.inertia),
        }
    }
}

impl<T: Lane> TreeMomentum<T> {
    pub(super) fn zero(zero: T) -> Self {
        let nothing = Vec3::new(zero, zero, zero);
        Self {
            linear: nothing,
            angular: nothing,
        }
    }

    /// Products of the momentum with the six motions of the base.
    #[inline(always)]
    pub(super) fn entries(&self) -> [T; BASE] {
        let (f, l) = (self.linear, self.angular);
        [f.x, f.y, f.z, l.x, l.y, l.z]
    }

    /// Products of the momentum with the motions at `indices`, written to `out`.
    #[inline(always)]
    pub(super) fn along_all(&self, motions: &[Motion<T>], indices: &[usize], out: &mut [T]) {
        for p in 0..indices.len() {
            out[p] = self.along(&motions[indices[p]]);
        }
    }

    /// Product of the momentum with a motion.
    #[inline(always)]
    pub(super) fn along(&self, motion: &Motion<T>) -> T {
        motion.power(self.linear, self.angular)
    }
}
