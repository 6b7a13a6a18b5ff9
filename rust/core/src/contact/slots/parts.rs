//! The parts of a machine that meet the ground, and the motion of what carries them.
//!
//! The spin of a wheel moves its nearest point to the ground along the ground alone, so its
//! normal velocity comes from the carrier.

use std::ops::Range;

use nalgebra::Vector3;

use super::machine::SharedMachine;
use crate::contact::Part;
use crate::contact::ways_out::shallow;
use crate::geometry::query::section::Section;
use crate::multibody::JointAxis;
use crate::multibody::joint::{Joint, JointModel, Revolute};
use crate::multibody::mechanism::{BASE, Link, PathVelocity};
use crate::multibody::poses::{Pose, Poses};
use crate::scalar::{Lane, Mat3, Vec3};

/// Wheels and boxes.
#[derive(Clone, Debug)]
pub(crate) struct Parts {
    pub wheels: Vec<ContactWheel>,
    pub boxes: Vec<Solid>,
    /// First velocities of the trees' free roots, whose twists come first; none of a tree that a
    /// joint connects to the world, whose twist is zero.
    roots: Vec<Option<usize>>,
    /// The roots or the world, then bodies after what carries them.
    carriers: Vec<Carrier>,
}

/// A wheel, as contacts need it.
#[derive(Clone, Debug)]
pub(crate) struct ContactWheel {
    pub body: usize,
    pub tree: usize,
    /// Slots for the wheel's contacts.
    pub slots: Range<usize>,
    centre: Option<[f64; 3]>,
    axle: Axle,
    pub spoke: [f64; 3],
    pub section: Section,
    /// Depth in a surface up to which all its points count, m.
    pub shallow: f64,
    /// Sine and cosine of the angle of its rollers from the axle, if it has any.
    pub rollers: Option<[f64; 2]>,
    /// Friction across over that along, if they differ.
    pub across: Option<f64>,
    /// Radius of a bounding ball, m.
    pub bound: f64,
    /// Twist of the body that moves its centre.
    pub carrier: usize,
}

/// Where a wheel's axle comes from.
#[derive(Clone, Copy, Debug)]
enum Axle {
    /// Along an axis of the body's frame, or against it.
    Frame(usize, bool),
    /// A direction in the body's frame.
    Fixed([f64; 3]),
}

/// A box, as contacts need it.
#[derive(Clone, Debug)]
pub(crate) struct Solid {
    pub part: Part,
    pub body: usize,
    pub tree: usize,
    centre: Option<[f64; 3]>,
    rotation: Option<[[f64; 3]; 3]>,
    pub half_size: [f64; 3],
    /// Radius of a bounding ball, m.
    pub bound: f64,
    /// Twist of its body.
    pub carrier: usize,
}

/// A body whose twist is needed, or what lies between two velocities of a spherical joint.
#[derive(Clone, Copy, Debug)]
struct Carrier {
    /// None of the world.
    body: Option<usize>,
    /// Twist of what carries it.
    parent: usize,
    /// The velocity that moves it beside.
    mover: PathVelocity,
}

/// Velocity of a body: angular, and of its material point at the origin of its tree.
#[derive(Clone, Copy, Debug)]
pub(crate) struct BodyTwist<T> {
    pub angular: Vec3<T>,
    pub linear: Vec3<T>,
}

