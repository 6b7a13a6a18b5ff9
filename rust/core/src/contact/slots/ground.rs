//! The ground under the rovers of a block: a plane, a surface, spheres, or spheres on one of them.
//!
//! A rover over a plane alone pays for the plane alone. Spheres are searched rover by rover, and
//! seldom: a wheel keeps those near it until it has moved further than the search looked ahead, and
//! a box keeps its distance to the nearest and, near rocks, the nearest themselves. What is kept
//! decides only what need not be examined, so a step does not depend on when a search was made.

use std::sync::Arc;

use nalgebra::{Matrix3, Vector3};

use super::contact_plane::ContactPlane;
use super::pieces::{LaneDisc, LanePlane, Pieces};
use crate::contact::Part;
use crate::contact::box_clearance::over_surfaces;
use crate::geometry::query::sweep::DEEP;
use crate::geometry::{Coverage, OrientedBox, Sphere, Terrain};
use crate::scalar::{Lane, LaneMask, MAX_LANES, Mat3, Vec3};

/// Most spheres near a wheel. A wheel near more falls back.
const MAX_NEAR: usize = 8;

/// How far beyond its reach a search for a wheel looks, m: first, and where that finds too many.
/// Twice as far examines twice as many spheres a step and searches half as often.
const AHEAD: [f64; 3] = [0.1, 0.02, 0.0];

/// How far beyond its reach a search for a box looks, and how near the spheres are that it keeps,
/// m. A box that drives close over rocks then measures some of them at every step and searches a
/// few times a metre.
const AHEAD_OF_BOX: f64 = 0.5;
const KEPT_BY_BOX: f64 = 0.15;

/// How far around a box a search looks where the plane between box and surface is not level, m.
const AHEAD_TILTED: f64 = 0.1;

/// Covers the rounding of distances, m, for coordinates up to the size of a terrain.
const ROUNDING: f64 = 1e-6;

/// The place of a sphere that has not been found.
const NONE: Sphere = Sphere::new(Vector3::new(0.0, 0.0, 0.0), f64::NEG_INFINITY);

/// A sphere of the ground under each rover.
#[derive(Clone, Copy, Debug)]
pub struct GroundSphere<T> {
    /// World, m.
    pub centre: Vec3<T>,
    /// m; −∞ for a rover that has no such sphere.
    pub radius: T,
    /// Number of the sphere in the terrain.
    pub number: T,
}

/// The spheres near a wheel.
#[derive(Clone, Debug)]
struct Near<T> {
    /// Place of the wheel's centre when they were searched, world, m.
    from: Vec3<T>,
    /// They are all that come as near to the wheel as this, m.
    within: T,
    spheres: [GroundSphere<T>; MAX_NEAR],
    counts: [usize; MAX_LANES],
    /// The largest count.
    n: usize,
}

/// The spheres around a box.
#[derive(Clone, Debug)]
struct Around<T> {
    /// Place and attitude of the box when its clearance was measured; world, m.
    from: Vec3<T>,
    R: Mat3<T>,
    /// No sphere comes nearer to the box than this, m.
    clearance: T,
    kept: [Kept; MAX_LANES],
}

/// The spheres nearest to a rover's box.
#[derive(Clone, Debug)]
struct Kept {
    /// Place and attitude of the box when they were searched; world, m.
    from: Vector3<f64>,
    R: Matrix3<f64>,
    /// They are all that come as near to the box as this, m; −∞ if there were too many.
    within: f64,
    spheres: [Sphere; MAX_NEAR],
    n: usize,
}

