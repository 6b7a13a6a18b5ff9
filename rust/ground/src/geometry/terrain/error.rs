//! Errors of a terrain.

use thiserror::Error;

/// An invalid terrain.
#[derive(Debug, Error, Clone, PartialEq)]
pub enum TerrainError {
    /// NaN or infinite.
    #[error("{field}: must be finite, is {value}")]
    NotFinite {
        /// Name of the field.
        field: &'static str,
        /// What was given.
        value: f64,
    },
    /// A normal of length zero.
    #[error("normal: must have a direction, is {value:?}")]
    NoDirection {
        /// What was given.
        value: [f64; 3],
    },
    /// A sphere's centre or radius that is NaN or infinite.
    #[error("{field}[{index}]: must be finite, is {value}")]
    EntryNotFinite {
        /// `centres` or `radii`.
        field: &'static str,
        /// Number of the sphere, from 0.
        index: usize,
        /// What was given.
        value: f64,
    },
    /// A radius that is zero or negative.
    #[error("radii[{index}]: must be positive, is {radius}")]
    NonPositiveRadius {
        /// Number of the sphere, from 0.
        index: usize,
        /// What was given, m.
        radius: f64,
    },
    /// A sphere so far from the origin that a wheel next to it cannot be resolved, or so large.
    #[error("{field}[{index}]: must be at most {limit} in size, is {value}")]
    TooFar {
        /// `centres` or `radii`.
        field: &'static str,
        /// Number of the sphere, from 0.
        index: usize,
        /// What was given, m.
        value: f64,
        /// Largest allowed, m.
        limit: f64,
    },
    /// Different numbers of centres and radii.
    #[error("radii: needs one for each of the {centres} centres, has {radii}")]
    MismatchedLengths {
        /// Number of centres.
        centres: usize,
        /// Number of radii.
        radii: usize,
    },
    /// Neither a sphere nor a plane.
    #[error("centres: a field needs at least one sphere or a ground plane")]
    Empty,
    /// More spheres than a field may have.
    #[error("centres: at most {limit} spheres are allowed, has {count}")]
    TooMany {
        /// How many there are, or would be.
        count: usize,
        /// How many there may be.
        limit: usize,
    },
    /// A height that is infinite or too large.
    #[error(
        "heights[{row}, {column}]: must be at most {limit} m in size or nan for no data, is {value}"
    )]
    BadHeight {
        /// Row, along z.
        row: usize,
        /// Column, along x.
        column: usize,
        /// What was given, m.
        value: f64,
        /// Largest allowed, m.
        limit: f64,
    },
    /// A map of another size than its heights.
    #[error("heights: needs {rows} rows of {columns} numbers, has {count} numbers")]
    WrongCount {
        /// Rows.
        rows: usize,
        /// Columns.
        columns: usize,
        /// Numbers.
        count: usize,
    },
    /// A map without a cell, or with too many.
    #[error("heights: needs from 2 x 2 to {limit} numbers, has {rows} x {columns}")]
    MapSize {
        /// Rows.
        rows: usize,
        /// Columns.
        columns: usize,
        /// Most numbers.
        limit: usize,
    },
    /// A map of which nothing is known.
    #[error("heights: no cell has data at all of its corners")]
    NoData,
    /// A mesh without triangles.
    #[error("triangles: a mesh needs at least one")]
    NoTriangles,
    /// A triangle that names a vertex that is not there.
    #[error(
        "triangles[{index}]: refers to vertex {vertex}, but there are only {vertices} vertices"
    )]
    NoSuchVertex {
        /// Number of the triangle.
        index: usize,
        /// Number of the vertex that the triangle names.
        vertex: usize,
        /// How many there are.
        vertices: usize,
    },
    /// A triangle without an area.
    #[error("triangles[{index}]: has no area")]
    FlatTriangle {
        /// Number of the triangle.
        index: usize,
    },
    /// An edge of three triangles, or of two that face opposite ways.
    #[error(
        "triangles[{index}]: its edge from vertex {from} to {to} belongs to another triangle in the \
         same direction; all triangles must list their vertices counterclockwise, seen from outside"
    )]
    NotASurface {
        /// Number of the triangle.
        index: usize,
        /// Vertex where the edge begins.
        from: usize,
        /// Vertex where it ends.
        to: usize,
    },
    /// Nothing to combine.
    #[error("parts: a union needs at least one terrain")]
    NoParts,
    /// More planes than one in a union.
    #[error("parts[{index}]: is a second plane; a union can have only one")]
    SecondPlane {
        /// Number of the part.
        index: usize,
    },
    /// More soft grounds than one in a union.
    #[error("parts[{index}]: is a second soft ground; a union can have only one")]
    SecondSand {
        /// Number of the part.
        index: usize,
    },
    /// More primitives than can be numbered.
    #[error("parts: there are too many pieces in total, at most 2^32 are allowed")]
    TooManyPieces,
    /// A number that describes a field of rocks, outside its range.
    #[error("{field}: must be {range}, is {value}")]
    OutOfRange {
        /// Name of the field.
        field: &'static str,
        /// Admissible values, in words.
        range: &'static str,
        /// What was given.
        value: f64,
    },
}

impl TerrainError {
    /// Name of the offending field.
    #[must_use]
    pub fn field(&self) -> &'static str {
        match self {
            Self::NotFinite { field, .. }
            | Self::EntryNotFinite { field, .. }
            | Self::TooFar { field, .. }
            | Self::OutOfRange { field, .. } => field,
            Self::NoDirection { .. } => "normal",
            Self::NonPositiveRadius { .. } | Self::MismatchedLengths { .. } => "radii",
            Self::Empty | Self::TooMany { .. } => "centres",
            Self::BadHeight { .. }
            | Self::WrongCount { .. }
            | Self::MapSize { .. }
            | Self::NoData => "heights",
            Self::NoTriangles
            | Self::NoSuchVertex { .. }
            | Self::FlatTriangle { .. }
            | Self::NotASurface { .. } => "triangles",
            Self::NoParts
            | Self::SecondPlane { .. }
            | Self::SecondSand { .. }
            | Self::TooManyPieces => "parts",
        }
    }
}
