//! What the dynamics ask of a joint.
//!
//! A joint has *coordinates*, kept in a configuration as numbers, rotations or poses, and
//! *velocities*. It places its body relative to its own frame, which is fixed in the carrier. Each
//! velocity has a [screw](Screw) S; the axes of all joints but the free one are fixed in the
//! carrier, so with the velocity V of the carrier
//!
//! ```text
//! V_body = V + Σ S_k v_k,        Ṡ_k = V × S_k
//! ```
//!
//! Mass matrix, bias, energy, contact rows and limits read the screws and nothing else.

use super::axis::JointAxis;
use super::coupling::Coupling;
use super::screw::{Motion, Screw};
use crate::scalar::{Lane, Mat3, Vec3};

/// The coordinates of all joints of a machine, where joints find their own.
pub trait JointCoordinates<T> {
    /// The number of a revolute (rad) or prismatic (m) joint.
    fn number_at(&self, joint: usize) -> T;

    /// A rotation relative to the joint's frame: a unit quaternion x, y, z, w.
    fn rotation_at(&self, index: usize) -> [T; 4];

    /// Replaces a rotation.
    fn set_rotation_at(&mut self, index: usize, rotation: [T; 4]);

    /// Origin (world, m) and attitude of a free body.
    fn pose_at(&self, index: usize) -> (Vec3<T>, [T; 4]);

    /// Replaces a pose.
    fn set_pose_at(&mut self, index: usize, pose: (Vec3<T>, [T; 4]));
}

/// Where a joint puts its body.
#[derive(Clone, Copy, Debug)]
pub struct JointPlacement<T> {
    /// Attitude of the body.
    pub R: Mat3<T>,
    /// From the joint's origin to the body's, m; `None` if they coincide.
    pub shift: Option<Vec3<T>>,
}

/// A joint of the catalogue.
pub trait JointModel {
    /// Number of its own velocities; 0 for a joint that follows another. By default one if it has a
    /// coordinate.
    #[inline(always)]
    fn nv(&self) -> usize {
        usize::from(self.coordinate().is_some())
    }

    /// Number of its screws: one a velocity, own or followed, without those of a free base.
    fn n_motions(&self) -> usize {
        self.nv()
    }

    /// Whether the joint displaces its body's origin along an axis.
    fn slides(&self) -> bool {
        false
    }

    /// Angular speed of its body relative to the carrier at a unit of one of its velocities; `None`
    /// if it never turns.
    fn turning(&self) -> Option<f64> {
        None
    }

    /// Which of the machine's numbers is its coordinate, or that of the joint that it follows.
    fn coordinate(&self) -> Option<usize> {
        None
    }

    /// The axis about or along which that coordinate moves the body, the same in the joint's frame
    /// and the body's.
    fn axis(&self) -> Option<&JointAxis> {
        None
    }

    /// The number from which its angle follows, and how, if it is placed by the sine and cosine of
    /// an angle. A step computes those of all joints at once.
    fn angle(&self) -> Option<(usize, Option<Coupling>)> {
        None
    }

    /// Places its body, where the joint's frame has the attitude `frame`. `turn`: sine and cosine
    /// of its angle; `None` for a body whose rotation shows in nothing but its appearance.
    fn place<T: Lane>(
        &self,
        frame: &Mat3<T>,
        q: &impl JointCoordinates<T>,
        turn: impl FnOnce() -> Option<(T, T)>,
    ) -> JointPlacement<T>;

    /// Calls `set(k, S)` with each of its screws, in world axes.
    fn screws<T: Lane>(&self, frame: &Mat3<T>, set: impl FnMut(usize, Screw<T>));

    /// The screw of one of its motions.
    fn screw<T: Lane>(&self, motion: &Motion<T>) -> Screw<T>;

    /// Direction, world axes, in which its coordinate grows: what a limit pushes along.
    #[inline(always)]
    fn direction<T: Lane>(&self, motion: &Motion<T>) -> Vec3<T> {
        let Screw { turning, sliding } = self.screw(motion);
        turning.or(sliding).unwrap_or(motion.axis)
    }

    /// The motions of which the second is the sum of the first and its own, for a joint that
    /// follows one further inwards: [`Coupling::combined`].
    fn combined(&self) -> Option<(usize, usize)> {
        None
    }

    /// Advances its rotation by `h` seconds at its velocities `v`. Numbers are not its task: all of
    /// them advance at once, by [`advanced`].
    fn advance<T: Lane>(&self, _q: &mut impl JointCoordinates<T>, _v: &[T], _h: T) {}

    /// Names of its public coordinates; that of a single number is the body's.
    fn names(&self) -> &'static [&'static str] {
        const SINGLE: &[&str] = &[""];
        &SINGLE[..self.nv()]
    }

    /// Where the angles of its rotation stand among its public coordinates, if it has one.
    fn first_angle(&self) -> Option<usize> {
        None
    }

    /// Sets its rotation from public coordinates, where `turn` maps three angles to a rotation.
    fn set_public(
        &self,
        _public: &[f64],
        _turn: impl Fn([f64; 3]) -> [f64; 4],
        _q: &mut impl JointCoordinates<f64>,
    ) {
    }

    /// Writes the public coordinates of its rotation, where `angles` maps a rotation to three
    /// angles.
    fn write_public(
        &self,
        _q: &impl JointCoordinates<f64>,
        _angles: impl Fn([f64; 4]) -> [f64; 3],
        _public: &mut [f64],
    ) {
    }
}

/// A number `h` seconds later, at its rate.
#[inline(always)]
pub fn advanced<T: Lane>(q: T, rate: T, h: T) -> T {
    q + h * rate
}
