//! Models and truth over time.

use plot::{Axis, Chart, Mark, Series};

use crate::render::block::Block;
use crate::render::figure::{Figure, Picture};
use crate::studies::sweep::{Family, Sweep};
use crate::truth::Row;

/// A quantity over time: its title, axis and caption, the model's value and the truth's.
struct Quantity {
    title: &'static str,
    axis: &'static str,
    caption: &'static str,
    reference: &'static str,
    model: fn(&Row) -> Option<f64>,
    truth: fn(&Row) -> Option<f64>,
}

const QUANTITIES: [Quantity; 6] = [
    Quantity {
        title: "Distance from the discs",
        axis: "distance [m]",
        caption: "Root mean square distance of squares of material from the discs, over squares and \
                  seeds. The line in the colour of the text is the spread: the same between two seeds.",
        reference: "two seeds of the discs",
        model: |row| Some(row.distance),
        truth: |row| row.spread,
    },
    Quantity {
        title: "Mass misplaced",
        axis: "share of the mass",
        caption: "Share of the mass in another place than in the discs, mean over seeds, and between two \
                  seeds.",
        reference: "two seeds of the discs",
        model: |row| Some(row.misplaced),
        truth: |row| row.misplaced_spread,
    },
    Quantity {
        title: "Front",
        axis: "front [m]",
        caption: "Front of 99 % of the mass; of the discs, the mean over seeds.",
        reference: "discs",
        model: |row| Some(row.front),
        truth: |row| Some(row.true_front.mean),
    },
    Quantity {
        title: "Connected front",
        axis: "front [m]",
        caption: "The foremost material that hangs together with the pile; of the discs, the mean over \
                  seeds.",
        reference: "discs",
        model: |row| row.connected_front,
        truth: |row| Some(row.true_connected_front?.mean),
    },
    Quantity {
        title: "Height of the centre of mass",
        axis: "height [m]",
        caption: "Height of the centre of mass; of the discs, the mean over seeds.",
        reference: "discs",
        model: |row| Some(row.centre[1]),
        truth: |row| Some(row.true_centre[1].mean),
    },
    Quantity {
        title: "Kinetic energy",
        axis: "kinetic energy [J/kg]",
        caption: "Kinetic energy over mass; of the discs, the mean over seeds, with their rotation and \
                  fluctuations.",
        reference: "discs",
        model: |row| Some(row.kinetic_energy),
        truth: |row| Some(row.true_kinetic_energy.mean),
    },
];

/// All quantities over time.
///
/// # Errors
/// If a chart cannot be drawn.
pub(super) fn charts(sweep: &Sweep) -> miette::Result<Vec<Block>> {
    QUANTITIES.iter().filter_map(|quantity| chart(sweep, quantity).transpose()).collect()
}

/// One quantity over time; `None` where the truth lacks it.
fn chart(sweep: &Sweep, quantity: &Quantity) -> miette::Result<Option<Block>> {
    let models = sweep.measured.iter().filter(|m| m.family != Family::Discs);
    let mut series: Vec<Series> = models
        .filter_map(|m| {
            let rows = &m.comparison.as_ref()?.rows;
            let points = rows.iter().filter_map(|row| Some((row.time, (quantity.model)(row)?)));
            Some(Series::new(&m.name, Mark::Line, points.collect()))
        })
        .collect();
    let rows = sweep.with_truth().into_iter().flat_map(|found| &found.rows);
    let truth: Vec<(f64, f64)> =
        rows.filter_map(|row| Some((row.time, (quantity.truth)(row)?))).collect();
    if truth.is_empty() {
        return Ok(None);
    }
    series.push(Series::new(quantity.reference, Mark::Reference, truth));
    let svg =
        Chart { x: Axis::linear("time [s]"), y: Axis::linear(quantity.axis), series, floor: None }
            .svg()?;
    let figure = Figure::new(quantity.title, Picture::Svg(svg), quantity.caption);
    Ok(Some(Block::Figure(figure)))
}
