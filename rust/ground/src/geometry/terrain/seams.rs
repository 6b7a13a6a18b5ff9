//! Where the parts of a ground meet: their borders are inner edges of the union.
//!
//! A part knows only itself. At its border, and at the upper edge of a block, it bends away from
//! the free side and would push a body that slides on to its neighbour. So the edges of every part,
//! its [`BorderEdge`]s, are compared once with the faces of the others. Where a face goes on beyond
//! an edge, the union has the edge between these two faces: no piece if they are flat or form a
//! valley, a ridge otherwise. What is left of the edge stays as it was. At corners there, the edges
//! of all parts bound the vertex.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use nalgebra::Vector3;

use super::surface::{BorderEdge, Edge, Face, Hinge, Vertex};
use super::{Plane, Primitive, Terrain};
use crate::geometry::broad_phase::BallTree;
use crate::geometry::query::any_tangent;
use crate::geometry::shape::Sphere;

/// Distance within which an edge and a face meet, in lengths of the edge, and in coordinates:
/// places of single precision are that accurate.
const TOLERANCE: f64 = 1e-5;
const SINGLE: f64 = 1e-7;

/// Sine of the angle between two parts below which they meet flat.
const FLAT: f64 = 1e-5;

/// Difference of two unit directions that count as one.
const SAME_WAY: f64 = 1e-4;

/// How far below the surface of the other side an edge is buried, in its rise: less than half, as
/// its middle is looked at, and more than edges along the seam.
const DEEP: f64 = 0.1;

/// Cosine between the normals of two faces below which they lie back to back.
const BACK: f64 = -0.9;

/// What changes where parts meet. Numbers are those of the union.
#[derive(Clone, Debug, Default)]
pub(super) struct Seams {
    /// Edges and vertices of parts that are none of the union.
    hidden: BTreeSet<u32>,
    /// Edges of meshes beyond all of which the ground goes on.
    joined: BTreeSet<u32>,
    /// Faces with other walls.
    faces: BTreeMap<u32, Face>,
    /// Edges and vertices of the union, and the face whose material they have.
    pieces: Vec<(Primitive, u32)>,
    tree: Option<BallTree>,
    /// Distance within which parts meet, m.
    pub tolerance: f64,
}

/// Where a face of another part goes on beyond a rim.
#[derive(Clone, Copy, Debug)]
struct Stretch {
    /// From the rim's start, m.
    from: f64,
    to: f64,
    /// Unit normal of that face.
    normal: Vector3<f64>,
}

/// A piece of a part that parts of others replace.
struct Replaced {
    start: Vector3<f64>,
    end: Vector3<f64>,
    normals: [Vector3<f64>; 2],
    face: u32,
    stretches: Vec<[f64; 2]>,
}

/// A face at a vertex, and the direction away from it.
struct Corner {
    face: u32,
    normal: Vector3<f64>,
    outward: Vector3<f64>,
}

/// A direction along a rim, that away from its face, and how near others must come.
struct Line<'a> {
    rim: &'a BorderEdge,
    along: Vector3<f64>,
    outward: Vector3<f64>,
    length: f64,
    tolerance: f64,
}

