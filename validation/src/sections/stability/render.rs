//! Studies as blocks of the report.

use super::snapshot;
use super::study::{Axis, Chart, Map, Study};
use crate::block::{Block, Figure, Table};
use crate::chart::{self, ChartError, Mark, Series};
use crate::map;
use crate::table::number;

/// A study as the report shows it.
///
/// # Errors
/// If a chart or picture cannot be drawn.
pub fn blocks(study: &Study) -> Result<Vec<Block>, ChartError> {
    let mut blocks = vec![Block::text(&study.method)];
    if !study.findings.is_empty() {
        blocks.push(Block::Table(table(study)));
    }
    for map in &study.maps {
        blocks.push(Block::Map(rendered(map)));
    }
    for chart in &study.charts {
        let caption = chart.caption.clone();
        blocks.push(Block::Figure(Figure::new(&chart.title, drawn(chart)?, caption)));
    }
    for picture in &study.pictures {
        blocks.push(Block::Figure(snapshot::figure(picture)?));
    }
    if !study.notes.is_empty() {
        blocks.push(Block::List(study.notes.clone()));
    }
    Ok(blocks)
}

fn table(study: &Study) -> Table {
    let columns =
        ["pushed", "parameter", "threshold", "theory", "formula", "beyond it", "what was said"];
    let title =
        study.of.as_ref().map_or("Thresholds".into(), |model| format!("Thresholds ({model})"));
    let mut table = Table::new(title, columns);
    for finding in &study.findings {
        let (value, formula) = match &finding.theory {
            Some((value, formula)) => (number(*value), formula.clone()),
            None => Default::default(),
        };
        let (word, ..) = finding.beyond.kind().words();
        table.row([
            finding.case.clone(),
            finding.parameter.clone(),
            finding.measured.to_string(),
            value,
            formula,
            word.to_owned(),
            finding.beyond.text().to_owned(),
        ]);
    }
    table
}

fn rendered(map: &Map) -> map::Map {
    let texts = |axis: &Axis| {
        let numbers = || axis.values.iter().map(|v| number(*v)).collect();
        (axis.label.clone(), axis.names.clone().unwrap_or_else(numbers))
    };
    let cells = map.outcomes.iter().enumerate().map(|(row, outcomes)| {
        let cell = |(column, outcome): (usize, &super::Outcome)| {
            let value = map.numbers.get(row).and_then(|row| row.get(column));
            (outcome.kind(), value.map_or(String::new(), |value| number(*value)))
        };
        outcomes.iter().enumerate().map(cell).collect()
    });
    let said = map.outcomes.iter().flatten().find(|o| !o.works()).map(|o| o.text().to_owned());
    let said = said.map_or(String::new(), |text| format!(" One of the failures: {text}."));
    map::Map {
        title: map.title.clone(),
        x: texts(&map.x),
        y: texts(&map.y),
        cells: cells.collect(),
        caption: format!("{}{said}", map.caption),
    }
}

fn drawn(chart: &Chart) -> Result<crate::figure::Picture, ChartError> {
    let marks = [Mark::Circles, Mark::Squares, Mark::Triangles, Mark::Crosses];
    let mut measured = 0;
    let series = chart.curves.iter().map(|curve| {
        let mark = if curve.theory {
            Mark::Reference
        } else {
            measured += 1;
            marks[(measured - 1) % marks.len()]
        };
        Series::new(&curve.name, mark, curve.points.iter().map(|&[x, y]| (x, y)).collect())
    });
    let axis = |label: &str, log: bool| {
        if log { chart::Axis::log(label) } else { chart::Axis::linear(label) }
    };
    chart::Chart {
        series: series.collect(),
        x: axis(&chart.x, chart.log[0]),
        y: axis(&chart.y, chart.log[1]),
        floor: None,
    }
    .draw()
}
