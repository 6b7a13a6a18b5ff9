//! `Contacts`, `PlanarContacts`, `GrainContacts`: the contacts of the last step as arrays.

use pyo3::prelude::*;
use rover_core::contact::{Contact, Part};
use rover_core::integrator::Local;
use rover_core::multibody::Model;
use rover_core::simulation::{
    ActiveContact, BedMemory, GrainBed, GrainSimulation, LocatedContact, Scene,
};
use rover_core::system::PlanarContact;
use rover_core::system::grains::GrainContact;

use crate::arrays::{Array, fresh_rows};

fn rows<C: LocatedContact>(
    active: &[ActiveContact<C>],
    f: impl Fn(&ActiveContact<C>) -> C::Local,
) -> Array {
    let rows: Vec<C::Local> = active.iter().map(f).collect();
    let numbers = rows.iter().flat_map(AsRef::as_ref).copied();
    Array::shaped(numbers.collect(), &[rows.len(), C::Local::N])
}

/// Numbers of both bodies; -1 from `n_moving` on.
fn numbers<const D: usize>(
    active: &[ActiveContact<GrainContact<D>>],
    n_moving: usize,
) -> Array<i64> {
    let name = |body: u32| {
        if body as usize >= n_moving {
            -1
        } else {
            i64::from(body)
        }
    };
    let keys = active.iter().map(|a| a.contact.key);
    fresh_rows(keys.map(|k| [name(k.a), name(k.b)]))
}

/// Frames (n, D, D) of their rows.
fn frames<const D: usize>(rows: impl Iterator<Item = [[f64; D]; D]>) -> Array {
    let values: Vec<f64> = rows.flatten().flatten().collect();
    let n = values.len() / (D * D);
    Array::shaped(values, &[n, D, D])
}

/// Contacts of a rover in the last step, as new arrays with one row for each contact.
#[pyclass(module = "rover_gym.core", frozen, get_all)]
pub struct Contacts {
    /// Name of the solid in each contact, or of the joint that is at its stop.
    bodies: Vec<String>,
    /// Name of the other solid in each contact; None for the ground, a grain or a joint.
    others: Vec<Option<String>>,
    /// Kind of each contact, "wheel", "box", "sphere", "collider", "limit" or "friction".
    ///
    /// "limit" is a joint at its stop, "friction" the dry friction of a joint.
    ///
    /// For these, the contact point is the origin of the solid that the joint carries, and the
    /// normal is the joint's axis in the direction that opens the gap. At a revolute joint, gap,
    /// impulse and velocity along the normal are in rad, N m s and rad/s. Tangential entries are
    /// zero. For dry friction, the entry along n of the impulse is its largest value, and the entry
    /// along t its value, positive if it accelerates the joint.
    kinds: Vec<&'static str>,
    /// Index of the wheel in each contact, (n,); -1 for another solid or a joint's stop.
    wheels: Array<i64>,
    /// Contact points, world frame, (n, 3), m.
    points: Array,
    /// Contact frames, world frame, (n, 3, 3).
    ///
    /// Rows are the unit vectors n (normal), t (rolling direction) and b (lateral). On rollers, t
    /// is the axis of the roller, and b is zero.
    frames: Array,
    /// Gaps, (n,), m, at the configuration in which the step detected the contacts.
    gaps: Array,
    /// Impulses of the step along n, t, b, (n, 3), N s.
    ///
    /// If the step was split, these are sums over its parts.
    impulses: Array,
    /// Relative velocities after the step along n, t, b, (n, 3), m/s.
    velocities: Array,
}

impl Contacts {
    pub fn new(model: &Model, active: &[ActiveContact<Contact>]) -> Self {
        let unit_axes = active.iter().map(|own| own.with_unit_axes(model));
        let active = &unit_axes.collect::<Vec<_>>()[..];
        let parts = active.iter().map(|a| &a.contact.part);
        let kind_of = |part: &Part| match part {
            Part::Wheel(i) => ("wheel", i64::try_from(*i).unwrap_or(-1)),
            Part::Box(_) => ("box", -1),
            Part::Sphere(_) => ("sphere", -1),
            Part::Collider(_) => ("collider", -1),
            Part::Limit(..) => ("limit", -1),
            Part::Friction(_) => ("friction", -1),
        };
        let (kinds, wheels): (_, Vec<i64>) = parts.clone().map(kind_of).unzip();
        let name = |part: &Part| part.name(model).to_owned();
        let others = active.iter().map(|a| a.contact.other);
        let axes = active.iter().map(|a| a.contact.frame.rows());
        let axes = axes.map(|rows| rows.map(Into::into));
        Self {
            bodies: parts.map(name).collect(),
            others: others.map(|a| a.map(|a| name(&a.part))).collect(),
            kinds,
            wheels: wheels.into(),
            points: rows(active, |a| a.position),
            frames: frames(axes),
            gaps: active.iter().map(|a| a.contact.gap).collect(),
            impulses: rows(active, |a| a.impulse),
            velocities: rows(active, |a| a.velocity),
        }
    }
}

