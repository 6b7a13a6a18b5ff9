//! The forces on trees in lanes, without those of contacts.

use super::TreeLanes;
use crate::integrator::{Forces, StartOf, StepOptions, Work};
use crate::multibody::LaneConfiguration;
use crate::multibody::bias::bias;
use crate::scalar::{Lane, inlined};
use crate::system::gyroscopic::{Gyroscopic, Turned};

impl<T: Lane> TreeLanes<T> {
    /// Adds the impulse of drives, sand and wrenches over a step that ends with the iterate
    /// `v_end`.
    #[inline(always)]
    pub fn actuate(
        &self,
        options: &StepOptions,
        start: StartOf<'_, Self>,
        v_end: &[T],
        out: &mut [T],
    ) {
        let (step, places) = (self.step(options), &start.configuration.joints);
        (self.drives).add_impulse(&self.mechanism, step, places, [start.v, v_end], out);
        self.push_with_sand(options, v_end, out, false);
        self.push(step.0, out);
    }

    /// `y` = the bias at a velocity.
    fn find_bias(&mut self, v: &[T], y: &mut [T]) {
        bias(
            &self.mechanism,
            &self.inertias,
            &self.poses_middle,
            v,
            self.gravity,
            &mut self.bias_scratch,
            y,
        );
    }
}

impl<T: Lane> Forces for TreeLanes<T> {
    fn begin_load(&mut self, options: &StepOptions, start: StartOf<'_, Self>, y: &mut [T]) {
        let mut torque = std::mem::take(&mut self.torque);
        inlined!(T::vectorize, self.token, {
            torque.fill(self.number(0.0));
            self.actuate(options, start, start.v, &mut torque);
        });
        self.torque = torque;
        let mut before = std::mem::take(&mut self.bias_before);
        if before.is_empty() {
            before.resize(start.v.len(), self.number(0.0));
            self.find_bias(start.v, &mut before);
        }
        let (h, _) = self.step(options);
        inlined!(T::vectorize, self.token, {
            for (y, (torque, bias)) in y.iter_mut().zip(self.torque.iter().zip(&before)) {
                *y = *torque - h * *bias;
            }
        });
        self.bias_before = before;
    }

    fn load(&mut self, options: &StepOptions, _: StartOf<'_, Self>, v_mean: &[T], y: &mut [T]) {
        self.find_bias(v_mean, y);
        let (h, _) = self.step(options);
        inlined!(T::vectorize, self.token, {
            for (y, torque) in y.iter_mut().zip(&self.torque) {
                *y = *torque - h * *y;
            }
        });
    }

    #[inline(always)]
    fn add_given(&self, options: &StepOptions, impulse: &mut [T]) {
        for (impulse, given) in impulse.iter_mut().zip(&self.given) {
            *impulse += *given;
        }
        self.push_with_sand(options, &self.torque, impulse, true);
    }

    fn load_gyroscopic(
        &mut self,
        options: &StepOptions,
        start: StartOf<'_, Self>,
        v_mean: &[T],
        impulse: &[T],
        y: &mut [T],
    ) {
        let step = self.step(options);
        let solver = (self.implicit)
            .get_or_insert_with(|| Box::new(Gyroscopic::new(self.token, &self.mechanism)));
        let of = Turned {
            mechanism: &self.mechanism,
            inertias: &self.inertias,
            poses: &self.poses_middle,
            mass_matrix: &self.mass_matrix,
            gravity: self.gravity,
        };
        y.copy_from_slice(&self.torque);
        solver.solve(&of, step, [start.v, v_mean], impulse, y);
    }

    #[inline(always)]
    fn choose_branches(&mut self, v: &[T]) {
        self.drives.choose_branches(&self.mechanism, v);
        if let Some(sand) = &mut self.sand {
            sand.start_from(v);
        }
    }

    #[inline(always)]
    fn may_revise(&self) -> bool {
        self.drives.has_motors() || self.sand.is_some()
    }

    fn revise(&mut self, lanes: T::Mask, v: &[T], v_end: &[T]) -> T::Mask {
        let (drives, machine) = (&mut self.drives, &*self.mechanism);
        let retaken = inlined!(
            T::vectorize,
            self.token,
            drives.revise(machine, lanes, v, v_end)
        );
        retaken | self.revise_sand(lanes, v_end)
    }

    fn unsettled(&mut self, lanes: T::Mask, v_end: &[T]) -> T::Mask {
        let tried = self.sand.clone();
        let unsettled = self.revise_sand(lanes, v_end);
        self.sand = tried;
        unsettled
    }

    fn most_revisions(&self, lane: usize) -> usize {
        self.most_revisions_of(lane)
    }

    fn work(
        &mut self,
        options: &StepOptions,
        start: StartOf<'_, Self>,
        v_end: &[T],
        out: &mut [Work<T>],
    ) {
        let v = [start.v, v_end];
        self.find_sand_work(v);
        let step = self.step(options);
        inlined!(T::vectorize, self.token, {
            let places = &start.configuration.joints;
            self.drives.work(&self.mechanism, step, places, v, out);
            self.add_work_of_wrenches(step, v, out);
            for (work, of_sand) in out.iter_mut().zip(&self.of_sand) {
                work.damped -= *of_sand;
            }
        });
    }

    #[inline(always)]
    fn stored(&self, q: &LaneConfiguration<T>, out: &mut [T]) {
        (self.drives).stored(&self.mechanism, self.number(0.0), &q.joints, out);
    }

    fn work_of_displacement(
        &mut self,
        options: &StepOptions,
        start: StartOf<'_, Self>,
        v_end: &[T],
        displacement: &[T],
    ) -> Option<T> {
        let (machine, step) = (&*self.mechanism, self.step(options));
        let motion = [start.v, v_end, displacement];
        let places = &start.configuration.joints;
        let of_drives = (self.drives).work_of_displacement(machine, step, places, motion);
        Some(of_drives + self.work_on_the_way(displacement))
    }

    #[inline(always)]
    fn accept(&mut self, lanes: T::Mask) {
        if self.is_thorough {
            self.drives.accept_part(lanes);
        } else {
            self.drives.accept(lanes);
        }
        if let Some(sand) = &mut self.sand {
            sand.accept(lanes);
        }
    }
}
