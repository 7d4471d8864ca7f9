//! Walls, obstacles and the plate as particles, the form in which GNS and LagrangeBench see them.

use ndarray::{ArrayView2, Axis};

use super::error::ExportError;
use crate::trajectory::Trajectory;

/// Particles on the walls and on the faces of the boxes of a trajectory, a point spacing apart.
pub(super) struct RigidParticles {
    /// Places on walls, m.
    walls: Vec<[f64; 2]>,
    /// Box and place relative to its lower left corner, m.
    boxes: Vec<(usize, [f64; 2])>,
    /// Whether a box moves.
    moves: Vec<bool>,
}

impl RigidParticles {
    /// Covers the boxes of a trajectory, and its walls if `walls`.
    ///
    /// # Errors
    /// If it cannot be read or has no frames, or a box is absent at times.
    pub fn of(trajectory: &Trajectory, walls: bool) -> Result<Self, ExportError> {
        if trajectory.frames() == 0 {
            return Err(ExportError::NoFrames { path: trajectory.path().to_owned() });
        }
        let spacing = trajectory.header().point_spacing;
        let segments = if walls { trajectory.header().walls.as_slice() } else { &[] };
        let walls = segments.iter().flat_map(|&wall| along(wall, spacing)).collect();
        let places = trajectory.boxes(0..trajectory.frames())?;
        if let Some(place) = places.iter().position(|x| !x.is_finite()) {
            let row = place / 4;
            let count = places.shape()[1];
            let (frame, index) = (row / count, row % count);
            let path = trajectory.path().to_owned();
            return Err(ExportError::AbsentBox { path, frame, index });
        }
        let first = places.index_axis(Axis(0), 0);
        let moves = (0..first.nrows()).map(|index| {
            let over_time = places.index_axis(Axis(1), index);
            over_time.rows().into_iter().any(|now| now != over_time.row(0))
        });
        let boxes = first.rows().into_iter().enumerate().flat_map(|(index, place)| {
            let (width, height) = (place[2] - place[0], place[3] - place[1]);
            let faces = [
                [0.0, 0.0, width, 0.0],
                [0.0, height, width, height],
                [0.0, 0.0, 0.0, height],
                [width, 0.0, width, height],
            ];
            faces.into_iter().flat_map(move |face| along(face, spacing)).map(move |x| (index, x))
        });
        Ok(Self { walls, boxes: boxes.collect(), moves: moves.collect() })
    }

    /// Whether each particle moves.
    pub fn moving(&self) -> impl Iterator<Item = bool> + '_ {
        let walls = self.walls.iter().map(|_| false);
        walls.chain(self.boxes.iter().map(|&(index, _)| self.moves[index]))
    }

    /// Their positions (m) when the boxes are at `boxes` (boxes x 4, m).
    pub fn positions<'a>(&'a self, boxes: ArrayView2<'a, f64>) -> impl Iterator<Item = [f64; 2]> {
        let on_box = move |&(index, x): &(usize, [f64; 2])| {
            [boxes[[index, 0]] + x[0], boxes[[index, 1]] + x[1]]
        };
        self.walls.iter().copied().chain(self.boxes.iter().map(on_box))
    }
}

/// Points on a segment (x1, y1, x2, y2) at most `spacing` apart, the first and last half of that from its
/// ends: adjacent segments share no point.
fn along([x1, y1, x2, y2]: [f64; 4], spacing: f64) -> impl Iterator<Item = [f64; 2]> {
    // But for round-off.
    let parts = ((x2 - x1).hypot(y2 - y1) / spacing - 1e-6).ceil().max(1.0);
    (0..parts as usize).map(move |k| {
        let part = (k as f64 + 0.5) / parts;
        [x1 + part * (x2 - x1), y1 + part * (y2 - y1)]
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn particles_are_evenly_spaced() {
        let points: Vec<[f64; 2]> = along([1.0, 0.0, 1.0, 0.5], 0.125).collect();
        assert_eq!(points, [[1.0, 0.0625], [1.0, 0.1875], [1.0, 0.3125], [1.0, 0.4375]]);
        // Never further apart than the spacing.
        assert_eq!(along([0.0, 0.0, 0.3, 0.0], 0.125).count(), 3);
        assert_eq!(along([0.0, 0.0, 0.01, 0.0], 0.125).collect::<Vec<_>>(), [[0.005, 0.0]]);
    }
}
