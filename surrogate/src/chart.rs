//! Line charts as SVG.

use std::ops::Range;
use std::path::Path;

use files::{WriteError, write_text};
use plot::FONT;
use plotters::prelude::*;
use plotters::style::RGBColor;

const SIZE: (u32, u32) = (900, 540);
const TEXT: u32 = 15;

/// Colours that people with any kind of colour vision tell apart (Okabe and Ito).
const COLOURS: [RGBColor; 7] = [
    RGBColor(0, 114, 178),
    RGBColor(213, 94, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(230, 159, 0),
    RGBColor(86, 180, 233),
    RGBColor(90, 90, 90),
];

/// A line and its name.
pub struct Line {
    /// As the legend has it.
    pub name: String,
    /// Places (x, y).
    pub points: Vec<(f64, f64)>,
    /// Drawn black and thick, as what others are compared with.
    pub reference: bool,
}

/// A chart with a logarithmic y axis.
pub struct Chart {
    /// Above everything.
    pub title: String,
    /// Below the x axis.
    pub x: String,
    /// Beside the y axis.
    pub y: String,
    /// What it shows.
    pub lines: Vec<Line>,
    /// Where the names of the lines are.
    pub legend: SeriesLabelPosition,
}

/// A chart that could not be made.
#[derive(Debug, thiserror::Error, miette::Diagnostic)]
pub enum ChartError {
    #[error("cannot draw the chart: {0}")]
    Draw(String),
    #[error(transparent)]
    #[diagnostic(transparent)]
    Write(#[from] WriteError),
}

impl Chart {
    /// Writes the chart as SVG. Values that have no logarithm are left out.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn write(&self, path: &Path) -> Result<(), ChartError> {
        let mut text = String::new();
        self.draw(&mut text).map_err(|error| ChartError::Draw(error.to_string()))?;
        Ok(write_text(path, &text)?)
    }

    fn draw(&self, text: &mut String) -> Result<(), Box<dyn std::error::Error + '_>> {
        plot::register_font()?;
        let area = SVGBackend::with_string(text, SIZE).into_drawing_area();
        area.fill(&WHITE)?;
        let [x, y] = self.ranges();
        let mut chart = ChartBuilder::on(&area)
            .caption(&self.title, (FONT, TEXT + 3))
            .margin(12)
            .margin_right(30)
            .x_label_area_size(46)
            .y_label_area_size(78)
            .build_cartesian_2d(x, y.log_scale())?;
        chart
            .configure_mesh()
            .light_line_style(BLACK.mix(0.05))
            .bold_line_style(BLACK.mix(0.12))
            .label_style((FONT, TEXT))
            .x_desc(&self.x)
            .y_desc(&self.y)
            .x_label_formatter(&|value| ((value * 1e6).round() / 1e6).to_string())
            .y_label_formatter(&|value| format!("{value:.0e}"))
            .draw()?;
        for (index, line) in self.lines.iter().enumerate() {
            let style = match line.reference {
                true => BLACK.stroke_width(3),
                false => COLOURS[index % COLOURS.len()].stroke_width(2),
            };
            chart
                .draw_series(LineSeries::new(drawable(&line.points), style))?
                .label(&line.name)
                .legend(move |(x, y)| PathElement::new([(x, y), (x + 22, y)], style));
        }
        chart
            .configure_series_labels()
            .position(self.legend.clone())
            .background_style(WHITE.mix(0.85))
            .label_font((FONT, TEXT))
            .draw()?;
        area.present()?;
        drop(chart);
        Ok(())
    }

    /// Ranges of all lines, the logarithmic one with some air.
    fn ranges(&self) -> [Range<f64>; 2] {
        let all = || self.lines.iter().flat_map(|line| drawable(&line.points));
        let range = |values: &mut dyn Iterator<Item = f64>| {
            values.fold((f64::MAX, f64::MIN), |(low, high), v| (low.min(v), high.max(v)))
        };
        let (left, right) = range(&mut all().map(|(x, _)| x));
        let (low, high) = range(&mut all().map(|(_, y)| y));
        if left > right {
            return [0.0..1.0, 0.1..1.0];
        }
        let right = if right > left { right } else { left + 1.0 };
        [left..right, low / 1.5..high * 1.5]
    }
}

fn drawable(points: &[(f64, f64)]) -> impl Iterator<Item = (f64, f64)> + '_ {
    points.iter().copied().filter(|(x, y)| x.is_finite() && y.is_finite() && *y > 0.0)
}
