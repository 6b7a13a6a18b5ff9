//! Reader of friction-contact problems, the shelf's and recorded ones
//! (`.npz`: a zip of NumPy arrays), for tests and examples only.

#![allow(clippy::print_stdout)] // what is left out is said

use std::fs;
use std::path::Path;

use friction_contact::nalgebra::{Matrix3, Vector3};
use friction_contact::problem::Dimension;

/// A problem read from a file, owning its arrays.
pub struct Recorded {
    /// File name without extension.
    pub name: String,
    pub dimension: Dimension,
    pub W: Vec<f64>,
    pub q: Vec<f64>,
    pub mu: Vec<f64>,
}

/// Environment variable that names the folder of the recorded problems,
/// which are no part of this repository.
const SETTING: &str = "ROVER_GYM_CONTACT_PROBLEMS";

/// The problems of this repository's shelf, `tests/shelf/data`, whose name
/// passes the filter, sorted by size.
#[allow(dead_code)] // not every user of this page asks for it
pub fn shelf(filter: impl Fn(&str) -> bool) -> Vec<Recorded> {
    read_all(
        &Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/shelf/data"),
        filter,
    )
}

/// The recorded problems, of the folder that the environment variable names, whose name passes the
/// filter, sorted by size; says so when none is named.
#[allow(dead_code)] // not every user of this page asks for it
pub fn recorded(filter: impl Fn(&str) -> bool) -> Vec<Recorded> {
    let Some(folder) = std::env::var_os(SETTING) else {
        println!("{SETTING} is not set: the recorded problems are left out");
        return Vec::new();
    };
    read_all(Path::new(&folder), filter)
}

fn read_all(folder: &Path, filter: impl Fn(&str) -> bool) -> Vec<Recorded> {
    let mut problems: Vec<Recorded> = fs::read_dir(folder)
        .unwrap_or_else(|error| panic!("{}: {error}", folder.display()))
        .filter_map(|entry| {
            let path = entry.expect("readable entry").path();
            let name = path.file_stem()?.to_str()?.to_owned();
            (path.extension()? == "npz" && filter(&name)).then(|| read(&path, name))
        })
        .collect();
    problems.sort_by(|a, b| (a.q.len(), &a.name).cmp(&(b.q.len(), &b.name)));
    problems
}

fn read(path: &Path, name: String) -> Recorded {
    let archive = fs::read(path).expect("readable file");
    let array = |array: &str| floats(&member(&archive, array).expect(array));
    let dimension = match integers(&member(&archive, "dimension.npy").expect("a dimension"))[0] {
        2 => Dimension::Two,
        3 => Dimension::Three,
        other => panic!("{name}: dimension {other}"),
    };
    Recorded {
        dimension,
        W: match member(&archive, "W.npy") {
            Some(npy) => floats(&npy),
            None => delassus_of_free_bodies(
                &array("mass.npy"),
                &array("inertia_inverse.npy"),
                &integers(&member(&archive, "pairs.npy").expect("pairs")),
                &array("frames.npy"),
                &array("levers.npy"),
            ),
        },
        q: array("q.npy"),
        mu: array("mu.npy"),
        name,
    }
}

/// `W = Hᵀ M̂⁻¹ H`, row by row, of free bodies that touch;
/// `tests/shelf/problem.py` tells the arrays' meaning.
fn delassus_of_free_bodies(
    mass: &[f64],
    inertia_inverse: &[f64],
    pairs: &[i64],
    frames: &[f64],
    levers: &[f64],
) -> Vec<f64> {
    let n = pairs.len() / 2 * 3;
    // Per body its rows of Hᵀ: index of the row, direction of the force and its moment.
    let mut rows_of = vec![Vec::new(); mass.len()];
    for row in 0..n {
        let contact = row / 3;
        for (side, sign) in [(0, -1.0), (1, 1.0)] {
            let Ok(body) = usize::try_from(pairs[2 * contact + side]) else {
                continue; // the ground
            };
            let direction = Vector3::from_column_slice(&frames[3 * row..3 * row + 3]) * sign;
            let lever = Vector3::from_column_slice(&levers[6 * contact + 3 * side..][..3]);
            rows_of[body].push((row, direction, lever.cross(&direction)));
        }
    }
    let mut W = vec![0.0; n * n];
    for (body, rows) in rows_of.iter().enumerate() {
        let inertia_inverse = Matrix3::from_row_slice(&inertia_inverse[9 * body..9 * body + 9]);
        for (column, force, moment) in rows {
            let (speed, spin) = (force / mass[body], inertia_inverse * moment);
            for (row, direction, arm) in rows {
                W[row * n + column] += direction.dot(&speed) + arm.dot(&spin);
            }
        }
    }
    W
}

fn u16_at(bytes: &[u8], at: usize) -> usize {
    usize::from(u16::from_le_bytes([bytes[at], bytes[at + 1]]))
}

fn u32_at(bytes: &[u8], at: usize) -> usize {
    u32::from_le_bytes([bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]]) as usize
}

/// One file of a zip archive, found through the central directory; `None`
/// if there is none of that name.
fn member(archive: &[u8], wanted: &str) -> Option<Vec<u8>> {
    let end = (0..archive.len() - 21)
        .rev()
        .find(|&at| archive[at..].starts_with(b"PK\x05\x06"))
        .expect("a zip archive");
    let (count, mut at) = (u16_at(archive, end + 10), u32_at(archive, end + 16));
    for _ in 0..count {
        let method = u16_at(archive, at + 10);
        let compressed = u32_at(archive, at + 20);
        let (name, extra, comment) = (
            u16_at(archive, at + 28),
            u16_at(archive, at + 30),
            u16_at(archive, at + 32),
        );
        let local = u32_at(archive, at + 42);
        if &archive[at + 46..at + 46 + name] == wanted.as_bytes() {
            let start = local + 30 + u16_at(archive, local + 26) + u16_at(archive, local + 28);
            let data = &archive[start..start + compressed];
            return Some(match method {
                0 => data.to_vec(),
                8 => miniz_oxide::inflate::decompress_to_vec(data).expect("a deflate stream"),
                other => panic!("zip method {other}"),
            });
        }
        at += 46 + name + extra + comment;
    }
    None
}

/// Checks the header of a `.npy` array and returns its bytes.
fn body<'a>(npy: &'a [u8], kind: &str) -> &'a [u8] {
    assert!(npy.starts_with(b"\x93NUMPY\x01"), "npy version 1");
    let start = 10 + u16_at(npy, 8);
    let header = std::str::from_utf8(&npy[10..start]).expect("ascii header");
    assert!(
        header.contains(kind) && header.contains("'fortran_order': False"),
        "{header}"
    );
    &npy[start..]
}

fn floats(npy: &[u8]) -> Vec<f64> {
    body(npy, "'<f8'")
        .chunks_exact(8)
        .map(|b| f64::from_le_bytes(b.try_into().expect("8 bytes")))
        .collect()
}

fn integers(npy: &[u8]) -> Vec<i64> {
    body(npy, "'<i8'")
        .chunks_exact(8)
        .map(|b| i64::from_le_bytes(b.try_into().expect("8 bytes")))
        .collect()
}
