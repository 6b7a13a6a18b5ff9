//! A search for the balls near a place: a balanced tree of intervals.
//!
//! Each node splits its balls at the median centre along their longest extent, and stores the upper
//! bound of the lower half and the lower bound of the upper half along that axis. A search compares
//! one coordinate per node and enters only the halves that it may touch. Its cost is one descent of
//! `log₂ n` comparisons plus the balls found. Unlike a grid the tree needs no cell size: pebbles
//! beside boulders, heaps, and a stray ball a kilometre away cost the same.
//!
//! Source: Wächter and Keller 2006, *Instant ray tracing: the bounding interval hierarchy*.

use nalgebra::Vector3;

use super::bounds::Bounds;
use crate::geometry::ray::{self, Hit, Ray};
use crate::geometry::shape::Sphere;
use friction_contact::scalar::elementary::hypot;

/// Most balls in a leaf. Measured on 100 000 balls: 2, 4 and 8 search equally fast.
const LEAF: usize = 4;

/// Deeper than any tree of 2^32 balls.
const DEPTH: usize = 34;

/// Two halves, or the balls themselves.
#[derive(Clone, Copy, Debug)]
struct Node {
    /// How far up the lower half reaches along the axis, m.
    lower_end: f64,
    /// How far down the upper half reaches, m.
    upper_begin: f64,
    /// Inner node: the upper half; the lower one comes right after its parent. Leaf: first ball.
    at: u32,
    /// Inner node: the axis, 0 to 2. Leaf: 3 and the number of balls.
    kind: u32,
}

/// Kinds from here on are leaves.
const IS_LEAF: u32 = 3;

