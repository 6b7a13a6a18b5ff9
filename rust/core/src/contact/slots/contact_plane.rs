//! The plane that a wheel stands on where the ground is a surface.
//!
//! Where all pieces near a wheel lie in one plane the wheel keeps it until it has moved further
//! than the search looked ahead, and costs what a wheel on a plane costs. Elsewhere its contacts
//! are found lane by lane.

use std::sync::Arc;

use nalgebra::Vector3;

use crate::geometry::{Coverage, Terrain};
use crate::scalar::{Lane, MAX_LANES, Vec3};

/// How far beyond its reach a search looks, m. Twice as far examines four times as many pieces and
/// searches half as often.
const AHEAD: f64 = 0.1;

/// Share of a wheel's bound within which ground that is not flat is looked for: such ground stays
/// near while the wheel moves by the rest of it.
const NEARBY: f64 = 0.5;

/// Covers the rounding of distances, m.
const ROUNDING: f64 = 1e-6;

/// The plane under a wheel.
#[derive(Clone, Debug)]
pub struct ContactPlane<T> {
    /// Unit normal.
    pub normal: Vec3<T>,
    /// m; ∞ where there is nothing.
    pub offset: T,
    /// Place of the wheel's centre at the last search, world, m.
    from: [Vector3<f64>; MAX_LANES],
    /// Distance beyond the wheel's bounding ball about `from` up to which the last search holds, m.
    within: [f64; MAX_LANES],
    /// Lanes where the last search found a plane.
    flat: u32,
    /// A place with ground that is not flat as near as this, m.
    rough_from: [Vector3<f64>; MAX_LANES],
    rough: [f64; MAX_LANES],
}

impl<T: Lane> ContactPlane<T> {
    /// Nothing anywhere.
    pub fn new(token: T::Token) -> Self {
        Self {
            normal: Vec3::splat(token, [0.0, 1.0, 0.0]),
            offset: T::splat(token, f64::INFINITY),
            from: [Vector3::zeros(); MAX_LANES],
            within: [f64::NEG_INFINITY; MAX_LANES],
            flat: 0,
            rough_from: [Vector3::zeros(); MAX_LANES],
            rough: [f64::INFINITY; MAX_LANES],
        }
    }

    /// Forgets what is known of a lane's ground and puts its wheel on a plane.
    pub fn set_lane(&mut self, lane: usize, normal: [f64; 3], offset: f64) {
        self.normal.set(lane, normal);
        self.offset.set(lane, offset);
        self.within[lane] = f64::NEG_INFINITY;
        self.rough[lane] = f64::INFINITY;
        self.flat &= !(1 << lane);
    }

    /// Finds the planes of all lanes on a surface, of wheels with their centres at `centre` (world,
    /// m), within `bound` (m) and their `reach` (m) around them. Returns the lanes where there is
    /// no single one.
    #[inline(always)]
    pub fn find(
        &mut self,
        surfaces: &[Option<Arc<dyn Terrain>>],
        centre: Vec3<T>,
        bound: f64,
        reach: T,
    ) -> T::Mask {
        let mut others = 0;
        for (lane, terrain) in surfaces.iter().enumerate() {
            let Some(terrain) = terrain else { continue };
            let centre = Vector3::from(centre.get(lane));
            let moved = (centre - self.from[lane]).norm();
            let reach = reach.get(lane) + ROUNDING;
            let is_known = moved + reach <= self.within[lane];
            if is_known && self.flat >> lane & 1 == 1 {
                continue;
            }
            let is_rough =
                (centre - self.rough_from[lane]).norm() + self.rough[lane] <= bound + reach;
            let is_flat = !is_rough
                && !is_known
                && self.search(lane, &**terrain, centre, bound, reach + AHEAD);
            // A step does not depend on when a search was made.
            if is_rough || !(is_flat || self.stand(lane, &**terrain, centre, bound + reach)) {
                if !is_rough && terrain.level_near(&centre, NEARBY * bound).is_none() {
                    (self.rough_from[lane], self.rough[lane]) = (centre, NEARBY * bound);
                }
                self.offset.set(lane, f64::INFINITY);
                others |= 1 << lane;
            }
        }
        T::mask(reach.token(), others)
    }

    /// Searches the ground of one lane. Whether there is one plane.
    #[cold]
    fn search(
        &mut self,
        lane: usize,
        terrain: &dyn Terrain,
        centre: Vector3<f64>,
        bound: f64,
        within: f64,
    ) -> bool {
        self.flat &= !(1 << lane);
        self.within[lane] = f64::NEG_INFINITY;
        if terrain.coverage(&centre, bound + within) != Coverage::Known {
            return false;
        }
        (self.from[lane], self.within[lane]) = (centre, within);
        let is_flat = self.stand(lane, terrain, centre, bound + within);
        self.flat |= u32::from(is_flat) << lane;
        is_flat
    }

    /// Whether all within a distance (m) of a place is one plane, which it takes.
    fn stand(
        &mut self,
        lane: usize,
        terrain: &dyn Terrain,
        centre: Vector3<f64>,
        within: f64,
    ) -> bool {
        if terrain.coverage(&centre, within) != Coverage::Known {
            return false;
        }
        let plane = terrain.level_near(&centre, within);
        if let Some(plane) = &plane {
            self.normal.set(lane, (*plane.normal()).into());
            self.offset.set(lane, plane.offset());
        }
        plane.is_some()
    }
}
