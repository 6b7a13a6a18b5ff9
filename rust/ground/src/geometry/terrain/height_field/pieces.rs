//! The pieces of a height field, built from the heights around a corner.

use nalgebra::Vector3;

use super::{Half, HeightField, Place};
use crate::geometry::terrain::plane::Plane;
use crate::geometry::terrain::surface::{Edge, EdgeHalfSpace, Face, Hinge, MAX_SPOKES, Vertex};
use crate::geometry::terrain::{BorderEdge, Primitive};

/// Number of the vertex among a corner's pieces.
const VERTEX: u32 = 5;

/// Neighbours of a vertex: columns and rows.
const SPOKES: [Place; 6] = [[1, 0], [1, 1], [0, 1], [-1, 0], [-1, -1], [0, -1]];

/// The heights of a cell and around it: all that its pieces depend on. Places are relative to the
/// cell's corner.
#[derive(Clone, Copy, Debug)]
pub(super) struct CellNeighbourhood<'a> {
    field: &'a HeightField,
    corner: Place,
    /// Rows and columns from −1 to 2; nan where there is none.
    heights: [[f64; 4]; 4],
}

impl HeightField {
    /// Around a corner, which may be the last of a row or column.
    #[inline]
    pub(super) fn patch(&self, [i, j]: [usize; 2]) -> CellNeighbourhood<'_> {
        let corner @ [x, y] = [i, j].map(super::narrow);
        let is_inside = i > 0 && j > 0 && i + 2 < self.columns && j + 2 < self.rows;
        let heights = if is_inside {
            let first = (j - 1) * self.columns + i - 1;
            std::array::from_fn(|v| {
                let row = &self.heights[first + v * self.columns..][..4];
                std::array::from_fn(|u| f64::from(row[u]))
            })
        } else {
            let ahead = [-1, 0, 1, 2];
            ahead.map(|v| ahead.map(|u| self.corner([x + u, y + v])))
        };
        CellNeighbourhood {
            field: self,
            corner,
            heights,
        }
    }
}

