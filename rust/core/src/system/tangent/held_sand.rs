//! The sand of a step that was taken with given forces: the forces at its end, and how they change.
//!
//! A step with the forces F on its wheels ends with the twists x(F) of these wheels. Those of the
//! step are the solution of
//!
//! ```text
//! F = f(x(F), m, θ),        (1 − D R) dF = df       D = ∂f/∂x,  R = ∂x/∂F
//! ```
//!
//! with the memories m of the wheels and the numbers θ of the soil. R contains the loops and the
//! contacts in their modes. Derivatives of f are central differences of the force of one wheel, in
//! its pose and its memory at the end of the step: points move with the arc in the sand and with
//! the memory, so no closed form of a point's stress has them all.

use nalgebra::{DMatrix, DVector, Dyn, LU, Matrix6, Vector3, Vector6};
use std::sync::Arc;

use crate::contact::Contact;
use crate::integrator::held_step::HeldStep;
use crate::integrator::{Dynamics, MechanicalSystem, StepOptions};
use crate::sand::memory::rate;
use crate::sand::{Derivatives, Memory, Soil, WheelPose, WheelTwist};
use crate::system::sand::SandContact;
use crate::system::sand_patch::{LaneGround, SandPatch, SandStep};
use crate::system::six::{self, SIX, Six};
use crate::system::{TreeScratch, TreeSystem};

/// Changes of differences: of places, m, and of angles and the numbers of a memory.
const PLACE: f64 = 3e-7;
const NUMBER: f64 = 1e-6;

/// Change of a number of a soil, relative to it or, if it is zero, to its size.
const RELATIVE: f64 = 3e-5;

/// Speed relative to the sand, m/s, below which a wheel is at rest.
pub(super) const REST: f64 = 1e-10;

/// Numbers of the memory and the energy of the sand at a wheel.
pub(crate) const OF_WHEEL: usize = SIX + 1;

/// The wheels of a step in sand.
#[derive(Clone, Debug)]
pub(crate) struct HeldSand {
    pub(super) wheels: Vec<HeldWheel>,
    /// Velocity (nv) at which the forces are taken: that at the end of the step.
    pub(super) v_end: Vec<f64>,
    /// Length over which the sand forgets, m.
    pub(super) length: f64,
    /// `M̂⁻¹ h Jᵀ` (nv, 6 n), row-major.
    pub(super) response: Vec<f64>,
    /// `(1 − D R)⁻¹ D J` (6 n, nv), row-major.
    pub(super) feedback: Vec<f64>,
    gain: LU<f64, Dyn, Dyn>,
}

/// A wheel at the end of a step in sand.
#[derive(Clone, Debug)]
pub(super) struct HeldWheel {
    /// Memory and energy of the sand at the start of the step.
    pub memory: Six<f64>,
    pub stored: f64,
    pub wrench: Six<f64>,
    pub is_touching: bool,
    /// Part of its memory that the sand keeps.
    pub kept: f64,
    /// Derivatives of the wrench by translations and rotations of the wheel, by the numbers of its
    /// memory, and by those of the soil that were asked for.
    pub by_pose: [Six<f64>; SIX],
    pub by_memory: [Six<f64>; SIX],
    pub by_soil: Vec<Six<f64>>,
}

/// Difference of the force at the end of a step from the one that was given to a wheel.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SandError {
    pub residual: Vector6<f64>,
    /// Size of the wrench at the end, N, with moments at the wheel's radius.
    pub size: f64,
    pub is_touching: bool,
}

impl TreeScratch {
    /// Gives the next steps the forces of the sand, see [`SandContact::give`]. Wheels leave no
    /// ruts.
    pub(crate) fn give_sand(&mut self, wrenches: Option<&[Option<Vector6<f64>>]>) {
        self.tree.give_sand(0, wrenches);
    }

    /// Whether each wheel touched the sand in the last step, and whether that had nothing left to
    /// give.
    pub(crate) fn modes_of_sand(&self) -> Vec<[bool; 2]> {
        let modes = |sand: &SandContact<f64>| -> Vec<[bool; 2]> {
            let patches = sand.patches.iter();
            (patches.map(|patch| [patch.force.is_touching, patch.is_empty])).collect()
        };
        self.tree.sand().map(modes).unwrap_or_default()
    }
}

