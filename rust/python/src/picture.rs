//! `PictureLook`, and pictures as arrays.

use pyo3::prelude::*;
use pyo3::types::{PyDict, PyMapping};
use rover_core::geometry::picture::{Checks, Colour, Drawing, Grain, Light, Look, Pixel, Shot};
use rover_core::nalgebra::Vector3;

use crate::arguments::{Named, object, refused, text};
use crate::arrays::{Array, finite_shaped, fresh_rows};
use crate::errors::{Kind, Result};

/// Colours (n, 3), kinds (n,) and distances (n,).
pub type Picture = (Array<f32>, Array<u8>, Array);

/// Rows of a number of finite entries.
fn rows<const N: usize>(
    value: &Bound<'_, PyAny>,
    kind: Kind,
    field: &str,
) -> Result<Vec<[f64; N]>> {
    let what = format!("(n, {N})");
    let fits = |shape: &[usize]| matches!(*shape, [_, n] if n == N);
    let (flat, _) = finite_shaped(value, kind, (field, &what), fits)?;
    Ok(flat.as_chunks::<N>().0.to_vec())
}

/// N numbers.
pub fn numbers<const N: usize>(
    value: &Bound<'_, PyAny>,
    kind: Kind,
    field: &str,
) -> Result<[f64; N]> {
    let what = format!("({N},)");
    let (flat, _) = finite_shaped(value, kind, (field, &what), |shape| shape == [N])?;
    Ok(std::array::from_fn(|k| flat[k]))
}

/// Two colours.
fn tones(value: &Bound<'_, PyAny>, kind: Kind, field: &str) -> Result<[Colour; 2]> {
    let found = rows::<3>(value, kind, field)?;
    <[Colour; 2]>::try_from(found).map_err(|_| refused(value, kind, field, "two colours"))
}

fn grain(value: &Bound<'_, PyAny>, kind: Kind, field: &str) -> Result<Grain> {
    let fits = |shape: &[usize]| matches!(*shape, [n, m] if n == m);
    let (values, shape) = finite_shaped(value, kind, (field, "(n, n)"), fits)?;
    let wrong = || refused(value, kind, field, "square, with a power of 2 as its side");
    Grain::new(values, shape[0]).ok_or_else(wrong)
}

/// Two numbers that rise.
fn rising(value: &Bound<'_, PyAny>, kind: Kind, field: &str) -> Result<[f64; 2]> {
    let [low, high] = numbers(value, kind, field)?;
    let is_rising = 0.0 <= low && low < high;
    is_rising
        .then_some([low, high])
        .ok_or_else(|| refused(value, kind, field, "two numbers from 0 on that rise"))
}

fn light(given: &Bound<'_, PyAny>) -> Result<Light> {
    let named = Named::mapping(given, "light", Kind::Option)?;
    Ok(Light {
        sun: named.need("sun", numbers)?,
        sky: named.need("sky", numbers)?,
        bounce: named.need("bounce", numbers)?,
        horizon: named.need("horizon", numbers)?,
        zenith: named.need("zenith", numbers)?,
        bands: named.need("bands", rows)?,
        haze: named.need("haze", rising)?,
    })
}

