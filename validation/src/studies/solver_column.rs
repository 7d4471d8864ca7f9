//! The column of 1 m as networks learnt it, with two seeds: what rollouts should reproduce.

use miette::{Context as _, miette};

use crate::context::Context;
use crate::run_cache::Run;
use crate::scene_text::merged;
use crate::suite::Suite;

/// Packings in points, with 200 discs each.
pub const PACKINGS: &str = include_str!("../../../scenes/column-paper.toml");
/// Every grain as a disc.
pub const DISCS: &str = include_str!("../../../scenes/discs.toml");

/// Estimated time of what is not kept, s.
pub fn estimate(context: &Context, column: &str) -> f64 {
    texts(column, context.suite).iter().map(|text| context.estimate(text)).sum()
}

/// Runs [`PACKINGS`] or [`DISCS`] with both seeds.
///
/// # Errors
/// If a run fails or the user interrupts.
pub fn measure(context: &mut Context, column: &str) -> miette::Result<[Run; 2]> {
    let [one, other] = texts(column, context.suite);
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
fn texts(column: &str, suite: Suite) -> [String; 2] {
    let duration = suite.pick("duration = 0.5\n", "");
    [1, 2].map(|seed| merged(column, &format!("{duration}seed = {seed}\noutput.fields = []")))
}
