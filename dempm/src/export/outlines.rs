//! Walls and boxes as lines and rectangles in space.

use crate::trajectory::Trajectory;
use crate::trajectory::vtk_layout::{CORNERS, ENDS};

use super::error::ExportError;

/// Ends of the walls of a trajectory, two each, m.
pub(super) fn wall_ends(trajectory: &Trajectory) -> Vec<[f64; 3]> {
    in_space(&trajectory.header().walls, &ENDS)
}

/// Corners of its boxes at a frame, four each, m; NaN for a box that is absent.
pub(super) fn box_corners(
    trajectory: &Trajectory,
    frame: usize,
) -> Result<Vec<[f64; 3]>, ExportError> {
    let boxes = trajectory.boxes(frame..frame + 1)?.into_raw_vec_and_offset().0;
    Ok(in_space(boxes.as_chunks().0, &CORNERS))
}

fn in_space(bodies: &[[f64; 4]], places: &[[usize; 2]]) -> Vec<[f64; 3]> {
    let mut points = Vec::with_capacity(bodies.len() * places.len());
    for body in bodies {
        points.extend(places.iter().map(|&[x, y]| [body[x], body[y], 0.0]));
    }
    points
}
