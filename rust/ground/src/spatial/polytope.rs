//! Convex hull of a few points: its faces and edges, its volume and its inertia.
//!
//! Every plane through three of the points that leaves all others on one side carries a face. The
//! search tries all triples, largest first. With at most [`MAX_VERTICES`] points it takes
//! milliseconds, has no special cases for points in one plane, and gives the same faces on every
//! machine.
//!
//! Volume and moments are sums over tetrahedra from the mean of the points to the faces.

use nalgebra::{Matrix3, Vector3};

/// Most vertices of a polytope: a set of them is the bits of a 64-bit number.
pub const MAX_VERTICES: usize = 64;

/// Distances from a face's plane, in lengths of the polytope, within which points lie in it. The
/// first for which faces and edges close is taken.
const FLAT: [f64; 4] = [1e-6, 1e-8, 1e-10, 1e-12];

/// Length (in lengths of the polytope) by which points must leave every plane.
const THIN: f64 = 1e-6;

/// A convex polytope about its centroid.
#[derive(Clone, Debug, PartialEq)]
pub struct Polytope {
    vertices: Vec<Vector3<f64>>,
    faces: Vec<PolytopeFace>,
    edges: Vec<PolytopeEdge>,
    centroid: Vector3<f64>,
    volume: f64,
    /// Second moments ∫ x xᵀ dV about the centroid, m⁵.
    moments: Matrix3<f64>,
    bound: f64,
    half_size: Vector3<f64>,
    middle: Vector3<f64>,
}

/// A face of a polytope.
#[derive(Clone, Debug, PartialEq)]
pub struct PolytopeFace {
    /// Unit, outward.
    pub normal: Vector3<f64>,
    /// Distance of the face's plane from the centroid along the normal, m.
    pub offset: f64,
    /// Numbers of the face's vertices, counterclockwise from outside.
    pub corners: Vec<usize>,
}

/// An edge of a polytope.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PolytopeEdge {
    /// Numbers of the two vertices of the edge.
    pub ends: [usize; 2],
    /// Numbers of the two faces at the edge; `ends` is counterclockwise in the first.
    pub faces: [usize; 2],
}

impl Polytope {
    /// The convex hull of points (m); `None` if they are fewer than four or more than
    /// [`MAX_VERTICES`], not finite, or almost in one plane.
    #[must_use]
    pub fn hull_of(points: &[Vector3<f64>]) -> Option<Self> {
        let is_finite = points.iter().all(|x| x.iter().all(|c| c.is_finite()));
        if !(4..=MAX_VERTICES).contains(&points.len()) || !is_finite {
            return None;
        }
        let mean = points.iter().sum::<Vector3<f64>>() / points.len() as f64;
        let around: Vec<Vector3<f64>> = points.iter().map(|x| x - mean).collect();
        let size = around.iter().fold(0.0, |size: f64, x| size.max(x.norm()));
        let triples = triples_by_area(&around, size);
        let (faces, edges) = FLAT.iter().find_map(|flat| {
            let faces = find_faces(&around, &triples, flat * size);
            let edges = find_edges(&faces)?;
            Some((faces, edges))
        })?;
        let is_thick = faces.iter().all(|face| {
            let depths = around.iter().map(|x| face.offset - face.normal.dot(x));
            depths.fold(0.0, f64::max) > THIN * size
        });
        is_thick.then(|| Self::assemble(&around, &mean, faces, edges))
    }

    /// Numbers the vertices that are used, and moves the centroid to the origin.
    fn assemble(
        points: &[Vector3<f64>],
        mean: &Vector3<f64>,
        mut faces: Vec<PolytopeFace>,
        mut edges: Vec<PolytopeEdge>,
    ) -> Self {
        let is_used = |k: usize| faces.iter().any(|face| face.corners.contains(&k));
        let used: Vec<usize> = (0..points.len()).filter(|&k| is_used(k)).collect();
        let number = |k: usize| used.iter().position(|&own| own == k).unwrap_or(0);
        let (volume, centroid, moments) = integrals(points, &faces);
        let vertices: Vec<_> = used.iter().map(|&k| points[k] - centroid).collect();
        for face in &mut faces {
            face.offset -= face.normal.dot(&centroid);
            face.corners.iter_mut().for_each(|k| *k = number(*k));
        }
        for edge in &mut edges {
            edge.ends = edge.ends.map(number);
        }
        let ends = |choose: fn(f64, f64) -> f64| {
            (vertices.iter().copied()).reduce(|a, b| a.zip_map(&b, choose))
        };
        let low = ends(f64::min).unwrap_or_default();
        let high = ends(f64::max).unwrap_or_default();
        Self {
            bound: vertices.iter().fold(0.0, |r: f64, x| r.max(x.norm())),
            half_size: (high - low) * 0.5,
            middle: (high + low) * 0.5,
            vertices,
            faces,
            edges,
            centroid: centroid + mean,
            volume,
            moments,
        }
    }

