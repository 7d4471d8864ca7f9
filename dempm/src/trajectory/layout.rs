//! Names, shapes and storage of the datasets.

use hdf5::file::FileAccessBuilder;
use hdf5::{Dataset, Extent, Group, H5Type, SimpleExtents};
use ndarray::{ArrayView, IxDyn};

use super::frame::{Frame, FrameShape};

/// The attribute `format` of every trajectory file.
pub const FORMAT: &str = "DEMPM trajectory";
/// The attribute `format_version` of files written by this version.
pub const FORMAT_VERSION: u64 = 1;

pub(super) const TIME: &str = "time";
pub(super) const MASS: &str = "points/mass";
pub(super) const COLUMN: &str = "points/column";
pub(super) const WALLS: &str = "boundary/walls";
pub(super) const BOXES: &str = "boundary/boxes";
pub(super) const BUDGET: &str = "budget";
pub(super) const WALL_TIME: &str = "wall_time";
pub(super) const WARNINGS: &str = "warnings";

/// Turns HDF5's file locks off. No file is changed under its own name, so there is nothing to lock. A
/// lock can outlive its owner (a process forked while the file is open inherits it), and network file
/// systems often have none.
pub(crate) fn unlocked(access: &mut FileAccessBuilder) -> &mut FileAccessBuilder {
    access.file_locking(false)
}

/// A quantity at every point and frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Field {
    /// Position, m.
    Position,
    /// Velocity, m/s.
    Velocity,
    /// Cauchy stress, Pa, tension positive.
    Stress,
    /// Solid fraction.
    SolidFraction,
    /// Coordination number.
    Coordination,
    /// Inertial number.
    InertialNumber,
}

impl Field {
    /// All fields, in the order of lists.
    pub const ALL: [Self; 6] = [
        Self::Position,
        Self::Velocity,
        Self::Stress,
        Self::SolidFraction,
        Self::Coordination,
        Self::InertialNumber,
    ];
    /// Fields that a scene may omit.
    pub const OPTIONAL: [Self; 4] =
        [Self::Stress, Self::SolidFraction, Self::Coordination, Self::InertialNumber];

    /// The name of the dataset.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Position => "position",
            Self::Velocity => "velocity",
            Self::Stress => "stress",
            Self::SolidFraction => "solid_fraction",
            Self::Coordination => "coordination",
            Self::InertialNumber => "inertial_number",
        }
    }

    /// The names of the components; one for a scalar.
    pub const fn components(self) -> &'static [&'static str] {
        match self {
            Self::Position | Self::Velocity => &["x", "y"],
            Self::Stress => &["xx", "xy", "yx", "yy"],
            Self::SolidFraction | Self::Coordination | Self::InertialNumber => &[""],
        }
    }

    /// The unit; empty for a pure number.
    pub const fn unit(self) -> &'static str {
        match self {
            Self::Position => "m",
            Self::Velocity => "m/s",
            Self::Stress => "Pa",
            Self::SolidFraction | Self::Coordination | Self::InertialNumber => "",
        }
    }

    /// The shape of the dataset: (frames, points) for a scalar, else (frames, points, components).
    pub fn shape(self, frames: usize, points: usize) -> Vec<usize> {
        match self.components().len() {
            1 => vec![frames, points],
            components => vec![frames, points, components],
        }
    }
}

impl Frame {
    /// The shape that the frames of this trajectory share.
    pub(super) fn shape(&self) -> FrameShape {
        let mut fields = Vec::new();
        for field in Field::OPTIONAL {
            let present = match field {
                Field::Stress => self.stress.is_some(),
                _ => self.scalar(field).is_some(),
            };
            if present {
                fields.push(field.name());
            }
        }
        FrameShape {
            fields,
            boxes: self.boxes.len(),
            budget: self.budget.keys().cloned().collect(),
        }
    }

    /// A scalar field, one value a point; `None` if it is absent or not a scalar.
    pub fn scalar(&self, field: Field) -> Option<&[f32]> {
        match field {
            Field::SolidFraction => self.solid_fraction.as_deref(),
            Field::Coordination => self.coordination.as_deref(),
            Field::InertialNumber => self.inertial_number.as_deref(),
            Field::Position | Field::Velocity | Field::Stress => None,
        }
    }

