//! The legend below a chart, where it hides nothing.

use plotters::prelude::*;

use super::area::{Area, BAND, DOTS, Drawn, TEXT};
use super::colours::INK;
use super::series::Mark;
use crate::font::FONT;

/// Height of a line, pixels.
pub(super) const LINE: u32 = 24;

/// A name and the mark that goes with it.
pub(super) struct Entry {
    pub name: String,
    pub mark: Mark,
    pub colour: RGBColor,
}

/// Entries of one line with the places of their left ends, pixels.
type Line<'e> = Vec<(i32, &'e Entry)>;

/// The entries broken into lines of a width (pixels).
pub(super) fn lines(entries: &[Entry], line_width: u32) -> Vec<Line<'_>> {
    let mut lines: Vec<Line> = Vec::new();
    let mut x = i32::MAX;
    for entry in entries {
        // About the mean width of a character.
        let width = 40 + (entry.name.chars().count() as f64 * 0.58 * f64::from(TEXT)) as i32;
        if x.saturating_add(width) > line_width as i32 {
            lines.push(Vec::new());
            x = 72;
        }
        if let Some(line) = lines.last_mut() {
            line.push((x, entry));
        }
        x += width + 12;
    }
    lines
}

pub(super) fn draw<'a>(area: &Area<'a>, lines: &[Line]) -> Drawn<'a> {
    for (row, line) in lines.iter().enumerate() {
        let y = row as i32 * LINE as i32 + 12;
        for (x, Entry { name, mark, colour }) in line {
            let at = (x + 12, y);
            match mark {
                Mark::Line | Mark::Reference => {
                    let ends = [(*x, y), (x + 24, y)];
                    area.draw(&PathElement::new(ends, colour.stroke_width(2)))?;
                }
                Mark::Band => {
                    let corners = [(*x, y - 6), (x + 24, y + 6)];
                    area.draw(&Rectangle::new(corners, colour.mix(BAND).filled()))?;
                }
                Mark::Dots => area.draw(&Circle::new(at, 2, colour.mix(DOTS).filled()))?,
                Mark::Circles => area.draw(&Circle::new(at, 5, colour.filled()))?,
                Mark::Squares => {
                    let corners = [(at.0 - 5, y - 5), (at.0 + 5, y + 5)];
                    area.draw(&Rectangle::new(corners, colour.filled()))?;
                }
                Mark::Triangles => area.draw(&TriangleMarker::new(at, 7, colour.filled()))?,
                Mark::Crosses => area.draw(&Cross::new(at, 5, colour.stroke_width(2)))?,
            }
            let style = (FONT, TEXT).into_font().color(&INK);
            area.draw(&Text::new(name.clone(), (x + 30, y - 8), style))?;
        }
    }
    Ok(())
}
