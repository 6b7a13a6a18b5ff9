//! A reading: all inputs of a controller as one row of numbers.

use std::ops::Range;

use nalgebra::Vector3;

use super::rover::RoverSimulation;
use super::rover_sand::{SLIP_SPEED, WheelContactInSand};
use crate::contact::WheelGaps;
use crate::geometry::Terrain;
use crate::integrator::StepStatus;
use crate::multibody::{Model, coordinates};
use crate::scalar::elementary::{hypot, sin_cos};
use crate::spatial::HeadingPitchRoll;

/// A wheel touches when its gap is at most this, m. Resting wheels show gaps below a micrometre.
pub const CONTACT_GAP: f64 = 1e-3;

/// Distance over which the slope of a surface is read, m: about as wide as the rover stands.
pub const FOOTPRINT: f64 = 1.0;

/// Normal of the ground plane, or of a surface about a place (x, z, m).
fn ground_normal(terrain: &dyn Terrain, x: f64, z: f64) -> Option<Vector3<f64>> {
    if let Some(plane) = terrain.ground() {
        return Some(*plane.normal());
    }
    if !terrain.has_surface() {
        return None;
    }
    let half = 0.5 * FOOTPRINT;
    let rise = |dx: f64, dz: f64| {
        let ahead = terrain.height(x + dx, z + dz)?;
        Some((ahead - terrain.height(x - dx, z - dz)?) / FOOTPRINT)
    };
    Some(Vector3::new(-rise(half, 0.0)?, 1.0, -rise(0.0, half)?).normalize())
}

/// Request for a reading.
#[derive(Clone, Copy, Debug, Default)]
pub struct ReadingRequest<'a> {
    /// A place on the map, x and z, m.
    pub target: [f64; 2],
    /// Points of the height scan, ahead and to the right of the trunk's origin in the heading
    /// frame, m.
    pub scan: &'a [[f64; 2]],
}

/// Names and positions of the numbers in a reading, in order. SI units.
///
/// | name | size | meaning |
/// |---|---|---|
/// | `pose` | nq | public q with the wheels' angles wrapped to one turn |
/// | `body_velocity` | 6 | trunk, linear then angular, in the trunk's frame |
/// | `joint_rates` | nv − 6 | |
/// | `wheel_gaps` | n | distance to the ground or the nearest grain, one a wheel; minus the sinkage of a wheel in sand |
/// | `wheel_contacts` | n | 1 where the gap is at most [`CONTACT_GAP`], else 0 |
/// | `normal_forces` | n | mean of the last step, N |
/// | `tangential_forces` | 2 n | rolling, lateral, wheel by wheel, N |
/// | `ground_normal` | 3 | in the trunk's frame: of the ground plane, or of a surface over [`FOOTPRINT`] about the trunk's origin; zero where there is none |
/// | `target` | 3 | a place on the map: ahead and to the right of the trunk's origin, and how far; horizontal |
/// | `cos_tilt` | 1 | between the trunk's y axis and up, against gravity |
/// | `speed` | 1 | of the trunk's origin, horizontal |
/// | `trunk_force` | 1 | mean normal force of the last step on all that is no wheel, N |
/// | `slip_ratio` | 1 | mean over the wheels' contacts of the last step of rim slip over the faster of rim and ground |
/// | `work` | 1 | through the wheel motors in the last call of `step`, driving or braking, J |
/// | `positive_work` | 1 | its driving part, J |
/// | `time` | 1 | s |
/// | `solver` | 4 | of the last call of `step`: 1 where it did not converge, iterations, residual, most contacts |
/// | `heights` | scan | of the visible ground over the trunk's origin; not a number where there is none |
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ReadingLayout {
    fields: Vec<(&'static str, Range<usize>)>,
    size: usize,
}

impl ReadingLayout {
    /// Layout for a model and this number of height scan points.
    #[must_use]
    pub fn new(model: &Model, n_scan: usize) -> Self {
        let n = model.wheels().len();
        let sizes = [
            ("pose", model.nv()),
            ("body_velocity", 6),
            ("joint_rates", model.n_joints()),
            ("wheel_gaps", n),
            ("wheel_contacts", n),
            ("normal_forces", n),
            ("tangential_forces", 2 * n),
            ("ground_normal", 3),
            ("target", 3),
            ("cos_tilt", 1),
            ("speed", 1),
            ("trunk_force", 1),
            ("slip_ratio", 1),
            ("work", 1),
            ("positive_work", 1),
            ("time", 1),
            ("solver", 4),
            ("heights", n_scan),
        ];
        let mut size = 0;
        let mut place = |(name, width)| {
            size += width;
            (name, size - width..size)
        };
        let fields = sizes.into_iter().map(&mut place).collect();
        Self { fields, size }
    }

    /// Names with their places.
    #[must_use]
    pub fn fields(&self) -> &[(&'static str, Range<usize>)] {
        &self.fields
    }

    /// Numbers of a reading.
    #[must_use]
    pub fn size(&self) -> usize {
        self.size
    }
}

/// Fills a slice from its front.
struct Row<'a> {
    out: &'a mut [f64],
    filled: usize,
}

impl Row<'_> {
    /// Room for the next `n` numbers.
    fn next(&mut self, n: usize) -> &mut [f64] {
        self.filled += n;
        &mut self.out[self.filled - n..self.filled]
    }

    fn put(&mut self, values: impl IntoIterator<Item = f64>) {
        for value in values {
            self.out[self.filled] = value;
            self.filled += 1;
        }
    }
}

