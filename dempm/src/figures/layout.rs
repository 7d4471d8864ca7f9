//! Arrangement of panels, key and graph in a figure.

use super::view::View;

/// Where things are, pixels from the upper left corner of the picture.
pub(super) struct Layout {
    pub width: f64,
    pub height: f64,
    pub font: f64,
    /// Left edge of the first column.
    pub left: f64,
    /// Top edge of the first row of panels.
    pub top: f64,
    pub columns: usize,
    /// Width and height of a panel.
    pub panel: [f64; 2],
    /// From one panel to the next.
    pub pitch: [f64; 2],
    /// From the left edge of a column to its panel, which is in its middle.
    inset: f64,
    /// Pixels a metre.
    pub scale: f64,
    pub bar_top: f64,
    pub bar_width: f64,
    /// Upper left and lower right corner of the graph over time, if there is one.
    pub graph: Option<[[f64; 2]; 2]>,
}

/// What is to be arranged.
#[derive(Clone, Copy)]
pub(super) struct Contents {
    /// Panels.
    pub count: usize,
    /// Columns of panels, where that matters.
    pub columns: Option<usize>,
    /// A graph over time below.
    pub graph: bool,
}

impl Layout {
    /// The arrangement in rows and columns whose picture is nearest to 8 : 5, of those that leave the fewest
    /// places empty.
    pub(super) fn new(width: f64, view: View, contents: Contents) -> Self {
        let unlike = |layout: &Self| (layout.height / layout.width * 1.6).ln().abs();
        let choices = contents.columns.map_or_else(|| columns(contents.count, view), |k| vec![k]);
        let layout = |columns: usize| Self::in_columns(width, view, contents, columns);
        choices[1..].iter().fold(layout(choices[0]), |best, &columns| {
            let other = layout(columns);
            if unlike(&other) < unlike(&best) { other } else { best }
        })
    }

    fn in_columns(width: f64, view: View, contents: Contents, columns: usize) -> Self {
        let font = 9.5 + 0.0065 * width;
        let (left, right, gap) = (4.6 * font, 1.2 * font, [1.4 * font, 2.6 * font]);
        let top = 2.6 * font + 1.6 * font;
        let rows = contents.count.div_ceil(columns) as f64;
        let across = (width - left - right - gap[0] * (columns - 1) as f64) / columns as f64;
        // A tower would make an endless picture: rather leave room at its sides.
        let scale = (across / view.width()).min(1.4 * width / (rows * view.height()));
        let panel = [across.min(scale * view.width()), scale * view.height()];
        let bar_top = top + rows * panel[1] + (rows - 1.0) * gap[1] + 4.4 * font;
        let below_bar = bar_top + 3.6 * font;
        let graph = contents.graph.then(|| {
            let top = below_bar + 2.2 * font;
            [[left, top], [width - right, top + (0.13 * width).max(7.0 * font)]]
        });
        Self {
            width,
            height: graph.map_or(below_bar, |[_, corner]| corner[1] + 3.6 * font),
            font,
            left,
            top,
            columns,
            panel,
            pitch: [across + gap[0], panel[1] + gap[1]],
            inset: 0.5 * (across - panel[0]),
            scale,
            bar_top,
            bar_width: (0.42 * width).min(width - left - 22.0 * font).max(8.0 * font),
            graph,
        }
    }

    /// The upper left corner of a panel.
    pub(super) fn corner(&self, index: usize) -> [f64; 2] {
        [
            self.left + self.inset + (index % self.columns) as f64 * self.pitch[0],
            self.top + (index / self.columns) as f64 * self.pitch[1],
        ]
    }
}

/// Numbers of columns that leave the fewest places empty. Four panels are two by two, but towers stand side by side.
fn columns(count: usize, view: View) -> Vec<usize> {
    let empty = |columns: usize| count.div_ceil(columns) * columns - count;
    if count < 4 {
        return (1..=count.max(1)).filter(|&columns| empty(columns) == 0).collect();
    }
    let least = (2..count).map(empty).min().unwrap_or(0);
    let mut found: Vec<usize> = (2..count).filter(|&columns| empty(columns) == least).collect();
    if view.height() > 2.0 * view.width() {
        found.push(count);
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    const FLAT: View = View { x: [0.0, 10.0], y: [0.0, 1.5] };
    const SQUARE: View = View { x: [0.0, 3.0], y: [0.0, 3.0] };
    const TOWER: View = View { x: [0.0, 1.0], y: [0.0, 6.0] };

    fn layout(view: View, count: usize) -> Layout {
        Layout::new(1600.0, view, Contents { count, columns: None, graph: false })
    }

    #[test]
    fn four_panels_are_two_by_two_and_no_place_is_empty() {
        for view in [FLAT, SQUARE] {
            assert_eq!(layout(view, 4).columns, 2);
            for count in [1, 2, 3, 4, 6, 8, 9, 12] {
                assert_eq!(count % layout(view, count).columns, 0, "{count}");
            }
        }
        assert_eq!(layout(TOWER, 4).columns, 4);
    }

    #[test]
    fn panels_stay_within_the_picture() {
        for view in [FLAT, SQUARE, TOWER] {
            for count in [1, 2, 4, 5, 7, 12] {
                let layout = layout(view, count);
                for [left, top] in (0..count).map(|index| layout.corner(index)) {
                    assert!(left >= layout.left - 1e-9 && top >= layout.top);
                    assert!(left + layout.panel[0] < layout.width);
                    assert!(top + layout.panel[1] < layout.bar_top);
                }
            }
        }
    }
}