#[pymethods]
impl Contacts {
    fn __len__(&self) -> usize {
        self.bodies.len()
    }

    fn __repr__(&self) -> String {
        format!("Contacts({})", self.bodies.join(", "))
    }
}

/// Contacts of a planar simulation in the last step, as new arrays with one row for each contact.
#[pyclass(module = "rover_gym.core", frozen, get_all)]
pub struct PlanarContacts {
    /// Index of the disc in each contact, (n,); 0 is the ball or wheel A, 1 is wheel B.
    discs: Array<i64>,
    /// Points of the ground, world frame, (n, 2), m.
    points: Array,
    /// Unit normals out of the ground, (n, 2); the tangent is (n_y, -n_x).
    normals: Array,
    /// Gaps, (n,), m.
    gaps: Array,
    /// Impulses of the step along normal and tangent, (n, 2), N s.
    ///
    /// If the step was split, these are sums over its parts.
    impulses: Array,
    /// Velocities of the rim after the step along normal and tangent, (n, 2), m/s.
    velocities: Array,
}

impl PlanarContacts {
    pub fn new(active: &[ActiveContact<PlanarContact>]) -> Self {
        let discs = active
            .iter()
            .map(|a| i64::from(a.contact.key.disc))
            .collect();
        Self {
            discs,
            points: rows(active, |a| a.position),
            normals: rows(active, |a| a.contact.normal()),
            gaps: active.iter().map(|a| a.contact.gap).collect(),
            impulses: rows(active, |a| a.impulse),
            velocities: rows(active, |a| a.velocity),
        }
    }
}

#[pymethods]
impl PlanarContacts {
    fn __len__(&self) -> usize {
        self.discs.len()
    }

    fn __repr__(&self) -> String {
        format!("PlanarContacts({})", self.discs.len())
    }
}

/// Contacts of grains in the last step, as new arrays with one row for each contact.
///
/// Vectors have D entries: 2 for disks, 3 for balls. Contacts between sleeping grains are not
/// included.
#[pyclass(module = "rover_gym.core", frozen, get_all)]
pub struct GrainContacts {
    /// Indices of both bodies, (n, 2), grains from 0, then wheels; -1 for a wall or the ground.
    bodies: Array<i64>,
    /// Points of the first body's surface, (n, D), m.
    points: Array,
    /// Unit normals from the second body into the first, (n, D).
    normals: Array,
    /// Contact frames, world frame, (n, D, D).
    ///
    /// Rows are the unit vectors n (normal), t and b (tangents); t = (n_y, -n_x) in the plane.
    frames: Array,
    /// Gaps at the start of the step, (n,), m; negative where bodies overlap.
    gaps: Array,
    /// Impulses on the first body along n, t, b of `frames`, (n, D), N s.
    ///
    /// Normal impulses include cohesion and are negative if a contact carries tension.
    impulses: Array,
    /// Relative velocities of the first body after the step along n, t, b, (n, D), m/s.
    velocities: Array,
    /// Impulses on the first body along x, y, z, (n, D), N s.
    world_impulses: Array,
    /// Moments of rolling and drilling friction on the first body, (n, 3), N m s.
    world_moments: Array,
}

impl GrainContacts {
    /// The contacts of a bed. The solver's impulses bear the cohesion as well.
    pub fn of<const D: usize>(bed: &GrainSimulation<D>) -> Self
    where
        GrainBed<D>: Scene<Contact = GrainContact<D>, Memory = BedMemory>,
    {
        let (scene, h) = (&bed.scene().description, bed.options().time_step);
        let wheels = scene.machine.as_ref().map_or(0, |m| m.n_wheels());
        let mut active = bed.contacts().to_vec();
        for one in &mut active {
            one.impulse[0] -= h * scene.attraction(&one.contact);
        }
        let on_first = |a: &ActiveContact<GrainContact<D>>| {
            let (axes, p) = (a.contact.frame(), &a.impulse);
            (1..D)
                .fold(axes[0] * p[0], |sum, k| sum + axes[k] * p[k])
                .into()
        };
        Self {
            bodies: numbers(&active, scene.grains.len() + wheels),
            points: rows(&active, |a| a.position),
            normals: rows(&active, |a| a.contact.normal()),
            frames: frames(active.iter().map(|a| a.contact.frame().map(Into::into))),
            gaps: active.iter().map(|a| a.contact.gap_start).collect(),
            impulses: rows(&active, |a| a.impulse),
            velocities: rows(&active, |a| a.velocity),
            world_impulses: rows(&active, on_first),
            world_moments: fresh_rows(active.iter().map(|a| bed.moment(&a.contact))),
        }
    }
}

#[pymethods]
impl GrainContacts {
    fn __len__(&self) -> usize {
        self.bodies.len()
    }

    fn __repr__(&self) -> String {
        format!("GrainContacts({})", self.bodies.len())
    }
}
