//! Panels with common axes above one colour bar.

use image::RgbImage;
use plot::{
    Anchor, Canvas, ColourScale, INK, Pen, PenError, RGBColor, Range, minus, tick_texts, ticks,
};

use super::bodies::Bodies;
use super::colour_bar::draw_colour_bar;
use super::error::FigureError;
use super::layout::Layout;
use super::options::Options;
use super::quantity::{Evaluator, Quantity};
use super::undrawn::is_drawn;
use super::view::View;
use crate::trajectory::Frame;

const WALL: RGBColor = RGBColor(70, 70, 70);
const BOX: RGBColor = RGBColor(196, 196, 196);
/// Radius in pictures over that of a grain.
const SHRUNK: f64 = 0.95;
/// Characters of a title that are looked at: more than fit into the widest figure.
const MOST_TITLE: usize = 512;

/// A frame and the values of its colours.
pub(super) struct Panel {
    frame: Frame,
    values: Vec<f64>,
}

impl Panel {
    pub(super) fn new(frame: Frame, evaluator: &Evaluator) -> Self {
        let values = evaluator.values(&frame);
        Self { frame, values }
    }

    pub(super) fn frame(&self) -> &Frame {
        &self.frame
    }
}

/// The layout of a figure: everything but the frames in it.
pub(super) struct Figure {
    title: String,
    quantity: Quantity,
    walls: Vec<[f64; 4]>,
    /// Radii of points or grains (m).
    radii: Vec<f64>,
    /// Grains are drawn with exact edges.
    grains: bool,
    view: View,
    scale: ColourScale,
    /// Pixels; see [`Layout`].
    layout: Layout,
}

impl Figure {
    /// A layout for `panels`, in which other frames of the trajectory fit too.
    pub(super) fn new(
        bodies: &Bodies<'_>,
        options: &Options,
        panels: &[Panel],
        width: u32,
    ) -> Self {
        let mut view = View::EMPTY;
        for panel in panels {
            view.include(&panel.frame);
        }
        Self::with_view(bodies, options, panels, view, panels.len(), width)
    }

    /// As [`new`](Self::new), for figures of `count` panels with a given view.
    pub(super) fn with_view(
        bodies: &Bodies<'_>,
        options: &Options,
        panels: &[Panel],
        view: View,
        count: usize,
        width: u32,
    ) -> Self {
        let header = bodies.trajectory.header();
        let view = view.framed(header);
        let values = || panels.iter().flat_map(|panel| panel.values.iter().copied());
        let classes =
            options.quantity.is_class().then(|| values().fold(0.0, f64::max) as usize + 1);
        let range = match classes {
            Some(classes) => Range { low: -0.5, high: classes as f64 - 0.5, cut: [false; 2] },
            None if options.log => Range::robust_log(values()),
            None => Range::robust(values(), options.quantity.is_signed()),
        };
        let log = options.log && classes.is_none();
        let signed = options.quantity.is_signed() && !log;
        Self {
            title: header.title.replace(char::is_control, " "),
            quantity: options.quantity,
            walls: header.walls.clone(),
            radii: bodies.radii(),
            grains: bodies.are_grains(),
            view,
            scale: ColourScale { range, log, signed, classes },
            layout: Layout::new(f64::from(width), view, count),
        }
    }

    /// Width and height, pixels; both even, as video wants it.
    pub(super) fn size(&self) -> (u32, u32) {
        let even = |size: f64| (size / 2.0).ceil() as u32 * 2;
        (even(self.layout.width), even(self.layout.height))
    }

    pub(super) const fn scale(&self) -> &ColourScale {
        &self.scale
    }

    /// Draws as many panels as the layout is for.
    pub(super) fn draw(&self, panels: &[Panel]) -> Result<RgbImage, FigureError> {
        let (width, height) = self.size();
        let mut canvas = Canvas::new(width, height)?;
        if self.grains {
            for (index, panel) in panels.iter().enumerate() {
                self.draw_grains(&mut canvas, index, panel);
            }
        }
        canvas.draw(|pen| {
            self.draw_title(pen)?;
            for (index, panel) in panels.iter().enumerate() {
                self.draw_panel(pen, index, panels.len(), panel)?;
            }
            draw_colour_bar(pen, &self.layout, &self.scale, self.quantity)
        })?;
        Ok(canvas.finish())
    }

    /// Draws as much of the title as fits.
    fn draw_title(&self, pen: &Pen<'_, '_>) -> Result<(), PenError> {
        let layout = &self.layout;
        let size = 1.25 * layout.font;
        let room = layout.width - layout.left - layout.font;
        let mut title: String = self.title.chars().take(MOST_TITLE).collect();
        while pen.text_width(&title, size) > room && title.pop().is_some() {
            if pen.text_width(&format!("{title}…"), size) <= room {
                title.push('…');
                break;
            }
        }
        pen.text(&title, [layout.left, 1.45 * layout.font], size, Anchor::Left)
    }

