//! Models and truth in numbers.

use super::charts::shown;
use crate::render::table::Table;
use crate::studies::sweep::{Measured, Sweep};
use crate::text::{number, percent};
use crate::truth::{Row, Seeds};

/// Time between rows of the table over time, s.
const INTERVAL: f64 = 0.1;

/// All models at their worst and at the end.
pub(super) fn summary(sweep: &Sweep) -> Table {
    let columns = [
        "model",
        "wall time [s]",
        "largest ratio",
        "at [s]",
        "distance there [m]",
        "spread there [m]",
        "distance at the end [m]",
        "misplaced at the end",
        "front at the end [m]",
        "centre of mass off [m]",
        "at rest after [s]",
    ];
    let truth = sweep.measured.iter().filter_map(|m| m.comparison.as_ref()).next_back();
    let last = truth.and_then(|found| found.rows.last());
    let rest = truth.and_then(|found| found.true_arrest);
    let note = format!(
        "The discs: front {} at the end, at rest after {} s (mean over {} seeds ± standard deviation). \
         The row of the discs is one seed against the others. Wall times are those of the computation, \
         one run at a time. Centre of mass: largest distance from the discs' mean.",
        last.map_or(String::new(), |row| format!("{} m", seeds(&row.true_front))),
        rest.map_or("more than the run's duration".to_owned(), |rest| seeds(&rest)),
        sweep.seeds
    );
    let mut table = Table::new("Models and discs", columns).note(note);
    for m in shown(sweep) {
        table.row(summary_row(m));
    }
    table
}

fn summary_row(m: &Measured) -> [String; 11] {
    let found = m.comparison.as_ref();
    let worst = found.and_then(|found| found.worst());
    let last = found.and_then(|found| found.rows.last());
    let of = |row: Option<&Row>, value: fn(&Row) -> f64| {
        row.map_or(String::new(), |row| number(value(row)))
    };
    let spread = worst.and_then(|row| row.spread);
    let off = found.map(|found| found.rows.iter().map(Row::centre_distance).fold(0.0, f64::max));
    [
        m.name.clone(),
        if m.failure.is_empty() { number(m.seconds) } else { "failed".to_owned() },
        worst.and_then(Row::ratio).map_or(String::new(), number),
        of(worst, |row| row.time),
        of(worst, |row| row.distance),
        spread.map_or(String::new(), number),
        of(last, |row| row.distance),
        last.map_or(String::new(), |row| percent(row.misplaced)),
        of(last, |row| row.front),
        off.map_or(String::new(), number),
        match found.map(|found| found.arrest) {
            Some(Some(time)) => number(time),
            Some(None) => "not at rest".to_owned(),
            None => String::new(),
        },
    ]
}

/// All models over time.
pub(super) fn over_time(sweep: &Sweep) -> Table {
    let columns = [
        "model",
        "time [s]",
        "distance [m]",
        "spread [m]",
        "ratio",
        "misplaced",
        "misplaced between seeds",
        "front [m]",
        "front of the discs [m]",
        "connected front [m]",
        "connected front of the discs [m]",
        "centre of mass x [m]",
        "of the discs [m]",
        "y [m]",
        "of the discs [m]",
        "kinetic energy [J/kg]",
        "of the discs [J/kg]",
    ];
    let mut table = Table::new("Over time", columns).note(
        "Of the discs: mean over seeds ± standard deviation. Cells are empty where a trajectory lacks a \
         quantity.",
    );
    for m in shown(sweep) {
        let Some(found) = &m.comparison else { continue };
        let mut next = INTERVAL;
        for row in &found.rows {
            if row.time > next - 1e-6 {
                table.row(cells(&m.name, row));
                next = row.time + INTERVAL;
            }
        }
    }
    table
}

fn cells(name: &str, row: &Row) -> [String; 17] {
    let optional = |value: Option<f64>| value.map_or(String::new(), number);
    [
        name.to_owned(),
        number(row.time),
        number(row.distance),
        optional(row.spread),
        optional(row.ratio()),
        number(row.misplaced),
        optional(row.misplaced_spread),
        metres(row.front),
        seeds(&row.true_front),
        row.connected_front.map_or(String::new(), metres),
        row.true_connected_front.map_or(String::new(), |front| seeds(&front)),
        metres(row.centre[0]),
        seeds(&row.true_centre[0]),
        metres(row.centre[1]),
        seeds(&row.true_centre[1]),
        metres(row.kinetic_energy),
        seeds(&row.true_kinetic_energy),
    ]
}

fn seeds(of: &Seeds) -> String {
    let deviation =
        of.deviation.map_or(String::new(), |deviation| format!(" ± {}", metres(deviation)));
    format!("{}{deviation}", metres(of.mean))
}

fn metres(value: f64) -> String {
    format!("{value:.3}")
}
