//! Archives for numpy: a zip file of `.npy` files, named as the datasets of the trajectory.

use std::io::{self, BufWriter, Write};
use std::path::Path;

use files::{OutputFile, refuse_input, write_atomically};
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipWriter};

use super::error::ExportError;
use super::finite::check_finite;
use super::npy::npy_header;
use crate::trajectory::{Field, GridFrame, StaticGrid, Trajectory};

/// Writes all arrays of a trajectory as `.npz`.
///
/// # Errors
/// If the trajectory cannot be read, has positions or velocities that are no numbers, or is itself
/// `output`, or the file cannot be written.
pub fn write(trajectory: &Trajectory, output: &Path) -> Result<(), ExportError> {
    refuse_input(output, [trajectory.path()])?;
    check_finite(trajectory)?;
    write_atomically(output, |temporary| {
        let at = ExportError::at(output);
        let mut file = OutputFile::create(temporary).map_err(&at)?;
        let mut archive = Archive(ZipWriter::new(BufWriter::new(&mut file)));
        write_static(trajectory, &mut archive).map_err(&at)?;
        for field in trajectory.fields() {
            write_field(trajectory, field, &mut archive, output)?;
        }
        if let Some(grid) = trajectory.grid() {
            write_grid(trajectory, grid, &mut archive, output)?;
        }
        let boxes = trajectory.boxes(0..trajectory.frames())?;
        archive.array("boundary_boxes", boxes.shape(), boxes.iter().copied()).map_err(&at)?;
        let mut file = archive.0.finish().map_err(io::Error::from).map_err(&at)?;
        file.flush().map_err(&at)
    })
}

fn write_static<W: Write + io::Seek>(
    trajectory: &Trajectory,
    archive: &mut Archive<W>,
) -> io::Result<()> {
    let (header, points) = (trajectory.header(), trajectory.points());
    let vector = |archive: &mut Archive<W>, name: &str, values: &[f64]| {
        archive.array(name, &[values.len()], values.iter().copied())
    };
    vector(archive, "time", trajectory.time())?;
    vector(archive, "mass", &points.mass)?;
    archive.array("column", &[points.column.len()], points.column.iter().copied())?;
    vector(archive, "domain", &header.domain)?;
    vector(archive, "gravity", &header.gravity)?;
    archive.array(
        "boundary_walls",
        &[header.walls.len(), 4],
        header.walls.as_flattened().iter().copied(),
    )?;
    for (name, values) in trajectory.budget() {
        vector(archive, &format!("budget_{name}"), values)?;
    }
    Ok(())
}

fn write_field<W: Write + io::Seek>(
    trajectory: &Trajectory,
    field: Field,
    archive: &mut Archive<W>,
    output: &Path,
) -> Result<(), ExportError> {
    if Field::OPTIONAL.contains(&field) {
        write_frames::<f32, W>(trajectory, field, archive, output)
    } else {
        write_frames::<f64, W>(trajectory, field, archive, output)
    }
}

fn write_frames<T: Element + hdf5::H5Type, W: Write + io::Seek>(
    trajectory: &Trajectory,
    field: Field,
    archive: &mut Archive<W>,
    output: &Path,
) -> Result<(), ExportError> {
    let at = ExportError::at(output);
    let shape = field.shape(trajectory.frames(), trajectory.points().mass.len());
    archive.begin::<T>(field.name(), &shape).map_err(&at)?;
    for index in 0..trajectory.frames() {
        let frame = trajectory.field::<T>(field, index..index + 1)?;
        archive.values(frame.iter().flatten().copied()).map_err(&at)?;
    }
    Ok(())
}

/// The fields on the grid, array by array.
fn write_grid<W: Write + io::Seek>(
    trajectory: &Trajectory,
    grid: &StaticGrid,
    archive: &mut Archive<W>,
    output: &Path,
) -> Result<(), ExportError> {
    let at = ExportError::at(output);
    let [rows, columns] = [grid.y.len(), grid.x.len()];
    for (name, nodes) in [("grid_x", &grid.x), ("grid_y", &grid.y)] {
        archive.array(name, &[nodes.len()], nodes.iter().copied()).map_err(&at)?;
    }
    type Values = fn(&GridFrame) -> &[f32];
    let fields: [(&str, &[usize], Values); 3] = [
        ("grid_density", &[], |frame| &frame.density),
        ("grid_velocity", &[2], |frame| frame.velocity.as_flattened()),
        ("grid_stress", &[4], |frame| frame.stress.as_flattened()),
    ];
    for (name, components, values) in fields {
        let shape = [&[trajectory.frames(), rows, columns], components].concat();
        archive.begin::<f32>(name, &shape).map_err(&at)?;
        for index in 0..trajectory.frames() {
            if let Some(frame) = trajectory.grid_frame(index)? {
                archive.values(values(&frame).iter().copied()).map_err(&at)?;
            }
        }
    }
    Ok(())
}

/// A number as numpy stores it.
trait Element: Copy {
    /// Its name: little-endian, kind, size.
    const DESCRIPTION: &'static str;
    fn append_to(self, bytes: &mut Vec<u8>);
}

macro_rules! element {
    ($($number:ty => $description:literal),*) => {$(
        impl Element for $number {
            const DESCRIPTION: &'static str = $description;
            fn append_to(self, bytes: &mut Vec<u8>) {
                bytes.extend_from_slice(&self.to_le_bytes());
            }
        }
    )*};
}
element!(f64 => "<f8", f32 => "<f4", u32 => "<u4");

struct Archive<W: Write + io::Seek>(ZipWriter<W>);

impl<W: Write + io::Seek> Archive<W> {
    fn array<T: Element>(
        &mut self,
        name: &str,
        shape: &[usize],
        values: impl Iterator<Item = T>,
    ) -> io::Result<()> {
        self.begin::<T>(name, shape)?;
        self.values(values)
    }

    /// Begins an array.
    fn begin<T: Element>(&mut self, name: &str, shape: &[usize]) -> io::Result<()> {
        let options = SimpleFileOptions::default()
            .compression_method(CompressionMethod::Deflated)
            .large_file(true);
        self.0.start_file(format!("{name}.npy"), options)?;
        self.0.write_all(&npy_header(T::DESCRIPTION, shape))
    }

    fn values<T: Element>(&mut self, values: impl Iterator<Item = T>) -> io::Result<()> {
        let mut bytes = Vec::new();
        for value in values {
            value.append_to(&mut bytes);
        }
        self.0.write_all(&bytes)
    }
}
