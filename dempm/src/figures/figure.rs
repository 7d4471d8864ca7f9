//! Panels with common axes above one key.

use image::RgbImage;
use plot::{
    Anchor, Canvas, ColourScale, Curve, Graph, INK, Pen, PenError, RGBColor, Range, series_colour,
    tick_texts, ticks,
};

use super::error::FigureError;
use super::key::{Key, draw_names};
use super::layout::{Contents, Layout};
use super::options::{Compare, Options};
use super::panel::{Disc, Paint, Panel};
use super::shorten::shortened;
use super::shown::Shown;
use super::view::View;

const WALL: RGBColor = RGBColor(70, 70, 70);
const BOX: RGBColor = RGBColor(196, 196, 196);
/// Radius in pictures over that of a grain.
const SHRUNK: f64 = 0.95;

/// The layout of a figure: everything but the frames in it.
pub(super) struct Figure {
    title: String,
    key: Key,
    /// Grains are drawn with exact edges.
    grains: bool,
    view: View,
    layout: Layout,
    /// The graph over time, if runs are compared.
    graph: Option<TimeGraph>,
}

/// Distances of runs from the first over time.
struct TimeGraph {
    curves: Vec<Curve>,
    /// Colours and names of the runs.
    names: Vec<(RGBColor, String)>,
    /// Name of the first run.
    first: String,
}

impl Figure {
    /// A figure of `count` panels with a `view`, for the values of `panels` and others like them.
    pub(super) fn new(
        shown: &Shown<'_>,
        options: &Options,
        panels: &[Panel],
        view: View,
        count: usize,
        width: u32,
    ) -> Self {
        let view = view.framed(shown.runs[0].bodies.trajectory.header());
        let graph = TimeGraph::of(shown);
        // A row for each time.
        let a_time = shown.panels_a_time();
        let columns = (a_time > 1 && count > a_time).then_some(a_time);
        let contents = Contents { count, columns, graph: graph.is_some() };
        Self {
            title: shown.title(),
            key: key(shown, options, panels),
            grains: options.grains,
            view,
            layout: Layout::new(f64::from(width), view, contents),
            graph,
        }
    }

    /// Width and height, pixels; both even, as video wants it.
    pub(super) fn size(&self) -> (u32, u32) {
        let even = |size: f64| (size / 2.0).ceil() as u32 * 2;
        (even(self.layout.width), even(self.layout.height))
    }

    /// The colour scale, which a figure of runs in one colour each does not show, and all other colours but greys.
    pub(super) fn colours(&self) -> (ColourScale, Vec<RGBColor>) {
        let curves = self.graph.iter().flat_map(|graph| &graph.curves).map(|curve| curve.colour);
        match &self.key {
            Key::Bar { scale, .. } => (*scale, curves.collect()),
            Key::Runs(runs) => {
                let range = Range { low: 0.0, high: 1.0, cut: [false; 2] };
                let scale = ColourScale { range, log: false, signed: false, classes: None };
                (scale, runs.iter().map(|run| run.0).collect())
            }
        }
    }

