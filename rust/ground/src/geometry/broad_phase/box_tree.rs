//! A search for the boxes that a ray crosses: a hierarchy of bounding boxes.
//!
//! Each node splits its boxes in halves at the median middle along the longest extent of the
//! middles. A ray enters the nearer half first, and no half that lies beyond what it has met. The
//! two halves of a node stand side by side, with bounds in single precision, rounded outwards: both
//! fit one line of the cache.

use nalgebra::Vector3;

use super::bounds::Bounds;
use crate::geometry::ray::Ray;

/// Most boxes in a leaf.
const LEAF: usize = 1;

/// Deeper than any tree of 2^32 boxes.
const DEPTH: usize = 34;

/// Two halves, or the boxes themselves.
#[derive(Clone, Copy, Debug, Default)]
#[repr(align(32))]
struct Node {
    /// m.
    low: [f32; 3],
    /// m.
    high: [f32; 3],
    /// Inner node: the first half; the second comes right after it. Leaf: first item.
    at: u32,
    /// Number of items of a leaf; 0 for an inner node.
    count: u32,
}

/// An immutable set of boxes that can be searched along rays.
#[derive(Clone, Debug, Default)]
pub struct BoxTree {
    nodes: Vec<Node>,
    /// Numbers of the boxes in the input, in the order of the leaves.
    items: Vec<u32>,
}

impl Node {
    fn around(bounds: &Bounds) -> Self {
        Self {
            low: bounds.low.map(below).into(),
            high: bounds.high.map(above).into(),
            ..Self::default()
        }
    }

    #[inline]
    fn bounds(&self) -> Bounds {
        Bounds {
            low: Vector3::from(self.low.map(f64::from)),
            high: Vector3::from(self.high.map(f64::from)),
        }
    }
}

/// A number of single precision that is not above another.
#[allow(clippy::cast_possible_truncation)] // rounded down
fn below(x: f64) -> f32 {
    let near = x as f32;
    if f64::from(near) > x {
        near.next_down()
    } else {
        near
    }
}

/// One that is not below.
fn above(x: f64) -> f32 {
    -below(-x)
}

impl BoxTree {
    /// Builds the tree; `n log n`.
    ///
    /// # Panics
    /// If there are 2^32 boxes or more.
    #[must_use]
    pub fn new(boxes: &[Bounds]) -> Self {
        let mut items: Vec<u32> = (0..narrow(boxes.len())).collect();
        let mut nodes = Vec::with_capacity(boxes.len());
        if !boxes.is_empty() {
            // The root, and a gap after it.
            nodes.extend([Node::default(); 2]);
            grow(&mut nodes, 0, boxes, &mut items, 0);
        }
        nodes.shrink_to_fit();
        Self { nodes, items }
    }

    /// Visits boxes that a ray crosses within `reach` (m), nearer halves first. `visit` gets the
    /// number of a box in the input and the reach, and returns the reach from there on.
    #[inline]
    pub fn visit_along(&self, ray: &Ray, mut reach: f64, mut visit: impl FnMut(u32, f64) -> f64) {
        let inverse = ray.inverse();
        let enters = |at: usize, reach: f64| {
            let bounds = self.nodes[at].bounds();
            let crossing = bounds.crossing(&ray.origin, &inverse, reach);
            crossing.map(|[enter, _]| enter)
        };
        if self.nodes.is_empty() || enters(0, reach).is_none() {
            return;
        }
        let mut waiting = [(0_u32, 0.0_f64); DEPTH];
        let mut n_waiting = 0;
        let mut at = 0_usize;
        loop {
            let node = &self.nodes[at];
            if node.count == 0 {
                let (first, second) = (node.at as usize, node.at as usize + 1);
                match (enters(first, reach), enters(second, reach)) {
                    (Some(a), Some(b)) => {
                        let is_first_nearer = a <= b;
                        waiting[n_waiting] = if is_first_nearer {
                            (node.at + 1, b)
                        } else {
                            (node.at, a)
                        };
                        n_waiting += 1;
                        at = if is_first_nearer { first } else { second };
                        continue;
                    }
                    (Some(_), None) => {
                        at = first;
                        continue;
                    }
                    (None, Some(_)) => {
                        at = second;
                        continue;
                    }
                    (None, None) => {}
                }
            } else {
                for &item in &self.items[node.at as usize..][..node.count as usize] {
                    reach = visit(item, reach);
                }
            }
            loop {
                if n_waiting == 0 {
                    return;
                }
                n_waiting -= 1;
                let (next, enter) = waiting[n_waiting];
                if enter <= reach {
                    at = next as usize;
                    break;
                }
            }
        }
    }
}