impl CellNeighbourhood<'_> {
    #[inline]
    #[allow(clippy::cast_sign_loss)] // −1 to 2
    fn height(&self, [u, v]: Place) -> f64 {
        self.heights[(v + 1) as usize][(u + 1) as usize]
    }

    /// A corner, world, m.
    #[inline]
    fn point(&self, place @ [u, v]: Place) -> Vector3<f64> {
        let ([i, j], [x, z], [dx, dz]) = (self.corner, self.field.origin, self.field.spacing);
        Vector3::new(
            x + (i + u) as f64 * dx,
            self.height(place),
            z + (j + v) as f64 * dz,
        )
    }

    /// Unit normal of a face; None where there is none.
    #[inline]
    fn normal(&self, ([u, v], half): (Place, Half)) -> Option<Vector3<f64>> {
        let (a, d) = (self.height([u, v]), self.height([u + 1, v + 1]));
        let other = match half {
            Half::Low => self.height([u + 1, v]),
            Half::High => self.height([u, v + 1]),
        };
        half.normal([a, other, d], self.field.spacing)
    }

    /// The faces at the edge k = 2, 3, 4 of a corner, in the order of [`Hinge`].
    #[inline]
    fn faces_at([u, v]: Place, k: u32) -> [(Place, Half); 2] {
        match k {
            2 => [([u, v - 1], Half::High), ([u, v], Half::Low)],
            3 => [([u, v], Half::High), ([u - 1, v], Half::Low)],
            _ => [([u, v], Half::Low), ([u, v], Half::High)],
        }
    }

    /// Start and end of an edge, world, m.
    #[inline]
    fn ends(&self, place: Place, k: u32) -> [Vector3<f64>; 2] {
        [self.point(place), self.point(Self::end_of(place, k))]
    }

    #[inline]
    fn end_of([u, v]: Place, k: u32) -> Place {
        match k {
            2 => [u + 1, v],
            3 => [u, v + 1],
            _ => [u + 1, v + 1],
        }
    }

    /// The wall of a face with the unit normal n at an edge of which it is the first face (0) or
    /// the second. A face without a neighbour there is bounded as if the surface went on flat.
    #[inline]
    fn wall(&self, n: &Vector3<f64>, (place, k): (Place, u32), number: usize) -> EdgeHalfSpace {
        let other = self
            .normal(Self::faces_at(place, k)[1 - number])
            .unwrap_or(*n);
        let [start, end] = self.ends(place, k);
        let normals = if number == 0 {
            [n, &other]
        } else {
            [&other, n]
        };
        Hinge::new(&start, &end, normals).walls[number]
    }

    /// Visits the borders of the cell's faces.
    pub(super) fn visit_borders(&self, first: u32, visit: &mut dyn FnMut(&BorderEdge)) {
        let number = |[u, v]: Place| {
            let [i, j] = self.corner;
            let corner = usize::try_from((j + v) * super::narrow(self.field.columns) + i + u);
            super::number(corner.unwrap_or(0)) + VERTEX
        };
        for (k, half) in [Half::Low, Half::High].into_iter().enumerate() {
            let Some(normal) = self.normal(([0, 0], half)) else {
                continue;
            };
            for (wall, (place, edge, side)) in Self::edges_of(half).into_iter().enumerate() {
                if self.normal(Self::faces_at(place, edge)[1 - side]).is_some() {
                    continue;
                }
                let mut ends = [place, Self::end_of(place, edge)];
                if side == 1 {
                    ends.reverse();
                }
                let [start, end] = ends.map(|place| self.point(place));
                visit(&BorderEdge {
                    face: first + u32::from(k == 1),
                    wall,
                    piece: None,
                    corners: ends.map(number),
                    start,
                    end,
                    normal,
                    beyond: None,
                });
            }
        }
    }

    /// The corner with all its neighbours of known height.
    pub(super) fn neighbours(&self) -> Vertex {
        let place = self.point([0, 0]);
        let mut vertex = Vertex {
            place,
            spokes: [Vector3::zeros(); MAX_SPOKES],
            n: 0,
        };
        for spoke in SPOKES.map(|other| self.point(other) - place) {
            if !spoke.y.is_nan() {
                vertex.spokes[vertex.n] = spoke;
                vertex.n += 1;
            }
        }
        vertex
    }

    /// Edges of a face in the order of its walls: whose they are, their number, and whether the
    /// face is the first or the second at it.
    fn edges_of(half: Half) -> [(Place, u32, usize); 3] {
        match half {
            Half::Low => [([0, 0], 2, 1), ([1, 0], 3, 1), ([0, 0], 4, 0)],
            Half::High => [([0, 1], 2, 0), ([0, 0], 3, 0), ([0, 0], 4, 1)],
        }
    }

    /// A face of the cell.
    #[inline]
    pub(super) fn face(&self, half: Half) -> Option<Face> {
        let n = self.normal(([0, 0], half))?;
        Some(Face {
            plane: Plane::through(&self.point([0, 0]), n),
            walls: Self::edges_of(half).map(|(place, k, number)| self.wall(&n, (place, k), number)),
        })
    }

    /// The edge k = 2, 3, 4 of the corner, if it is convex.
    #[inline]
    pub(super) fn edge(&self, k: u32) -> Option<Edge> {
        let [first, second] = Self::faces_at([0, 0], k);
        let normals = [self.normal(first)?, self.normal(second)?];
        let [start, end] = self.ends([0, 0], k);
        let hinge = Hinge::new(&start, &end, [&normals[0], &normals[1]]);
        if !hinge.is_convex {
            return None;
        }
        let length = (end - start).norm();
        Some(Edge {
            start,
            along: (end - start) / length,
            length,
            normals,
        })
    }

    /// The corner, if its vertex may be convex.
    #[inline]
    pub(super) fn vertex(&self) -> Option<Vertex> {
        let height = self.height([0, 0]);
        let mut is_flat = true;
        for [u, v] in &SPOKES[..3] {
            let mean = 0.5 * (self.height([*u, *v]) + self.height([-u, -v]));
            // Not convex where the height beside it is not known either.
            let may_be_convex = height >= mean;
            if !may_be_convex {
                return None;
            }
            is_flat &= height <= mean;
        }
        if is_flat {
            return None;
        }
        let own = self.point([0, 0]);
        let mut spokes = [Vector3::zeros(); MAX_SPOKES];
        for (spoke, place) in spokes.iter_mut().zip(SPOKES) {
            *spoke = self.point(place) - own;
        }
        Some(Vertex {
            place: own,
            spokes,
            n: SPOKES.len(),
        })
    }

    /// A piece of the corner.
    #[inline]
    pub(super) fn piece(&self, k: u32) -> Option<Primitive> {
        match k {
            0 => self.face(Half::Low).map(Primitive::Face),
            1 => self.face(Half::High).map(Primitive::Face),
            5 => self.vertex().map(Primitive::Vertex),
            _ => self.edge(k).map(Primitive::Edge),
        }
    }
}
