//! `.npz` files of geoelements/gns: an array `gns_data` of objects (positions, particle types[, material
//! property]), or one such object an array, as `gns/data_loader.py` reads them.

use std::fs::File;
use std::io::{BufRead, BufReader, Read};
use std::path::Path;

use zip::ZipArchive;

use super::error::ImportError;
use super::foreign::Foreign;
use super::pickle::{Id, Pickle, PickleError};

/// `KINEMATIC_PARTICLE_ID` of `gns/train.py`.
const KINEMATIC: f64 = 3.0;
/// The array of all trajectories.
const ALL: &str = "gns_data.npy";

/// Calls `act` with each trajectory of a file.
pub(super) fn each(
    path: &Path,
    act: &mut dyn FnMut(Foreign) -> Result<(), ImportError>,
) -> Result<(), ImportError> {
    let failed = |source| ImportError::Archive { path: path.to_owned(), source };
    let file = File::open(path).map_err(ImportError::read(path))?;
    let mut archive = ZipArchive::new(BufReader::new(file)).map_err(failed)?;
    let arrays = match archive.index_for_name(ALL) {
        Some(index) => index..index + 1,
        None => 0..archive.len(),
    };
    let mut number = 0;
    for index in arrays {
        let entry = archive.by_index(index).map_err(failed)?;
        let name = entry.name().map_err(failed)?.into_owned();
        let place = format!("{}, {name}", path.display());
        let pickle = objects(BufReader::new(entry))
            .map_err(|source| ImportError::Pickle { place: place.clone(), source })?;
        let trajectories = match name == ALL {
            true => tuples(&pickle),
            false => vec![pickle.items(pickle.root).unwrap_or_default().to_vec()],
        };
        for items in trajectories {
            let place = format!("{}, trajectory {number}", path.display());
            act(trajectory(place, &pickle, &items)?)?;
            number += 1;
        }
    }
    Ok(())
}

/// The object in an `.npy` file of objects: a header of text, then a pickle.
fn objects(mut file: impl BufRead) -> Result<Pickle, PickleError> {
    let mut start = [0; 8];
    file.read_exact(&mut start)?;
    // The length takes 2 bytes in version 1 and 4 in later ones.
    let mut length = [0; 4];
    let width = if start[6] == 1 { 2 } else { 4 };
    file.read_exact(&mut length[..width])?;
    let mut header = Vec::new();
    file.by_ref().take(u32::from_le_bytes(length).into()).read_to_end(&mut header)?;
    let header = String::from_utf8_lossy(&header);
    if !start.starts_with(b"\x93NUMPY") || !header.contains("'|O'") {
        return Err(PickleError::Unknown("an array of no objects".to_owned()));
    }
    Pickle::read(file)
}

/// The items of each trajectory in an array of tuples, or of as many rows.
fn tuples(pickle: &Pickle) -> Vec<Vec<Id>> {
    let all = pickle.items(pickle.root).unwrap_or_default();
    match pickle.shape(pickle.root) {
        Some(&[_, columns]) if columns > 0 => all.chunks(columns).map(<[Id]>::to_vec).collect(),
        _ => all.iter().map(|&id| pickle.items(id).unwrap_or_default().to_vec()).collect(),
    }
}

fn trajectory(place: String, pickle: &Pickle, items: &[Id]) -> Result<Foreign, ImportError> {
    let arrays = match items {
        [positions, types] | [positions, types, _] => {
            pickle.numbers(*positions).zip(pickle.numbers(*types))
        }
        _ => None,
    };
    match arrays {
        Some((positions, types)) => {
            Foreign::new(place, positions, &types, |kind| kind == KINEMATIC)
        }
        None => {
            let problem = "not a tuple (positions, particle types) of arrays of numbers".to_owned();
            Err(ImportError::Shape { place, problem })
        }
    }
}
