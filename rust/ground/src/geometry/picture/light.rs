//! Sun, sky and haze.

use nalgebra::Vector3;

use super::{Colour, mix, smooth_step};
use friction_contact::scalar::elementary::asin;

/// The light of a scene.
#[derive(Clone, Debug, PartialEq)]
pub struct Light {
    /// Light of the Sun on a surface that faces it.
    pub sun: Colour,
    /// Light of the sky on a surface that faces up.
    pub sky: Colour,
    /// Light of the ground on a surface that faces down.
    pub bounce: Colour,
    /// The sky at the horizon, which is the colour of haze, and overhead.
    pub horizon: Colour,
    /// The sky overhead.
    pub zenith: Colour,
    /// Elevations, deg, rising, and the share of [`Self::zenith`] that the sky has there.
    pub bands: Vec<[f64; 2]>,
    /// Where haze begins and where it hides everything, m.
    pub haze: [f64; 2],
}

impl Light {
    /// Light on a surface with a unit normal. `towards`: unit vector to the Sun, none in a shadow.
    #[inline]
    #[must_use]
    pub fn on(&self, normal: &Vector3<f64>, towards: Option<&Vector3<f64>>) -> Colour {
        let sky = mix(&self.bounce, &self.sky, 0.5 + 0.5 * normal.y);
        let facing = towards.map_or(0.0, |sun| normal.dot(sun).max(0.0));
        std::array::from_fn(|k| sky[k] + facing * self.sun[k])
    }

    /// Colour of the sky in a unit direction.
    #[must_use]
    pub fn sky(&self, direction: &Vector3<f64>) -> Colour {
        let elevation = asin(direction.y.clamp(-1.0, 1.0)).to_degrees();
        let above = self.bands.partition_point(|band| band[0] <= elevation);
        let share = match (
            above.checked_sub(1).map(|k| self.bands[k]),
            self.bands.get(above),
        ) {
            (Some([from, low]), Some([to, high])) => {
                low + (elevation - from) / (to - from) * (high - low)
            }
            (Some([_, share]), None) => share,
            (None, first) => first.map_or(0.0, |band| band[1]),
        };
        mix(&self.horizon, &self.zenith, share)
    }

    /// A colour seen from a distance, m.
    #[inline]
    #[must_use]
    pub fn hazed(&self, colour: &Colour, distance: f64) -> Colour {
        mix(colour, &self.horizon, smooth_step(self.haze, distance))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn light() -> Light {
        Light {
            sun: [0.6, 0.5, 0.4],
            sky: [0.3; 3],
            bounce: [0.1; 3],
            horizon: [0.0; 3],
            zenith: [1.0; 3],
            bands: vec![[0.0, 0.0], [10.0, 0.5], [90.0, 1.0]],
            haze: [10.0, 30.0],
        }
    }

    #[test]
    fn brightness_follows_the_cosine_of_the_sun_and_ends_at_a_right_angle() {
        let sun = Vector3::y();
        for degrees in [0.0_f64, 30.0, 60.0, 90.0, 120.0] {
            let normal = Vector3::new(degrees.to_radians().sin(), degrees.to_radians().cos(), 0.0);
            let [lit, dark] = [Some(&sun), None].map(|sun| light().on(&normal, sun)[0]);
            let cosine = degrees.to_radians().cos();
            assert!((lit - dark - 0.6 * cosine.max(0.0)).abs() < 1e-15);
            assert!((dark - (0.2 + 0.1 * cosine)).abs() < 1e-15);
        }
    }

    #[test]
    fn the_sky_has_its_bands_and_far_things_its_colour_at_the_horizon() {
        for (elevation, share) in [(-30.0_f64, 0.0), (5.0, 0.25), (10.0, 0.5), (50.0, 0.75)] {
            let up = elevation.to_radians();
            let found = light().sky(&Vector3::new(up.cos(), up.sin(), 0.0))[1];
            assert!((found - share).abs() < 1e-12, "{elevation}");
        }
        let seen = |distance| light().hazed(&[1.0; 3], distance)[2];
        assert!((seen(10.0) - 1.0).abs() < 1e-15);
        assert!((seen(20.0) - 0.5).abs() < 1e-15);
        assert!(seen(30.0).abs() < 1e-15);
    }
}