impl Kept {
    const NOTHING: Self = Self {
        from: Vector3::new(0.0, 0.0, 0.0),
        R: Matrix3::new(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
        within: f64::NEG_INFINITY,
        spheres: [NONE; MAX_NEAR],
        n: 0,
    };
}

/// The ground of a block.
#[derive(Clone)]
pub struct BlockGround<T: Lane> {
    /// Unit normal of the plane.
    pub(crate) normal: Vec3<T>,
    /// Offset of the plane, m; ∞ without a plane.
    pub(crate) offset: T,
    /// Terrain of each lane, once it has one.
    terrains: Vec<Option<Arc<dyn Terrain>>>,
    /// Terrains of the lanes whose ground may be more than a plane.
    fields: Vec<Option<Arc<dyn Terrain>>>,
    has_spheres: bool,
    /// Terrains of the lanes whose ground has a surface: without the spheres on it where they are
    /// all else that there is.
    surfaces: Vec<Option<Arc<dyn Terrain>>>,
    has_surfaces: bool,
    /// Terrains of the lanes whose ground has a surface and is firm, likewise.
    under_wheels: Vec<Option<Arc<dyn Terrain>>>,
    /// Rovers on soft ground, whose wheels meet spheres alone.
    soft: T::Mask,
    /// Rovers on a surface and a plane.
    mixed: T::Mask,
    /// Rovers on soft ground with firm ground of another kind beside it, whose contacts are found
    /// lane by lane.
    pub(crate) beside_firm: T::Mask,
    planes: Vec<ContactPlane<T>>,
    /// Near each wheel.
    pieces: Vec<Pieces<T>>,
    wheels: Vec<Near<T>>,
    boxes: Vec<Around<T>>,
}

impl<T: Lane> BlockGround<T> {
    /// Flat ground at height 0 under every rover.
    #[must_use]
    pub fn new(token: T::Token, n_wheels: usize, n_boxes: usize) -> Self {
        let nowhere = Vec3::splat(token, [0.0; 3]);
        let none = GroundSphere {
            centre: nowhere,
            radius: T::splat(token, f64::NEG_INFINITY),
            number: T::splat(token, 0.0),
        };
        let near = Near {
            from: nowhere,
            within: T::splat(token, f64::INFINITY),
            spheres: [none; MAX_NEAR],
            counts: [0; MAX_LANES],
            n: 0,
        };
        let around = Around {
            from: nowhere,
            R: Mat3 {
                x: nowhere,
                y: nowhere,
                z: nowhere,
            },
            clearance: T::splat(token, f64::INFINITY),
            kept: [Kept::NOTHING; MAX_LANES],
        };
        Self {
            normal: Vec3::splat(token, [0.0, 1.0, 0.0]),
            offset: T::splat(token, 0.0),
            terrains: vec![None; T::LANES],
            fields: vec![None; T::LANES],
            has_spheres: false,
            surfaces: vec![None; T::LANES],
            has_surfaces: false,
            under_wheels: vec![None; T::LANES],
            soft: T::mask(token, 0),
            mixed: T::mask(token, 0),
            beside_firm: T::mask(token, 0),
            planes: vec![ContactPlane::new(token); n_wheels],
            pieces: vec![Pieces::new(token); n_wheels],
            wheels: vec![near; n_wheels],
            boxes: vec![around; n_boxes],
        }
    }

