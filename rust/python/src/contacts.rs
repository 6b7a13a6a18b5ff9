//! `Contacts`, `PlanarContacts`, `SoilContacts`, `GrainContacts`: the contacts of the last step as
//! arrays.

use numpy::{PyArray1, PyArray2, PyArray3, PyArrayMethods};
use pyo3::prelude::*;
use rover_core::contact::{Contact, Part};
use rover_core::multibody::Model;
use rover_core::simulation::{ActiveContact, Components, LocatedContact};
use rover_core::system::PlanarContact;
use rover_core::system::grains::GrainContact;

use crate::arrays::fresh_blocks;

/// What all lists of contacts have: columns with one row a contact.
struct Columns<C: LocatedContact>(Vec<ActiveContact<C>>);

impl<C: LocatedContact> Columns<C> {
    fn rows<'py>(
        &self,
        py: Python<'py>,
        f: impl Fn(&ActiveContact<C>) -> C::Vector,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let rows: Vec<C::Vector> = self.0.iter().map(f).collect();
        let numbers = rows.iter().flat_map(AsRef::as_ref).copied();
        PyArray1::from_iter(py, numbers).reshape([rows.len(), C::Vector::N])
    }

    fn points<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        self.rows(py, |a| a.position)
    }

    fn normals<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        self.rows(py, |a| a.contact.normal())
    }

    fn impulses<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        self.rows(py, |a| a.impulse)
    }

    fn velocities<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        self.rows(py, |a| a.velocity)
    }

    fn gaps<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_iter(py, self.0.iter().map(|a| a.contact.gap()))
    }
}

impl<const D: usize> Columns<GrainContact<D>> {
    /// Numbers of both bodies; -1 from `n_moving` on.
    fn bodies<'py>(&self, py: Python<'py>, n_moving: usize) -> PyResult<Bound<'py, PyAny>> {
        let name = |body: u32| {
            let is_fixed = body as usize >= n_moving;
            if is_fixed { -1 } else { i64::from(body) }
        };
        let keys = self.0.iter().map(|a| a.contact.key);
        let flat = PyArray1::from_iter(py, keys.flat_map(|k| [name(k.a), name(k.b)]));
        flat.call_method1("reshape", (self.0.len(), 2))
    }
}

/// The contacts of a rover's last step, as new arrays with one row a contact.
#[pyclass(module = "rover_gym.mechanics", frozen)]
pub struct Contacts {
    active: Columns<Contact>,
    bodies: Vec<String>,
}

impl Contacts {
    pub fn new(model: &Model, active: &[ActiveContact<Contact>]) -> Self {
        let name = |a: &ActiveContact<Contact>| a.contact.part.name(model).to_owned();
        Self {
            active: Columns(active.to_vec()),
            bodies: active.iter().map(name).collect(),
        }
    }
}

#[pymethods]
impl Contacts {
    /// Names of the solids that touch, and of the joints that are at a stop.
    #[getter]
    fn bodies(&self) -> Vec<String> {
        self.bodies.clone()
    }

