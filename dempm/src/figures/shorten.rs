//! Texts that fit into their place.

use plot::Pen;

/// Characters of a text that are looked at: more than fit into the widest figure.
const MOST: usize = 512;

/// As much of a text as fits into a width (pixels) at a height (pixels).
pub(super) fn shortened(pen: &Pen<'_, '_>, text: &str, size: f64, room: f64) -> String {
    let mut short: String = text.chars().take(MOST).collect();
    while pen.text_width(&short, size) > room && short.pop().is_some() {
        if pen.text_width(&format!("{short}…"), size) <= room {
            short.push('…');
            break;
        }
    }
    short
}
