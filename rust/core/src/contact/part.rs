//! The collision parts of a model and their placement.

use nalgebra::{Matrix3, Vector3};
use serde::{Deserialize, Serialize};

use super::body_motion::BodyMotion;
use crate::geometry::{Disc, Ellipsoid, Hull, OrientedBox, PlacedShape, Roller, Sphere};
use crate::law::compliance::Tread;
use crate::multibody::{Collider, ColliderForm, Kinematics, Model, Wheel};

/// A part of the machine that can be in contact.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Part {
    /// A wheel, by its index.
    Wheel(usize),
    /// A box, by its index in the model.
    Box(usize),
    /// A ball, by its index in the model.
    Sphere(usize),
    /// A cylinder, a capsule, an ellipsoid or a convex hull, by its index in the model.
    Collider(usize),
    /// A joint at its stop, by its index. It has no shape, only a point: the origin of the body
    /// that the joint carries.
    Limit(usize, Side),
    /// The dry friction of a joint, by its index ([`super::joint_friction`]). Without a shape, too.
    Friction(usize),
}

/// The two stops of a joint.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Side {
    /// `q ≥ lower`.
    Lower,
    /// `q ≤ upper`.
    Upper,
}

/// First codes of balls, colliders, boxes and joints.
const SPHERES: u16 = 0x4000;
const COLLIDERS: u16 = 0x6000;
const BOXES: u16 = 0x8000;
const LIMITS: u16 = 0xC000;

impl Part {
    /// A 16-bit code of the part: wheels start at 0, balls at 2^14, colliders at 3 · 2^13, boxes at
    /// 2^15, joints at 3 · 2^14.
    ///
    /// # Panics
    /// If a model has more than 2^13 wheels, balls, colliders, boxes or joints.
    #[inline]
    #[must_use]
    pub fn code(self) -> u16 {
        let narrow = |i: usize| match u16::try_from(i) {
            Ok(code) if code < COLLIDERS - SPHERES => code,
            _ => panic!("invariant: part {i} fits 13 bits"),
        };
        match self {
            Self::Wheel(i) => narrow(i),
            Self::Sphere(i) => narrow(i) | SPHERES,
            Self::Collider(i) => narrow(i) | COLLIDERS,
            Self::Box(i) => narrow(i) | BOXES,
            Self::Limit(i, _) | Self::Friction(i) => narrow(i) | LIMITS,
        }
    }

    /// The body of the part with a [code](Self::code).
    #[must_use]
    pub(crate) fn body_of_code(code: u16, model: &Model) -> usize {
        let of = |first: u16| usize::from(code - first);
        match code {
            LIMITS.. => model.joints()[of(LIMITS)].body,
            BOXES.. => model.boxes()[of(BOXES)].body,
            COLLIDERS.. => model.colliders()[of(COLLIDERS)].body,
            SPHERES.. => model.spheres()[of(SPHERES)].body,
            _ => model.wheels()[of(0)].body,
        }
    }

    /// All parts of a model that have a shape: wheels, boxes, balls, colliders.
    pub fn all(model: &Model) -> impl Iterator<Item = Self> {
        let wheels = (0..model.wheels().len()).map(Self::Wheel);
        let boxes = (0..model.boxes().len()).map(Self::Box);
        let spheres = (0..model.spheres().len()).map(Self::Sphere);
        let colliders = (0..model.colliders().len()).map(Self::Collider);
        wheels.chain(boxes).chain(spheres).chain(colliders)
    }

    /// Whether the model contains it.
    #[must_use]
    pub fn is_of(self, model: &Model) -> bool {
        match self {
            Self::Wheel(i) => i < model.wheels().len(),
            Self::Box(i) => i < model.boxes().len(),
            Self::Sphere(i) => i < model.spheres().len(),
            Self::Collider(i) => i < model.colliders().len(),
            Self::Limit(i, _) => model.limited_joints().contains(&i),
            Self::Friction(i) => model.rubbing_joints().contains(&i),
        }
    }

