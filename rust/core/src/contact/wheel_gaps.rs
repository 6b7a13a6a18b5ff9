//! Gaps of all wheels, without the poses, points and frames that only a step needs.

use nalgebra::Vector3;

use super::detection::wheel_gap;
use super::part::{shape_about, wheel_shape};
use crate::geometry::{Disc, Plane, Terrain};
use crate::multibody::joint::{Joint, JointAxis};
use crate::multibody::{Configuration, Kinematics, Model};
use crate::scalar::elementary::sines_cosines;
use crate::scalar::{Mat3, Single, Vec3};

/// Angles are turned in whole registers.
const REGISTER: usize = 8;

/// Gaps of wheels: scratch.
#[derive(Debug, Default)]
pub struct WheelGaps {
    poses: Vec<Pose>,
    /// Angles, sines and cosines of the joints that are not spinners', in the order of the bodies.
    turns: [Vec<f64>; 3],
    /// Poses of a machine with other joints than revolute ones.
    kinematics: Option<Kinematics>,
}

/// Columns of an attitude.
type Columns = (Vec3<f64>, Vec3<f64>, Vec3<f64>);

/// Pose of a body.
#[derive(Clone, Copy, Debug)]
struct Pose {
    /// Attitude; without meaning for a body that only spins.
    R: Mat3<f64>,
    /// Origin relative to the trunk's, m.
    r: Vec3<f64>,
    /// The body whose attitude it has: itself, or for one that only spins its carrier.
    frame: usize,
}

impl WheelGaps {
    /// Writes the gap of every wheel (m) over a terrain: that of
    /// [`wheel_contact`](super::detection::wheel_contact).
    ///
    /// # Panics
    /// If there are not as many gaps as wheels.
    pub fn write(
        &mut self,
        model: &Model,
        configuration: &Configuration,
        terrain: &dyn Terrain,
        gaps: &mut [f64],
    ) {
        assert_eq!(gaps.len(), model.wheels().len(), "one gap a wheel");
        if !(model.only_turns() && model.trees().len() == 1) {
            self.write_by_kinematics(model, configuration, terrain, gaps);
            return;
        }
        self.pose(model, configuration);
        if let Some(plane) = terrain.ground().filter(|_| terrain.is_plane()) {
            self.write_over_plane(model, &configuration.position, plane, gaps);
            return;
        }
        for (gap, wheel) in gaps.iter_mut().zip(model.wheels()) {
            let (R, r) = self.place(wheel.body);
            let turned = |v: &Vector3<f64>| R.times_shared((*v).into());
            let disc = Disc {
                centre: vector(r + turned(&wheel.centre)),
                axle: vector(turned(&wheel.axle)),
                spoke: vector(turned(&wheel.spoke)),
                radius: wheel.radius,
            };
            let shape = shape_about(wheel, disc);
            *gap = wheel_gap(&shape, &configuration.position, terrain);
        }
    }

    #[cold]
    fn write_by_kinematics(
        &mut self,
        model: &Model,
        configuration: &Configuration,
        terrain: &dyn Terrain,
        gaps: &mut [f64],
    ) {
        if !(self.kinematics.as_ref()).is_some_and(|own| own.is_of(model)) {
            self.kinematics = None;
        }
        let kinematics = (self.kinematics).get_or_insert_with(|| Kinematics::new(model));
        kinematics.update_for_step(model, configuration);
        for (gap, wheel) in gaps.iter_mut().zip(model.wheels()) {
            let shape = wheel_shape(wheel, kinematics);
            *gap = wheel_gap(&shape, kinematics.origin(wheel.body), terrain);
        }
    }

    /// Poses of a machine on a free base whose other joints are revolute and uncoupled.
    fn pose(&mut self, model: &Model, configuration: &Configuration) {
        let bodies = model.bodies();
        let [angles, sines, cosines] = &mut self.turns;
        angles.clear();
        for body in bodies {
            if let Joint::Revolute(joint) = &body.joint
                && !body.is_spinner
            {
                angles.push(configuration.joints[joint.coordinate.joint]);
            }
        }
        let n = angles.len().next_multiple_of(REGISTER);
        angles.resize(n, 0.0);
        sines.resize(n, 0.0);
        cosines.resize(n, 0.0);
        Single::best().vectorize(
            #[inline(always)]
            || sines_cosines(angles, sines, cosines),
        );

        let attitude = configuration.attitude.to_rotation_matrix();
        let origin = Vec3::new(0.0, 0.0, 0.0);
        let trunk = Pose {
            R: matrix(attitude.matrix()),
            r: origin,
            frame: 0,
        };
        self.poses.resize(bodies.len(), trunk);
        self.poses[0] = trunk;
        let mut turn = 0;
        for (b, body) in bodies.iter().enumerate().skip(1) {
            let (Some(parent), Joint::Revolute(joint)) = (body.parent, &body.joint) else {
                unreachable!("invariant: all other joints turn a body on another")
            };
            let (before, own) = self.poses.split_at_mut(b);
            let (carrier, own) = (&before[parent], &mut own[0]);
            let R = &before[carrier.frame].R;
            own.r = carrier.r + R.times_shared(body.position.into());
            own.frame = b;
            let (mut x, mut y, mut z) = (R.x, R.y, R.z);
            if let Some(fixed) = &body.rotation {
                let column =
                    |j: usize| R.times_shared([fixed[(0, j)], fixed[(1, j)], fixed[(2, j)]]);
                (x, y, z) = (column(0), column(1), column(2));
            } else if body.is_spinner {
                own.frame = carrier.frame;
                continue;
            }
            if !body.is_spinner {
                let (s, c) = (sines[turn], cosines[turn]);
                (x, y, z) = match &joint.axis {
                    JointAxis::X => (x, y * c + z * s, z * c - y * s),
                    JointAxis::Y => (x * c - z * s, y, z * c + x * s),
                    JointAxis::Z => (x * c + y * s, y * c - x * s, z),
                    JointAxis::General(_) => rotated(&joint.axis, [x, y, z], angles[turn]),
                };
                turn += 1;
            }
            own.R = Mat3 { x, y, z };
        }
    }

