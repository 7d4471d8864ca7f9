//! The data of a chart: axes and series.

/// How a series is drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mark {
    /// A line through the points.
    Line,
    /// A line in the colour of the text, to compare others with.
    Reference,
    /// The shaded area within a closed outline, in the colour of the series after it.
    Band,
    /// Small discs that let others shine through: clouds of many points.
    Dots,
    /// Filled circles.
    Circles,
    /// Filled squares.
    Squares,
    /// Filled triangles.
    Triangles,
    /// Diagonal crosses.
    Crosses,
}

impl Mark {
    /// Whether points are joined instead of marked one by one.
    pub(super) fn joins(self) -> bool {
        matches!(self, Self::Line | Self::Reference | Self::Band)
    }
}

/// Points of one colour and mark.
#[derive(Clone, Debug, PartialEq)]
pub struct Series {
    /// Name in the legend; empty to leave it out.
    pub name: String,
    /// Points (x, y) in the units of the axes.
    pub points: Vec<(f64, f64)>,
    /// How they are drawn.
    pub mark: Mark,
    /// Short texts beside the points, in their order; may be fewer.
    pub labels: Vec<String>,
}

impl Series {
    /// A series without labels.
    pub fn new(name: impl Into<String>, mark: Mark, points: Vec<(f64, f64)>) -> Self {
        Self { name: name.into(), points, mark, labels: Vec::new() }
    }
}

/// Title and scale of an axis.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Axis {
    /// Quantity with its unit, such as `time [s]`.
    pub label: String,
    /// Logarithmic instead of linear.
    pub log: bool,
}

impl Axis {
    /// A linear axis.
    pub fn linear(label: impl Into<String>) -> Self {
        Self { label: label.into(), log: false }
    }

    /// A logarithmic axis.
    pub fn log(label: impl Into<String>) -> Self {
        Self { label: label.into(), log: true }
    }
}