    /// Body that carries it.
    #[inline]
    #[must_use]
    pub fn body(self, model: &Model) -> usize {
        match self {
            Self::Wheel(i) => model.wheels()[i].body,
            Self::Box(i) => model.boxes()[i].body,
            Self::Sphere(i) => model.spheres()[i].body,
            Self::Collider(i) => model.colliders()[i].body,
            Self::Limit(i, _) | Self::Friction(i) => model.joints()[i].body,
        }
    }

    /// Name of the solid that carries it.
    #[must_use]
    pub fn name(self, model: &Model) -> &str {
        match self {
            Self::Wheel(i) => &model.description().wheels[i].solid,
            Self::Box(i) => &model.boxes()[i].name,
            Self::Sphere(i) => &model.spheres()[i].name,
            Self::Collider(i) => &model.colliders()[i].name,
            Self::Limit(i, _) | Self::Friction(i) => &model.bodies()[model.joints()[i].body].name,
        }
    }

    /// Whether the part is a wheel that may touch with the two ends of a rigid tread.
    #[inline]
    pub(crate) fn has_rigid_ends(self, model: &Model) -> bool {
        matches!(self, Self::Wheel(i) if model.wheels()[i].has_rigid_ends())
    }

    /// Tread of a wheel that yields, and the wheel as [`Mechanism::travel`] takes it; `None` if the
    /// part is rigid.
    ///
    /// [`Mechanism::travel`]: crate::multibody::Mechanism::travel
    #[inline]
    #[must_use]
    #[allow(clippy::type_complexity)] // a tread, and body, axle and radius of its wheel
    pub(crate) fn tread(self, model: &Model) -> Option<(Tread, (usize, [f64; 3], f64))> {
        let Self::Wheel(i) = self else {
            return None;
        };
        let wheel = &model.wheels()[i];
        Some((wheel.tread?, (wheel.body, wheel.axle.into(), wheel.radius)))
    }

    /// Tread of a wheel that yields.
    #[inline]
    pub(crate) fn own_tread(self, model: &Model) -> Option<&Tread> {
        match self {
            Self::Wheel(i) => model.wheels()[i].tread.as_ref(),
            _ => None,
        }
    }

    /// Name of its material; empty for a joint.
    #[must_use]
    pub fn material(self, model: &Model) -> &str {
        match self {
            Self::Wheel(i) => &model.wheels()[i].material,
            Self::Box(i) => &model.boxes()[i].material,
            Self::Sphere(i) => &model.spheres()[i].material,
            Self::Collider(i) => &model.colliders()[i].material,
            Self::Limit(..) | Self::Friction(_) => "",
        }
    }

    /// Centre in its body's frame, m.
    #[inline]
    #[must_use]
    pub fn centre(self, model: &Model) -> Vector3<f64> {
        match self {
            Self::Wheel(i) => model.wheels()[i].centre,
            Self::Box(i) => model.boxes()[i].centre,
            Self::Sphere(i) => model.spheres()[i].centre,
            Self::Collider(i) => model.colliders()[i].centre,
            Self::Limit(..) | Self::Friction(_) => Vector3::zeros(),
        }
    }

    /// Radius of a bounding ball about the centre, m.
    #[must_use]
    pub fn bound(self, model: &Model) -> f64 {
        match self {
            Self::Wheel(i) => model.wheels()[i].bound(),
            Self::Box(i) => model.boxes()[i].half_size.norm(),
            Self::Sphere(i) => model.spheres()[i].radius,
            Self::Collider(i) => model.colliders()[i].bound(),
            Self::Limit(..) | Self::Friction(_) => 0.0,
        }
    }

