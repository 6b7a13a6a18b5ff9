//! What a disc, or a torus about it, may touch of a height field while it rolls on for a while.
//!
//! The point of a disc over a plane of normal n is its lowest, that of a torus lies by its rounding
//! along −n from there, and both move by no more than the disc does. So a face is left out if that
//! point is further off its walls than the disc will move, or if the wheel is further from its
//! plane; an edge, if at either of its faces' normals the lowest point stays on that face's side.

use nalgebra::Vector3;

use super::neighbourhood::ROUNDING;
use super::wheel::OFF;
use super::{Half, HeightField, narrow};
use crate::geometry::shape::Disc;
use crate::geometry::terrain::surface::{Edge, EdgeHalfSpace, LEAN};
use crate::geometry::terrain::{Coverage, Primitive, Terrain};

/// Sine of the angle up to which an axle is level enough.
const MOST_TILT: f64 = 0.5;

/// Square of the steepest slope on which a disc is followed. Edges are not sharp there, and a disc
/// does not lie.
const MOST_SLOPE: f64 = 0.64;

/// Side of the cells, in radii, below which a disc is not followed: it meets edges at every step.
const FINE: f64 = 0.5;

/// Longest motion, in sides of a cell.
const LONGEST: f64 = 0.3;

/// Cosine between the axle and a normal up to which the lowest point moves by no more than 1.5
/// radii times the way of the axle's tip.
const STEADY: f64 = 0.5;

/// How deep a disc is in the ground where faces are looked for beside it, in radii.
const DEPTH: f64 = 0.02;

/// The region of a search.
struct Search<'a> {
    disc: &'a Disc,
    rounding: f64,
    reach: f64,
    ahead: f64,
    /// How far a face may be from the wheel's lowest point over it, m.
    off: f64,
    /// How far a cell may be from the disc's plane, m.
    aside: f64,
}

/// The lowest point of a wheel over a plane through a place.
struct Lowest {
    /// From that place, m.
    point: Vector3<f64>,
    gap: f64,
    /// Whether the disc's motion bounds that of the lowest point; see [`STEADY`].
    is_steady: bool,
}

impl HeightField {
    /// [`Terrain::visit_ahead`]; the disc's centre is in world coordinates.
    pub(super) fn visit_pieces_ahead(
        &self,
        (disc, rounding): (&Disc, f64),
        [reach, ahead]: [f64; 2],
        visit: &mut dyn FnMut(&Primitive),
    ) -> Option<f64> {
        let (c, s, R) = (&disc.centre, &disc.axle, disc.radius + rounding);
        let cell = self.spacing[0].min(self.spacing[1]);
        let ahead = ahead.min(LONGEST * cell);
        let tilt = s.y.abs() + ahead / R;
        let around = R + reach + ahead;
        let is_known = || self.coverage(c, around) == Coverage::Known;
        if tilt > MOST_TILT || cell < FINE * R || !is_known() {
            return None;
        }
        let [columns, rows] = self.cells_within(c, [around; 2])?;
        let beyond = |[a, b]: [usize; 2], n: usize| [a.saturating_sub(1), (b + 1).min(n - 2)];
        let slope = (self.tiles).steepest(beyond(columns, self.columns), beyond(rows, self.rows));
        if slope.is_nan() || slope > MOST_SLOPE {
            return None;
        }
        // The lowest point over any plane of this slope is within an angle of the disc's lowest.
        let steep = (slope / (1.0 + slope)).sqrt();
        let upright = ((1.0 - steep * steep) * (1.0 - tilt * tilt)).sqrt() - steep * tilt;
        let off = OFF * (reach + DEPTH * R) + ROUNDING;
        let aside = off + rounding * (2.0 * (1.0 - upright)).sqrt();
        let length = (steep * steep + upright * upright).sqrt();
        let [sine, cosine] = [steep, upright].map(|x| x / length);
        let up = (Vector3::y() - s * s.y).normalize();
        let along = up.cross(s);
        let half = |axis: usize| {
            let swing = along[axis].abs() * sine + up[axis].abs() * (1.0 - cosine);
            R * swing + 2.0 * ahead + aside
        };
        let [columns, rows] = self.cells_within(&(c - up * R), [half(0), half(2)])?;
        let search = Search {
            disc,
            rounding,
            reach,
            ahead,
            off,
            aside,
        };
        for j in rows[0]..=rows[1] {
            for i in columns[0]..=columns[1] {
                self.visit_cell_ahead([i, j], &search, visit);
            }
        }
        Some(ahead)
    }