    /// What touches in each contact, "wheel", "box" or "sphere"; "limit" for a joint's stop.
    ///
    /// The point of a stop is the origin of the solid that the joint carries, its normal is the
    /// joint's axis that opens the gap. Along it, at a revolute joint, the gap is in rad, the
    /// impulse in N m s and the velocity in rad/s; tangential entries are zero.
    #[getter]
    fn kinds(&self) -> Vec<&'static str> {
        let kind = |a: &ActiveContact<Contact>| match a.contact.part {
            Part::Wheel(_) => "wheel",
            Part::Box(_) => "box",
            Part::Sphere(_) => "sphere",
            Part::Limit(..) => "limit",
        };
        self.active.0.iter().map(kind).collect()
    }

    /// Indices of the wheels that touch, (n,); -1 where it is another solid or a joint's stop.
    #[getter]
    fn wheels<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<i64>> {
        let index = |a: &ActiveContact<Contact>| match a.contact.part {
            Part::Wheel(i) => i64::try_from(i).unwrap_or(-1),
            Part::Box(_) | Part::Sphere(_) | Part::Limit(..) => -1,
        };
        PyArray1::from_iter(py, self.active.0.iter().map(index))
    }

    /// Contact points, world frame, (n, 3), m.
    #[getter]
    fn points<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        self.active.points(py)
    }

    /// Contact frames, world frame, (n, 3, 3).
    ///
    /// Rows are the unit vectors n (normal), t (rolling direction) and b (lateral).
    #[getter]
    fn frames<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray3<f64>>> {
        let values = self
            .active
            .0
            .iter()
            .flat_map(|a| a.contact.frame.rows().map(<[f64; 3]>::from))
            .flatten()
            .collect();
        fresh_blocks(py, values, [self.active.0.len(), 3, 3])
    }

    /// Gaps, (n,), m, at the configuration where the step evaluated the contacts.
    #[getter]
    fn gaps<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.active.gaps(py)
    }

    /// Impulses of the step along n, t, b, (n, 3), N s.
    ///
    /// Where the step was split, they are sums over its parts.
    #[getter]
    fn impulses<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        self.active.impulses(py)
    }

    /// Relative velocities after the step along n, t, b, (n, 3), m/s.
    #[getter]
    fn velocities<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        self.active.velocities(py)
    }

    fn __len__(&self) -> usize {
        self.active.0.len()
    }

    fn __repr__(&self) -> String {
        format!("Contacts({})", self.bodies.join(", "))
    }
}

/// The contacts of a planar simulation's last step, as new arrays with one row a contact.
#[pyclass(module = "rover_gym.mechanics", frozen)]
pub struct PlanarContacts {
    active: Columns<PlanarContact>,
}

impl PlanarContacts {
    pub fn new(active: &[ActiveContact<PlanarContact>]) -> Self {
        Self {
            active: Columns(active.to_vec()),
        }
    }
}

#[pymethods]
impl PlanarContacts {
    /// Indices of the discs that touch, (n,); 0 is the ball or wheel A, 1 wheel B.
    #[getter]
    fn discs<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<i64>> {
        PyArray1::from_iter(
            py,
            self.active.0.iter().map(|a| i64::from(a.contact.key.disc)),
        )
    }

    /// Points of the ground, world frame, (n, 2), m.
    #[getter]
    fn points<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        self.active.points(py)
    }

    /// Unit normals out of the ground, (n, 2); the tangent is (n_y, -n_x).
    #[getter]
    fn normals<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        self.active.normals(py)
    }

    /// Gaps, (n,), m.
    #[getter]
    fn gaps<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.active.gaps(py)
    }

    /// Impulses of the step along normal and tangent, (n, 2), N s.
    ///
    /// Where the step was split, they are sums over its parts.
    #[getter]
    fn impulses<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        self.active.impulses(py)
    }

    /// Velocities of the rim after the step along normal and tangent, (n, 2), m/s.
    #[getter]
    fn velocities<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        self.active.velocities(py)
    }

    fn __len__(&self) -> usize {
        self.active.0.len()
    }

    fn __repr__(&self) -> String {
        format!("PlanarContacts({})", self.active.0.len())
    }
}

/// The contacts of a soil's last step, as new arrays with one row a contact.
///
/// Contacts between sleeping disks are left out.
#[pyclass(module = "rover_gym.mechanics", frozen)]
pub struct SoilContacts {
    active: Columns<GrainContact<2>>,
    n_moving: usize,
}

impl SoilContacts {
    /// `n_moving`: number of disks and wheels.
    pub fn new(active: &[ActiveContact<GrainContact<2>>], n_moving: usize) -> Self {
        Self {
            active: Columns(active.to_vec()),
            n_moving,
        }
    }
}

