//! Panels with common axes above one colour bar.

use image::RgbImage;
use plot::{
    Anchor, Canvas, ColourScale, INK, Pen, PenError, RGBColor, Range, minus, tick_texts, ticks,
};

use super::error::FigureError;
use super::options::Options;
use super::quantity::{Evaluator, Quantity};
use super::undrawn::is_drawn;
use super::view::View;
use crate::trajectory::{Frame, Header};

const WALL: RGBColor = RGBColor(70, 70, 70);
const BOX: RGBColor = RGBColor(196, 196, 196);
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
    point_spacing: f64,
    view: View,
    scale: ColourScale,
    /// Pixels; see [`Layout`].
    layout: Layout,
}

impl Figure {
    /// A layout for `panels`, in which other frames of the trajectory fit too.
    pub(super) fn new(header: &Header, options: &Options, panels: &[Panel], width: u32) -> Self {
        let mut view = View::EMPTY;
        for panel in panels {
            view.include(&panel.frame);
        }
        Self::with_view(header, options, panels, view, panels.len(), width)
    }

    /// As [`new`](Self::new), for figures of `count` panels with a given view.
    pub(super) fn with_view(
        header: &Header,
        options: &Options,
        panels: &[Panel],
        view: View,
        count: usize,
        width: u32,
    ) -> Self {
        let view = view.framed(header);
        let values = || panels.iter().flat_map(|panel| panel.values.iter().copied());
        let classes = (options.quantity == Quantity::Column)
            .then(|| values().fold(0.0, f64::max) as usize + 1);
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
            point_spacing: header.point_spacing,
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
        canvas.draw(|pen| {
            self.draw_title(pen)?;
            for (index, panel) in panels.iter().enumerate() {
                self.draw_panel(pen, index, panels.len(), panel)?;
            }
            self.draw_bar(pen)
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

    fn draw_panel(
        &self,
        pen: &Pen<'_, '_>,
        index: usize,
        count: usize,
        panel: &Panel,
    ) -> Result<(), PenError> {
        let layout = &self.layout;
        let [left, top] = layout.corner(index);
        let bottom = top + layout.panel[1];
        // Metres to pixels, the same along both axes.
        let place = |[x, y]: [f64; 2]| {
            [
                left + (x - self.view.x[0]) * layout.scale,
                bottom - (y - self.view.y[0]) * layout.scale,
            ]
        };

        let radius = 0.5 * self.point_spacing * layout.scale;
        for (&position, &value) in std::iter::zip(&panel.frame.position, &panel.values) {
            if is_drawn(&position) {
                pen.disc(place(position), radius.max(0.75), self.scale.colour(value))?;
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

    fn draw_bar(&self, pen: &Pen<'_, '_>) -> Result<(), PenError> {
        let layout = &self.layout;
        let (font, thin) = (layout.font, 0.06 * layout.font);
        let range = self.scale.range;
        let (left, top) = (layout.left, layout.bar_top);
        let (right, bottom) = (left + layout.bar_width, layout.bar_top + 1.1 * font);
        let steps = layout.bar_width.ceil() as usize;
        for step in 0..steps {
            let part = [step, step + 1].map(|s| s as f64 / steps as f64);
            let x = part.map(|part| left + part * layout.bar_width);
            let colour = self.scale.at(0.5 * (part[0] + part[1]));
            pen.rectangle([[x[0], top], [x[1], bottom]], colour)?;
        }
        // Arrowheads where values go on beyond the colours.
        let (middle, tip) = (0.5 * (top + bottom), 0.8 * font);
        let mut outline = vec![[left, top], [right, top]];
        if range.cut[1] {
            let corners = [[right, top], [right + tip, middle], [right, bottom]];
            pen.polygon(&corners, self.scale.at(1.0))?;
            outline.push([right + tip, middle]);
        }
        outline.extend([[right, bottom], [left, bottom]]);
        if range.cut[0] {
            let corners = [[left, top], [left - tip, middle], [left, bottom]];
            pen.polygon(&corners, self.scale.at(0.0))?;
            outline.push([left - tip, middle]);
        }
        outline.push([left, top]);
        pen.line(&outline, thin, INK)?;

        let (name, unit) = self.quantity.label();
        // Thousands of pascals are easier to read as kilopascals.
        let kilo = unit == "Pa" && !self.scale.log && range.low.abs().max(range.high) >= 2000.0;
        let factor = if kilo { 1e-3 } else { 1.0 };
        for (fraction, text) in self.bar_ticks(factor) {
            let x = left + fraction * layout.bar_width;
            pen.line(&[[x, bottom], [x, bottom + 0.3 * font]], thin, INK)?;
            pen.text(&text, [x, bottom + 0.45 * font], 0.9 * font, Anchor::Below)?;
        }
        let label = match (unit, kilo) {
            ("", _) => name.to_owned(),
            (_, true) => format!("{name} (k{unit})"),
            (_, false) => format!("{name} ({unit})"),
        };
        let x = right + 2.2 * font;
        pen.text(&label, [x, middle], font, Anchor::Left)?;
        let note = match range.cut {
            [false, false] => None,
            [true, true] => Some("colours from the 1st to the 99th percentile"),
            [true, false] => Some("colours begin at the 1st percentile"),
            [false, true] => Some("colours end at the 99th percentile"),
        };
        if let Some(note) = note {
            pen.text(note, [x, middle + 1.35 * font], 0.75 * font, Anchor::Left)?;
        }
        Ok(())
    }

    /// Ticks of the colour bar: where they are, from 0 to 1, and their text.
    fn bar_ticks(&self, factor: f64) -> Vec<(f64, String)> {
        let Range { low, high, .. } = self.scale.range;
        let wanted = (self.layout.bar_width / (4.5 * self.layout.font)).min(8.0);
        if let Some(classes) = self.scale.classes {
            let every = (classes as f64 / wanted).ceil().max(1.0) as usize;
            let at = |class: usize| (self.scale.range.fraction(class as f64), class.to_string());
            return (0..classes).step_by(every).map(at).collect();
        }
        if self.scale.log {
            return log_ticks(low, high, wanted)
                .into_iter()
                .map(|(logarithm, text)| (self.scale.range.fraction(logarithm), text))
                .collect();
        }
        let ticks = ticks(factor * low, factor * high, wanted);
        let texts = tick_texts(&ticks);
        let at = |tick: &f64| self.scale.range.fraction(tick / factor);
        std::iter::zip(ticks.iter().map(at), texts).collect()
    }
}

/// Decimals of a time: hundredths of a second, or finer if needed.
fn decimals(time: f64) -> usize {
    (2..5)
        .find(|&n| (time * 10_f64.powi(n) - (time * 10_f64.powi(n)).round()).abs() < 1e-3)
        .unwrap_or(5) as usize
}

/// Powers of ten between two logarithms; over less than two decades, round multiples of them.
fn log_ticks(low: f64, high: f64, wanted: f64) -> Vec<(f64, String)> {
    let decades = high.floor() - low.ceil();
    if decades >= 2.0 {
        let step = (decades / wanted).ceil().max(1.0) as usize;
        let (first, last) = (low.ceil() as i32, high.floor() as i32);
        return (first..=last)
            .step_by(step)
            .map(|power| (f64::from(power), format!("10{}", superscript(power))))
            .collect();
    }
    let mut marks = Vec::new();
    for power in low.floor() as i32..=high.ceil() as i32 {
        for digit in [1.0_f64, 2.0, 5.0] {
            let logarithm = f64::from(power) + digit.log10();
            if (low..=high).contains(&logarithm) {
                let text = match power {
                    -3..=5 => (digit * 10_f64.powi(power)).to_string(),
                    _ => format!("{digit}·10{}", superscript(power)),
                };
                marks.push((logarithm, text));
            }
        }
    }
    marks
}

fn superscript(number: i32) -> String {
    let raised = |digit: char| match digit {
        '-' => '⁻',
        '1' => '¹',
        '2' => '²',
        '3' => '³',
        digit => {
            char::from_u32(u32::from(digit) - u32::from('0') + u32::from('⁰')).unwrap_or(digit)
        }
    };
    number.to_string().chars().map(raised).collect()
}

/// Where things are, pixels from the upper left corner of the picture.
struct Layout {
    width: f64,
    height: f64,
    font: f64,
    /// Left edge of the first column of panels.
    left: f64,
    /// Top edge of the first row of panels.
    top: f64,
    columns: usize,
    /// Width and height of a panel.
    panel: [f64; 2],
    /// From one panel to the next.
    pitch: [f64; 2],
    /// Pixels a metre.
    scale: f64,
    bar_top: f64,
    bar_width: f64,
}

impl Layout {
    /// The arrangement in rows and columns whose picture is nearest to 8 : 5.
    fn new(width: f64, view: View, count: usize) -> Self {
        let unlike = |layout: &Self| (layout.height / layout.width * 1.6).ln().abs();
        (2..=count).map(|columns| Self::in_columns(width, view, count, columns)).fold(
            Self::in_columns(width, view, count, 1),
            |best, other| {
                if unlike(&other) < unlike(&best) { other } else { best }
            },
        )
    }

    fn in_columns(width: f64, view: View, count: usize, columns: usize) -> Self {
        let font = 9.5 + 0.0065 * width;
        let (left, right, gap) = (4.6 * font, 1.2 * font, [1.4 * font, 2.6 * font]);
        let top = 2.6 * font + 1.6 * font;
        let rows = count.div_ceil(columns) as f64;
        let across = (width - left - right - gap[0] * (columns - 1) as f64) / columns as f64;
        // A tower would make an endless picture: rather leave room at its sides.
        let scale = (across / view.width()).min(1.4 * width / (rows * view.height()));
        let panel = [across, scale * view.height()];
        let panel = [panel[0].min(scale * view.width()), panel[1]];
        let bar_top = top + rows * panel[1] + (rows - 1.0) * gap[1] + 4.4 * font;
        Self {
            width,
            height: bar_top + 3.6 * font,
            font,
            left,
            top,
            columns,
            panel,
            pitch: [panel[0] + gap[0], panel[1] + gap[1]],
            scale,
            bar_top,
            bar_width: (0.42 * width).min(width - left - 22.0 * font).max(8.0 * font),
        }
    }

    /// The upper left corner of a panel.
    fn corner(&self, index: usize) -> [f64; 2] {
        [
            self.left + (index % self.columns) as f64 * self.pitch[0],
            self.top + (index / self.columns) as f64 * self.pitch[1],
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_of_logarithms() {
        let texts = |low, high| -> Vec<String> {
            log_ticks(low, high, 6.0).into_iter().map(|(_, text)| text).collect()
        };
        assert_eq!(texts(-3.2, 0.1), ["10⁻³", "10⁻²", "10⁻¹", "10⁰"]);
        assert_eq!(texts(-1.1, 0.1), ["0.1", "0.2", "0.5", "1"]);
    }

    #[test]
    fn times_show_what_tells_them_apart() {
        assert_eq!([0.0, 0.5, 0.01, 0.005, 1.0 / 3.0].map(decimals), [2, 2, 2, 3, 5]);
    }
}
