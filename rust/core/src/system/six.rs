//! Vectors and matrices of six dimensions over lanes: twists and wrenches, and what maps them.
//!
//! The first three components are a velocity or a force, the others an angular velocity or a
//! moment.
#![allow(clippy::inline_always)] // a call leaves the instructions that its caller is compiled for

use nalgebra::{Matrix6, Vector6};

use crate::scalar::{Lane, Vec3};

/// Components of a twist or a wrench.
pub(super) const SIX: usize = 6;

/// A twist, or a wrench.
pub(super) type Six<T> = [T; SIX];

/// A matrix by its columns.
pub(super) type Square<T> = [Six<T>; SIX];

/// Joins a linear and an angular part.
#[inline(always)]
pub(super) fn join<T: Lane>(linear: Vec3<T>, angular: Vec3<T>) -> Six<T> {
    [
        linear.x, linear.y, linear.z, angular.x, angular.y, angular.z,
    ]
}

/// Linear part.
#[inline(always)]
pub(super) fn linear<T: Lane>(x: &Six<T>) -> Vec3<T> {
    Vec3::new(x[0], x[1], x[2])
}

/// Angular part.
#[inline(always)]
pub(super) fn angular<T: Lane>(x: &Six<T>) -> Vec3<T> {
    Vec3::new(x[3], x[4], x[5])
}

/// `x + a y`.
#[inline(always)]
pub(super) fn plus<T: Lane>(x: &Six<T>, a: T, y: &Six<T>) -> Six<T> {
    let mut sum = *x;
    for d in 0..SIX {
        sum[d] += a * y[d];
    }
    sum
}

/// `x − y`.
#[inline(always)]
pub(super) fn minus<T: Lane>(x: &Six<T>, y: &Six<T>) -> Six<T> {
    let mut difference = *x;
    for d in 0..SIX {
        difference[d] -= y[d];
    }
    difference
}

/// Scalar product.
#[inline(always)]
pub(super) fn dot<T: Lane>(x: &Six<T>, y: &Six<T>) -> T {
    let mut sum = x[0] * y[0];
    for d in 1..SIX {
        sum += x[d] * y[d];
    }
    sum
}

/// Vector with its angular part multiplied by `arm`.
#[inline(always)]
pub(super) fn scaled<T: Lane>(x: &Six<T>, arm: f64) -> Six<T> {
    let arm = x[0].like(arm);
    [x[0], x[1], x[2], arm * x[3], arm * x[4], arm * x[5]]
}

/// Size of a wrench, N, with moments at an arm, m.
#[inline(always)]
pub(super) fn size<T: Lane>(wrench: &Six<T>, arm: f64) -> T {
    let (force, moment) = (linear(wrench), angular(wrench));
    (force.dot(force) + moment.dot(moment) * moment.x.like(1.0 / (arm * arm))).sqrt()
}

/// `A x`, column by column.
#[inline(always)]
pub(super) fn times<T: Lane>(A: &Square<T>, x: &Six<T>) -> Six<T> {
    let mut sum = A[0];
    for d in 0..SIX {
        sum[d] *= x[0];
    }
    for k in 1..SIX {
        for d in 0..SIX {
            sum[d] += A[k][d] * x[k];
        }
    }
    sum
}

/// `yes` where the mask is true, `no` elsewhere.
#[inline(always)]
pub(super) fn select<T: Lane>(mask: T::Mask, yes: &Six<T>, no: &Six<T>) -> Six<T> {
    let mut chosen = *no;
    for d in 0..SIX {
        chosen[d] = T::select(mask, yes[d], no[d]);
    }
    chosen
}

/// The vector of a lane.
#[inline(always)]
pub(super) fn get<T: Lane>(x: &Six<T>, lane: usize) -> Vector6<f64> {
    Vector6::from_fn(|d, _| x[d].get(lane))
}

/// Replaces the vector of a lane.
#[inline(always)]
pub(super) fn set<T: Lane>(x: &mut Six<T>, lane: usize, own: &Vector6<f64>) {
    for d in 0..SIX {
        x[d].set(lane, own[d]);
    }
}

/// The matrix of a lane.
#[inline(always)]
pub(super) fn matrix_of<T: Lane>(A: &Square<T>, lane: usize) -> Matrix6<f64> {
    Matrix6::from_fn(|i, j| A[j][i].get(lane))
}
