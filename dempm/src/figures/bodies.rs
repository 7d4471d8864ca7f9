//! What a picture shows: the points of a frame, or its grains.

use super::error::FigureError;
use crate::trajectory::{Frame, StaticGrains, Trajectory};

/// The points or the grains of a trajectory.
pub(super) struct Bodies<'a> {
    pub trajectory: &'a Trajectory,
    /// The grains, if they are shown.
    grains: Option<StaticGrains>,
}

impl<'a> Bodies<'a> {
    /// The points, or with `grains` the grains.
    pub(super) fn of(trajectory: &'a Trajectory, grains: bool) -> Result<Self, FigureError> {
        let path = || trajectory.path().to_owned();
        let grains = match grains {
            true => {
                Some(trajectory.grains()?.ok_or_else(|| FigureError::NoGrains { path: path() })?)
            }
            false => None,
        };
        Ok(Self { trajectory, grains })
    }

    /// Frames from one that can be shown to the next.
    pub(super) fn every(&self) -> usize {
        self.grains.as_ref().map_or(1, |grains| grains.every)
    }

    /// Whether grains are shown.
    pub(super) const fn are_grains(&self) -> bool {
        self.grains.is_some()
    }

    /// Radii (m); half a spacing for points.
    pub(super) fn radii(&self) -> Vec<f64> {
        match &self.grains {
            Some(grains) => grains.radius.iter().map(|&r| f64::from(r)).collect(),
            None => {
                let half = 0.5 * self.trajectory.header().point_spacing;
                vec![half; self.trajectory.points().mass.len()]
            }
        }
    }

    /// The column of each.
    pub(super) fn column(&self) -> Vec<u32> {
        let points = || self.trajectory.points().column.clone();
        self.grains.as_ref().map_or_else(points, |grains| grains.column.clone())
    }

    /// A frame, with grains in the place of its points if they are shown. The stress of a grain is its
    /// pressure.
    pub(super) fn frame(&self, index: usize) -> Result<Frame, FigureError> {
        let frame = self.trajectory.frame(index)?;
        if self.grains.is_none() {
            return Ok(frame);
        }
        let grains = self.trajectory.grain_frame(index)?;
        let grains = grains.ok_or(FigureError::NoGrainsAt { frame: index, every: self.every() })?;
        let doubles = |vectors: &[[f32; 2]]| vectors.iter().map(|v| v.map(f64::from)).collect();
        Ok(Frame {
            position: doubles(&grains.position),
            velocity: doubles(&grains.velocity),
            stress: Some(grains.pressure.iter().map(|&p| [-p, 0.0, 0.0, -p]).collect()),
            time: frame.time,
            boxes: frame.boxes,
            ..Frame::default()
        })
    }
}
