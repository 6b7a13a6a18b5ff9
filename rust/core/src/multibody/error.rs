//! What can be wrong with a model's description or with a state.

use thiserror::Error;

/// A model description that is not readable or not physical.
#[derive(Debug, Error, Clone, PartialEq)]
pub enum ModelError {
    /// The text is not the format it should be.
    #[error("the model description cannot be read: {message}")]
    Unreadable {
        /// The parser's own words, with line and column.
        message: String,
    },
    /// A field that says something impossible.
    #[error("{field}: {fault}")]
    Invalid {
        /// Path of the field, such as `solids[3].mass`.
        field: String,
        /// What is wrong with it, and what it held.
        fault: ModelFault,
    },
}

impl ModelError {
    /// Path of the offending field, such as `solids[3].mass`.
    #[must_use]
    pub fn field(&self) -> &str {
        match self {
            Self::Unreadable { .. } => "text",
            Self::Invalid { field, .. } => field,
        }
    }

    /// Puts `path`, the path of a part such as `solids[3]`, before the field of an error in that
    /// part.
    pub(super) fn within(mut self, path: &str) -> Self {
        if let Self::Invalid { field, .. } = &mut self {
            *field = format!("{path}.{field}");
        }
        self
    }
}

/// What can be wrong with a field of a model description. A single datum is what was given.
#[derive(Debug, Error, Clone, PartialEq)]
pub enum ModelFault {
    /// A format that this version does not read.
    #[error("this version reads format 1, the file has {0}")]
    UnknownFormat(i64),
    /// A name that is not in the gallery.
    #[error("there is no model {name:?}; there are {known}")]
    UnknownModel {
        /// What was given.
        name: String,
        /// The names that there are.
        known: String,
    },
    /// No solids at all.
    #[error("a model needs at least one solid")]
    NoSolids,
    /// Two things of one name; the field is that of the second.
    #[error("the name {0:?} is used twice")]
    DuplicateName(String),
    /// A parent that is not listed before its child, or a base that has one.
    #[error("{0:?} is not a solid listed before this one")]
    UnknownParent(String),
    /// A reference to something that is not there.
    #[error("there is no solid or joint named {0:?}")]
    UnknownName(String),
    /// A field that must be there is missing.
    #[error("is missing")]
    Missing,
    /// A field that only another kind of joint may have.
    #[error("a {joint} joint has no {what}")]
    NotForJoint {
        /// The field's name.
        what: &'static str,
        /// Kind of the joint.
        joint: &'static str,
    },
    /// A field that only another kind of loop may have.
    #[error("a loop of kind \"{kind}\" has no {what}")]
    NotForLoop {
        /// The field's name.
        what: &'static str,
        /// Kind of the loop.
        kind: &'static str,
    },
    /// A loop, by its name, whose ends do not move relative to each other.
    #[error("both ends of the loop {0:?} are on one rigid body")]
    LoopInOneBody(String),
    /// A loop that is open where it should be closed.
    #[error(
        "the loop {name:?} does not close at the zero of all joints, the gap is {gap} {unit}; without {without} it closes there"
    )]
    LoopOpen {
        /// Name of the loop.
        name: String,
        /// What is left, m or rad.
        gap: f64,
        /// Unit of the gap, "m" or "rad".
        unit: &'static str,
        /// The fields that say where it closes.
        without: &'static str,
    },
    /// A solid that is listed among those of another tree than its own, of which this is the root.
    #[error("the solids under {0:?} must be listed together, before those of the next tree")]
    OtherTree(String),
    /// A machine that does not begin at a root, in the order of the solids.
    #[error(
        "{0:?} must be a solid without a parent, after those of the machines before; the first machine begins at the first solid"
    )]
    NotAFirstSolid(String),
    /// A wheel that is listed among those of another machine than its own, which this is.
    #[error(
        "the wheels of the machine {0:?} must be listed together, in the order of the machines"
    )]
    OtherMachine(String),
    /// A field that each of several machines has.
    #[error("a model with machines has this field in each of them")]
    OfAMachine,
    /// A joint that follows one on another branch, or one that has no coordinate of its own.
    #[error(
        "the joint {0:?} must have a coordinate, and be an ancestor of this joint or hang on the same solid"
    )]
    CoupledApart(String),
    /// NaN or infinite.
    #[error("must be finite, is {0}")]
    NotFinite(f64),
    /// Zero or negative where a positive number is needed.
    #[error("must be positive, is {0}")]
    NotPositive(f64),
    /// Negative where zero or more is needed.
    #[error("must not be negative, is {0}")]
    Negative(f64),
    /// A lower limit that is not below the upper one.
    #[error("must be below the upper limit {upper}, is {value}")]
    NotBelow {
        /// What was given.
        value: f64,
        /// The upper limit.
        upper: f64,
    },
    /// An axis of no direction.
    #[error("an axis must have a direction, is {0:?}")]
    NoDirection([f64; 3]),
    /// A sign that is not ±1.
    #[error("must be 1 or -1, is {0}")]
    NotASign(f64),
    /// Principal inertias, kg m², that no mass distribution has.
    #[error(
        "the principal inertias {0:?} are not physical: each must be positive and at most the sum of the other two"
    )]
    ImpossibleInertia([f64; 3]),
    /// `collides` on a disc.
    #[error("a disc cannot collide; add a wheel")]
    CannotCollide,
    /// So many points without a hull.
    #[error("{0} points: a hull needs from 4 to 64 points that are not all in one plane")]
    NoHull(usize),
    /// A hull as the only shape of a solid, whose origin would be its mass centre.
    #[error("a hull must be one of the solid's `shapes`")]
    HullAlone,
    /// A triangle of a drawing with a vertex that is not there.
    #[error("there is no vertex {vertex}, only {count} vertices counted from 0")]
    NoVertex {
        /// Index of the vertex.
        vertex: usize,
        /// Number of vertices.
        count: usize,
    },
    /// The short form of one shape, a field, beside a list of shapes.
    #[error("a solid with shapes must not have its own {0}; the shapes define it")]
    NotWithShapes(&'static str),
    /// A mass centre without an inertia, or the other way round, beside a list of shapes; the field
    /// is the one that is missing.
    #[error("is missing; a solid with shapes states inertia and centre_of_mass, or neither")]
    HalfGiven,
    /// Masses of shapes that are together not the solid's, or leave nothing to the others.
    #[error(
        "{value} kg contradicts the masses of its shapes, {sum} kg together: both must be equal if every shape has a mass, otherwise the mass of the solid must be larger"
    )]
    MassesContradict {
        /// Mass of the solid, kg.
        value: f64,
        /// Masses of its shapes, those that are given, kg.
        sum: f64,
    },
    /// A disc among shapes that share a mass by volume.
    #[error(
        "is missing; a disc has no volume, so its share of the mass of the solid must be given"
    )]
    NoVolume,
    /// A number so large or so small that the mechanics would overflow or vanish.
    #[error("must be {range}, is {value}")]
    OutOfRange {
        /// Admissible values, in words.
        range: &'static str,
        /// What was given.
        value: f64,
    },
    /// More than a model may have.
    #[error("at most {limit} {what} are allowed, has {count}")]
    TooMany {
        /// What is counted.
        what: &'static str,
        /// How many there are.
        count: usize,
        /// How many there may be.
        limit: usize,
    },
    /// A text that names no material.
    #[error("the name of a material has 1 to 100 characters, is {0:?}")]
    MaterialName(String),
    /// A wheel of another radius than the disc that it is.
    #[error(
        "{value} m contradicts the shape of {solid:?}, a disc of {shape} m; for a wheel that touches the ground at another radius, give contact_radius"
    )]
    RadiusContradictsShape {
        /// What was given, m.
        value: f64,
        /// The wheel's solid.
        solid: String,
        /// Radius of its disc, m.
        shape: f64,
    },
    /// A wheel whose solid, which this is, is no disc has no shape that a radius could change.
    #[error("the shape of {0:?} is not a disc; give contact_radius instead")]
    NotADisc(String),
    /// A steering limit of a wheel that has no steering joint.
    #[error("the steering solid {0:?} is not an ancestor of the wheel")]
    SteeringNotAbove(String),
}

impl ModelFault {
    /// The error of a field with this fault.
    pub(super) fn at(self, field: impl Into<String>) -> ModelError {
        ModelError::Invalid {
            field: field.into(),
            fault: self,
        }
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
