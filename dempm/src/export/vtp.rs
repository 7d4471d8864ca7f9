//! VTK's XML files: one `.vtp` of points and one of walls and boxes a frame, and a `.pvd` that gives them
//! their times.

use std::fmt::Write as _;
use std::fs;
use std::ops::Range;
use std::path::Path;

use files::{refuse_input, write_atomically};

use super::error::ExportError;
use super::finite::check_finite;
use super::outlines::{box_corners, wall_ends};
use crate::trajectory::{Field, Frame, Points, Trajectory};

/// Writes `output` (.pvd) and the folder `NAME_frames` of its frames beside it.
///
/// # Errors
/// If the trajectory cannot be read, has positions or velocities that are no numbers, or is itself
/// among the files to write, or a file cannot be written.
pub fn write(trajectory: &Trajectory, output: &Path) -> Result<(), ExportError> {
    let stem = output.file_stem().unwrap_or_default().to_string_lossy();
    let folder = format!("{stem}_frames");
    let frame_files = |index: usize| {
        [format!("{folder}/{index:05}.vtp"), format!("{folder}/{index:05}_boundary.vtp")]
    };
    refuse_input(output, [trajectory.path()])?;
    for file in (0..trajectory.frames()).flat_map(frame_files) {
        refuse_input(&output.with_file_name(file), [trajectory.path()])?;
    }
    check_finite(trajectory)?;
    let mut series = String::from(
        "<?xml version=\"1.0\"?>\n<VTKFile type=\"Collection\" version=\"1.0\">\n<Collection>\n",
    );
    for (index, time) in trajectory.time().iter().enumerate() {
        let points = vtp(&trajectory.frame(index)?, trajectory.points());
        let boundary = boundary(&wall_ends(trajectory), &box_corners(trajectory, index)?);
        let contents = [("points", points), ("boundary", boundary)];
        for (part, (file, (name, content))) in frame_files(index).iter().zip(contents).enumerate() {
            put(&output.with_file_name(file), &content)?;
            // Writing to a string cannot fail.
            let _ = writeln!(
                series,
                "<DataSet timestep=\"{time}\" part=\"{part}\" name=\"{name}\" file=\"{}\"/>",
                escape(file)
            );
        }
    }
    series.push_str("</Collection>\n</VTKFile>\n");
    // Last, so that the series never exists without its frames.
    put(output, series.as_bytes())
}

fn put(path: &Path, bytes: &[u8]) -> Result<(), ExportError> {
    write_atomically(path, |temporary| fs::write(temporary, bytes).map_err(ExportError::at(path)))
}

fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('"', "&quot;")
}

/// A frame as a `.vtp` file: XML that describes arrays, then the arrays as raw bytes.
fn vtp(frame: &Frame, points: &Points) -> Vec<u8> {
    let count = frame.position.len();
    let mut file = Vtp::default();
    file.open("PointData");
    file.array("velocity", "Float64", 3, in_space(&frame.velocity));
    if let Some(stress) = &frame.stress {
        let tensor = |&[xx, xy, yx, yy]: &[f32; 4]| [xx, xy, 0.0, yx, yy, 0.0, 0.0, 0.0, 0.0];
        let bytes = stress.iter().flat_map(tensor).flat_map(f32::to_le_bytes).collect();
        file.array("stress", "Float32", 9, bytes);
    }
    for field in Field::OPTIONAL {
        if let Some(values) = frame.scalar(field) {
            let bytes = values.iter().copied().flat_map(f32::to_le_bytes).collect();
            file.array(field.name(), "Float32", 1, bytes);
        }
    }
    file.array("mass", "Float64", 1, points.mass.iter().flat_map(|m| m.to_le_bytes()).collect());
    file.array("column", "UInt32", 1, points.column.iter().flat_map(|c| c.to_le_bytes()).collect());
    file.close("PointData");
    file.open("Points");
    file.array("position", "Float64", 3, in_space(&frame.position));
    file.close("Points");
    file.open("Verts");
    file.cells(0..count as u64, 1);
    file.close("Verts");
    file.finish(&format!("NumberOfPoints=\"{count}\" NumberOfVerts=\"{count}\""))
}

/// Walls as lines and boxes as polygons in a `.vtp` file. `walls` are ends and `boxes` corners, m; a box
/// that is absent is left out.
fn boundary(walls: &[[f64; 3]], boxes: &[[f64; 3]]) -> Vec<u8> {
    let present = boxes.as_chunks::<4>().0.iter().filter(|corners| corners[0][0].is_finite());
    let corners: Vec<[f64; 3]> = present.flatten().copied().collect();
    let [lines, all] = [walls.len(), walls.len() + corners.len()];
    let mut file = Vtp::default();
    file.open("Points");
    let points = walls.iter().chain(&corners).flatten();
    file.array("position", "Float64", 3, points.flat_map(|x| x.to_le_bytes()).collect());
    file.close("Points");
    file.open("Lines");
    file.cells(0..lines as u64, 2);
    file.close("Lines");
    file.open("Polys");
    file.cells(lines as u64..all as u64, 4);
    file.close("Polys");
    file.finish(&format!(
        "NumberOfPoints=\"{all}\" NumberOfLines=\"{}\" NumberOfPolys=\"{}\"",
        lines / 2,
        corners.len() / 4
    ))
}

/// Vectors of the plane in space.
fn in_space(vectors: &[[f64; 2]]) -> Vec<u8> {
    vectors.iter().flat_map(|&[x, y]| [x, y, 0.0]).flat_map(f64::to_le_bytes).collect()
}

#[derive(Default)]
struct Vtp {
    xml: String,
    data: Vec<u8>,
}

impl Vtp {
    fn open(&mut self, tag: &str) {
        let _ = writeln!(self.xml, "<{tag}>");
    }

    fn close(&mut self, tag: &str) {
        let _ = writeln!(self.xml, "</{tag}>");
    }

    /// Names an array in the XML and appends its length and bytes to the data.
    fn array(&mut self, name: &str, kind: &str, components: usize, bytes: Vec<u8>) {
        let _ = writeln!(
            self.xml,
            "<DataArray Name=\"{name}\" type=\"{kind}\" NumberOfComponents=\"{components}\" \
             format=\"appended\" offset=\"{}\"/>",
            self.data.len()
        );
        self.data.extend_from_slice(&(bytes.len() as u64).to_le_bytes());
        self.data.extend(bytes);
    }

    /// Cells of `nodes` points each, which use the `points` in turn.
    fn cells(&mut self, points: Range<u64>, nodes: usize) {
        let count = points.end - points.start;
        let bytes =
            |numbers: &mut dyn Iterator<Item = u64>| numbers.flat_map(u64::to_le_bytes).collect();
        self.array("connectivity", "Int64", 1, bytes(&mut points.clone()));
        let ends = (nodes as u64..=count).step_by(nodes);
        self.array("offsets", "Int64", 1, bytes(&mut ends.clone()));
    }

    /// `counts` are attributes of the piece.
    fn finish(self, counts: &str) -> Vec<u8> {
        let mut file = format!(
            "<?xml version=\"1.0\"?>\n\
             <VTKFile type=\"PolyData\" version=\"1.0\" byte_order=\"LittleEndian\" \
             header_type=\"UInt64\">\n<PolyData>\n\
             <Piece {counts}>\n\
             {}</Piece>\n</PolyData>\n<AppendedData encoding=\"raw\">\n_",
            self.xml
        )
        .into_bytes();
        file.extend(self.data);
        file.extend_from_slice(b"\n</AppendedData>\n</VTKFile>\n");
        file
    }
}
