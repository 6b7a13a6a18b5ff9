//! What can be wrong with a model's description or with a state.

use thiserror::Error;

/// A model description that is not readable or not physical. Each variant names the field and what
/// it held.
#[derive(Debug, Error, Clone, PartialEq)]
pub enum ModelError {
    /// The text is not the format it should be.
    #[error("the model description cannot be read: {message}")]
    Unreadable {
        /// The parser's own words, with line and column.
        message: String,
    },
    /// A format that this version does not read.
    #[error("format: this version reads format 1, the file has {format}")]
    UnknownFormat {
        /// What the file says.
        format: i64,
    },
    /// A name that is not in the gallery.
    #[error("name: there is no model {name:?}; there are {known}")]
    UnknownModel {
        /// What was given.
        name: String,
        /// The names that there are.
        known: String,
    },
    /// No solids at all.
    #[error("solids: a model needs at least one solid")]
    NoSolids,
    /// Two things of one name.
    #[error("{field}: the name {name:?} is used twice")]
    DuplicateName {
        /// Path of the second use.
        field: String,
        /// The name.
        name: String,
    },
    /// A parent that is not listed before its child, or a base that has one.
    #[error("{field}: {name:?} is not a solid listed before this one")]
    UnknownParent {
        /// Path of the field.
        field: String,
        /// What was given.
        name: String,
    },
    /// A reference to something that is not there.
    #[error("{field}: there is no solid or joint named {name:?}")]
    UnknownName {
        /// Path of the field.
        field: String,
        /// What was given.
        name: String,
    },
    /// A field that must be there is missing.
    #[error("{field}: is missing")]
    Missing {
        /// Path of the field.
        field: String,
    },
    /// A field that only another kind of joint may have.
    #[error("{field}: a {joint} joint has no {what}")]
    NotForJoint {
        /// Path of the field.
        field: String,
        /// The field's name.
        what: &'static str,
        /// Kind of the joint.
        joint: &'static str,
    },
    /// A field that only another kind of loop may have.
    #[error("{field}: a loop of kind \"{kind}\" has no {what}")]
    NotForLoop {
        /// Path of the field.
        field: String,
        /// The field's name.
        what: &'static str,
        /// Kind of the loop.
        kind: &'static str,
    },
    /// A loop whose ends do not move relative to each other.
    #[error("{field}: both ends of the loop {name:?} are on one rigid body")]
    LoopInOneBody {
        /// Path of the loop.
        field: String,
        /// Name of the loop.
        name: String,
    },
    /// A loop that is open where it should be closed.
    #[error(
        "{field}: the loop {name:?} does not close at the zero of all joints, the gap is {gap} {unit}; without {without} it closes there"
    )]
    LoopOpen {
        /// Path of the loop.
        field: String,
        /// Name of the loop.
        name: String,
        /// What is left, m or rad.
        gap: f64,
        /// Unit of the gap, "m" or "rad".
        unit: &'static str,
        /// The fields that say where it closes.
        without: &'static str,
    },
    /// A solid that is listed among those of another tree.
    #[error(
        "{field}: the solids under {name:?} must be listed together, before those of the next tree"
    )]
    OtherTree {
        /// Path of the field.
        field: String,
        /// The root of the tree that it belongs to.
        name: String,
    },
    /// A machine that does not begin at a root, in the order of the solids.
    #[error(
        "{field}: {name:?} must be a solid without a parent, after those of the machines before; the first machine begins at the first solid"
    )]
    NotAFirstSolid {
        /// Path of the field.
        field: String,
        /// What was given.
        name: String,
    },
    /// A wheel that is listed among those of another machine.
    #[error(
        "{field}: the wheels of the machine {name:?} must be listed together, in the order of the machines"
    )]
    OtherMachine {
        /// Path of the field.
        field: String,
        /// The wheel's machine.
        name: String,
    },
    /// A field that each of several machines has.
    #[error("{field}: a model with machines has this field in each of them")]
    OfAMachine {
        /// Path of the field.
        field: String,
    },
    /// A joint that follows one on another branch, or one that has no coordinate of its own.
    #[error(
        "{field}: the joint {name:?} must have a coordinate, and be an ancestor of this joint or hang on the same solid"
    )]
    CoupledApart {
        /// Path of the field.
        field: String,
        /// What was given.
        name: String,
    },
    /// NaN or infinite.
    #[error("{field}: must be finite, is {value}")]
    NotFinite {
        /// Path of the field.
        field: String,
        /// What was given.
        value: f64,
    },
    /// Zero or negative where a positive number is needed.
    #[error("{field}: must be positive, is {value}")]
    NotPositive {
        /// Path of the field.
        field: String,
        /// What was given.
        value: f64,
    },
    /// Negative where zero or more is needed.
    #[error("{field}: must not be negative, is {value}")]
    Negative {
        /// Path of the field.
        field: String,
        /// What was given.
        value: f64,
    },
    /// A lower limit that is not below the upper one.
    #[error("{field}: must be below the upper limit {upper}, is {value}")]
    NotBelow {
        /// Path of the lower limit.
        field: String,
        /// What was given.
        value: f64,
        /// The upper limit.
        upper: f64,
    },
    /// An axis of no direction.
    #[error("{field}: an axis must have a direction, is {value:?}")]
    NoDirection {
        /// Path of the field.
        field: String,
        /// What was given.
        value: [f64; 3],
    },
    /// A sign that is not ±1.
    #[error("{field}: must be 1 or -1, is {value}")]
    NotASign {
        /// Path of the field.
        field: String,
        /// What was given.
        value: f64,
    },
    /// Principal inertias that no mass distribution has.
    #[error(
        "{field}: the principal inertias {principal:?} are not physical: each must be positive and at most the sum of the other two"
    )]
    ImpossibleInertia {
        /// Path of the field.
        field: String,
        /// Principal moments, kg m².
        principal: [f64; 3],
    },
    /// `collides` on a disc.
    #[error("{field}: a disc cannot collide; add a wheel")]
    CannotCollide {
        /// Path of the field.
        field: String,
    },
    /// Points without a hull.
    #[error(
        "{field}: {count} points: a hull needs from 4 to 64 points that are not all in one plane"
    )]
    NoHull {
        /// Path of the field.
        field: String,
        /// Number of points.
        count: usize,
    },
    /// A hull as the only shape of a solid, whose origin would be its mass centre.
    #[error("{field}: a hull must be one of the solid's `shapes`")]
    HullAlone {
        /// Path of the field.
        field: String,
    },
    /// A triangle of a drawing with a vertex that is not there.
    #[error("{field}: there is no vertex {vertex}, only {count} vertices counted from 0")]
    NoVertex {
        /// Path of the field.
        field: String,
        /// Index of the vertex.
        vertex: usize,
        /// Number of vertices.
        count: usize,
    },
    /// The short form of one shape beside a list of shapes.
    #[error("{field}: a solid with shapes must not have its own {what}; the shapes define it")]
    NotWithShapes {
        /// Path of the field.
        field: String,
        /// The field's name.
        what: &'static str,
    },
    /// A mass centre without an inertia, or the other way round, beside a list of shapes.
    #[error(
        "{field}: is missing; a solid with shapes states inertia and centre_of_mass, or neither"
    )]
    HalfGiven {
        /// Path of the field that is missing.
        field: String,
    },
    /// Masses of shapes that are together not the solid's, or leave nothing to the others.
    #[error(
        "{field}: {value} kg contradicts the masses of its shapes, {sum} kg together: both must be equal if every shape has a mass, otherwise the mass of the solid must be larger"
    )]
    MassesContradict {
        /// Path of the field.
        field: String,
        /// Mass of the solid, kg.
        value: f64,
        /// Masses of its shapes, those that are given, kg.
        sum: f64,
    },
    /// A disc among shapes that share a mass by volume.
    #[error(
        "{field}: is missing; a disc has no volume, so its share of the mass of the solid must be given"
    )]
    NoVolume {
        /// Path of the field.
        field: String,
    },
    /// A number so large or so small that the mechanics would overflow or vanish.
    #[error("{field}: must be {range}, is {value}")]
    OutOfRange {
        /// Path of the field.
        field: String,
        /// Admissible values, in words.
        range: &'static str,
        /// What was given.
        value: f64,
    },
    /// More than a model may have.
    #[error("{field}: at most {limit} {what} are allowed, has {count}")]
    TooMany {
        /// Path of the field.
        field: &'static str,
        /// What is counted.
        what: &'static str,
        /// How many there are.
        count: usize,
        /// How many there may be.
        limit: usize,
    },
    /// A text that names no material.
    #[error("{field}: the name of a material has 1 to 100 characters, is {name:?}")]
    MaterialName {
        /// Path of the field.
        field: String,
        /// What was given.
        name: String,
    },
    /// A wheel of another radius than the disc that it is.
    #[error(
        "{field}: {value} m contradicts the shape of {solid:?}, a disc of {shape} m; for a wheel that touches the ground at another radius, give contact_radius"
    )]
    RadiusContradictsShape {
        /// Path of the field.
        field: String,
        /// What was given, m.
        value: f64,
        /// The wheel's solid.
        solid: String,
        /// Radius of its disc, m.
        shape: f64,
    },
    /// A wheel whose solid is no disc has no shape that a radius could change.
    #[error("{field}: the shape of {solid:?} is not a disc; give contact_radius instead")]
    NotADisc {
        /// Path of the field.
        field: &'static str,
        /// The wheel's solid.
        solid: String,
    },
    /// A steering limit of a wheel that has no steering joint.
    #[error("{field}: the steering solid {name:?} is not an ancestor of the wheel")]
    SteeringNotAbove {
        /// Path of the field.
        field: String,
        /// What was given.
        name: String,
    },
}

