//! Coupled joint: a revolute or prismatic joint that follows another one, `q = ratio q_other +
//! offset`, like the two rockers of a differential.
//!
//! It has no coordinate or velocity of its own. It is eliminated exactly: a unit of the other
//! joint's velocity moves everything the coupled joint carries by `ratio` times the coupled joint's
//! screw,
//! ```text
//! M = Gᵀ M_all G,        v_all = G v
//! ```
//!
//! where `M_all` is the mass matrix of the tree without the coupling. `M` keeps the sparsity of a
//! tree if both joints lie on one path or are mounted on the same body; other couplings are
//! rejected. Its limits are those of the joint that it follows.

use super::axis::JointAxis;
use super::coupling::Coupling;
use super::joint_model::{JointCoordinates, JointModel, JointPlacement};
use super::prismatic::Prismatic;
use super::revolute::Revolute;
use super::screw::{Motion, Screw};
use crate::scalar::{Lane, Mat3};

/// A joint that follows another.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Coupled {
    /// How it moves, with the coordinate that it follows.
    pub moves: SingleJoint,
    /// How it follows.
    pub coupling: Coupling,
}

/// A joint with one coordinate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SingleJoint {
    /// About an axis.
    Revolute(Revolute),
    /// Along an axis.
    Prismatic(Prismatic),
}

impl JointModel for Coupled {
    fn nv(&self) -> usize {
        0
    }

    #[inline(always)]
    fn n_motions(&self) -> usize {
        1
    }

    fn slides(&self) -> bool {
        matches!(self.moves, SingleJoint::Prismatic(_))
    }

    fn turning(&self) -> Option<f64> {
        match self.moves {
            SingleJoint::Revolute(_) => Some(self.coupling.ratio.abs()),
            SingleJoint::Prismatic(_) => None,
        }
    }

    fn coordinate(&self) -> Option<usize> {
        match self.moves {
            SingleJoint::Revolute(own) => own.coordinate(),
            SingleJoint::Prismatic(own) => own.coordinate(),
        }
    }

    fn axis(&self) -> Option<&JointAxis> {
        match &self.moves {
            SingleJoint::Revolute(own) => own.axis(),
            SingleJoint::Prismatic(own) => own.axis(),
        }
    }

    fn angle(&self) -> Option<(usize, Option<Coupling>)> {
        match self.moves {
            SingleJoint::Revolute(own) => Some((own.coordinate, Some(self.coupling))),
            SingleJoint::Prismatic(_) => None,
        }
    }

    #[inline(always)]
    fn place<T: Lane>(
        &self,
        frame: &Mat3<T>,
        q: &impl JointCoordinates<T>,
        turn: impl FnOnce() -> Option<(T, T)>,
    ) -> JointPlacement<T> {
        match &self.moves {
            SingleJoint::Revolute(own) => own.place(frame, q, turn),
            SingleJoint::Prismatic(own) => {
                let way = self.coupling.value(q.number_at(own.coordinate));
                own.displace(frame, way)
            }
        }
    }

    #[inline(always)]
    fn screws<T: Lane>(&self, frame: &Mat3<T>, mut set: impl FnMut(usize, Screw<T>)) {
        let ratio = frame.x.x.like(self.coupling.ratio);
        let scaled = |k: usize, screw: Screw<T>| set(k, screw.times(ratio));
        match &self.moves {
            SingleJoint::Revolute(own) => own.screws(frame, scaled),
            SingleJoint::Prismatic(own) => own.screws(frame, scaled),
        }
    }

    #[inline(always)]
    fn screw<T: Lane>(&self, motion: &Motion<T>) -> Screw<T> {
        match &self.moves {
            SingleJoint::Revolute(own) => own.screw(motion),
            SingleJoint::Prismatic(own) => own.screw(motion),
        }
    }

    #[inline(always)]
    fn combined(&self) -> Option<(usize, usize)> {
        self.coupling.combined
    }
}
