//! The joint catalogue: how a body can move relative to its carrier, or to the world.
//!
//! | joint | coordinates | velocities | moves |
//! |---|---|---|---|
//! | [`free`] | position, unit quaternion | 6 | anywhere; a root only |
//! | [`fixed`] | – | – | not at all |
//! | [`revolute`] | angle, rad | 1 | about an axis |
//! | [`prismatic`] | displacement, m | 1 | along an axis |
//! | [`spherical`] | unit quaternion | 3 | about a point |
//! | [`coupled`] | – | – | as a revolute or prismatic joint, in proportion to another |
//!
//! A joint is one page: an implementation of [`JointModel`], which says how it places its body, its
//! [screws](Screw), how its coordinates advance and what they are called. The sources of the
//! dynamics know joints by that interface alone.
//!
//! Source: Featherstone 2008, *Rigid Body Dynamics Algorithms*, ch. 4; Carpentier et al. 2019, *The
//! Pinocchio C++ library*, for the joints as types with their own numbers of coordinates and
//! velocities.

pub mod axis;
pub mod coupled;
pub mod coupling;
pub mod fixed;
pub mod free;
pub mod joint_model;
pub mod prismatic;
pub mod revolute;
pub mod screw;
pub mod spherical;

pub use axis::JointAxis;
pub use coupled::{Coupled, SingleJoint};
pub use coupling::Coupling;
pub use fixed::Fixed;
pub use free::{Free, FreePose};
pub use joint_model::{JointCoordinates, JointModel, JointPlacement};
pub use prismatic::Prismatic;
pub use revolute::Revolute;
pub use screw::{Motion, Screw};
pub use spherical::Spherical;

use crate::scalar::{Lane, Mat3};

