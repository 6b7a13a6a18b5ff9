//! Bytes with a checksum at their end, so that damage is noticed when they are read.
//!
//! The checksum is CRC-32 (ISO-HDLC, as in zlib and Ethernet), which finds every burst of up to 32
//! damaged bits, and overlooks other damage once in 2³² times.

use thiserror::Error;

/// Length of the checksum.
const LENGTH: usize = 4;

/// Remainders of the 256 bytes.
const REMAINDERS: [u32; 256] = {
    let mut table = [0; 256];
    let mut byte = 0;
    while byte < 256 {
        #[expect(clippy::cast_possible_truncation, reason = "below 256")]
        let mut rest = byte as u32;
        let mut bit = 0;
        while bit < 8 {
            rest = (rest >> 1) ^ (0xEDB8_8320 * (rest & 1));
            bit += 1;
        }
        table[byte] = rest;
        byte += 1;
    }
    table
};

/// The bytes do not have the checksum that they end with.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
#[error("the checksum does not fit")]
pub struct SealError;

/// The CRC-32 of some bytes.
#[must_use]
pub fn checksum(bytes: &[u8]) -> u32 {
    !(bytes.iter()).fold(u32::MAX, |rest, &byte| {
        REMAINDERS[usize::from(rest.to_le_bytes()[0] ^ byte)] ^ (rest >> 8)
    })
}

/// The bytes with their checksum at the end.
#[must_use]
pub fn seal(mut bytes: Vec<u8>) -> Vec<u8> {
    let sum = checksum(&bytes);
    bytes.extend(sum.to_le_bytes());
    bytes
}

/// The bytes that were sealed.
///
/// # Errors
///
/// [`SealError`] if a byte has changed since.
pub fn unseal(sealed: &[u8]) -> Result<&[u8], SealError> {
    let (bytes, sum) = sealed.split_last_chunk::<LENGTH>().ok_or(SealError)?;
    if checksum(bytes) == u32::from_le_bytes(*sum) {
        return Ok(bytes);
    }
    Err(SealError)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_checksum_is_the_one_of_other_programs() {
        assert_eq!(checksum(b"123456789"), 0xCBF4_3926);
        assert_eq!(checksum(b""), 0);
    }

    #[test]
    fn every_flipped_bit_and_every_cut_is_noticed() {
        let sealed = seal((0..200).collect());
        assert_eq!(unseal(&sealed), Ok(&sealed[..200]));
        for bit in 0..8 * sealed.len() {
            let mut damaged = sealed.clone();
            damaged[bit / 8] ^= 1 << (bit % 8);
            assert_eq!(unseal(&damaged), Err(SealError), "bit {bit}");
        }
        for length in 0..sealed.len() {
            assert_eq!(unseal(&sealed[..length]), Err(SealError), "{length} bytes");
        }
    }
}
