//! The surface that a chart is drawn on.

use plotters::coord::Shift;
use plotters::prelude::{DrawingArea, SVGBackend};

/// Usual width, pixels.
pub(super) const WIDTH: u32 = 760;
/// Usual height above the legend, pixels.
pub(super) const HEIGHT: u32 = 440;
/// Height of texts, pixels.
pub(super) const TEXT: u32 = 14;
/// Opacity of bands and of dots.
pub(super) const BAND: f64 = 0.25;
pub(super) const DOTS: f64 = 0.4;

pub(super) type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;
/// The result of drawing with plotters, whose errors borrow the text they draw into.
pub(super) type Drawn<'a> = Result<(), Box<dyn std::error::Error + 'a>>;
