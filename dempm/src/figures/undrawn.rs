//! Points that a picture leaves out.

use crate::trajectory::Frame;

/// Points without a finite position, over the frames of a figure or an animation.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Undrawn {
    /// Their number; a point counts once a frame.
    pub count: usize,
    /// Frame and point of the first.
    pub first: Option<(usize, usize)>,
}

impl Undrawn {
    /// Counts those of frame number `index`.
    pub(super) fn add(&mut self, index: usize, frame: &Frame) {
        for (point, position) in frame.position.iter().enumerate() {
            if !is_drawn(position) {
                self.count += 1;
                self.first.get_or_insert((index, point));
            }
        }
    }
}

/// Whether a point has a place in the picture.
pub(super) fn is_drawn(position: &[f64; 2]) -> bool {
    position.iter().all(|x| x.is_finite())
}
