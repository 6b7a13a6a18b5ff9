//! Measures of a state of grains: energy, momentum, overlap.

use nalgebra::{SVector, Vector3};

use super::bodies::COORDINATES;
use super::grid::Grid;
use super::scene::{GrainScene, apart};
use crate::multibody::Energy;
use crate::spatial::space::body_velocities;

impl<const D: usize> GrainScene<D> {
    /// Numbers of the grains that are not kinematic, with the coordinates and velocities of each.
    fn free<'a>(
        &'a self,
        q: &'a [f64],
        v: &'a [f64],
    ) -> impl Iterator<Item = (usize, &'a [f64], &'a [f64])> {
        let states = q
            .chunks_exact(COORDINATES)
            .zip(v.chunks_exact(body_velocities(D)));
        let states = states.take(self.grains.len()).enumerate();
        let kinematic = self.grains.kinematic();
        states
            .filter(|(i, _)| !kinematic[*i])
            .map(|(i, (q, v))| (i, q, v))
    }

    /// Kinetic and potential energy (0 at y = 0), J, without kinematic grains. q (nq), v (nv).
    #[must_use]
    pub fn energy(&self, q: &[f64], v: &[f64], gravity: &Vector3<f64>) -> Energy {
        let mut energy = Energy::default();
        let square = |x: &[f64]| x.iter().map(|x| x * x).sum::<f64>();
        for (i, q, v) in self.free(q, v) {
            let m = self.grains.mass()[i];
            energy.kinetic += 0.5 * m * square(&v[..D]);
            energy.kinetic += v[D..]
                .iter()
                .map(|omega| 0.5 * self.grains.inertia(i) * omega * omega)
                .sum::<f64>();
            let height: f64 = gravity.iter().zip(&q[..D]).map(|(g, q)| g * q).sum();
            energy.potential -= m * height;
        }
        if let Some(machine) = &self.machine {
            let (pose, rate) = (self.machine_coordinates(q), self.machine_velocities(v));
            let (own, _) = machine.energy(pose, rate, &gravity.xy());
            energy.kinetic += own.kinetic;
            energy.potential += own.potential;
        }
        energy
    }

    /// Momentum of the grains that are not kinematic, kg m/s, and their moment
    /// of momentum about the origin, kg m²/s. q (nq), v (nv).
    ///
    /// The moment in the plane is its z component.
    #[must_use]
    pub fn momentum(&self, q: &[f64], v: &[f64]) -> (SVector<f64, D>, Vector3<f64>) {
        let (mut linear, mut moment) = (SVector::zeros(), Vector3::zeros());
        for (i, q, v) in self.free(q, v) {
            let m = self.grains.mass()[i];
            for k in 0..D {
                linear[k] += m * v[k];
            }
            let spin = |axis: usize| match D {
                2 if axis == 2 => v[D],
                2 => 0.0,
                _ => v[D + axis],
            };
            let x = |k: usize| if k < D { q[k] } else { 0.0 };
            let rate = |k: usize| if k < D { v[k] } else { 0.0 };
            for axis in 0..3 {
                let (a, b) = ((axis + 1) % 3, (axis + 2) % 3);
                let orbit = m * (x(a) * rate(b) - x(b) * rate(a));
                moment[axis] += orbit + self.grains.inertia(i) * spin(axis);
            }
        }
        (linear, moment)
    }

    /// Deepest overlap, m: 0 if nothing overlaps. Overlaps of kinematic grains with each other and
    /// with walls do not count. q (nq); walls as they are at `time`, s.
    #[must_use]
    pub fn penetration(&self, q: &[f64], time: f64) -> f64 {
        let grains = &self.grains;
        let (n, radius, kinematic) = (grains.len(), grains.radius(), grains.kinematic());
        let mut grid = Grid::<D>::default();
        grid.fill(q, radius, 2.0 * grains.largest());
        let mut facing = Vec::new();
        let mut least = 0.0_f64;
        let mut meet = |i: usize, x: &SVector<f64, D>, r: f64| {
            let is_kinematic = i < n && kinematic[i];
            grid.near(&(*x).into(), r + grains.largest(), |item| {
                let other = item.index as usize;
                if other != i && !(is_kinematic && kinematic[other]) {
                    least = least.min(apart(&item.centre, x) - r - item.radius);
                }
            });
            if is_kinematic {
                return;
            }
            for wall in &self.walls {
                least = least.min(wall.at(time).distance(x) - r);
            }
            if let Some(ground) = &self.ground {
                facing.clear();
                ground.facing(x, r, &mut facing);
                least = facing.iter().fold(least, |l, f| l.min(f.distance - r));
            }
        };
        for (i, (r, q)) in radius.iter().zip(q.chunks_exact(COORDINATES)).enumerate() {
            meet(i, &SVector::from_fn(|k, _| q[k]), *r);
        }
        for (k, (centre, radius)) in self.wheels(q).iter().enumerate() {
            meet(n + k, centre, *radius);
        }
        -least
    }
}
