//! The ground: the interface of a terrain, and the available terrains.
//!
//! A terrain lists its primitives near a place. Each primitive is convex and pairs with every shape
//! of a machine ([`super::query`]).

mod area;
pub mod error;
mod half_space;
pub mod height_field;
pub mod limits;
pub mod mesh;
mod neighbourhood;
pub mod plane;
pub mod rocks;
mod seams;
pub mod soft_ground;
pub mod sphere_field;
pub mod surface;
mod tiles;
pub mod union;

use std::sync::{Arc, Mutex, PoisonError};

use nalgebra::Vector3;

pub use area::Area;
pub use error::TerrainError;
pub use height_field::HeightField;
pub use mesh::TriangleMesh;
pub use neighbourhood::Neighbourhood;
pub use plane::Plane;
pub use rocks::{Clearing, Rocks};
pub use soft_ground::SoftGround;
pub use sphere_field::SphereField;
pub use surface::{BorderEdge, Edge, Face, Vertex};
pub use union::Union;

use super::ray::{Hit, Ray};
use super::shape::{Disc, Sphere};
use crate::sand::test_bed::rules_within;
use crate::sand::{GaussRules, SandWheel, Soil};

/// A convex piece of ground whose distance to every shape has a closed form.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Primitive {
    /// A half-space.
    Plane(Plane),
    /// A ball.
    Sphere(Sphere),
    /// A triangle of a surface.
    Face(Face),
    /// A convex edge of a surface.
    Edge(Edge),
    /// A convex vertex of a surface.
    Vertex(Vertex),
}

/// Material of planes, and of surfaces that name no other.
pub const GROUND: &str = "ground";

/// Material of spheres that name no other.
pub const ROCK: &str = "rock";

/// What a terrain knows of the ground under a place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Coverage {
    /// There is ground.
    Known,
    /// The terrain says nothing of the ground there: it only has things that lie on the ground.
    Silent,
    /// The ground is not known at this place (x, z), m.
    Unknown([f64; 2]),
}

/// The ground. Immutable, shared between threads.
pub trait Terrain: Send + Sync {
    /// Visits every primitive that comes closer than `reach` (m) to `centre` (world, m), with a
    /// number that identifies it for the lifetime of the terrain. May visit others too; the result
    /// must not depend on distant ones.
    fn visit_near(&self, centre: &Vector3<f64>, reach: f64, visit: &mut dyn FnMut(u32, &Primitive));

    /// Visits every primitive that a part may touch, as [`Self::visit_near`] does. Pieces of a
    /// surface that are clear of the part or out of its reach may be left out.
    fn visit_around(&self, part: &Neighbourhood<'_>, visit: &mut dyn FnMut(u32, &Primitive)) {
        self.visit_near(&part.centre, part.radius(), visit);
    }

    /// Visits every sphere that comes closer than `reach` (m) to `centre` (world, m), with its
    /// number, as [`Self::visit_near`] does.
    fn visit_spheres(
        &self,
        centre: &Vector3<f64>,
        reach: f64,
        visit: &mut dyn FnMut(u32, &Sphere),
    ) {
        self.visit_near(centre, reach, &mut |id, primitive| {
            if let Primitive::Sphere(sphere) = primitive {
                visit(id, sphere);
            }
        });
    }

    /// Visits the pieces of a surface that a disc swept by a ball of radius `rounding` (m), with
    /// its centre in world coordinates, may touch by a gap of up to `reach[0]` (m) while it moves
    /// by up to `reach[1]` (m): the way of its centre plus that of its axle's tip at 1.5 radii.
    /// Returns how far it may move, which is `reach[1]` or less. What is visited without motion is
    /// among what was visited from any earlier place that it has not left so far. None if this is
    /// not known; then what was visited means nothing.
    fn visit_ahead(
        &self,
        (_disc, _rounding): (&Disc, f64),
        _reach: [f64; 2],
        _visit: &mut dyn FnMut(&Primitive),
    ) -> Option<f64> {
        None
    }

