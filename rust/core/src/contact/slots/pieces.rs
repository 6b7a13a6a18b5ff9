//! The pieces of a surface that a wheel with one circle, a thin disc or a torus, may touch for the
//! next steps, lane by lane.
//!
//! They are searched when the wheel has moved further than the last search looked ahead. In between
//! all lanes compare their wheels with them at once: a face touches if the lowest point of the rim
//! over its plane is over it. Where the wheel may touch an edge or a vertex, or is deep in the
//! ground, its contacts are found lane by lane.
//!
//! What is kept decides only what need not be compared: a face touches with the same bits here and
//! where contacts are found lane by lane, and in the same order. So a step does not depend on when
//! a search was made.

use std::sync::Arc;

use nalgebra::Vector3;

use crate::geometry::terrain::surface::{Edge, EdgeHalfSpace, Face, LEAN, OVERLAP};
use crate::geometry::{Disc, Primitive, Terrain};
use crate::scalar::{Lane, LaneMask, MAX_LANES, Vec3};

/// Most pieces near a wheel.
const MAX_FACES: usize = 12;
const MAX_EDGES: usize = 12;
const MAX_TIPS: usize = 6;

/// How far a wheel may move before the next search, m: first, and where that finds too many pieces.
/// Twice as far finds more pieces, which every step examines, and searches half as often.
const AHEAD: [f64; 2] = [0.08, 0.0];

/// How far before a wheel that rolls on a search is made, as a share of how far it may move.
const FORTH: f64 = 0.8;

/// How deep the rim may be in the ground, in radii, for its contacts to be those of the kept
/// pieces: a search finds no more than that beside it.
const DEEP: f64 = 0.02;

/// Cosine and sine of the places of the rim that are measured, from its lowest point.
const SIDES: [[f64; 2]; 3] = [[1.0, 0.0], [0.88, 0.475], [0.88, -0.475]];

/// Covers the rounding of distances, m.
const ROUNDING: f64 = 1e-6;

/// A disc in every lane, swept by a ball.
#[derive(Clone, Copy)]
pub(crate) struct LaneDisc<T> {
    /// World, m.
    pub centre: Vec3<T>,
    /// Unit.
    pub axle: Vec3<T>,
    /// Radius of the disc, m.
    pub radius: f64,
    /// Radius of the ball, m.
    pub rounding: f64,
    /// How near it must come to the ground to touch it, m.
    pub reach: T,
}

/// A plane of every lane: `normal · x + offset = 0`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LanePlane<T> {
    pub normal: Vec3<T>,
    pub offset: T,
}

/// A face of every lane.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LaneFace<T> {
    pub plane: LanePlane<T>,
    /// Normal and offset of the walls around what is over it, and lanes where they are open.
    walls: [(Vec3<T>, T, u32); 3],
}

/// A convex edge of every lane.
#[derive(Clone, Copy, Debug)]
struct LaneEdge<T> {
    start: Vec3<T>,
    along: Vec3<T>,
    length: T,
    /// Unit normals of the edge's two faces.
    normals: [Vec3<T>; 2],
}

/// Pieces of a kind.
#[derive(Clone, Debug)]
struct Kept<P, const N: usize> {
    pieces: [P; N],
    counts: [usize; MAX_LANES],
    /// The largest count.
    most: usize,
}

/// The pieces near a wheel.
#[derive(Clone, Debug)]
pub(crate) struct Pieces<T> {
    faces: Kept<LaneFace<T>, MAX_FACES>,
    edges: Kept<LaneEdge<T>, MAX_EDGES>,
    /// Convex vertices.
    tips: Kept<Vec3<T>, MAX_TIPS>,
    /// Place and axle of the wheel at the last search, world, m.
    from: Vec3<T>,
    axle: Vec3<T>,
    /// How far it may have moved from there, and the largest reach for which it holds, m.
    moves: T,
    reach: T,
}

impl<T: Lane> Pieces<T> {
    /// Nothing anywhere.
    pub fn new(token: T::Token) -> Self {
        let nowhere = Vec3::splat(token, [0.0; 3]);
        let never = T::splat(token, f64::INFINITY);
        let face = LaneFace {
            plane: LanePlane {
                normal: nowhere,
                offset: never,
            },
            walls: [(nowhere, never, 0); 3],
        };
        let edge = LaneEdge {
            start: nowhere,
            along: nowhere,
            length: -never,
            normals: [nowhere; 2],
        };
        Self {
            faces: Kept::new(face),
            edges: Kept::new(edge),
            tips: Kept::new(Vec3::new(never, never, never)),
            from: nowhere,
            axle: nowhere,
            moves: -never,
            reach: -never,
        }
    }

    /// Forgets what is known of a lane's ground.
    pub fn forget(&mut self, lane: usize) {
        self.moves.set(lane, f64::NEG_INFINITY);
        self.keep(lane, &[]);
    }

