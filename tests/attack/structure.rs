//! Changes that leave a binary file well-formed, so that its contents are read.

use std::path::Path;

use hdf5::{Dataset, File, Group, H5Type, Location};
use ndarray::{ArrayD, IxDyn};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use crate::mutation::{damage, mutate};

/// Bytes of the hash at the end of a sealed file.
const HASH: usize = 32;
/// Numbers that a trajectory cannot have, and some that it can.
const NUMBERS: [f64; 12] = [
    f64::NAN,
    f64::INFINITY,
    f64::NEG_INFINITY,
    1e300,
    -1e300,
    1e-300,
    -1.0,
    0.0,
    1.0,
    1e6,
    1e12,
    0.1,
];

fn one<T: Copy>(of: &[T], rng: &mut ChaCha8Rng) -> T {
    of[rng.random_range(0..of.len())]
}

/// A sealed file whose contents are damaged, with the hash that they then have.
pub fn damage_sealed(bytes: &mut Vec<u8>, rng: &mut ChaCha8Rng) -> String {
    bytes.truncate(bytes.len() - HASH);
    let how = damage(bytes, rng);
    *bytes = files::seal(std::mem::take(bytes));
    format!("{how}, and sealed again")
}

/// A safetensors file with a mutated header of the right length.
pub fn mutate_header(bytes: &mut Vec<u8>, rng: &mut ChaCha8Rng) -> String {
    let (header, data) = header_and_data(bytes);
    *bytes = with_header(&mutate(&header, rng), data);
    "mutated the header".to_owned()
}

/// A safetensors file without the hash of its contents, as other programs write it.
pub fn without_hash(bytes: &[u8]) -> Vec<u8> {
    let (mut header, data) = header_and_data(bytes);
    let key = r#",\"hash\":\""#;
    let start = header.find(key).expect("a file of surrogate has a hash");
    let end = header[start + key.len()..].find(r#"\""#).expect("the hash ends") + start + key.len();
    header.replace_range(start..end + 2, "");
    with_header(header.as_bytes(), data)
}

/// The JSON of a safetensors file, which follows its length, and all else.
fn header_and_data(bytes: &[u8]) -> (String, &[u8]) {
    let (length, rest) = bytes.split_first_chunk().expect("a file has a header");
    let (header, data) = rest.split_at(u64::from_le_bytes(*length) as usize);
    (String::from_utf8_lossy(header).into_owned(), data)
}

fn with_header(header: &[u8], data: &[u8]) -> Vec<u8> {
    [&(header.len() as u64).to_le_bytes()[..], header, data].concat()
}

/// Changes an object of an HDF5 file.
pub fn mutate_hdf5(path: &Path, rng: &mut ChaCha8Rng) -> hdf5::Result<String> {
    let file = File::open_rw(path)?;
    let mut found = Vec::new();
    collect(&file, "", &mut found)?;
    let (name, is_group) = found[rng.random_range(0..found.len())].clone();
    match rng.random_range(0..10) {
        0 => {
            file.unlink(&name)?;
            Ok(format!("removed {name}"))
        }
        1 => {
            let (other, _) = found[rng.random_range(0..found.len())].clone();
            file.unlink(&name)?;
            file.link_soft(&other, &name)?;
            Ok(format!("linked {name} to {other}"))
        }
        2..5 => {
            let place: Location = if is_group || rng.random_bool(0.5) {
                (*file.group(if is_group { &name } else { "/" })?).clone()
            } else {
                (**file.dataset(&name)?).clone()
            };
            change_attribute(&place, rng)
        }
        _ if is_group => {
            file.unlink(&name)?;
            create::<f64>(&file, &name, rng)
        }
        5 => {
            file.unlink(&name)?;
            match rng.random_range(0..4) {
                0 => create::<f64>(&file, &name, rng),
                1 => create::<f32>(&file, &name, rng),
                2 => create::<i64>(&file, &name, rng),
                _ => create::<u8>(&file, &name, rng),
            }
        }
        6 => {
            let dataset = file.dataset(&name)?;
            let mut shape = dataset.shape();
            if let Some(axis) = (!shape.is_empty()).then(|| rng.random_range(0..shape.len())) {
                shape[axis] = one(&[0, 1, shape[axis] + 1, 1 << 20, 1 << 40], rng);
            }
            dataset.resize(shape.clone())?;
            Ok(format!("resized {name} to {shape:?}"))
        }
        _ => {
            let value = one(&NUMBERS, rng);
            let place = write_number(&file.dataset(&name)?, value, rng)?;
            Ok(format!("wrote {value} at place {place} of {name}"))
        }
    }
}

/// Names of everything below a group, and whether they are groups.
fn collect(group: &Group, before: &str, found: &mut Vec<(String, bool)>) -> hdf5::Result<()> {
    for name in group.member_names()? {
        let path = format!("{before}/{name}");
        let inner = group.group(&name);
        found.push((path.clone(), inner.is_ok()));
        if let Ok(inner) = inner {
            collect(&inner, &path, found)?;
        }
    }
    Ok(())
}

/// Replaces or removes an attribute.
fn change_attribute(place: &Location, rng: &mut ChaCha8Rng) -> hdf5::Result<String> {
    let names = place.attr_names()?;
    if names.is_empty() {
        return Ok("nothing".to_owned());
    }
    let name = &names[rng.random_range(0..names.len())];
    place.delete_attr(name)?;
    let number = one(&NUMBERS, rng);
    match rng.random_range(0..6) {
        0 => return Ok(format!("removed {name} of {}", place.name())),
        1 => place.new_attr::<u64>().create(&**name)?.write_scalar(&u64::MAX)?,
        2 => {
            let text: hdf5::types::VarLenUnicode =
                "a\u{1b}[2J = [text]\n".parse().expect("a text without zeros");
            place.new_attr::<hdf5::types::VarLenUnicode>().create(&**name)?.write_scalar(&text)?;
        }
        3 => {
            let pair = ndarray::arr1(&[number, one(&NUMBERS, rng)]);
            place.new_attr_builder().with_data(&pair).create(&**name)?;
        }
        _ => place.new_attr::<f64>().create(&**name)?.write_scalar(&number)?,
    }
    Ok(format!("changed {name} of {}", place.name()))
}

/// Creates a dataset of another shape.
fn create<T: H5Type + Default + Clone>(
    file: &File,
    name: &str,
    rng: &mut ChaCha8Rng,
) -> hdf5::Result<String> {
    let sides = rng.random_range(0..4);
    let shape: Vec<usize> = (0..sides).map(|_| one(&[0, 1, 2, 4, 8, 21], rng)).collect();
    let values = ArrayD::from_elem(IxDyn(&shape), T::default());
    file.new_dataset_builder().with_data(&values).create(name)?;
    Ok(format!("made {name} anew, of shape {shape:?}"))
}

/// Writes a number into a dataset; the place.
fn write_number(dataset: &Dataset, value: f64, rng: &mut ChaCha8Rng) -> hdf5::Result<usize> {
    let mut values: ArrayD<f64> = dataset.read_dyn()?;
    if values.is_empty() {
        return Ok(0);
    }
    let place = rng.random_range(0..values.len());
    if let Some(number) = values.iter_mut().nth(place) {
        *number = value;
    }
    dataset.write(&values)?;
    Ok(place)
}
