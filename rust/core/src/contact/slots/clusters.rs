//! The clusters of a machine: trees that closed loops tie together.
//!
//! Contacts of different clusters do not feel each other, so each cluster of a rover has a contact
//! problem of its own. Where clusters touch, their contacts are in one problem, that of the first
//! of them.

use std::collections::BTreeSet;
use std::sync::{Arc, OnceLock};

use crate::multibody::Mechanism;
use crate::multibody::mechanism::BASE;
use crate::multibody::model::Loop;
use crate::solver::batch::pattern::{self, Pattern};
use crate::solver::batch::problem::MAX_CONTACTS;

const _: () = assert!(
    BASE == pattern::BASE,
    "the solver's paths begin with a free root"
);

/// The clusters of a machine.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Clusters {
    /// Cluster of each tree.
    of_tree: Vec<usize>,
    /// Velocities of each cluster, ascending; those of a free root come first.
    velocities: Vec<Vec<usize>>,
    /// Velocities that precede them in the cluster's problems: six that nothing moves, in place of
    /// those of a free root, if its first root is not free.
    leads: Vec<usize>,
    /// Whether loops tie the trees of a cluster, or a tree to itself or to the world.
    has_loops: Vec<bool>,
    /// Pattern of the contact problems of each.
    patterns: Vec<LazyPattern>,
    wide: WidePatterns,
}

/// A pattern, found where it is first needed. It follows from the rest of the machine, so copies of
/// a machine share it.
#[derive(Clone, Debug, Default)]
struct LazyPattern(Arc<OnceLock<Arc<Pattern>>>);

impl PartialEq for LazyPattern {
    fn eq(&self, _: &Self) -> bool {
        true
    }
}

impl LazyPattern {
    fn get(&self, find: impl FnOnce() -> Arc<Pattern>) -> &Arc<Pattern> {
        self.0.get_or_init(find)
    }
}

/// Patterns with all entries, by number of velocities: of bodies that touch each other.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct WidePatterns(Vec<(usize, LazyPattern)>);

impl WidePatterns {
    /// Pattern with all entries for clusters that have `nv` velocities together.
    pub(crate) fn of(&self, nv: usize) -> &Arc<Pattern> {
        let Some((_, own)) = self.0.iter().find(|(size, _)| *size == nv) else {
            unreachable!("invariant: all sums of clusters are listed")
        };
        own.get(|| Arc::new(Pattern::whole(nv, MAX_CONTACTS)))
    }
}

impl Clusters {
    /// Clusters of a mechanism with closed `loops`.
    pub(crate) fn of(mechanism: &Mechanism, loops: &[Loop]) -> Self {
        let of_tree: Vec<usize> = mechanism.trees.iter().map(|tree| tree.cluster).collect();
        let n = mechanism.n_clusters();
        let mut velocities = vec![Vec::new(); n];
        for (tree, own) in mechanism.trees.iter().zip(&of_tree) {
            velocities[*own].extend(tree.velocities.clone());
        }
        let mut has_loops = vec![false; n];
        for tree in loops.iter().flat_map(|closure| closure.trees(mechanism)) {
            has_loops[of_tree[tree]] = true;
        }
        let mut leads: Vec<Option<usize>> = vec![None; n];
        for (tree, own) in mechanism.trees.iter().zip(&of_tree) {
            leads[*own].get_or_insert(BASE - tree.lead());
        }
        let leads: Vec<usize> = leads.into_iter().map(Option::unwrap_or_default).collect();
        let mut sizes = BTreeSet::from([0]);
        for (own, lead) in velocities.iter().zip(&leads) {
            let larger: Vec<usize> = sizes.iter().map(|size| size + lead + own.len()).collect();
            sizes.extend(larger);
        }
        let wide = sizes.into_iter().skip(1);
        Self {
            of_tree,
            velocities,
            leads,
            has_loops,
            // One each: a copy of a lazy pattern shares what is found.
            patterns: (0..n).map(|_| LazyPattern::default()).collect(),
            wide: WidePatterns(wide.map(|size| (size, LazyPattern::default())).collect()),
        }
    }

    /// Number of clusters.
    pub(crate) fn n(&self) -> usize {
        self.velocities.len()
    }

    /// Cluster of a tree: the index of the contact problem that its contacts belong to.
    pub(crate) fn of_tree(&self, tree: usize) -> usize {
        self.of_tree[tree]
    }

    /// Number of trees of a cluster.
    pub(crate) fn n_trees(&self, cluster: usize) -> usize {
        self.of_tree.iter().filter(|own| **own == cluster).count()
    }

    /// Number of velocities in the problems of a cluster.
    pub(crate) fn nv(&self, cluster: usize) -> usize {
        self.leads[cluster] + self.velocities[cluster].len()
    }

    /// Cluster of each of `nv` velocities, and its place among those of the cluster's problems.
    pub(crate) fn places(&self, nv: usize) -> Vec<[usize; 2]> {
        let mut places = vec![[0; 2]; nv];
        for (cluster, own) in self.velocities.iter().enumerate() {
            for (place, &velocity) in own.iter().enumerate() {
                places[velocity] = [cluster, self.leads[cluster] + place];
            }
        }
        places
    }

    /// Patterns of problems with contacts between bodies.
    pub(crate) fn wide(&self) -> &WidePatterns {
        &self.wide
    }

    /// Pattern of the problems of a cluster, whose slots move the bodies with these paths. Where
    /// loops are closed, a coupled joint follows one with other carriers, or there are more slots
    /// than contacts of a problem, it has all entries.
    /// Equal clusters have the same one.
    pub(crate) fn pattern(&self, cluster: usize, paths: &[&[usize]]) -> &Arc<Pattern> {
        self.patterns[cluster].get(|| {
            let (own, lead) = (&self.velocities[cluster], self.leads[cluster]);
            let own_slots = paths.len();
            let place = |velocity: &usize| Some(lead + own.binary_search(velocity).ok()?);
            let local = |path: &&[usize]| {
                let known = path.iter().map(place);
                (0..lead).map(Some).chain(known).collect::<Option<Vec<_>>>()
            };
            let paths = paths.iter().map(local).collect::<Option<Vec<_>>>();
            let has_room = !self.has_loops[cluster] && own_slots <= MAX_CONTACTS;
            let of_tree = paths
                .filter(|_| has_room)
                .and_then(|paths| Pattern::new(self.nv(cluster), &paths));
            let Some(found) = of_tree else {
                return Arc::clone(self.wide.of(self.nv(cluster)));
            };
            let known = self.patterns.iter().filter_map(|own| own.0.get());
            let same = known.into_iter().find(|known| ***known == found);
            same.map_or_else(|| Arc::new(found), Arc::clone)
        })
    }
}