#[pymethods]
impl SoilContacts {
    /// Numbers of both bodies, (n, 2), disks from 0, then the wheels; -1 for a wall or the ground.
    #[getter]
    fn bodies<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.active.bodies(py, self.n_moving)
    }

    /// Points of the first body's rim, (n, 2), m.
    #[getter]
    fn points<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        self.active.points(py)
    }

    /// Unit normals from the second body into the first, (n, 2).
    #[getter]
    fn normals<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        self.active.normals(py)
    }

    /// Gaps at the start of the step, (n,), m; negative where bodies overlap.
    #[getter]
    fn gaps<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_iter(py, self.active.0.iter().map(|a| a.contact.gap_start))
    }

    /// Impulses on the first body along the normal and the tangent (n_y, -n_x), (n, 2), N s.
    #[getter]
    fn impulses<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        self.active.impulses(py)
    }

    /// Relative velocities after the step along normal and tangent, (n, 2), m/s.
    ///
    /// Of the first body against the second.
    #[getter]
    fn velocities<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        self.active.velocities(py)
    }

    /// Impulses on the first body along x and y, (n, 2), N s.
    #[getter]
    fn world_impulses<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        self.active.rows(py, |a| {
            (a.contact.n * a.impulse[0] + a.contact.t() * a.impulse[1]).into()
        })
    }

    fn __len__(&self) -> usize {
        self.active.0.len()
    }

    fn __repr__(&self) -> String {
        format!("SoilContacts({})", self.active.0.len())
    }
}

/// The contacts of the last step of grains in space, as new arrays with one row a contact.
///
/// Contacts between sleeping balls are left out.
#[pyclass(module = "rover_gym.mechanics", frozen)]
pub struct GrainContacts {
    active: Columns<GrainContact<3>>,
    n_moving: usize,
}

impl GrainContacts {
    /// `n_moving`: number of balls and of what moves among them. `attraction`: impulse of the
    /// cohesion in a contact, N s, which the solver's has to bear.
    pub fn new(
        active: &[ActiveContact<GrainContact<3>>],
        n_moving: usize,
        attraction: impl Fn(&GrainContact<3>) -> f64,
    ) -> Self {
        let mut active = active.to_vec();
        for one in &mut active {
            one.impulse[0] -= attraction(&one.contact);
        }
        Self {
            active: Columns(active),
            n_moving,
        }
    }
}

#[pymethods]
impl GrainContacts {
    /// Numbers of both bodies, (n, 2), balls from 0; -1 for a wall or the terrain.
    #[getter]
    fn bodies<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.active.bodies(py, self.n_moving)
    }

    /// Points of the first body's surface, (n, 3), m.
    #[getter]
    fn points<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        self.active.points(py)
    }

    /// Unit normals from the second body into the first, (n, 3).
    #[getter]
    fn normals<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        self.active.normals(py)
    }

    /// Contact frames, world frame, (n, 3, 3).
    ///
    /// Rows are the unit vectors n (normal), t and b (tangents).
    #[getter]
    fn frames<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray3<f64>>> {
        let active = self.active.0.iter();
        let frames = active.flat_map(|a| a.contact.frame().map(<[f64; 3]>::from));
        fresh_blocks(py, frames.flatten().collect(), [self.active.0.len(), 3, 3])
    }

    /// Gaps at the start of the step, (n,), m; negative where bodies overlap.
    #[getter]
    fn gaps<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_iter(py, self.active.0.iter().map(|a| a.contact.gap_start))
    }

    /// Impulses on the first body along n, t, b of `frames`, (n, 3), N s.
    ///
    /// Cohesion is part of the normal ones, which are negative where a contact bears tension.
    #[getter]
    fn impulses<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        self.active.impulses(py)
    }

    /// Velocities of the first body against the second after the step along n, t, b, (n, 3), m/s.
    #[getter]
    fn velocities<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        self.active.velocities(py)
    }

    /// Impulses on the first body along x, y, z, (n, 3), N s.
    #[getter]
    fn world_impulses<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        self.active.rows(py, |a| {
            let [n, t, b] = a.contact.frame();
            (n * a.impulse[0] + t * a.impulse[1] + b * a.impulse[2]).into()
        })
    }

    fn __len__(&self) -> usize {
        self.active.0.len()
    }

    fn __repr__(&self) -> String {
        format!("GrainContacts({})", self.active.0.len())
    }
}
