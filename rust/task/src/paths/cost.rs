//! What a path costs.

/// What a path costs, in metres of way. Lengths of the rover are in wheel radii where not said
/// otherwise.
#[derive(Clone, Copy, Debug)]
pub struct PathCosts {
    /// Cost of low clearance: a metre with the underside `d` radii below the margin costs
    /// `belly * d * (1 + d)`.
    pub belly: f64,
    /// Clearance that costs nothing.
    pub margin: f64,
    /// Cost of a wheel's rise by a radius.
    pub climb: f64,
    /// Cost of the square of a wheel's rise between two poses, beyond half a radius.
    pub step: f64,
    /// Cost of a metre at a slope of 1; it grows with the square of the slope.
    pub lean: f64,
    /// Cost of a heading one radian off the goal, over the rover's reach.
    pub facing: f64,
    /// Cost of a change of the curvature or sideways command from 0 to its limit.
    pub swerve: f64,
    /// Cost of a change between forward and backward.
    pub switch: f64,
    /// Cost of an arc driven backward.
    pub reverse: f64,
    /// Cost of an arc through a pose in which the rover got stuck.
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
