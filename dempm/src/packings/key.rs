//! What a packing is known by: a hash of all that it depends on.

use serde::Serialize;

/// Changes whenever packings made by an older version must not be used any more.
const VERSION: u32 = 5;

/// Hash of the parameters, the seed and the kind of a packing.
pub(super) type Key = [u8; 16];

/// The key of what depends on `parts`.
pub(super) fn key(parts: &impl Serialize) -> Option<Key> {
    let bytes = postcard::to_stdvec(&(VERSION, parts)).ok()?;
    blake3::hash(&bytes).as_bytes().first_chunk().copied()
}
