//! Oriented box.

use nalgebra::{Matrix3, Vector3};

use super::SupportMap;

/// A box in space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OrientedBox {
    /// m.
    pub centre: Vector3<f64>,
    /// Rotation from the box's axes to the world's.
    pub R: Matrix3<f64>,
    /// Half edge lengths, m.
    pub half_size: Vector3<f64>,
}

impl OrientedBox {
    /// Position of a corner: bits 0, 1, 2 of its index select the side along x, y, z.
    #[inline]
    #[must_use]
    pub fn corner(&self, number: usize) -> Vector3<f64> {
        self.centre + self.R * self.half_size.component_mul(&signs(number))
    }

    /// Middle, unit direction and half length (m) of an edge: its number is 4 k for an edge along
    /// axis k, and bits 0 and 1 select the side along the next two axes.
    #[inline]
    #[must_use]
    pub fn edge(&self, number: usize) -> (Vector3<f64>, Vector3<f64>, f64) {
        let k = number / 4 % 3;
        let mut local = Vector3::zeros();
        for bit in 0..2 {
            let axis = (k + 1 + bit) % 3;
            local[axis] = signs(number % 4)[bit] * self.half_size[axis];
        }
        let middle = self.centre + self.R * local;
        (middle, self.axis(k), self.half_size[k])
    }

    /// The box with each side moved out by `reach`, m.
    #[inline]
    #[must_use]
    pub fn grown(&self, reach: f64) -> Self {
        Self {
            half_size: self.half_size.add_scalar(reach),
            ..*self
        }
    }

    /// Whether faces of a surface are clear of the box: they lie beyond one of its sides, with all
    /// corners, and their unit normals do not face away from it. A box that is in the ground has
    /// the surface beyond its sides too, but that faces away.
    #[inline]
    #[must_use]
    pub fn is_clear_of<const N: usize>(
        &self,
        corners: &[Vector3<f64>],
        normals: impl Fn() -> [Vector3<f64>; N],
    ) -> bool {
        (0..3).any(|k| {
            let axis = self.axis(k);
            let places = corners.iter().map(|x| axis.dot(&(x - self.centre)));
            let (low, high) = places.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| {
                (low.min(x), high.max(x))
            });
            let side = if low > self.half_size[k] {
                axis
            } else if high < -self.half_size[k] {
                -axis
            } else {
                return false;
            };
            normals().iter().all(|n| n.dot(&side) <= AWAY)
        })
    }

    /// Unit axis by index, world axes.
    #[inline]
    #[must_use]
    pub fn axis(&self, k: usize) -> Vector3<f64> {
        self.R.column(k).into()
    }
}

/// Cosine of the angle to the way from a box to a face from which on the face looks away.
const AWAY: f64 = 0.5;

/// The sides of a corner along the three axes, 1 or −1.
#[inline]
#[must_use]
pub(crate) fn signs(number: usize) -> Vector3<f64> {
    let sign = |bit: usize| if number >> bit & 1 == 1 { 1.0 } else { -1.0 };
    Vector3::new(sign(0), sign(1), sign(2))
}

impl SupportMap for OrientedBox {
    fn support(&self, direction: &Vector3<f64>) -> Vector3<f64> {
        let local = self.R.tr_mul(direction);
        let corner = self.half_size.zip_map(&local, f64::copysign);
        self.centre + self.R * corner
    }

    fn centre(&self) -> Vector3<f64> {
        self.centre
    }

    fn bound(&self) -> f64 {
        self.half_size.norm()
    }
}
