//! Colours on a light page, and the style that exchanges them on a dark one.

use std::fmt::Write as _;

use plotters::style::RGBColor;

pub(super) const INK: RGBColor = RGBColor(0x1C, 0x1C, 0x1A);
pub(super) const GRID: RGBColor = RGBColor(0xDC, 0xDB, 0xD4);

/// Colours of series, distinguishable with any colour vision (after Okabe and Ito; the last ones
/// less so), and their brighter twins for dark pages.
pub(super) const COLOURS: [(RGBColor, &str); 10] = [
    (RGBColor(0x00, 0x72, 0xB2), "#4FB0EC"),
    (RGBColor(0xD5, 0x5E, 0x00), "#FF8A3D"),
    (RGBColor(0x00, 0x8F, 0x68), "#2FCFA2"),
    (RGBColor(0xB8, 0x5C, 0x93), "#E79AC8"),
    (RGBColor(0xB8, 0x7A, 0x00), "#F2BE4A"),
    (RGBColor(0x6A, 0x4C, 0xA8), "#B39DEB"),
    (RGBColor(0x6B, 0x6B, 0x66), "#A9A79F"),
    (RGBColor(0x9B, 0x22, 0x26), "#F07B78"),
    (RGBColor(0x6F, 0x8F, 0x00), "#BFDC4A"),
    (RGBColor(0x00, 0x9F, 0xC0), "#6ADDF2"),
];

/// The colour of a series, counted from 0, on a light page.
pub fn series_colour(index: usize) -> RGBColor {
    COLOURS[index % COLOURS.len()].0
}

/// CSS that exchanges the colours of charts on dark screens.
pub fn dark_style() -> String {
    let hex = |RGBColor(r, g, b): RGBColor| format!("#{r:02X}{g:02X}{b:02X}");
    let pairs = [(INK, "#E8E6E0"), (GRID, "#3D3C38")];
    let mut rules = String::new();
    for (light, dark) in pairs.into_iter().chain(COLOURS) {
        for property in ["fill", "stroke"] {
            // Writing to a string cannot fail.
            let _ = write!(rules, "svg [{property}=\"{}\"]{{{property}:{dark}}}", hex(light));
        }
    }
    format!("@media screen and (prefers-color-scheme: dark){{{rules}}}")
}

/// A chart for a page that already has [`dark_style`]; `title` (escaped) names it for screen readers.
pub fn inlined(svg: &str, title: &str) -> String {
    let style = format!("<style>{}</style>", dark_style());
    svg.replacen(&style, "", 1).replacen(
        "<svg ",
        &format!("<svg role=\"img\" aria-label=\"{title}\" "),
        1,
    )
}
