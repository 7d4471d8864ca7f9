//! The parts of a VTKHDF file of bodies over time that do not depend on where the numbers are.

use hdf5::plist::group_create::LinkCreationOrder;
use hdf5::types::FixedAscii;
use hdf5::{Group, H5Type};
use ndarray::{Array1, Array2, ArrayView1};

use super::links::new_group;

/// The version of the VTKHDF specification that is written; 2.1 brought collections.
const VERSION: [i64; 2] = [2, 1];

/// The root group.
pub(crate) const ROOT: &str = "VTKHDF";
/// The group of links that orders the blocks.
const ASSEMBLY: &str = "Assembly";

/// x and y of the corners of a rectangle among its four numbers, counter-clockwise.
pub(crate) const CORNERS: [[usize; 2]; 4] = [[0, 1], [2, 1], [2, 3], [0, 3]];
/// x and y of the ends of a segment among its four numbers.
pub(crate) const ENDS: [[usize; 2]; 2] = [[0, 1], [2, 3]];

/// The cells of a block.
#[derive(Clone, Copy)]
pub(crate) enum Cells {
    /// One vertex a point.
    Vertices(usize),
    /// Lines of two points.
    Lines(usize),
    /// Polygons of four points.
    Rectangles(usize),
}

impl Cells {
    /// Name in a `PolyData`, number of cells, points of each.
    fn layout(self) -> (&'static str, usize, usize) {
        match self {
            Self::Vertices(count) => ("Vertices", count, 1),
            Self::Lines(count) => ("Lines", count, 2),
            Self::Rectangles(count) => ("Polygons", count, 4),
        }
    }

    /// The number of points. No two cells share one.
    pub fn points(self) -> usize {
        let (_, count, nodes) = self.layout();
        count * nodes
    }
}

/// Creates the root group: a collection of blocks.
pub(crate) fn create_root(file: &Group) -> hdf5::Result<Group> {
    let root = ordered_group(file, ROOT)?;
    write_type(&root, b"PartitionedDataSetCollection")?;
    ordered_group(&root, ASSEMBLY)?;
    Ok(root)
}

/// Creates a block of the collection, a `PolyData` of `cells`; the points are left to the caller.
pub(crate) fn create_block(root: &Group, name: &str, cells: Cells) -> hdf5::Result<Group> {
    let assembly = root.group(ASSEMBLY)?;
    let index = assembly.len() as i64;
    let block = new_group(root, name)?;
    write_type(&block, b"PolyData")?;
    block.new_attr::<i64>().create("Index")?.write_scalar(&index)?;
    assembly.link_soft(&format!("/{ROOT}/{name}"), name)?;

    let count = |n: usize| Array1::from_elem(1, n as i64);
    store(&block, "NumberOfPoints", &count(cells.points()))?;
    let (kind, number, nodes) = cells.layout();
    for name in ["Vertices", "Lines", "Polygons", "Strips"] {
        let number = if name == kind { number } else { 0 };
        let ids = (number * nodes) as i64;
        let group = new_group(&block, name)?;
        store(&group, "NumberOfCells", &count(number))?;
        store(&group, "NumberOfConnectivityIds", &count(number * nodes))?;
        store(&group, "Connectivity", &Array1::from_iter(0..ids))?;
        store(&group, "Offsets", &Array1::from_iter((0..=ids).step_by(nodes)))?;
    }
    Ok(block)
}

/// The beginning of each frame in the arrays of a block. Points and the arrays of `series` have one part
/// of so many `points` a frame, or one for all frames without `points`; those of `fixed` have one for all.
/// All frames share the same cells. The times are left to the caller: `Steps/Values`.
pub(crate) fn write_steps(
    block: &Group,
    frames: usize,
    points: Option<usize>,
    series: &[&str],
    fixed: &[&str],
) -> hdf5::Result<()> {
    let steps = new_group(block, "Steps")?;
    steps.new_attr::<i64>().create("NSteps")?.write_scalar(&(frames as i64))?;
    let first = Array1::from_iter((0..frames).map(|frame| (frame * points.unwrap_or(0)) as i64));
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

fn write_type(group: &Group, kind: &[u8]) -> hdf5::Result<()> {
    group.new_attr_builder().with_data(ArrayView1::from(&VERSION)).create("Version")?;
    // VTK reads texts of fixed length here.
    let value =
        FixedAscii::<32>::from_ascii(kind).map_err(|error| hdf5::Error::from(error.to_string()))?;
    let exact = hdf5::types::TypeDescriptor::FixedAscii(kind.len());
    group.new_attr_builder().empty_as(exact).create("Type")?.write_scalar(&value)
}

/// VTK goes through these groups in the order of creation.
fn ordered_group(parent: &Group, name: &str) -> hdf5::Result<Group> {
    parent
        .create_group_builder()
        .obj_track_times(false)
        .with_gcpl(|create| create.link_creation_order(LinkCreationOrder::Indexed))
        .create(name)
}
