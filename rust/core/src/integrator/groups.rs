//! Groups of clusters that touch each other in a step.
//!
//! A *cluster* is a part of a system that is coupled to the rest by contacts alone: of a model, the
//! trees that closed loops tie together. Clusters whose contacts touch each other form a *group*.
//! Whether contacts persist, whether gyroscopic terms are implicit, how far the energy audit
//! corrects the velocity and how far positions are projected are decisions of a group: what happens
//! in another one has no influence on it. A system with one cluster has one group.

use super::contacting::{KeyOf, UnilateralContact};
use super::dynamics::MechanicalEnergy;
use super::mechanical_system::MechanicalSystem;
use super::options::StepOptions;
use super::warm_start::WarmStart;

/// The groups of a step. A group has the number of its first cluster.
#[derive(Clone, Debug, Default)]
pub(super) struct Groups {
    /// Group of each cluster.
    of_cluster: Vec<usize>,
    /// Group of each contact; empty if the system is one cluster.
    of_contact: Vec<usize>,
    /// Data of each group, by its number.
    own: Vec<Group>,
}

/// What is known of a group.
#[derive(Clone, Copy, Debug, Default)]
#[allow(clippy::struct_excessive_bools)] // facts that do not depend on each other
pub(super) struct Group {
    /// Number of its contacts.
    pub n_contacts: usize,
    /// Whether all its contacts are between its own bodies.
    pub is_untouched: bool,
    /// Whether the last step had the same contacts.
    pub is_same: bool,
    /// Whether they persisted, besides, so that the impulses of the last step are those of this one
    /// up to O(h).
    pub persists: bool,
    /// Whether the group's gyroscopic terms are implicit.
    pub is_gyroscopic: bool,
    /// Whether the audit asks for another step.
    pub is_coarse: bool,
    /// Whether the solver converged for the group's contacts.
    pub is_solved: bool,
    /// Whether an impact without elastic answer was taken as inelastic.
    pub is_inelastic: bool,
    /// Whether the group's positions were projected.
    pub is_moved: bool,
    /// Penetration that is tolerated, m: the least of its clusters.
    pub tolerated: f64,
    /// Which share of the projection's displacement it makes.
    pub share: f64,
}

impl Groups {
    /// Finds the groups for the contacts of a step. `gyroscopic`: of each cluster, whether its
    /// gyroscopic terms are implicit.
    pub(super) fn find<S: MechanicalSystem>(
        &mut self,
        system: &S,
        options: &StepOptions,
        contacts: &[S::Contact],
        warm_start: &WarmStart<KeyOf<S>>,
        gyroscopic: &[bool],
    ) {
        let n = system.n_clusters();
        self.of_cluster.clear();
        self.of_cluster.extend(0..n);
        self.own.clear();
        self.own.resize(n, Group::default());
        for own in &mut self.own {
            own.is_untouched = true;
            own.is_solved = true;
            own.tolerated = f64::INFINITY;
        }
        self.of_contact.clear();
        if n == 1 {
            self.own[0].tolerated = system.tolerated(options, 0);
            let own = &mut self.own[0];
            own.n_contacts = contacts.len();
            own.is_untouched = contacts.iter().all(UnilateralContact::is_internal);
            own.is_same = warm_start.is_of(contacts);
            own.persists = !warm_start.persistent.is_empty() && own.is_same;
            own.is_gyroscopic = gyroscopic.contains(&true);
            return;
        }
        for contact in contacts {
            let [a, b] = system
                .clusters_of(&contact.key())
                .map(|own| self.of_cluster[own]);
            if a != b {
                for own in &mut self.of_cluster {
                    if [a, b].contains(own) {
                        *own = a.min(b);
                    }
                }
            }
        }
        self.compare(system, contacts, warm_start);
        for (cluster, &group) in self.of_cluster.iter().enumerate() {
            self.own[group].is_gyroscopic |= gyroscopic.get(cluster) == Some(&true);
            let tolerated = system.tolerated(options, cluster);
            let own = &mut self.own[group];
            own.tolerated = own.tolerated.min(tolerated);
            let has_contacts = self.own[group].n_contacts > 0;
            let lasts = warm_start.persists(system, cluster);
            self.own[group].persists &= lasts || !has_contacts;
        }
    }

