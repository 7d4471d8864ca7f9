//! The font of all pictures, built in so that they look the same everywhere.

use plotters::style::FontStyle;

use crate::error::PlotError;

/// Name under which the built-in font is registered with plotters.
pub const FONT: &str = "DejaVu Sans";
static FONT_FILE: &[u8] = include_bytes!("../assets/DejaVuSans-subset.ttf");

/// Makes [`FONT`] known to plotters; may be called any number of times.
///
/// # Errors
/// If plotters cannot read the font.
pub fn register_font() -> Result<(), PlotError> {
    plotters::style::register_font(FONT, FontStyle::Normal, FONT_FILE).map_err(|_| PlotError::Font)
}