    /// Mutable access to an optional scalar field's place.
    pub(super) fn scalar_mut(&mut self, field: Field) -> Option<&mut Option<Vec<f32>>> {
        match field {
            Field::SolidFraction => Some(&mut self.solid_fraction),
            Field::Coordination => Some(&mut self.coordination),
            Field::InertialNumber => Some(&mut self.inertial_number),
            Field::Position | Field::Velocity | Field::Stress => None,
        }
    }
}

/// Frames in a chunk of a scalar: a chunk of one 8-byte value would cost more than it holds.
const SCALARS_PER_CHUNK: usize = 1024;

/// Creates an empty dataset that grows along the frames: shape (0, `inner`...).
///
/// One chunk per frame: a window of frames is read without touching the others. Shuffle groups bytes of
/// equal significance for deflate, and Fletcher's checksum reveals damaged chunks.
pub(super) fn create_growing<T: H5Type>(
    group: &Group,
    name: &str,
    inner: &[usize],
) -> hdf5::Result<Dataset> {
    let mut extents = vec![Extent::new(0, None)];
    extents.extend(inner.iter().map(|&size| Extent::fixed(size)));
    let mut chunk = vec![if inner.is_empty() { SCALARS_PER_CHUNK } else { 1 }];
    // A chunk has at least one element, also in a dataset over no boxes.
    chunk.extend(inner.iter().map(|&size| size.max(1)));
    group
        .new_dataset::<T>()
        .chunk(chunk)
        .shuffle()
        .deflate(4)
        .fletcher32()
        .obj_track_times(false)
        .shape(SimpleExtents::new(extents))
        .create(name)
}

/// Sets the number of frames of a growing dataset.
pub(super) fn set_frames(dataset: &Dataset, frames: usize) -> hdf5::Result<()> {
    let mut shape = dataset.shape();
    if let Some(first) = shape.first_mut() {
        *first = frames;
    }
    dataset.resize(shape)
}

/// Writes frames of a growing dataset that is already long enough; `values` are in C order.
pub(super) fn write_frames<T: H5Type>(
    dataset: &Dataset,
    frames: std::ops::Range<usize>,
    values: &[T],
) -> hdf5::Result<()> {
    let mut shape = dataset.shape();
    if values.is_empty() || shape.is_empty() {
        return Ok(());
    }
    shape[0] = frames.len();
    let view = ArrayView::from_shape(shape.as_slice(), values)
        .map_err(|error| hdf5::Error::from(error.to_string()))?;
    dataset.write_slice(view, frame_selection(frames, shape.len()))
}

/// Reads one frame of a dataset.
pub(super) fn read_frame<T: H5Type>(dataset: &Dataset, index: usize) -> hdf5::Result<Vec<T>> {
    let one = frame_selection(index..index + 1, dataset.ndim());
    Ok(dataset.read_slice::<T, _, IxDyn>(one)?.into_raw_vec_and_offset().0)
}

/// Selects a range of frames of a dataset with `rank` dimensions.
pub(super) fn frame_selection(frames: std::ops::Range<usize>, rank: usize) -> hdf5::Hyperslab {
    let mut slices: Vec<hdf5::SliceOrIndex> = vec![frames.into()];
    slices.resize(rank, (..).into());
    hdf5::Hyperslab::new(slices)
}

/// Creates a group without time stamps.
pub(super) fn new_group(parent: &Group, name: &str) -> hdf5::Result<Group> {
    parent.create_group_builder().obj_track_times(false).create(name)
}

/// Writes a compressed dataset of fixed shape in one chunk; an empty one is left out.
pub(super) fn write_whole<T: H5Type>(
    group: &Group,
    name: &str,
    shape: &[usize],
    values: &[T],
) -> hdf5::Result<()> {
    if values.is_empty() {
        return Ok(());
    }
    let view = ArrayView::from_shape(shape, values)
        .map_err(|error| hdf5::Error::from(error.to_string()))?;
    group
        .new_dataset_builder()
        .with_data(view)
        .chunk(shape.to_vec())
        .shuffle()
        .deflate(4)
        .fletcher32()
        .obj_track_times(false)
        .create(name)?;
    Ok(())
}
