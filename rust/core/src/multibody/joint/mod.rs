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
//! Each velocity has a [motion](crate::multibody::Motion): the screw that a unit of it imparts to everything the joint
//! carries.
//!
//! Source: Featherstone 2008, *Rigid Body Dynamics Algorithms*, ch. 4; Carpentier et al. 2019, *The
//! Pinocchio C++ library*, for the joints as types with their own numbers of coordinates and
//! velocities.

pub mod axis;
pub mod coordinate;
pub mod coupled;
pub mod fixed;
pub mod free;
pub mod prismatic;
pub mod revolute;
pub mod spherical;

pub use axis::JointAxis;
pub use coordinate::Coordinate;
pub use coupled::Coupling;
pub use free::{Free, Pose};
pub use prismatic::Prismatic;
pub use revolute::Revolute;
pub use spherical::Spherical;

/// The joint of a body.
#[derive(Clone, Debug, PartialEq)]
pub enum Joint {
    /// Six degrees of freedom; roots only.
    Free(Free),
    /// No degree of freedom; roots only, since a solid fixed to another body is merged with it.
    Fixed,
    /// Rotation about an axis.
    Revolute(Revolute),
    /// Translation along an axis.
    Prismatic(Prismatic),
    /// Any rotation about a point.
    Spherical(Spherical),
}

impl Joint {
    /// Number of its own velocities; 0 for a coupled joint.
    #[must_use]
    pub fn nv(&self) -> usize {
        match self {
            Self::Free(_) => free::NV,
            Self::Fixed => 0,
            Self::Revolute(Revolute { coordinate, .. })
            | Self::Prismatic(Prismatic { coordinate, .. }) => coordinate.nv(),
            Self::Spherical(_) => spherical::NV,
        }
    }

    /// Number of motions: one per velocity, not counting those of a free base, and one for a
    /// coupled joint.
    #[must_use]
    pub fn n_motions(&self) -> usize {
        match self {
            Self::Free(_) | Self::Fixed => 0,
            Self::Revolute(_) | Self::Prismatic(_) => 1,
            Self::Spherical(_) => spherical::NV,
        }
    }

    /// Axis of a revolute or a prismatic joint.
    #[must_use]
    pub fn axis(&self) -> Option<&JointAxis> {
        match self {
            Self::Revolute(Revolute { axis, .. }) | Self::Prismatic(Prismatic { axis, .. }) => {
                Some(axis)
            }
            Self::Free(_) | Self::Fixed | Self::Spherical(_) => None,
        }
    }

    /// The coordinate of a revolute or a prismatic joint.
    #[inline]
    #[must_use]
    pub fn coordinate(&self) -> Option<&Coordinate> {
        match self {
            Self::Revolute(Revolute { coordinate, .. })
            | Self::Prismatic(Prismatic { coordinate, .. }) => Some(coordinate),
            Self::Free(_) | Self::Fixed | Self::Spherical(_) => None,
        }
    }

    /// The coupling of a joint that follows another.
    #[inline]
    #[must_use]
    pub fn coupling(&self) -> Option<&Coupling> {
        self.coordinate().and_then(|c| c.coupling.as_ref())
    }
}