/// Scratch of readings: kept between them, so that a reading allocates nothing.
#[derive(Debug, Default)]
pub struct ReadingScratch {
    gaps: WheelGaps,
    forces: Vec<[f64; 3]>,
    /// Room for the numbers of a reader.
    pub numbers: Vec<f64>,
}

/// A target (x, z) from a place (x, z) with a heading (rad): ahead, to the right, and how far, m.
#[must_use]
pub fn seen_from([x, z]: [f64; 2], heading: f64, target: [f64; 2]) -> [f64; 3] {
    let (sine, cosine) = sin_cos(heading);
    let (dx, dz) = (target[0] - x, target[1] - z);
    [
        dx * cosine - dz * sine,
        dx * sine + dz * cosine,
        hypot(dx, dz),
    ]
}

impl RoverSimulation {
    /// Writes a reading in the order of [`ReadingLayout`].
    ///
    /// # Panics
    /// If the size of `out` is not that of the layout of this model and scan.
    pub fn read(&self, look: &ReadingRequest<'_>, scratch: &mut ReadingScratch, out: &mut [f64]) {
        let heights = out.len().saturating_sub(look.scan.len());
        let (state, heights) = out.split_at_mut(heights);
        self.read_state(look.target, scratch, state);
        self.read_heights(look.scan, heights);
    }

