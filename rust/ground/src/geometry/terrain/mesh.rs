//! Triangle mesh: rocks and other things of any shape.
//!
//! Triangles turn counterclockwise, seen from outside. A closed mesh is filled. The border of an
//! open one pushes outwards too, and what lies below it is inside.

use std::collections::HashMap;
use std::sync::{Arc, OnceLock};

use nalgebra::Vector3;

use super::error::TerrainError;
use super::limits::check_entry;
use super::plane::Plane;
use super::surface::{BorderEdge, Edge, EdgeHalfSpace, Face, Hinge, Vertex};
use super::{Area, Coverage, GROUND, Neighbourhood, Primitive, Terrain};
use crate::geometry::broad_phase::{BallTree, Bounds, BoxTree};
use crate::geometry::ray::triangle::Sheared;
use crate::geometry::ray::{Hit, Ray};
use crate::geometry::shape::Sphere;

/// Most triangles of a mesh.
pub const MAX_TRIANGLES: usize = 5_000_000;

/// No neighbour.
const NONE: u32 = u32::MAX;

/// Triangles in space. Immutable.
///
/// With m triangles, face t is primitive t, the edge from the k-th vertex of triangle t to the next
/// is m + 3 t + k, of the lower of its two triangles, and vertex i is 4 m + i.
#[derive(Clone, Debug)]
pub struct TriangleMesh {
    vertices: Vec<Vector3<f64>>,
    triangles: Vec<[u32; 3]>,
    normals: Vec<Vector3<f64>>,
    /// Triangle beyond each edge.
    neighbours: Vec<[u32; 3]>,
    /// First triangle of each vertex.
    owners: Vec<u32>,
    /// Neighbours of vertex i: `spokes[begins[i]..begins[i + 1]]`.
    begins: Vec<u32>,
    spokes: Vec<u32>,
    /// Bounding balls of the triangles.
    tree: BallTree,
    /// Whether no triangle has a border.
    is_closed: bool,
    /// Their bounding boxes, from the first ray on.
    boxes: OnceLock<BoxTree>,
    /// Name of the surface's material, if it is not the default.
    material: Option<Arc<str>>,
}

impl TriangleMesh {
    /// Gives the surface the material `name`; see [`is_name`](friction_contact::law::materials::is_name).
    #[must_use]
    pub fn with_material(mut self, name: &str) -> Self {
        self.material = Some(name.into());
        self
    }

    /// From vertices (n, 3), m, and triangles (m, 3) of their numbers.
    ///
    /// Corners at exactly equal positions are joined: triangles that list copies of a corner, as
    /// those of STL do, name the first of them and become neighbours.
    ///
    /// # Errors
    /// `EntryNotFinite`, `TooFar`, `TooMany`, `Empty`, `NoSuchVertex`, `FlatTriangle`,
    /// `NotASurface`.
    pub fn new(vertices: &[[f64; 3]], triangles: &[[usize; 3]]) -> Result<Self, TerrainError> {
        if triangles.is_empty() {
            return Err(TerrainError::NoTriangles);
        }
        for count in [triangles.len(), vertices.len()] {
            let limit = MAX_TRIANGLES;
            if count > limit {
                return Err(TerrainError::TooMany { count, limit });
            }
        }
        for (index, vertex) in vertices.iter().enumerate() {
            (vertex.iter()).try_for_each(|&x| check_entry("vertices", index, x))?;
        }
        let first = find_first_copies(vertices);
        let vertices: Vec<_> = vertices.iter().map(|&v| Vector3::from(v)).collect();
        let mut normals = Vec::with_capacity(triangles.len());
        let mut balls = Vec::with_capacity(triangles.len());
        let mut own = Vec::with_capacity(triangles.len());
        for (index, triangle) in triangles.iter().enumerate() {
            if let Some(&vertex) = triangle.iter().find(|&&v| v >= vertices.len()) {
                return Err(TerrainError::NoSuchVertex {
                    index,
                    vertex,
                    vertices: vertices.len(),
                });
            }
            let [a, b, c] = triangle.map(|v| vertices[v]);
            let (ab, ac) = (b - a, c - a);
            let area = ab.cross(&ac);
            let longest = ab
                .norm_squared()
                .max(ac.norm_squared())
                .max((c - b).norm_squared());
            if area.norm() <= 1e-9 * longest {
                return Err(TerrainError::FlatTriangle { index });
            }
            normals.push(area.normalize());
            let centre = (a + b + c) / 3.0;
            let radius = [a, b, c]
                .map(|x| (x - centre).norm())
                .into_iter()
                .fold(0.0, f64::max);
            balls.push(Sphere { centre, radius });
            own.push(triangle.map(|v| first[v]));
        }
        let neighbours = find_neighbours(&own)?;
        let (owners, begins, spokes) = find_spokes(&own, vertices.len());
        Ok(Self {
            material: None,
            vertices,
            triangles: own,
            normals,
            is_closed: neighbours.iter().flatten().all(|&t| t != NONE),
            neighbours,
            owners,
            begins,
            spokes,
            tree: BallTree::new(&balls),
            boxes: OnceLock::new(),
        })
    }

