//! Data sets for learned simulators: one file for each split, and `metadata.json`.

use std::path::Path;

use super::error::ExportError;
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

/// Writes each split of a data set, or one trajectory as a training set, and `metadata.json` to
/// `folder`. Returns the number of trajectories with obstacles or a plate, which these formats cannot
/// hold, for each split that has any.
///
/// # Errors
/// If a trajectory cannot be read or is not finished, or a file cannot be written.
pub fn write(
    source: &Path,
    folder: &Path,
    format: Format,
) -> Result<Vec<(Split, usize)>, ExportError> {
    let set = DataSet::open(source)?;
    let metadata = Metadata::of(&set)?;
    let mut lost = Vec::new();
    for (split, files) in &set.splits {
        let mut trajectories =
            files.iter().map(|file| Trajectory::open(file)).collect::<Result<Vec<_>, _>>()?;
        // The shortest first: some readers take its length for that of all.
        trajectories.sort_by_key(Trajectory::frames);
        let boxes = trajectories.iter().filter(|t| !matches!(t.boxes(0..1), Ok(b) if b.is_empty()));
        let boxes = boxes.count();
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