    /// Vertices of the polytope relative to its centroid, m.
    #[inline]
    #[must_use]
    pub fn vertices(&self) -> &[Vector3<f64>] {
        &self.vertices
    }

    /// Faces of the polytope.
    #[inline]
    #[must_use]
    pub fn faces(&self) -> &[PolytopeFace] {
        &self.faces
    }

    /// Edges of the polytope.
    #[inline]
    #[must_use]
    pub fn edges(&self) -> &[PolytopeEdge] {
        &self.edges
    }

    /// Centroid in the coordinates of the points that it was made of, m.
    #[must_use]
    pub fn centroid(&self) -> Vector3<f64> {
        self.centroid
    }

    /// m³.
    #[must_use]
    pub fn volume(&self) -> f64 {
        self.volume
    }

    /// Inertia about the centroid for a mass `m` (kg) of uniform density, kg m².
    #[must_use]
    pub fn inertia(&self, m: f64) -> Matrix3<f64> {
        let C = self.moments * (m / self.volume);
        Matrix3::identity() * C.trace() - C
    }

    /// Radius of a ball about the centroid that contains it, m.
    #[inline]
    #[must_use]
    pub fn bound(&self) -> f64 {
        self.bound
    }

    /// Middle (relative to the centroid) and half edge lengths of a box with its axes around it, m.
    #[inline]
    #[must_use]
    pub fn bounding_box(&self) -> (Vector3<f64>, Vector3<f64>) {
        (self.middle, self.half_size)
    }

    /// The number of the vertex that lies furthest along a direction.
    #[inline]
    #[must_use]
    pub fn furthest(&self, direction: &Vector3<f64>) -> usize {
        let mut best = (0, f64::NEG_INFINITY);
        for (k, x) in self.vertices.iter().enumerate() {
            let along = direction.dot(x);
            if along > best.1 {
                best = (k, along);
            }
        }
        best.0
    }
}

/// Triples of points that span an area, the largest first.
fn triples_by_area(points: &[Vector3<f64>], size: f64) -> Vec<[usize; 3]> {
    let n = points.len();
    let mut triples = Vec::with_capacity(n * (n - 1) * (n - 2) / 6);
    for i in 0..n {
        for j in i + 1..n {
            for k in j + 1..n {
                let area = (points[j] - points[i])
                    .cross(&(points[k] - points[i]))
                    .norm();
                if area > 1e-12 * size * size {
                    triples.push((area, [i, j, k]));
                }
            }
        }
    }
    triples.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
    triples.into_iter().map(|(_, triple)| triple).collect()
}

/// The faces of a convex hull; `flat` (m): distance from a plane within which points lie in it.
fn find_faces(points: &[Vector3<f64>], triples: &[[usize; 3]], flat: f64) -> Vec<PolytopeFace> {
    let mut faces: Vec<PolytopeFace> = Vec::new();
    let mut members: Vec<u64> = Vec::new();
    for triple in triples {
        let bits = triple.iter().fold(0_u64, |bits, k| bits | 1 << k);
        if members.iter().any(|own| own & bits == bits) {
            continue;
        }
        let [p, q, r] = triple.map(|k| points[k]);
        let normal = (q - p).cross(&(r - p)).normalize();
        let heights = || points.iter().map(|x| normal.dot(&(x - p)));
        for side in [1.0, -1.0] {
            if heights().any(|height| side * height > flat) {
                continue;
            }
            let own = heights()
                .enumerate()
                .filter(|(_, height)| height.abs() <= flat);
            let own: Vec<usize> = own.map(|(k, _)| k).collect();
            members.push(own.iter().fold(0, |bits, k| bits | 1 << k));
            faces.push(outline(points, &own, normal * side, flat));
        }
    }
    faces
}

