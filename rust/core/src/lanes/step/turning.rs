//! Implicit gyroscopic terms in a block: [`crate::system::gyroscopic`].

use super::implicit::Implicit;
use super::{Block, Fallback};
use crate::integrator::moreau_jean::{GYROSCOPIC_PASSES, MOST_TURN};
use crate::scalar::{Lane, LaneMask};
use crate::system::extent::Turning;
use crate::system::gyroscopic::Turned;

impl<T: Lane> Block<T> {
    /// Finds the clusters that turn too fast for explicit gyroscopic terms. A rover that turns too
    /// fast for one step falls back.
    #[inline(always)]
    pub(super) fn find_turning(&mut self) {
        let (h, _) = self.time_step();
        let mut is_fast = T::mask(self.token, 0);
        for cluster in 0..self.n_clusters() {
            let turning = Turning::of_cluster(h.like(0.0), &self.machine, &self.v, cluster);
            self.is_gyroscopic[cluster] = turning.is_gyroscopic(h);
            is_fast = is_fast | h.like(MOST_TURN).lt(h * turning.of_frames());
        }
        self.fall_back(Fallback::Turning, is_fast);
    }

    /// Whether any rover of the step has implicit gyroscopic terms.
    #[inline(always)]
    fn is_any_implicit(&self) -> bool {
        (self.any(&self.is_gyroscopic) & self.going).any()
    }

    /// Whether any group of any rover of the step has explicit gyroscopic terms.
    #[inline(always)]
    pub(super) fn is_any_explicit(&self) -> bool {
        let explicit = self.is_gyroscopic.iter().map(|own| !*own & self.going);
        explicit.fold(false, |any, own| any | own.any()) || !self.is_any_implicit()
    }

    /// Keeps M̂, which its factor replaces, for implicit gyroscopic terms.
    pub(super) fn keep_mass_matrix(&mut self) {
        if !self.is_any_implicit() {
            return;
        }
        let own = &mut self.implicit;
        let own = own.get_or_insert_with(|| Box::new(Implicit::new(self.token, &self.machine)));
        own.mass_matrix.clone_from(&self.mass_matrix);
    }

    /// The free change of velocity with implicit gyroscopic terms, for [`Self::take_implicit`].
    /// `is_any`: whether the contacts of any group persist.
    pub(super) fn load_implicitly(&mut self, is_any: bool) {
        if !self.is_any_implicit() {
            return;
        }
        let Some(mut own) = self.implicit.take() else {
            return;
        };
        let (h, theta) = self.time_step();
        let zero = h.like(0.0);
        self.weigh(None);
        for (given, (torque, weight)) in own.given.iter_mut().zip(self.torque.iter().zip(&self.y)) {
            *given = *torque - h * *weight;
        }
        own.foreseen.fill(zero);
        let pushed = self.pushed.iter().zip(&self.cluster_of);
        for (foreseen, (pushed, cluster)) in own.foreseen.iter_mut().zip(pushed).filter(|_| is_any)
        {
            *foreseen = T::select(self.persists[*cluster], *pushed, zero);
        }
        self.v_mean.copy_from_slice(&self.v);
        for pass in 0..GYROSCOPIC_PASSES {
            self.y.copy_from_slice(&own.given);
            let of = Turned {
                mechanism: &self.machine,
                inertias: &self.inertias,
                poses: &self.poses_middle,
                mass_matrix: &own.mass_matrix,
            };
            let velocities = [&self.v[..], &self.v_mean];
            (own.solver).solve(&of, (h, theta), velocities, &own.foreseen, &mut self.y);
            if pass + 1 < GYROSCOPIC_PASSES {
                self.foresee(&mut own.foreseen);
            }
        }
        T::vectorize(
            self.token,
            #[inline(always)]
            || self.correct_impulse(is_any),
        );
        own.y.copy_from_slice(&self.y);
        self.implicit = Some(own);
    }

    /// The mean velocity that follows from the impulse `y` and the foreseen one, and the impulses
    /// of the loops that are foreseen with it.
    fn foresee(&mut self, foreseen: &mut [T]) {
        let (h, theta) = self.time_step();
        let share = h.like(1.0) - theta;
        T::vectorize(
            self.token,
            #[inline(always)]
            || {
                for (y, foreseen) in self.y.iter_mut().zip(&*foreseen) {
                    *y += *foreseen;
                }
                self.factor.half_solve(&self.machine, &mut self.y);
                self.close_loops();
                if let Some(loops) = &mut self.rows.loops {
                    loops.add_generalized_impulse(&std::iter::empty(), foreseen);
                }
                self.factor.half_solve_back(&self.machine, &mut self.y);
                for ((mean, v), change) in self.v_mean.iter_mut().zip(&self.v).zip(&self.y) {
                    *mean = *v + share * *change;
                }
            },
        );
    }

    /// Takes the free change of velocity with implicit gyroscopic terms in the groups that have
    /// them.
    #[inline(always)]
    pub(super) fn take_implicit(&mut self) {
        let Some(own) = self.implicit.as_ref().filter(|_| self.is_any_implicit()) else {
            return;
        };
        for (y, (implicit, cluster)) in self.y.iter_mut().zip(own.y.iter().zip(&self.cluster_of)) {
            *y = T::select(self.is_gyroscopic[*cluster], *implicit, *y);
        }
    }
}
