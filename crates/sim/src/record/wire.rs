//! Records of an MCAP file as bytes, read so that no file can do harm.
//!
//! The file is trusted with nothing: a length is believed only as far as the file
//! reaches and [`RECORD_LIMIT`] allows, and every field is looked up with bounds.
//! Unpacking of compressed chunks is left to the mcap crate, under the same limit.

/// Largest record, and largest unpacked chunk, that is read, bytes.
pub(crate) const RECORD_LIMIT: u64 = 128 * 1024 * 1024;
