//! What a trajectory says about the run that made it, kept as attributes of the file.

use std::collections::BTreeMap;
use std::str::FromStr;

use hdf5::types::{FixedAscii, FixedUnicode, TypeDescriptor, VarLenAscii, VarLenUnicode};
use hdf5::{Group, H5Type, Location};
use ndarray::{Array1, ArrayView1};

use super::layout::{FORMAT, FORMAT_VERSION};

/// The run: enough to repeat it and to read its numbers.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Header {
    /// The title of the scene.
    pub title: String,
    /// The text of the scene file (TOML).
    pub scene: String,
    /// The seed of the random numbers.
    pub seed: u64,
    /// When the run began, UTC, ISO 8601; see [`files::utc_now`].
    pub created: String,
    /// Versions of the programs and libraries that made it, such as `dempm` -> `0.1.0`.
    pub versions: BTreeMap<String, String>,
    /// What it ran on, such as `cpu, 16 threads` or the name of a GPU.
    pub device: String,
    /// The precision of the computation, such as `f64`.
    pub precision: String,
    /// The material of the points, such as `rve` or `drucker-prager`.
    pub material: String,
    /// Size of the domain along x and y, m; its corner is at the origin.
    pub domain: [f64; 2],
    /// Gravity, m/s^2.
    pub gravity: [f64; 2],
    /// Edge of a cell of the background grid, m.
    pub grid_cell: f64,
    /// Initial distance between neighbouring material points, m.
    pub point_spacing: f64,
    /// Macroscopic time step, s.
    pub time_step: f64,
    /// Time between frames, s.
    pub frame_interval: f64,
    /// Further numbers of the run under the scene's own names, SI units.
    pub parameters: BTreeMap<String, f64>,
    /// Walls that never move: segments (x1, y1, x2, y2), m.
    pub walls: Vec<[f64; 4]>,
}

impl Header {
    /// Writes the attributes to the root group of a new file.
    pub(super) fn write(&self, root: &Group) -> hdf5::Result<()> {
        write_text(root, "format", FORMAT)?;
        write_scalar(root, "format_version", &FORMAT_VERSION)?;
        for (name, text) in [
            ("title", &self.title),
            ("scene", &self.scene),
            ("created", &self.created),
            ("device", &self.device),
            ("precision", &self.precision),
            ("material", &self.material),
        ] {
            write_text(root, name, text)?;
        }
        write_scalar(root, "seed", &self.seed)?;
        write_scalar(root, "dimensions", &2_u64)?;
        for (name, number) in [
            ("grid_cell", self.grid_cell),
            ("point_spacing", self.point_spacing),
            ("time_step", self.time_step),
            ("frame_interval", self.frame_interval),
        ] {
            write_scalar(root, name, &number)?;
        }
        for (name, vector) in [("domain", &self.domain), ("gravity", &self.gravity)] {
            root.new_attr_builder().with_data(ArrayView1::from(vector)).create(name)?;
        }
        let versions = super::writer::new_group(root, "versions")?;
        for (name, version) in &self.versions {
            write_text(&versions, name, version)?;
        }
        let parameters = super::writer::new_group(root, "parameters")?;
        for (name, number) in &self.parameters {
            write_scalar(&parameters, name, number)?;
        }
        Ok(())
    }

    /// Reads the attributes; the walls are a dataset and are left empty.
    ///
    /// On failure the name of the attribute comes with the error.
    pub(super) fn read(root: &Group) -> Result<Self, (String, hdf5::Error)> {
        let text = |name: &str| read_text(root, name).map_err(|error| (name.to_owned(), error));
        let number =
            |name: &str| read_scalar::<f64>(root, name).map_err(|error| (name.to_owned(), error));
        let pair = |name: &str| read_pair(root, name).map_err(|error| (name.to_owned(), error));
        let group = |name: &str| root.group(name).map_err(|error| (name.to_owned(), error));
        Ok(Self {
            title: text("title")?,
            scene: text("scene")?,
            seed: read_scalar(root, "seed").map_err(|error| ("seed".to_owned(), error))?,
            created: text("created")?,
            versions: read_all(&group("versions")?, read_text)?,
            device: text("device")?,
            precision: text("precision")?,
            material: text("material")?,
            domain: pair("domain")?,
            gravity: pair("gravity")?,
            grid_cell: number("grid_cell")?,
            point_spacing: number("point_spacing")?,
            time_step: number("time_step")?,
            frame_interval: number("frame_interval")?,
            parameters: read_all(&group("parameters")?, read_scalar)?,
            walls: Vec::new(),
        })
    }
}

/// The longest text attribute, bytes.
const LONGEST_TEXT: usize = 65_536;

/// Writes a text attribute, in place of an older one of that name.
///
/// Strings of fixed length lie in the object's header, which has a checksum. Those of variable
/// length lie in a heap without one, where a flipped bit can send the library round in circles.
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

/// Writes a scalar attribute, in place of an older one of that name.
pub(super) fn write_scalar<T: H5Type>(place: &Location, name: &str, value: &T) -> hdf5::Result<()> {
    remove(place, name)?;
    place.new_attr::<T>().create(name)?.write_scalar(value)
}

fn remove(place: &Location, name: &str) -> hdf5::Result<()> {
    if place.attr(name).is_ok() { place.delete_attr(name) } else { Ok(()) }
}

/// Reads a text attribute: of fixed length as we write it, or variable as h5py does.
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

fn read_pair(place: &Location, name: &str) -> hdf5::Result<[f64; 2]> {
    let attribute = place.attr(name)?;
    if attribute.shape() != [2] {
        return Err(format!("has shape {:?}, expected [2]", attribute.shape()).into());
    }
    let values: Array1<f64> = attribute.read_1d()?;
    Ok([values[0], values[1]])
}

/// Reads all attributes of a group that is used as a table.
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
