//! All scenes at once.

use super::charts::shown;
use crate::context::Context;
use crate::render::block::Block;
use crate::render::section::Section;
use crate::render::table::Table;
use crate::studies::sweep::{Case, Family, Measured, Sweep};
use crate::text::{length, number};
use crate::truth::Row;

/// How far every model is from the truth on every scene.
pub struct Overview;

impl Section for Overview {
    fn title(&self) -> &'static str {
        "How right each model is"
    }

    fn lead(&self) -> &'static str {
        "The distance of every model from the discs on every scene, in metres and in spreads between seeds."
    }

    /// It is written after the sections of the scenes, which compute.
    fn always(&self) -> bool {
        true
    }

    fn run(&self, context: &mut Context) -> miette::Result<Vec<Block>> {
        let (mut sweeps, mut absent) = (Vec::new(), Vec::new());
        for case in Case::against_truth(context.suite) {
            if case.missing(context).is_empty() {
                let sweep = case.measure(context)?;
                sweeps.push((case, sweep));
            } else {
                absent.push(case.scene.name);
            }
        }
        let mut blocks = Vec::new();
        if !sweeps.is_empty() {
            blocks.extend([lead(&sweeps), headline(&sweeps)]);
            blocks.push(Block::text(
                "Distance: root mean square distance of squares of material from those of the discs, at \
                 the time at which it is largest beside the spread. Ratio: that distance over the spread \
                 between two seeds of the discs. A model that were the discs would have a ratio of 1.",
            ));
            blocks.push(Block::Table(ratios(&sweeps)));
            blocks.push(Block::Table(accuracy(&sweeps)));
        }
        if !absent.is_empty() {
            blocks.push(Block::missing(
                absent.join(", "),
                "not all models have been run.",
                "`--only truth` runs them.",
            ));
        }
        Ok(blocks)
    }
}

type Measurements = [(Case, Sweep)];

/// The default packings and the continuum law on half the cells, on the scene that stands for all.
fn lead(sweeps: &Measurements) -> Block {
    let col2x2 = sweeps.iter().find(|(case, _)| case.scene.name == "Col2x2");
    let Some((case, sweep)) = col2x2.or(sweeps.first()) else { return Block::lead("Truth", "") };
    let words: Vec<String> = sweep
        .measured
        .iter()
        .filter(|m| matches!(m.family, Family::Packings | Family::Continuum))
        .filter_map(|m| {
            let worst = m.comparison.as_ref()?.worst()?;
            Some(format!("{} {}", m.name, length(worst.distance)))
        })
        .collect();
    let spread = worst(&sweep.measured[0]).and_then(|row| row.spread).map_or(String::new(), length);
    Block::lead(
        "Truth",
        format!(
            "How far points end up from those of the same scene with every grain as a disc ({}): {}. Two \
             runs with other grains differ by {spread}.",
            case.scene.description,
            words.join(", ")
        ),
    )
}

fn headline(sweeps: &Measurements) -> Block {
    let words = sweeps.iter().filter_map(|(case, sweep)| {
        let ratio = worst(sweep.measured.get(1)?)?.ratio()?;
        Some(format!("{} {}", case.scene.name, number(ratio)))
    });
    let words: Vec<String> = words.collect();
    Block::headline(format!(
        "Distance of the default packings from the discs over the spread between seeds: {}.",
        words.join("; ")
    ))
}

fn worst(m: &Measured) -> Option<&Row> {
    m.comparison.as_ref()?.worst()
}

/// Largest ratio and distance of every model on every scene.
fn ratios(sweeps: &Measurements) -> Table {
    let mut models: Vec<&str> = Vec::new();
    for m in sweeps.iter().flat_map(|(_, sweep)| shown(sweep)) {
        if !models.contains(&m.name.as_str()) {
            models.push(&m.name);
        }
    }
    let columns = ["scene", "spread [m]"].into_iter().chain(models.iter().copied());
    let mut table = Table::new("Distance over spread", columns).note(
        "Largest ratio, and the distance there in m. Discs: one seed against the others. A cell is empty \
         where a model has no such settings, failed before the ratio counts or was trained on other \
         scenes.",
    );
    for (case, sweep) in sweeps {
        let spread = sweep.measured.get(1).and_then(worst).and_then(|row| row.spread);
        let head = [case.scene.name.to_owned(), spread.map_or(String::new(), number)];
        let cells = models.iter().map(|name| {
            let row = shown(sweep).find(|m| m.name == *name).and_then(worst);
            row.and_then(|row| Some(format!("{} ({})", number(row.ratio()?), number(row.distance))))
                .unwrap_or_default()
        });
        table.row(head.into_iter().chain(cells));
    }
    table
}

/// What `dempm check` quotes: the defaults of packings and continuum law, and the discs themselves.
fn accuracy(sweeps: &Measurements) -> Table {
    let columns = [
        "scene",
        "kind",
        "width [m]",
        "height [m]",
        "material",
        "cell [m]",
        "seeds",
        "distance [m]",
        "spread [m]",
    ];
    let mut table = Table::new("Accuracy of the defaults", columns).note(
        "Distance and spread at the time of the largest ratio. `dempm check` quotes this table as it was \
         when the program was built: it is `dempm/src/check/accuracy.csv`.",
    );
    for (case, sweep) in sweeps {
        for (material, cell, m) in case.defaults(sweep) {
            let Some(row) = worst(m).filter(|_| m.failure.is_empty()) else { continue };
            let [width, height] = case.scene.size;
            table.row([
                case.scene.name.to_owned(),
                case.scene.kind.name().to_owned(),
                number(width),
                number(height),
                material.to_owned(),
                number(cell),
                sweep.seeds.to_string(),
                number(row.distance),
                row.spread.map_or(String::new(), number),
            ]);
        }
    }
    table
}
