//! HDF5 attributes: texts, scalars, and groups used as tables.

use std::collections::BTreeMap;
use std::str::FromStr;

use hdf5::types::{FixedAscii, FixedUnicode, TypeDescriptor, VarLenAscii, VarLenUnicode};
use hdf5::{Group, H5Type, Location};
use ndarray::Array1;

/// Longest text attribute, bytes.
const LONGEST_TEXT: usize = 65_536;

/// Writes a text attribute, replacing an older one of that name.
///
/// Strings of fixed length lie in the object's header, which has a checksum. Strings of variable
/// length lie in a heap without one, where a flipped bit can send the library into an endless loop.
pub(super) fn write_text(place: &Location, name: &str, text: &str) -> hdf5::Result<()> {
    // HDF5 strings end at the first NUL.
    let text = text.replace('\0', "\u{fffd}");
    let value = FixedUnicode::<LONGEST_TEXT>::from_str(&text).map_err(|_| {
        hdf5::Error::from(format!("{} bytes of text, at most {LONGEST_TEXT} fit", text.len()))
    })?;
    remove(place, name)?;
    let exact = TypeDescriptor::FixedUnicode(text.len().max(1));
    place.new_attr_builder().empty_as(exact).create(name)?.write_scalar(&value)
}

/// Writes a scalar attribute, replacing an older one of that name.
pub(super) fn write_scalar<T: H5Type>(place: &Location, name: &str, value: &T) -> hdf5::Result<()> {
    remove(place, name)?;
    place.new_attr::<T>().create(name)?.write_scalar(value)
}

fn remove(place: &Location, name: &str) -> hdf5::Result<()> {
    if has(place, name)? { place.delete_attr(name) } else { Ok(()) }
}

/// Whether there is an attribute of that name.
pub(super) fn has(place: &Location, name: &str) -> hdf5::Result<bool> {
    Ok(place.attr_names()?.iter().any(|other| other == name))
}

/// Reads a text attribute: of fixed length as written here, or of variable length as h5py writes it.
pub(super) fn read_text(place: &Location, name: &str) -> hdf5::Result<String> {
    let attribute = place.attr(name)?;
    let bytes = match attribute.dtype()?.to_descriptor()? {
        TypeDescriptor::VarLenUnicode => {
            attribute.read_scalar::<VarLenUnicode>()?.as_bytes().to_vec()
        }
        TypeDescriptor::VarLenAscii => attribute.read_scalar::<VarLenAscii>()?.as_bytes().to_vec(),
        TypeDescriptor::FixedAscii(_) => {
            attribute.read_scalar::<FixedAscii<LONGEST_TEXT>>()?.as_bytes().to_vec()
        }
        _ => attribute.read_scalar::<FixedUnicode<LONGEST_TEXT>>()?.as_bytes().to_vec(),
    };
    String::from_utf8(bytes).map_err(|error| hdf5::Error::from(error.to_string()))
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
    read: impl Fn(&Location, &str) -> hdf5::Result<T>,
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
