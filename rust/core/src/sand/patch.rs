//! Force of sand on a wheel: the stress over what is under the surface, with its derivatives.

use nalgebra::{Matrix3, Matrix6, Vector3, Vector6};

use super::memory::Memory;
use super::piece::Piece;
use super::soil::Soil;
use super::wheel::{Ring, Rules, SandWheel, visit_rings};
use crate::scalar::elementary::{acos, sin_cos};

/// Pose of a wheel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WheelPose {
    /// World, or relative to an origin that the bed shares, m.
    pub centre: Vector3<f64>,
    /// Unit vector.
    pub axle: Vector3<f64>,
}

/// Heights of the surface over the plane of a [`Bed`] at a place, m: undisturbed, and as wheels
/// have left it.
pub type Relief<'a> = &'a dyn Fn(&Vector3<f64>) -> [f64; 2];

/// The surface of the sand near a wheel.
#[derive(Clone, Copy)]
pub struct Bed<'a> {
    /// A point of its tangent plane, m.
    pub place: Vector3<f64>,
    /// Unit normal of that plane, out of the sand.
    pub normal: Vector3<f64>,
    /// Heights over the plane; none of a plane bed.
    pub relief: Option<Relief<'a>>,
    /// What no height near the wheel exceeds, m.
    pub highest: f64,
    /// Gravity against the normal, m/s².
    pub gravity: f64,
}

/// Force on a wheel and its derivatives.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reaction {
    /// Force, N, and moment about the centre, N m, in world axes.
    pub wrench: Vector6<f64>,
    /// Its derivative by the six numbers of the memory.
    pub by_memory: Matrix6<f64>,
    /// Its derivative by a translation and a rotation of the wheel, m and rad. The normals of the
    /// pieces are kept.
    pub by_pose: Matrix6<f64>,
    /// Area under the surface, m².
    pub area: f64,
    /// Depth of the lowest point under the surface, m; negative where the wheel is clear of it.
    pub sinkage: f64,
}

/// Derivatives are not computed where they are not asked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Want {
    /// The wrench alone.
    Wrench,
    /// The wrench and its derivatives.
    Slopes,
}

/// Sine between axle and normal below which the wheel lies flat.
const FLAT: f64 = 1e-9;

/// How fast the side at which the rim enters changes with the direction of travel.
const ENTRY: f64 = 0.1;

/// Frame of a wheel relative to the bed.
struct Frame<'a> {
    wheel: &'a SandWheel,
    rules: &'a Rules,
    soil: &'a Soil,
    bed: &'a Bed<'a>,
    pose: &'a WheelPose,
    memory: &'a Memory,
    want: Want,
    /// In the wheel's plane, downwards and along.
    down: Vector3<f64>,
    along: Vector3<f64>,
    /// Sine of the angle between axle and normal.
    sine: f64,
    /// Height of the wheel's centre over the plane, m.
    height: f64,
    /// Along the axle per unit of normal.
    lean: f64,
    held: f64,
    /// From −1 to 1: which end of an arc enters the sand.
    entry: f64,
}

/// The force of a soil on a wheel in a pose, with what the sand remembers.
#[must_use]
pub fn react(
    (wheel, rules): (&SandWheel, &Rules),
    soil: &Soil,
    bed: &Bed<'_>,
    pose: &WheelPose,
    memory: &Memory,
    want: Want,
) -> Reaction {
    let lean = pose.axle.dot(&bed.normal);
    let flat = pose.axle * lean - bed.normal;
    let sine = flat.norm();
    let down = if sine > FLAT {
        flat / sine
    } else {
        perpendicular(&pose.axle)
    };
    let along = pose.axle.cross(&down);
    let travel = Vector3::from(memory.shift).dot(&along);
    let height = (pose.centre - bed.place).dot(&bed.normal);
    let frame = Frame {
        wheel,
        rules,
        soil,
        bed,
        pose,
        memory,
        want,
        down,
        along,
        sine,
        height,
        lean,
        held: wheel.held(),
        entry: travel / (travel * travel + ENTRY * ENTRY).sqrt(),
    };
    let radius = wheel.drum();
    let half = 0.5 * wheel.width;
    let mut reaction = Reaction {
        wrench: Vector6::zeros(),
        by_memory: Matrix6::zeros(),
        by_pose: Matrix6::zeros(),
        area: 0.0,
        sinkage: half * lean.abs() + radius * sine - height,
    };
    if reaction.sinkage + bed.highest > 0.0 {
        // The inner radius of what is wet of the side wall that is deeper.
        let dry = (height - half * lean.abs() - bed.highest) / sine.max(FLAT);
        visit_rings(wheel, rules, dry, |ring| frame.add(ring, &mut reaction));
    }
    reaction
}