impl TreeSystem<'_> {
    /// How far the given forces of the step that was just taken are from those at its end, wheel by
    /// wheel. The system was loaded with the sand as it was before the step.
    pub(crate) fn sand_errors(&self) -> Vec<SandError> {
        let tree = &self.parts.tree;
        let (Some(sand), scene) = (tree.sand(), tree.sand_scene()) else {
            return Vec::new();
        };
        let ground = scene.ground(0);
        let errors = sand.patches.iter().filter_map(|patch| {
            let probe = Probe::new(patch, &sand.step, ground.as_ref()?, &sand.guess);
            let found = probe.wrench(&probe.pose, &probe.memory);
            let given = six::get(&patch.force.force, 0);
            let arm = patch.wheel.shape.radius;
            Some(SandError {
                residual: found.unwrap_or_default() - given,
                size: found.map_or(0.0, |wrench| six::size::<f64>(&wrench.into(), arm)),
                is_touching: found.is_some(),
            })
        });
        errors.collect()
    }

    /// The sand of that step; none on firm ground. `numbers`: indices of numbers of the soil.
    pub(crate) fn hold_sand(
        &self,
        options: &StepOptions,
        step: &HeldStep<Contact>,
        numbers: &[usize],
    ) -> Option<HeldSand> {
        let (sand, scene) = (self.parts.tree.sand()?, self.parts.tree.sand_scene());
        let ground = scene.ground(0)?;
        let (v_end, length) = (sand.guess.clone(), sand.step.length);
        let held = sand.patches.iter().map(|patch| {
            let probe = Probe::new(patch, &sand.step, &ground, &v_end);
            let kept = match (patch.force.is_touching, patch.is_empty) {
                (true, is_empty) => SandContact::<f64>::part_kept(is_empty),
                (false, _) => f64::from(u8::from(patch.sinkage(&scene.layers, true) > 0.0)),
            };
            probe.hold(kept, numbers)
        });
        let (wheels, slopes): (Vec<HeldWheel>, Vec<[Six<f64>; SIX]>) = held.unzip();
        let (nv, n) = (self.model.nv(), wheels.len());
        let mut response = vec![0.0; nv * SIX * n];
        let mut matrix = DMatrix::identity(SIX * n, SIX * n);
        let mut feedback = DMatrix::zeros(SIX * n, nv);
        for column in 0..SIX * n {
            let [plain, whole] = self.push_wheel(options, step, (column / SIX, column % SIX));
            for (row, x) in response.chunks_exact_mut(SIX * n).zip(plain) {
                row[column] = x;
            }
            for (w, slope) in slopes.iter().enumerate() {
                let pushed = six::times::<f64>(slope, &self.twist_of(w, &whole));
                for (k, x) in pushed.into_iter().enumerate() {
                    matrix[(SIX * w + k, column)] -= x;
                }
            }
        }
        let mut unit = vec![0.0; nv];
        for k in 0..nv {
            unit[k] = 1.0;
            for (w, slope) in slopes.iter().enumerate() {
                let pushed = six::times::<f64>(slope, &self.twist_of(w, &unit));
                for (i, x) in pushed.into_iter().enumerate() {
                    feedback[(SIX * w + i, k)] = x;
                }
            }
            unit[k] = 0.0;
        }
        let gain = matrix.lu();
        gain.solve_mut(&mut feedback).then_some(())?;
        Some(HeldSand {
            wheels,
            v_end,
            length,
            response,
            feedback: feedback.transpose().as_slice().to_vec(),
            gain,
        })
    }

    fn twist_of(&self, wheel: usize, v: &[f64]) -> Six<f64> {
        let sand = self.parts.tree.sand();
        sand.map_or([0.0; SIX], |sand| sand.patches[wheel].map.twist(v))
    }

    /// Change of the velocity (nv) by a unit of one component of the force on a wheel over the
    /// step: with held impulses of the contacts, and with contacts that keep their modes.
    fn push_wheel(
        &self,
        options: &StepOptions,
        step: &HeldStep<Contact>,
        (wheel, component): (usize, usize),
    ) -> [Vec<f64>; 2] {
        let mut unit = [0.0; SIX];
        unit[component] = 1.0;
        let mut y = vec![0.0; self.model.nv()];
        if let Some(sand) = self.parts.tree.sand() {
            (sand.patches[wheel].map).add_impulse(&unit, options.time_step, &mut y);
        }
        self.machine().half_solve(&mut y);
        if let Some(loops) = &self.parts.tree.loops {
            loops.restrict(&mut y);
        }
        let mut du = vec![0.0; step.law.p.len()];
        self.local(&y, &mut du);
        self.machine().half_solve_back(&mut y);
        let sum = |row: &[f64], x: &[f64]| row.iter().zip(x).map(|(a, x)| a * x).sum::<f64>();
        let dp: Vec<f64> = step.answer.rows().map(|(row, _)| sum(row, &du)).collect();
        let mut whole = y.clone();
        if !dp.is_empty() {
            for (x, row) in whole.iter_mut().zip(step.response.chunks_exact(dp.len())) {
                *x += sum(row, &dp);
            }
        }
        [y, whole]
    }
}