impl ModelError {
    /// Path of the offending field, such as `solids[3].mass`.
    #[must_use]
    pub fn field(&self) -> &str {
        match self {
            Self::Unreadable { .. } => "text",
            Self::UnknownFormat { .. } => "format",
            Self::UnknownModel { .. } => "name",
            Self::NoSolids => "solids",
            Self::DuplicateName { field, .. }
            | Self::UnknownParent { field, .. }
            | Self::UnknownName { field, .. }
            | Self::Missing { field }
            | Self::NotForJoint { field, .. }
            | Self::NotForLoop { field, .. }
            | Self::LoopInOneBody { field, .. }
            | Self::LoopOpen { field, .. }
            | Self::OtherTree { field, .. }
            | Self::NotAFirstSolid { field, .. }
            | Self::OtherMachine { field, .. }
            | Self::OfAMachine { field }
            | Self::CoupledApart { field, .. }
            | Self::NotFinite { field, .. }
            | Self::NotPositive { field, .. }
            | Self::Negative { field, .. }
            | Self::NotBelow { field, .. }
            | Self::NoDirection { field, .. }
            | Self::NotASign { field, .. }
            | Self::ImpossibleInertia { field, .. }
            | Self::CannotCollide { field }
            | Self::NoHull { field, .. }
            | Self::HullAlone { field }
            | Self::NoVertex { field, .. }
            | Self::NotWithShapes { field, .. }
            | Self::HalfGiven { field }
            | Self::MassesContradict { field, .. }
            | Self::NoVolume { field }
            | Self::MaterialName { field, .. }
            | Self::OutOfRange { field, .. }
            | Self::RadiusContradictsShape { field, .. }
            | Self::SteeringNotAbove { field, .. } => field,
            Self::TooMany { field, .. } | Self::NotADisc { field, .. } => field,
        }
    }
}