    /// The plane of all pieces of a surface within `radius` (m) of `centre`, seen from above, if
    /// the surface is level there and that is quickly decided.
    fn level_near(&self, _centre: &Vector3<f64>, _radius: f64) -> Option<Plane> {
        None
    }

    /// Whether a part can pass a primitive within one step: a ball, but not a half-space. Only then
    /// the motion within a step is examined.
    fn can_be_passed(&self) -> bool {
        true
    }

    /// Whether the terrain is a plane and nothing else.
    fn is_plane(&self) -> bool {
        false
    }

    /// Whether the terrain has pieces of a surface: faces, edges or vertices.
    fn has_surface(&self) -> bool {
        false
    }

    /// The primitive with a number from [`Self::visit_near`].
    fn primitive(&self, id: u32) -> Primitive;

    /// Name of the material of a primitive.
    fn material(&self, _id: u32) -> &str {
        GROUND
    }

    /// Numbers of primitives are below this.
    fn n_primitives(&self) -> u32;

    /// Whether a point of a part (world, m) behind the plane of a primitive is in the ground, and
    /// not merely beyond its other side. Asked of pieces of a surface only.
    fn is_inside(&self, _id: u32, _point: &Vector3<f64>) -> bool {
        true
    }

    /// Whether a place (world, m) is in the ground, for pieces of other terrains: below a surface
    /// without an underside by at most `within`, m.
    fn buries(&self, place: &Vector3<f64>, _within: f64) -> bool {
        self.has_surface() && self.is_inside(0, place)
    }

    /// What is known of the ground within `radius` (m) of `centre`, seen from above.
    fn coverage(&self, _centre: &Vector3<f64>, _radius: f64) -> Coverage {
        Coverage::Known
    }

    /// What is known of the ground all over a rectangle. `is_joined`: whether the ground goes on
    /// beyond an edge of a surface, by its number.
    fn covers(&self, area: &Area, _is_joined: &dyn Fn(u32) -> bool) -> Coverage {
        let [x, z] = area.middle();
        self.coverage(&Vector3::new(x, 0.0, z), area.radius())
    }

    /// Rectangle within which it knows the ground, if it knows that of one.
    fn known_within(&self) -> Option<Area> {
        None
    }

    /// Visits the edges at which a face of a surface ends, or bends away from the free side.
    fn visit_rims(&self, _visit: &mut dyn FnMut(&BorderEdge)) {}

    /// The vertex of a number from a [`BorderEdge`], convex or not, with all its edges.
    fn rim_corner(&self, id: u32) -> Vertex {
        unreachable!("invariant: corner {id} is of a rim")
    }

    /// Whether a face may end within `radius` (m) of a place.
    fn may_end_near(&self, _place: &Vector3<f64>, _radius: f64) -> bool {
        true
    }

    /// The terrains that it was made of, if it is a union.
    fn members(&self) -> &[Arc<dyn Terrain>] {
        &[]
    }

    /// Whether pieces of different numbers may lie in each other.
    fn may_overlap(&self) -> bool {
        false
    }

    /// Whether a place (world, m) of a piece with the unit normal n is covered by other ground.
    fn is_buried(&self, _id: u32, _place: &Vector3<f64>, _n: &Vector3<f64>) -> bool {
        false
    }

    /// A distance (m) along a unit vector n, which points up, that no place of a surface exceeds
    /// within `radius` (m) of `centre`, seen from above.
    fn furthest(&self, _n: &Vector3<f64>, _centre: &Vector3<f64>, _radius: f64) -> f64 {
        f64::INFINITY
    }

    /// What a ray meets first within `reach` (m), from either side of a surface.
    fn first_hit(&self, ray: &Ray, reach: f64) -> Option<Hit>;

    /// What a ray meets first, as [`Self::first_hit`], and which sphere it is, if it is one: its
    /// number in the field that it belongs to.
    fn first_hit_of(&self, ray: &Ray, reach: f64) -> Option<(Hit, Option<(u32, Sphere)>)> {
        self.first_hit(ray, reach).map(|hit| (hit, None))
    }

