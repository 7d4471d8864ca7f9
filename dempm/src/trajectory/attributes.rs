//! HDF5 attributes: scalars, and groups used as tables.

use std::collections::BTreeMap;

use hdf5::{Group, H5Type, Location};
use ndarray::Array1;

/// Writes a scalar attribute, replacing an older one of that name.
pub(super) fn write_scalar<T: H5Type>(place: &Location, name: &str, value: &T) -> hdf5::Result<()> {
    remove(place, name)?;
    place.new_attr::<T>().create(name)?.write_scalar(value)
}

/// Removes an attribute if it is there.
pub(super) fn remove(place: &Location, name: &str) -> hdf5::Result<()> {
    if has(place, name)? { place.delete_attr(name) } else { Ok(()) }
}

/// Whether there is an attribute of that name.
pub(super) fn has(place: &Location, name: &str) -> hdf5::Result<bool> {
    Ok(place.attr_names()?.iter().any(|other| other == name))
}

/// Reads a scalar attribute.
pub(super) fn read_scalar<T: H5Type>(place: &Location, name: &str) -> hdf5::Result<T> {
    place.attr(name)?.read_scalar()
}

/// Reads an attribute of two numbers.
pub(super) fn read_pair(place: &Location, name: &str) -> hdf5::Result<[f64; 2]> {
    let attribute = place.attr(name)?;
    if attribute.shape() != [2] {
        return Err(format!("has shape {:?}, expected [2]", attribute.shape()).into());
    }
    let values: Array1<f64> = attribute.read_1d()?;
    Ok([values[0], values[1]])
}

/// Reads all attributes of a group that is used as a table. Errors come with the attribute's name.
pub(super) fn read_all<T>(
    group: &Group,
    read: impl Fn(&Group, &str) -> hdf5::Result<T>,
) -> Result<BTreeMap<String, T>, (String, hdf5::Error)> {
    let place = group.name();
    let names = group.attr_names().map_err(|error| (place.clone(), error))?;
    names
        .into_iter()
        .map(|name| match read(group, &name) {
            Ok(value) => Ok((name, value)),
            Err(error) => Err((format!("{place}.{name}"), error)),
        })
        .collect()
}
