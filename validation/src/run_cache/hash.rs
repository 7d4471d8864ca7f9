//! Hashes of texts and files.

use std::fs::File;
use std::path::Path;

/// Characters of a hash that are kept.
const LENGTH: usize = 20;

/// The first 20 hexadecimal digits of the BLAKE3 hash of some texts and their lengths.
pub fn hash(parts: &[&str]) -> String {
    let mut hasher = blake3::Hasher::new();
    for part in parts {
        hasher.update(&(part.len() as u64).to_le_bytes());
        hasher.update(part.as_bytes());
    }
    hasher.finalize().to_hex()[..LENGTH].to_owned()
}

/// The first 20 hexadecimal digits of the BLAKE3 hash of a file's contents.
///
/// # Errors
/// If the file cannot be read.
pub fn hash_of_file(path: &Path) -> std::io::Result<String> {
    let mut hasher = blake3::Hasher::new();
    std::io::copy(&mut File::open(path)?, &mut hasher)?;
    Ok(hasher.finalize().to_hex()[..LENGTH].to_owned())
}
