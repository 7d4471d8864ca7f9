//! The run that made a trajectory, stored as attributes of the file.

use std::collections::BTreeMap;

use hdf5::Group;
use ndarray::ArrayView1;

use super::attributes::{read_all, read_pair, read_scalar, write_scalar};
use super::layout::{FORMAT, FORMAT_VERSION};
use super::links::{self, new_group};
use super::texts::{read_text, write_text};

/// A description of the run: enough to repeat it and to interpret its numbers.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Header {
    /// The title of the scene.
    pub title: String,
    /// The text of the scene file (TOML).
    pub scene: String,
    /// The seed of the random numbers.
    pub seed: u64,
    /// Start of the run, UTC, ISO 8601; see [`files::utc_now`].
    pub created: String,
    /// Versions of the programs that made it, such as `dempm` -> `0.1.0`.
    pub versions: BTreeMap<String, String>,
    /// The processor, such as `cpu, 16 threads` or the name of a GPU.
    pub device: String,
    /// Floating-point precision, such as `f64`.
    pub precision: String,
    /// The material of the points, such as `rve` or `mu-i`.
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
    /// Further parameters of the run in SI units, such as `rve_discs`.
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
        let versions = new_group(root, "versions")?;
        for (name, version) in &self.versions {
            write_text(&versions, name, version)?;
        }
        let parameters = new_group(root, "parameters")?;
        for (name, number) in &self.parameters {
            write_scalar(&parameters, name, number)?;
        }
        Ok(())
    }

    /// Reads the attributes; the walls are a dataset and are left empty.
    ///
    /// Errors come with the name of the attribute.
    pub(super) fn read(root: &Group) -> Result<Self, (String, hdf5::Error)> {
        let text = |name: &str| read_text(root, name).map_err(|error| (name.to_owned(), error));
        let number =
            |name: &str| read_scalar::<f64>(root, name).map_err(|error| (name.to_owned(), error));
        let pair = |name: &str| read_pair(root, name).map_err(|error| (name.to_owned(), error));
        let group = |name: &str| links::group(root, name).map_err(|error| (name.to_owned(), error));
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
            parameters: read_all(&group("parameters")?, |group, name| read_scalar(group, name))?,
            walls: Vec::new(),
        })
    }
}
