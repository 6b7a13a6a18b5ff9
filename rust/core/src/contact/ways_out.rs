//! Which of the points at which a part overlaps a surface lead out of it.
//!
//! A piece of a surface knows only itself: a corner that dips into a boulder at its top is also
//! behind the face at the boulder's bottom, and one that dips into the side of a spike is far below
//! its ridge. The overlap with such a piece is as large as the rock, wherever the part touches it.
//!
//! So a point counts only if no smaller overlap explains it. The points are taken in the order of
//! their depth. The part is moved out along the normal of each that counts, by its depth; a deeper
//! point that is then no longer in the ground was only in the way. The smallest overlap always
//! counts. A part that has just touched has overlaps as large as its motion since then, and the
//! points that count are no deeper. A place that the part touches without an overlap is a way out
//! like the others: rounding must not decide whether the part is free there.
//!
//! Up is a way out too, whatever the slopes. A point that is out of the ground when the part is
//! raised by three quarters of the overlap is deep behind a piece that it does not touch, such as
//! the far face of another ridge. It does not count beside a smaller overlap. Every overlap that
//! counts is only as deep as the part must rise: [`OverSurfaces::excess`].

use nalgebra::Vector3;

use crate::geometry::query::{SurfacePoint, convex};
use crate::geometry::{PlacedShape, Primitive, SupportMap, Terrain};
use crate::law::compliance::Tread;

/// Most points that are compared, those of the smallest overlaps.
const MOST: usize = 24;

/// Depth, in bounding radii of the shape, up to which every point counts: ground that is thinner,
/// as near a sharp ridge, is pierced and still pushes.
const SHALLOW: f64 = 1e-3;

/// Number of deflections at rest by which that depth is larger where a wheel yields, and the most
/// that they add, in bounding radii: what a wheel yields by is no overlap to be explained.
const DEFLECTIONS: f64 = 6.0;
const MOST_YIELDING: f64 = 0.01;

/// Largest gap at which a part touches a surface, m: a point of a part that is no further above the
/// ground may count as in it by rounding, and what the part touches there is the way out.
pub(crate) const TOUCH: f64 = 2e-9;

/// How far a part is moved out, in depths: where the other point is much deeper, so far that what
/// the part overlaps beside the first point is left behind too.
const OUT: [f64; 2] = [1.001, 3.0];

/// Distance by which a part is moved out beyond the depths in [`OUT`], m, to allow for rounding.
const ROUNDING: f64 = 1e-8;

/// Fraction of an overlap by which a part is raised to see whether the point is then out of the
/// ground.
///
/// Of 20 000 buried wheels in a map of 0.1 m of noise in cells of 0.25 m, 154 had an overlap that
/// exceeds the way up by more than 1 cm, and 145 moved out by 2 cm more than that. Now these are 6
/// and 8; with a fraction of ½, 33 move further, with 1 a single one. But a point that is nearly as
/// deep as the part must rise may be the only one that holds it.
const FAR_UP: f64 = 0.75;

/// Places behind an edge that are looked at for unbroken ground: on spiky maps of single cells the
/// way behind a steep edge leaves the ground again within a cell or two.
const PLACES: usize = 12;

/// Bisections for the height by which a part must rise: to 1e-9 of its overlap.
const BISECTIONS: usize = 30;

/// A part near the surfaces of a terrain.
#[derive(Clone, Copy)]
pub(crate) struct OverSurfaces<'a> {
    pub shape: &'a PlacedShape<'a>,
    pub terrain: &'a dyn Terrain,
    /// Where the shape's coordinates have their origin, world, m.
    pub base: &'a Vector3<f64>,
    /// Depth up to which every point counts ([`shallow`]), m.
    pub shallow: f64,
}

/// Depth up to which every point of a part counts, by its bounding radius (m), m; `tread`: of a
/// wheel that yields.
#[inline]
pub(crate) fn shallow(bound: f64, tread: Option<&Tread>) -> f64 {
    let yielding = tread.map_or(0.0, |tread| DEFLECTIONS * tread.usual_deflection());
    SHALLOW * bound + yielding.min(MOST_YIELDING * bound)
}

