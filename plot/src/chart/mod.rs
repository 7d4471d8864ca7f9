//! Charts as SVG, drawn in the colours of a light page; a style sheet exchanges them on a dark one.

mod area;
mod colours;
mod drawing;
mod labels;
mod legend;
mod series;

pub use colours::{dark_style, inlined, series_colour};
pub use drawing::Chart;
pub use series::{Axis, Mark, Series};
