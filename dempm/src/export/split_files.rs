//! Data sets for learned simulators: one file for each split, and `metadata.json`.

use std::path::{Path, PathBuf};

use files::{ReplacesInput, refuse_input};

use super::error::ExportError;
use super::finite::check_finite;
use super::metadata::{GnsMetadata, lagrangebench_metadata};
use super::particles::Particles;
use super::{gns, lagrangebench};
use crate::dataset::{DataSet, Metadata, Split};
use crate::trajectory::Trajectory;

/// Formats of data sets.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// `.npz` files for geoelements/gns.
    Gns,
    /// HDF5 files for LagrangeBench.
    Lagrangebench,
}

/// Refuses a folder in which a file of the data set would be replaced, or that is the data set's own.
fn refuse_inputs(
    source: &Path,
    set: &DataSet,
    folder: &Path,
    format: Format,
) -> Result<(), ReplacesInput> {
    if source.is_dir() {
        let splits = set.splits.iter().map(|(split, _)| source.join(split.name()));
        refuse_input(folder, splits.chain([source.to_owned()]))?;
    }
    let inputs: Vec<&PathBuf> = set.splits.iter().flat_map(|(_, files)| files).collect();
    let ending = match format {
        Format::Gns => "npz",
        Format::Lagrangebench => "h5",
    };
    let names = set.splits.iter().map(|(split, _)| format!("{}.{ending}", split.name()));
    for name in names.chain(["metadata.json".to_owned()]) {
        refuse_input(&folder.join(name), &inputs)?;
    }
    Ok(())
}

/// What a data set became.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Written {
    /// Particles of each trajectory, walls and boxes included, split by split.
    pub particles: Vec<(Split, Vec<usize>)>,
    /// Whether material properties were written: every trajectory has a friction angle.
    pub friction: bool,
}

/// Writes each split of a data set, or one trajectory as a training set, and `metadata.json` to
/// `folder`. Boxes become particles, and so do walls if `walls`.
///
/// # Errors
/// If a trajectory cannot be read, is not finished, has no frames, a box that is absent at times, or
/// positions or velocities that are no numbers, `folder` is that of the data set, or a file cannot be
/// written.
pub fn write(
    source: &Path,
    folder: &Path,
    format: Format,
    walls: bool,
) -> Result<Written, ExportError> {
    let set = DataSet::open(source)?;
    refuse_inputs(source, &set, folder, format)?;
    let metadata = Metadata::of(&set)?;
    let mut splits = Vec::new();
    for (split, files) in &set.splits {
        let mut trajectories =
            files.iter().map(|file| Trajectory::open(file)).collect::<Result<Vec<_>, _>>()?;
        trajectories.iter().try_for_each(check_finite)?;
        // The shortest first: LagrangeBench takes its length for that of all.
        trajectories.sort_by_key(Trajectory::frames);
        let particles = trajectories.into_iter().map(|t| Particles::of(t, walls));
        splits.push((*split, particles.collect::<Result<Vec<_>, _>>()?));
    }
    let all = || splits.iter().flat_map(|(_, particles)| particles);
    let friction = format == Format::Gns && all().all(|particles| particles.friction().is_some());
    for (split, particles) in &splits {
        let path = folder.join(split.name());
        match format {
            Format::Gns => gns::write(particles, &path, friction)?,
            Format::Lagrangebench => lagrangebench::write(particles, &path)?,
        }
    }
    let num_particles_max = all().map(Particles::count).max().unwrap_or(0);
    let metadata = Metadata { num_particles_max, ..metadata };
    match format {
        Format::Gns => GnsMetadata::new(&metadata, friction).write(folder)?,
        Format::Lagrangebench => lagrangebench_metadata(metadata, walls).write(folder)?,
    }
    let counts = |particles: &[Particles]| particles.iter().map(Particles::count).collect();
    let particles = splits.iter().map(|(split, particles)| (*split, counts(particles)));
    Ok(Written { particles: particles.collect(), friction })
}
