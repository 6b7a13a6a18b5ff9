//! Vectors and matrices of three dimensions over lanes.

use std::ops::{Add, AddAssign, Mul, Neg, Sub, SubAssign};

use nalgebra::{Matrix3, Vector3};

use super::lane::Lane;

/// A vector.
#[derive(Clone, Copy, Debug)]
pub struct Vec3<T> {
    /// First component.
    pub x: T,
    /// Second component.
    pub y: T,
    /// Third component.
    pub z: T,
}

impl<T: Lane> Vec3<T> {
    /// From its components.
    #[inline(always)]
    pub fn new(x: T, y: T, z: T) -> Self {
        Self { x, y, z }
    }

    /// The vector `v` in every lane.
    #[inline(always)]
    pub fn splat(token: T::Token, v: [f64; 3]) -> Self {
        Self {
            x: T::splat(token, v[0]),
            y: T::splat(token, v[1]),
            z: T::splat(token, v[2]),
        }
    }

    /// Scalar product.
    #[inline(always)]
    pub fn dot(self, other: Self) -> T {
        self.x * other.x + self.y * other.y + self.z * other.z
    }

    /// Vector product.
    #[inline(always)]
    #[must_use]
    pub fn cross(self, other: Self) -> Self {
        Self {
            x: self.y * other.z - self.z * other.y,
            y: self.z * other.x - self.x * other.z,
            z: self.x * other.y - self.y * other.x,
        }
    }

    /// Length.
    #[inline(always)]
    pub fn norm(self) -> T {
        self.dot(self).sqrt()
    }

    /// `self` where the mask is true, `other` elsewhere.
    #[inline(always)]
    #[must_use]
    pub fn select(mask: T::Mask, yes: Self, no: Self) -> Self {
        Self {
            x: T::select(mask, yes.x, no.x),
            y: T::select(mask, yes.y, no.y),
            z: T::select(mask, yes.z, no.z),
        }
    }

    /// The vector of a lane.
    #[inline(always)]
    pub fn get(self, lane: usize) -> [f64; 3] {
        [self.x.get(lane), self.y.get(lane), self.z.get(lane)]
    }

    /// Replaces the vector of a lane.
    #[inline(always)]
    pub fn set(&mut self, lane: usize, v: [f64; 3]) {
        self.x.set(lane, v[0]);
        self.y.set(lane, v[1]);
        self.z.set(lane, v[2]);
    }
}

impl<T: Lane> Add for Vec3<T> {
    type Output = Self;

    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Self::new(self.x + other.x, self.y + other.y, self.z + other.z)
    }
}

impl<T: Lane> Sub for Vec3<T> {
    type Output = Self;

    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        Self::new(self.x - other.x, self.y - other.y, self.z - other.z)
    }
}

impl<T: Lane> Mul<T> for Vec3<T> {
    type Output = Self;

    #[inline(always)]
    fn mul(self, a: T) -> Self {
        Self::new(self.x * a, self.y * a, self.z * a)
    }
}

impl<T: Lane> Neg for Vec3<T> {
    type Output = Self;

    #[inline(always)]
    fn neg(self) -> Self {
        Self::new(-self.x, -self.y, -self.z)
    }
}

impl<T: Lane> AddAssign for Vec3<T> {
    #[inline(always)]
    fn add_assign(&mut self, other: Self) {
        *self = *self + other;
    }
}

impl<T: Lane> SubAssign for Vec3<T> {
    #[inline(always)]
    fn sub_assign(&mut self, other: Self) {
        *self = *self - other;
    }
}

/// A matrix, by its columns.
#[derive(Clone, Copy, Debug)]
pub struct Mat3<T> {
    /// First column.
    pub x: Vec3<T>,
    /// Second column.
    pub y: Vec3<T>,
    /// Third column.
    pub z: Vec3<T>,
}

impl<T: Lane> Mat3<T> {
    /// The identity.
    #[inline(always)]
    pub fn identity(token: T::Token) -> Self {
        let unit = |v| Vec3::splat(token, v);
        Self {
            x: unit([1.0, 0.0, 0.0]),
            y: unit([0.0, 1.0, 0.0]),
            z: unit([0.0, 0.0, 1.0]),
        }
    }

    /// Columns of the matrix.
    #[inline(always)]
    pub fn columns(&self) -> [Vec3<T>; 3] {
        [self.x, self.y, self.z]
    }

    /// `A v`.
    #[inline(always)]
    pub fn times(&self, v: Vec3<T>) -> Vec3<T> {
        self.x * v.x + self.y * v.y + self.z * v.z
    }

    /// `A v` for a vector that all lanes share.
    #[inline(always)]
    pub fn times_shared(&self, v: [f64; 3]) -> Vec3<T> {
        self.times(Vec3::splat(self.x.x.token(), v))
    }

    /// `A B`.
    #[inline(always)]
    #[must_use]
    pub fn product(&self, other: &Self) -> Self {
        Self {
            x: self.times(other.x),
            y: self.times(other.y),
            z: self.times(other.z),
        }
    }

    /// `A B` for a matrix that all lanes share, by its columns.
    #[inline(always)]
    #[must_use]
    pub fn times_columns(&self, columns: &[[f64; 3]; 3]) -> Self {
        Self {
            x: self.times_shared(columns[0]),
            y: self.times_shared(columns[1]),
            z: self.times_shared(columns[2]),
        }
    }

    /// `Aᵀ v`.
    #[inline(always)]
    pub fn transpose_times(&self, v: Vec3<T>) -> Vec3<T> {
        Vec3::new(self.x.dot(v), self.y.dot(v), self.z.dot(v))
    }
}

impl From<Vector3<f64>> for Vec3<f64> {
    #[inline(always)]
    fn from(v: Vector3<f64>) -> Self {
        Self::new(v.x, v.y, v.z)
    }
}

impl From<Vec3<f64>> for Vector3<f64> {
    #[inline(always)]
    fn from(v: Vec3<f64>) -> Self {
        Self::new(v.x, v.y, v.z)
    }
}

impl From<Mat3<f64>> for Matrix3<f64> {
    #[inline(always)]
    fn from(A: Mat3<f64>) -> Self {
        Self::from_columns(&A.columns().map(Vector3::from))
    }
}

impl From<Matrix3<f64>> for Mat3<f64> {
    #[inline(always)]
    fn from(A: Matrix3<f64>) -> Self {
        let [x, y, z]: [[f64; 3]; 3] = A.into();
        Self {
            x: Vec3::new(x[0], x[1], x[2]),
            y: Vec3::new(y[0], y[1], y[2]),
            z: Vec3::new(z[0], z[1], z[2]),
        }
    }
}