/// The face through points in a plane: their convex hull there (Andrew 1979).
fn outline(
    points: &[Vector3<f64>],
    own: &[usize],
    normal: Vector3<f64>,
    flat: f64,
) -> PolytopeFace {
    let along = if normal.x.abs() < 0.7 {
        Vector3::x()
    } else {
        Vector3::y()
    };
    let along = (along - normal * normal.dot(&along)).normalize();
    let across = normal.cross(&along);
    let mut places: Vec<(f64, f64, usize)> = (own.iter())
        .map(|&k| (along.dot(&points[k]), across.dot(&points[k]), k))
        .collect();
    places.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1)));
    let turns_left = |a: &(f64, f64, usize), b: &(f64, f64, usize), c: &(f64, f64, usize)| {
        let (to_b, to_c) = ((b.0 - a.0, b.1 - a.1), (c.0 - a.0, c.1 - a.1));
        let length = (to_c.0 * to_c.0 + to_c.1 * to_c.1).sqrt();
        to_b.0 * to_c.1 - to_b.1 * to_c.0 > flat * length
    };
    let half = |places: &mut dyn Iterator<Item = (f64, f64, usize)>| {
        let mut chain: Vec<(f64, f64, usize)> = Vec::new();
        for place in places {
            while let [.., a, b] = chain[..]
                && !turns_left(&a, &b, &place)
            {
                chain.pop();
            }
            chain.push(place);
        }
        chain.pop();
        chain
    };
    let lower = half(&mut places.iter().copied());
    let upper = half(&mut places.iter().rev().copied());
    let corners: Vec<usize> = lower.iter().chain(&upper).map(|place| place.2).collect();
    let offset = corners
        .iter()
        .map(|&k| normal.dot(&points[k]))
        .fold(f64::NEG_INFINITY, f64::max);
    PolytopeFace {
        normal,
        offset,
        corners,
    }
}

/// The edges between faces; none if the faces do not close.
fn find_edges(faces: &[PolytopeFace]) -> Option<Vec<PolytopeEdge>> {
    let mut edges: Vec<PolytopeEdge> = Vec::new();
    let mut n_half = 0;
    for (own, face) in faces.iter().enumerate() {
        let n = face.corners.len();
        if n < 3 {
            return None;
        }
        n_half += n;
        for k in 0..n {
            let ends = [face.corners[k], face.corners[(k + 1) % n]];
            let back = [ends[1], ends[0]];
            let mut others = faces.iter().enumerate().filter(|(_, other)| {
                let m = other.corners.len();
                (0..m).any(|j| [other.corners[j], other.corners[(j + 1) % m]] == back)
            });
            let (other, _) = others.next()?;
            if others.next().is_some() {
                return None;
            }
            if own < other {
                let faces = [own, other];
                edges.push(PolytopeEdge { ends, faces });
            }
        }
    }
    let mut vertices = faces.iter().fold(0_u64, |bits, face| {
        face.corners.iter().fold(bits, |bits, k| bits | 1 << k)
    });
    let mut n_vertices = 0;
    while vertices != 0 {
        vertices &= vertices - 1;
        n_vertices += 1;
    }
    // Euler's formula.
    let closes = 2 * edges.len() == n_half && n_vertices + faces.len() == edges.len() + 2;
    closes.then_some(edges)
}

