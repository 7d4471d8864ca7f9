//! Data sets for learned simulators: one file for each split, and `metadata.json`.

use std::path::{Path, PathBuf};

use files::{ReplacesInput, refuse_input};

use super::error::ExportError;
use super::finite::check_finite;
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

/// Writes each split of a data set, or one trajectory as a training set, and `metadata.json` to
/// `folder`. Returns the number of trajectories with obstacles or a plate, which these formats cannot
/// hold, for each split that has any.
///
/// # Errors
/// If a trajectory cannot be read, is not finished or has positions or velocities that are no numbers,
/// `folder` is that of the data set, or a file cannot be written.
pub fn write(
    source: &Path,
    folder: &Path,
    format: Format,
) -> Result<Vec<(Split, usize)>, ExportError> {
    let set = DataSet::open(source)?;
    refuse_inputs(source, &set, folder, format)?;
    let metadata = Metadata::of(&set)?;
    let mut lost = Vec::new();
    for (split, files) in &set.splits {
        let mut trajectories =
            files.iter().map(|file| Trajectory::open(file)).collect::<Result<Vec<_>, _>>()?;
        // The shortest first: some readers take its length for that of all.
        trajectories.sort_by_key(Trajectory::frames);
        trajectories.iter().try_for_each(check_finite)?;
        let mut boxes = 0;
        for trajectory in &trajectories {
            let first = 0..trajectory.frames().min(1);
            boxes += usize::from(trajectory.boxes(first)?.shape()[1] > 0);
        }
        if boxes > 0 {
            lost.push((*split, boxes));
        }
        let path = folder.join(split.name());
        match format {
            Format::Gns => gns::write(&trajectories, &path)?,
            Format::Lagrangebench => lagrangebench::write(&trajectories, &path)?,
        }
    }
    metadata.write(folder)?;
    Ok(lost)
}
