//! HDF5 files of LagrangeBench: a group a trajectory with `position` and `particle_type`, as
//! `lagrangebench/data/data.py` reads them.

use std::path::Path;

use ndarray::ArrayD;

use super::error::ImportError;
use super::foreign::Foreign;
use crate::trajectory::open_hdf5;

/// `SOLID_WALL` and `MOVING_WALL` among `NodeType` of `lagrangebench/utils.py`.
const KINEMATIC: [f64; 2] = [1.0, 2.0];

/// Calls `act` with each trajectory of a file.
pub(super) fn each(
    path: &Path,
    act: &mut dyn FnMut(Foreign) -> Result<(), ImportError>,
) -> Result<(), ImportError> {
    let (file, _) = open_hdf5(path)?;
    let mut names = file.member_names().map_err(ImportError::hdf5(path, "the groups"))?;
    names.sort();
    for name in names {
        let read = |item: &str| -> Result<ArrayD<f64>, ImportError> {
            let item = format!("{name}/{item}");
            file.dataset(&item)
                .and_then(|dataset| dataset.read_dyn())
                .map_err(ImportError::hdf5(path, &item))
        };
        let place = format!("{}, trajectory {name}", path.display());
        let (positions, types) = (read("position")?, read("particle_type")?);
        act(Foreign::new(place, positions, &types, |kind| KINEMATIC.contains(&kind))?)?;
    }
    Ok(())
}