/// A ball and its number in the input.
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
    /// Where each ball of the input is among them.
    places: Vec<u32>,
    /// Around all.
    bounds: Option<Bounds>,
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
        nodes.shrink_to_fit();
        let mut places = vec![0; balls.len()];
        for (place, ball) in balls.iter().enumerate() {
            places[ball.index as usize] = narrow(place);
        }
        let around = |ball: &Sphere| Bounds {
            low: ball.centre.add_scalar(-ball.radius),
            high: ball.centre.add_scalar(ball.radius),
        };
        let bounds = spheres.iter().map(around).reduce(|a, b| a.with(&b));
        Self {
            nodes,
            balls,
            places,
            bounds,
        }
    }

    /// Number of balls.
    #[must_use]
    pub fn len(&self) -> usize {
        self.balls.len()
    }

    /// Whether there are none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.balls.is_empty()
    }

    /// A ball by its number in the input.
    ///
    /// # Panics
    /// If there is no such ball.
    #[must_use]
    pub fn ball(&self, index: usize) -> &Sphere {
        &self.balls[self.places[index] as usize].sphere
    }

    /// Visits exactly the balls whose surface comes closer than `reach` to
    /// `centre`, or that contain it.
    #[inline]
    pub fn visit_near(
        &self,
        centre: &Vector3<f64>,
        reach: f64,
        mut visit: impl FnMut(u32, &Sphere),
    ) {
        self.search(centre, &[reach; 3], |ball| {
            let within = reach + ball.sphere.radius;
            if (ball.sphere.centre - centre).norm_squared() <= within * within {
                visit(ball.index, &ball.sphere);
            }
        });
    }

    /// Visits exactly the balls that the vertical line through (x, z) meets.
    pub fn visit_column(&self, x: f64, z: f64, mut visit: impl FnMut(&Sphere)) {
        self.visit_column_indexed(x, z, |index| visit(self.ball(index as usize)));
    }

    /// Visits exactly the balls that the vertical line through (x, z) meets, by their numbers in
    /// the input.
    pub fn visit_column_indexed(&self, x: f64, z: f64, mut visit: impl FnMut(u32)) {
        let line = Vector3::new(x, 0.0, z);
        self.search(&line, &[0.0, f64::INFINITY, 0.0], |ball| {
            let Sphere { centre, radius } = &ball.sphere;
            if hypot(centre.x - x, centre.z - z) <= *radius {
                visit(ball.index);
            }
        });
    }

    /// Visits all balls that come closer than `radius` to `centre`, seen from above, and some more.
    pub fn visit_pillar(&self, centre: &Vector3<f64>, radius: f64, mut visit: impl FnMut(&Sphere)) {
        let reach = [radius, f64::INFINITY, radius];
        self.search(centre, &reach, |ball| visit(&ball.sphere));
    }

    /// Visits all balls that come closer than `radius` to `centre`, seen from above, and some more,
    /// by their numbers in the input.
    pub fn visit_pillar_indexed(
        &self,
        centre: &Vector3<f64>,
        radius: f64,
        mut visit: impl FnMut(u32),
    ) {
        let reach = [radius, f64::INFINITY, radius];
        self.search(centre, &reach, |ball| visit(ball.index));
    }

    /// The ball that a ray meets first within `reach` (m), with its index in the input.
    #[must_use]
    pub fn first_hit(&self, ray: &Ray, reach: f64) -> Option<(Hit, u32, Sphere)> {
        let inverse = ray.inverse();
        let whole = self.bounds?.crossing(&ray.origin, &inverse, reach)?;
        let mut nearest: Option<(f64, &Ball)> = None;
        let mut waiting = [(0_u32, [0.0_f64; 2]); DEPTH];
        let mut n_waiting = 0;
        let (mut at, mut within) = (0_usize, whole);
        loop {
            let node = &self.nodes[at];
            if node.kind < IS_LEAF {
                let axis = node.kind as usize;
                let (x, inverse) = (ray.origin[axis], inverse[axis]);
                let [enter, leave] = within;
                // Where the ray leaves the one half and where it enters the other.
                let (lower, upper) = (at, node.at as usize);
                let lower_end = (node.lower_end - x) * inverse;
                let upper_begin = (node.upper_begin - x) * inverse;
                let (near, far, until, from) = if inverse >= 0.0 {
                    (lower + 1, upper, lower_end, upper_begin)
                } else {
                    (upper, lower + 1, upper_begin, lower_end)
                };
                let near_range = [enter, leave.min(until)];
                let far_range = [enter.max(from), leave];
                let crosses = |range: [f64; 2]| range[0] <= range[1];
                match (crosses(near_range), crosses(far_range)) {
                    (true, true) => {
                        waiting[n_waiting] = (narrow(far), far_range);
                        n_waiting += 1;
                        (at, within) = (near, near_range);
                        continue;
                    }
                    (true, false) => {
                        (at, within) = (near, near_range);
                        continue;
                    }
                    (false, true) => {
                        (at, within) = (far, far_range);
                        continue;
                    }
                    (false, false) => {}
                }
            } else {
                let count = (node.kind - IS_LEAF) as usize;
                for ball in &self.balls[node.at as usize..][..count] {
                    let reach = nearest.map_or(reach, |(distance, _)| distance);
                    if let Some(distance) = ray::sphere::distance(ray, &ball.sphere, reach) {
                        nearest = Some((distance, ball));
                    }
                }
            }
            loop {
                if n_waiting == 0 {
                    return nearest.map(|(distance, Ball { sphere, index })| {
                        (ray::sphere::hit_at(ray, sphere, distance), *index, *sphere)
                    });
                }
                n_waiting -= 1;
                let (next, [enter, leave]) = waiting[n_waiting];
                let leave = nearest.map_or(leave, |(distance, _)| leave.min(distance));
                if enter <= leave {
                    (at, within) = (next as usize, [enter, leave]);
                    break;
                }
            }
        }
    }

    /// Visits the balls of all leaves that come closer than `reach` to `centre` along each axis.
    #[inline]
    fn search(&self, centre: &Vector3<f64>, reach: &[f64; 3], mut visit: impl FnMut(&Ball)) {
        if self.nodes.is_empty() {
            return;
        }
        let mut waiting = [0_u32; DEPTH];
        let mut n_waiting = 0;
        let mut at = 0_usize;
        loop {
            let node = &self.nodes[at];
            if node.kind < IS_LEAF {
                let axis = node.kind as usize;
                let (x, reach) = (centre[axis], reach[axis]);
                let is_in_lower = x - reach <= node.lower_end;
                if x + reach >= node.upper_begin {
                    if !is_in_lower {
                        at = node.at as usize;
                        continue;
                    }
                    waiting[n_waiting] = node.at;
                    n_waiting += 1;
                }
                if is_in_lower {
                    at += 1;
                    continue;
                }
            } else {
                let count = (node.kind - IS_LEAF) as usize;
                for ball in &self.balls[node.at as usize..][..count] {
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
    let me = nodes.len();
    if balls.len() <= LEAF {
        nodes.push(Node {
            lower_end: 0.0,
            upper_begin: 0.0,
            at: narrow(first),
            kind: IS_LEAF + narrow(balls.len()),
        });
        return;
    }
    let range = |k: usize| {
        let centres = balls.iter().map(|b| b.sphere.centre[k]);
        let (low, high) = centres.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| {
            (low.min(x), high.max(x))
        });
        high - low
    };
    let sides = [range(0), range(1), range(2)];
    let axis = (1..3).fold(0, |best, k| if sides[k] > sides[best] { k } else { best });
    let half = balls.len() / 2;
    balls.select_nth_unstable_by(half, |a, b| {
        let (x, y) = (a.sphere.centre[axis], b.sphere.centre[axis]);
        x.total_cmp(&y).then(a.index.cmp(&b.index))
    });
    let (lower, upper) = balls.split_at_mut(half);
    let high = |b: &Ball| b.sphere.centre[axis] + b.sphere.radius;
    let low = |b: &Ball| b.sphere.centre[axis] - b.sphere.radius;
    nodes.push(Node {
        lower_end: lower.iter().map(high).fold(f64::NEG_INFINITY, f64::max),
        upper_begin: upper.iter().map(low).fold(f64::INFINITY, f64::min),
        at: 0,
        kind: narrow(axis),
    });
    grow(nodes, lower, first);
    nodes[me].at = narrow(nodes.len());
    grow(nodes, upper, first + half);
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn sphere() -> impl Strategy<Value = Sphere> {
        // From pebbles to boulders, some at the same place, some far off.
        let place = prop_oneof![8 => -10.0..10.0, 1 => Just(1.0), 1 => -1e4..1e4];
        (prop::array::uniform3(place), -4.0..1.5)
            .prop_map(|(centre, size): ([f64; 3], f64)| Sphere::new(centre.into(), size.exp()))
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

    proptest! {
        #[test]
        fn a_ray_meets_the_ball_that_looking_at_all_finds(
            spheres in prop::collection::vec(sphere(), 0..200),
            origin in prop::array::uniform3(prop_oneof![4 => -12.0..12.0, 1 => Just(1.0)]),
            direction in prop::array::uniform3(prop_oneof![4 => -1.0..1.0, 1 => Just(0.0)]),
            reach in prop_oneof![1 => 0.0..20.0, 1 => Just(f64::INFINITY)],
        ) {
            let Some(ray) = Ray::new(origin.into(), direction.into()) else { return Ok(()) };
            let found = BallTree::new(&spheres).first_hit(&ray, reach).map(|(hit, ..)| hit.distance);
            let all = spheres.iter().filter_map(|ball| ray::sphere::distance(&ray, ball, reach));
            prop_assert_eq!(found, all.reduce(f64::min));
        }
    }

    #[test]
    fn very_many_balls_at_one_place_are_no_deeper_than_the_search_remembers() {
        let one = Sphere::new(Vector3::zeros(), 1.0);
        let tree = BallTree::new(&vec![one; 1 << 17]);
        let mut count = 0;
        tree.visit_near(&Vector3::zeros(), 0.5, |_, _| count += 1);
        assert_eq!(count, 1 << 17);
    }
}
