//! What the colours of a figure mean: a colour bar, or the name of each run.

use plot::{Anchor, ColourScale, Pen, PenError, RGBColor};

use super::colour_bar::draw_colour_bar;
use super::layout::Layout;
use super::shorten::shortened;

/// The key below the panels.
pub(super) enum Key {
    /// Colours for values of a quantity with a name and a unit.
    Bar {
        scale: ColourScale,
        name: String,
        unit: &'static str,
        /// What grey points are, if there are any.
        grey: Option<String>,
    },
    /// A colour for each run.
    Runs(Vec<(RGBColor, String)>),
}

impl Key {
    pub(super) fn draw(&self, pen: &Pen<'_, '_>, layout: &Layout) -> Result<(), PenError> {
        match self {
            Self::Bar { scale, name, unit, grey } => {
                draw_colour_bar(pen, layout, scale, name, unit, grey.as_deref())
            }
            Self::Runs(runs) => {
                let at = [layout.left, layout.bar_top + 0.5 * layout.font];
                draw_names(pen, layout, runs, at)
            }
        }
    }
}

/// Draws a row of colours and the names of what they stand for, as many as fit.
pub(super) fn draw_names(
    pen: &Pen<'_, '_>,
    layout: &Layout,
    names: &[(RGBColor, String)],
    [mut x, y]: [f64; 2],
) -> Result<(), PenError> {
    let font = layout.font;
    for (colour, name) in names {
        let room = layout.width - x - 2.2 * font;
        if room < 2.0 * font {
            break;
        }
        pen.disc([x + 0.5 * font, y], 0.42 * font, *colour)?;
        let name = shortened(pen, name, font, room);
        pen.text(&name, [x + 1.3 * font, y], font, Anchor::Left)?;
        x += pen.text_width(&name, font) + 3.2 * font;
    }
    Ok(())
}
