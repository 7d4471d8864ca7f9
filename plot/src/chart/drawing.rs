//! Drawing a chart with plotters.

use std::ops::Range;

use plotters::coord::combinators::{BindKeyPoints, WithKeyPoints};
use plotters::coord::ranged1d::{Ranged, ValueFormatter};
use plotters::prelude::*;
use plotters::style::RGBColor;

use super::area::{BAND, DOTS, Drawn, HEIGHT, TEXT, WIDTH};
use super::colours::{GRID, INK, dark_style, series_colour};
use super::labels::offsets;
use super::legend::{self, Entry};
use super::series::{Axis, Mark, Series};
use crate::error::PlotError;
use crate::font::{FONT, register_font};
use crate::number::number;
use crate::ticks::log_ticks;

/// Ticks of a linear axis at most.
const LABELS: usize = 8;

/// A chart with a legend below it. Values that a logarithmic axis cannot show are left out.
#[derive(Clone, Debug, PartialEq)]
pub struct Chart {
    /// Horizontal axis.
    pub x: Axis,
    /// Vertical axis.
    pub y: Axis,
    /// Drawn in this order, each in the next colour.
    pub series: Vec<Series>,
    /// The region below this y is shaded and labelled with this text.
    pub floor: Option<(f64, String)>,
}

impl Chart {
    /// The text of an SVG file, which follows light and dark by itself.
    ///
    /// # Errors
    /// If plotters refuses, for example without its font.
    pub fn svg(&self) -> Result<String, PlotError> {
        self.svg_of_size([WIDTH, HEIGHT])
    }

    /// The same with another width and height (without the legend), pixels. Texts keep their size: a
    /// small chart stays readable on a phone.
    ///
    /// # Errors
    /// As [`svg`](Self::svg).
    pub fn svg_of_size(&self, size: [u32; 2]) -> Result<String, PlotError> {
        let mut text = String::new();
        register_font()?;
        self.draw_into(&mut text, size).map_err(|error| PlotError::Draw {
            what: format!("the chart of {}", self.y.label),
            reason: error.to_string(),
        })?;
        let style = format!("<style>{}</style>", dark_style());
        let end = text.find('>').map_or(text.len(), |end| end + 1);
        text.insert_str(end, &style);
        Ok(text.replacen("<svg ", "<svg class=\"chart\" ", 1))
    }

