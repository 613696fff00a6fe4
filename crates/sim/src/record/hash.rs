//! One number that says whether two runs were the same run.
//!
//! SHA-256 over outcome, reason and the bit patterns of the numbers: no times of
//! day, paths, host or thread count (`interfaces.md` §1).

use std::fmt::Write as _;

use sha2::{Digest, Sha256};

/// Gathers the numbers of a result as they come, then seals them with how it ended.
///
/// ```
/// use bikebot_sim::record::ResultHasher;
///
/// let mut hasher = ResultHasher::new();
/// hasher.values(&[1.0, 2.0]);
/// hasher.values(&[3.0]);
/// assert_eq!(hasher.finish("arrived", "goal").len(), 64);
/// ```
#[derive(Debug, Clone)]
pub struct ResultHasher {
    numbers: Sha256,
    count: u64,
}

impl Default for ResultHasher {
    fn default() -> Self {
        Self::new()
    }
}

impl ResultHasher {
    /// Starts with no numbers.
    #[must_use]
    pub fn new() -> Self {
        Self {
            numbers: Sha256::new(),
            count: 0,
        }
    }

    /// Adds numbers by their bits, in order: `-0.0` and `0.0` differ.
    ///
    /// Every NaN counts as the same one, because its payload is nobody's result.
    pub fn values(&mut self, values: &[f64]) {
        for &value in values {
            let bits = if value.is_nan() {
                f64::NAN.to_bits()
            } else {
                value.to_bits()
            };
            self.numbers.update(bits.to_le_bytes());
        }
        self.count += values.len() as u64;
    }

    /// The digest as 64 lower-case hexadecimal digits.
    ///
    /// The numbers are digested first, since how a run ends is known last.
    #[must_use]
    pub fn finish(self, outcome: &str, reason: &str) -> String {
        let mut whole = Sha256::new();
        for word in [outcome, reason] {
            // The length keeps ("ab", "c") apart from ("a", "bc").
            whole.update((word.len() as u64).to_le_bytes());
            whole.update(word.as_bytes());
        }
        whole.update(self.count.to_le_bytes());
        whole.update(self.numbers.finalize());
        hexadecimal(&whole.finalize())
    }
}

/// SHA-256 of some bytes, as 64 lower-case hexadecimal digits.
#[must_use]
pub fn sha256_hex(bytes: &[u8]) -> String {
    hexadecimal(&Sha256::digest(bytes))
}

fn hexadecimal(digest: &[u8]) -> String {
    digest.iter().fold(String::new(), |mut text, byte| {
        let _ = write!(text, "{byte:02x}");
        text
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn agrees_with_the_published_digest_of_abc() {
        // FIPS 180-4, example of one block.
        assert_eq!(
            sha256_hex(b"abc"),
            "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad"
        );
    }

    #[test]
    fn is_the_digest_of_the_documented_bytes() {
        let mut hasher = ResultHasher::new();
        hasher.values(&[1.5]);
        let mut bytes = Vec::new();
        bytes.extend(7u64.to_le_bytes());
        bytes.extend(b"arrived");
        bytes.extend(4u64.to_le_bytes());
        bytes.extend(b"goal");
        bytes.extend(1u64.to_le_bytes());
        bytes.extend(Sha256::digest(1.5f64.to_bits().to_le_bytes()));
        assert_eq!(hasher.finish("arrived", "goal"), sha256_hex(&bytes));
    }

    #[test]
    fn one_bit_one_word_or_one_more_number_changes_it() {
        let digest = |values: &[f64], outcome: &str, reason: &str| {
            let mut hasher = ResultHasher::new();
            hasher.values(values);
            hasher.finish(outcome, reason)
        };
        let base = digest(&[1.0, 2.0], "fell", "slip");
        assert_eq!(base, digest(&[1.0, 2.0], "fell", "slip"));
        assert_ne!(
            base,
            digest(&[1.0, f64::from_bits(2.0f64.to_bits() + 1)], "fell", "slip")
        );
        assert_ne!(base, digest(&[1.0, 2.0, 0.0], "fell", "slip"));
        assert_ne!(base, digest(&[2.0, 1.0], "fell", "slip"));
        assert_ne!(base, digest(&[1.0, 2.0], "fells", "lip"));
        assert_ne!(digest(&[0.0], "", ""), digest(&[-0.0], "", ""));
    }

    #[test]
    fn does_not_depend_on_how_the_numbers_were_handed_over_nor_on_nan_payloads() {
        let mut parts = ResultHasher::new();
        parts.values(&[1.0]);
        parts.values(&[f64::NAN]);
        let mut whole = ResultHasher::new();
        whole.values(&[
            1.0,
            f64::from_bits(f64::NAN.to_bits() ^ 0x8000_0000_0000_0001),
        ]);
        assert_eq!(parts.finish("", ""), whole.finish("", ""));
    }
}