    /// Unit normal at a place (world, m) on a surface that is curved but for its triangles, for
    /// shading; none on others.
    fn smooth_normal(&self, _place: &Vector3<f64>) -> Option<Vector3<f64>> {
        None
    }

    /// Height y (m) of the visible surface at (x, z); `None` where there is none.
    fn height(&self, x: f64, z: f64) -> Option<f64>;

    /// The base plane, if there is one; its number is 0.
    fn ground(&self) -> Option<&Plane>;

    /// The sand that wheels sink into, if there is any.
    fn soft(&self) -> Option<SoftLayer<'_>> {
        None
    }
}

/// Sand under a surface, into which wheels sink.
#[derive(Clone, Copy)]
pub struct SoftLayer<'a> {
    /// The undisturbed surface.
    pub surface: &'a dyn Terrain,
    /// The sand.
    pub soil: &'a Arc<Soil>,
    /// Size of a cell of the ruts, m.
    pub cell: f64,
    /// Where points lie on wheels.
    pub known: &'a KnownRules,
    /// Whether wheels meet nothing else but spheres.
    pub is_alone: bool,
}

/// Gauss rules of wheels in a soil, found once for all rovers on a ground.
#[derive(Debug, Default)]
pub struct KnownRules(Mutex<Vec<(SandWheel, Arc<GaussRules>)>>);

/// Accuracy of the forces on a wheel, in the worst of several motions, for which the number of its
/// points is chosen. Soils are not known better.
const ACCURACY: f64 = 0.05;

/// The plane that touches a surface at a place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TangentPlane {
    /// World, m.
    pub place: Vector3<f64>,
    /// Unit normal, out of the ground.
    pub normal: Vector3<f64>,
    /// Whether the surface is this plane.
    pub is_exact: bool,
    /// Largest height of the surface over the plane among the places that were looked at, m.
    pub highest: f64,
}

impl SoftLayer<'_> {
    /// Where the points lie on a wheel whose forces are within 5%.
    #[must_use]
    pub fn rules(&self, wheel: &SandWheel) -> Arc<GaussRules> {
        let mut known = self.known.0.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((_, rules)) = known.iter().find(|(same, _)| same == wheel) {
            return rules.clone();
        }
        let rules = Arc::new(rules_within(wheel, self.soil, ACCURACY));
        known.push((*wheel, rules.clone()));
        rules
    }

    /// The tangent plane under a place (world, m), from the heights within `radius`, m. None where
    /// there is no ground.
    #[must_use]
    pub fn tangent(&self, at: &Vector3<f64>, radius: f64) -> Option<TangentPlane> {
        if let Some(plane) = self.surface.ground().filter(|_| self.surface.is_plane()) {
            let normal = *plane.normal();
            let height = normal.dot(at) + plane.offset();
            return Some(TangentPlane {
                place: at - normal * height,
                normal,
                is_exact: true,
                highest: 0.0,
            });
        }
        let height = |x: f64, z: f64| self.surface.height(at.x + x * radius, at.z + z * radius);
        let middle = height(0.0, 0.0)?;
        let around = [[1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]];
        let around = around.map(|[x, z]| height(x, z).unwrap_or(middle));
        let slope_x = (around[0] - around[1]) / (2.0 * radius);
        let slope_z = (around[2] - around[3]) / (2.0 * radius);
        let normal = Vector3::new(-slope_x, 1.0, -slope_z).normalize();
        // Of opposite places the mean is over or under the plane.
        let bend = [around[0] + around[1], around[2] + around[3]];
        let over = bend.map(|sum| 0.5 * sum - middle);
        Some(TangentPlane {
            place: Vector3::new(at.x, middle, at.z),
            normal,
            is_exact: false,
            highest: normal.y * over[0].max(over[1]).max(0.0),
        })
    }
}
