//! Which velocities of a machine a contact moves, and which of them come together.

use std::ops::Range;

/// Number of velocities of a free root, with which every path of its tree starts.
pub const BASE: usize = 6;

/// The branch-induced sparsity of a matrix `1 + Z K Zᵀ` over the velocities of a machine
/// (Featherstone 2008, ch. 6): all entries of the base's six velocities, and (k, a) and (a, k) for
/// every joint's velocity k and those that carry it, its ancestors. Joints' velocities are numbered
/// from 0, after those of the base.
#[derive(Debug, Default, PartialEq, Eq)]
pub struct Pattern {
    /// Joint ancestors of all joints, from the root: those of joint k are `ancestors[rows[k]]`.
    ancestors: Vec<usize>,
    rows: Vec<Range<usize>>,
    /// Joints that move the contact of a slot, from the root.
    paths: Vec<Vec<usize>>,
    /// Length of the longest path.
    stride: usize,
    /// Velocities that two slots share: `shared[a * n + b]`.
    shared: Vec<usize>,
    /// Whether the pattern has all entries.
    is_whole: bool,
}

impl Pattern {
    /// Pattern of contacts along paths over `nv` velocities, a path a slot. None if a path does not
    /// begin with the base, or if a velocity has other ancestors on another path.
    #[must_use]
    pub fn new(nv: usize, paths: &[Vec<usize>]) -> Option<Self> {
        let mut of_joint: Vec<Option<&[usize]>> = vec![None; nv.checked_sub(BASE)?];
        let mut own_paths = Vec::new();
        for path in paths {
            let (base, joints) = path.split_at_checked(BASE)?;
            if !base.iter().copied().eq(0..BASE) {
                return None;
            }
            own_paths.push(joints.iter().map(|k| k - BASE).collect());
            for (k, &velocity) in joints.iter().enumerate() {
                let own = &mut of_joint[velocity - BASE];
                if own.is_some_and(|own| *own != joints[..k]) {
                    return None;
                }
                *own = Some(&joints[..k]);
            }
        }
        let mut ancestors = Vec::new();
        let rows = (of_joint.iter())
            .map(|own| {
                let first = ancestors.len();
                ancestors.extend(own.unwrap_or_default().iter().map(|k| k - BASE));
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
            paths: own_paths,
            is_whole: false,
        })
    }

    /// Pattern of `n` slots with all entries of `nv` velocities, those of the base among them.
    #[must_use]
    pub fn whole(nv: usize, n: usize) -> Self {
        let joints: Vec<usize> = (0..nv - BASE).collect();
        let first = |k: usize| k * k.saturating_sub(1) / 2;
        Self {
            ancestors: joints.iter().flat_map(|&k| 0..k).collect(),
            rows: joints.iter().map(|&k| first(k)..first(k) + k).collect(),
            paths: vec![joints; n],
            stride: nv,
            shared: vec![nv; n * n],
            is_whole: true,
        }
    }

    /// Whether the pattern has all entries, and every slot all velocities.
    #[inline(always)]
    #[must_use]
    pub fn is_whole(&self) -> bool {
        self.is_whole
    }

    /// Number of joints' velocities.
    #[inline(always)]
    #[must_use]
    pub fn n_joints(&self) -> usize {
        self.rows.len()
    }

    /// Number of entries between joints below the diagonal.
    #[must_use]
    pub fn n_entries(&self) -> usize {
        self.ancestors.len()
    }

    /// Joint ancestors of a joint, from the root.
    #[inline(always)]
    #[must_use]
    pub fn ancestors(&self, joint: usize) -> &[usize] {
        &self.ancestors[self.rows[joint].clone()]
    }

    /// Entries of a joint's row with its ancestors.
    #[inline(always)]
    #[must_use]
    pub fn row(&self, joint: usize) -> Range<usize> {
        self.rows[joint].clone()
    }

    /// Joints that move the contact of a slot, from the root.
    #[inline(always)]
    #[must_use]
    pub fn joints(&self, slot: usize) -> &[usize] {
        &self.paths[slot]
    }

    /// Number of velocities that move the contacts of two slots.
    #[must_use]
    pub fn shared(&self, a: usize, b: usize) -> usize {
        self.shared[a * self.paths.len() + b]
    }

    /// Number of velocities on the longest path.
    #[inline(always)]
    #[must_use]
    pub fn stride(&self) -> usize {
        self.stride
    }
}

fn shared(a: &[usize], b: &[usize]) -> usize {
    a.iter().zip(b).take_while(|(i, j)| i == j).count()
}
