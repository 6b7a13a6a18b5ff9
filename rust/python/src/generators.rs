//! Random generators as arrays: four unsigned 64-bit numbers each, high and low half of the state,
//! high and low half of the increment.

use numpy::PyReadonlyArray2;
use pyo3::prelude::*;
use pyo3::types::PyInt;
use rover_task::draw::{Pcg64, Pcg64State};

use crate::arguments::{count, each, refused};
use crate::arrays::{Array, check_size, fresh_rows};
use crate::errors::{Kind, Result};

/// (m, 4) halves of states and increments.
pub fn generators(value: &Bound<'_, PyAny>) -> Result<Vec<Pcg64>> {
    let found = value.extract::<PyReadonlyArray2<'_, u64>>();
    let what = "an array (m, 4) of uint64";
    let found = found.map_err(|_| refused(value, Kind::Option, "generators", what))?;
    let view = found.as_array();
    if view.shape()[1] != 4 {
        return Err(refused(value, Kind::Option, "generators", what));
    }
    let generator = |row: numpy::ndarray::ArrayView1<'_, u64>| {
        Pcg64::from_state(Pcg64State::from_halves([row[0], row[1], row[2], row[3]]))
    };
    Ok(view.rows().into_iter().map(generator).collect())
}

/// Seeds random generators as `numpy.random.PCG64` does.
///
/// Args:
///     seeds: Whole numbers from 0, of any size.
///
/// Returns:
///     (m, 4) uint64: high and low half of each state, high and low half of each increment.
///
/// Raises:
///     OptionError: A seed is not a whole number from 0.
#[pyfunction]
pub fn seed_generators(seeds: &Bound<'_, PyAny>) -> Result<Array<u64>> {
    let what = "whole numbers from 0";
    check_size(seeds, Kind::Option, "seeds")?;
    let seeded = |entry: &Bound<'_, PyAny>, kind, field: &str| -> Result<[u64; 4]> {
        if !entry.is_instance_of::<PyInt>() || entry.lt(0)? {
            return Err(refused(entry, kind, field, "a whole number from 0"));
        }
        let n_bits: usize = entry.call_method0("bit_length")?.extract()?;
        let n_words = n_bits.div_ceil(32).max(1);
        let bytes = entry.call_method1("to_bytes", (4 * n_words, "little"))?;
        let bytes: Vec<u8> = bytes.extract()?;
        let words = bytes.chunks_exact(4);
        let words: Vec<u32> = words
            .map(|w| u32::from_le_bytes([w[0], w[1], w[2], w[3]]))
            .collect();
        Ok(Pcg64::seeded(&words).state().halves())
    };
    let rows = each(seeds, Kind::Option, ("seeds", what), seeded)?;
    Ok(fresh_rows(rows))
}

/// Draws standard normal numbers as `numpy.random.Generator.standard_normal` does.
///
/// Args:
///     generators: Generators, (m, 4) uint64.
///     size: Number of draws from each generator.
///
/// Returns:
///     The numbers, (m, size), and the generators after the draws, (m, 4) uint64.
///
/// Raises:
///     OptionError: An argument has a wrong shape or type.
#[pyfunction]
pub fn standard_normals(
    generators: &Bound<'_, PyAny>,
    size: &Bound<'_, PyAny>,
) -> Result<(Array, Array<u64>)> {
    let mut randoms = self::generators(generators)?;
    let size = count(size, Kind::Option, "size")?;
    let numbers = (randoms.iter_mut()).flat_map(|random| (0..size).map(|_| random.normal()));
    let numbers = numbers.collect();
    let numbers = Array::shaped(numbers, &[randoms.len(), size]);
    Ok((
        numbers,
        fresh_rows(randoms.iter().map(|random| random.state().halves())),
    ))
}
