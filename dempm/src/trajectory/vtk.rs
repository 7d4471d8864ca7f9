//! `/VTKHDF`: a view of the same data in the shapes that ParaView expects.
//!
//! Nothing is stored twice. VTKHDF has one array over all frames with three components, (frames *
//! points, 3), the trajectory (frames, points, 2): a virtual dataset maps one to the other, with zeros
//! for the third component. Static arrays and the time are hard links. The small group is replaced at
//! each commit, as a virtual dataset cannot follow two growing axes.

use hdf5::{Extents, File, Group, H5Type, Hyperslab, SliceOrIndex};

use super::layout::{COLUMN, Field, MASS, TIME, new_group};
use super::links;
use super::vtk_layout::{ROOT as GROUP, create_root, write_cells, write_steps};

/// Writes `/VTKHDF` for a file with `frames` frames, replacing an older one.
pub(super) fn write(file: &File, frames: usize, points: usize) -> hdf5::Result<()> {
    if links::exists(file, GROUP)? {
        file.unlink(GROUP)?;
    }
    if frames == 0 {
        return Ok(());
    }
    let root = create_root(file)?;
    write_cells(&root, points)?;
    let map = Map { file, frames, points };
    map.create::<f64>(&root, "Points", Field::Position, &[(0, 0), (1, 1)], Some(3))?;

    let data = new_group(&root, "PointData")?;
    let mut series = vec![Field::Velocity.name()];
    map.create::<f64>(&data, Field::Velocity.name(), Field::Velocity, &[(0, 0), (1, 1)], Some(3))?;
    for field in Field::OPTIONAL {
        if !links::exists(file, field.name())? {
            continue;
        }
        if field == Field::Stress {
            // xx, xy, yx, yy in a tensor of 3 x 3.
            let columns = [(0, 0), (1, 1), (2, 3), (3, 4)];
            map.create::<f32>(&data, field.name(), field, &columns, Some(9))?;
        } else {
            map.create::<f32>(&data, field.name(), field, &[], None)?;
        }
        series.push(field.name());
    }
    let mut fixed = Vec::new();
    for (source, name) in [(MASS, "mass"), (COLUMN, "column")] {
        file.link_hard(&format!("/{source}"), &format!("/{GROUP}/PointData/{name}"))?;
        fixed.push(name);
    }
    write_steps(&root, frames, points, &series, &fixed)?;
    file.link_hard(&format!("/{TIME}"), &format!("/{GROUP}/Steps/Values"))
}

/// Maps datasets over (frames, points) to ones over (frames * points).
struct Map<'a> {
    file: &'a File,
    frames: usize,
    points: usize,
}

impl Map<'_> {
    /// Creates a virtual dataset of `width` columns, where each pair of `columns` names a component
    /// of the source and its column here; the others read as zero.
    fn create<T: H5Type>(
        &self,
        group: &Group,
        name: &str,
        field: Field,
        columns: &[(usize, usize)],
        width: Option<usize>,
    ) -> hdf5::Result<()> {
        let rows = self.frames * self.points;
        let source_shape = self.file.dataset(field.name())?.shape();
        let shape: Vec<usize> = std::iter::once(rows).chain(width).collect();
        let extents = |shape: &[usize]| Extents::from(shape.to_vec());
        let column = |rank: usize, column: usize| {
            let mut slices: Vec<SliceOrIndex> = vec![(..).into(); rank - 1];
            slices.push((column..column + 1).into());
            Hyperslab::new(slices)
        };
        // "." is the file itself, whatever its name.
        let path = format!("/{}", field.name());
        let mut builder = group.new_dataset::<T>().obj_track_times(false);
        if columns.is_empty() {
            builder =
                builder.virtual_map(".", &path, extents(&source_shape), .., extents(&shape), ..);
        }
        for &(from, to) in columns {
            builder = builder.virtual_map(
                ".",
                &path,
                extents(&source_shape),
                column(source_shape.len(), from),
                extents(&shape),
                column(shape.len(), to),
            );
        }
        builder.shape(extents(&shape)).create(name)?;
        Ok(())
    }
}