    /// Finds the pieces near the wheels of some lanes. Returns the lanes where they are known.
    #[inline(always)]
    pub fn find(
        &mut self,
        surfaces: &[Option<Arc<dyn Terrain>>],
        lanes: T::Mask,
        rim: &LaneDisc<T>,
    ) -> T::Mask {
        let turned = (rim.axle - self.axle).norm() * rim.reach.like(1.5 * rim.outer());
        let moved = (rim.centre - self.from).norm() + turned;
        let is_known = moved.le(self.moves) & rim.reach.le(self.reach);
        let mut unknown = (lanes & !is_known).bits();
        let mut others = 0;
        while unknown != 0 {
            let lane = unknown.trailing_zeros() as usize;
            unknown &= unknown - 1;
            let terrain = surfaces[lane].as_deref();
            if !terrain.is_some_and(|terrain| self.search(lane, terrain, rim)) {
                if self.moves.get(lane) > f64::NEG_INFINITY {
                    self.forget(lane);
                }
                others |= 1 << lane;
            }
        }
        let rim_points = rim.low_points();
        for (lane, terrain) in surfaces.iter().enumerate() {
            if (lanes.bits() & !others) >> lane & 1 == 1
                && let Some(terrain) = terrain
                && rim_points
                    .iter()
                    .any(|x| is_deep(&**terrain, x.get(lane), DEEP * rim.outer()))
            {
                others |= 1 << lane;
            }
        }
        lanes & !T::mask(rim.reach.token(), others)
    }

    /// Searches the ground of one lane, about a place to which the wheel rolls on if that may do.
    /// False where there are too many pieces, or it is too steep.
    #[cold]
    fn search(&mut self, lane: usize, terrain: &dyn Terrain, rim: &LaneDisc<T>) -> bool {
        let centre = Vector3::from(rim.centre.get(lane));
        let way = centre - Vector3::from(self.from.get(lane));
        let (length, moves) = (way.norm(), self.moves.get(lane));
        // One that has turned, or jumped, does not roll on.
        let rolls_on = moves > 0.0 && length > 0.5 * moves && length < 2.0 * moves;
        let ahead = centre + way * (FORTH * moves / length);
        (rolls_on && self.search_about(lane, terrain, rim, ahead))
            || self.search_about(lane, terrain, rim, centre)
    }

    /// Searches the ground of one lane about a place from which its wheel is not too far.
    fn search_about(
        &mut self,
        lane: usize,
        terrain: &dyn Terrain,
        rim: &LaneDisc<T>,
        place: Vector3<f64>,
    ) -> bool {
        let disc = Disc {
            centre: place,
            axle: rim.axle.get(lane).into(),
            spoke: Vector3::zeros(),
            radius: rim.radius,
        };
        let off = (place - Vector3::from(rim.centre.get(lane))).norm();
        let reach = rim.reach.get(lane) + 2.0 * ROUNDING;
        AHEAD.iter().any(|&ahead| {
            if off > ahead {
                return false;
            }
            let mut found = [None; MAX_FACES + MAX_EDGES + MAX_TIPS];
            let mut n = 0;
            let moves = terrain.visit_ahead((&disc, rim.rounding), [reach, ahead], &mut |piece| {
                if let Some(place) = found.get_mut(n) {
                    *place = Some(*piece);
                }
                n += 1;
            });
            let Some(moves) = moves.filter(|moves| off <= moves - ROUNDING) else {
                return false;
            };
            let fits = (found.get(..n)).is_some_and(|found| self.keep(lane, found));
            if fits {
                self.from.set(lane, disc.centre.into());
                self.axle.set(lane, disc.axle.into());
                self.moves.set(lane, moves - ROUNDING);
                self.reach.set(lane, rim.reach.get(lane));
            }
            fits
        })
    }

    /// Replaces the pieces of a lane. False if they do not fit.
    fn keep(&mut self, lane: usize, found: &[Option<Primitive>]) -> bool {
        let mut counts = [0; 3];
        for piece in found.iter().flatten() {
            let (kind, most) = match piece {
                Primitive::Face(_) => (0, MAX_FACES),
                Primitive::Edge(_) => (1, MAX_EDGES),
                _ => (2, MAX_TIPS),
            };
            let k = counts[kind];
            if k == most {
                return false;
            }
            match piece {
                Primitive::Face(face) => self.faces.pieces[k].set(lane, face),
                Primitive::Edge(edge) => self.edges.pieces[k].set(lane, edge),
                Primitive::Vertex(tip) => self.tips.pieces[k].set(lane, tip.place.into()),
                Primitive::Plane(_) | Primitive::Sphere(_) => return false,
            }
            counts[kind] += 1;
        }
        for face in &mut self.faces.pieces[counts[0]..] {
            face.plane.offset.set(lane, f64::INFINITY);
        }
        for edge in &mut self.edges.pieces[counts[1]..] {
            edge.length.set(lane, f64::NEG_INFINITY);
        }
        for tip in &mut self.tips.pieces[counts[2]..] {
            tip.set(lane, [f64::INFINITY; 3]);
        }
        self.faces.count(lane, counts[0]);
        self.edges.count(lane, counts[1]);
        self.tips.count(lane, counts[2]);
        true
    }