impl Seams {
    /// Finds the seams between parts whose pieces are numbered from `first` on.
    pub fn find(parts: &[Arc<dyn Terrain>], first: &[u32]) -> Self {
        let mut seams = Self::default();
        let has_faces = |part: &Arc<dyn Terrain>| part.has_surface() || part.ground().is_some();
        if parts.iter().filter(|part| has_faces(part)).count() < 2 {
            return seams;
        }
        let mut replaced: BTreeMap<u32, Replaced> = BTreeMap::new();
        let mut corners: BTreeMap<(usize, u32), Corner> = BTreeMap::new();
        let mut least = f64::INFINITY;
        let others_of = |a: usize| {
            let others = parts.iter().enumerate();
            let others = others.filter(move |(b, other)| *b != a && has_faces(other));
            others.map(|(_, other)| &**other)
        };
        for (a, part) in parts.iter().enumerate() {
            let (mut sum, mut n) = (0.0, 0.0);
            part.visit_rims(&mut |rim| {
                let line = Line::new(rim);
                (sum, n) = (sum + line.length, n + 1.0);
                let mut stretches = Vec::new();
                for other in others_of(a) {
                    line.find_stretches(other, &mut stretches);
                }
                let stretches = line.bounding(&stretches);
                if stretches.is_empty() {
                    return;
                }
                for (end, corner) in rim.corners.into_iter().enumerate() {
                    let touches = |s: &Stretch| match end {
                        0 => s.from <= line.tolerance,
                        _ => s.to >= line.length - line.tolerance,
                    };
                    if stretches.iter().any(touches) {
                        corners.entry((a, corner)).or_insert(Corner {
                            face: rim.face,
                            normal: rim.normal,
                            outward: line.outward,
                        });
                    }
                }
                seams.join(&line, (&**part, first[a]), &stretches);
                if let Some(piece) = rim.piece {
                    let own = replaced
                        .entry(first[a] + piece)
                        .or_insert_with(|| line.replaced(first[a]));
                    let is_reversed = (own.start - rim.start).norm() > line.tolerance;
                    own.stretches.extend(stretches.iter().map(|s| {
                        if is_reversed {
                            [line.length - s.to, line.length - s.from]
                        } else {
                            [s.from, s.to]
                        }
                    }));
                }
            });
            if n > 0.0 {
                least = least.min(sum / n);
            }
        }
        seams.tolerance = if least.is_finite() {
            TOLERANCE * least
        } else {
            0.0
        };
        for (piece, own) in replaced {
            seams.replace(piece, own);
        }
        for ((a, corner), at) in corners {
            let others: Vec<&dyn Terrain> = others_of(a).collect();
            seams.place_vertex((&*parts[a], first[a]), (corner, &at), &others);
        }
        let balls: Vec<Sphere> = seams
            .pieces
            .iter()
            .map(|(piece, _)| ball_about(piece))
            .collect();
        seams.tree = (!balls.is_empty()).then(|| BallTree::new(&balls));
        seams
    }

    /// Whether nothing changes.
    pub fn is_empty(&self) -> bool {
        self.hidden.is_empty() && self.faces.is_empty() && self.pieces.is_empty()
    }

    /// Number of its own pieces.
    pub fn n_pieces(&self) -> usize {
        self.pieces.len()
    }

    /// Whether beyond all of an edge of a mesh the ground goes on.
    pub fn is_joined(&self, id: u32) -> bool {
        self.joined.contains(&id)
    }

    /// A piece of a part as the union has it.
    #[inline]
    pub fn shown(&self, id: u32, piece: &Primitive) -> Option<Primitive> {
        match piece {
            Primitive::Face(_) => Some(self.faces.get(&id).map_or(*piece, |f| Primitive::Face(*f))),
            Primitive::Edge(_) | Primitive::Vertex(_) => {
                (!self.hidden.contains(&id)).then_some(*piece)
            }
            Primitive::Plane(_) | Primitive::Sphere(_) => Some(*piece),
        }
    }

    /// An own piece, and the face whose material it has.
    pub fn piece(&self, k: usize) -> &(Primitive, u32) {
        &self.pieces[k]
    }

    /// Visits its own pieces near a place.
    pub fn visit_near(
        &self,
        centre: &Vector3<f64>,
        reach: f64,
        mut visit: impl FnMut(u32, &Primitive),
    ) {
        if let Some(tree) = &self.tree {
            tree.visit_near(centre, reach, |k, _| visit(k, &self.pieces[k as usize].0));
        }
    }

    /// Enters the edges between a rim's face and those that go on beyond it.
    fn join(&mut self, line: &Line<'_>, (part, first): (&dyn Terrain, u32), stretches: &[Stretch]) {
        let rim = line.rim;
        for stretch in stretches {
            let (start, end) = (line.at(stretch.from), line.at(stretch.to));
            let hinge = Hinge::new(&start, &end, [&rim.normal, &stretch.normal]);
            let bend = rim.normal.cross(&line.along).dot(&stretch.normal);
            if bend.abs() <= FLAT {
                continue;
            }
            if hinge.is_convex {
                let edge = Edge {
                    start,
                    along: line.along,
                    length: stretch.to - stretch.from,
                    normals: [rim.normal, stretch.normal],
                };
                self.pieces.push((Primitive::Edge(edge), first + rim.face));
            } else if let Primitive::Face(face) = part.primitive(rim.face) {
                let own = self.faces.entry(first + rim.face).or_insert(face);
                own.walls[rim.wall] = hinge.walls[0];
            }
        }
    }

