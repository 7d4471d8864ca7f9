//! Prepared packings, made once and kept on disk.

use std::fs::File;
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use dem::{Packing, Rung, RveParameters};
use rayon::prelude::*;
use serde::Serialize;
use serde::de::DeserializeOwned;

/// Changes whenever packings made by an older version must not be used any more.
const VERSION: u32 = 2;

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
            let file = cache_file(&("isotropic", p, seed));
            let isotropic = cached(file, || dem::consolidate(p, seed))?;
            let density = bulk_density(p, &isotropic);
            let targets: Vec<f64> =
                depths.iter().map(|depth| (density * g * depth).max(LEAST_STRESS)).collect();
            let file = cache_file(&("ladder", p, seed, &targets));
            let rungs = cached(file, || dem::ladder(p, seed, &isotropic, &targets))?;
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

/// The value kept in `file`, or a new one, which is then kept.
fn cached<T: Serialize + DeserializeOwned, E>(
    file: Option<PathBuf>,
    make: impl FnOnce() -> Result<T, E>,
) -> Result<T, E> {
    let Some(file) = file else { return make() };
    if let Some(value) = kept(&file) {
        return Ok(value);
    }
    // Whoever else wants this packing, in this process or another, waits for it instead of making
    // it too. Where files cannot be locked everybody makes it.
    let _lock = lock(&file.with_extension("lock"));
    if let Some(value) = kept(&file) {
        return Ok(value);
    }
    let value = make()?;
    // Without a cache the next run only takes longer.
    drop(keep(&file, &value));
    Ok(value)
}

/// The value in a cache file. One that does not parse, cut short by a full disk say, is made again.
fn kept<T: DeserializeOwned>(file: &Path) -> Option<T> {
    postcard::from_bytes(&std::fs::read(file).ok()?).ok()
}

/// Under a temporary name of its own first: two processes never write one file.
fn keep(file: &Path, value: &impl Serialize) -> io::Result<()> {
    let bytes = postcard::to_stdvec(value).map_err(io::Error::other)?;
    let folder = file.parent().unwrap_or(Path::new("."));
    let mut builder = tempfile::Builder::new();
    // As any other file, and not for this user alone.
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
    let mut temporary = builder.tempfile_in(folder)?;
    temporary.write_all(&bytes)?;
    temporary.as_file().sync_all()?;
    temporary.persist(file)?;
    Ok(())
}

/// Waits for the lock; it ends with the returned file, also when the process is killed.
fn lock(path: &Path) -> io::Result<File> {
    std::fs::create_dir_all(path.parent().unwrap_or(Path::new(".")))?;
    let file = File::create(path)?;
    file.lock()?;
    Ok(file)
}

/// Cache file of a key; `None` without a home directory.
fn cache_file(key: &impl Serialize) -> Option<PathBuf> {
    let key = postcard::to_stdvec(&(VERSION, key)).ok()?;
    let name = blake3::hash(&key).to_hex();
    Some(gpu::cache_directory()?.join("packings").join(&name.as_str()[..32]))
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::{AtomicUsize, Ordering};

    use super::*;

    #[test]
    fn one_of_many_makes_a_packing_and_no_temporary_file_stays() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("new/packing");
        let made = AtomicUsize::new(0);
        let fetch = || {
            cached(Some(file.clone()), || {
                made.fetch_add(1, Ordering::Relaxed);
                Ok::<_, ()>(vec![7_u64; 10_000])
            })
        };
        std::thread::scope(|scope| {
            for _ in 0..8 {
                scope.spawn(|| assert_eq!(fetch().unwrap(), vec![7; 10_000]));
            }
        });
        assert_eq!(std::fs::read_dir(file.parent().unwrap()).unwrap().count(), 2);
        // What does not parse is as good as nothing.
        std::fs::write(&file, b"\xff\xff").unwrap();
        assert_eq!(fetch().unwrap(), vec![7; 10_000]);
        assert_eq!(made.into_inner(), 2);
    }
}
