//! A ranking of models as a headline and a table.

use crate::render::block::Block;
use crate::render::table::Table;
use crate::studies::ranking::{Ranked, Ranking};
use crate::text::number;

/// Models by their mean error over the same cases, and whether they were trained equally long.
pub(super) fn ranking_blocks(title: &str, ranking: &Ranking) -> Vec<Block> {
    if ranking.ranked.is_empty() {
        return Vec::new();
    }
    vec![Block::headline(headline(ranking)), Block::Table(table(title, ranking))]
}

fn table(title: &str, Ranking { ranked, cases, horizon }: &Ranking) -> Table {
    let early = match horizon {
        Some(time) => format!(
            "The first rollout to end early did so at {time:.2} s: errors until then can be compared."
        ),
        None => "None did.".to_owned(),
    };
    let mut table = Table::new(
        format!("{title} by mean error"),
        [
            "model",
            "parameters",
            "steps",
            "mean MSE",
            "times the best",
            "cases to the end",
            "mean MSE until one ended early",
        ],
    )
    .note(format!(
        "MSE: box width 1, mean over all cases and frames; empty where a rollout ended early. {early}"
    ));
    for model in ranked {
        table.row([
            model.model.clone(),
            model.parameters.to_string(),
            model.steps.to_string(),
            number(model.error),
            number(model.error / ranked[0].error),
            format!("{} of {cases}", model.completed),
            model.early.map_or(String::new(), number),
        ]);
    }
    table
}

fn headline(Ranking { ranked, cases, .. }: &Ranking) -> String {
    let steps = || ranked.iter().map(|ranked| ranked.steps);
    let trained = match (steps().min(), steps().max()) {
        (Some(least), Some(most)) if least == most => format!("after {least} steps each"),
        (least, most) => format!(
            "after {} to {} steps, which is not equal",
            least.unwrap_or_default(),
            most.unwrap_or_default()
        ),
    };
    let count = ranked.len();
    let complete: Vec<&Ranked> = ranked.iter().filter(|model| model.error.is_finite()).collect();
    match complete.as_slice() {
        [best, .., worst] => format!(
            "Of {count} networks {trained}, {} complete all validation cases: `{}` with the smallest \
             mean error ({} box²), `{}` with the largest ({} box²).",
            complete.len(),
            best.model,
            number(best.error),
            worst.model,
            number(worst.error)
        ),
        [one] => format!(
            "Of {count} networks {trained}, only `{}` completes all validation cases (mean error {} \
             box²).",
            one.model,
            number(one.error)
        ),
        [] => format!(
            "None of {count} networks {trained} completes all {cases} validation cases; `{}` completes \
             {}.",
            ranked[0].model, ranked[0].completed
        ),
    }
}
