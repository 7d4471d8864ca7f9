//! Cost and error of all models over the size of grains.

use plot::{Axis, Chart, Mark, Series};

use crate::context::Context;
use crate::render::block::Block;
use crate::render::figure::{Figure, Picture};
use crate::render::section::Section;
use crate::render::table::Table;
use crate::studies::grain_size::{GrainSize, crossing, estimate, extrapolated, measure};
use crate::studies::sweep::Measured;
use crate::suite::Suite;
use crate::text::{number, seconds};

/// Mean radius of sand of 0.2 mm, m.
const SAND: f64 = 1e-4;

/// All models as grains shrink.
pub struct AsGrainsShrink;

impl Section for AsGrainsShrink {
    fn title(&self) -> &'static str {
        "As grains shrink"
    }

    fn lead(&self) -> &'static str {
        "A column 1 m wide and 1 m high with grains of the usual, half and a quarter of the size: wall time and \
         distance from the discs."
    }

    fn estimate(&self, context: &Context) -> f64 {
        context.suite.pick(0.0, estimate(context))
    }

    fn run(&self, context: &mut Context) -> miette::Result<Vec<Block>> {
        if context.suite == Suite::Quick {
            return Ok(vec![Block::missing(
                "Smaller grains",
                "only the full suite computes them.",
                "`--suite full` does, on a GPU.",
            )]);
        }
        let sizes = measure(context)?;
        let wall_time = chart(
            &sizes,
            ("Wall time over the size of grains", "wall time [s]"),
            "Discs need 8 times the steps and discs for half the radius, packings twice the steps, the mu(I) law \
             the same. Large grains leave a GPU partly idle.",
            |m| m.failure.is_empty().then_some(m.seconds),
        )?;
        let error = chart(
            &sizes,
            ("Distance over the size of grains", "distance from the discs [m]"),
            "Root mean square over squares of material and time. Discs: one seed against the others.",
            |m| Some(m.error?.distance),
        )?;
        Ok([headline(&sizes)]
            .into_iter()
            .flatten()
            .chain([wall_time, error, Block::Table(table(&sizes))])
            .collect())
    }
}

/// Where packings become faster, and the times with sand.
fn headline(sizes: &[GrainSize]) -> Option<Block> {
    let GrainSize { radius, sweep } = sizes.last()?;
    let [discs, packings] = [sweep.measured.first()?, sweep.measured.get(1)?];
    let times = sweep
        .measured
        .iter()
        .map(|m| format!("{} {}", m.name, seconds(extrapolated(m, *radius, SAND))));
    let times: Vec<String> = times.collect();
    Some(Block::headline(format!(
        "Packings take less time than discs under a mean radius of {} mm. With sand of 0.2 mm, by the growth of the \
         work from the smallest grains computed: {}.",
        number(1e3 * crossing(discs, packings, *radius)),
        times.join(", ")
    )))
}

fn chart(
    sizes: &[GrainSize],
    (title, axis): (&str, &str),
    caption: &str,
    value: fn(&Measured) -> Option<f64>,
) -> miette::Result<Block> {
    let models = sizes.first().map_or(0, |size| size.sweep.measured.len());
    let series = (0..models).map(|index| {
        let points = sizes
            .iter()
            .filter_map(|size| Some((1e3 * size.radius, value(&size.sweep.measured[index])?)));
        Series::new(&sizes[0].sweep.measured[index].name, Mark::Line, points.collect())
    });
    let x = Axis::log("mean radius [mm]");
    let svg = Chart { x, y: Axis::log(axis), series: series.collect(), floor: None }.svg()?;
    Ok(Block::Figure(Figure::new(title, Picture::Svg(svg), caption)))
}

fn table(sizes: &[GrainSize]) -> Table {
    let columns = [
        "mean radius [mm]",
        "model",
        "wall time [s]",
        "largest ratio",
        "distance there [m]",
        "distance at the end [m]",
        "spread at the end [m]",
        "front at the end [m]",
        "discs [m]",
    ];
    let mut table = Table::new("Sizes of grains", columns).note(
        "Ratio: distance from the discs over the spread between two of their seeds. Front of 99 % of the mass.",
    );
    for GrainSize { radius, sweep } in sizes {
        for m in &sweep.measured {
            let found = m.comparison.as_ref();
            let worst = found.and_then(|found| found.worst());
            let last = found.and_then(|found| found.rows.last());
            let cell = |value: Option<f64>| value.map_or(String::new(), number);
            table.row([
                number(1e3 * radius),
                m.name.clone(),
                if m.failure.is_empty() { number(m.seconds) } else { "failed".to_owned() },
                cell(worst.and_then(|row| row.ratio())),
                cell(worst.map(|row| row.distance)),
                cell(last.map(|row| row.distance)),
                cell(last.and_then(|row| row.spread)),
                cell(last.map(|row| row.front)),
                cell(last.map(|row| row.true_front.mean)),
            ]);
        }
    }
    table
}