impl ModelError {
    /// Puts `path`, the path of a part such as `solids[3]`, before the field of an error in that
    /// part.
    pub(super) fn within(mut self, path: &str) -> Self {
        if let Self::Missing { field }
        | Self::MassesContradict { field, .. }
        | Self::NoVolume { field } = &mut self
        {
            *field = format!("{path}.{field}");
        }
        self
    }
}

/// A state that cannot be taken.
#[derive(Debug, Error, Clone, PartialEq)]
pub enum StateError {
    /// Wrong number of entries.
    #[error("{field}: needs {expected} entries, has {actual}")]
    Length {
        /// `q` or `qdot`.
        field: &'static str,
        /// What the model needs.
        expected: usize,
        /// What was given.
        actual: usize,
    },
    /// NaN or infinite.
    #[error("{field}[{index}]: must be finite, is {value}")]
    NotFinite {
        /// `q` or `qdot`.
        field: &'static str,
        /// Which entry.
        index: usize,
        /// What was given.
        value: f64,
    },
    /// A configuration in which a loop is open.
    #[error(
        "q: the loop {name:?} is open by {gap} {unit}; RoverModel.close_loops(q) gives the nearest coordinates that close it"
    )]
    LoopOpen {
        /// Name of the loop.
        name: String,
        /// What is left, m or rad.
        gap: f64,
        /// Unit of the gap, "m" or "rad".
        unit: &'static str,
    },
    /// Loops that no configuration near the given one closes.
    #[error("q: no coordinates near these close the loop {name:?}, {gap} {unit} are left")]
    LoopStaysOpen {
        /// The loop with the largest gap.
        name: String,
        /// What is left, m or rad.
        gap: f64,
        /// Unit of the gap, "m" or "rad".
        unit: &'static str,
    },
    /// The report's angles cannot express a rate there.
    #[error(
        "q[{index}]: the report's coordinates are singular at a heading of 90 degrees, is {heading} rad"
    )]
    SingularCardan {
        /// Where the angle stands.
        index: usize,
        /// Middle Cardan angle, rad.
        heading: f64,
    },
}
