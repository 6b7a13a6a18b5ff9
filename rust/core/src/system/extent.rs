//! How far a step moves a machine: rotations, and displacements.
#![allow(clippy::inline_always)] // a call leaves the instructions that its caller is compiled for

use crate::multibody::mechanism::Mechanism;
use crate::scalar::Lane;

/// Rotation of a free base in a step, rad, beyond which gyroscopic terms are implicit. At this
/// angle the third-order error of the explicit terms is a thousandth of the energy.
const MOST_TURN: f64 = 0.1;

/// Rotation of the fastest frame in a step, joints included, rad, beyond which gyroscopic terms are
/// implicit. A joint that snaps to a new set-point turns a light part of the machine. Measured on
/// the drives of random policies: implicit terms between [`MOST_TURN`] and this limit change no
/// error in its third digit.
const MOST_JOINT_TURN: f64 = 0.5;

/// Rotation of a wheel about its axle in a step, rad, beyond which gyroscopic terms are implicit.
/// The spin couples the motions across the axle at a frequency of a few per cent of the spin rate,
/// so explicit terms would stay acceptable up to some twenty times more.
const MOST_SPIN: f64 = 1.0;

/// Angular speeds, rad/s.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Turning<T> {
    /// Largest of a free base.
    base: T,
    /// Largest of a joint that turns a frame.
    joints: T,
    /// Largest of a spinner about its axle.
    spin: T,
}

impl<T: Lane> Turning<T> {
    /// Angular speeds of a cluster at a velocity (nv), rad/s; `zero`: 0 in every lane.
    #[inline(always)]
    pub(crate) fn of_cluster(zero: T, mechanism: &Mechanism, v: &[T], cluster: usize) -> Self {
        let is_one = mechanism.n_clusters() == 1;
        let is_own = |k: usize| is_one || mechanism.cluster_of_velocity(k) == cluster;
        let (mut base, mut joints, mut spin) = (zero, zero, zero);
        let trees = mechanism.trees.iter();
        for tree in trees.filter(|tree| tree.is_free && tree.cluster == cluster) {
            let first = tree.velocities.start;
            let [x, y, z] = [v[first + 3], v[first + 4], v[first + 5]];
            base = (x * x + y * y + z * z).sqrt().max(base);
        }
        for &(k, ratio) in mechanism.turning.iter().filter(|(k, _)| is_own(*k)) {
            joints = (v[k].abs() * zero.like(ratio)).max(joints);
        }
        for &k in mechanism.spinning.iter().filter(|k| is_own(**k)) {
            spin = v[k].abs().max(spin);
        }
        Self { base, joints, spin }
    }

    /// Largest angular speed of a frame whose pose matters.
    #[inline(always)]
    pub(crate) fn of_frames(&self) -> T {
        self.base + self.joints
    }

    /// Where explicit gyroscopic terms are too stiff for a step of h.
    #[inline(always)]
    pub(crate) fn is_gyroscopic(&self, h: T) -> T::Mask {
        h.like(MOST_TURN).lt(h * self.base)
            | h.like(MOST_JOINT_TURN).lt(h * self.of_frames())
            | h.like(MOST_SPIN).lt(h * self.spin)
    }
}

/// Size of the displacement of a cluster (`y`, nv), m: the farthest that any joint, or any motion
/// of a free base, moves what it carries; `zero`: 0 in every lane.
#[inline(always)]
pub(crate) fn displacement<T: Lane>(zero: T, mechanism: &Mechanism, y: &[T], cluster: usize) -> T {
    let mut largest = zero;
    for lever in (mechanism.levers.iter()).filter(|lever| lever.cluster == cluster) {
        let own = &y[lever.first..][..lever.n];
        let length = if let [x] = own {
            x.abs()
        } else {
            let squares = own.iter().fold(zero, |sum, x| sum + *x * *x);
            squares.sqrt()
        };
        largest = (length * zero.like(lever.arm)).max(largest);
    }
    largest
}

/// Penetration of a cluster that is tolerated by default, as a fraction of its size. The built-in
/// rover reaches 1.408 m and has 1e-8 m: one step of driving on a plane adds less.
const PENETRATION: f64 = 1e-8 / 1.408;

/// Penetration that is tolerated, m: `stated`, or what a cluster has by default.
#[inline(always)]
pub(crate) fn tolerated(stated: Option<f64>, mechanism: &Mechanism, cluster: usize) -> f64 {
    stated.unwrap_or_else(|| PENETRATION * mechanism.size(cluster))
}