impl HeldSand {
    /// Changes of the forces that make up for these errors, to first order.
    pub(crate) fn corrections(&self, errors: &[SandError]) -> Option<Vec<Vector6<f64>>> {
        let numbers = errors
            .iter()
            .flat_map(|error| error.residual.iter().copied());
        let right = DVector::from_iterator(SIX * errors.len(), numbers);
        let found = self.gain.solve(&right)?;
        let wrenches = found.as_slice().chunks_exact(SIX);
        Some(wrenches.map(Vector6::from_column_slice).collect())
    }
}

/// The force on a wheel in poses and with memories near those at the end of a step.
struct Probe<'a> {
    patch: &'a SandPatch<f64>,
    step: &'a SandStep<f64>,
    ground: &'a LaneGround<'a>,
    twist: Vector6<f64>,
    pose: WheelPose,
    memory: Memory,
}

impl<'a> Probe<'a> {
    fn new(
        patch: &'a SandPatch<f64>,
        step: &'a SandStep<f64>,
        ground: &'a LaneGround<'a>,
        v_end: &[f64],
    ) -> Self {
        let twist = Vector6::from(patch.map.twist(v_end));
        let (pose, memory, _) = patch.ended(step, 0, &twist);
        Self {
            patch,
            step,
            ground,
            twist,
            pose,
            memory,
        }
    }

    /// None where the wheel does not touch the sand.
    fn wrench(&self, pose: &WheelPose, memory: &Memory) -> Option<Vector6<f64>> {
        self.wrench_in(self.ground, pose, memory)
    }

    fn wrench_in(
        &self,
        ground: &LaneGround<'_>,
        pose: &WheelPose,
        memory: &Memory,
    ) -> Option<Vector6<f64>> {
        let gravity = Vector3::from(self.step.gravity.get(0));
        let found = (self.patch).react(0, (ground, &gravity), pose, memory, Derivatives::Wrench);
        found
            .filter(|found| found.is_touching)
            .map(|found| found.wrench)
    }

    /// The wheel with its derivatives, and that of its wrench by the twist at the end of the step.
    fn hold(&self, kept: f64, numbers: &[usize]) -> (HeldWheel, [Six<f64>; SIX]) {
        let none = [[0.0; SIX]; SIX];
        let begin = &self.patch.begin;
        let mut held = HeldWheel {
            memory: begin.memory,
            stored: begin.stored,
            wrench: self.patch.force.force,
            is_touching: self.patch.force.is_touching,
            kept,
            by_pose: none,
            by_memory: none,
            by_soil: vec![[0.0; SIX]; numbers.len()],
        };
        if self.wrench(&self.pose, &self.memory).is_none() {
            return (held, none);
        }
        for k in 0..SIX {
            held.by_pose[k] = self.by_pose(k);
            held.by_memory[k] = self.by_memory(k);
        }
        for (column, number) in held.by_soil.iter_mut().zip(numbers) {
            *column = self.by_soil(*number);
        }
        let slope = self.by_twist(&held);
        (held, slope)
    }