    /// Puts a rover on a terrain.
    pub fn set_lane(&mut self, lane: usize, terrain: &Arc<dyn Terrain>) {
        // What is known of a terrain holds for any rover on it.
        if (self.terrains[lane].as_ref()).is_some_and(|own| Arc::ptr_eq(own, terrain)) {
            return;
        }
        self.terrains[lane] = Some(Arc::clone(terrain));
        let plane = terrain.ground();
        let (normal, offset) = match plane {
            Some(plane) => ((*plane.normal()).into(), plane.offset()),
            None => ([0.0, 1.0, 0.0], f64::INFINITY),
        };
        self.normal.set(lane, normal);
        self.offset.set(lane, offset);
        let soft = terrain.soft();
        let own = T::mask(self.offset.token(), 1 << lane);
        self.beside_firm = self.beside_firm & !own;
        if soft.as_ref().is_some_and(|layer| !layer.is_alone) {
            self.beside_firm = self.beside_firm | own;
        }
        let is_plane = match &soft {
            Some(layer) => layer.surface.is_plane() && !terrain.can_be_passed(),
            None => terrain.is_plane(),
        };
        self.fields[lane] = (!is_plane).then(|| Arc::clone(terrain));
        self.has_spheres = self.fields.iter().any(Option::is_some);
        let has_surface = terrain.has_surface();
        self.surfaces[lane] = has_surface.then(|| Arc::clone(bare(terrain)));
        self.has_surfaces = self.surfaces.iter().any(Option::is_some);
        let is_firm = soft.is_none();
        self.under_wheels[lane] = self.surfaces[lane].clone().filter(|_| is_firm);
        (self.soft, self.mixed) = (self.soft & !own, self.mixed & !own);
        if !is_firm {
            self.soft = self.soft | own;
        } else if has_surface && plane.is_some() {
            self.mixed = self.mixed | own;
        }
        let offset = if is_firm { offset } else { f64::INFINITY };
        for plane in &mut self.planes {
            plane.set_lane(lane, normal, offset);
        }
        for pieces in &mut self.pieces {
            pieces.forget(lane);
        }
        // Without spheres there is nothing to search, and the first step on spheres makes one.
        let has_spheres = !is_plane && terrain.can_be_passed();
        let known = if has_spheres {
            f64::NEG_INFINITY
        } else {
            f64::INFINITY
        };
        for near in &mut self.wheels {
            near.keep(lane, &[]);
            near.from.set(lane, [0.0; 3]);
            near.within.set(lane, known);
        }
        for around in &mut self.boxes {
            around.from.set(lane, [0.0; 3]);
            let is_known = !has_spheres && !has_surface;
            let clearance = if is_known { known } else { f64::NEG_INFINITY };
            around.clearance.set(lane, clearance);
            around.kept[lane].within = f64::NEG_INFINITY;
        }
    }

    /// Whether any rover's ground may have spheres.
    #[inline(always)]
    pub(crate) fn has_spheres(&self) -> bool {
        self.has_spheres
    }

    /// Whether any rover's ground has a surface.
    #[inline(always)]
    pub(crate) fn has_surfaces(&self) -> bool {
        self.has_surfaces
    }

    /// Finds the plane that the rovers' wheel stands on where the ground is a surface: see
    /// [`ContactPlane::find`].
    #[inline(always)]
    pub(crate) fn find_plane(
        &mut self,
        wheel: usize,
        centre: Vec3<T>,
        bound: f64,
        reach: T,
    ) -> T::Mask {
        let found = self.planes[wheel].find(&self.under_wheels, centre, bound, reach);
        found | self.mixed | self.unknown(centre, bound)
    }

    /// Rovers on soft ground that is not known as near as `bound` (m) to a place.
    #[inline(always)]
    fn unknown(&self, centre: Vec3<T>, bound: f64) -> T::Mask {
        let mut unknown = 0;
        for (lane, terrain) in self.surfaces.iter().enumerate() {
            if let Some(terrain) = terrain.as_ref().filter(|_| self.soft.get(lane)) {
                let coverage = terrain.coverage(&Vector3::from(centre.get(lane)), bound);
                unknown |= u32::from(matches!(coverage, Coverage::Unknown(_))) << lane;
            }
        }
        T::mask(self.offset.token(), unknown)
    }

    /// The plane under a wheel.
    #[inline(always)]
    pub(crate) fn under_wheel(&self, wheel: usize) -> LanePlane<T> {
        let ContactPlane { normal, offset, .. } = self.planes[wheel];
        LanePlane { normal, offset }
    }

    /// The pieces that the rovers' wheel may touch, of the given lanes, and the lanes where they
    /// are known; none if they are in no lane.
    #[inline(always)]
    pub(crate) fn find_pieces(
        &mut self,
        wheel: usize,
        lanes: T::Mask,
        rim: &LaneDisc<T>,
    ) -> Option<(&Pieces<T>, T::Mask)> {
        let pieces = &mut self.pieces[wheel];
        let known = pieces.find(&self.under_wheels, lanes & !self.mixed, rim);
        known.any().then_some((pieces, known))
    }

