//! Which of many balls come near a place: a balanced tree of bounding boxes.
//!
//! Each node halves its balls at the median centre along its longest side, down to leaves of a few. A search opens only nodes whose
//! box comes closer than the reach, so that it costs the balls it finds and one way down, `log₂ n`: what is far away is
//! not looked at. Unlike a grid the tree asks for no cell size: pebbles beside boulders, heaps, and one stray ball a
//! kilometre off cost the same.

use nalgebra::Vector3;

use super::sphere::Sphere;

/// Most balls in a leaf. Measured on 100 000 rocks: 2 to 8 search equally fast, below that the tree only grows.
const LEAF: usize = 4;

/// Deeper than any tree of 2^32 balls.
const DEPTH: usize = 34;

/// Box around balls, and where they or the children are.
#[derive(Clone, Copy, Debug)]
struct Node {
    low: [f64; 3],
    high: [f64; 3],
    /// Leaf: first ball. Inner node: right child; the left one comes right after its parent.
    at: u32,
    /// Leaf: number of balls. Inner node: 0.
    count: u32,
}

/// A ball and the number it was given under.
#[derive(Clone, Copy, Debug)]
struct Ball {
    sphere: Sphere,
    index: u32,
}

/// An immutable set of balls that can be searched by place.
#[derive(Clone, Debug, Default)]
pub struct BallTree {
    nodes: Vec<Node>,
    /// In the order of the leaves.
    balls: Vec<Ball>,
}

impl BallTree {
    /// Builds the tree; `n log n`.
    ///
    /// # Panics
    /// If there are 2^32 balls or more.
    #[must_use]
    pub fn new(spheres: &[Sphere]) -> Self {
        let mut balls: Vec<Ball> = spheres
            .iter()
            .enumerate()
            .map(|(index, &sphere)| Ball {
                sphere,
                index: narrow(index),
            })
            .collect();
        let mut nodes = Vec::with_capacity(2 * balls.len().div_ceil(LEAF));
        if !balls.is_empty() {
            grow(&mut nodes, &mut balls, 0);
        }
        Self { nodes, balls }
    }

    /// Visits exactly the balls whose surface comes closer than `reach` to `centre`, or that contain it.
    #[inline]
    pub fn visit_near(
        &self,
        centre: &Vector3<f64>,
        reach: f64,
        mut visit: impl FnMut(u32, &Sphere),
    ) {
        let square = reach * reach;
        self.visit(
            |node| square_distance(node, centre) <= square,
            |ball| {
                let within = reach + ball.sphere.radius;
                if (ball.sphere.centre - centre).norm_squared() <= within * within {
                    visit(ball.index, &ball.sphere);
                }
            },
        );
    }

    /// Visits exactly the balls that the vertical line through (x, z) meets.
    pub fn visit_column(&self, x: f64, z: f64, mut visit: impl FnMut(&Sphere)) {
        self.visit(
            |node| {
                (node.low[0]..=node.high[0]).contains(&x)
                    && (node.low[2]..=node.high[2]).contains(&z)
            },
            |ball| {
                let Sphere { centre, radius } = &ball.sphere;
                if (centre.x - x).hypot(centre.z - z) <= *radius {
                    visit(&ball.sphere);
                }
            },
        );
    }

    /// Visits the balls of all leaves below nodes that are `wanted`.
    #[inline]
    fn visit(&self, wanted: impl Fn(&Node) -> bool, mut visit: impl FnMut(&Ball)) {
        if self.nodes.is_empty() {
            return;
        }
        let mut waiting = [0_u32; DEPTH];
        let mut n_waiting = 0;
        let mut at = 0_usize;
        loop {
            let node = &self.nodes[at];
            if wanted(node) {
                if node.count == 0 {
                    waiting[n_waiting] = node.at;
                    n_waiting += 1;
                    at += 1;
                    continue;
                }
                for ball in &self.balls[node.at as usize..][..node.count as usize] {
                    visit(ball);
                }
            }
            if n_waiting == 0 {
                return;
            }
            n_waiting -= 1;
            at = waiting[n_waiting] as usize;
        }
    }
}

