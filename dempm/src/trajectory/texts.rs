//! Texts as attributes.
//!
//! A text is an attribute of variable length, which other programs show as a string. HDF5 keeps such texts
//! in a heap without checksums, where a byte of damage changes a text unnoticed or sends the library into
//! an endless loop. So the group `texts` has copies of fixed length, which lie in object headers with
//! checksums, and only those are read here.

use std::str::FromStr;

use hdf5::types::{FixedAscii, FixedUnicode, TypeDescriptor, VarLenAscii, VarLenUnicode};
use hdf5::{Group, Location};

use super::attributes::{has, remove};
use super::links;

/// The group of copies; below it, the same paths.
const COPIES: &str = "texts";
/// Longest text attribute, bytes.
const LONGEST: usize = 65_536;

/// Writes a text attribute with its copy, replacing an older one of that name.
pub(super) fn write_text(place: &Group, name: &str, text: &str) -> hdf5::Result<()> {
    // HDF5 strings end at the first NUL.
    let text = text.replace('\0', "\u{fffd}");
    let path = copies_of(place);
    let file = place.file()?;
    let copies = match links::exists(&file, &path)? {
        true => file.group(&path)?,
        false => links::new_group(&file, &path)?,
    };
    // The heap keeps what was there before.
    if has(&copies, name)? && read_attribute(&copies, name)? == text {
        return Ok(());
    }
    let value = FixedUnicode::<LONGEST>::from_str(&text).map_err(|_| {
        hdf5::Error::from(format!("{} bytes of text, at most {LONGEST} fit", text.len()))
    })?;
    remove(&copies, name)?;
    let exact = TypeDescriptor::FixedUnicode(text.len().max(1));
    copies.new_attr_builder().empty_as(exact).create(name)?.write_scalar(&value)?;
    remove(place, name)?;
    write_note(place, name, &text)
}

/// Writes a text attribute that is not read here, such as a unit.
pub(super) fn write_note(place: &Location, name: &str, text: &str) -> hdf5::Result<()> {
    let value = VarLenUnicode::from_str(text)
        .map_err(|error| hdf5::Error::from(format!("{name}: {error}")))?;
    place.new_attr::<VarLenUnicode>().create(name)?.write_scalar(&value)
}

/// Reads a text: its copy, or the attribute itself in files that have none.
pub(super) fn read_text(place: &Group, name: &str) -> hdf5::Result<String> {
    let (file, path) = (place.file()?, copies_of(place));
    if links::exists(&file, COPIES)? && links::exists(&file, &path)? {
        let copies = links::group(&file, &path)?;
        if has(&copies, name)? {
            return read_attribute(&copies, name);
        }
    }
    read_attribute(place, name)
}

fn copies_of(place: &Group) -> String {
    format!("{COPIES}{}", place.name()).trim_end_matches('/').to_owned()
}

/// Reads an attribute of fixed or variable length.
fn read_attribute(place: &Location, name: &str) -> hdf5::Result<String> {
    let attribute = place.attr(name)?;
    let bytes = match attribute.dtype()?.to_descriptor()? {
        TypeDescriptor::VarLenUnicode => {
            attribute.read_scalar::<VarLenUnicode>()?.as_bytes().to_vec()
        }
        TypeDescriptor::VarLenAscii => attribute.read_scalar::<VarLenAscii>()?.as_bytes().to_vec(),
        TypeDescriptor::FixedAscii(_) => {
            attribute.read_scalar::<FixedAscii<LONGEST>>()?.as_bytes().to_vec()
        }
        _ => attribute.read_scalar::<FixedUnicode<LONGEST>>()?.as_bytes().to_vec(),
    };
    String::from_utf8(bytes).map_err(|error| hdf5::Error::from(error.to_string()))
}
