//! Granular soil in the plane: the disks of [`super::grains`], and a planar
//! machine that drives over them.

use std::sync::Arc;

use nalgebra::{SVector, Vector2, Vector3};

use super::grains::{self, Wheel};
use crate::planar::PlanarMachine;

pub use super::grains::{
    GrainError as SoilError, GrainFriction as SoilFriction, GrainKey as SoilKey, SleepOptions,
};

/// The disks.
pub type Disks = grains::Grains<2>;
/// Where they start.
pub type Packing = grains::Packing<2>;
/// The walls.
pub type Wall = grains::Wall<2>;
/// The machine on the soil.
pub type Machine = dyn grains::Machine<2>;
/// A soil's description.
pub type SoilScene = grains::GrainScene<2>;
/// A contact of a disk or a wheel.
pub type SoilContact = grains::GrainContact<2>;
/// Scratch of a soil.
pub type SoilParts = grains::GrainParts<2>;
/// A soil in a step.
pub type SoilSystem<'a> = grains::GrainSystem<'a, 2>;

/// A machine of NV coordinates with the interface of a machine among grains.
#[derive(Clone, Copy, Debug)]
struct OnSoil<const NV: usize, M>(M);

/// Puts a machine of any number of coordinates on a soil.
pub fn on_soil<const NV: usize, M: PlanarMachine<NV> + 'static>(machine: M) -> Arc<Machine> {
    Arc::new(OnSoil(machine))
}

impl<const NV: usize, M: PlanarMachine<NV>> grains::Machine<2> for OnSoil<NV, M> {
    fn nv(&self) -> usize {
        NV
    }

    fn mass_matrix(&self, q: &[f64], out: &mut [f64]) {
        let mass = self.0.mass_matrix(&SVector::from_column_slice(q));
        for (out, row) in out.chunks_exact_mut(NV).zip(mass.row_iter()) {
            for (out, m) in out.iter_mut().zip(&row) {
                *out = *m;
            }
        }
    }

    fn force(&self, q: &[f64], v: &[f64], gravity: &Vector3<f64>, inputs: &[f64], out: &mut [f64]) {
        let (q, v) = (SVector::from_column_slice(q), SVector::from_column_slice(v));
        let force = self.0.force(&q, &v, &gravity.xy(), inputs);
        out.copy_from_slice(force.as_slice());
    }

    fn potential(&self, q: &[f64], gravity: &Vector3<f64>) -> f64 {
        let q = SVector::from_column_slice(q);
        self.0.potential(&q, &gravity.xy())
    }

    fn n_inputs(&self) -> usize {
        self.0.n_inputs()
    }

    fn n_wheels(&self) -> usize {
        self.0.n_discs()
    }

    fn wheel(&self, i: usize, q: &[f64]) -> Wheel<2> {
        let disc = self.0.disc(i, &SVector::from_column_slice(q));
        Wheel {
            centre: disc.centre,
            radius: disc.radius,
        }
    }

    fn point_jacobian(&self, i: usize, q: &[f64], point: &Vector2<f64>, out: &mut [f64]) {
        let J = self
            .0
            .point_jacobian(i, &SVector::from_column_slice(q), point);
        for (out, row) in out.chunks_exact_mut(NV).zip(J.row_iter()) {
            for (out, x) in out.iter_mut().zip(&row) {
                *out = *x;
            }
        }
    }

    fn displacement(&self, y: &[f64]) -> f64 {
        let arms = self.0.arms();
        let own = y.iter().zip(&arms);
        own.map(|(y, arm)| (y * arm).abs()).fold(0.0, f64::max)
    }

    fn fingerprint(&self) -> u64 {
        self.0.fingerprint()
    }
}
