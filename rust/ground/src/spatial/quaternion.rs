//! Unit quaternions x, y, z, w over lanes.
#![allow(clippy::inline_always)] // a call leaves the instructions that its caller is compiled for

use friction_contact::scalar::elementary::sin_cos;
use friction_contact::scalar::{Lane, LaneMask};
use friction_contact::scalar::{Mat3, Vec3};

/// Rotation by the vector `phi` (rad, world axes): the quaternion `exp(phi / 2)`.
///
/// The series at small angles keeps full precision where `sin(x) / x` would not.
#[inline(always)]
pub fn exp_rotation<T: Lane>(phi: Vec3<T>) -> [T; 4] {
    let number = |x: f64| phi.x.like(x);
    let one = number(1.0);
    let square = phi.dot(phi) * number(0.25);
    let is_small = square.lt(number(1e-4));
    let nested = |a: f64, b: f64, c: f64| {
        let inner = one - square * number(1.0 / b) * (one - square * number(1.0 / c));
        one - square * number(1.0 / a) * inner
    };
    // sin(x)/x and cos(x): error below 1e-19 at the switch.
    let (mut w, mut s) = (
        nested(2.0, 12.0, 30.0),
        nested(6.0, 20.0, 42.0) * number(0.5),
    );
    if !is_small.all() {
        let half = square.sqrt();
        let (sin, cos) = sin_cos(half);
        w = T::select(is_small, w, cos);
        s = T::select(is_small, s, number(0.5) * sin / half);
    }
    [s * phi.x, s * phi.y, s * phi.z, w]
}

/// A quaternion of nearly unit length, renormalised.
#[inline(always)]
pub fn normalised<T: Lane>(q: &[T; 4]) -> [T; 4] {
    let [x, y, z, w] = *q;
    let square = x * x + y * y + z * z + w * w;
    let factor = x.like(0.5) * (x.like(3.0) - square);
    [x * factor, y * factor, z * factor, w * factor]
}

/// Product of two quaternions x, y, z, w.
#[inline(always)]
pub fn product<T: Lane>(a: &[T; 4], b: &[T; 4]) -> [T; 4] {
    let ([ax, ay, az, aw], [bx, by, bz, bw]) = (*a, *b);
    [
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
        aw * bw - ax * bx - ay * by - az * bz,
    ]
}

/// Rotation matrix of a unit quaternion x, y, z, w.
#[inline(always)]
pub fn rotation<T: Lane>(q: &[T; 4]) -> Mat3<T> {
    let [x, y, z, w] = *q;
    let (xx, yy, zz, ww) = (x * x, y * y, z * z, w * w);
    let two = x.like(2.0);
    let (xy, xz, yz) = (two * x * y, two * x * z, two * y * z);
    let (wx, wy, wz) = (two * w * x, two * w * y, two * w * z);
    Mat3 {
        x: Vec3::new(ww + xx - yy - zz, xy + wz, xz - wy),
        y: Vec3::new(xy - wz, ww - xx + yy - zz, yz + wx),
        z: Vec3::new(xz + wy, yz - wx, ww - xx - yy + zz),
    }
}
