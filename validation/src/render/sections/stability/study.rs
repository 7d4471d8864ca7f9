//! Studies as blocks of the report.

use plot::{Mark, PlotError, Series};

use crate::render::block::Block;
use crate::render::figure::{Figure, Picture};
use crate::render::map;
use crate::render::point_cloud;
use crate::render::table::Table;
use crate::studies::stability::{Axis, Chart, Finding, Map, Outcome, Study};
use crate::studies::statistics::range;
use crate::text::number;

/// A study as the report shows it.
///
/// # Errors
/// If a chart or picture cannot be drawn.
pub fn blocks(study: &Study) -> Result<Vec<Block>, PlotError> {
    let mut blocks = vec![Block::text(&study.method)];
    if !study.findings.is_empty() {
        blocks.push(Block::Findings(vec![summary(study)]));
        blocks.push(Block::Table(thresholds(study)));
    }
    let said = messages(study);
    if !said.rows.is_empty() {
        blocks.push(Block::Table(said));
    }
    for map in &study.maps {
        blocks.push(Block::Map(rendered(map)));
    }
    for chart in &study.charts {
        let picture = Picture::Svg(svg(chart)?);
        blocks.push(Block::Figure(Figure::new(&chart.title, picture, &chart.caption)));
    }
    blocks.extend(study.pictures.iter().map(|picture| Block::Figure(point_cloud::figure(picture))));
    if !study.notes.is_empty() {
        blocks.push(Block::List(study.notes.clone()));
    }
    Ok(blocks)
}

/// The outcome of a run as maps show it.
fn kind(outcome: &Outcome) -> map::Outcome {
    match outcome {
        Outcome::Stable => map::Outcome::Stable,
        Outcome::Warned { .. } => map::Outcome::Warned,
        Outcome::Failed { .. } => map::Outcome::Failed,
        Outcome::Silent { .. } => map::Outcome::Silent,
    }
}

/// The study in a line: how many thresholds, how close to theory, and failures without a message.
fn summary(study: &Study) -> String {
    let failed: Vec<_> = study.findings.iter().filter(|f| !f.beyond.works()).collect();
    let mut line = study.of.as_ref().map_or(String::new(), |model| format!("{model}: "));
    line += &format!("{} of {} thresholds were reached", failed.len(), study.findings.len());
    let is_silent = |outcome: &Outcome| kind(outcome) == map::Outcome::Silent;
    let silent: Vec<&str> =
        failed.iter().filter(|f| is_silent(&f.beyond)).map(|f| f.case.as_str()).collect();
    if !silent.is_empty() {
        line += &format!("; without a warning: {}", silent.join("; "));
    } else if !failed.is_empty() {
        line += ", each with a warning or an error";
    }
    let of_theory = |finding: &Finding| {
        let (theory, _) = finding.theory.as_ref()?;
        Some(finding.measured.value()? / theory).filter(|ratio| ratio.is_finite())
    };
    let ratios: Vec<f64> = study.findings.iter().filter_map(of_theory).collect();
    if let Some([least, most]) = range(ratios.iter().copied()) {
        line += &format!(
            ". Measured thresholds are {} to {} times those of theory ({} of them)",
            number(least),
            number(most),
            ratios.len()
        );
    }
    let cells: Vec<_> = study.maps.iter().flat_map(|map| map.outcomes.iter().flatten()).collect();
    if !cells.is_empty() {
        let silent = cells.iter().filter(|outcome| is_silent(outcome)).count();
        line += &format!(". Of {} cells of the maps, {silent} failed silently", cells.len());
    }
    line + "."
}

fn thresholds(study: &Study) -> Table {
    let columns = ["case", "parameter", "threshold", "theory", "beyond it"];
    let mut table = Table::new(titled("Thresholds", study), columns);
    for finding in &study.findings {
        let theory = finding.theory.as_ref();
        let theory = theory.map(|(value, formula)| format!("{} ({formula})", number(*value)));
        let (word, ..) = kind(&finding.beyond).words();
        table.row([
            finding.case.clone(),
            finding.parameter.clone(),
            finding.measured.to_string(),
            theory.unwrap_or_default(),
            word.to_owned(),
        ]);
    }
    table
}

