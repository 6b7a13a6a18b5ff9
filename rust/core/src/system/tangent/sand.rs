//! Wheels in sand in a pass: their forces, and what the sand remembers of them.

use super::held_sand::{HeldSand, HeldWheel, OF_WHEEL, REST};
use super::held_tree::TangentScene;
use super::pass::along;
use super::scratch::Tangent;
use crate::multibody::Mechanism;
use crate::sand::memory::{after_way, rate};
use crate::scalar::{Dual, Lane, Vec3};
use crate::system::sand_tangent::TwistMap;
use crate::system::sand_wheel::{LanePose, PlacedWheel};
use crate::system::six::{self, SIX, Six};

/// A wheel with its derivatives.
pub(super) struct VaryingWheel<T: Lane> {
    wheel: PlacedWheel,
    map: TwistMap<Dual<T>>,
    pose: LanePose<Dual<T>>,
    /// What it begins with: memory and energy of the sand.
    pub memory: Six<Dual<T>>,
    pub stored: Dual<T>,
    /// Derivative of its wrench by what varies of the soil.
    pub by_soil: Six<T>,
    wrench: Six<Dual<T>>,
    /// Memory and energy at the end.
    end: Six<Dual<T>>,
    left: Dual<T>,
}

/// The wheels of a machine in sand.
pub(super) struct VaryingSand<T: Lane> {
    pub wheels: Vec<VaryingWheel<T>>,
    /// Length over which the sand forgets, m.
    pub length: Dual<T>,
    /// Changes of the wrenches by those of the velocity at the end (6 n), and of that velocity (nv).
    changes: Vec<T>,
    dv: Vec<T>,
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
            dv: vec![zero.slope; mechanism.nv()],
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
    fn recalled(&self, twist: &Six<Dual<T>>, (h, length): (Dual<T>, Dual<T>)) -> Six<Dual<T>> {
        let drum = self.wheel.shape.drum();
        let way = rate(twist, drum);
        // At rest the way has a corner, and its mean slope is none.
        let way = Dual::select(way.like(REST).lt(way), way, Dual::constant(way.value));
        after_way(&self.memory, twist, way, (h, length)).0
    }

    /// The wrench with its derivative at a held velocity.
    #[inline(always)]
    fn press(&mut self, held: &HeldWheel, twist: &Six<Dual<T>>, end: &Six<Dual<T>>, lag: f64) {
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

impl<T: Lane> Tangent<T> {
    /// `y += h Jᵀ F`, with the derivative at a held velocity at the end of the step.
    #[inline(always)]
    pub(super) fn push_sand(&mut self, scene: &TangentScene<'_>) {
        let (Some(sand), Some(held)) = (&mut self.sand, &scene.held.sand) else {
            return;
        };
        let h = scene.options.time_step;
        for (own, v) in self.v_end.iter_mut().zip(&held.v_end) {
            *own = Dual::splat(self.token, *v);
        }
        for (own, held) in sand.wheels.iter_mut().zip(&held.wheels) {
            own.pose = own.map.place(&own.wheel, &self.poses_middle);
            let twist = own.map.twist(&self.v_end);
            let end = own.recalled(&twist, (sand.length.like(h), sand.length));
            own.press(held, &twist, &end, scene.options.theta * h);
            own.map.add_impulse(&own.wrench, h, &mut self.y);
        }
    }

    /// Adds to `y` and to the wrenches what follows from the change of the velocity at the end, which
    /// is known with wrenches at a held velocity. False on firm ground.
    #[inline(always)]
    pub(super) fn yield_sand(&mut self, scene: &TangentScene<'_>) -> bool {
        let (Some(sand), Some(held)) = (&mut self.sand, &scene.held.sand) else {
            return false;
        };
        for (own, v) in sand.dv.iter_mut().zip(&self.v_end) {
            *own = v.slope;
        }
        let zero = sand.length.slope.like(0.0);
        sand.changes.clear();
        for row in held.feedback.chunks_exact(sand.dv.len()) {
            sand.changes.push(along(row, &sand.dv, zero));
        }
        let changes = sand.changes.chunks_exact(SIX);
        for (wheel, changes) in sand.wheels.iter_mut().zip(changes) {
            for (own, change) in wheel.wrench.iter_mut().zip(changes) {
                own.slope += *change;
            }
        }
        let rows = held.response.chunks_exact(sand.changes.len());
        for (y, row) in self.y.iter_mut().zip(rows) {
            y.slope = along(row, &sand.changes, y.slope);
        }
        true
    }

    /// What the sand remembers at the end of the step.
    #[inline(always)]
    pub(super) fn recall_sand(&mut self, scene: &TangentScene<'_>) {
        let (Some(sand), Some(held)) = (&mut self.sand, &scene.held.sand) else {
            return;
        };
        let (length, zero) = (sand.length, sand.length.like(0.0));
        let (h, theta) = (
            zero.like(scene.options.time_step),
            zero.like(scene.options.theta),
        );
        for (own, held) in sand.wheels.iter_mut().zip(&held.wheels) {
            let twist = own.map.twist(&self.v_end);
            let end = own.recalled(&twist, (h, length));
            own.end = end.map(|x| x * zero.like(held.kept));
            own.left = zero;
            if held.is_touching {
                let before = own.map.twist(&self.v).map(|x| x * (zero.like(1.0) - theta));
                let mean = six::plus(&before, theta, &twist);
                let wanted = h * six::dot(&own.wrench, &mean);
                let given = wanted.min(own.stored);
                let force = six::linear(&own.wrench).norm();
                let force = Dual::select(zero.lt(force), force, zero);
                own.left = (own.stored - given).min(length * force);
            }
        }
    }

    /// Number of entries of the state of the sand.
    pub(super) fn n_of_sand(scene: &TangentScene<'_>) -> usize {
        let wheels = scene.held.sand.as_ref().map_or(0, |held| held.wheels.len());
        OF_WHEEL * wheels
    }
}
