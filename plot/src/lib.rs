//! Charts, raster figures and animations that look the same on every machine.
//!
//! - [`Chart`]: an SVG chart with axes, series and a legend, readable on light and dark pages;
//! - [`Canvas`] and [`Pen`]: antialiased drawing into a raster image, and [`Graph`], a chart of lines in one;
//! - [`ColourScale`]: from numbers to colours, with robust ranges ([`Range`]) and [`ticks`];
//! - [`Gif`]: an animation of images with one palette.
//!
//! ```
//! # fn main() -> Result<(), plot::PlotError> {
//! use plot::{Axis, Chart, Mark, Series};
//!
//! let chart = Chart {
//!     x: Axis::linear("time [s]"),
//!     y: Axis::log("error"),
//!     series: vec![Series::new("network", Mark::Circles, vec![(0.0, 1e-3), (1.0, 1e-2)])],
//!     floor: None,
//! };
//! assert!(chart.svg()?.starts_with("<svg "));
//! # Ok(())
//! # }
//! ```
#![warn(missing_docs)]

mod canvas;
mod chart;
mod colour_scale;
mod error;
mod font;
mod gif;
mod graph;
mod number;
mod palette;
mod ticks;

pub use canvas::{Anchor, Canvas, INK, Pen, PenError};
pub use chart::{Axis, Chart, Mark, Series, dark_style, inlined, series_colour};
pub use colour_scale::{ColourScale, Range};
pub use error::PlotError;
pub use font::{FONT, register_font};
pub use gif::Gif;
pub use graph::{Curve, Graph};
pub use number::number;
pub use palette::Palette;
/// The colour type of all drawing functions.
pub use plotters::style::RGBColor;
pub use ticks::{minus, tick_texts, ticks};