/// Volume, centroid, and second moments about the centroid.
fn integrals(points: &[Vector3<f64>], faces: &[PolytopeFace]) -> (f64, Vector3<f64>, Matrix3<f64>) {
    let (mut volume, mut moment) = (0.0, Vector3::zeros());
    let mut second = Matrix3::zeros();
    for face in faces {
        for pair in face.corners[1..].windows(2) {
            let [a, b, c] = [face.corners[0], pair[0], pair[1]].map(|k| points[k]);
            let own = a.dot(&b.cross(&c)) / 6.0;
            let sum = a + b + c;
            volume += own;
            moment += sum * (own / 4.0);
            let outer = |x: &Vector3<f64>| x * x.transpose();
            second += (outer(&a) + outer(&b) + outer(&c) + outer(&sum)) * (own / 20.0);
        }
    }
    let centroid = moment / volume;
    let about = second - centroid * centroid.transpose() * volume;
    (volume, centroid, about)
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Rotation3;
    use proptest::prelude::*;

    fn corners(half: [f64; 3]) -> Vec<Vector3<f64>> {
        (0..8)
            .map(|k| {
                Vector3::from_fn(|axis, _| half[axis] * if k >> axis & 1 == 1 { 1.0 } else { -1.0 })
            })
            .collect()
    }

    /// A prism of n sides, radius 1 and height 2, about y.
    fn prism(n: u32) -> Vec<Vector3<f64>> {
        (0..n)
            .flat_map(|k| {
                let (sin, cos) = (std::f64::consts::TAU * f64::from(k) / f64::from(n)).sin_cos();
                [-1.0, 1.0].map(|y| Vector3::new(cos, y, sin))
            })
            .collect()
    }

    #[test]
    fn a_box_has_six_faces_of_four_corners_and_the_inertia_of_a_box() {
        let half = [0.6, 0.2, 0.5];
        let mut points = corners(half);
        points.push(Vector3::new(0.1, 0.0, -0.3)); // inside
        points.push(Vector3::new(0.6, 0.1, 0.0)); // on a face
        points.push(Vector3::new(0.6, 0.2, 0.1)); // on an edge
        let R = Rotation3::from_euler_angles(0.3, -1.0, 2.0);
        let shift = Vector3::new(3.0, -1.0, 0.5);
        let moved: Vec<_> = points.iter().map(|x| R * x + shift).collect();
        let hull = Polytope::hull_of(&moved).unwrap();
        assert_eq!(
            (
                hull.vertices().len(),
                hull.faces().len(),
                hull.edges().len()
            ),
            (8, 6, 12)
        );
        assert!(hull.faces().iter().all(|face| face.corners.len() == 4));
        assert!((hull.volume() - 0.48).abs() < 1e-12);
        assert!((hull.centroid() - shift).norm() < 1e-12);
        let [a, b, c] = half.map(|half| 4.0 * half * half);
        let own = Matrix3::from_diagonal(&Vector3::new(b + c, a + c, a + b)) * (7.0 / 12.0);
        let turned = R.matrix() * own * R.matrix().transpose();
        assert!((hull.inertia(7.0) - turned).norm() < 1e-12);
    }

    #[test]
    fn a_prism_of_32_sides_has_two_faces_of_32_corners() {
        let hull = Polytope::hull_of(&prism(32)).unwrap();
        let large = hull
            .faces()
            .iter()
            .filter(|face| face.corners.len() == 32)
            .count();
        assert_eq!(
            (large, hull.faces().len(), hull.vertices().len()),
            (2, 34, 64)
        );
        let area = 16.0 * (std::f64::consts::TAU / 32.0).sin();
        assert!((hull.volume() - 2.0 * area).abs() < 1e-12);
    }

    #[test]
    fn flat_points_and_too_few_have_no_hull() {
        let flat: Vec<_> = prism(8).into_iter().filter(|x| x.y > 0.0).collect();
        assert!(Polytope::hull_of(&flat).is_none());
        assert!(Polytope::hull_of(&corners([1.0; 3])[..3]).is_none());
        assert!(Polytope::hull_of(&[Vector3::x(); 5]).is_none());
        assert!(Polytope::hull_of(&[Vector3::repeat(f64::NAN); 4]).is_none());
        let mut many = prism(32);
        many.push(Vector3::y() * 3.0);
        assert!(Polytope::hull_of(&many).is_none());
    }

    proptest! {
        #[test]
        fn every_point_is_behind_every_face(
            points in prop::collection::vec(prop::array::uniform3(-1.0..1.0_f64), 8..24),
            grid in prop::sample::select(vec![0.0, 0.25, 1.0]), stretch in 0.01..1.0_f64,
        ) {
            // On a grid, many points share planes and lines.
            let snap = |x: f64| if grid > 0.0 { (x / grid).round() * grid } else { x };
            let points: Vec<_> = points.iter().map(|x| {
                Vector3::from(x.map(snap)).component_mul(&Vector3::new(1.0, stretch, 1.0))
            }).collect();
            let Some(hull) = Polytope::hull_of(&points) else {
                // Random points have a volume; points of a grid may lie in one plane.
                prop_assert!(grid > 0.0);
                return Ok(());
            };
            for face in hull.faces() {
                for x in &points {
                    let height = face.normal.dot(&(x - hull.centroid())) - face.offset;
                    prop_assert!(height < 3e-6, "{height}");
                }
                for &k in &face.corners {
                    prop_assert!((face.normal.dot(&hull.vertices()[k]) - face.offset).abs() < 3e-6);
                }
            }
            // Moments by a sum over the same hull from another origin.
            let C = hull.inertia(1.0);
            prop_assert!(C.symmetric_eigenvalues().min() > 0.0);
            let furthest = hull.vertices().iter().fold(0.0_f64, |most, x| most.max(x.norm()));
            prop_assert!((hull.bound() - furthest).abs() < 1e-15);
        }
    }
}
