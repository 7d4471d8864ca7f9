//! What is chosen for scenes that the choice does not know.

use crate::context::Context;
use crate::render::block::Block;
use crate::render::section::Section;
use crate::render::table::Table;
use crate::studies::model_choice::{Chosen, OfScene, WITHIN, estimate, measure};
use crate::text::{number, seconds};

/// The choice of models.
pub struct ModelChoice;

impl Section for ModelChoice {
    fn title(&self) -> &'static str {
        "No more than a scene needs"
    }

    fn lead(&self) -> &'static str {
        "What `dempm choose` takes for scenes drawn at random that it was not fitted to, how far that is from the discs \
         in fact, and what it costs."
    }

    fn estimate(&self, context: &Context) -> f64 {
        estimate(context)
    }

    fn run(&self, context: &mut Context) -> miette::Result<Vec<Block>> {
        let scenes = measure(context)?;
        Ok(vec![Block::headline(headline(&scenes)), Block::Table(table(&scenes))])
    }
}

/// How often the choice holds, and what it saves.
fn headline(scenes: &[OfScene]) -> String {
    let of = |within: f64| {
        let chosen = scenes.iter().flat_map(|scene| &scene.chosen);
        let chosen: Vec<&Chosen> = chosen.filter(|chosen| chosen.within == within).collect();
        let met: Vec<_> = chosen.iter().filter(|chosen| chosen.met).collect();
        let kept = met.iter().filter(|chosen| chosen.is_below(within)).count();
        let cost: f64 = chosen.iter().map(|chosen| chosen.seconds).sum();
        format!(
            "{} within {} m, promised for {} of {} and kept for {kept}",
            seconds(cost),
            number(within),
            met.len(),
            chosen.len()
        )
    };
    let parts: Vec<String> = WITHIN.into_iter().map(of).collect();
    let finest: f64 = scenes.iter().map(|scene| scene.seconds).sum();
    let different: Vec<&[Chosen]> = scenes.iter().flat_map(alike).collect();
    let bounds: Vec<(&Chosen, f64)> =
        different.iter().filter_map(|alike| Some((&alike[0], alike[0].expected?[1]))).collect();
    let below = bounds.iter().filter(|(chosen, bound)| chosen.is_below(*bound)).count();
    format!(
        "The scenes take {}; as discs {}. {below} of {} different choices are below their bounds.",
        parts.join("; "),
        seconds(finest),
        bounds.len()
    )
}

/// The choices of a scene, those of the same model together.
fn alike(scene: &OfScene) -> impl Iterator<Item = &[Chosen]> {
    scene.chosen.chunk_by(|a, b| (&a.model, a.met) == (&b.model, b.met))
}

fn table(scenes: &[OfScene]) -> Table {
    let columns = [
        "scene",
        "within [m]",
        "chosen",
        "expected [m]",
        "bound [m]",
        "distance [m]",
        "cost [s]",
        "cost of the discs [s]",
        "two seeds of discs [m]",
    ];
    let mut table = Table::new("What is chosen", columns).note(
        "Distances: root mean square over squares of material, the largest over time, against three seeds of the discs. \
         The bound holds in nine of ten scenes. A star: no model had a bound within the distance, and this one is nearest. \
         The quick suite has the three cheapest of twelve scenes.",
    );
    for scene in scenes {
        for chosen in alike(scene) {
            let within: Vec<String> = chosen.iter().map(|one| number(one.within)).collect();
            let chosen = &chosen[0];
            let star = if chosen.met { "" } else { " *" };
            let [median, bound] = chosen.expected.unwrap_or([f64::NAN; 2]);
            let shown =
                |value: f64| if value.is_finite() { number(value) } else { "unknown".to_owned() };
            table.row([
                scene.name.clone(),
                within.join(", "),
                format!("{}{star}", chosen.model),
                shown(median),
                shown(bound),
                chosen.distance.as_ref().map_or("failed".to_owned(), |distance| number(*distance)),
                number(chosen.seconds),
                number(scene.seconds),
                number(scene.spread),
            ]);
        }
    }
    table
}