    /// Vertices, m.
    #[must_use]
    pub fn vertices(&self) -> &[Vector3<f64>] {
        &self.vertices
    }

    /// Triangles, by the numbers of their vertices.
    #[must_use]
    pub fn triangles(&self) -> &[[u32; 3]] {
        &self.triangles
    }

    /// Whether no triangle has a border.
    #[must_use]
    pub fn is_closed(&self) -> bool {
        self.is_closed
    }

    fn bounding_boxes(&self) -> BoxTree {
        let bounds = |triangle: &[u32; 3]| {
            let corners = triangle.map(|v| self.vertices[v as usize]);
            let of_corner = |x: &Vector3<f64>| Bounds { low: *x, high: *x };
            let corners = corners.iter().map(of_corner);
            corners.fold(Bounds::NOTHING, |all, one| all.with(&one))
        };
        let boxes: Vec<Bounds> = self.triangles.iter().map(bounds).collect();
        BoxTree::new(&boxes)
    }

    fn ends(&self, t: usize, k: usize) -> [Vector3<f64>; 2] {
        let triangle = &self.triangles[t];
        [triangle[k], triangle[(k + 1) % 3]].map(|v| self.vertices[v as usize])
    }

    /// The normal beyond an edge; at a border the one that points out.
    fn normal_beyond(&self, t: usize, k: usize) -> Vector3<f64> {
        match self.neighbours[t][k] {
            NONE => {
                let [a, b] = self.ends(t, k);
                (b - a).cross(&self.normals[t]).normalize()
            }
            other => self.normals[other as usize],
        }
    }

    fn hinge(&self, t: usize, k: usize) -> Hinge {
        let [a, b] = self.ends(t, k);
        Hinge::new(&a, &b, [&self.normals[t], &self.normal_beyond(t, k)])
    }

    fn wall(&self, t: usize, k: usize) -> EdgeHalfSpace {
        let other = self.neighbours[t][k] as usize;
        if self.neighbours[t][k] == NONE || t < other {
            return self.hinge(t, k).walls[0];
        }
        let same = |&l: &usize| {
            self.neighbours[other][l] as usize == t && {
                let (own, its) = (&self.triangles[t], &self.triangles[other]);
                its[l] == own[(k + 1) % 3]
            }
        };
        let l = (0..3).find(same).unwrap_or(0);
        self.hinge(other, l).walls[1]
    }

    /// Number of an edge as the triangle beyond it counts it; its own at a border.
    fn same_edge(&self, t: usize, k: usize) -> u32 {
        let (own, other) = (&self.triangles[t], self.neighbours[t][k]);
        let l = match self.triangles.get(other as usize) {
            Some(its) => (0..3).find(|&l| its[l] == own[(k + 1) % 3] && its[(l + 1) % 3] == own[k]),
            None => None,
        };
        l.map_or(3 * narrow(t) + narrow(k), |l| 3 * other + narrow(l))
    }

    /// Whether a place is farther than `reach` in front of a triangle's plane, or beside it.
    fn is_beyond(&self, t: usize, place: &Vector3<f64>, reach: f64) -> bool {
        let n = &self.normals[t];
        let is_beside = |k: usize| {
            let [a, b] = self.ends(t, k);
            let out = (b - a).cross(n);
            let distance = out.dot(&(place - a));
            distance > 0.0 && distance * distance > reach * reach * out.norm_squared()
        };
        let [a, _] = self.ends(t, 0);
        n.dot(&(place - a)) > reach || (0..3).any(is_beside)
    }