fn narrow(x: usize) -> u32 {
    u32::try_from(x).unwrap_or_else(|_| panic!("invariant: {x} boxes or nodes fit 32 bits"))
}

/// Makes node `me` the tree of `items`, which begin at `first` among all.
fn grow(nodes: &mut Vec<Node>, me: usize, boxes: &[Bounds], items: &mut [u32], first: usize) {
    let own = items.iter().map(|&i| &boxes[i as usize]);
    let bounds = own.fold(Bounds::NOTHING, |all, one| all.with(one));
    let node = Node::around(&bounds);
    if items.len() <= LEAF {
        nodes[me] = Node {
            at: narrow(first),
            count: narrow(items.len()),
            ..node
        };
        return;
    }
    let twice_middle = |i: u32| -> Vector3<f64> { boxes[i as usize].low + boxes[i as usize].high };
    let middles = items.iter().map(|&i| twice_middle(i));
    let spread = middles.fold(Bounds::NOTHING, |all, x| {
        all.with(&Bounds { low: x, high: x })
    });
    let axis = (spread.high - spread.low).imax();
    let half = items.len() / 2;
    items.select_nth_unstable_by(half, |&a, &b| {
        let (x, y) = (twice_middle(a)[axis], twice_middle(b)[axis]);
        x.total_cmp(&y).then(a.cmp(&b))
    });
    let halves = nodes.len();
    nodes[me] = Node {
        at: narrow(halves),
        ..node
    };
    nodes.extend([Node::default(); 2]);
    let (lower, upper) = items.split_at_mut(half);
    grow(nodes, halves, boxes, lower, first);
    grow(nodes, halves + 1, boxes, upper, first + half);
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn bounds() -> impl Strategy<Value = Bounds> {
        // Some flat, some at the same place.
        let place = prop_oneof![8 => -5.0..5.0, 1 => Just(1.0)];
        let size = prop_oneof![8 => 0.0..1.0, 2 => Just(0.0)];
        (prop::array::uniform3(place), prop::array::uniform3(size)).prop_map(|(low, size)| {
            let low = Vector3::<f64>::from(low);
            Bounds {
                low,
                high: low + Vector3::from(size),
            }
        })
    }

    proptest! {
        #[test]
        fn finds_all_that_a_ray_crosses(
            boxes in prop::collection::vec(bounds(), 0..200),
            origin in prop::array::uniform3(prop_oneof![4 => -6.0..6.0, 1 => Just(1.0)]),
            direction in prop::array::uniform3(prop_oneof![4 => -1.0..1.0, 1 => Just(0.0)]),
            reach in prop_oneof![1 => 0.0..10.0, 1 => Just(f64::INFINITY)],
        ) {
            let Some(ray) = Ray::new(origin.into(), direction.into()) else { return Ok(()) };
            let mut found = vec![false; boxes.len()];
            BoxTree::new(&boxes).visit_along(&ray, reach, |i, reach| {
                assert!(!std::mem::replace(&mut found[i as usize], true));
                reach
            });
            for (one, found) in boxes.iter().zip(found) {
                let crosses = one.crossing(&ray.origin, &ray.inverse(), reach).is_some();
                prop_assert!(found || !crosses);
            }
        }
    }
}