    /// The ground of a lane.
    pub(crate) fn terrain(&self, lane: usize) -> Option<&Arc<dyn Terrain>> {
        self.terrains[lane].as_ref()
    }

    /// What a part of a lane may touch of its ground, with the same numbers.
    pub(crate) fn near(&self, part: Part, lane: usize) -> Option<&Arc<dyn Terrain>> {
        let terrain = self.terrain(lane)?;
        let has_no_spheres = |w: usize| {
            let near = &self.wheels[w];
            near.counts[lane] == 0 && near.within.get(lane) > 0.0
        };
        let surface = self.under_wheels[lane].as_ref();
        let is_first = |own: &&Arc<dyn Terrain>| {
            (terrain.members().first()).is_some_and(|first| Arc::ptr_eq(first, own))
        };
        match part {
            Part::Wheel(w) if has_no_spheres(w) => surface.filter(is_first).or(Some(terrain)),
            _ => Some(terrain),
        }
    }

    /// Whether a rover's ground is a surface.
    #[inline(always)]
    pub(crate) fn is_surface(&self, lane: usize) -> bool {
        self.surfaces[lane].is_some()
    }

    /// Rovers whose wheels stand on a surface.
    pub(crate) fn on_surface(&self) -> T::Mask {
        let bits = (self.under_wheels.iter().enumerate()).fold(0, |bits, (lane, own)| {
            bits | u32::from(own.is_some()) << lane
        });
        T::mask(self.offset.token(), bits)
    }

    /// Height of a point over the plane, m.
    #[inline(always)]
    pub(crate) fn height(&self, x: Vec3<T>) -> T {
        self.normal.dot(x) + self.offset
    }

    /// Height of a point over the plane that wheels stand on, m; ∞ on soft ground.
    #[inline(always)]
    pub(crate) fn height_for_wheels(&self, x: Vec3<T>) -> T {
        let height = self.height(x);
        T::select(self.soft, height.like(f64::INFINITY), height)
    }

    /// Spheres near a wheel, for the rover that has most; see [`Self::look_around_wheel`].
    #[inline(always)]
    pub(crate) fn near_wheel(&self, wheel: usize) -> &[GroundSphere<T>] {
        let near = &self.wheels[wheel];
        &near.spheres[..near.n]
    }

    /// Makes [`Self::near_wheel`] contain all spheres that come closer than `need` (m) to a ball of
    /// radius `radius` (m) about `centre` (world, m). True where there are too many.
    #[inline(always)]
    pub(crate) fn look_around_wheel(
        &mut self,
        wheel: usize,
        centre: Vec3<T>,
        radius: f64,
        need: T,
    ) -> T::Mask {
        let near = &mut self.wheels[wheel];
        let moved = (centre - near.from).norm();
        let is_known = (moved + need + need.like(ROUNDING)).le(near.within);
        let mut too_many = 0;
        let mut unknown = (!is_known).bits();
        while unknown != 0 {
            let lane = unknown.trailing_zeros() as usize;
            unknown &= unknown - 1;
            if let Some(field) = &self.fields[lane] {
                let place = Vector3::from(centre.get(lane));
                if !near.search(lane, &**field, &place, radius, need.get(lane)) {
                    too_many |= 1 << lane;
                }
            }
        }
        T::mask(need.token(), too_many)
    }

