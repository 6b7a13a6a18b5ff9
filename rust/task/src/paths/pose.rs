//! A place and a heading.

/// Place and heading from a present pose.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PlanarPose {
    /// Way ahead, m.
    pub ahead: f64,
    /// Way to the right, m.
    pub right: f64,
    /// Turn to the left, rad.
    pub heading: f64,
}

impl PlanarPose {
    /// The pose that is `next` as seen from this one, whose heading has this sine and cosine.
    #[must_use]
    pub fn then(self, sine: f64, cosine: f64, next: Self) -> Self {
        Self {
            ahead: self.ahead + cosine * next.ahead + sine * next.right,
            right: self.right - sine * next.ahead + cosine * next.right,
            heading: self.heading + next.heading,
        }
    }

    /// Distance of the place from another, m.
    #[must_use]
    pub fn distance(self, ahead: f64, right: f64) -> f64 {
        let (ahead, right) = (self.ahead - ahead, self.right - right);
        (ahead * ahead + right * right).sqrt()
    }
}
