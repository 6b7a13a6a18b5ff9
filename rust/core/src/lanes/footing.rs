//! What a wheel stands on where the ground is a surface: up to [`SLOTS`] planes for each rover.
//!
//! A plane is that of a face under the wheel, or the one through a convex edge or vertex with the
//! contact's normal. Where all pieces near a wheel lie in one plane the wheel keeps it until it has
//! moved further than the search looked ahead, and costs what a wheel on a plane costs. Elsewhere
//! the pieces are searched at every step, rover by rover, and of those that the wheel overlaps the
//! ones count that lead out of the ground, as in [`crate::contact`]. A wheel on more than [`SLOTS`]
//! of them is declined.

use std::sync::Arc;

use nalgebra::Vector3;

use crate::contact::detection::visit_on_surface;
use crate::contact::ways_out::{OverSurfaces, WaysOut};
use crate::geometry::query::dispatch::{point_at_edge, point_at_vertex};
use crate::geometry::query::{NEAREST, SurfacePoint};
use crate::geometry::{Coverage, Disc, Neighbourhood, PlacedShape, Plane, Primitive, Terrain};
use crate::scalar::{Lane, MAX_LANES, Vec3};

/// How far beyond its reach a search for a plane looks, m. Twice as far examines four times as many
/// pieces and searches half as often.
const AHEAD: f64 = 0.1;

/// Covers the rounding of distances, m.
const ROUNDING: f64 = 1e-6;

/// Most points at which a wheel and the pieces of a surface are compared.
const MOST_POINTS: usize = 12;

/// Slots of a wheel.
pub const SLOTS: usize = 3;

/// A plane under a wheel.
#[derive(Clone, Copy, Debug)]
pub struct Underfoot<T> {
    /// Unit normal.
    pub normal: Vec3<T>,
    /// m; ∞ where there is nothing.
    pub offset: T,
    /// Number of the edge or vertex in the terrain.
    pieces: [u32; MAX_LANES],
    /// Lanes with an edge or a vertex.
    bent: u32,
}

/// The planes under a wheel.
#[derive(Clone, Debug)]
pub struct Footing<T> {
    /// One for each slot of the wheel.
    pub planes: [Underfoot<T>; SLOTS],
    /// Place of the wheel's centre at the last search for a plane, world, m.
    from: [Vector3<f64>; MAX_LANES],
    /// Its result holds as far from there as this, m.
    within: [f64; MAX_LANES],
    /// Lanes where it found a plane.
    flat: u32,
    /// Lanes with planes beyond the first, slot by slot.
    filled: [u32; SLOTS],
}

/// The wheels of a block at one instant, lane by lane; coordinates relative to `base`.
pub struct Wheels<'a, T> {
    /// World, m.
    pub base: Vec3<T>,
    /// m.
    pub centre: Vec3<T>,
    /// Unit.
    pub axle: Vec3<T>,
    /// m.
    pub radius: f64,
    /// Terrain of each lane that has a surface.
    pub surfaces: &'a [Option<Arc<dyn Terrain>>],
}

impl<T: Lane> Wheels<'_, T> {
    fn disc(&self, lane: usize) -> (Disc, Vector3<f64>) {
        let axle = Vector3::from(self.axle.get(lane));
        let disc = Disc {
            centre: self.centre.get(lane).into(),
            axle,
            // Only a wheel that lies flat has a use for it, and that is declined.
            spoke: crate::geometry::query::any_tangent(&axle),
            radius: self.radius,
        };
        (disc, self.base.get(lane).into())
    }
}

impl<T: Lane> Footing<T> {
    /// Nothing anywhere.
    pub fn new(token: T::Token) -> Self {
        Self {
            planes: [Underfoot {
                normal: Vec3::splat(token, [0.0, 1.0, 0.0]),
                offset: T::splat(token, f64::INFINITY),
                pieces: [0; MAX_LANES],
                bent: 0,
            }; SLOTS],
            from: [Vector3::zeros(); MAX_LANES],
            within: [f64::NEG_INFINITY; MAX_LANES],
            flat: 0,
            filled: [0; SLOTS],
        }
    }

    /// Forgets what is known of a lane's ground and puts its wheel on a plane.
    pub fn set_lane(&mut self, lane: usize, normal: [f64; 3], offset: f64) {
        for plane in &mut self.planes {
            plane.clear(lane);
        }
        self.planes[0].normal.set(lane, normal);
        self.planes[0].offset.set(lane, offset);
        self.within[lane] = f64::NEG_INFINITY;
        self.flat &= !(1 << lane);
        self.empty(lane);
    }

    /// Finds the planes of all lanes on a surface; `reach` (m) as for a plane. Returns the lanes
    /// where there is no single one.
    #[inline(always)]
    pub fn find(&mut self, wheels: &Wheels<'_, T>, reach: T) -> T::Mask {
        let mut declined = 0;
        for (lane, terrain) in wheels.surfaces.iter().enumerate() {
            let Some(terrain) = terrain else { continue };
            let centre = (wheels.base + wheels.centre).get(lane);
            let moved = (Vector3::from(centre) - self.from[lane]).norm();
            let is_known = moved + reach.get(lane) + ROUNDING <= self.within[lane];
            if is_known && self.flat >> lane & 1 == 1 {
                continue;
            }
            if !self.search(lane, &**terrain, wheels, reach.get(lane), is_known) {
                declined |= 1 << lane;
            }
        }
        T::mask(reach.token(), declined)
    }

