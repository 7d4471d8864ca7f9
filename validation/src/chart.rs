//! Charts as SVG that can be read in light and in dark: drawn with plotters in the colours of a
//! light page, which a style sheet exchanges in a dark one.

use std::fmt::Write as _;
use std::ops::Range;

use plotters::coord::Shift;
use plotters::coord::ranged1d::{Ranged, ValueFormatter};
use plotters::prelude::*;
use plotters::style::{FontStyle, RGBColor, register_font};

use crate::figure::Picture;
use crate::table::number;

const FONT: &str = "DejaVu Sans";
static FONT_FILE: &[u8] = include_bytes!("../../dempm/assets/DejaVuSans-subset.ttf");
const WIDTH: u32 = 760;
const HEIGHT: u32 = 440;
const TEXT: u32 = 14;
const LEGEND_LINE: u32 = 24;

const INK: RGBColor = RGBColor(0x1C, 0x1C, 0x1A);
const GRID: RGBColor = RGBColor(0xDC, 0xDB, 0xD4);

/// Colours that people with any kind of colour vision tell apart (after Okabe and Ito), and their
/// brighter twins for a dark page.
const COLOURS: [(RGBColor, &str); 8] = [
    (RGBColor(0x00, 0x72, 0xB2), "#4FB0EC"),
    (RGBColor(0xD5, 0x5E, 0x00), "#FF8A3D"),
    (RGBColor(0x00, 0x8F, 0x68), "#2FCFA2"),
    (RGBColor(0xB8, 0x5C, 0x93), "#E79AC8"),
    (RGBColor(0xB8, 0x7A, 0x00), "#F2BE4A"),
    (RGBColor(0x6A, 0x4C, 0xA8), "#B39DEB"),
    (RGBColor(0x6B, 0x6B, 0x66), "#A9A79F"),
    (RGBColor(0x9B, 0x22, 0x26), "#F07B78"),
];

/// How a series is drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mark {
    Line,
    /// A line in the colour of the text, to compare others with.
    Reference,
    Circles,
    Squares,
    Triangles,
    Crosses,
}

/// Places that belong together.
#[derive(Clone, Debug, PartialEq)]
pub struct Series {
    /// As the legend has it.
    pub name: String,
    pub points: Vec<(f64, f64)>,
    pub mark: Mark,
    /// A short text beside each point; empty for none.
    pub labels: Vec<String>,
}

impl Series {
    pub fn new(name: impl Into<String>, mark: Mark, points: Vec<(f64, f64)>) -> Self {
        Self { name: name.into(), points, mark, labels: Vec::new() }
    }
}

/// An axis.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Axis {
    pub label: String,
    pub log: bool,
}

impl Axis {
    pub fn linear(label: impl Into<String>) -> Self {
        Self { label: label.into(), log: false }
    }

    pub fn log(label: impl Into<String>) -> Self {
        Self { label: label.into(), log: true }
    }
}

/// A chart. Values that a logarithmic axis cannot show are left out.
#[derive(Clone, Debug, PartialEq)]
pub struct Chart {
    pub x: Axis,
    pub y: Axis,
    pub series: Vec<Series>,
    /// Everything below this y is shaded, and what that means.
    pub floor: Option<(f64, String)>,
}

/// A chart that cannot be drawn.
#[derive(Debug, thiserror::Error, miette::Diagnostic)]
#[error("cannot draw the chart of {what}: {reason}")]
pub struct ChartError {
    what: String,
    reason: String,
}

type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;
type Drawn<'a> = Result<(), Box<dyn std::error::Error + 'a>>;

impl Chart {
    /// The chart as SVG.
    ///
    /// # Errors
    /// If the library refuses, such as without its font.
    pub fn draw(&self) -> Result<Picture, ChartError> {
        let mut text = String::new();
        self.draw_into(&mut text).map_err(|error| ChartError {
            what: self.y.label.clone(),
            reason: error.to_string(),
        })?;
        // Alone, the file follows light and dark by itself.
        let style = format!("<style>{}</style>", dark_style());
        let end = text.find('>').map_or(text.len(), |end| end + 1);
        text.insert_str(end, &style);
        Ok(Picture::Svg(text))
    }

