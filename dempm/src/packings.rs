//! Prepared packings, made once and kept on disk.

mod key;
mod shipped;

use std::collections::BTreeMap;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::{Arc, OnceLock};

use dem::assembly::{
    Assembly, AssemblyError, Boundary, ColumnBox, Packed, Settling, on_cpu, prepare_column,
};
use dem::cuda::{CudaAssembly, CudaAssemblyError, CudaReal};
use dem::{Grains, Packing, Preparation, Real, Rung, RveParameters};
use files::{FileLock, note, read_sealed, seal, write_atomically};
use gpu::Device;
use rayon::prelude::*;
use serde::Serialize;
use serde::de::DeserializeOwned;

use key::{Key, key};

/// A consolidated packing and one packing per overburden.
#[derive(Clone, Debug)]
pub struct Ladder {
    /// The consolidated packing under isotropic pressure.
    pub isotropic: Packing<f64>,
    /// The same packing at each vertical stress, in the order of the depths.
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
    let count = seeds.len();
    let consolidated = vec![OnceLock::new(); count];
    // Some packings take five times as long to consolidate as others. Threads take these tasks in order: no ladder
    // before all consolidations have begun, so that few threads have nothing to do in the end.
    let ladders: Result<BTreeMap<usize, Ladder>, dem::Error> = (0..2 * count)
        .par_bridge()
        .filter_map(|task| {
            let (k, seed) = (task % count, seeds[task % count]);
            let isotropic = consolidated[k].get_or_init(|| consolidated_packing(p, seed));
            let isotropic = match isotropic {
                Ok(isotropic) => isotropic,
                Err(error) => return Some(Err(error.clone())),
            };
            (task >= count).then(|| Ok((k, ladder(p, seed, isotropic, depths, g)?)))
        })
        .collect();
    Ok(ladders?.into_values().collect())
}

/// Whether the consolidated packings of these seeds come with the program, so that only their ladders are left to make.
pub fn ship(p: &RveParameters, mut seeds: impl Iterator<Item = u64>) -> bool {
    seeds.all(|seed| consolidated_key(p, seed).is_some_and(|key| shipped::has(&key)))
}

/// Parameters as they enter keys.
fn in_keys(p: &RveParameters) -> impl Serialize {
    let RveParameters {
        grains,
        discs,
        stress_window,
        kinetic_stress,
        free_solid_fraction,
        thin_width,
        max_solid_fraction,
        preparation,
    } = p;
    (
        grains,
        discs,
        stress_window,
        kinetic_stress,
        free_solid_fraction,
        thin_width,
        max_solid_fraction,
        preparation,
    )
}

/// A packing under isotropic pressure.
fn consolidated_packing(p: &RveParameters, seed: u64) -> Result<Packing<f64>, dem::Error> {
    let key = consolidated_key(p, seed);
    match key.and_then(|key| shipped::packing(&key, &p.grains)) {
        Some(packing) => Ok(packing),
        None => cached(key.and_then(cache_file), || dem::consolidate(p, seed)),
    }
}

fn consolidated_key(p: &RveParameters, seed: u64) -> Option<Key> {
    let mut p = p.clone();
    // Only ladders depend on these.
    let Preparation { ladder_rate, lateral_strain, rough_ladder, .. } = Preparation::default();
    p.preparation = Preparation { ladder_rate, lateral_strain, rough_ladder, ..p.preparation };
    key(&("isotropic", in_keys(&p), seed))
}

/// A consolidated packing at the vertical stress of every depth.
fn ladder(
    p: &RveParameters,
    seed: u64,
    isotropic: &Packing<f64>,
    depths: &[f64],
    g: f64,
) -> Result<Ladder, dem::Error> {
    let density = bulk_density(p, isotropic);
    let targets: Vec<f64> =
        depths.iter().map(|depth| (density * g * depth).max(LEAST_STRESS)).collect();
    let file = key(&("ladder", in_keys(p), seed, &targets)).and_then(cache_file);
    let rungs = cached(file, || dem::ladder(p, seed, isotropic, &targets))?;
    Ok(Ladder { isotropic: isotropic.clone(), rungs })
}

/// Least vertical stress of the ladder (Pa): below it a packing would fall apart.
const LEAST_STRESS: f64 = 100.0;

/// Mass of grains over volume of packing (kg/m³).
pub fn bulk_density(p: &RveParameters, packing: &Packing<f64>) -> f64 {
    p.grains.grain_density * packing.solid_fraction()
}