    /// Attitude of a body, but for its spin, and its origin relative to the trunk's, m.
    #[inline]
    fn place(&self, body: usize) -> (&Mat3<f64>, Vec3<f64>) {
        let pose = &self.poses[body];
        (&self.poses[pose.frame].R, pose.r)
    }

    /// The gap of the lowest point of every wheel over a plane: see
    /// [`crate::geometry::query::disc_plane`] and [`crate::geometry::query::roller_plane`].
    fn write_over_plane(
        &self,
        model: &Model,
        origin: &Vector3<f64>,
        plane: &Plane,
        gaps: &mut [f64],
    ) {
        let [x, y, z]: [f64; 3] = (*plane.normal()).into();
        let [o_x, o_y, o_z]: [f64; 3] = (*origin).into();
        let n = Vec3::new(x, y, z);
        let base = n.dot(Vec3::new(o_x, o_y, o_z)) + plane.offset();
        for (gap, wheel) in gaps.iter_mut().zip(model.wheels()) {
            let (R, r) = self.place(wheel.body);
            let centre = r + R.times_shared(wheel.centre.into());
            let axle = R.times_shared(wheel.axle.into());
            let w = n - axle * n.dot(axle);
            let height = base + n.dot(centre);
            *gap = if wheel.is_wide() {
                let half = 0.5 * wheel.width - wheel.rounding;
                let lean = n.dot(axle).abs();
                height - (wheel.radius - wheel.rounding) * w.norm() - half * lean - wheel.rounding
            } else {
                height - wheel.radius * w.norm()
            };
        }
    }
}

/// The columns of an attitude, rotated about an axis that is none of the coordinate axes.
#[cold]
fn rotated(axis: &JointAxis, columns: [Vec3<f64>; 3], angle: f64) -> Columns {
    let R = nalgebra::Matrix3::from_columns(&columns.map(vector));
    let Mat3 { x, y, z } = matrix(&axis.rotate(&R, angle).0);
    (x, y, z)
}

#[inline]
fn matrix(R: &nalgebra::Matrix3<f64>) -> Mat3<f64> {
    let column = |j: usize| Vec3::new(R[(0, j)], R[(1, j)], R[(2, j)]);
    Mat3 {
        x: column(0),
        y: column(1),
        z: column(2),
    }
}

#[inline]
fn vector(v: Vec3<f64>) -> Vector3<f64> {
    Vector3::new(v.x, v.y, v.z)
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::contact::detection::wheel_contacts;
    use crate::geometry::SphereField;
    use crate::multibody::{JointKind, ModelDescription, SolidDescription, coordinates};
    use proptest::prelude::*;

    /// The rover; the same with wide wheels, with a joint about no coordinate axis, and with one
    /// that slides.
    fn machines() -> [Model; 4] {
        let changed = |change: fn(&mut SolidDescription)| {
            let mut rover = ModelDescription::rover();
            let carried = rover.solids.iter_mut().find(|s| s.parent.is_some());
            change(carried.unwrap());
            Model::from_description(rover).unwrap()
        };
        let mut wide = ModelDescription::rover();
        for wheel in &mut wide.wheels {
            (wheel.width, wheel.rounding) = (Some(0.1), Some(0.02));
        }
        [
            Model::rover(),
            Model::from_description(wide).unwrap(),
            changed(|solid| solid.axis = Some([0.1, 0.2, 0.9])),
            changed(|solid| solid.joint = Some(JointKind::Prismatic)),
        ]
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(32))]
        #[test]
        fn gaps_are_those_of_the_contacts(q in prop::collection::vec(-1.0..1.0, 21)) {
            let plane = Plane::new([0.2, 1.0, -0.1], 0.3).unwrap();
            let (centres, radii) = ([[0.5, -0.2, 0.3], [-0.6, 0.0, 0.1]], [0.4, 0.2]);
            let field = SphereField::new(&centres, &radii, Some(plane)).unwrap();
            let grounds: [Arc<dyn Terrain>; 2] = [Arc::new(plane), Arc::new(field)];
            let mut scratch = WheelGaps::default();
            for model in machines() {
                let place = coordinates::from_public(&model, &q).unwrap();
                let poses = Kinematics::of(&model, &place);
                for ground in &grounds {
                    let mut gaps = vec![0.0; model.wheels().len()];
                    scratch.write(&model, &place, &**ground, &mut gaps);
                    let contacts = wheel_contacts(&model, &poses, &**ground);
                    for (gap, contact) in gaps.iter().zip(contacts) {
                        prop_assert!((gap - contact.gap).abs() < 1e-13, "{gap} {}", contact.gap);
                    }
                }
            }
        }
    }
}