/// Triangles (n, 9), normals (n, 9) and colours (n, 3) of a solid.
fn drawing(name: &str, given: &Bound<'_, PyAny>) -> Result<Option<Drawing>> {
    let field = format!("drawings.{name}");
    let parts = given.extract::<[Bound<'_, PyAny>; 3]>();
    let what = "triangles, normals and colours, as many of each";
    let wrong = || refused(given, Kind::Option, &field, what);
    let [triangles, normals, colours] = parts.map_err(|_| wrong())?;
    let triangles = rows::<9>(&triangles, Kind::Option, &field)?;
    let normals = rows::<9>(&normals, Kind::Option, &field)?;
    let colours = rows::<3>(&colours, Kind::Option, &field)?;
    if triangles.len() != colours.len() || triangles.len() != normals.len() {
        return Err(wrong());
    }
    Ok(Drawing::new(&triangles, &normals, &colours))
}

/// How pictures show a rover and its ground: what is drawn of solids, colours, and light.
///
/// Immutable. Colours are red, green and blue, 1 for white.
///
/// Args:
///     drawings: For solids by name: the corners of triangles in the solid's frame, (n, 9), m, the
///         normals at these corners, (n, 9), and the triangles' colours, (n, 3). Triangles without
///         an area are not drawn.
///     colours: `ground` and `sand`, the two tones of the checkered ground, (2, 3); `rock` and
///         `ball`, (3,).
///     light: `sun`, `sky` and `bounce`, the light of Sun, sky and ground on a white surface that
///         faces them, (3,); `horizon` and `zenith`, colours of the sky, (3,); `bands`, rising
///         elevations, deg, and the share of `zenith` there, (n, 2); `haze`, distances where haze
///         begins and where it hides everything, (2,), m.
///     grain: Brightness of the ground's texture, (n, n) from 0 to 1, n a power of 2.
///     tile: Edge of a field of the checkered ground, m.
///
/// Raises:
///     OptionError: An array has a wrong shape or an entry that is not finite, an entry is missing,
///         `tile` is not positive, or `grain` is not square.
#[pyclass(module = "rover_gym.core", frozen)]
pub struct PictureLook {
    pub look: Look,
    pub drawings: Vec<(String, Drawing)>,
}

#[pymethods]
impl PictureLook {
    #[new]
    #[pyo3(signature = (drawings, **options), text_signature = "(drawings, *, colours, light, grain, tile)")]
    fn new(
        py: Python<'_>,
        drawings: &Bound<'_, PyAny>,
        options: Option<&Bound<'_, PyDict>>,
    ) -> Result<Self> {
        let given = Named::keywords(py, options)?;
        let colours = given.need("colours", |value, kind, field| {
            object::<PyMapping>(value, kind, field, "a mapping").cloned()
        })?;
        let colours = Named::mapping(colours.as_any(), "colours", Kind::Option)?;
        let look = Look {
            light: given.need("light", |value, _, _| light(value))?,
            checks: Checks {
                tile: given.need("tile", crate::arguments::positive)?,
                grain: given.need("grain", grain)?,
            },
            firm: colours.need("ground", tones)?,
            sand: colours.need("sand", tones)?,
            rock: colours.need("rock", numbers)?,
            ball: colours.need("ball", numbers)?,
        };
        given.finish()?;
        let solids = object::<PyMapping>(drawings, Kind::Option, "drawings", "a mapping")?;
        let mut found = Vec::new();
        for item in solids.items()?.iter() {
            let (name, parts) = item.extract::<(Bound<'_, PyAny>, Bound<'_, PyAny>)>()?;
            let name = text(&name, Kind::Option, "drawings")?;
            if let Some(drawing) = drawing(&name, &parts)? {
                found.push((name, drawing));
            }
        }
        Ok(Self {
            look,
            drawings: found,
        })
    }
}

/// How a picture is taken: its light, if the Sun has a direction, and its pixels' angle, rad.
pub fn shot(sun: Option<&Bound<'_, PyAny>>, pixel: f64, range: f64) -> Result<Shot> {
    let towards = |given: &Bound<'_, PyAny>| {
        let sun = Vector3::from(numbers::<3>(given, Kind::Option, "sun")?);
        let above = (sun.y > 0.0).then(|| sun.normalize());
        above.ok_or_else(|| refused(given, Kind::Option, "sun", "above the horizon"))
    };
    Ok(Shot {
        range,
        pixel,
        sun: sun.map(towards).transpose()?,
    })
}

/// Pixels as arrays.
#[allow(clippy::cast_possible_truncation)] // colours in the precision of images
pub fn pixels(taken: &[Pixel]) -> Picture {
    (
        fresh_rows(taken.iter().map(|pixel| pixel.colour.map(|c| c as f32))),
        taken.iter().map(|pixel| pixel.kind as u8).collect(),
        taken.iter().map(|pixel| pixel.distance).collect(),
    )
}