/// A unit vector perpendicular to a given one.
fn perpendicular(axle: &Vector3<f64>) -> Vector3<f64> {
    let e = if axle.x.abs() < 0.7 {
        Vector3::x()
    } else {
        Vector3::y()
    };
    (e - axle * axle.dot(&e)).normalize()
}

impl Frame<'_> {
    /// Adds the stress over the arc of a ring that is under the surface.
    fn add(&self, ring: &Ring, sum: &mut Reaction) {
        let raised = self.bed.highest - self.height - ring.offset * self.lean;
        let swing = ring.radius * self.sine;
        if raised <= -swing {
            return;
        }
        let arc = if raised >= swing {
            std::f64::consts::PI
        } else {
            acos(-raised / swing)
        };
        for (x, weight) in &self.rules.arc.points {
            let theta = arc * x;
            let area = arc * weight * ring.radius * ring.width;
            let (sin, cos) = sin_cos(theta);
            let radial = self.down * cos + self.along * sin;
            let r = radial * ring.radius + self.pose.axle * ring.offset;
            let depth = self.depth(&r);
            if depth[0] > 0.0 {
                let way = ring.radius * (arc - self.entry * theta);
                let normal = radial * ring.normal[0] + self.pose.axle * ring.normal[1];
                self.add_piece(ring, &r, &normal, (depth, way, area), sum);
            }
        }
    }

    /// Depth that counts of a piece at `r` from the centre, m, and its derivative by the depth.
    fn depth(&self, r: &Vector3<f64>) -> [f64; 2] {
        let below = -self.height - r.dot(&self.bed.normal);
        let Some(relief) = self.bed.relief else {
            return [below, 1.0];
        };
        let [virgin, left] = relief(&(self.pose.centre + r));
        let (virgin, left) = (below + virgin, (below + left) * self.soil.reload);
        if left < virgin {
            [left, self.soil.reload]
        } else {
            [virgin, 1.0]
        }
    }

    fn add_piece(
        &self,
        ring: &Ring,
        r: &Vector3<f64>,
        normal: &Vector3<f64>,
        ([depth, by_depth], arc, area): ([f64; 2], f64, f64),
        sum: &mut Reaction,
    ) {
        let down = -self.bed.normal;
        let x = self.memory.at(r);
        let stress = self.soil.stress(&Piece {
            normal,
            x: &x,
            down: &down,
            depth,
            arc,
            skin: ring.skin,
            held: self.held,
            width: self.wheel.width,
            gravity: self.bed.gravity,
        });
        let force = stress.value * area;
        sum.area += area;
        add_wrench(&mut sum.wrench, r, &force);
        if self.want == Want::Wrench {
            return;
        }
        add_slope(&mut sum.by_memory, r, &(stress.by_x * area));
        // The wheel may turn about its axle without a change of depth.
        let by_depth = stress.by_depth * (by_depth * area);
        let axle = &self.pose.axle;
        let turn = r.cross(&down);
        let turn = turn - axle * axle.dot(&turn);
        let lever = Vector6::new(down.x, down.y, down.z, turn.x, turn.y, turn.z);
        let mut wrench = Vector6::zeros();
        add_wrench(&mut wrench, r, &by_depth);
        sum.by_pose += wrench * lever.transpose();
    }
}

fn add_wrench(sum: &mut Vector6<f64>, r: &Vector3<f64>, force: &Vector3<f64>) {
    let moment = r.cross(force);
    for k in 0..3 {
        sum[k] += force[k];
        sum[3 + k] += moment[k];
    }
}

/// Adds `Jᵀ S J` with `J = [1, −r×]`, the displacement of a piece at r by those of the wheel.
fn add_slope(sum: &mut Matrix6<f64>, r: &Vector3<f64>, slope: &Matrix3<f64>) {
    let cross = r.cross_matrix();
    let turned = slope * -cross;
    for i in 0..3 {
        for j in 0..3 {
            sum[(i, j)] += slope[(i, j)];
            sum[(i, 3 + j)] += turned[(i, j)];
        }
    }
    let (moment, turned) = (cross * slope, cross * turned);
    for i in 0..3 {
        for j in 0..3 {
            sum[(3 + i, j)] += moment[(i, j)];
            sum[(3 + i, 3 + j)] += turned[(i, j)];
        }
    }
}
