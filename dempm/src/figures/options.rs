//! Options of figures and animations.

use super::quantity::Quantity;

/// Options of a figure or animation.
#[derive(Clone, Debug)]
pub struct Options {
    /// Grains instead of points.
    pub grains: bool,
    /// The quantity that the colours show.
    pub quantity: Quantity,
    /// Logarithmic colours.
    pub log: bool,
    /// The frames to draw.
    pub frames: Selection,
    /// Width in pixels; by default 1600 for figures and 960 for animations.
    pub width: Option<u32>,
}

/// The frames to draw.
#[derive(Clone, Debug)]
pub enum Selection {
    /// Four over the whole run in a figure, all in an animation.
    Default,
    /// By number, or `first` or `last`.
    Frames(Vec<String>),
    /// The frames nearest to these times (s).
    Times(Vec<f64>),
}