/// Makes the enum of the joints, which passes every question on to the joint's own page.
macro_rules! catalogue {
    ($($(#[$doc:meta])* $joint:ident,)*) => {
        /// The joint of a body.
        #[derive(Clone, Copy, Debug, PartialEq)]
        pub enum Joint {
            $($(#[$doc])* $joint($joint),)*
        }

        impl JointModel for Joint {
            fn nv(&self) -> usize {
                match self { $(Self::$joint(own) => own.nv(),)* }
            }

            #[inline(always)]
            fn n_motions(&self) -> usize {
                match self { $(Self::$joint(own) => own.n_motions(),)* }
            }

            fn slides(&self) -> bool {
                match self { $(Self::$joint(own) => own.slides(),)* }
            }

            fn turning(&self) -> Option<f64> {
                match self { $(Self::$joint(own) => own.turning(),)* }
            }

            fn coordinate(&self) -> Option<usize> {
                match self { $(Self::$joint(own) => own.coordinate(),)* }
            }

            fn axis(&self) -> Option<&JointAxis> {
                match self { $(Self::$joint(own) => own.axis(),)* }
            }

            fn angle(&self) -> Option<(usize, Option<Coupling>)> {
                match self { $(Self::$joint(own) => own.angle(),)* }
            }

            #[inline(always)]
            fn place<T: Lane>(
                &self,
                frame: &Mat3<T>,
                q: &impl JointCoordinates<T>,
                turn: impl FnOnce() -> Option<(T, T)>,
            ) -> JointPlacement<T> {
                match self { $(Self::$joint(own) => own.place(frame, q, turn),)* }
            }

            #[inline(always)]
            fn screws<T: Lane>(&self, frame: &Mat3<T>, set: impl FnMut(usize, Screw<T>)) {
                match self { $(Self::$joint(own) => own.screws(frame, set),)* }
            }

            #[inline(always)]
            fn screw<T: Lane>(&self, motion: &Motion<T>) -> Screw<T> {
                match self { $(Self::$joint(own) => own.screw(motion),)* }
            }

            #[inline(always)]
            fn combined(&self) -> Option<(usize, usize)> {
                match self { $(Self::$joint(own) => own.combined(),)* }
            }

            #[inline(always)]
            fn advance<T: Lane>(&self, q: &mut impl JointCoordinates<T>, v: &[T], h: T) {
                match self { $(Self::$joint(own) => own.advance(q, v, h),)* }
            }

            fn names(&self) -> &'static [&'static str] {
                match self { $(Self::$joint(own) => own.names(),)* }
            }

            fn first_angle(&self) -> Option<usize> {
                match self { $(Self::$joint(own) => own.first_angle(),)* }
            }

            fn set_public(
                &self,
                public: &[f64],
                turn: impl Fn([f64; 3]) -> [f64; 4],
                q: &mut impl JointCoordinates<f64>,
            ) {
                match self { $(Self::$joint(own) => own.set_public(public, turn, q),)* }
            }

            fn write_public(
                &self,
                q: &impl JointCoordinates<f64>,
                angles: impl Fn([f64; 4]) -> [f64; 3],
                public: &mut [f64],
            ) {
                match self { $(Self::$joint(own) => own.write_public(q, angles, public),)* }
            }
        }
    };
}

catalogue! {
    /// Six degrees of freedom; roots only.
    Free,
    /// No degree of freedom; roots only, since a solid fixed to another body is merged with it.
    Fixed,
    /// Rotation about an axis.
    Revolute,
    /// Translation along an axis.
    Prismatic,
    /// Any rotation about a point.
    Spherical,
    /// In proportion to another joint.
    Coupled,
}

impl Joint {
    /// The coupling of a joint that follows another.
    #[inline]
    #[must_use]
    pub fn coupling(&self) -> Option<&Coupling> {
        match self {
            Self::Coupled(own) => Some(&own.coupling),
            _ => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{Matrix3, Rotation3, Vector3};

    use super::joint_model::advanced;
    use super::*;
    use crate::scalar::Vec3;
    use crate::scalar::elementary::sin_cos;
    use crate::spatial::quaternion;

    /// A machine with one joint of each kind.
    struct Coordinates {
        number: f64,
        rotation: [f64; 4],
        pose: (Vec3<f64>, [f64; 4]),
    }

    impl JointCoordinates<f64> for Coordinates {
        fn number_at(&self, _joint: usize) -> f64 {
            self.number
        }

        fn rotation_at(&self, _index: usize) -> [f64; 4] {
            self.rotation
        }

        fn set_rotation_at(&mut self, _index: usize, rotation: [f64; 4]) {
            self.rotation = rotation;
        }

        fn pose_at(&self, _index: usize) -> (Vec3<f64>, [f64; 4]) {
            self.pose
        }

        fn set_pose_at(&mut self, _index: usize, pose: (Vec3<f64>, [f64; 4])) {
            self.pose = pose;
        }
    }

    fn turn(a: f64, b: f64, c: f64) -> [f64; 4] {
        quaternion::exp_rotation(Vec3::new(a, b, c))
    }

    fn joints() -> Vec<Joint> {
        let axis = JointAxis::from_direction(&Vector3::new(0.3, -0.8, 0.5)).unwrap();
        let coordinate = 0;
        let (revolute, prismatic) = (
            Revolute { axis, coordinate },
            Prismatic { axis, coordinate },
        );
        let coupling = Coupling {
            ratio: -0.7,
            offset: 0.2,
            combined: None,
        };
        let coupled = |moves| Joint::Coupled(Coupled { moves, coupling });
        vec![
            Joint::Fixed(Fixed),
            Joint::Revolute(revolute),
            Joint::Prismatic(prismatic),
            Joint::Spherical(Spherical { rotation: 0 }),
            coupled(SingleJoint::Revolute(revolute)),
            coupled(SingleJoint::Prismatic(prismatic)),
        ]
    }

    /// Attitude and place of the body that a joint carries, with the machine moved by `h` at the
    /// velocity `v` of the joint.
    fn placed(joint: &Joint, frame: &Mat3<f64>, v: &[f64], h: f64) -> (Matrix3<f64>, Vector3<f64>) {
        let mut q = Coordinates {
            number: advanced(0.4, v.first().copied().unwrap_or(0.0), h),
            rotation: turn(0.1, -0.6, 0.4),
            pose: (Vec3::new(1.0, 2.0, 3.0), turn(0.5, 0.2, -0.3)),
        };
        joint.advance(&mut q, v, h);
        let angle = joint.angle().map(|(_, coupling)| {
            let angle = coupling.map_or(q.number, |coupling| coupling.value(q.number));
            sin_cos(angle)
        });
        let JointPlacement { R, shift } = joint.place(frame, &q, || angle);
        (R.into(), shift.map_or(Vector3::zeros(), Vector3::from))
    }

    #[test]
    fn every_screw_is_the_rate_of_the_placement() {
        let frame = Mat3::from(*Rotation3::from_euler_angles(0.2, -0.5, 1.1).matrix());
        for joint in joints() {
            let n = joint.n_motions();
            let mut screws = vec![Screw::NONE; n];
            joint.screws(&frame, |k, screw| screws[k] = screw);
            for k in 0..n {
                let mut v = vec![0.0; n];
                v[k] = 1.0;
                let h = 1e-5;
                let (before, after) = (
                    placed(&joint, &frame, &v, -h),
                    placed(&joint, &frame, &v, h),
                );
                let (R, _) = placed(&joint, &frame, &v, 0.0);
                let spin = (after.0 - before.0) / (2.0 * h) * R.transpose();
                let slide = (after.1 - before.1) / (2.0 * h);
                let own = |part: Option<Vec3<f64>>| part.map_or(Vector3::zeros(), Vector3::from);
                let turning = own(screws[k].turning).cross_matrix();
                assert!((spin - turning).norm() < 1e-9, "{joint:?}");
                assert!((slide - own(screws[k].sliding)).norm() < 1e-9, "{joint:?}");
                // The motion about another origin gives the screw back.
                let r = Vec3::new(0.3, -1.2, 0.7);
                let motion = screws[k].motion(r);
                let again = joint.screw(&motion);
                assert!((own(again.turning) - own(screws[k].turning)).norm() < 1e-15);
                assert!((own(again.sliding) - own(screws[k].sliding)).norm() < 1e-15);
                let at_body = Vector3::from(motion.velocity_at(r));
                assert!(
                    (at_body - own(screws[k].sliding)).norm() < 1e-15,
                    "{joint:?}"
                );
            }
        }
    }

    #[test]
    fn public_coordinates_come_back() {
        let joints = [
            Joint::Free(Free { pose: 0 }),
            Joint::Spherical(Spherical { rotation: 0 }),
        ];
        for joint in joints {
            let public: Vec<f64> = (0..joint.nv()).map(|k| 0.1 + 0.2 * k as f64).collect();
            let mut q = Coordinates {
                number: 0.0,
                rotation: turn(0.0, 0.0, 0.0),
                pose: (Vec3::new(0.0, 0.0, 0.0), turn(0.0, 0.0, 0.0)),
            };
            joint.set_public(&public, |[x, y, z]| [x, y, z, 1.0], &mut q);
            let mut again = vec![0.0; joint.nv()];
            joint.write_public(&q, |[x, y, z, _]| [x, y, z], &mut again);
            assert_eq!(public, again);
            assert_eq!(joint.names().len(), joint.nv());
        }
    }
}