/// The message beyond each threshold, or the symptom without a message.
fn messages(study: &Study) -> Table {
    let mut table = Table::new(titled("What was said", study), ["case", "beyond it"]);
    for finding in study.findings.iter().filter(|f| !f.beyond.text().is_empty()) {
        table.row([finding.case.as_str(), finding.beyond.text()]);
    }
    table
}

/// Titles are unique in a section, which may push several models.
fn titled(title: &str, study: &Study) -> String {
    study.of.as_ref().map_or(title.into(), |model| format!("{title} ({model})"))
}

fn rendered(map: &Map) -> map::Map {
    let texts = |axis: &Axis| {
        let numbers = || axis.values.iter().map(|v| number(*v)).collect();
        (axis.label.clone(), axis.names.clone().unwrap_or_else(numbers))
    };
    let cells = map.outcomes.iter().enumerate().map(|(row, outcomes)| {
        let cell = |(column, outcome): (usize, &Outcome)| {
            let value = map.numbers.get(row).and_then(|row| row.get(column));
            (kind(outcome), value.map_or(String::new(), |value| number(*value)))
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

fn svg(chart: &Chart) -> Result<String, plot::PlotError> {
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
    let axis = |label: &str, log: bool| plot::Axis { label: label.to_owned(), log };
    plot::Chart {
        series: series.collect(),
        x: axis(&chart.x, chart.log[0]),
        y: axis(&chart.y, chart.log[1]),
        floor: None,
    }
    .svg()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::studies::stability::{Curve, Picture as PointPicture, Threshold};

    #[test]
    fn a_study_becomes_blocks_with_its_messages() {
        let silent = Outcome::Silent { symptom: "wrong".into() };
        let mut study = Study {
            method: "how".into(),
            findings: vec![Finding {
                case: "case".into(),
                parameter: "m".into(),
                measured: Threshold::Between(1.0, 4.0),
                theory: Some((2.0, "formula".into())),
                beyond: silent.clone(),
            }],
            maps: vec![Map {
                title: "map".into(),
                x: Axis::new("x", vec![1.0, 2.0]),
                y: Axis::named("y", vec!["a".into()]),
                outcomes: vec![vec![Outcome::Stable, silent]],
                numbers: vec![vec![0.5, f64::NAN]],
                caption: "caption.".into(),
            }],
            charts: vec![Chart {
                title: "chart".into(),
                x: "x".into(),
                y: "y".into(),
                log: [false, true],
                curves: vec![Curve::measured("m", vec![[1.0, 2.0]])],
                caption: String::new(),
            }],
            pictures: vec![PointPicture {
                title: "picture".into(),
                position: vec![[0.5, 0.5]],
                value: vec![1.0],
                radius: vec![0.1],
                window: [0.0, 0.0, 1.0, 1.0],
                ..PointPicture::default()
            }],
            ..Study::default()
        };
        study.name_model("tiny");
        let blocks = blocks(&study).unwrap();
        let [
            Block::Text(_),
            Block::Findings(summary),
            Block::Table(table),
            Block::Table(said),
            Block::Map(map),
            rest @ ..,
        ] = blocks.as_slice()
        else {
            panic!("{blocks:?}")
        };
        assert_eq!(
            summary,
            &[
                "tiny: 1 of 1 thresholds were reached; without a warning: case. Measured thresholds are \
               1 to 1 times those of theory (1 of them). Of 2 cells of the maps, 1 failed silently."
            ]
        );
        assert_eq!(table.title, "Thresholds (tiny)");
        assert_eq!(
            table.rows,
            [["case", "m", "1 to 4", "2 (formula)", "failed silently"].map(str::to_owned)]
        );
        assert_eq!(said.rows, [["case", "wrong"].map(str::to_owned)]);
        assert_eq!(map.title, "map (tiny)");
        assert_eq!(map.cells[0][0], (map::Outcome::Stable, "0.5".into()));
        assert_eq!(map.cells[0][1], (map::Outcome::Silent, String::new()));
        assert_eq!(map.caption, "caption. One of the failures: wrong.");
        assert_eq!(rest.len(), 2);
    }
}