    fn draw_into<'a>(&self, text: &'a mut String, [width, height]: [u32; 2]) -> Drawn<'a> {
        let entries = self.legend();
        let lines = legend::lines(&entries, width);
        let legend = legend::LINE * lines.len() as u32 + 6;
        let area = SVGBackend::with_string(text, (width, height + legend)).into_drawing_area();
        let (upper, lower) = area.split_vertically(height);
        let [x, y] = self.ranges();
        let mut builder = ChartBuilder::on(&upper);
        builder.margin(8).margin_right(24).x_label_area_size(46).y_label_area_size(72);
        match (self.x.log, self.y.log) {
            (false, false) => self.plot(builder.build_cartesian_2d(x, y)?)?,
            (true, false) => self.plot(builder.build_cartesian_2d(logarithmic(x), y)?)?,
            (false, true) => self.plot(builder.build_cartesian_2d(x, logarithmic(y))?)?,
            (true, true) => {
                self.plot(builder.build_cartesian_2d(logarithmic(x), logarithmic(y))?)?
            }
        }
        legend::draw(&lower, &lines)?;
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
            .x_labels(LABELS)
            .y_labels(LABELS)
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
                Mark::Band => {
                    let outline: Vec<_> = places.iter().map(|(place, _)| *place).collect();
                    chart.draw_series([Polygon::new(outline, colour.mix(BAND).filled())])?;
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
                            Mark::Dots => chart.draw_series([
                                element + Circle::new((0, 0), 2, colour.mix(DOTS).filled())
                            ])?,
                            _ => chart
                                .draw_series([element + Circle::new((0, 0), 5, colour.filled())])?,
                        };
                    }
                }
            }
        }
        self.draw_labels(&mut chart)?;
        if let Some((floor, meaning)) = &self.floor
            && *floor > y.start
        {
            // At the left end, just above the axis: what is within the shade is mostly near its edge.
            let text = Text::new(meaning.clone(), (6, -14), style(TEXT - 1));
            chart.draw_series([EmptyElement::at((x.start, y.start)) + text])?;
        }
        Ok(())
    }

    fn draw_labels<'a, X, Y>(
        &self,
        chart: &mut ChartContext<'_, SVGBackend<'a>, Cartesian2d<X, Y>>,
    ) -> Drawn<'a>
    where
        X: Ranged<ValueType = f64> + ValueFormatter<f64>,
        Y: Ranged<ValueType = f64> + ValueFormatter<f64>,
    {
        let pixel = |place: &(f64, f64)| <[i32; 2]>::from(chart.backend_coord(place));
        let marked = self.series.iter().filter(|s| !s.mark.joins());
        let points: Vec<((f64, f64), &str)> = marked.flat_map(|s| self.shown(s)).collect();
        let marks: Vec<[i32; 2]> = points.iter().map(|(place, _)| pixel(place)).collect();
        let lines = self.series.iter().filter(|s| s.mark.joins());
        let labelled: Vec<((f64, f64), &str)> = points
            .iter()
            .copied()
            .chain(lines.flat_map(|s| self.shown(s)))
            .filter(|(_, label)| !label.is_empty())
            .collect();
        let labels: Vec<([i32; 2], &str)> =
            labelled.iter().map(|(place, label)| (pixel(place), *label)).collect();
        let (x, y) = chart.plotting_area().get_pixel_range();
        let frame = [x.start, y.start, x.end, y.end];
        let style = (FONT, TEXT - 1).into_font().color(&INK);
        let offsets = offsets(&labels, &marks, frame, TEXT - 1);
        for ((place, label), offset) in labelled.into_iter().zip(offsets) {
            let text = Text::new(label.to_owned(), offset, style.clone());
            chart.draw_series([EmptyElement::at(place) + text])?;
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
            let colour = series_colour(next);
            next += usize::from(series.mark != Mark::Band);
            colour
        };
        self.series.iter().map(colour).collect()
    }

    fn legend(&self) -> Vec<Entry> {
        let entry = |(series, colour): (&Series, RGBColor)| Entry {
            name: series.name.clone(),
            mark: series.mark,
            colour,
        };
        let entries = self.series.iter().zip(self.colours()).map(entry);
        entries.filter(|entry| !entry.name.is_empty()).collect()
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

/// A range with some air around the values.
fn range(values: impl Iterator<Item = f64>, log: bool) -> Range<f64> {
    let (low, high) = values
        .filter(|value| value.is_finite() && (!log || *value > 0.0))
        .fold((f64::MAX, f64::MIN), |(low, high), v| (low.min(v), high.max(v)));
    match (low > high, log) {
        (true, true) => 0.1..1.0,
        (true, false) => 0.0..1.0,
        (false, true) => {
            // At least a factor of five, so that there are two ticks.
            let (low, high) = (low / 1.6, high * 1.6);
            let air = (5.0 * low / high).max(1.0).sqrt();
            let (low, high) = (low / air, high * air);
            low..high
        }
        (false, false) => {
            let air = if high > low { 0.05 * (high - low) } else { 0.5 * high.abs().max(1.0) };
            let start = if low >= 0.0 && low - air < 0.25 * (high - low) { 0.0 } else { low - air };
            start..high + air
        }
    }
}

/// A logarithmic axis, with ticks within a decade if there are few.
fn logarithmic(range: Range<f64>) -> WithKeyPoints<LogCoord<f64>> {
    let ticks = log_ticks(range.start, range.end);
    range.log_scale().with_key_points(ticks)
}

/// The text of a tick; rounded, since plotters adds up steps.
fn tick(value: f64, range: &Range<f64>) -> String {
    let small = 1e-9 * (range.end - range.start).abs();
    if value.abs() < small && range.start <= 0.0 { "0".to_owned() } else { number(value) }
}

#[cfg(test)]
mod tests {
    use super::super::colours::inlined;
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
        let svg = chart().svg().unwrap();
        let style = dark_style();
        let body = svg.replace(&style, "");
        for colour in body.split('"').filter(|part| part.starts_with('#')) {
            assert!(style.contains(colour), "{colour} in {body}");
        }
        assert!(body.contains("noise") && body.contains("solver"));
        assert!(!inlined(&svg, "t").contains("<style>"));
    }

    #[test]
    fn a_band_has_the_colour_of_its_line() {
        let outline = vec![(1.0, 1e-3), (2.0, 1e-3), (2.0, 1e-4)];
        let mut chart = chart();
        chart.series.insert(0, Series::new("95 %", Mark::Band, outline));
        assert_eq!(chart.colours(), [series_colour(0), series_colour(0), INK]);
        assert!(chart.svg().unwrap().contains("<polygon opacity=\"0.25\" fill=\"#0072B2\""));
    }

    #[test]
    fn ticks_are_rounded() {
        assert_eq!([0.4, 1e-18].map(|value| tick(value, &(0.0..1.0))), ["0.4", "0"]);
        assert_eq!(tick(1e-12, &(1e-12..1.0)), "1.0e-12");
    }

    #[test]
    fn a_value_without_a_logarithm_is_left_out() {
        assert_eq!(chart().shown(&chart().series[0]), [((1.0, 1e-3), "1")]);
        let wide = range([3e-6, 0.0, 2e-3].into_iter(), true);
        assert!(wide.start < 3e-6 && wide.start > 1e-6 && wide.end > 2e-3 && wide.end < 4e-3);
        let narrow = range([2.0, 3.0].into_iter(), true);
        assert!((narrow.end / narrow.start - 5.0).abs() < 1e-9);
        assert!(log_ticks(narrow.start, narrow.end).len() >= 2);
        assert_eq!(range([].into_iter(), false), 0.0..1.0);
    }
}