    /// Whether a sphere comes as near as `reach` (m) to a box with its centre at `centre` (world,
    /// m) and the axes `R`, or so near that the box, which moves by up to `motion` (m) in half a
    /// step, may pass it.
    #[inline(always)]
    pub(crate) fn is_near_box(
        &mut self,
        number: usize,
        centre: Vec3<T>,
        R: &Mat3<T>,
        half_size: [f64; 3],
        (reach, motion): (T, T),
    ) -> T::Mask {
        let need = reach + motion;
        let around = &mut self.boxes[number];
        let bound = Vector3::from(half_size).norm();
        let moved = (centre - around.from).norm() + turning(R, &around.R) * need.like(bound);
        let is_clear = (moved + need + need.like(ROUNDING)).lt(around.clearance);
        let mut is_near = 0;
        let mut unknown = (!is_clear).bits();
        while unknown != 0 {
            let lane = unknown.trailing_zeros() as usize;
            unknown &= unknown - 1;
            if let Some(field) = &self.fields[lane] {
                let columns = [R.x, R.y, R.z].map(|column| Vector3::from(column.get(lane)));
                let solid = OrientedBox {
                    centre: Vector3::from(centre.get(lane)),
                    R: Matrix3::from_columns(&columns),
                    half_size: Vector3::from(half_size),
                };
                let near = Nearness {
                    reach: reach.get(lane),
                    motion: motion.get(lane),
                };
                let surface = self.surfaces[lane].as_deref();
                if around.search(lane, (&**field, surface), &solid, bound, near) {
                    is_near |= 1 << lane;
                }
            }
        }
        T::mask(need.token(), is_near)
    }
}

impl<T: Lane> Near<T> {
    /// Searches the spheres of one rover. False if more than [`MAX_NEAR`] are as near as `need`.
    #[cold]
    fn search(
        &mut self,
        lane: usize,
        field: &dyn Terrain,
        centre: &Vector3<f64>,
        radius: f64,
        need: f64,
    ) -> bool {
        for ahead in AHEAD {
            let within = need + ahead;
            let mut found = [(0, NONE); MAX_NEAR];
            let mut count = 0;
            visit_spheres(field, centre, radius + within, |number, sphere| {
                if let Some(place) = found.get_mut(count) {
                    *place = (number, *sphere);
                }
                count += 1;
            });
            if let Some(found) = found.get(..count) {
                self.keep(lane, found);
                self.from.set(lane, (*centre).into());
                self.within.set(lane, within);
                return true;
            }
        }
        self.keep(lane, &[]);
        self.within.set(lane, f64::NEG_INFINITY);
        false
    }