    /// Distance of a cell from a disc's plane, m; `rises`: of its corners over the first, m.
    fn beside(&self, disc: &Disc, from: &Vector3<f64>, rises: [f64; 4]) -> f64 {
        let (s, [dx, dz]) = (&disc.axle, self.spacing);
        let (x, z) = (s.x * dx, s.z * dz);
        let (mut nearest, mut furthest) = (f64::INFINITY, f64::NEG_INFINITY);
        for (level, rise) in [0.0, x, z, x + z].into_iter().zip(rises) {
            let place = level + s.y * rise - s.dot(from);
            (nearest, furthest) = (nearest.min(place), furthest.max(place));
        }
        nearest.max(-furthest).max(0.0)
    }

    fn visit_cell_ahead(
        &self,
        cell: [usize; 2],
        search: &Search<'_>,
        visit: &mut dyn FnMut(&Primitive),
    ) {
        let Search {
            disc,
            rounding,
            reach,
            ahead,
            off,
            aside,
        } = *search;
        let place = cell.map(narrow);
        let from = disc.centre - self.point(place);
        let [a, b, c, d] = self.cell_heights(cell).map(f64::from);
        if self.beside(disc, &from, [0.0, b - a, c - a, d - a]) > ahead + aside {
            return;
        }
        let patch = self.patch(cell);
        for half in [Half::Low, Half::High] {
            let Some(n) = self.normal(place, half) else {
                continue;
            };
            let low = search.lowest(&n, &from);
            if !search.may_reach(&low) || !self.may_be_over(half, &low, ahead + off) {
                continue;
            }
            if let Some(face) = patch.face(half)
                && (!low.is_steady
                    || face
                        .walls
                        .iter()
                        .all(|wall| search.may_pass(wall, &low, &from)))
            {
                visit(&Primitive::Face(face));
            }
        }
        let [i, j] = place;
        let (before, left) = (self.corner([i, j - 1]), self.corner([i - 1, j]));
        let convex = [a + b > d + before, a + c > d + left, a + d > b + c];
        for k in (2..5).filter(|k| convex[*k as usize - 2]) {
            if let Some(edge) = patch.edge(k)
                && search.may_touch(&edge)
            {
                visit(&Primitive::Edge(edge));
            }
        }
        let within = rounding + reach + ahead + ROUNDING;
        let is_near = disc.axle.dot(&from).abs() <= within && from.norm() <= disc.radius + within;
        if is_near && let Some(vertex) = patch.vertex() {
            visit(&Primitive::Vertex(vertex));
        }
    }

    /// Whether a lowest point, from the cell's corner, is within a distance (m) of a face, seen
    /// from above.
    #[inline]
    fn may_be_over(&self, half: Half, low: &Lowest, off: f64) -> bool {
        let (x, z, [dx, dz]) = (low.point.x, low.point.z, self.spacing);
        let ahead = x / dx - z / dz;
        let beyond = off / dx + off / dz;
        let is_in_other = match half {
            Half::Low => ahead < -beyond,
            Half::High => ahead > beyond,
        };
        let is_beside = x < -off || x > dx + off || z < -off || z > dz + off;
        !low.is_steady || !(is_beside || is_in_other)
    }
}