    /// Moves the planes of edges and vertices to the wheels of another instant.
    #[inline(always)]
    pub fn follow(&mut self, wheels: &Wheels<'_, T>) {
        for plane in &mut self.planes {
            plane.follow(wheels);
        }
    }

    /// Searches the ground of one lane. False where it is unknown or more than a plane.
    #[cold]
    fn search(
        &mut self,
        lane: usize,
        terrain: &dyn Terrain,
        wheels: &Wheels<'_, T>,
        reach: f64,
        is_known: bool,
    ) -> bool {
        let own = 1 << lane;
        let (disc, base) = wheels.disc(lane);
        let centre = base + disc.centre;
        self.flat &= !own;
        self.empty(lane);
        for plane in &mut self.planes {
            plane.clear(lane);
        }
        if !is_known {
            let within = reach + AHEAD;
            self.within[lane] = f64::NEG_INFINITY;
            if terrain.coverage(&centre, disc.radius + within) == Coverage::Known {
                (self.from[lane], self.within[lane]) = (centre, within);
                if let Some(plane) = terrain.level_near(&centre, disc.radius + within) {
                    self.flat |= own;
                    self.planes[0].put(lane, &plane);
                    return true;
                }
            } else if terrain.coverage(&centre, disc.radius) != Coverage::Known {
                return false;
            }
        }
        let shape = PlacedShape::Disc(disc);
        let (mut found, mut n) = ([None; MOST_POINTS], 0);
        let mut ways = WaysOut::default();
        let shallow = OverSurfaces::shallow(&shape);
        let part = OverSurfaces {
            shape: &shape,
            terrain,
            base: &base,
        };
        let around = Neighbourhood::new(&shape, &base, reach);
        terrain.visit_around(&around, &mut |id, piece| {
            visit_on_surface(&shape, (terrain, id, piece), &base, reach, |point| {
                ways.add(id, point, shallow);
                if let Some(place) = found.get_mut(n) {
                    *place = Some((id, *piece, *point));
                }
                n += 1;
            });
        });
        if n > MOST_POINTS {
            return false;
        }
        let is_doubtful = ways.are_doubtful();
        if is_doubtful {
            ways.sift(&part);
        }
        let mut count = 0;
        for (id, piece, point) in found.iter().flatten() {
            if is_doubtful && !ways.counts(&part, *id, point) {
                continue;
            }
            if part.excess((*id, piece), point) > 0.0 {
                return false;
            }
            if let Some(own) = self.planes.get_mut(count) {
                own.stand_on(lane, *id, piece, point, &base);
            }
            count += 1;
        }
        for filled in &mut self.filled[..count.min(SLOTS)] {
            *filled |= own;
        }
        count <= SLOTS
    }

    /// Whether any lane has a plane in a slot beyond the first.
    #[inline(always)]
    pub fn has_plane(&self, slot: usize) -> bool {
        self.filled[slot] != 0
    }

    fn empty(&mut self, lane: usize) {
        for filled in &mut self.filled {
            *filled &= !(1 << lane);
        }
    }
}

impl<T: Lane> Underfoot<T> {
    /// Nothing there.
    fn clear(&mut self, lane: usize) {
        self.offset.set(lane, f64::INFINITY);
        self.bent &= !(1 << lane);
    }

    fn put(&mut self, lane: usize, plane: &Plane) {
        self.normal.set(lane, (*plane.normal()).into());
        self.offset.set(lane, plane.offset());
    }

    /// The plane of a piece with this point of the wheel.
    fn stand_on(
        &mut self,
        lane: usize,
        id: u32,
        piece: &Primitive,
        point: &SurfacePoint,
        base: &Vector3<f64>,
    ) {
        if let Primitive::Face(face) = piece {
            self.put(lane, &face.plane);
        } else {
            self.put(lane, &plane_at(point, base));
            self.pieces[lane] = id;
            self.bent |= 1 << lane;
        }
    }

    /// Moves it to the wheels of another instant, where it is that of an edge or a vertex.
    #[inline(always)]
    fn follow(&mut self, wheels: &Wheels<'_, T>) {
        let mut lanes = self.bent;
        while lanes != 0 {
            let lane = lanes.trailing_zeros() as usize;
            lanes &= lanes - 1;
            if let Some(terrain) = &wheels.surfaces[lane] {
                let (disc, base) = wheels.disc(lane);
                let shape = PlacedShape::Disc(disc);
                let point = match terrain.primitive(self.pieces[lane]) {
                    Primitive::Edge(edge) => point_at_edge(&shape, &edge, &base, NEAREST),
                    Primitive::Vertex(vertex) => point_at_vertex(&shape, &vertex, &base),
                    Primitive::Face(_) | Primitive::Plane(_) | Primitive::Sphere(_) => continue,
                };
                self.put(lane, &plane_at(&point, &base));
            }
        }
    }
}

/// The plane behind a point, along its normal by its gap; `base` as for the point.
fn plane_at(point: &SurfacePoint, base: &Vector3<f64>) -> Plane {
    Plane::through(&(base + point.point - point.n * point.gap), point.n)
}