    fn visit_triangles(&self, centre: &Vector3<f64>, reach: f64, mut visit: impl FnMut(u32)) {
        self.tree.visit_near(centre, reach, |t, _| {
            if !self.is_beyond(t as usize, centre, reach) {
                visit(t);
            }
        });
    }

    /// Visits a triangle and the convex edges and vertices that are its own.
    fn visit_pieces(&self, t: u32, visit: &mut dyn FnMut(u32, &Primitive)) {
        let m = narrow(self.triangles.len());
        visit(t, &Primitive::Face(self.face(t as usize)));
        for k in 0..3 {
            if let Some(edge) = self.edge(t as usize, k) {
                visit(m + 3 * t + narrow(k), &Primitive::Edge(edge));
            }
        }
        for v in self.triangles[t as usize] {
            if self.owners[v as usize] == t {
                visit(4 * m + v, &Primitive::Vertex(self.vertex(v as usize)));
            }
        }
    }

    fn face(&self, t: usize) -> Face {
        let [a, _] = self.ends(t, 0);
        Face {
            plane: Plane::through(&a, self.normals[t]),
            walls: [0, 1, 2].map(|k| self.wall(t, k)),
        }
    }

    /// The edge, if it is convex and the triangle's own.
    fn edge(&self, t: usize, k: usize) -> Option<Edge> {
        let other = self.neighbours[t][k];
        if (other as usize) < t || !self.hinge(t, k).is_convex {
            return None;
        }
        let [start, end] = self.ends(t, k);
        let length = (end - start).norm();
        Some(Edge {
            start,
            along: (end - start) / length,
            length,
            normals: [self.normals[t], self.normal_beyond(t, k)],
        })
    }

    /// A vertex. Of more neighbours than it can keep it keeps those around it.
    fn vertex(&self, i: usize) -> Vertex {
        let place = self.vertices[i];
        let range = self.begins[i] as usize..self.begins[i + 1] as usize;
        let all = &self.spokes[range];
        let from_here = |&j: &u32| self.vertices[j as usize] - place;
        Vertex::among(
            place,
            all.iter().map(from_here),
            &self.normals[self.owners[i] as usize],
        )
    }

    /// Visits the height at which each triangle crosses the vertical through (x, z), and whether it
    /// faces up. Of triangles that share an edge one has it.
    fn visit_crossings(&self, x: f64, z: f64, mut visit: impl FnMut(f64, bool)) {
        self.tree.visit_column_indexed(x, z, |t| {
            let triangle = &self.triangles[t as usize];
            let is_left = |a: u32, b: u32| {
                let (low, high) = (a.min(b), a.max(b));
                let (p, q) = (&self.vertices[low as usize], &self.vertices[high as usize]);
                let (dx, dz) = (q.x - p.x, q.z - p.z);
                let side = dz * (x - p.x) - dx * (z - p.z);
                // A point on an edge is taken to be a little further along x, and less along z.
                let sides = [side, dz, -dx];
                let is_left = sides
                    .iter()
                    .find(|s| s.abs() > 0.0)
                    .is_some_and(|s| *s > 0.0);
                is_left == (low == a)
            };
            let [a, b, c] = *triangle;
            let sides = [is_left(a, b), is_left(b, c), is_left(c, a)];
            let n = &self.normals[t as usize];
            if sides.iter().all(|&s| s == sides[0]) && n.y.abs() > 1e-12 {
                let p = &self.vertices[a as usize];
                let y = p.y - (n.x * (x - p.x) + n.z * (z - p.z)) / n.y;
                visit(y, n.y > 0.0);
            }
        });
    }
}

fn narrow(x: usize) -> u32 {
    u32::try_from(x).unwrap_or_else(|_| unreachable!("invariant: few triangles"))
}

/// Triangles beyond the edges of each.
/// Number of the first vertex at the position of each; −0 equals 0.
fn find_first_copies(vertices: &[[f64; 3]]) -> Vec<u32> {
    let mut first = HashMap::with_capacity(vertices.len());
    let place = |vertex: &[f64; 3]| vertex.map(|x| (x + 0.0).to_bits());
    let all = vertices.iter().enumerate();
    all.map(|(index, vertex)| *first.entry(place(vertex)).or_insert(narrow(index)))
        .collect()
}