impl Parts {
    /// The parts of a machine.
    pub(crate) fn of(machine: &SharedMachine) -> Self {
        let mut carriers: Vec<Carrier> = (machine.trees.iter())
            .map(|tree| Carrier {
                body: tree.is_free.then_some(tree.bodies.start),
                parent: 0,
                mover: PathVelocity {
                    velocity: 0,
                    motion: 0,
                }, // not read
            })
            .collect();
        let some = |x: [f64; 3]| x.iter().any(|x| x.abs() > 0.0).then_some(x);
        let mut n_slots = 0;
        let wheels = (machine.wheels.iter())
            .map(|wheel| {
                let first = n_slots;
                n_slots += wheel.n_slots;
                let link = &machine.links[wheel.body];
                let axle = axle_of(wheel.axle);
                let spins = link.is_spinner && link.turns_about(axle);
                let mover = if spins { link.parent } else { wheel.body };
                ContactWheel {
                    body: wheel.body,
                    tree: machine.tree_of_body(wheel.body),
                    slots: first..n_slots,
                    centre: some(wheel.centre),
                    axle,
                    spoke: wheel.spoke,
                    section: Section {
                        radius: wheel.radius - wheel.rounding,
                        half: wheel.half,
                        rounding: wheel.rounding,
                    },
                    shallow: shallow(wheel.bound(), wheel.tread.as_ref()),
                    rollers: wheel.rollers,
                    across: wheel.across,
                    bound: wheel.bound(),
                    carrier: carrier_of(machine, mover, &mut carriers),
                }
            })
            .collect();
        let boxes = (machine.boxes.iter())
            .map(|solid| {
                let is_plain =
                    solid.rotation == [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
                Solid {
                    part: solid.part,
                    body: solid.body,
                    tree: machine.tree_of_body(solid.body),
                    centre: some(solid.centre),
                    rotation: (!is_plain).then_some(solid.rotation),
                    half_size: solid.half_size,
                    bound: Vector3::from(solid.half_size).norm(),
                    carrier: carrier_of(machine, solid.body, &mut carriers),
                }
            })
            .collect();
        Self {
            wheels,
            boxes,
            roots: (machine.trees.iter())
                .map(|tree| tree.is_free.then_some(tree.velocities.start))
                .collect(),
            carriers,
        }
    }

    /// Number of twists.
    pub(crate) fn n_carriers(&self) -> usize {
        self.carriers.len()
    }

    /// Twists of all carriers.
    #[inline(always)]
    pub(crate) fn find_twists<T: Lane>(
        &self,
        poses: &Poses<T>,
        v: &[T],
        twists: &mut [BodyTwist<T>],
    ) {
        let n = self.carriers.len();
        let twists = &mut twists[..n];
        for (twist, first) in twists.iter_mut().zip(&self.roots) {
            if let Some(first) = *first {
                let v = &v[first..][..BASE];
                *twist = BodyTwist {
                    linear: Vec3::new(v[0], v[1], v[2]),
                    angular: Vec3::new(v[3], v[4], v[5]),
                };
            }
        }
        for i in self.roots.len()..n {
            let Carrier { parent, mover, .. } = self.carriers[i];
            let (motion, rate) = (&poses.motions[mover.motion], v[mover.velocity]);
            let before = twists[parent];
            twists[i] = BodyTwist {
                angular: before.angular + motion.axis * rate,
                linear: before.linear + motion.swing * rate,
            };
        }
    }
}

impl Link {
    /// Whether a coordinate of its own turns it about this axle.
    fn turns_about(&self, axle: Axle) -> bool {
        let Joint::Revolute(Revolute { axis, .. }) = self.joint else {
            return false;
        };
        let k = match axis {
            JointAxis::X => 0,
            JointAxis::Y => 1,
            JointAxis::Z => 2,
            JointAxis::General(_) => return false,
        };
        matches!(axle, Axle::Frame(i, _) if i == k)
    }
}

impl<T: Lane> BodyTwist<T> {
    /// Velocity of a material point, m/s.
    #[inline(always)]
    pub(crate) fn velocity(&self, x: Vec3<T>) -> Vec3<T> {
        self.linear + self.angular.cross(x)
    }
}

impl ContactWheel {
    /// Whether the wheel has a width.
    #[inline(always)]
    pub(crate) fn is_wide(&self) -> bool {
        self.section.half > 0.0 || self.section.rounding > 0.0
    }