fn narrow(x: usize) -> u32 {
    u32::try_from(x).unwrap_or_else(|_| panic!("invariant: {x} balls or nodes fit 32 bits"))
}

/// Appends the tree of `balls`, which begin at `first` among all.
fn grow(nodes: &mut Vec<Node>, balls: &mut [Ball], first: usize) {
    let mut node = Node {
        low: [f64::INFINITY; 3],
        high: [f64::NEG_INFINITY; 3],
        at: narrow(first),
        count: narrow(balls.len()),
    };
    let (mut low, mut high) = (node.low, node.high);
    for Ball { sphere, .. } in balls.iter() {
        for k in 0..3 {
            let (x, r) = (sphere.centre[k], sphere.radius);
            node.low[k] = node.low[k].min(x - r);
            node.high[k] = node.high[k].max(x + r);
            low[k] = low[k].min(x);
            high[k] = high[k].max(x);
        }
    }
    let me = nodes.len();
    nodes.push(node);
    if balls.len() <= LEAF {
        return;
    }
    let side = |k: usize| high[k] - low[k];
    let axis = (1..3).fold(0, |best, k| if side(k) > side(best) { k } else { best });
    let half = balls.len() / 2;
    balls.select_nth_unstable_by(half, |a, b| {
        let (x, y) = (a.sphere.centre[axis], b.sphere.centre[axis]);
        x.total_cmp(&y).then(a.index.cmp(&b.index))
    });
    let (left, right) = balls.split_at_mut(half);
    grow(nodes, left, first);
    nodes[me].at = narrow(nodes.len());
    nodes[me].count = 0;
    grow(nodes, right, first + half);
}

/// Square of the distance from a point to a node's box.
#[inline]
fn square_distance(node: &Node, x: &Vector3<f64>) -> f64 {
    let mut sum = 0.0;
    for k in 0..3 {
        let outside = (node.low[k] - x[k]).max(x[k] - node.high[k]).max(0.0);
        sum += outside * outside;
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn sphere() -> impl Strategy<Value = Sphere> {
        // From pebbles to boulders, some at the same place, some far off.
        let place = prop_oneof![8 => -10.0..10.0, 1 => Just(1.0), 1 => -1e4..1e4];
        (prop::array::uniform3(place), -4.0..1.5).prop_map(|(centre, size): ([f64; 3], f64)| {
            Sphere {
                centre: centre.into(),
                radius: size.exp(),
            }
        })
    }

    proptest! {
        #[test]
        fn finds_what_looking_at_all_finds(
            spheres in prop::collection::vec(sphere(), 0..200),
            centre in prop::array::uniform3(-12.0..12.0),
            reach in prop_oneof![9 => 0.0..3.0, 1 => Just(f64::INFINITY)],
        ) {
            let centre = Vector3::from(centre);
            let mut found = Vec::new();
            BallTree::new(&spheres).visit_near(&centre, reach, |index, sphere| {
                assert_eq!(*sphere, spheres[index as usize]);
                found.push(index as usize);
            });
            found.sort_unstable();
            let expected: Vec<usize> = (0..spheres.len())
                .filter(|&i| spheres[i].distance(&centre) <= reach)
                .collect();
            prop_assert_eq!(found, expected);
        }
    }

    #[test]
    fn very_many_balls_at_one_place_are_no_deeper_than_the_search_remembers() {
        let one = Sphere {
            centre: Vector3::zeros(),
            radius: 1.0,
        };
        let tree = BallTree::new(&vec![one; 1 << 17]);
        let mut count = 0;
        tree.visit_near(&Vector3::zeros(), 0.5, |_, _| count += 1);
        assert_eq!(count, 1 << 17);
    }
}
