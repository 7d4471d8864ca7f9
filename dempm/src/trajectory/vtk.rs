//! `/VTKHDF`: a view of the same data in the shapes that ParaView expects, in the blocks `points`, `walls`
//! and `boxes`.
//!
//! Nothing is stored twice. VTKHDF has one array over all frames with three components, (frames *
//! points, 3), the trajectory (frames, points, 2): a virtual dataset maps one to the other, with zeros
//! for the third component. Static arrays and the time are soft links. The small group is replaced at
//! each commit, as a virtual dataset cannot follow two growing axes.

use hdf5::{Extents, File, Group, H5Type, Hyperslab, SliceOrIndex};

use super::layout::{BOXES, COLUMN, Field, MASS, TIME, WALLS};
use super::links::{self, new_group};
use super::vtk_layout::{
    CORNERS, Cells, ENDS, ROOT as GROUP, create_block, create_root, write_steps,
};

/// Writes `/VTKHDF` for a file with `frames` frames, replacing an older one.
pub(super) fn write(file: &File, frames: usize, points: usize) -> hdf5::Result<()> {
    if links::exists(file, GROUP)? {
        file.unlink(GROUP)?;
    }
    if frames == 0 {
        return Ok(());
    }
    let root = create_root(file)?;
    write_points(file, &root, frames, points)?;
    if links::exists(file, WALLS)? {
        let walls = file.dataset(WALLS)?.shape()[0];
        write_outlines(file, &root, frames, "walls", WALLS, Cells::Lines(walls))?;
    }
    if links::exists(file, BOXES)? {
        let boxes = file.dataset(BOXES)?.shape()[1];
        write_outlines(file, &root, frames, "boxes", BOXES, Cells::Rectangles(boxes))?;
    }
    Ok(())
}

/// The material points with their fields.
fn write_points(file: &File, root: &Group, frames: usize, points: usize) -> hdf5::Result<()> {
    let block = create_block(root, "points", Cells::Vertices(points))?;
    let map = Map { file, rows: frames * points };
    let position = Field::Position.name();
    map.create::<f64>(&block, "Points", position, &plane(0, 1, [0, 1]), Some(3))?;

    let data = new_group(&block, "PointData")?;
    let velocity = Field::Velocity.name();
    map.create::<f64>(&data, velocity, velocity, &plane(0, 1, [0, 1]), Some(3))?;
    let mut series = vec![velocity];
    for field in Field::OPTIONAL {
        if !links::exists(file, field.name())? {
            continue;
        }
        if field == Field::Stress {
            // xx, xy, yx, yy in a tensor of 3 x 3.
            let columns = [(0, 0), (1, 1), (2, 3), (3, 4)];
            let parts = columns.map(|(from, to)| Part { from, to, first: 0, every: 1 });
            map.create::<f32>(&data, field.name(), field.name(), &parts, Some(9))?;
        } else {
            map.create::<f32>(&data, field.name(), field.name(), &[], None)?;
        }
        series.push(field.name());
    }
    let mut fixed = Vec::new();
    for (source, name) in [(MASS, "mass"), (COLUMN, "column")] {
        data.link_soft(&format!("/{source}"), name)?;
        fixed.push(name);
    }
    write_steps(&block, frames, Some(points), &series, &fixed)?;
    block.group("Steps")?.link_soft(&format!("/{TIME}"), "Values")
}

/// Walls or boxes: cells whose points are among four numbers each. Boxes move.
fn write_outlines(
    file: &File,
    root: &Group,
    frames: usize,
    name: &str,
    source: &str,
    cells: Cells,
) -> hdf5::Result<()> {
    let block = create_block(root, name, cells)?;
    let (places, moving): (&[[usize; 2]], bool) = match cells {
        Cells::Rectangles(_) => (&CORNERS, true),
        _ => (&ENDS, false),
    };
    let rows = if moving { frames * cells.points() } else { cells.points() };
    let corners = places.iter().enumerate();
    let parts: Vec<Part> = corners.flat_map(|(k, &xy)| plane(k, places.len(), xy)).collect();
    Map { file, rows }.create::<f64>(&block, "Points", source, &parts, Some(3))?;
    write_steps(&block, frames, moving.then_some(cells.points()), &[], &[])?;
    block.group("Steps")?.link_soft(&format!("/{TIME}"), "Values")
}

/// A component of the source, and where it goes: a column, and every `every`-th row from `first` on.
#[derive(Clone, Copy)]
struct Part {
    from: usize,
    to: usize,
    first: usize,
    every: usize,
}

/// x and y of a vector from two components of the source.
fn plane(first: usize, every: usize, xy: [usize; 2]) -> [Part; 2] {
    [Part { from: xy[0], to: 0, first, every }, Part { from: xy[1], to: 1, first, every }]
}

/// Maps datasets over frames, points and components to ones with so many rows.
struct Map<'a> {
    file: &'a File,
    rows: usize,
}

impl Map<'_> {
    /// Creates a virtual dataset of `width` columns, filled by `parts`, the rest zero; without parts, of
    /// all values in their order.
    fn create<T: H5Type>(
        &self,
        group: &Group,
        name: &str,
        source: &str,
        parts: &[Part],
        width: Option<usize>,
    ) -> hdf5::Result<()> {
        let source_shape = self.file.dataset(source)?.shape();
        let shape: Vec<usize> = std::iter::once(self.rows).chain(width).collect();
        let extents = |shape: &[usize]| Extents::from(shape.to_vec());
        // "." is the file itself, whatever its name.
        let path = format!("/{source}");
        let mut builder = group.new_dataset::<T>().obj_track_times(false);
        if parts.is_empty() {
            builder =
                builder.virtual_map(".", &path, extents(&source_shape), .., extents(&shape), ..);
        }
        for part in parts {
            let mut from: Vec<SliceOrIndex> = vec![(..).into(); source_shape.len() - 1];
            from.push((part.from..part.from + 1).into());
            let rows = SliceOrIndex::SliceCount {
                start: part.first,
                step: part.every,
                count: self.rows / part.every,
                block: 1,
            };
            let to = Hyperslab::new(vec![rows, (part.to..part.to + 1).into()]);
            builder = builder.virtual_map(
                ".",
                &path,
                extents(&source_shape),
                Hyperslab::new(from),
                extents(&shape),
                to,
            );
        }
        builder.shape(extents(&shape)).create(name)?;
        Ok(())
    }
}