    fn draw_into<'a>(&self, text: &'a mut String) -> Drawn<'a> {
        register_font(FONT, FontStyle::Normal, FONT_FILE).map_err(|_| "the font is damaged")?;
        let names: Vec<(String, Mark, usize)> = self.names();
        let lines = legend_lines(&names);
        let legend = LEGEND_LINE * lines.len() as u32 + 6;
        let area = SVGBackend::with_string(text, (WIDTH, HEIGHT + legend)).into_drawing_area();
        let (upper, lower) = area.split_vertically(HEIGHT);
        let [x, y] = self.ranges();
        let mut builder = ChartBuilder::on(&upper);
        builder.margin(8).margin_right(24).x_label_area_size(46).y_label_area_size(72);
        match (self.x.log, self.y.log) {
            (false, false) => self.plot(builder.build_cartesian_2d(x, y)?)?,
            (true, false) => self.plot(builder.build_cartesian_2d(x.log_scale(), y)?)?,
            (false, true) => self.plot(builder.build_cartesian_2d(x, y.log_scale())?)?,
            (true, true) => self.plot(builder.build_cartesian_2d(x.log_scale(), y.log_scale())?)?,
        }
        draw_legend(&lower, &lines)?;
        area.present()?;
        Ok(())
    }

    fn plot<'a, X, Y>(
        &self,
        mut chart: ChartContext<'_, SVGBackend<'a>, Cartesian2d<X, Y>>,
    ) -> Drawn<'a>
    where
        X: Ranged<ValueType = f64> + ValueFormatter<f64>,
        Y: Ranged<ValueType = f64> + ValueFormatter<f64>,
    {
        let [x, y] = self.ranges();
        let style = |size: u32| (FONT, size).into_font().color(&INK);
        if let Some((floor, _)) = &self.floor
            && *floor > y.start
        {
            let corners = [(x.start, y.start), (x.end, floor.min(y.end))];
            chart.draw_series([Rectangle::new(corners, GRID.mix(0.5).filled())])?;
        }
        chart
            .configure_mesh()
            .light_line_style(TRANSPARENT)
            .bold_line_style(GRID)
            .axis_style(INK)
            .label_style(style(TEXT))
            .axis_desc_style(style(TEXT))
            .x_desc(&self.x.label)
            .y_desc(&self.y.label)
            .x_labels(8)
            .y_labels(8)
            .x_label_formatter(&|value| tick(*value, &x))
            .y_label_formatter(&|value| tick(*value, &y))
            .draw()?;
        for (series, colour) in self.series.iter().zip(self.colours()) {
            let places = self.shown(series);
            match series.mark {
                Mark::Line | Mark::Reference => {
                    let line = places.iter().map(|(place, _)| *place);
                    chart.draw_series(LineSeries::new(line, colour.stroke_width(2)))?;
                }
                mark => {
                    for &(place, _) in &places {
                        let element = EmptyElement::at(place);
                        match mark {
                            Mark::Squares => {
                                chart
                                    .draw_series([element
                                        + Rectangle::new([(-5, -5), (5, 5)], colour.filled())])?
                            }
                            Mark::Triangles => chart.draw_series([
                                element + TriangleMarker::new((0, 0), 7, colour.filled())
                            ])?,
                            Mark::Crosses => chart.draw_series([
                                element + Cross::new((0, 0), 5, colour.stroke_width(2))
                            ])?,
                            _ => chart
                                .draw_series([element + Circle::new((0, 0), 5, colour.filled())])?,
                        };
                    }
                }
            }
            for (place, label) in places {
                let text = Text::new(label.to_owned(), (8, -15), style(TEXT - 1));
                chart.draw_series([EmptyElement::at(place) + text])?;
            }
        }
        if let Some((floor, meaning)) = &self.floor
            && *floor > y.start
        {
            // At the left end, just below the edge of the shade.
            let text = Text::new(meaning.clone(), (6, 4), style(TEXT - 1));
            chart.draw_series([EmptyElement::at((x.start, floor.min(y.end))) + text])?;
        }
        Ok(())
    }

    /// Points of a series that the axes can show, with their labels.
    fn shown<'s>(&self, series: &'s Series) -> Vec<((f64, f64), &'s str)> {
        let fits = |value: f64, axis: &Axis| value.is_finite() && (!axis.log || value > 0.0);
        let labels = series.labels.iter().map(String::as_str).chain(std::iter::repeat(""));
        let points = series.points.iter().copied().zip(labels);
        points.filter(|((x, y), _)| fits(*x, &self.x) && fits(*y, &self.y)).collect()
    }

    fn colours(&self) -> Vec<RGBColor> {
        let mut next = 0;
        let colour = |series: &Series| {
            if series.mark == Mark::Reference {
                return INK;
            }
            next += 1;
            COLOURS[(next - 1) % COLOURS.len()].0
        };
        self.series.iter().map(colour).collect()
    }

    /// Entries of the legend: name, mark, and number of the series.
    fn names(&self) -> Vec<(String, Mark, usize)> {
        let mut place = 0;
        let entry = |series: &Series| {
            let colour = if series.mark == Mark::Reference { usize::MAX } else { place };
            place += usize::from(series.mark != Mark::Reference);
            (series.name.clone(), series.mark, colour)
        };
        self.series.iter().map(entry).filter(|(name, ..)| !name.is_empty()).collect()
    }

    fn ranges(&self) -> [Range<f64>; 2] {
        let places = || self.series.iter().flat_map(|s| self.shown(s)).map(|(place, _)| place);
        let floor = self.floor.iter().map(|(y, _)| *y);
        [
            range(places().map(|(x, _)| x), self.x.log),
            range(places().map(|(_, y)| y).chain(floor), self.y.log),
        ]
    }
}

