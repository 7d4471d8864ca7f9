//! Models and truth in numbers.

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
    let truth = sweep.with_truth();
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
    for m in &sweep.measured {
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

/// Distances of all models over time, and their states beside that of the truth.
pub(super) fn over_time(sweep: &Sweep) -> [Table; 2] {
    let columns = [
        "model",
        "time [s]",
        "distance [m]",
        "spread [m]",
        "ratio",
        "mass misplaced",
        "between seeds",
    ];
    let mut distances = Table::new("Distances over time", columns)
        .note("Spread and the last column: between two seeds of the discs.");
    let columns = [
        "model",
        "time [s]",
        "front [m]",
        "discs",
        "connected front [m]",
        "discs",
        "centre of mass x [m]",
        "discs",
        "y [m]",
        "discs",
        "kinetic energy [J/kg]",
        "discs",
    ];
    let mut states = Table::new("States over time", columns).note(
        "Beside each quantity that of the discs: mean over seeds ± standard deviation. The connected \
         front is empty where trajectories lack it.",
    );
    for m in &sweep.measured {
        let Some(found) = &m.comparison else { continue };
        let mut next = INTERVAL;
        for row in &found.rows {
            if row.time > next - 1e-6 {
                distances.row(distance_cells(&m.name, row));
                states.row(state_cells(&m.name, row));
                next = row.time + INTERVAL;
            }
        }
    }
    [distances, states]
}

fn distance_cells(name: &str, row: &Row) -> [String; 7] {
    let optional = |value: Option<f64>| value.map_or(String::new(), number);
    [
        name.to_owned(),
        number(row.time),
        number(row.distance),
        optional(row.spread),
        optional(row.ratio()),
        number(row.misplaced),
        optional(row.misplaced_spread),
    ]
}

fn state_cells(name: &str, row: &Row) -> [String; 12] {
    [
        name.to_owned(),
        number(row.time),
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