fn find_neighbours(triangles: &[[u32; 3]]) -> Result<Vec<[u32; 3]>, TerrainError> {
    let mut edges = HashMap::with_capacity(3 * triangles.len());
    for (index, triangle) in triangles.iter().enumerate() {
        for k in 0..3 {
            let (from, to) = (triangle[k], triangle[(k + 1) % 3]);
            if edges.insert((from, to), narrow(index)).is_some() {
                return Err(TerrainError::NotASurface {
                    index,
                    from: from as usize,
                    to: to as usize,
                });
            }
        }
    }
    let beyond = |triangle: &[u32; 3], k: usize| {
        let back = (triangle[(k + 1) % 3], triangle[k]);
        edges.get(&back).copied().unwrap_or(NONE)
    };
    let all = triangles.iter();
    Ok(all
        .map(|triangle| [0, 1, 2].map(|k| beyond(triangle, k)))
        .collect())
}

/// First triangle of each vertex, and the neighbours of all vertices.
fn find_spokes(triangles: &[[u32; 3]], n: usize) -> (Vec<u32>, Vec<u32>, Vec<u32>) {
    let mut owners = vec![NONE; n];
    let mut pairs = Vec::with_capacity(6 * triangles.len());
    for (t, triangle) in triangles.iter().enumerate().rev() {
        for k in 0..3 {
            let (a, b) = (triangle[k], triangle[(k + 1) % 3]);
            owners[a as usize] = narrow(t);
            pairs.extend([(a, b), (b, a)]);
        }
    }
    pairs.sort_unstable();
    pairs.dedup();
    let mut begins = vec![0; n + 1];
    for &(a, _) in &pairs {
        begins[a as usize + 1] += 1;
    }
    for i in 0..n {
        begins[i + 1] += begins[i];
    }
    (owners, begins, pairs.into_iter().map(|(_, b)| b).collect())
}

impl Terrain for TriangleMesh {
    fn visit_spheres(&self, _: &Vector3<f64>, _: f64, _: &mut dyn FnMut(u32, &Sphere)) {}

    fn visit_near(
        &self,
        centre: &Vector3<f64>,
        reach: f64,
        visit: &mut dyn FnMut(u32, &Primitive),
    ) {
        self.visit_triangles(centre, reach, |t| self.visit_pieces(t, visit));
    }

    fn visit_around(&self, part: &Neighbourhood<'_>, visit: &mut dyn FnMut(u32, &Primitive)) {
        let solid = part.solid();
        self.visit_triangles(&part.centre, part.radius(), |t| {
            let corners = self.triangles[t as usize].map(|v| self.vertices[v as usize]);
            if !solid.is_clear_of(&corners, || [self.normals[t as usize]]) {
                self.visit_pieces(t, visit);
            }
        });
    }

    fn can_be_passed(&self) -> bool {
        false
    }

    fn has_surface(&self) -> bool {
        true
    }

    fn primitive(&self, id: u32) -> Primitive {
        let (id, m) = (id as usize, self.triangles.len());
        if id < m {
            Primitive::Face(self.face(id))
        } else if id < 4 * m {
            let (t, k) = ((id - m) / 3, (id - m) % 3);
            let edge = self.edge(t, k);
            Primitive::Edge(
                edge.unwrap_or_else(|| unreachable!("invariant: edge {id} was visited")),
            )
        } else {
            Primitive::Vertex(self.vertex(id - 4 * m))
        }
    }

    fn material(&self, _id: u32) -> &str {
        self.material.as_deref().unwrap_or(GROUND)
    }

    fn n_primitives(&self) -> u32 {
        narrow(4 * self.triangles.len() + self.vertices.len())
    }

    fn visit_rims(&self, visit: &mut dyn FnMut(&BorderEdge)) {
        let m = narrow(self.triangles.len());
        for (t, triangle) in self.triangles.iter().enumerate() {
            for k in 0..3 {
                let other = self.neighbours[t][k];
                let is_border = other == NONE;
                let beyond = (!is_border).then(|| self.normal_beyond(t, k));
                if !is_border && !self.hinge(t, k).is_convex {
                    continue;
                }
                let [start, end] = self.ends(t, k);
                let own = 3 * narrow(t) + narrow(k);
                visit(&BorderEdge {
                    face: narrow(t),
                    wall: k,
                    piece: Some(m + own.min(self.same_edge(t, k))),
                    corners: [triangle[k], triangle[(k + 1) % 3]].map(|v| 4 * m + v),
                    start,
                    end,
                    normal: self.normals[t],
                    beyond,
                });
            }
        }
    }