    /// Draws as many panels as the layout is for; `times` (s) are those of the panels.
    pub(super) fn draw(&self, panels: &[Panel], times: &[f64]) -> Result<RgbImage, FigureError> {
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
            self.key.draw(pen, &self.layout)?;
            self.draw_graph(pen, times)
        })?;
        Ok(canvas.finish())
    }

    fn draw_title(&self, pen: &Pen<'_, '_>) -> Result<(), PenError> {
        let layout = &self.layout;
        let size = 1.25 * layout.font;
        let room = layout.width - layout.left - layout.font;
        let title = shortened(pen, &self.title, size, room);
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

    /// Place, radius (pixels) and colour of a disc in a panel.
    fn disc(&self, index: usize, disc: &Disc) -> ([f64; 2], f64, RGBColor) {
        let colour = match (disc.paint, &self.key) {
            (Paint::Value(value), Key::Bar { scale, .. }) => scale.colour(value),
            (Paint::Run(run), Key::Runs(runs)) => runs[run].0,
            _ => ColourScale::UNKNOWN,
        };
        (self.place(index, disc.at), disc.radius * self.layout.scale, colour)
    }

    /// Draws grains a little smaller than they are: a light line remains between neighbours.
    fn draw_grains(&self, canvas: &mut Canvas, index: usize, panel: &Panel) {
        for (at, radius, colour) in panel.discs.iter().map(|disc| self.disc(index, disc)) {
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
            for (at, radius, colour) in panel.discs.iter().map(|disc| self.disc(index, disc)) {
                pen.disc(at, radius.max(0.75), colour)?;
            }
        }
        let thin = 0.06 * layout.font;
        for &solid in &panel.boxes {
            if let Some([low, high]) = self.view.clip_box(solid) {
                let (low, high) = (place(low), place(high));
                pen.rectangle([low, high], BOX)?;
                let outline = [low, [high[0], low[1]], high, [low[0], high[1]], low];
                pen.line(&outline, 1.5 * thin, WALL)?;
            }
        }
        for &wall in &panel.walls {
            if let Some(ends) = self.view.clip_segment(wall) {
                pen.line(&ends.map(place), 3.0 * thin, WALL)?;
            }
        }
        self.draw_axes(pen, index, count)?;
        let label = shortened(pen, &panel.label, layout.font, layout.pitch[0]);
        pen.text(&label, [left, top - 0.35 * layout.font], layout.font, Anchor::AboveLeft)
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

    /// Distances over time, with a line at the times of the panels.
    fn draw_graph(&self, pen: &Pen<'_, '_>, times: &[f64]) -> Result<(), PenError> {
        let (Some(graph), Some(frame)) = (&self.graph, self.layout.graph) else { return Ok(()) };
        let font = self.layout.font;
        let title = format!("distance of the points from {}, root mean square:", graph.first);
        let title = shortened(pen, &title, font, 0.6 * (frame[1][0] - frame[0][0]));
        let at = [frame[0][0], frame[0][1] - 1.1 * font];
        pen.text(&title, at, font, Anchor::Left)?;
        let beside = [at[0] + pen.text_width(&title, font) + 1.5 * font, at[1]];
        draw_names(pen, &self.layout, &graph.names, beside)?;
        Graph {
            frame,
            font,
            x: "time (s)",
            y: "RMS (m)",
            curves: &graph.curves,
            marks: times,
            from_zero: true,
        }
        .draw(pen)
    }
}

impl TimeGraph {
    /// `None` of a single run, and where no other has the material of the first.
    fn of(shown: &Shown<'_>) -> Option<Self> {
        let curves = shown.curves();
        let name = |(run, curve): &(usize, Curve)| (curve.colour, shown.runs[*run].name.clone());
        (!curves.is_empty()).then(|| Self {
            names: curves.iter().map(name).collect(),
            curves: curves.into_iter().map(|(_, curve)| curve).collect(),
            first: shown.runs[0].name.clone(),
        })
    }
}

/// What the colours mean.
fn key(shown: &Shown<'_>, options: &Options, panels: &[Panel]) -> Key {
    if shown.compare == Compare::Overlay && shown.runs.len() > 1 {
        let names = shown.runs.iter().map(|run| run.name.clone());
        return Key::Runs(names.enumerate().map(|(k, name)| (series_colour(k), name)).collect());
    }
    let is_difference = shown.compare == Compare::Difference && shown.runs.len() > 1;
    let values = || panels.iter().flat_map(Panel::values);
    let quantity = shown.quantity;
    let is_class = quantity.is_class() && !is_difference;
    let classes = is_class.then(|| values().fold(0.0, f64::max) as usize + 1);
    let is_signed = match is_difference {
        true => !shown.shows_distance,
        false => quantity.is_signed(),
    };
    let range = match classes {
        Some(classes) => Range { low: -0.5, high: classes as f64 - 0.5, cut: [false; 2] },
        None if options.log => Range::robust_log(values()),
        None => Range::robust(values(), is_signed),
    };
    let log = options.log && classes.is_none();
    let (name, unit) = quantity.label();
    let first = &shown.runs[0].name;
    let (name, unit) = match (is_difference, shown.shows_distance) {
        (false, _) if options.average.is_some() => (format!("{name}, mean over cells"), unit),
        (false, _) => (name.to_owned(), unit),
        (true, true) => (format!("distance from {first}"), "m"),
        (true, false) => (format!("{name} minus that of {first}"), unit),
    };
    let grey = values().any(|value| !value.is_finite());
    Key::Bar {
        scale: ColourScale { range, log, signed: is_signed && !log, classes },
        grey: grey.then(|| format!("no finite {}", quantity.label().0)),
        name,
        unit,
    }
}
