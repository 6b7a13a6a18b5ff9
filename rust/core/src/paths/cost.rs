//! What a path costs.

/// What a path costs, in metres of way. Lengths of the rover are in wheel radii where not said
/// otherwise.
#[derive(Clone, Copy, Debug)]
pub struct PathCosts {
    /// Of a metre with the underside a wheel radius below the margin.
    pub belly: f64,
    /// Clearance that costs nothing.
    pub margin: f64,
    /// Of a wheel's rise by a radius.
    pub climb: f64,
    /// Of the square of a rise between two poses, beyond half a radius.
    pub step: f64,
    /// Of a metre at a slope of 1.
    pub lean: f64,
    /// Of a radian off the goal, over the rover's reach.
    pub facing: f64,
    /// Of a change of a command from 0 to its limit.
    pub swerve: f64,
    /// Of a change between forward and backward.
    pub switch: f64,
    /// Of an arc driven backward.
    pub reverse: f64,
    /// Of a pose at a place where the rover got stuck.
    pub memory: f64,
    /// Factor on the costs of each arc after the first.
    pub later: f64,
    /// Arcs of a path.
    pub depth: usize,
    /// Paths kept.
    pub width: usize,
    /// Length of an arc, over the rover's reach.
    pub length: f64,
}
