//! Options of figures and animations.

use super::quantity::Quantity;

/// Options of a figure or animation.
#[derive(Clone, Debug)]
pub struct Options {
    /// Grains instead of points.
    pub grains: bool,
    /// The quantity that the colours show; by default speed, the initial layer of grains, and the distance in
    /// differences.
    pub quantity: Option<Quantity>,
    /// Means of the quantity instead of its values at points.
    pub average: Option<Average>,
    /// Logarithmic colours.
    pub log: bool,
    /// The frames to draw, of the first run.
    pub frames: Selection,
    /// Width in pixels; by default 1600 for figures and 960 for animations.
    pub width: Option<u32>,
    /// How several runs share a picture.
    pub compare: Compare,
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

/// How several runs share a picture.
#[derive(clap::ValueEnum, Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Compare {
    /// One beside the other
    #[default]
    Side,
    /// One over the other, each in a colour
    Overlay,
    /// The first subtracted from the others: distances of points, or differences of --field
    Difference,
}

/// Means of a quantity.
#[derive(clap::ValueEnum, Clone, Copy, Debug, PartialEq, Eq)]
pub enum Average {
    /// Over the points in each cell of the grid
    Cell,
}