impl OverSurfaces<'_> {
    /// Whether the part overlaps a piece at one of its points (behind its plane), after a motion by
    /// `shift`, m: that point of the part is in the ground, or the piece is in the part; of an edge
    /// also the ground behind it. What is behind the plane may also be beyond the far side of a
    /// ridge or a rock.
    pub fn overlaps(
        &self,
        (id, piece): (u32, &Primitive),
        point: &SurfacePoint,
        shift: &Vector3<f64>,
    ) -> bool {
        let behind = || self.behind((id, piece), point);
        self.overlaps_after((id, piece), point, shift, behind)
    }

    /// The furthest place behind an edge, up to the depth of a point there, to which the ground is
    /// unbroken. Beyond the far side of a steep ridge there may be a valley, with the part in it,
    /// and then ground again.
    fn behind(&self, (id, piece): (u32, &Primitive), point: &SurfacePoint) -> Vector3<f64> {
        let Primitive::Edge(edge) = piece else {
            return Vector3::zeros();
        };
        let [top, deepest] = edge.behind(&point.n, &(self.base + point.point));
        let places = (1..=PLACES).map(|k| top + (deepest - top) * (k as f64 / PLACES as f64));
        let inside = places.take_while(|x| self.terrain.is_inside(id, x));
        inside.last().unwrap_or(edge.start)
    }

    fn overlaps_after(
        &self,
        (id, piece): (u32, &Primitive),
        point: &SurfacePoint,
        shift: &Vector3<f64>,
        behind: impl FnOnce() -> Vector3<f64>,
    ) -> bool {
        let origin = self.base + shift;
        let is_inside = |x: &Vector3<f64>| self.terrain.is_inside(id, x);
        let is_in_ground = || is_inside(&(origin + point.point));
        let meets = |corners: [Vector3<f64>; 3]| {
            let corners = Corners(corners.map(|x| x - origin));
            convex::meet(self.shape, &corners, &point.n)
        };
        match (piece, self.shape) {
            (Primitive::Face(face), _) => is_in_ground() || meets(face.corners(&origin)),
            (Primitive::Edge(edge), _) => {
                is_in_ground() || meets([edge.start, edge.end(), behind()])
            }
            (Primitive::Vertex(_), PlacedShape::Disc(_)) => is_in_ground(),
            (Primitive::Vertex(vertex), solid) => solid.holds(&(vertex.place - origin)),
            (Primitive::Plane(_) | Primitive::Sphere(_), _) => false,
        }
    }

    /// What an overlap at a point exceeds the way up by, m: zero unless the part, raised by less
    /// than the overlap, leaves the ground there. What remains is continuous in the pose.
    #[inline]
    pub fn excess(&self, (id, piece): (u32, &Primitive), point: &SurfacePoint) -> f64 {
        if point.gap >= -self.shallow {
            return 0.0;
        }
        self.excess_of_deep((id, piece), point)
    }

    #[cold]
    fn excess_of_deep(&self, piece: (u32, &Primitive), point: &SurfacePoint) -> f64 {
        let behind = self.behind(piece, point);
        let overlaps_at =
            |rise: f64| self.overlaps_after(piece, point, &(Vector3::y() * rise), || behind);
        if !overlaps_at(0.0) {
            // The place just behind a tip is in the ground. It pierces a disc no deeper than that.
            let is_tip = matches!(piece.1, Primitive::Vertex(_));
            return if is_tip {
                -point.gap - self.shallow
            } else {
                0.0
            };
        }
        if overlaps_at(-point.gap) {
            return 0.0;
        }
        let (mut low, mut high) = (0.0, -point.gap);
        for _ in 0..BISECTIONS {
            let middle = 0.5 * (low + high);
            if overlaps_at(middle) {
                low = middle;
            } else {
                high = middle;
            }
        }
        -point.gap - high.max(self.shallow)
    }
}

/// A triangle as a convex body, from the origin of the part's coordinates, m.
struct Corners([Vector3<f64>; 3]);