    /// Place of a circle along the axle, m.
    #[inline(always)]
    pub(crate) fn along(&self, circle: usize) -> f64 {
        if circle == 0 {
            self.section.half
        } else {
            -self.section.half
        }
    }

    /// Number of its circles.
    #[inline(always)]
    pub(crate) fn n_circles(&self) -> usize {
        if self.section.half > 0.0 { 2 } else { 1 }
    }

    /// Centre relative to the origin of its tree, m.
    #[inline(always)]
    pub(crate) fn centre<T: Lane>(&self, pose: &Pose<T>) -> Vec3<T> {
        place(pose, self.centre.as_ref())
    }

    /// Unit axle.
    #[inline(always)]
    pub(crate) fn axle<T: Lane>(&self, pose: &Pose<T>) -> Vec3<T> {
        match self.axle {
            Axle::Frame(k, is_reversed) => {
                let axis = match k {
                    0 => pose.R.x,
                    1 => pose.R.y,
                    _ => pose.R.z,
                };
                if is_reversed { -axis } else { axis }
            }
            Axle::Fixed(s) => pose.R.times_shared(s),
        }
    }

    /// Upper bound on the speed at which its surface moves along its normal, m/s, with the unit
    /// axle `s` and its centre at `centre`: its spin moves it nowhere.
    #[inline(always)]
    pub(crate) fn speed<T: Lane>(
        &self,
        twist: &BodyTwist<T>,
        (s, centre): (Vec3<T>, Vec3<T>),
    ) -> T {
        let turning = twist.angular.cross(s).norm();
        twist.velocity(centre).norm() + turning * turning.like(self.bound)
    }
}

impl Solid {
    /// Centre relative to the origin of its tree, m.
    #[inline(always)]
    pub(crate) fn centre<T: Lane>(&self, pose: &Pose<T>) -> Vec3<T> {
        place(pose, self.centre.as_ref())
    }

    /// Rotation from the box's frame to the world's; its columns are the box's axes.
    #[inline(always)]
    pub(crate) fn axes<T: Lane>(&self, pose: &Pose<T>) -> Mat3<T> {
        match &self.rotation {
            None => pose.R,
            Some(rotation) => pose.R.times_columns(rotation),
        }
    }

    /// Upper bound on the speed of all its points, m/s, with its centre at `centre`.
    #[inline(always)]
    pub(crate) fn speed<T: Lane>(&self, twist: &BodyTwist<T>, centre: Vec3<T>) -> T {
        twist.velocity(centre).norm() + twist.angular.norm() * centre.x.like(self.bound)
    }
}

/// A point of a body, `None` for its origin, relative to the origin of its tree, m.
#[inline(always)]
fn place<T: Lane>(pose: &Pose<T>, x: Option<&[f64; 3]>) -> Vec3<T> {
    match x {
        None => pose.r,
        Some(x) => pose.r + pose.R.times_shared(*x),
    }
}

/// A unit axle in the body's frame.
fn axle_of(axle: [f64; 3]) -> Axle {
    let along = (0..3).find(|&k| (0..3).all(|i| i == k || axle[i].abs() <= 0.0));
    along.map_or(Axle::Fixed(axle), |k| Axle::Frame(k, axle[k] < 0.0))
}

/// Index of a body among the carriers; adds it with all that carry it.
fn carrier_of(machine: &SharedMachine, body: usize, carriers: &mut Vec<Carrier>) -> usize {
    if let Some(i) = (carriers.iter()).rposition(|carrier| carrier.body == Some(body)) {
        return i;
    }
    let link = &machine.links[body];
    let mut parent = if link.parent == body {
        machine.tree_of_body(body)
    } else {
        carrier_of(machine, link.parent, carriers)
    };
    for k in 0..link.joint.n_motions() {
        let mover = PathVelocity {
            velocity: link.velocity + k,
            motion: link.motion + k,
        };
        carriers.push(Carrier {
            body: Some(body),
            parent,
            mover,
        });
        parent = carriers.len() - 1;
    }
    parent
}
