//! Prepared packings, made once and kept on disk.

use std::path::PathBuf;

use dem::{Packing, Rung, RveParameters};
use rayon::prelude::*;
use serde::Serialize;
use serde::de::DeserializeOwned;

use crate::trajectory::{WriteError, write_atomically};

/// Changes whenever packings made by an older version must not be used any more.
const VERSION: u32 = 1;

/// A consolidated packing and one packing per overburden.
#[derive(Clone, Debug)]
pub struct Ladder {
    pub isotropic: Packing<f64>,
    pub rungs: Vec<Rung>,
}

/// Consolidates one packing per seed and takes each to the vertical stress at every `depth` (m)
/// below a free surface under gravity `g` (m/s²). Packings found in the cache are not made again.
///
/// # Errors
/// When a packing cannot be prepared. A cache that cannot be read or written is not an error.
pub fn ladders(
    p: &RveParameters,
    seeds: &[u64],
    depths: &[f64],
    g: f64,
) -> Result<Vec<Ladder>, dem::Error> {
    seeds
        .par_iter()
        .map(|&seed| {
            let isotropic = cached(&("isotropic", p, seed), || dem::consolidate(p, seed))?;
            let density = bulk_density(p, &isotropic);
            let targets: Vec<f64> =
                depths.iter().map(|depth| (density * g * depth).max(LEAST_STRESS)).collect();
            let rungs = cached(&("ladder", p, seed, &targets), || {
                dem::ladder(p, seed, &isotropic, &targets)
            })?;
            Ok(Ladder { isotropic, rungs })
        })
        .collect()
}

/// Least vertical stress of the ladder (Pa): below it a packing would fall apart.
const LEAST_STRESS: f64 = 100.0;

/// Mass of grains over volume of packing (kg/m³).
pub fn bulk_density(p: &RveParameters, packing: &Packing<f64>) -> f64 {
    p.grain_density * packing.solid_fraction()
}

/// The value kept for `key`, or a new one, which is then kept.
fn cached<T: Serialize + DeserializeOwned, E>(
    key: &impl Serialize,
    make: impl FnOnce() -> Result<T, E>,
) -> Result<T, E> {
    let file = cache_file(key);
    let kept = file.as_ref().and_then(|file| std::fs::read(file).ok());
    // A file that does not parse, cut short by a full disk say, is simply made again.
    if let Some(value) = kept.and_then(|bytes| postcard::from_bytes(&bytes).ok()) {
        return Ok(value);
    }
    let value = make()?;
    if let (Some(file), Ok(bytes)) = (file, postcard::to_stdvec(&value)) {
        let written: Result<(), WriteError> = write_atomically(&file, |temporary| {
            std::fs::write(temporary, &bytes).map_err(|source| WriteError {
                path: file.clone(),
                action: "write it",
                source,
            })
        });
        // Without a cache the next run only takes longer.
        drop(written);
    }
    Ok(value)
}

/// Cache file of a key; `None` without a home directory.
fn cache_file(key: &impl Serialize) -> Option<PathBuf> {
    let key = postcard::to_stdvec(&(VERSION, key)).ok()?;
    let name = blake3::hash(&key).to_hex();
    Some(gpu::cache_directory()?.join("packings").join(&name.as_str()[..32]))
}
