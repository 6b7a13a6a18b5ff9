//! Which velocities of a machine a contact moves, and which of them come together.

use std::ops::Range;

/// The branch-induced sparsity of a matrix `1 + Z K Zᵀ` over the velocities of a machine
/// (Featherstone 2008, ch. 6): entries (k, a) and (a, k) for every velocity k and those that carry
/// it, its ancestors.
#[derive(Debug, PartialEq, Eq)]
pub struct Pattern {
    /// Ancestors of all velocities, from the root: those of velocity k are `ancestors[rows[k]]`.
    ancestors: Vec<usize>,
    rows: Vec<Range<usize>>,
    /// Velocities that move the contact of a slot, from the root.
    paths: Vec<Vec<usize>>,
    /// Length of the longest path.
    stride: usize,
    /// Velocities that two slots share: `shared[a * n + b]`.
    shared: Vec<usize>,
}

impl Pattern {
    /// That of contacts along paths over `nv` velocities, a path a slot; none if a velocity has
    /// other ancestors on another path.
    #[must_use]
    pub fn new(nv: usize, paths: Vec<Vec<usize>>) -> Option<Self> {
        let mut of_velocity: Vec<&[usize]> = vec![&[]; nv];
        for path in &paths {
            for (k, &velocity) in path.iter().enumerate() {
                let own = &mut of_velocity[velocity];
                if !own.is_empty() && **own != path[..k] {
                    return None;
                }
                *own = &path[..k];
            }
        }
        let mut ancestors = Vec::new();
        let rows = (of_velocity.iter())
            .map(|own| {
                let first = ancestors.len();
                ancestors.extend_from_slice(own);
                first..ancestors.len()
            })
            .collect();
        Some(Self {
            ancestors,
            rows,
            stride: paths.iter().map(Vec::len).max().unwrap_or(0),
            shared: (paths.iter())
                .flat_map(|a| paths.iter().map(move |b| shared(a, b)))
                .collect(),
            paths,
        })
    }

    /// Number of velocities.
    #[inline(always)]
    #[must_use]
    pub fn nv(&self) -> usize {
        self.rows.len()
    }

    /// Number of entries below the diagonal.
    #[must_use]
    pub fn n_entries(&self) -> usize {
        self.ancestors.len()
    }

    /// Ancestors of a velocity, from the root.
    #[inline(always)]
    #[must_use]
    pub fn ancestors(&self, velocity: usize) -> &[usize] {
        &self.ancestors[self.rows[velocity].clone()]
    }

    /// Entries of a velocity's row, left of the diagonal.
    #[inline(always)]
    #[must_use]
    pub fn row(&self, velocity: usize) -> Range<usize> {
        self.rows[velocity].clone()
    }

    /// Velocities that move the contact of a slot, from the root.
    #[inline(always)]
    #[must_use]
    pub fn path(&self, slot: usize) -> &[usize] {
        &self.paths[slot]
    }

    /// Number of velocities that move the contacts of two slots.
    #[must_use]
    pub fn shared(&self, a: usize, b: usize) -> usize {
        self.shared[a * self.paths.len() + b]
    }

    /// Length of the longest path.
    #[inline(always)]
    #[must_use]
    pub fn stride(&self) -> usize {
        self.stride
    }
}

fn shared(a: &[usize], b: &[usize]) -> usize {
    a.iter().zip(b).take_while(|(i, j)| i == j).count()
}
