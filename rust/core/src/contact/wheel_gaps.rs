//! Gaps of all wheels, without the poses, points and frames that only a step needs.

use nalgebra::Vector3;

use super::detection::disc_gap;
use super::part::place_wheel;
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

/// Pose of a body. Written number by number: a register that is stored in parts and loaded as a
/// whole takes as long as the rest of the pose.
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
        let plane = terrain.ground().filter(|_| !terrain.can_be_passed());
        let token = Single::best();
        match plane {
            Some(plane) => token.vectorize(
                #[inline(always)]
                || {
                    self.pose(model, configuration);
                    self.write_over_plane(model, &configuration.position, plane, gaps);
                },
            ),
            None => {
                token.vectorize(
                    #[inline(always)]
                    || self.pose(model, configuration),
                );
                for (gap, wheel) in gaps.iter_mut().zip(model.wheels()) {
                    let (R, r) = self.place(wheel.body);
                    let turned = |v: &Vector3<f64>| R.times_shared((*v).into());
                    let disc = Disc {
                        centre: vector(r + turned(&wheel.centre)),
                        axle: vector(turned(&wheel.axle)),
                        spoke: vector(turned(&wheel.spoke)),
                        radius: wheel.radius,
                    };
                    *gap = disc_gap(&disc, &configuration.position, terrain);
                }
            }
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
            let disc = place_wheel(wheel, kinematics);
            *gap = disc_gap(&disc, kinematics.origin(wheel.body), terrain);
        }
    }

    /// Poses of a machine on a free base whose other joints are revolute and uncoupled.
    #[inline(always)]
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
        sines_cosines(angles, sines, cosines);

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
            let R = &mut own.R;
            (R.x, R.y, R.z) = (x, y, z);
            if body.is_spinner {
                continue;
            }
            let (s, c) = (sines[turn], cosines[turn]);
            match joint.axis {
                JointAxis::X => (R.y, R.z) = (y * c + z * s, z * c - y * s),
                JointAxis::Y => (R.z, R.x) = (z * c + x * s, x * c - z * s),
                JointAxis::Z => (R.x, R.y) = (x * c + y * s, y * c - x * s),
                JointAxis::General(_) => *R = rotated(&joint.axis, R, angles[turn]),
            }
            turn += 1;
        }
    }

    /// Attitude of a body, but for its spin, and its origin relative to the trunk's, m.
    #[inline(always)]
    fn place(&self, body: usize) -> (&Mat3<f64>, Vec3<f64>) {
        let pose = &self.poses[body];
        (&self.poses[pose.frame].R, pose.r)
    }

    /// The gap of the lowest rim point of every wheel over a plane: see
    /// [`crate::geometry::query::disc_plane`].
    #[inline(always)]
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
            *gap = base + n.dot(centre) - wheel.radius * w.norm();
        }
    }
}

/// Rotation about an axis that is none of the coordinate axes.
#[cold]
fn rotated(axis: &JointAxis, R: &Mat3<f64>, angle: f64) -> Mat3<f64> {
    let R = nalgebra::Matrix3::from_columns(&[vector(R.x), vector(R.y), vector(R.z)]);
    matrix(&axis.rotate(&R, angle).0)
}

#[inline(always)]
fn matrix(R: &nalgebra::Matrix3<f64>) -> Mat3<f64> {
    let column = |j: usize| Vec3::new(R[(0, j)], R[(1, j)], R[(2, j)]);
    Mat3 {
        x: column(0),
        y: column(1),
        z: column(2),
    }
}

#[inline(always)]
fn vector(v: Vec3<f64>) -> Vector3<f64> {
    Vector3::new(v.x, v.y, v.z)
}
