//! The forces on the rovers of a block, without those of their contacts.

use super::system::{LaneSystem, time_step};
use crate::integrator::{Forces, StartOf, StepOptions, Work};
use crate::multibody::LaneConfiguration;
use crate::multibody::bias::bias;
use crate::scalar::Lane;
use crate::system::gyroscopic::Turned;

impl<T: Lane> LaneSystem<T> {
    /// `y` = the bias at a velocity.
    fn weigh(&mut self, v: &[T], y: &mut [T]) {
        bias(
            &self.machine,
            &self.inertias,
            &self.poses_middle,
            v,
            self.gravity,
            &mut self.bias_scratch,
            y,
        );
    }
}

impl<T: Lane> Forces for LaneSystem<T> {
    #[inline(always)]
    fn begin_load(&mut self, options: &StepOptions, start: StartOf<'_, Self>) {
        let step = time_step::<T>(self.token, options);
        self.torque.fill(step.0.like(0.0));
        let (machine, torque) = (&*self.machine, &mut self.torque);
        let (places, v) = (&start.configuration.joints, start.v);
        (self.drives).add_impulse(machine, step, places, [v, v], torque);
        if let Some(sand) = &self.sand {
            sand.add_impulse(options.time_step, v, torque);
        }
        self.push(step.0);
    }

    fn load(&mut self, options: &StepOptions, _: StartOf<'_, Self>, v_mean: &[T], y: &mut [T]) {
        self.weigh(v_mean, y);
        let (h, _) = time_step::<T>(self.token, options);
        T::vectorize(
            self.token,
            #[inline(always)]
            || {
                for (y, torque) in y.iter_mut().zip(&self.torque) {
                    *y = *torque - h * *y;
                }
            },
        );
    }

    fn begin_gyroscopic(&mut self, options: &StepOptions, scratch: &mut [T]) {
        let Some(mut own) = self.implicit.take() else {
            return;
        };
        let (h, _) = time_step::<T>(self.token, options);
        scratch.fill(h.like(0.0));
        self.weigh(scratch, &mut own.given);
        for (given, torque) in own.given.iter_mut().zip(&self.torque) {
            *given = *torque - h * *given;
        }
        self.implicit = Some(own);
    }

    fn load_gyroscopic(
        &mut self,
        options: &StepOptions,
        start: StartOf<'_, Self>,
        v_mean: &[T],
        impulse: &[T],
        y: &mut [T],
    ) {
        let step = time_step::<T>(self.token, options);
        let Some(own) = &mut self.implicit else {
            return;
        };
        y.copy_from_slice(&own.given);
        let of = Turned {
            mechanism: &self.machine,
            inertias: &self.inertias,
            poses: &self.poses_middle,
            mass_matrix: &own.mass_matrix,
        };
        own.solver.solve(&of, step, [start.v, v_mean], impulse, y);
    }

    #[inline(always)]
    fn choose_branches(&mut self, v: &[T]) {
        self.drives.choose_branches(&self.machine, v);
        if let Some(sand) = &mut self.sand {
            sand.start_from(v);
        }
    }

    #[inline(always)]
    fn may_revise(&self) -> bool {
        self.drives.has_motors() || self.sand.is_some()
    }

    fn revise(&mut self, lanes: T::Mask, v: &[T], v_end: &[T]) -> T::Mask {
        let (drives, machine) = (&mut self.drives, &*self.machine);
        let retaken = T::vectorize(
            self.token,
            #[inline(always)]
            || drives.revise(machine, lanes, v, v_end),
        );
        retaken | self.revise_sand(lanes, v_end)
    }

    fn unsettled(&mut self, lanes: T::Mask, v_end: &[T]) -> T::Mask {
        self.revise_sand(lanes, v_end)
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
        self.weigh_sand(v);
        let step = time_step::<T>(self.token, options);
        T::vectorize(
            self.token,
            #[inline(always)]
            || {
                let places = &start.configuration.joints;
                self.drives.work(&self.machine, step, places, v, out);
                self.add_work_of_wrenches(step, v, out);
                for (work, of_sand) in out.iter_mut().zip(&self.of_sand) {
                    work.damped -= *of_sand;
                }
            },
        );
    }

    #[inline(always)]
    fn stored(&self, q: &LaneConfiguration<T>, out: &mut [T]) {
        (self.drives).stored(&self.machine, self.number(0.0), &q.joints, out);
    }

    fn work_of_displacement(
        &mut self,
        options: &StepOptions,
        start: StartOf<'_, Self>,
        v_end: &[T],
        displacement: &[T],
    ) -> Option<T> {
        let (machine, step) = (&*self.machine, time_step::<T>(self.token, options));
        let motion = [start.v, v_end, displacement];
        let places = &start.configuration.joints;
        let of_drives = (self.drives).work_of_displacement(machine, step, places, motion);
        Some(of_drives + self.work_on_the_way(displacement))
    }

    #[inline(always)]
    fn accept(&mut self, lanes: T::Mask, p: &[T]) {
        let p = p.as_chunks::<3>().0;
        self.rows.find_loop_impulses(&self.contacts, lanes, p);
        self.drives.accept(lanes);
        if let Some(sand) = &mut self.sand {
            sand.accept(lanes);
        }
    }
}
