//! Storage of datasets: chunks, compression, checksums, and what the numbers mean.

use hdf5::{Dataset, Extent, Group, H5Type, SimpleExtents};
use ndarray::{ArrayView, IxDyn};

use super::meaning::Meaning;
use super::texts::write_note;

/// Frames in a chunk of a scalar: a chunk of one 8-byte value would cost more than it holds.
const SCALARS_PER_CHUNK: usize = 1024;
/// Level of compression: higher ones save little and take long.
pub(super) const DEFLATE_LEVEL: u8 = 4;

/// Creates an empty dataset that grows along the frames: shape (0, `inner`...).
///
/// One chunk per frame: a window of frames is read without touching the others. Shuffle groups bytes of
/// equal significance for deflate, and Fletcher's checksum reveals damaged chunks.
pub(super) fn create_growing<T: H5Type>(
    group: &Group,
    name: &str,
    inner: &[usize],
    meaning: Meaning,
) -> hdf5::Result<Dataset> {
    let mut extents = vec![Extent::new(0, None)];
    extents.extend(inner.iter().map(|&size| Extent::fixed(size)));
    let mut chunk = vec![if inner.is_empty() { SCALARS_PER_CHUNK } else { 1 }];
    // A chunk has at least one element, also in a dataset over no boxes.
    chunk.extend(inner.iter().map(|&size| size.max(1)));
    let dataset = group
        .new_dataset::<T>()
        .chunk(chunk)
        .shuffle()
        .deflate(DEFLATE_LEVEL)
        .fletcher32()
        .obj_track_times(false)
        .shape(SimpleExtents::new(extents))
        .create(name)?;
    describe(&dataset, meaning)?;
    Ok(dataset)
}

/// Sets the number of frames of a growing dataset.
pub(super) fn set_frames(dataset: &Dataset, frames: usize) -> hdf5::Result<()> {
    let mut shape = dataset.shape();
    if let Some(first) = shape.first_mut() {
        *first = frames;
    }
    dataset.resize(shape)
}

/// Writes frames of a growing dataset that is already long enough; `values` are in C order. Whole frames of points,
/// grains or nodes are packed faster as [`Values`](super::chunk::Values).
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

/// Writes a compressed dataset of fixed shape in one chunk; an empty one is left out.
pub(super) fn write_whole<T: H5Type>(
    group: &Group,
    name: &str,
    shape: &[usize],
    values: &[T],
    meaning: Meaning,
) -> hdf5::Result<()> {
    if values.is_empty() {
        return Ok(());
    }
    let view = ArrayView::from_shape(shape, values)
        .map_err(|error| hdf5::Error::from(error.to_string()))?;
    let dataset = group
        .new_dataset_builder()
        .with_data(view)
        .chunk(shape.to_vec())
        .shuffle()
        .deflate(DEFLATE_LEVEL)
        .fletcher32()
        .obj_track_times(false)
        .create(name)?;
    describe(&dataset, meaning)
}

fn describe(dataset: &Dataset, meaning: Meaning) -> hdf5::Result<()> {
    write_note(dataset, "units", meaning.units)?;
    write_note(dataset, "description", meaning.description)
}
