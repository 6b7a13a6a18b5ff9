//! A wheel in sand over lanes: its place on a tree, its pose, and what the sand remembers of it.
#![allow(clippy::inline_always)] // a call leaves the instructions that its caller is compiled for

use nalgebra::Vector3;

use super::six::{self, SIX, Six};
use crate::sand::{Memory, WheelInSand, WheelPose};
use crate::scalar::{Lane, Vec3};

/// [`WheelPose`] over lanes.
#[derive(Clone, Copy, Debug)]
pub(super) struct LanePose<T> {
    /// World, m.
    pub centre: Vec3<T>,
    /// Unit vector.
    pub axle: Vec3<T>,
}

impl<T: Lane> LanePose<T> {
    /// Somewhere.
    pub(super) fn new(token: T::Token) -> Self {
        Self {
            centre: Vec3::splat(token, [0.0; 3]),
            axle: Vec3::splat(token, [0.0, 0.0, 1.0]),
        }
    }

    /// After a time with a twist, to first order.
    #[inline(always)]
    pub(super) fn moved(&self, twist: &Six<T>, time: f64) -> Self {
        let time = twist[0].like(time);
        let axle = self.axle + six::angular(twist).cross(self.axle) * time;
        Self {
            centre: self.centre + six::linear(twist) * time,
            axle: axle * (time.like(1.0) / axle.norm()),
        }
    }

    /// Pose of the wheel in a lane.
    #[inline(always)]
    pub(super) fn get(&self, lane: usize) -> WheelPose {
        WheelPose {
            centre: Vector3::from(self.centre.get(lane)),
            axle: Vector3::from(self.axle.get(lane)),
        }
    }

    /// Centre and axle.
    #[inline(always)]
    pub(super) fn numbers(&self) -> Six<T> {
        six::join(self.centre, self.axle)
    }
}

/// [`WheelInSand`] over lanes.
#[derive(Clone, Copy, Debug)]
pub(super) struct LaneWheel<T> {
    /// Shift and turn.
    pub memory: Six<T>,
    pub stored: T,
    pub absorbed: T,
    /// Force and moment.
    pub wrench: Six<T>,
    pub velocity: Vec3<T>,
    pub sinkage: T,
    pub noted: Six<T>,
}

impl<T: Lane> LaneWheel<T> {
    /// Untouched sand.
    pub(super) fn new(token: T::Token) -> Self {
        let zero = T::splat(token, 0.0);
        Self {
            memory: [zero; SIX],
            stored: zero,
            absorbed: zero,
            wrench: [zero; SIX],
            velocity: Vec3::new(zero, zero, zero),
            sinkage: zero,
            noted: [zero; SIX],
        }
    }

    /// Gives a lane the sand at a wheel.
    pub(super) fn set(&mut self, lane: usize, own: &WheelInSand) {
        six::set(&mut self.memory, lane, &own.memory.six());
        self.stored.set(lane, own.stored);
        self.absorbed.set(lane, own.absorbed);
        let ([a, b, c], [d, e, f]) = (own.force, own.moment);
        six::set(&mut self.wrench, lane, &[a, b, c, d, e, f].into());
        self.velocity.set(lane, own.velocity);
        self.sinkage.set(lane, own.sinkage);
        six::set(&mut self.noted, lane, &own.noted.into());
    }

    /// The sand at the wheel of a lane.
    pub(super) fn get(&self, lane: usize) -> WheelInSand {
        let wrench = six::get(&self.wrench, lane);
        let halves = [0, 3].map(|k| [wrench[k], wrench[k + 1], wrench[k + 2]]);
        WheelInSand {
            memory: Memory::of(&six::get(&self.memory, lane)),
            stored: self.stored.get(lane),
            absorbed: self.absorbed.get(lane),
            force: halves[0],
            moment: halves[1],
            velocity: self.velocity.get(lane),
            sinkage: self.sinkage.get(lane),
            noted: six::get(&self.noted, lane).into(),
        }
    }

    /// `yes` where the mask is true, `no` elsewhere.
    #[inline(always)]
    pub(super) fn select(mask: T::Mask, yes: &Self, no: &Self) -> Self {
        Self {
            memory: six::select(mask, &yes.memory, &no.memory),
            stored: T::select(mask, yes.stored, no.stored),
            absorbed: T::select(mask, yes.absorbed, no.absorbed),
            wrench: six::select(mask, &yes.wrench, &no.wrench),
            velocity: Vec3::select(mask, yes.velocity, no.velocity),
            sinkage: T::select(mask, yes.sinkage, no.sinkage),
            noted: six::select(mask, &yes.noted, &no.noted),
        }
    }
}
