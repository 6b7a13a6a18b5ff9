//! Reader of the recorded friction-contact problems (`.npz`: a zip of NumPy arrays), for tests and examples only.

#![allow(clippy::print_stdout)] // a silent skip would look like a pass

use std::fs;
use std::path::{Path, PathBuf};

use rover_core::problem::Dimension;

/// A problem read from a file, owning its arrays.
pub struct Recorded {
    /// File name without extension.
    pub name: String,
    pub dimension: Dimension,
    pub W: Vec<f64>,
    pub q: Vec<f64>,
    pub mu: Vec<f64>,
}

/// Folder of the recorded problems, `../shared/reference/contact_problems` beside the repository; `None` where absent.
///
/// Worktrees lie deeper than the main checkout, so every ancestor is asked.
pub fn folder() -> Option<PathBuf> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    root.ancestors()
        .map(|ancestor| ancestor.join("shared/reference/contact_problems"))
        .find(|path| path.is_dir())
}

/// All recorded problems whose name passes the filter, sorted by size; says loudly when there is nothing to read.
pub fn recorded(filter: impl Fn(&str) -> bool) -> Vec<Recorded> {
    let Some(folder) = folder() else {
        println!(
            "SKIPPED: no ../shared/reference/contact_problems beside the repository, recorded problems not checked"
        );
        return Vec::new();
    };
    let mut problems: Vec<Recorded> = fs::read_dir(folder)
        .expect("readable folder")
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
    let dimension = match integers(&member(&archive, "dimension.npy"))[0] {
        2 => Dimension::Two,
        3 => Dimension::Three,
        other => panic!("{name}: dimension {other}"),
    };
    Recorded {
        dimension,
        W: floats(&member(&archive, "W.npy")),
        q: floats(&member(&archive, "q.npy")),
        mu: floats(&member(&archive, "mu.npy")),
        name,
    }
}

fn u16_at(bytes: &[u8], at: usize) -> usize {
    usize::from(u16::from_le_bytes([bytes[at], bytes[at + 1]]))
}

fn u32_at(bytes: &[u8], at: usize) -> usize {
    u32::from_le_bytes([bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]]) as usize
}

/// One file of a zip archive, found through the central directory.
fn member(archive: &[u8], wanted: &str) -> Vec<u8> {
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
            return match method {
                0 => data.to_vec(),
                8 => miniz_oxide::inflate::decompress_to_vec(data).expect("a deflate stream"),
                other => panic!("zip method {other}"),
            };
        }
        at += 46 + name + extra + comment;
    }
    panic!("no {wanted} in the archive")
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
