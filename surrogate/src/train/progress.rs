//! The line that shows how a training goes.

use std::fmt::Write;

use indicatif::{ProgressBar, ProgressState, ProgressStyle};

/// A bar over all steps, `done` of which were made before.
pub fn bar(steps: u64, done: u64) -> ProgressBar {
    let bar = ProgressBar::new(steps);
    let template = "{bar:24} {percent:>3} %  {pos}/{len}  {rate}  {eta} left  {msg}";
    bar.set_style(ProgressStyle::with_template(template).expect("the template is valid").with_key(
        "rate",
        |state: &ProgressState, text: &mut dyn Write| {
            // A terminal that cannot be written to is no reason to stop.
            let _ = write!(text, "{:.1} steps/s", state.per_sec());
        },
    ));
    bar.set_position(done);
    bar.reset_eta();
    bar
}
