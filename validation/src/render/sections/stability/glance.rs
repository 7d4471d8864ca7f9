//! All studies in a table: how much of what they did went well, failed, and was said.

use crate::block::{Block, Map, Outcome, Table};
use crate::computed::Computed;
use crate::context::Context;
use crate::report::slug;
use crate::section::Section;

/// The maps of all studies, counted.
pub struct Glance;

/// Outcomes in the order of the columns.
const OUTCOMES: [Outcome; 4] = [Outcome::Stable, Outcome::Warned, Outcome::Failed, Outcome::Silent];

impl Section for Glance {
    fn title(&self) -> &'static str {
        "Stability at a glance"
    }

    fn always(&self) -> bool {
        true
    }

    fn run(&self, context: &mut Context) -> miette::Result<Vec<Block>> {
        let columns = ["study", "stable", "warned", "failed, and said so", "failed silently"];
        let mut table = Table::new("Outcomes of all studies", columns).note(
            "Numbers of cells of the maps below, each a run or a rollout with one pair of \
             parameters. Warned: sound, and the program said that it may not be.",
        );
        let mut total = [0; OUTCOMES.len()];
        let mut silent = Vec::new();
        for study in super::studies() {
            let Some(computed) = Computed::kept(context, &slug(study.title())) else { continue };
            let maps: Vec<&Map> = computed
                .blocks
                .iter()
                .filter_map(|block| if let Block::Map(map) = block { Some(map) } else { None })
                .collect();
            if maps.is_empty() {
                continue;
            }
            let counts = OUTCOMES.map(|outcome| maps.iter().map(|map| map.count(outcome)).sum());
            for (total, count) in total.iter_mut().zip(counts) {
                *total += count;
            }
            let quiet = maps.iter().filter(|map| map.count(Outcome::Silent) > 0);
            silent.extend(quiet.map(|map| map.title.clone()));
            let counts = counts.map(|count: usize| count.to_string());
            table.row(std::iter::once(study.title().to_owned()).chain(counts));
        }
        if table.rows.is_empty() {
            return Ok(vec![Block::missing(
                "The table",
                "no study has been computed.",
                "`--only mpm,dem,tall,learned` does it.",
            )]);
        }
        let [_, _, failed, quiet] = total;
        let words = match quiet {
            0 => "The program said so each time.".to_owned(),
            _ => format!("Of {quiet} it said nothing: {}.", silent.join("; ")),
        };
        Ok(vec![
            Block::lead(
                "Stability",
                format!(
                    "{} studies push each method until it fails: {} runs and rollouts, {} of which \
                 failed. {words}",
                    table.rows.len(),
                    total.iter().sum::<usize>(),
                    failed + quiet
                ),
            ),
            Block::Table(table),
        ])
    }
}
