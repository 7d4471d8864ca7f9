//! What a picture leaves out.

use crate::trajectory::Frame;

/// Points without a finite position, over the frames of a figure or an animation, and runs without a distance.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Undrawn {
    /// The number of the points; a point counts once a frame.
    pub count: usize,
    /// Frame and point of the first.
    pub first: Option<(usize, usize)>,
    /// Names of the runs that do not start with the material of the first, and have no distance from it.
    pub unlike: Vec<String>,
}

impl Undrawn {
    /// No point, and runs of these names.
    pub(super) fn unlike(names: &[String]) -> Self {
        Self { unlike: names.to_vec(), ..Self::default() }
    }

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