    /// Replaces the spheres of a rover.
    fn keep(&mut self, lane: usize, spheres: &[(u32, Sphere)]) {
        for (k, own) in self.spheres.iter_mut().enumerate() {
            if let Some((number, sphere)) = spheres.get(k) {
                own.centre.set(lane, sphere.centre.into());
                own.radius.set(lane, sphere.radius);
                own.number.set(lane, f64::from(*number));
            } else {
                own.radius.set(lane, f64::NEG_INFINITY);
            }
        }
        self.counts[lane] = spheres.len();
        self.n = self.counts.iter().fold(0, |most, &n| most.max(n));
    }
}

impl<T: Lane> Around<T> {
    /// Measures the clearance of one rover's box from its ground and the surface of that. True if
    /// something is near.
    fn search(
        &mut self,
        lane: usize,
        (field, surface): (&dyn Terrain, Option<&dyn Terrain>),
        solid: &OrientedBox,
        bound: f64,
        near: Nearness,
    ) -> bool {
        let kept = &mut self.kept[lane];
        let moved = (solid.centre - kept.from).norm() + (solid.R - kept.R).norm() * bound;
        let need = near.reach + near.motion;
        let (mut clearance, mut is_near) = (kept.within - moved, false);
        if moved + need + ROUNDING <= kept.within {
            for sphere in &kept.spheres[..kept.n] {
                let own = clearance_of(solid, sphere);
                clearance = clearance.min(own);
                is_near |= near.includes(own, sphere.radius);
            }
        } else {
            (clearance, is_near) = kept.search(field, solid, bound, near);
        }
        if let Some(surface) = surface {
            let (own, is_near_surface) = over_surface(surface, solid, bound, near);
            clearance = clearance.min(own);
            is_near |= is_near_surface;
        }
        self.from.set(lane, solid.centre.into());
        self.R.x.set(lane, solid.axis(0).into());
        self.R.y.set(lane, solid.axis(1).into());
        self.R.z.set(lane, solid.axis(2).into());
        self.clearance.set(lane, clearance);
        is_near
    }
}

/// Which spheres are near a box, by the rules of [`crate::contact::detection`].
#[derive(Clone, Copy, Debug)]
struct Nearness {
    /// Distance up to which a sphere may be a contact, m.
    reach: f64,
    /// Upper bound on the motion of the box in half a step, m.
    motion: f64,
}

impl Nearness {
    /// Whether a sphere at a distance (m) from the box is.
    fn includes(&self, distance: f64, radius: f64) -> bool {
        distance <= self.reach + ROUNDING || distance - self.motion <= ROUNDING - DEEP * radius
    }
}

impl Kept {
    /// Searches the spheres around the box anew. Returns its clearance, m, and whether one is near.
    #[cold]
    fn search(
        &mut self,
        field: &dyn Terrain,
        solid: &OrientedBox,
        bound: f64,
        near: Nearness,
    ) -> (f64, bool) {
        let need = near.reach + near.motion;
        let (mut clearance, mut is_near) = (need + AHEAD_OF_BOX, false);
        self.within = need + KEPT_BY_BOX;
        self.n = 0;
        visit_spheres(field, &solid.centre, bound + clearance, |_, sphere| {
            let own = clearance_of(solid, sphere);
            clearance = clearance.min(own);
            is_near |= near.includes(own, sphere.radius);
            if own <= self.within {
                match self.spheres.get_mut(self.n) {
                    Some(place) => {
                        *place = *sphere;
                        self.n += 1;
                    }
                    None => self.within = f64::NEG_INFINITY,
                }
            }
        });
        self.from = solid.centre;
        self.R = solid.R;
        (clearance, is_near)
    }
}

/// A distance (m) that no piece of a surface comes nearer to a box than, and whether one may be
/// near or its ground is unknown.
#[cold]
fn over_surface(
    field: &dyn Terrain,
    solid: &OrientedBox,
    bound: f64,
    near: Nearness,
) -> (f64, bool) {
    if field.coverage(&solid.centre, bound) != Coverage::Known {
        return (f64::NEG_INFINITY, true);
    }
    if field.coverage(&solid.centre, bound + AHEAD_OF_BOX) == Coverage::Known {
        let need = near.reach + near.motion + ROUNDING;
        let ahead = [AHEAD_OF_BOX, AHEAD_TILTED];
        if let Some(clearance) = over_surfaces(field, solid, ahead, need) {
            return (clearance, false);
        }
    }
    (f64::NEG_INFINITY, true)
}

/// Distance of a sphere from a box, m; at least minus the radius.
fn clearance_of(solid: &OrientedBox, sphere: &Sphere) -> f64 {
    let local = solid.R.tr_mul(&(sphere.centre - solid.centre));
    let outside = (local.abs() - solid.half_size).map(|x| x.max(0.0));
    outside.norm() - sphere.radius
}

/// Upper bound on the motion of a point at unit distance from the centre: the Frobenius norm of the
/// difference of two attitudes.
#[inline(always)]
pub(crate) fn turning<T: Lane>(R: &Mat3<T>, S: &Mat3<T>) -> T {
    let (x, y, z) = (R.x - S.x, R.y - S.y, R.z - S.z);
    (x.dot(x) + y.dot(y) + z.dot(z)).sqrt()
}

/// A firm terrain without the spheres on its surface, if these are all else that it has.
fn bare(terrain: &Arc<dyn Terrain>) -> &Arc<dyn Terrain> {
    let members = terrain.members();
    let mut surfaces = members.iter().filter(|own| own.has_surface());
    match (surfaces.next(), surfaces.next()) {
        (Some(only), None) if terrain.ground().is_none() && terrain.soft().is_none() => only,
        _ => terrain,
    }
}

/// Visits exactly the spheres that come as near to `centre` (world, m) as `within`, m.
fn visit_spheres(
    field: &dyn Terrain,
    centre: &Vector3<f64>,
    within: f64,
    mut visit: impl FnMut(u32, &Sphere),
) {
    field.visit_spheres(centre, within, &mut |number, sphere| {
        if sphere.distance(centre) <= within {
            visit(number, sphere);
        }
    });
}
