//! Distances of runs from the truth.

use std::path::PathBuf;

use dempm::commands::terminal::print_json;
use files::{is_quiet, out};
use miette::miette;
use serde::Serialize;

use crate::text::{number, percent};
use crate::truth::{Comparison, Motion, Reference, Row, Seeds, compare};

/// Times of the table unless others are asked for, s.
pub(super) const TIMES: [f64; 6] = [0.2, 0.5, 1.0, 1.5, 2.0, 3.0];

/// Runs against the truth.
#[derive(Serialize)]
struct Distances {
    /// Material of the truth, such as `discs`.
    truth: String,
    /// Its seeds.
    seeds: Vec<u64>,
    /// The runs at all times.
    runs: Vec<Comparison>,
}

/// Prints the distances as tables in Markdown, or those at all times as one JSON object.
///
/// # Errors
/// If a file cannot be read, or a run cannot be compared with the truth.
pub(super) fn print_distances(
    runs: &[PathBuf],
    truth: &[PathBuf],
    times: &[f64],
    json: bool,
) -> miette::Result<()> {
    let read = |path: &PathBuf| Motion::read(path);
    let truth = truth.iter().map(read).collect::<Result<Vec<_>, _>>()?;
    let truth = Reference::of(truth).map_err(|problem| miette!("{problem}"))?;
    let compared: Vec<Comparison> = runs
        .iter()
        .map(|path| compare(&read(path)?, &truth).map_err(|problem| miette!("{problem}")))
        .collect::<miette::Result<_>>()?;
    let first = &truth.runs[0];
    if json {
        let seeds = truth.runs.iter().map(|run| run.seed).collect();
        return print_json(&Distances { truth: first.material.clone(), seeds, runs: compared });
    }
    let seeds: Vec<String> = truth.runs.iter().map(|run| run.seed.to_string()).collect();
    out!("Truth: {}, seeds {}.\n", first.material, seeds.join(", "))?;
    over_time(&compared, times)?;
    out!("")?;
    summaries(&compared)?;
    if is_quiet() {
        return Ok(());
    }
    out!(
        "\nDistance: root mean square over squares of material and seeds of the truth; spread: the same between\n\
         two seeds. In brackets: the truth, mean over seeds ± standard deviation. Misplaced: share of the mass;\n\
         front: of 99 % of the mass. Ratio: distance over spread, the largest from the time on that is given."
    )?;
    Ok(())
}

fn over_time(compared: &[Comparison], times: &[f64]) -> miette::Result<()> {
    let columns = [
        "run",
        "time [s]",
        "distance [m]",
        "spread [m]",
        "ratio",
        "misplaced",
        "front [m]",
        "connected front [m]",
        "centre of mass x [m]",
        "y [m]",
        "kinetic energy [J/kg]",
    ];
    let connected =
        compared.iter().flat_map(|found| &found.rows).any(|row| row.connected_front.is_some());
    let shown = |column: usize| connected || columns[column] != "connected front [m]";
    print_row(columns.map(str::to_owned), shown)?;
    print_row(columns.map(|_| "---".to_owned()), shown)?;
    for found in compared {
        let mut last = None;
        for row in times.iter().filter_map(|&time| found.at(time)) {
            if last != Some(row.time) {
                print_row(cells(&found.name, row), shown)?;
            }
            last = Some(row.time);
        }
    }
    Ok(())
}

fn cells(name: &str, row: &Row) -> [String; 11] {
    let optional = |value: Option<f64>| value.map_or(String::new(), number);
    let spread = row.misplaced_spread.map_or(String::new(), percent);
    let connected = row.connected_front.zip(row.true_connected_front);
    [
        name.to_owned(),
        number(row.time),
        number(row.distance),
        optional(row.spread),
        optional(row.ratio()),
        beside(percent(row.misplaced), &spread),
        with_truth(row.front, &row.true_front),
        connected.map_or(String::new(), |(front, truth)| with_truth(front, &truth)),
        with_truth(row.centre[0], &row.true_centre[0]),
        with_truth(row.centre[1], &row.true_centre[1]),
        with_truth(row.kinetic_energy, &row.true_kinetic_energy),
    ]
}

fn summaries(compared: &[Comparison]) -> miette::Result<()> {
    let columns = ["run", "largest ratio", "at [s]", "from [s] on", "at rest after [s]"];
    print_row(columns.map(str::to_owned), |_| true)?;
    print_row(columns.map(|_| "---".to_owned()), |_| true)?;
    for found in compared {
        let worst = found.worst();
        let never = || "not at rest".to_owned();
        let arrest = found.arrest.map_or_else(never, number);
        let truth = found.true_arrest.map_or_else(never, |truth| seeds(&truth));
        let row = [
            found.name.clone(),
            worst.and_then(Row::ratio).map_or(String::new(), number),
            worst.map_or(String::new(), |row| number(row.time)),
            number(found.counted_from),
            beside(arrest, &truth),
        ];
        print_row(row, |_| true)?;
    }
    Ok(())
}

fn print_row<const N: usize>(
    cells: [String; N],
    shown: impl Fn(usize) -> bool,
) -> miette::Result<()> {
    let cells = cells.into_iter().enumerate().filter(|(column, _)| shown(*column));
    let cells: Vec<String> = cells.map(|(_, cell)| cell).collect();
    out!("| {} |", cells.join(" | "))?;
    Ok(())
}

fn with_truth(value: f64, truth: &Seeds) -> String {
    beside(fixed(value), &seeds(truth))
}

fn beside(value: String, truth: &str) -> String {
    if truth.is_empty() { value } else { format!("{value} ({truth})") }
}

fn seeds(truth: &Seeds) -> String {
    let deviation =
        truth.deviation.map_or(String::new(), |deviation| format!(" ± {}", fixed(deviation)));
    format!("{}{deviation}", fixed(truth.mean))
}

/// Millimetres are enough.
fn fixed(value: f64) -> String {
    format!("{value:.3}")
}
