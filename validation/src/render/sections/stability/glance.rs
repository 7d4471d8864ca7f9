//! The outcomes of all studies in one table.

use crate::context::Context;
use crate::render::block::Block;
use crate::render::map::{Map, Outcome};
use crate::render::section::Section;
use crate::render::table::Table;
use crate::section_cache::Computed;
use crate::text::slug;

/// The maps of all studies, counted.
pub(super) struct Glance {
    /// Titles of the studies.
    pub studies: Vec<&'static str>,
}

/// Outcomes in the order of the columns.
const OUTCOMES: [Outcome; 4] = [Outcome::Stable, Outcome::Warned, Outcome::Failed, Outcome::Silent];

impl Section for Glance {
    fn title(&self) -> &'static str {
        "Stability at a glance"
    }

    fn lead(&self) -> &'static str {
        "How often each method worked, warned or failed in all studies below."
    }

    fn always(&self) -> bool {
        true
    }

    fn run(&self, context: &mut Context) -> miette::Result<Vec<Block>> {
        let columns = ["study", "stable", "warned", "failed, and said so", "failed silently"];
        let mut table = Table::new("Outcomes of all studies", columns).note(
            "Numbers of cells of the maps below. Each cell is a run or a rollout with one pair of \
             parameters.",
        );
        let mut total = [0; OUTCOMES.len()];
        let mut silent = Vec::new();
        for title in &self.studies {
            let maps = maps(context, title);
            if maps.is_empty() {
                continue;
            }
            let counts: [usize; OUTCOMES.len()] =
                OUTCOMES.map(|outcome| maps.iter().map(|map| map.count(outcome)).sum());
            for (total, count) in total.iter_mut().zip(counts) {
                *total += count;
            }
            let quiet = maps.iter().filter(|map| map.count(Outcome::Silent) > 0);
            silent.extend(quiet.map(|map| map.title.clone()));
            let counts = counts.map(|count| count.to_string());
            table.row(std::iter::once((*title).to_owned()).chain(counts));
        }
        if table.rows.is_empty() {
            return Ok(vec![Block::missing(
                "The table",
                "no study has been computed.",
                "`--only mpm,dem,tall,learned` computes them.",
            )]);
        }
        let lead = lead(table.rows.len(), total, &silent);
        Ok(vec![Block::lead("Stability", lead), Block::Table(table)])
    }
}

/// The maps of a study that has been computed.
fn maps(context: &Context, title: &str) -> Vec<Map> {
    let blocks = Computed::kept(context, &slug(title)).map_or(Vec::new(), |study| study.blocks);
    let map = |block| if let Block::Map(map) = block { Some(map) } else { None };
    blocks.into_iter().filter_map(map).collect()
}

fn lead(studies: usize, total: [usize; 4], silent: &[String]) -> String {
    let [_, _, failed, quiet] = total;
    let warning = match quiet {
        0 => "each with a warning or an error".to_owned(),
        _ => format!("{quiet} of them without a warning ({})", silent.join("; ")),
    };
    format!(
        "Pushed until they fail in {studies} studies, solver and networks gave wrong results in {} of \
         {} runs, {warning}.",
        failed + quiet,
        total.iter().sum::<usize>()
    )
}