    /// The faces, for the lane that has most.
    #[inline(always)]
    pub fn faces(&self) -> &[LaneFace<T>] {
        &self.faces.pieces[..self.faces.most]
    }

    /// Where a wheel may touch an edge or a vertex.
    #[inline(always)]
    pub fn may_touch_others(&self, rim: &LaneDisc<T>) -> T::Mask {
        let like = rim.reach;
        let (radius, rounding) = (like.like(rim.radius), like.like(ROUNDING));
        let near = rim.reach + rounding + rounding.like(rim.rounding);
        let (overlap, beyond) = (like.like(OVERLAP), like.like(LEAN));
        let zero = like.like(0.0);
        let mut touched = zero.lt(zero);
        for edge in &self.edges.pieces[..self.edges.most] {
            let from = rim.centre - edge.start;
            let [first, second] = edge.normals.map(
                #[inline(always)]
                |n| {
                    let across = n - rim.axle * n.dot(rim.axle);
                    let length = across.norm();
                    let low = from - across * (radius / length);
                    let lean = n.cross(edge.along).dot(low);
                    (n.dot(from) - radius * length, lean, low.dot(edge.along))
                },
            );
            let over = beyond * edge.length + rounding;
            touched = touched
                | (first.0.le(near)
                    & second.0.le(near)
                    & first.1.lt(overlap)
                    & (-overlap).lt(second.1)
                    & (-over).le(first.2.max(second.2))
                    & first.2.min(second.2).le(edge.length + over));
        }
        for tip in &self.tips.pieces[..self.tips.most] {
            let from = rim.centre - *tip;
            let beside = from.dot(rim.axle);
            let abreast = (from.dot(from) - beside * beside).max(zero).sqrt();
            let beyond = (abreast - radius).max(zero);
            touched = touched | (beside * beside + beyond * beyond).le(near * near);
        }
        touched
    }
}

impl<T: Lane> LaneDisc<T> {
    /// Outer radius, m.
    fn outer(&self) -> f64 {
        self.radius + self.rounding
    }

    /// The lowest point of the rim and one to either side, world, m.
    #[inline(always)]
    fn low_points(&self) -> [Vec3<T>; 3] {
        let like = self.reach;
        let s = self.axle;
        let up = Vec3::new(-(s.x * s.y), like.like(1.0) - s.y * s.y, -(s.z * s.y));
        let up = up * (like.like(1.0) / up.norm());
        let along = up.cross(s);
        SIDES.map(
            #[inline(always)]
            |[a, b]| {
                let [a, b] = [a, b].map(|x| like.like(x * self.outer()));
                self.centre - up * a + along * b
            },
        )
    }
}

/// Whether a point is further than `depth` (m) below a surface, or over none.
fn is_deep(terrain: &dyn Terrain, [x, y, z]: [f64; 3], depth: f64) -> bool {
    !terrain
        .height(x, z)
        .is_some_and(|height| y >= height - depth)
}

impl<P: Copy, const N: usize> Kept<P, N> {
    fn new(none: P) -> Self {
        Self {
            pieces: [none; N],
            counts: [0; MAX_LANES],
            most: 0,
        }
    }

    /// Enters the number of a lane's pieces.
    fn count(&mut self, lane: usize, n: usize) {
        self.counts[lane] = n;
        self.most = self.counts.iter().fold(0, |most, &n| most.max(n));
    }
}

impl<T: Lane> LanePlane<T> {
    /// Height of a point over the plane, m.
    #[inline(always)]
    pub fn height(&self, x: Vec3<T>) -> T {
        self.normal.dot(x) + self.offset
    }
}

impl<T: Lane> LaneFace<T> {
    fn set(&mut self, lane: usize, face: &Face) {
        self.plane.normal.set(lane, (*face.plane.normal()).into());
        self.plane.offset.set(lane, face.plane.offset());
        for (own, wall) in self
            .walls
            .iter_mut()
            .zip(face.walls.each_ref().map(EdgeHalfSpace::parts))
        {
            let (normal, offset, is_open) = wall;
            own.0.set(lane, (*normal).into());
            own.1.set(lane, offset);
            own.2 = (own.2 & !(1 << lane)) | u32::from(is_open) << lane;
        }
    }

    /// Where a point (world, m) is over the face, or under it.
    #[inline(always)]
    pub fn admits(&self, x: Vec3<T>) -> T::Mask {
        let mut admits = self.plane.offset.le(self.plane.offset);
        for (normal, offset, is_open) in &self.walls {
            let is_open = T::mask(offset.token(), *is_open);
            let is_past = offset.le(normal.dot(x));
            admits = admits & ((is_past & !is_open) | (!is_past & is_open));
        }
        admits
    }
}

impl<T: Lane> LaneEdge<T> {
    fn set(&mut self, lane: usize, edge: &Edge) {
        self.start.set(lane, edge.start.into());
        self.along.set(lane, edge.along.into());
        self.length.set(lane, edge.length);
        for (own, n) in self.normals.iter_mut().zip(&edge.normals) {
            own.set(lane, (*n).into());
        }
    }
}
