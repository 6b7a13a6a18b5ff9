//! Passes over a step, with as many directions as lanes.

use std::sync::Arc;

use super::direction::Direction;
use super::held_system::HeldSystem;
use super::held_tree::TangentScene;
use super::sand::n_of_sand;
use super::scratch::TangentPass;
use super::varying_sand::VaryingSand;
use crate::contact::placed_wheel::PlacedWheel;
use crate::integrator::NoProbe;
use crate::integrator::audit::note_energies;
use crate::integrator::held_step::SAME;
use crate::integrator::projection::set_gaps;
use crate::integrator::scheme::{Next, conclude, finish, prepare};
use crate::multibody::Configuration;
use crate::scalar::{Dual, Lane, LaneMask, inlined};

/// Relative difference of velocities that is rounding.
const ROUNDING: f64 = 1e-13;

impl<T: Lane> TangentPass<T> {
    /// Calls `take` with the number of each direction and its derivatives of the configuration's
    /// motion and of the velocity at the end (nv each), and of the state of the sand (7 n). False
    /// if the step is not the one that the held equations describe; `end` then is of no use.
    pub(crate) fn differentiate(
        &mut self,
        scene: &TangentScene<'_>,
        directions: &[Direction],
        end: &mut Configuration,
        mut take: impl FnMut(usize, &[f64], &[f64]),
    ) -> bool {
        let nv = scene.model.nv();
        self.load(scene);
        let mut columns = vec![vec![0.0; 2 * nv + n_of_sand(scene)]; T::LANES];
        let (mut motion, mut numbers) = (vec![T::splat(self.data.token, 0.0); nv], [0.0; 8]);
        for (group, directions) in directions.chunks(T::LANES).enumerate() {
            let mut off = self.pass(scene, directions);
            let may_be_corrected = scene.held.sand.is_none() && !self.parts.tree.is_audited;
            if group == 0 && may_be_corrected && off > ROUNDING {
                self.parts.tree.is_audited = true;
                off = self.pass(scene, directions);
            }
            if off.is_nan() || off > SAME {
                return false;
            }
            self.data.start.slope(scene.model.mechanism(), &mut motion);
            let slopes = self.data.v.iter().map(|v| v.slope);
            let of_sand = self.parts.sand.iter().flat_map(VaryingSand::ends);
            let all = motion.iter().copied().chain(slopes).chain(of_sand);
            for (k, slope) in all.enumerate() {
                slope.store(&mut numbers[..T::LANES]);
                for (column, x) in columns.iter_mut().zip(numbers) {
                    column[k] = x;
                }
            }
            for (lane, column) in columns[..directions.len()].iter().enumerate() {
                let (motion, velocity) = column.split_at(nv);
                take(group * T::LANES + lane, motion, velocity);
            }
        }
        self.data.start.to_lane(0, end);
        true
    }

    /// Takes the step with what varies in these directions. Returns how far its velocity is off
    /// that of the step, relative to the fastest, and infinity if it meets what the step did not.
    fn pass(&mut self, scene: &TangentScene<'_>, directions: &[Direction]) -> f64 {
        self.seed(scene, directions);
        let Self {
            parts,
            data: d,
            answers: [answer, displacement],
            ..
        } = self;
        let all = T::mask(d.token, u32::MAX >> (32 - T::LANES));
        (d.occupied, d.is_new) = (all, all);
        d.has_persistent.fill(T::mask(d.token, 0));
        for memory in &mut d.memories {
            memory.clear();
        }
        parts.is_other = false;
        let v_start = d.v.clone();
        let s = &mut HeldSystem { scene, own: parts };
        note_energies(s, d);
        prepare(s, d, answer, &mut NoProbe);
        let mut next = Next::Retake;
        while next == Next::Retake {
            next = conclude(s, d, answer, &mut NoProbe);
        }
        let is_deep = next == Next::Project;
        if is_deep {
            set_gaps(s, d, displacement);
        }
        finish(s, d, is_deep.then_some(displacement), &mut NoProbe);
        inlined!(T::vectorize, d.token, s.recall_sand([&v_start, &d.v]));
        let fastest = scene.v_end.iter().fold(1e-3_f64, |m, v| m.max(v.abs()));
        let off = d.v.iter().zip(scene.v_end);
        let off = off.fold(0.0_f64, |m, (own, v)| m.max((own.get(0) - v).abs()));
        if d.going.bits() == all.bits() && !s.own.is_other {
            off / fastest
        } else {
            f64::INFINITY
        }
    }

    /// The machine at the start of the step in all lanes, without anything that varies.
    fn load(&mut self, scene: &TangentScene<'_>) {
        for lane in 0..T::LANES {
            self.base.set_lane(lane, scene.start.configuration);
            (self.own_drives).set_lane(lane, scene.model.joints(), scene.command);
            let tree = &mut self.parts.tree;
            tree.models[lane] = Some(Arc::clone(scene.model));
            tree.wrenches[lane].clone_from(&scene.command.wrenches);
            tree.gravity.set(lane, scene.options.gravity.into());
        }
        self.own_drives.finish_loading();
        let (mechanism, token) = (scene.model.mechanism(), self.data.token);
        self.parts.tree.given.clear();
        // Most steps are not corrected: whether this one was shows at its end.
        self.parts.tree.is_audited = scene.held.step.projection.is_some();
        if scene.held.sand.is_some() {
            let wheels = scene.model.wheels().iter().map(PlacedWheel::of);
            let sand = &mut self.parts.sand;
            sand.get_or_insert_with(|| VaryingSand::new(token, mechanism, wheels));
            let given = &mut self.parts.tree.given;
            given.resize(mechanism.nv(), Dual::splat(token, 0.0));
            self.parts.tree.is_audited = false;
        }
        (self.parts.places).load(scene.model, &scene.held.step.contacts);
        self.data.options.clone_from(scene.options);
        self.data.most_turn = f64::INFINITY;
        self.reset_inertias(scene);
        self.varies_inertias = false;
    }
}
