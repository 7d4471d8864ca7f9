//! Windows of frames as networks see them, and their mirror images.

use super::obstacle::Obstacle;

/// Consecutive frames of one trajectory.
#[derive(Clone, Copy, Debug)]
pub struct Window<'a> {
    /// Positions (m), frame by frame, the oldest first:
    /// [`ModelConfig::window`](crate::network::ModelConfig::window) x points x 2.
    pub positions: &'a [f32],
    /// Number of points.
    pub points: usize,
    /// Static features, points x columns ([`static_features`](super::static_features)).
    pub statics: &'a [f32],
    /// Boxes, which networks [may see](crate::network::ModelConfig::sees_boxes).
    pub obstacles: &'a [Obstacle],
}

/// Positions (m, x and y in turn) with left and right exchanged in a domain of this width (m).
pub fn mirrored(positions: &[f32], width: f64) -> Vec<f32> {
    let rows = positions.as_chunks::<2>().0.iter();
    rows.flat_map(|[x, y]| [width as f32 - x, *y]).collect()
}