impl SupportMap for Corners {
    fn support(&self, direction: &Vector3<f64>) -> Vector3<f64> {
        let [a, b, c] = &self.0;
        let further = |x, y| {
            if direction.dot(y) > direction.dot(x) {
                y
            } else {
                x
            }
        };
        *further(further(a, b), c)
    }

    fn centre(&self) -> Vector3<f64> {
        self.0.iter().sum::<Vector3<f64>>() / 3.0
    }

    fn bound(&self) -> f64 {
        let centre = self.centre();
        self.0
            .iter()
            .fold(0.0, |most: f64, x| most.max((x - centre).norm()))
    }
}

/// The points at which one part overlaps or touches surfaces.
#[derive(Debug, Default)]
pub(crate) struct WaysOut {
    /// With the numbers of their pieces, in the order of their depth.
    ways: [Option<(u32, SurfacePoint)>; MOST],
    n: usize,
    has_deep: bool,
}

impl WaysOut {
    /// Begins with another part.
    #[inline]
    pub fn clear(&mut self) {
        (self.n, self.has_deep) = (0, false);
    }

    /// Adds a point at a piece of a surface; `shallow`: of [`OverSurfaces`], m.
    #[inline]
    pub fn add(&mut self, id: u32, point: &SurfacePoint, shallow: f64) {
        if point.gap < TOUCH {
            self.has_deep |= point.gap < -shallow;
            self.insert(id, point);
        }
    }

    fn insert(&mut self, id: u32, point: &SurfacePoint) {
        let depths = self.ways[..self.n].iter().flatten();
        let place = depths.take_while(|(_, way)| way.gap >= point.gap).count();
        if place < MOST {
            self.n = (self.n + 1).min(MOST);
            self.ways[place..self.n].rotate_right(1);
            self.ways[place] = Some((id, *point));
        }
    }

    /// Whether [`Self::sift`] may find a point that does not count, or one with an excess.
    #[inline]
    pub fn are_doubtful(&self) -> bool {
        self.has_deep
    }

    /// Keeps the points that count.
    #[cold]
    pub fn sift(&mut self, part: &OverSurfaces<'_>) {
        for k in 1..self.n {
            if let Some((id, point)) = self.ways[k]
                && !self.counts(part, id, &point)
            {
                self.ways[k] = None;
            }
        }
    }

    /// Whether a point at a piece counts, once the others are sifted.
    pub fn counts(&self, part: &OverSurfaces<'_>, id: u32, point: &SurfacePoint) -> bool {
        if point.gap >= -part.shallow {
            return true;
        }
        let piece = part.terrain.primitive(id);
        let ways = self.ways[..self.n].iter().flatten();
        let mut smaller = ways
            .map(|(_, way)| way)
            .take_while(|way| way.gap > point.gap)
            .peekable();
        let up = Vector3::y() * (FAR_UP * -point.gap);
        if smaller.peek().is_some() && !part.overlaps((id, &piece), point, &up) {
            return false;
        }
        smaller.all(|way| {
            let depths = (0.5 * point.gap / way.gap).clamp(OUT[0], OUT[1]);
            let out = way.n * (ROUNDING - depths * way.gap);
            part.overlaps((id, &piece), point, &out)
        })
    }

    /// The deepest of the points that count, each without its excess, and its piece, if any is
    /// deeper than [`OverSurfaces::shallow`].
    pub fn deepest(&mut self, part: &OverSurfaces<'_>) -> Option<(u32, SurfacePoint)> {
        if !self.has_deep {
            return None;
        }
        self.sift(part);
        let mut deepest: Option<(u32, SurfacePoint)> = None;
        // From the largest overlap on: the others are no deeper than they are.
        for &(id, mut point) in self.ways[..self.n].iter().flatten().rev() {
            if deepest.is_some_and(|(_, other)| other.gap <= point.gap) {
                break;
            }
            point.gap += part.excess((id, &part.terrain.primitive(id)), &point);
            if deepest.is_none_or(|(_, other)| point.gap < other.gap) {
                deepest = Some((id, point));
            }
        }
        deepest
    }
}