    /// Replaces an edge of a part by what is left of it.
    fn replace(&mut self, piece: u32, mut own: Replaced) {
        self.hidden.insert(piece);
        let along = own.end - own.start;
        let length = along.norm();
        let along = along / length;
        let tolerance = tolerance_of(&own.start, &own.end);
        own.stretches.sort_by(|a, b| a[0].total_cmp(&b[0]));
        own.stretches.push([length, length]);
        let (mut place, mut is_whole) = (0.0_f64, true);
        for [from, to] in own.stretches {
            if from - place > 4.0 * tolerance {
                is_whole = false;
                let edge = Edge {
                    start: own.start + along * place,
                    along,
                    length: from - place,
                    normals: own.normals,
                };
                self.pieces.push((Primitive::Edge(edge), own.face));
            }
            place = place.max(to);
        }
        if is_whole {
            self.joined.insert(piece);
        }
    }

    /// Replaces a vertex of a part by that of the union, if it is none in the middle of a flat
    /// surface.
    fn place_vertex(
        &mut self,
        (part, first): (&dyn Terrain, u32),
        (corner, at): (u32, &Corner),
        others: &[&dyn Terrain],
    ) {
        self.hidden.insert(first + corner);
        let own = part.rim_corner(corner);
        let place = own.place;
        let (mut spokes, mut beside) = (own.spokes[..own.n].to_vec(), Vec::new());
        let size = spokes
            .iter()
            .map(Vector3::norm)
            .fold(f64::INFINITY, f64::min);
        let tolerance = tolerance_of(&place, &(place + Vector3::x() * size));
        for other in others {
            other.visit_near(&place, 2.0 * tolerance, &mut |_, piece| match piece {
                Primitive::Face(face) => {
                    let mut walls = face.walls.iter();
                    let is_over = walls.all(|wall| wall.beyond(&place) <= tolerance);
                    if is_over && face.plane.distance(&place).abs() <= tolerance {
                        beside.extend(face.corners(&place).map(|x| x - place));
                    }
                }
                Primitive::Plane(plane) if plane.distance(&place).abs() <= tolerance => {
                    let t = any_tangent(plane.normal());
                    let b = t.cross(plane.normal());
                    beside.extend([t, -t, b, -b].map(|x| x * size));
                }
                _ => {}
            });
        }
        beside.retain(|x: &Vector3<f64>| x.norm() > 2.0 * tolerance);
        // What lies in the ground of the other side is no edge of the union.
        let is_flat = |x: &Vector3<f64>| at.normal.dot(x).abs() <= FLAT * x.norm();
        let (aside, within) = (at.outward * (4.0 * tolerance), 10.0 * tolerance);
        let on_way = |x: &Vector3<f64>| place + x * 0.5 + Vector3::y() * (DEEP * x.y.abs());
        spokes.retain(|x| {
            let inside = on_way(x) + aside;
            is_flat(x) || !others.iter().any(|other| other.buries(&inside, within))
        });
        beside.retain(|x| is_flat(x) || !part.buries(&(on_way(x) - aside), within));
        if spokes.iter().chain(&beside).all(is_flat) {
            return;
        }
        for x in beside {
            let is_along = |y: &Vector3<f64>| (x.normalize() - y.normalize()).norm() < SAME_WAY;
            if !spokes.iter().any(is_along) {
                spokes.push(x);
            }
        }
        let vertex = Vertex::among(place, spokes.iter().copied(), &at.normal);
        self.pieces
            .push((Primitive::Vertex(vertex), first + at.face));
    }
}

impl<'a> Line<'a> {
    fn new(rim: &'a BorderEdge) -> Self {
        let way = rim.end - rim.start;
        let length = way.norm();
        Self {
            rim,
            along: way / length,
            outward: way.cross(&rim.normal) / length,
            length,
            tolerance: tolerance_of(&rim.start, &rim.end),
        }
    }

    fn at(&self, place: f64) -> Vector3<f64> {
        self.rim.start + self.along * place
    }

    /// Edge of the rim as its part has it, before any of it is replaced.
    fn replaced(&self, first: u32) -> Replaced {
        let rim = self.rim;
        Replaced {
            start: rim.start,
            end: rim.end,
            normals: [rim.normal, rim.beyond.unwrap_or(self.outward)],
            face: first + rim.face,
            stretches: Vec::new(),
        }
    }