impl Search<'_> {
    /// The lowest point over the plane of normal n through a place, from which the disc's centre is
    /// `from`, m.
    #[inline]
    fn lowest(&self, n: &Vector3<f64>, from: &Vector3<f64>) -> Lowest {
        let disc = self.disc;
        let across = n.dot(&disc.axle);
        let w = n - disc.axle * across;
        let length = w.norm();
        Lowest {
            point: from - w * (disc.radius / length) - n * self.rounding,
            gap: n.dot(from) - disc.radius * length - self.rounding,
            is_steady: across.abs() <= STEADY,
        }
    }

    #[inline]
    fn may_reach(&self, low: &Lowest) -> bool {
        low.gap <= self.reach + self.ahead + ROUNDING
    }

    /// Whether a lowest point may come to be on a face's side of a wall. `from`: place of the
    /// disc's centre from the place from which the point is, m.
    #[inline]
    fn may_pass(&self, wall: &EdgeHalfSpace, low: &Lowest, from: &Vector3<f64>) -> bool {
        wall.beyond(&(self.disc.centre - from + low.point)) <= self.ahead + ROUNDING
    }

    /// Whether the disc may touch an edge.
    fn may_touch(&self, edge: &Edge) -> bool {
        let from = self.disc.centre - edge.start;
        let [first, second] = edge.normals.each_ref().map(|n| self.lowest(n, &from));
        if !(self.may_reach(&first) && self.may_reach(&second)) {
            return false;
        }
        if !(first.is_steady && second.is_steady) {
            return true;
        }
        let within = self.ahead + ROUNDING;
        let places = [&first, &second].map(|low| low.point.dot(&edge.along));
        let over = LEAN * edge.length + within;
        edge.lean(&edge.normals[0], &first.point) <= within
            && edge.lean(&edge.normals[1], &second.point) >= -within
            && places[0].max(places[1]) >= -over
            && places[0].min(places[1]) <= edge.length + over
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::query::dispatch;
    use crate::geometry::{Neighbourhood, PlacedShape, Roller, SupportMap};
    use nalgebra::Rotation3;
    use proptest::prelude::*;

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(400))]
        /// Whatever a disc touches after a motion is among what was found ahead.
        #[test]
        fn no_piece_is_left_out_that_the_disc_comes_to_touch(
            heights in prop::collection::vec(-1.0..1.0, 21 * 21),
            steepness in 0.0..0.8_f64,
            spacing in prop::sample::select(vec![0.1, 0.25]),
            (yaw, lean) in (-3.2..3.2, -0.3..0.3_f64),
            height in -0.002..0.02_f64,
            motion in prop::array::uniform3(-1.0..1.0_f64),
            turn in prop::array::uniform3(-1.0..1.0_f64),
            reach in 0.0..2e-3_f64,
            ahead in prop::sample::select(vec![0.0, 0.01, 0.05]),
            rounding in prop::sample::select(vec![0.0, 0.02, 0.1]),
        ) {
            #[allow(clippy::cast_possible_truncation)] // a map is single
            let heights = heights.iter().map(|h: &f64| (h * 0.5 * steepness * spacing) as f32);
            let origin = [-10.0 * spacing; 2];
            let field = HeightField::new(heights.collect(), [21, 21], [spacing; 2], origin).unwrap();
            let R = *Rotation3::from_euler_angles(lean, yaw, 0.0).matrix();
            let mut disc = Disc {
                centre: Vector3::zeros(),
                axle: R.column(2).into(),
                spoke: R.column(0).into(),
                radius: 0.2 - rounding,
            };
            let wheel = |disc: &Disc| match rounding {
                0.0 => PlacedShape::Disc(*disc),
                _ => PlacedShape::Roller(Roller { core: *disc, half: 0.0, rounding }),
            };
            // Lowered onto the ground.
            let gap = |disc: &Disc| {
                let low = wheel(disc).support(&-Vector3::y());
                field.height(low.x, low.z).map_or(0.0, |height| low.y - height)
            };
            disc.centre.y = 0.5;
            for _ in 0..20 {
                disc.centre.y -= gap(&disc) - height;
            }
            let mut ahead_of = Vec::new();
            let take = &mut |piece: &Primitive| ahead_of.push(*piece);
            let Some(ahead) = field.visit_pieces_ahead((&disc, rounding), [reach, ahead], take) else {
                return Ok(());
            };
            let shift = Vector3::from(motion);
            let share = 0.5 * ahead / shift.norm().max(1.0);
            let mut later = disc;
            later.centre += shift * share;
            let turn = Rotation3::new(Vector3::from(turn).normalize() * ahead);
            (later.axle, later.spoke) = (turn * disc.axle, turn * disc.spoke);
            // Down to the ground again, as far as that is within the motion.
            let down = gap(&later).clamp(0.0, 0.2 * ahead);
            later.centre.y -= down;
            let base = Vector3::zeros();
            let shape = wheel(&later);
            let part = Neighbourhood::new(&shape, &base, reach);
            field.visit_near(&part.centre, part.radius(), &mut |_, piece| {
                let mut touches = false;
                let is_shallow = |gap: f64| (-2e-3..=reach).contains(&gap);
                match piece {
                    Primitive::Face(face) => {
                        dispatch::visit_on_face(&shape, face, &base, reach, |x| {
                            touches |= is_shallow(x.gap);
                        });
                    }
                    Primitive::Edge(edge) => {
                        dispatch::visit_at_edge(&shape, edge, &base, reach, |x| {
                            touches |= is_shallow(x.gap);
                        });
                    }
                    Primitive::Vertex(vertex) => {
                        let near = dispatch::point_at_vertex(&shape, vertex, &base);
                        touches = is_shallow(near.gap) && dispatch::pushes(vertex, &shape, &near.n);
                    }
                    Primitive::Plane(_) | Primitive::Sphere(_) => {}
                }
                assert!(!touches || ahead_of.contains(piece), "{piece:?}");
            });
        }
    }
}
