//! The column of `scenes/column-paper.toml` by the direct solver, with two seeds: what rollouts should reproduce.

use miette::{Context as _, miette};

use crate::context::Context;
use crate::run_cache::Run;
use crate::scene_text::merged;
use crate::suite::Suite;

/// Estimated time of what is not kept, s.
pub fn estimate(context: &Context) -> f64 {
    texts(context.suite).iter().map(|text| context.estimate(text)).sum()
}

/// Runs the column with both seeds.
///
/// # Errors
/// If a run fails or the user interrupts.
pub fn measure(context: &mut Context) -> miette::Result<[Run; 2]> {
    let [one, other] = texts(context.suite);
    let mut run = |text: &str| {
        let run = context.run("column of 1 m", text)?;
        if run.succeeded {
            Ok(run)
        } else {
            Err(miette!("{}", run.message)).wrap_err("the solver failed")
        }
    };
    Ok([run(&one)?, run(&other)?])
}

/// The scene with both seeds; the quick suite has half of the collapse.
fn texts(suite: Suite) -> [String; 2] {
    let duration = suite.pick("duration = 0.5\n", "");
    let column = include_str!("../../../scenes/column-paper.toml");
    [1, 2].map(|seed| merged(column, &format!("{duration}seed = {seed}\noutput.fields = []")))
}