    /// Writes a reading without heights.
    ///
    /// # Panics
    /// If the size of `out` is not that of the layout of this model without a scan.
    pub fn read_state(&self, target: [f64; 2], scratch: &mut ReadingScratch, out: &mut [f64]) {
        let model = self.model();
        let (pose, rest) = out.split_at_mut(model.nv());
        let mut row = Row {
            out: rest,
            filled: 0,
        };
        let state = self.state();
        let R_WB = state.configuration.attitude.to_rotation_matrix();

        coordinates::write_public(model, &state.configuration, pose);
        for j in model.wheels().iter().filter_map(|wheel| wheel.joint) {
            let k = model.joint_velocity(j);
            let turn = std::f64::consts::TAU;
            pose[k] -= turn * (pose[k] / turn).round_ties_even();
        }
        let [x, _, z]: [f64; 3] = state.configuration.position.into();
        let is_free = model.trees()[0].is_free;

        // A first body that is not free moves with the world.
        let v = &state.v;
        let base = match v[..] {
            [a, b, c, d, e, f, ..] if is_free => [a, b, c, d, e, f],
            _ => [0.0; 6],
        };
        let linear = R_WB.inverse() * Vector3::new(base[0], base[1], base[2]);
        let angular = R_WB.inverse() * Vector3::new(base[3], base[4], base[5]);
        row.put(linear.iter().copied());
        row.put(angular.iter().copied());
        row.put(model.joint_velocities().iter().map(|&k| v[k]));

        let n_wheels = model.wheels().len();
        let (gaps, touch) = row.next(2 * n_wheels).split_at_mut(n_wheels);
        let terrain = &**self.terrain();
        (scratch.gaps).write(model, &state.configuration, terrain, gaps);
        for (gap, to_grain) in gaps.iter_mut().zip(&self.parts.gaps_to_grains) {
            *gap = gap.min(*to_grain);
        }
        let in_sand = self.wheels_in_sand();
        for contact in &in_sand {
            gaps[contact.wheel] = gaps[contact.wheel].min(-contact.sinkage);
        }
        for (touch, gap) in touch.iter_mut().zip(gaps) {
            *touch = f64::from(u8::from(*gap <= CONTACT_GAP));
        }
        self.sum_wheel_forces(&in_sand, &mut scratch.forces);
        let forces = &scratch.forces;
        row.put(forces.iter().map(|force| force[0]));
        row.put(forces.iter().flat_map(|force| [force[1], force[2]]));
        let normal = ground_normal(&**self.terrain(), x, z).unwrap_or_default();
        let normal = R_WB.inverse() * normal;
        row.put(normal.iter().copied());

        let heading = if is_free { pose[4] } else { 0.0 };
        row.put(seen_from([x, z], heading, target));
        let gravity = &self.options().gravity;
        let up = gravity.try_normalize(0.0).map_or(Vector3::y(), |g| -g);
        row.put([
            up.dot(&R_WB.matrix().column(1)),
            hypot(base[0], base[2]),
            self.body_force(),
            self.mean_slip(&in_sand),
        ]);

        let last = self.last_call();
        let report = &last.report;
        row.put([
            last.work,
            last.positive_work,
            state.time,
            f64::from(u8::from(report.status == StepStatus::NotConverged)),
            report.iterations as f64,
            report.residual,
            report.n_contacts as f64,
        ]);
        assert_eq!(row.filled, row.out.len(), "a row as long as its layout");
    }

    /// Writes the heights of a reading at the points of a scan.
    ///
    /// # Panics
    /// If there are not as many heights as points.
    pub fn read_heights(&self, scan: &[[f64; 2]], heights: &mut [f64]) {
        assert_eq!(heights.len(), scan.len(), "one height a point");
        if scan.is_empty() {
            return;
        }
        let configuration = &self.state().configuration;
        let [x, y, z]: [f64; 3] = configuration.position.into();
        let heading = if self.model().trees()[0].is_free {
            let attitude = configuration.attitude.to_rotation_matrix();
            HeadingPitchRoll::from_rotation(attitude.matrix()).heading
        } else {
            0.0
        };
        let (sine, cosine) = sin_cos(heading);
        for (own, [ahead, right]) in heights.iter_mut().zip(scan) {
            let at_x = x + (ahead * cosine + right * sine);
            let at_z = z + (right * cosine - ahead * sine);
            let height = self.terrain().height(at_x, at_z);
            *own = height.map_or(f64::NAN, |height| height - y);
        }
    }

    /// Mean over the wheels' contacts of the last step, and the wheels in sand, of |u_T| / max(|rim
    /// speed|, |ground speed|); 0 without contacts.
    #[must_use]
    pub fn slip_ratio(&self) -> f64 {
        self.mean_slip(&self.wheels_in_sand())
    }

    fn mean_slip(&self, in_sand: &[WheelContactInSand]) -> f64 {
        let mut total: f64 = in_sand.iter().map(|contact| contact.slip).sum();
        let mut n = in_sand.len();
        self.for_each_wheel_contact(|i, _, [_, u_t, u_b]| {
            let wheel = &self.model().wheels()[i];
            let rate = wheel.joint;
            let rate = rate.map_or(0.0, |j| self.state().v[self.model().joint_velocity(j)]);
            let rim = wheel.radius * wheel.drive_sign * rate;
            let ground = hypot(rim + u_t, u_b);
            total += hypot(u_t, u_b) / rim.abs().max(ground).max(SLIP_SPEED);
            n += 1;
        });
        if n == 0 { 0.0 } else { total / n as f64 }
    }
}
