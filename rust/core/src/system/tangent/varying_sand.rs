//! Wheels in sand with their derivatives: their forces, and what the sand remembers of them.

use super::held_sand::{HeldSand, HeldWheel, REST};
use crate::contact::placed_wheel::PlacedWheel;
use crate::multibody::Mechanism;
use crate::sand::memory::{after_way, rate};
use crate::scalar::{Dual, Lane, Vec3};
use crate::system::sand_tangent::TwistMap;
use crate::system::sand_wheel::LanePose;
use crate::system::six::{self, SIX, Six};

/// A wheel with its derivatives.
pub(super) struct VaryingWheel<T: Lane> {
    pub wheel: PlacedWheel,
    pub map: TwistMap<Dual<T>>,
    pub pose: LanePose<Dual<T>>,
    /// Memory and energy of the sand at the start of the step.
    pub memory: Six<Dual<T>>,
    pub stored: Dual<T>,
    /// Derivative of its wrench by what varies of the soil.
    pub by_soil: Six<T>,
    pub wrench: Six<Dual<T>>,
    /// Memory and energy at the end.
    pub end: Six<Dual<T>>,
    pub left: Dual<T>,
}

/// The wheels of a machine in sand.
pub(super) struct VaryingSand<T: Lane> {
    pub wheels: Vec<VaryingWheel<T>>,
    /// Length over which the sand forgets, m.
    pub length: Dual<T>,
    /// Changes of the wrenches by those of the velocity at the end (6 n).
    pub changes: Vec<T>,
}

impl<T: Lane> VaryingSand<T> {
    pub(super) fn new(
        token: T::Token,
        mechanism: &Mechanism,
        wheels: impl Iterator<Item = PlacedWheel>,
    ) -> Self {
        let zero = Dual::splat(token, 0.0);
        let wheels = wheels.map(|wheel| VaryingWheel {
            map: TwistMap::new(token, mechanism, wheel.body),
            wheel,
            pose: LanePose::new(token),
            memory: [zero; SIX],
            stored: zero,
            by_soil: [zero.slope; SIX],
            wrench: [zero; SIX],
            end: [zero; SIX],
            left: zero,
        });
        Self {
            wheels: wheels.collect(),
            length: zero,
            changes: Vec::new(),
        }
    }

    /// Without anything that varies.
    pub(super) fn reset(&mut self, held: &HeldSand) {
        for (own, held) in self.wheels.iter_mut().zip(&held.wheels) {
            let number = |x: f64| own.stored.like(x);
            (own.memory, own.stored) = (held.memory.map(number), number(held.stored));
            own.by_soil = [own.stored.slope.like(0.0); SIX];
        }
        self.length = self.length.like(held.length);
    }

    /// Entries of the state at the end (7 n), wheel by wheel.
    pub(super) fn ends(&self) -> impl Iterator<Item = T> {
        (self.wheels.iter()).flat_map(|wheel| {
            let memory = wheel.end.into_iter().chain([wheel.left]);
            memory.map(|x| x.slope)
        })
    }
}

impl<T: Lane> VaryingWheel<T> {
    /// The memory after a step with a twist.
    #[inline(always)]
    pub(super) fn recalled(
        &self,
        twist: &Six<Dual<T>>,
        (h, length): (Dual<T>, Dual<T>),
    ) -> Six<Dual<T>> {
        let drum = self.wheel.shape.drum();
        let way = rate(twist, drum);
        // At rest the way has a corner, and its mean slope is none.
        let way = Dual::select(way.like(REST).lt(way), way, Dual::constant(way.value));
        after_way(&self.memory, twist, way, (h, length)).0
    }

    /// The wrench with its derivative at a held velocity.
    #[inline(always)]
    pub(super) fn press(
        &mut self,
        held: &HeldWheel,
        twist: &Six<Dual<T>>,
        end: &Six<Dual<T>>,
        lag: f64,
    ) {
        let pose = self.pose.moved(twist, lag);
        let slope = |v: Vec3<Dual<T>>| Vec3::new(v.x.slope, v.y.slope, v.z.slope);
        let value = |v: Vec3<Dual<T>>| Vec3::new(v.x.value, v.y.value, v.z.value);
        let turn = value(pose.axle).cross(slope(pose.axle));
        let moved = six::join(slope(pose.centre), turn);
        let mut sum = self.by_soil;
        for k in 0..SIX {
            let (by_pose, by_memory) = (&held.by_pose[k], &held.by_memory[k]);
            for (d, sum) in sum.iter_mut().enumerate() {
                *sum += moved[k] * moved[k].like(by_pose[d]);
                *sum += end[k].slope * moved[k].like(by_memory[d]);
            }
        }
        for ((own, x), slope) in self.wrench.iter_mut().zip(held.wrench).zip(sum) {
            *own = Dual::new(slope.like(x), slope);
        }
    }
}