    /// Compares the contacts of each group with those of the last step.
    fn compare<S: MechanicalSystem>(
        &mut self,
        system: &S,
        contacts: &[S::Contact],
        warm_start: &WarmStart<KeyOf<S>>,
    ) {
        for own in &mut self.own {
            own.is_same = true;
        }
        for contact in contacts {
            let key = contact.key();
            let group = self.of_cluster[system.clusters_of(&key)[0]];
            self.of_contact.push(group);
            let own = &mut self.own[group];
            own.n_contacts += 1;
            own.is_untouched &= contact.is_internal();
            own.is_same &= warm_start.impulses.iter().any(|(known, _)| *known == key);
        }
        for (known, _) in &warm_start.impulses {
            if !contacts.iter().any(|contact| contact.key() == *known) {
                for cluster in system.clusters_of(known) {
                    self.own[self.of_cluster[cluster]].is_same = false;
                }
            }
        }
        for own in &mut self.own {
            own.persists = own.is_same && own.n_contacts > 0;
        }
    }

    /// Number of clusters, one more than the highest number of a group.
    pub(super) fn n(&self) -> usize {
        self.of_cluster.len()
    }

    /// Whether a number is that of a group.
    pub(super) fn is_group(&self, number: usize) -> bool {
        self.of_cluster[number] == number
    }

    /// What is known of a group.
    pub(super) fn group(&self, number: usize) -> &Group {
        &self.own[number]
    }

    /// What is known of a group.
    pub(super) fn group_mut(&mut self, number: usize) -> &mut Group {
        &mut self.own[number]
    }

    /// What is known of all groups.
    pub(super) fn all(&self) -> impl Iterator<Item = &Group> {
        let all = self.own.iter().zip(&self.of_cluster).enumerate();
        all.filter(|(number, (_, of))| *number == **of)
            .map(|(_, (own, _))| own)
    }

    /// The group of a cluster.
    pub(super) fn of_cluster(&self, cluster: usize) -> usize {
        self.of_cluster[cluster]
    }

    /// The group of a contact.
    pub(super) fn of_contact(&self, i: usize) -> usize {
        self.of_contact.get(i).copied().unwrap_or(0)
    }

    /// Whether the contacts of a step are in several groups.
    pub(super) fn are_several(&self) -> bool {
        self.all().filter(|own| own.n_contacts > 0).count() > 1
    }

    /// Whether the contacts of any group persist.
    pub(super) fn any_persists(&self) -> bool {
        self.all().any(|own| own.persists)
    }

    /// Asks for implicit gyroscopic terms in the coarse groups without; whether there is one.
    pub(super) fn make_coarse_implicit(&self, gyroscopic: &mut [bool]) -> bool {
        let mut is_any = false;
        for (own, group) in gyroscopic.iter_mut().zip(&self.of_cluster) {
            let group = &self.own[*group];
            if group.is_coarse && !group.is_gyroscopic {
                (*own, is_any) = (true, true);
            }
        }
        is_any
    }

    /// Energy and momentum of a group, from those of the clusters.
    pub(super) fn energy(
        &self,
        of_clusters: &[MechanicalEnergy],
        group: usize,
    ) -> MechanicalEnergy {
        let own = of_clusters.iter().enumerate();
        own.filter(|(cluster, _)| self.of_cluster[*cluster] == group)
            .map(|(_, energy)| *energy)
            .reduce(MechanicalEnergy::with)
            .unwrap_or_default()
    }

    /// Sum of what a group's clusters have.
    pub(super) fn sum<T>(&self, of_clusters: &[T], group: usize) -> T
    where
        T: Copy + Default + std::ops::Add<Output = T>,
    {
        let own = of_clusters.iter().enumerate();
        own.filter(|(cluster, _)| self.of_cluster[*cluster] == group)
            .map(|(_, x)| *x)
            .reduce(|a, b| a + b)
            .unwrap_or_default()
    }
}
