//! One scene: all models against the truth.

use super::super::cover::stands_for_all;
use super::super::no_model::left_out;
use super::charts::charts;
use super::tables::{over_time, summary};
use crate::context::Context;
use crate::render::block::Block;
use crate::render::rollouts::animation_of_runs;
use crate::render::section::Section;
use crate::studies::sweep::{Case, Family, Measured, Sweep, TruthScene};
use crate::text::{length, number};
use crate::truth::{Comparison, Row};

/// Title and caption of the animation.
const ANIMATION: &str = "Packings over discs, animated";
const CAPTION: &str = "Grey: the scene with every grain as a disc, as means over squares of grains. Coloured: \
                       the default packings, from blue (close to the discs) over yellow to red (far from them).";

/// The models on a scene.
pub struct TruthSection {
    /// The scene.
    pub scene: &'static TruthScene,
}

impl TruthSection {
    fn case(&self, context: &Context) -> Option<Case> {
        let cases = Case::against_truth(context.suite);
        cases.into_iter().find(|case| case.scene.name == self.scene.name)
    }
}

impl Section for TruthSection {
    fn title(&self) -> &'static str {
        self.scene.title
    }

    fn lead(&self) -> &'static str {
        self.scene.lead
    }

    fn estimate(&self, context: &Context) -> f64 {
        self.case(context).map_or(0.0, |case| case.estimate(context))
    }

    fn run(&self, context: &mut Context) -> miette::Result<Vec<Block>> {
        let Some(case) = self.case(context) else {
            return Ok(vec![Block::missing(
                "This scene",
                "only the full suite computes it.",
                "`--suite full` does, on a GPU.",
            )]);
        };
        truth_blocks(&case, context)
    }
}

/// All models against the truth of a case.
///
/// # Errors
/// As [`Case::measure`], and if a chart cannot be drawn.
pub fn truth_blocks(case: &Case, context: &mut Context) -> miette::Result<Vec<Block>> {
    let sweep = case.measure(context)?;
    let mut blocks = vec![headline(&sweep), description(case.scene, &sweep)];
    if let Some([packings, truth]) = case.drawn(context)? {
        let figure = animation_of_runs(ANIMATION, CAPTION, &packings.output, &truth.output)?;
        let is_cover = stands_for_all(case.scene, context.suite);
        blocks.push(Block::Figure(if is_cover { figure.on_cover() } else { figure }));
    }
    blocks.push(Block::Table(summary(&sweep)));
    blocks.extend(charts(&sweep)?);
    blocks.extend(over_time(&sweep).map(Block::Table));
    blocks.extend(failures(&sweep));
    blocks.extend(left_out(&sweep));
    Ok(blocks)
}

/// Distance and ratio of each model at its worst.
fn headline(sweep: &Sweep) -> Block {
    let models = sweep.measured.iter().filter(|m| m.family != Family::Discs);
    let words: Vec<String> = models
        .filter_map(|m| {
            let worst = m.comparison.as_ref()?.worst()?;
            let (ratio, distance) = (number(worst.ratio()?), length(worst.distance));
            Some(format!("{} {ratio} ({distance})", m.name))
        })
        .collect();
    Block::headline(format!(
        "Largest distance from the discs, in spreads between seeds of the discs: {}.",
        words.join("; ")
    ))
}

fn description(scene: &TruthScene, sweep: &Sweep) -> Block {
    let of_truth = sweep.measured[0].comparison.as_ref();
    let from = of_truth.map_or(f64::NAN, |found| found.counted_from);
    let side = of_truth.map_or(f64::NAN, |found| 1e3 * found.side);
    let row = of_truth.and_then(Comparison::worst);
    let spread = row.and_then(|row| row.spread).map_or(String::new(), length);
    let time = row.map_or(String::new(), |row| number(row.time));
    Block::text(format!(
        "{}. The truth is the scene as discs, with {} seeds. Distances are root mean squares between \
         squares of material {} mm wide (wider for coarser points), over squares and seeds; two seeds are {spread} \
         apart at {time} s. The ratio of distance to spread counts from {} s on.",
        capitalised(scene.description),
        sweep.seeds,
        number(side),
        number(from),
    ))
}

fn capitalised(text: &str) -> String {
    let mut letters = text.chars();
    letters.next().map_or(String::new(), |first| first.to_uppercase().chain(letters).collect())
}

fn failures(sweep: &Sweep) -> Vec<Block> {
    let failed = sweep.measured.iter().filter(|m| !m.failure.is_empty());
    let block = |m: &Measured| {
        let until = m.comparison.as_ref().and_then(|found| found.rows.last());
        let when =
            until.map_or(String::new(), |row: &Row| format!(" after {} s", number(row.time)));
        [Block::text(format!("{} failed{when}:", m.name)), Block::Quote(m.failure.clone())]
    };
    failed.flat_map(block).collect()
}