/// A range with some air around the values; whole decades where it is logarithmic.
fn range(values: impl Iterator<Item = f64>, log: bool) -> Range<f64> {
    let (low, high) = values
        .filter(|value| value.is_finite() && (!log || *value > 0.0))
        .fold((f64::MAX, f64::MIN), |(low, high), v| (low.min(v), high.max(v)));
    match (low > high, log) {
        (true, true) => 0.1..1.0,
        (true, false) => 0.0..1.0,
        (false, true) => {
            let decade = |value: f64, up: bool| {
                let exponent = value.log10();
                10_f64.powf(if up { exponent.ceil() } else { exponent.floor() })
            };
            let (low, high) = (decade(low / 1.2, false), decade(high * 1.2, true));
            low..high
        }
        (false, false) => {
            let air = if high > low { 0.05 * (high - low) } else { 0.5 * high.abs().max(1.0) };
            let start = if low >= 0.0 && low - air < 0.25 * (high - low) { 0.0 } else { low - air };
            start..high + air
        }
    }
}

/// The text of a tick; rounded, since plotters adds up steps.
fn tick(value: f64, range: &Range<f64>) -> String {
    let small = 1e-9 * (range.end - range.start).abs();
    if value.abs() < small { "0".to_owned() } else { number(value) }
}

/// Legend entries broken into lines.
fn legend_lines(names: &[(String, Mark, usize)]) -> Vec<Vec<(i32, &(String, Mark, usize))>> {
    let mut lines: Vec<Vec<(i32, &(String, Mark, usize))>> = Vec::new();
    let mut x = i32::MAX;
    for entry in names {
        // About the mean width of a character.
        let width = 40 + (entry.0.chars().count() as f64 * 0.58 * f64::from(TEXT)) as i32;
        if x.saturating_add(width) > WIDTH as i32 {
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

fn draw_legend<'a>(area: &Area<'a>, lines: &[Vec<(i32, &(String, Mark, usize))>]) -> Drawn<'a> {
    for (row, line) in lines.iter().enumerate() {
        let y = row as i32 * LEGEND_LINE as i32 + 12;
        for (x, (name, mark, place)) in line {
            let colour = match *place {
                usize::MAX => INK,
                place => COLOURS[place % COLOURS.len()].0,
            };
            let at = (x + 12, y);
            match mark {
                Mark::Line | Mark::Reference => {
                    area.draw(&PathElement::new([(*x, y), (x + 24, y)], colour.stroke_width(2)))?
                }
                Mark::Circles => area.draw(&Circle::new(at, 5, colour.filled()))?,
                Mark::Squares => area.draw(&Rectangle::new(
                    [(at.0 - 5, y - 5), (at.0 + 5, y + 5)],
                    colour.filled(),
                ))?,
                Mark::Triangles => area.draw(&TriangleMarker::new(at, 7, colour.filled()))?,
                Mark::Crosses => area.draw(&Cross::new(at, 5, colour.stroke_width(2)))?,
            }
            let style = (FONT, TEXT).into_font().color(&INK);
            area.draw(&Text::new(name.clone(), (x + 30, y - 8), style))?;
        }
    }
    Ok(())
}

/// Style that exchanges the colours of charts on a dark screen.
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

/// The chart as a part of a page, which has the style already: named for those who cannot see it.
pub fn inlined(svg: &str, title: &str) -> String {
    let style = format!("<style>{}</style>", dark_style());
    svg.replacen(&style, "", 1).replacen(
        "<svg ",
        &format!("<svg role=\"img\" aria-label=\"{title}\" "),
        1,
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    fn chart() -> Chart {
        Chart {
            x: Axis::log("time [s]"),
            y: Axis::log("error"),
            series: vec![
                Series {
                    labels: vec!["1".into(), "2".into()],
                    ..Series::new("solver", Mark::Circles, vec![(1.0, 1e-3), (10.0, 0.0)])
                },
                Series::new("best", Mark::Reference, vec![(1.0, 1e-3), (20.0, 1e-5)]),
            ],
            floor: Some((2e-6, "noise".into())),
        }
    }

    #[test]
    fn all_colours_of_a_chart_have_a_twin_in_the_dark() {
        let Picture::Svg(svg) = chart().draw().unwrap() else { panic!("not an SVG") };
        let style = dark_style();
        let body = svg.replace(&style, "");
        for colour in body.split('"').filter(|part| part.starts_with('#')) {
            assert!(style.contains(colour), "{colour} in {body}");
        }
        assert!(body.contains("noise") && body.contains("solver"));
        assert!(!inlined(&svg, "t").contains("<style>"));
    }

    #[test]
    fn a_value_without_a_logarithm_is_left_out() {
        assert_eq!(chart().shown(&chart().series[0]), [((1.0, 1e-3), "1")]);
        assert_eq!(range([3e-6, 0.0, 2e-3].into_iter(), true), 1e-6..1e-2);
        assert_eq!(range([].into_iter(), false), 0.0..1.0);
    }
}
