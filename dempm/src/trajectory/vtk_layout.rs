//! The parts of a VTKHDF file of points over time that do not depend on where the numbers are.

use hdf5::types::FixedAscii;
use hdf5::{Group, H5Type};
use ndarray::{Array1, Array2, ArrayView1};

/// The version of the VTKHDF specification that is written; 2.0 brought `PolyData` and time.
const VERSION: [i64; 2] = [2, 0];

/// The root group.
pub(crate) const ROOT: &str = "VTKHDF";

/// Creates the root group of a `PolyData`.
pub(crate) fn create_root(file: &Group) -> hdf5::Result<Group> {
    let root = new_group(file, ROOT)?;
    root.new_attr_builder().with_data(ArrayView1::from(&VERSION)).create("Version")?;
    let kind = FixedAscii::<8>::from_ascii(b"PolyData")
        .map_err(|error| hdf5::Error::from(error.to_string()))?;
    root.new_attr::<FixedAscii<8>>().create("Type")?.write_scalar(&kind)?;
    Ok(root)
}

/// One vertex per point; the other cells of a `PolyData` are empty.
pub(crate) fn write_cells(root: &Group, points: usize) -> hdf5::Result<()> {
    let count = |n: usize| Array1::from_elem(1, n as i64);
    store(root, "NumberOfPoints", &count(points))?;
    for (name, cells) in [("Vertices", points), ("Lines", 0), ("Polygons", 0), ("Strips", 0)] {
        let group = new_group(root, name)?;
        store(&group, "NumberOfCells", &count(cells))?;
        store(&group, "NumberOfConnectivityIds", &count(cells))?;
        store(&group, "Connectivity", &Array1::from_iter(0..cells as i64))?;
        store(&group, "Offsets", &Array1::from_iter(0..=cells as i64))?;
    }
    Ok(())
}

/// The beginning of each frame in the arrays: those of `series` have one part a frame, those of `fixed` are
/// the same in all. All frames share the same cells. The times are left to the caller: `Steps/Values`.
pub(crate) fn write_steps(
    root: &Group,
    frames: usize,
    points: usize,
    series: &[&str],
    fixed: &[&str],
) -> hdf5::Result<()> {
    let steps = new_group(root, "Steps")?;
    steps.new_attr::<i64>().create("NSteps")?.write_scalar(&(frames as i64))?;
    let first = Array1::from_iter((0..frames).map(|frame| (frame * points) as i64));
    let zero = Array1::<i64>::zeros(frames);
    let zeros = Array2::<i64>::zeros((frames, 4));
    store(&steps, "NumberOfParts", &Array1::<i64>::ones(frames))?;
    store(&steps, "PartOffsets", &zero)?;
    store(&steps, "PointOffsets", &first)?;
    store(&steps, "CellOffsets", &zeros)?;
    store(&steps, "ConnectivityIdOffsets", &zeros)?;
    let offsets = new_group(&steps, "PointDataOffsets")?;
    for name in series {
        store(&offsets, name, &first)?;
    }
    for name in fixed {
        store(&offsets, name, &zero)?;
    }
    Ok(())
}

/// Writes an array without time stamps.
pub(crate) fn store<T: H5Type, D: ndarray::Dimension>(
    group: &Group,
    name: &str,
    values: &ndarray::Array<T, D>,
) -> hdf5::Result<()> {
    group.new_dataset_builder().with_data(values).obj_track_times(false).create(name)?;
    Ok(())
}

/// Creates a group without time stamps.
pub(crate) fn new_group(parent: &Group, name: &str) -> hdf5::Result<Group> {
    parent.create_group_builder().obj_track_times(false).create(name)
}