    /// How far a face with the unit normal n beyond the rim rises over the rim's: the sine of the
    /// angle, continued beyond a right angle.
    fn rise(&self, n: &Vector3<f64>) -> f64 {
        let way = self.along.cross(n);
        let [up, out] = [way.dot(&self.rim.normal), way.dot(&self.outward)];
        if out >= 0.0 {
            up
        } else {
            (2.0 - up.abs()).copysign(up)
        }
    }

    /// Parts of stretches that bound the free space: of several faces the highest, if it is higher
    /// than the face that the part itself has there.
    fn bounding(&self, all: &[Stretch]) -> Vec<Stretch> {
        let own = self
            .rim
            .beyond
            .map_or(f64::NEG_INFINITY, |n| self.rise(&n) + FLAT);
        let mut places: Vec<f64> = all.iter().flat_map(|s| [s.from, s.to]).collect();
        places.sort_by(f64::total_cmp);
        let mut out: Vec<Stretch> = Vec::new();
        for pair in places.windows(2) {
            let [from, to] = [pair[0], pair[1]];
            if to - from <= self.tolerance {
                continue;
            }
            let here = all.iter().filter(|s| s.from <= from && s.to >= to);
            let risen = here.map(|s| (self.rise(&s.normal), s.normal));
            let highest = risen.max_by(|a, b| a.0.total_cmp(&b.0));
            let Some((_, normal)) = highest.filter(|(rise, _)| *rise > own) else {
                continue;
            };
            match out.last_mut() {
                Some(last) if from - last.to <= self.tolerance && last.normal == normal => {
                    last.to = to;
                }
                _ => out.push(Stretch { from, to, normal }),
            }
        }
        out
    }

    /// Adds the stretches beyond which a face of another part goes on.
    fn find_stretches(&self, other: &dyn Terrain, out: &mut Vec<Stretch>) {
        let middle = self.at(0.5 * self.length);
        let around = 0.5 * self.length + 2.0 * self.tolerance;
        if self.rim.beyond.is_some() && !other.may_end_near(&middle, around) {
            return;
        }
        other.visit_near(&middle, around, &mut |_, piece| {
            let (plane, walls) = match piece {
                Primitive::Face(face) => (&face.plane, &face.walls[..]),
                Primitive::Plane(plane) => (plane, &[][..]),
                _ => return,
            };
            out.extend(self.stretch_of(plane, walls));
        });
    }

    fn stretch_of(
        &self,
        plane: &Plane,
        walls: &[super::surface::EdgeHalfSpace],
    ) -> Option<Stretch> {
        let n = plane.normal();
        if n.dot(&self.rim.normal) < BACK {
            return None;
        }
        // Just beyond the edge.
        let ahead = self.along.cross(n) * (4.0 * self.tolerance);
        let (mut from, mut to) = (0.0, self.length);
        for wall in walls {
            let [a, b] = [from, to].map(|s| wall.beyond(&(self.at(s) + ahead)) - self.tolerance);
            if a > 0.0 && b > 0.0 {
                return None;
            }
            let crossing = || from + (to - from) * (a / (a - b));
            if a > 0.0 {
                from = crossing();
            } else if b > 0.0 {
                to = crossing();
            }
        }
        let is_near = |s: f64| plane.distance(&self.at(s)).abs() <= self.tolerance;
        (to - from > 4.0 * self.tolerance && is_near(from) && is_near(to)).then_some(Stretch {
            from,
            to,
            normal: *n,
        })
    }
}

/// How near a part must come to an edge, m.
fn tolerance_of(start: &Vector3<f64>, end: &Vector3<f64>) -> f64 {
    TOLERANCE * (end - start).norm() + SINGLE * start.amax().max(end.amax())
}

fn ball_about(piece: &Primitive) -> Sphere {
    match piece {
        Primitive::Edge(edge) => Sphere::new(
            edge.start + edge.along * (0.5 * edge.length),
            0.5 * edge.length,
        ),
        Primitive::Vertex(vertex) => Sphere::new(vertex.place, 0.0),
        _ => unreachable!("invariant: seams have edges and vertices"),
    }
}