    fn rim_corner(&self, id: u32) -> Vertex {
        self.vertex(id as usize - 4 * self.triangles.len())
    }

    /// Known if no border and no edge where it turns under crosses the rectangle, and there is
    /// ground at its middle. What is closed, such as a rock, does not end the ground.
    fn covers(&self, area: &Area, is_joined: &dyn Fn(u32) -> bool) -> Coverage {
        let m = narrow(self.triangles.len());
        let mut coverage = Coverage::Silent;
        let [x, z] = area.middle();
        if self.height(x, z).is_some() {
            coverage = Coverage::Known;
        }
        let place = Vector3::new(x, 0.0, z);
        self.tree.visit_pillar_indexed(&place, area.radius(), |t| {
            let t = t as usize;
            let faces_up = |n: &Vector3<f64>| n.y > UPRIGHT;
            if !faces_up(&self.normals[t]) {
                return;
            }
            for k in 0..3 {
                let other = self.neighbours[t][k];
                let ends_here = other == NONE || !faces_up(&self.normals[other as usize]);
                let own = 3 * narrow(t) + narrow(k);
                let is_crossed = || area.is_crossed(&self.ends(t, k).map(|p| [p.x, p.z]));
                if ends_here && is_crossed() && !is_joined(m + own.min(self.same_edge(t, k))) {
                    coverage = if self.is_closed {
                        Coverage::Silent
                    } else {
                        Coverage::Unknown([x, z])
                    };
                }
            }
        });
        coverage
    }

    /// Whether an odd number of triangles is above the point.
    fn is_inside(&self, _id: u32, point: &Vector3<f64>) -> bool {
        let mut above = 0;
        self.visit_crossings(point.x, point.z, |y, _| {
            above += usize::from(y > point.y - SURFACE);
        });
        above % 2 == 1
    }

    /// What is next above the place must face up, so that a hall of inward faces is not solid.
    /// Below an open surface, such as a bridge, there may be free space.
    fn buries(&self, place: &Vector3<f64>, within: f64) -> bool {
        let mut next = (f64::INFINITY, false);
        self.visit_crossings(place.x, place.z, |y, faces_up| {
            if y > place.y - SURFACE && y < next.0 {
                next = (y, faces_up);
            }
        });
        next.1 && (self.is_closed || next.0 - place.y <= within)
    }

    fn coverage(&self, _centre: &Vector3<f64>, _radius: f64) -> Coverage {
        Coverage::Silent
    }

    fn furthest(&self, n: &Vector3<f64>, centre: &Vector3<f64>, radius: f64) -> f64 {
        let place = Vector3::new(centre.x, 0.0, centre.z);
        let mut furthest = f64::NEG_INFINITY;
        self.tree.visit_pillar(&place, radius, |ball| {
            furthest = furthest.max(n.dot(&ball.centre) + ball.radius);
        });
        furthest
    }

    fn first_hit(&self, ray: &Ray, reach: f64) -> Option<Hit> {
        let sheared = Sheared::new(ray);
        let mut nearest = None;
        let boxes = self.boxes.get_or_init(|| self.bounding_boxes());
        boxes.visit_along(ray, reach, |t, reach| {
            let corners = self.triangles[t as usize].map(|v| self.vertices[v as usize]);
            let Some(distance) = sheared.distance(&corners, reach) else {
                return reach;
            };
            nearest = Some((distance, t));
            distance
        });
        nearest.map(|(distance, t)| Hit {
            distance,
            normal: self.normals[t as usize],
        })
    }

    fn height(&self, x: f64, z: f64) -> Option<f64> {
        let mut highest: Option<f64> = None;
        self.visit_crossings(x, z, |y, faces_up| {
            if faces_up {
                highest = Some(highest.map_or(y, |h| h.max(y)));
            }
        });
        highest
    }

    fn ground(&self) -> Option<&Plane> {
        None
    }
}

/// Vertical part of a normal below which a triangle covers nothing, seen from above.
const UPRIGHT: f64 = 1e-12;

/// How far above the surface a point that is in the ground may seem to be by rounding, m.
const SURFACE: f64 = 1e-9;
