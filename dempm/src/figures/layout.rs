//! Arrangement of panels and colour bar in a figure.

use super::view::View;

/// Where things are, pixels from the upper left corner of the picture.
pub(super) struct Layout {
    pub width: f64,
    pub height: f64,
    pub font: f64,
    /// Left edge of the first column of panels.
    pub left: f64,
    /// Top edge of the first row of panels.
    pub top: f64,
    pub columns: usize,
    /// Width and height of a panel.
    pub panel: [f64; 2],
    /// From one panel to the next.
    pub pitch: [f64; 2],
    /// Pixels a metre.
    pub scale: f64,
    pub bar_top: f64,
    pub bar_width: f64,
}

impl Layout {
    /// The arrangement in rows and columns whose picture is nearest to 8 : 5.
    pub(super) fn new(width: f64, view: View, count: usize) -> Self {
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
    pub(super) fn corner(&self, index: usize) -> [f64; 2] {
        [
            self.left + (index % self.columns) as f64 * self.pitch[0],
            self.top + (index / self.columns) as f64 * self.pitch[1],
        ]
    }
}
