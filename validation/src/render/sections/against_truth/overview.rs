//! All scenes at once.

use super::super::cover::stands_for_all;
use crate::context::Context;
use crate::render::block::Block;
use crate::render::section::Section;
use crate::render::table::Table;
use crate::section_cache::Computed;
use crate::studies::sweep::{Case, Family, Measured, Sweep};
use crate::suite::Suite;
use crate::text::{length, number, slug};
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
        let former = former_blocks(context, self.title());
        if sweeps.is_empty() && !former.is_empty() {
            return Ok(former);
        }
        let mut blocks = Vec::new();
        if !sweeps.is_empty() {
            blocks.extend(lead(&sweeps, context.suite));
            blocks.push(headline(&sweeps));
            blocks.push(Block::text(
                "Distance: root mean square distance of squares of material from those of the discs, at \
                 the time at which it is largest beside the spread. Ratio: that distance over the spread \
                 between two seeds of the discs. A model that were the discs would have a ratio of 1.",
            ));
            let tables = [ratios(&sweeps), accuracy(&sweeps)];
            blocks.extend(tables.map(|table| Block::Table(with_former(table, &former, &absent))));
        }
        let known = |name: &&str| {
            let rows = blocks.iter().filter_map(|block| match block {
                Block::Table(table) => Some(&table.rows),
                _ => None,
            });
            rows.flatten().any(|row| row[0] == **name)
        };
        absent.retain(|name| !known(name));
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

/// The section as it was kept: its rows stay where the runs behind them are gone.
fn former_blocks(context: &Context, title: &str) -> Vec<Block> {
    Computed::kept(context, &slug(title)).map_or(Vec::new(), |kept| kept.blocks)
}

/// A table with the former rows of scenes whose runs are absent.
fn with_former(mut table: Table, former: &[Block], absent: &[&str]) -> Table {
    for block in former {
        if let Block::Table(former) = block
            && former.title == table.title
        {
            table.rows_of(former, absent);
        }
    }
    table
}

type Measurements = [(Case, Sweep)];

/// Packings and continuum law at the end of the scene that stands for all.
fn lead(sweeps: &Measurements, suite: Suite) -> Option<Block> {
    let (case, sweep) = sweeps.iter().find(|(case, _)| stands_for_all(case.scene, suite))?;
    let last = |m: &Measured| m.comparison.as_ref()?.rows.last().cloned();
    let solvers = |m: &&Measured| matches!(m.family, Family::Packings | Family::Continuum);
    let words = sweep
        .measured
        .iter()
        .filter(solvers)
        .filter_map(|m| Some(format!("{} ({})", length(last(m)?.distance), m.name)));
    let words: Vec<String> = words.collect();
    let spread = sweep.with_truth()?.rows.last()?.spread.map_or(String::new(), length);
    Some(Block::lead(
        "Truth",
        format!(
            "Where {}, points end {} from those of the same scene with every grain as a disc. Two such \
             runs with other grains end {spread} apart.",
            case.scene.description,
            words.join(", ")
        ),
    ))
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
    for m in sweeps.iter().flat_map(|(_, sweep)| &sweep.measured) {
        if !models.contains(&m.name.as_str()) {
            models.push(&m.name);
        }
    }
    let columns = ["scene", "spread at the end [m]"].into_iter().chain(models.iter().copied());
    let mut table = Table::new("Distance over spread", columns).note(
        "Largest ratio, and the distance there in m. Discs: one seed against the others. A cell is empty \
         where a model has no such settings, failed before the ratio counts or was trained on other \
         scenes.",
    );
    for (case, sweep) in sweeps {
        let spread = sweep.with_truth().and_then(|found| found.rows.last()?.spread);
        let head = [case.scene.name.to_owned(), spread.map_or(String::new(), number)];
        let found = |name: &&str| sweep.measured.iter().find(|m| m.name == **name);
        let cells = models.iter().map(|name| found(name).and_then(ratio).unwrap_or_default());
        table.row(head.into_iter().chain(cells));
    }
    table
}

/// Largest ratio and the distance there, up to when the model failed.
fn ratio(m: &Measured) -> Option<String> {
    let found = m.comparison.as_ref()?;
    let row = found.worst()?;
    let until = match (m.failure.is_empty(), found.rows.last()) {
        (false, Some(last)) => format!(" until {} s", number(last.time)),
        _ => String::new(),
    };
    Some(format!("{} ({}){until}", number(row.ratio()?), number(row.distance)))
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
        "source",
    ];
    let mut table = Table::new("Accuracy of the defaults", columns).note(
        "Distance and spread at the end. `dempm check` quotes this table as it was \
         when the program was built: it is `dempm/src/check/accuracy.csv`.",
    );
    for (case, sweep) in sweeps {
        for (material, cell, m) in case.defaults(sweep) {
            let last = m.comparison.as_ref().and_then(|found| found.rows.last());
            let Some(row) = last.filter(|_| m.failure.is_empty()) else { continue };
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
                "validation report".to_owned(),
            ]);
        }
    }
    table
}