/// Fills a column of a scene with discs at rest; see [`prepare_column`]. A column found in the cache is not
/// filled again; the CPU and GPUs have columns of their own, which differ as their round-off does.
///
/// # Errors
/// When the column cannot be filled. A cache that cannot be read or written is not an error.
pub fn column<R: CudaReal>(
    grains: &Grains,
    boundary: &Boundary,
    gravity: [f64; 2],
    place: &ColumnBox,
    seed: u64,
    device: Option<&Arc<Device>>,
) -> Result<Packed, AssemblyError> {
    // Of the boundary, only what lies below the column matters.
    let floor = (boundary.size[0], boundary.walls.bottom, boundary.floor, boundary.seed);
    let ColumnBox { corner, size, loaded } = *place;
    let key = key(&(
        // Springs push with their mean overlap.
        "column, mean overlap",
        <R as Real>::NAME,
        device.is_some(),
        grains.in_preparation(),
        floor,
        gravity,
        corner,
        size,
        loaded,
        seed,
    ));
    cached(key.and_then(cache_file), || {
        let mut start = |assembly| match device {
            None => on_cpu(assembly),
            Some(device) => on_gpu(device, assembly).map_err(preparation_error),
        };
        prepare_column::<R>(grains, boundary, gravity, place, seed, &mut start)
    })
}

/// An assembly that settles on a GPU.
struct OnGpu<R: CudaReal> {
    assembly: Assembly<R>,
    twin: CudaAssembly<R>,
}

fn on_gpu<R: CudaReal>(
    device: &Arc<Device>,
    assembly: Assembly<R>,
) -> Result<Box<dyn Settling<R>>, CudaAssemblyError> {
    let twin = CudaAssembly::upload(device, &assembly)?;
    Ok(Box::new(OnGpu { assembly, twin }))
}

impl<R: CudaReal> Settling<R> for OnGpu<R> {
    fn set_drag(&mut self, rate: f64) {
        self.twin.set_drag(rate);
    }

    fn advance(&mut self, steps: usize) -> Result<(), AssemblyError> {
        self.twin.advance(steps).map_err(preparation_error)
    }

    fn agitation(&mut self, gravity: f64) -> Result<f64, AssemblyError> {
        self.twin.agitation(&self.assembly, gravity).map_err(preparation_error)
    }

    fn finish(mut self: Box<Self>) -> Result<Assembly<R>, AssemblyError> {
        self.twin.download_into(&mut self.assembly).map_err(preparation_error)?;
        Ok(self.assembly)
    }
}

fn preparation_error(error: CudaAssemblyError) -> AssemblyError {
    match error {
        CudaAssemblyError::Assembly(error) => error,
        other => AssemblyError::Device(other.to_string()),
    }
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
    let _lock = FileLock::wait(&file, |holder| {
        note!("waiting for {holder}, which prepares the same packing");
    });
    if let Some(value) = kept(&file) {
        return Ok(value);
    }
    if file.exists() {
        note!("{}: damaged; preparing this packing again", file.display());
    }
    let value = make()?;
    // Without a cache the next run only takes longer.
    drop(keep(&file, &value));
    Ok(value)
}

/// The value in a cache file, unless the file is missing or damaged.
fn kept<T: DeserializeOwned>(file: &Path) -> Option<T> {
    postcard::from_bytes(&read_sealed(file).ok()?).ok()
}

/// Whole or not at all: other processes may read it at any moment.
fn keep(file: &Path, value: &impl Serialize) -> io::Result<()> {
    let bytes = seal(postcard::to_stdvec(value).map_err(io::Error::other)?);
    write_atomically(file, |temporary| std::fs::write(temporary, bytes))
}

/// Cache file of a key; `None` without a home directory.
fn cache_file(key: Key) -> Option<PathBuf> {
    let name: String = key.iter().map(|byte| format!("{byte:02x}")).collect();
    Some(gpu::cache_directory()?.join("packings").join(name))
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
        assert_eq!(std::fs::read_dir(file.parent().unwrap()).unwrap().count(), 1);
        // A damaged packing is made anew.
        let mut bytes = std::fs::read(&file).unwrap();
        bytes[5000] ^= 1;
        std::fs::write(&file, bytes).unwrap();
        assert_eq!(fetch().unwrap(), vec![7; 10_000]);
        assert_eq!(made.load(Ordering::SeqCst), 2);
        assert_eq!(fetch().unwrap(), vec![7; 10_000]);
        assert_eq!(made.into_inner(), 2);
    }
}