    /// From metres to pixels in a panel, with the same scale along both axes.
    fn place(&self, index: usize, [x, y]: [f64; 2]) -> [f64; 2] {
        let [left, top] = self.layout.corner(index);
        let bottom = top + self.layout.panel[1];
        [
            left + (x - self.view.x[0]) * self.layout.scale,
            bottom - (y - self.view.y[0]) * self.layout.scale,
        ]
    }

    /// Place, radius (pixels) and colour of points or grains in a panel.
    fn discs<'a>(
        &'a self,
        index: usize,
        panel: &'a Panel,
    ) -> impl Iterator<Item = ([f64; 2], f64, RGBColor)> + 'a {
        let bodies = panel.frame.position.iter().zip(&self.radii).zip(&panel.values);
        bodies.filter(|((position, _), _)| is_drawn(position)).map(
            move |((&position, radius), &value)| {
                let radius = radius * self.layout.scale;
                (self.place(index, position), radius, self.scale.colour(value))
            },
        )
    }

    /// Draws grains a little smaller than they are: a light line remains between neighbours.
    fn draw_grains(&self, canvas: &mut Canvas, index: usize, panel: &Panel) {
        for (at, radius, colour) in self.discs(index, panel) {
            canvas.disc(at, SHRUNK * radius, colour);
        }
    }

    fn draw_panel(
        &self,
        pen: &Pen<'_, '_>,
        index: usize,
        count: usize,
        panel: &Panel,
    ) -> Result<(), PenError> {
        let layout = &self.layout;
        let [left, top] = layout.corner(index);
        let place = |x: [f64; 2]| self.place(index, x);
        if !self.grains {
            for (at, radius, colour) in self.discs(index, panel) {
                pen.disc(at, radius.max(0.75), colour)?;
            }
        }
        let thin = 0.06 * layout.font;
        for &solid in &panel.frame.boxes {
            if let Some([low, high]) = self.view.clip_box(solid) {
                let (low, high) = (place(low), place(high));
                pen.rectangle([low, high], BOX)?;
                let outline = [low, [high[0], low[1]], high, [low[0], high[1]], low];
                pen.line(&outline, 1.5 * thin, WALL)?;
            }
        }
        for &wall in &self.walls {
            if let Some(ends) = self.view.clip_segment(wall) {
                pen.line(&ends.map(place), 3.0 * thin, WALL)?;
            }
        }
        self.draw_axes(pen, index, count)?;
        let time = format!("t = {:.*} s", decimals(panel.frame.time), panel.frame.time);
        pen.text(&minus(&time), [left, top - 0.35 * layout.font], layout.font, Anchor::AboveLeft)
    }

    /// Frame, ticks and, at the left and the bottom of the picture, their numbers.
    fn draw_axes(&self, pen: &Pen<'_, '_>, index: usize, count: usize) -> Result<(), PenError> {
        let layout = &self.layout;
        let (font, thin) = (layout.font, 0.06 * layout.font);
        let [left, top] = layout.corner(index);
        let [right, bottom] = [left + layout.panel[0], top + layout.panel[1]];
        let outline = [[left, top], [right, top], [right, bottom], [left, bottom], [left, top]];
        pen.line(&outline, thin, INK)?;

        let is_left = index.is_multiple_of(layout.columns);
        let is_bottom = index + layout.columns >= count;
        let (view, size) = (&self.view, 0.9 * font);
        let along_x = ticks(view.x[0], view.x[1], (layout.panel[0] / (4.5 * font)).min(12.0));
        for (tick, text) in std::iter::zip(&along_x, tick_texts(&along_x)) {
            let x = left + (tick - view.x[0]) * layout.scale;
            pen.line(&[[x, bottom], [x, bottom + 0.35 * font]], thin, INK)?;
            if is_bottom {
                pen.text(&text, [x, bottom + 0.5 * font], size, Anchor::Below)?;
            }
        }
        let along_y = ticks(view.y[0], view.y[1], (layout.panel[1] / (2.4 * font)).min(10.0));
        for (tick, text) in std::iter::zip(&along_y, tick_texts(&along_y)) {
            let y = bottom - (tick - view.y[0]) * layout.scale;
            pen.line(&[[left - 0.35 * font, y], [left, y]], thin, INK)?;
            if is_left {
                pen.text(&text, [left - 0.55 * font, y], size, Anchor::Right)?;
            }
        }
        if is_bottom {
            let at = [0.5 * (left + right), bottom + 1.7 * font];
            pen.text("x (m)", at, font, Anchor::Below)?;
        }
        if is_left {
            let at = [left - 3.0 * font, 0.5 * (top + bottom)];
            pen.text("y (m)", at, font, Anchor::Upwards)?;
        }
        Ok(())
    }
}

/// Decimals of a time: hundredths of a second, or finer if needed.
fn decimals(time: f64) -> usize {
    (2..5)
        .find(|&n| (time * 10_f64.powi(n) - (time * 10_f64.powi(n)).round()).abs() < 1e-3)
        .unwrap_or(5) as usize
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_show_what_tells_them_apart() {
        assert_eq!([0.0, 0.5, 0.01, 0.005, 1.0 / 3.0].map(decimals), [2, 2, 2, 3, 5]);
    }
}