    /// Shape of the part at the poses of `kinematics`, relative to the origin of its body's tree.
    #[inline]
    #[must_use]
    pub fn place<'a>(self, model: &'a Model, kinematics: &Kinematics) -> PlacedShape<'a> {
        let body = self.body(model);
        self.place_at(model, (&kinematics.R(body), &kinematics.r(body)))
    }

    /// Shape of the part at the poses of `motion`, relative to the origin of its tree.
    pub(crate) fn placed<'a>(self, model: &'a Model, motion: &impl BodyMotion) -> PlacedShape<'a> {
        let (R, r) = motion.pose(self.body(model));
        self.place_at(model, (&R, &r))
    }

    /// Shape of the part, given the attitude and the origin (m) of its body.
    #[inline]
    #[must_use]
    pub fn place_at<'a>(
        self,
        model: &'a Model,
        pose: (&Matrix3<f64>, &Vector3<f64>),
    ) -> PlacedShape<'a> {
        if let Self::Wheel(i) = self {
            let wheel = &model.wheels()[i];
            shape_about(wheel, disc_at(wheel, pose))
        } else {
            self.place_solid(model, pose)
        }
    }

    /// Shape of a part other than a wheel, given the attitude and the origin (m) of its body. Kept
    /// separate so that the short code for wheels is inlined.
    fn place_solid<'a>(
        self,
        model: &'a Model,
        (R, r): (&Matrix3<f64>, &Vector3<f64>),
    ) -> PlacedShape<'a> {
        let centre = r + R * self.centre(model);
        match self {
            Self::Box(i) => {
                let solid = &model.boxes()[i];
                PlacedShape::Box(OrientedBox {
                    centre,
                    R: R * solid.rotation,
                    half_size: solid.half_size,
                })
            }
            Self::Collider(i) => place_collider(&model.colliders()[i], centre, R),
            Self::Wheel(_) | Self::Sphere(_) | Self::Limit(..) | Self::Friction(_) => {
                PlacedShape::Sphere(Sphere::new(centre, self.bound(model)))
            }
        }
    }
}

/// The shape of a collider with its centre (m) at a place of a body with the attitude R.
fn place_collider<'a>(
    solid: &'a Collider,
    centre: Vector3<f64>,
    R: &Matrix3<f64>,
) -> PlacedShape<'a> {
    let R = R * solid.rotation;
    let round = |radius: f64, half: f64, rounding: f64| {
        let core = Disc {
            centre,
            axle: R.column(1).into(),
            spoke: R.column(0).into(),
            radius,
        };
        PlacedShape::Cylinder(Roller {
            core,
            half,
            rounding,
        })
    };
    match &solid.form {
        ColliderForm::Cylinder { radius, half } => round(*radius, *half, 0.0),
        ColliderForm::Capsule { radius, half } => round(0.0, *half, *radius),
        ColliderForm::Ellipsoid { radii } => PlacedShape::Ellipsoid(Ellipsoid {
            centre,
            R,
            radii: *radii,
        }),
        ColliderForm::Hull { polytope } => PlacedShape::Hull(Hull {
            centre,
            R,
            polytope,
        }),
    }
}

/// A wheel's shape at the poses of `kinematics`, relative to the origin of its body's tree.
#[inline]
#[must_use]
pub fn wheel_shape(wheel: &Wheel, kinematics: &Kinematics) -> PlacedShape<'static> {
    shape_about(wheel, place_wheel(wheel, kinematics))
}

/// The shape of a wheel with this disc midway along its axle.
#[inline]
#[must_use]
pub fn shape_about(wheel: &Wheel, disc: Disc) -> PlacedShape<'static> {
    if wheel.is_wide() {
        PlacedShape::Roller(Roller::new(disc, wheel.width, wheel.rounding))
    } else {
        PlacedShape::Disc(disc)
    }
}

/// The disc midway along a wheel's axle at the poses of `kinematics`, relative to the origin of its
/// body's tree.
#[inline]
#[must_use]
pub fn place_wheel(wheel: &Wheel, kinematics: &Kinematics) -> Disc {
    disc_at(
        wheel,
        (&kinematics.R(wheel.body), &kinematics.r(wheel.body)),
    )
}

#[inline]
fn disc_at(wheel: &Wheel, (R, r): (&Matrix3<f64>, &Vector3<f64>)) -> Disc {
    Disc {
        centre: r + R * wheel.centre,
        axle: R * wheel.axle,
        spoke: R * wheel.spoke,
        radius: wheel.radius,
    }
}