    fn by_pose(&self, k: usize) -> Six<f64> {
        let e = Vector3::ith(k % 3, 1.0);
        let moved = |sign: f64| {
            let mut pose = self.pose;
            if k < 3 {
                pose.centre += e * (sign * PLACE);
            } else {
                let axle = pose.axle + e.cross(&pose.axle) * (sign * NUMBER);
                pose.axle = axle / axle.norm();
            }
            pose
        };
        let poses = [moved(1.0), moved(-1.0)];
        let width = if k < 3 {
            (poses[0].centre - poses[1].centre)[k]
        } else {
            2.0 * NUMBER
        };
        difference(poses.map(|pose| self.wrench(&pose, &self.memory)), width)
    }

    fn by_memory(&self, k: usize) -> Six<f64> {
        let change = if k < 3 {
            NUMBER
        } else {
            NUMBER / self.patch.wheel.shape.drum()
        };
        let moved = [1.0, -1.0].map(|sign| {
            let mut six = self.memory.six();
            six[k] += sign * change;
            six
        });
        let width = moved[0][k] - moved[1][k];
        difference(
            moved.map(|six| self.wrench(&self.pose, &Memory::of(&six))),
            width,
        )
    }

    fn by_soil(&self, number: usize) -> Six<f64> {
        let soil: &Soil = self.ground.layer.soil;
        let mut width = 0.0;
        let wrenches = [1.0, -1.0].map(|sign| {
            let mut other = soil.clone();
            if let Some((name, value)) = other.numbers_mut().into_iter().nth(number) {
                let before = *value;
                *value += sign * RELATIVE * size_of(name, before);
                width += sign * *value;
            }
            let mut ground = *self.ground;
            let other = Arc::new(other);
            ground.layer.soil = &other;
            self.wrench_in(&ground, &self.pose, &self.memory)
        });
        difference(wrenches, width)
    }

    /// Derivative of the wrench by the twist, by columns.
    fn by_twist(&self, held: &HeldWheel) -> [Six<f64>; SIX] {
        let (h, length) = (self.step.h, self.step.length);
        let lag = self.step.theta * h;
        let begin = Memory::of(&Vector6::from(self.patch.begin.memory));
        let drum = self.patch.wheel.shape.drum();
        let mut recalled = begin.after(&WheelTwist::of(&self.twist), drum, (h, length));
        if rate(&self.twist.into(), drum) <= REST {
            recalled.slope = Matrix6::from_diagonal_element(recalled.fresh);
        }
        // The axle turns by `lag ω × axle` and is then made a unit vector.
        let before = self.patch.pose.get(0).axle;
        let long =
            (before + Vector3::from(self.twist.fixed_rows::<3>(3)).cross(&before) * lag).norm();
        std::array::from_fn(|k| {
            let mut pose = [0.0; SIX];
            if k < 3 {
                pose[k] = lag;
            } else {
                let moved = Vector3::ith(k - 3, 1.0).cross(&before) * (lag / long);
                let turn = self.pose.axle.cross(&moved);
                pose[3..].copy_from_slice(turn.as_slice());
            }
            let memory = recalled.slope.column(k).into_owned();
            let of_memory = six::times::<f64>(&held.by_memory, &memory.into());
            six::plus(&six::times::<f64>(&held.by_pose, &pose), 1.0, &of_memory)
        })
    }
}

/// Size of the changes of a number of a soil.
fn size_of(name: &str, value: f64) -> f64 {
    match (value == 0.0, name) {
        (true, "cohesion" | "cohesive_modulus") => 1e3,
        (true, _) => 1.0,
        (false, _) => value.abs(),
    }
}

/// Quotient of the difference of two wrenches.
fn difference(wrenches: [Option<Vector6<f64>>; 2], width: f64) -> Six<f64> {
    let [above, below] = wrenches.map(Option::unwrap_or_default);
    ((above - below) / width).into()
}
