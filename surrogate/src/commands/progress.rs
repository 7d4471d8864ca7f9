//! Progress bars.

use std::fmt::Write;

use indicatif::{ProgressBar, ProgressState, ProgressStyle};

/// A bar over all steps of a training, `done` of which were made before.
pub fn training_bar(steps: u64, done: u64) -> ProgressBar {
    let template = "{bar:24} {percent:>3} %  {pos}/{len}  {rate}  {eta} left  {msg}";
    let style = style(template).with_key("rate", |state: &ProgressState, text: &mut dyn Write| {
        // A terminal that cannot be written to is no reason to stop.
        let _ = write!(text, "{:.1} steps/s", state.per_sec());
    });
    let bar = ProgressBar::new(steps).with_style(style);
    bar.set_position(done);
    bar.reset_eta();
    bar
}

/// A bar over the frames of a rollout.
pub fn rollout_bar(frames: u64) -> ProgressBar {
    let style = style("{bar:24} {percent:>3} %  frame {pos}/{len}  {eta} left");
    ProgressBar::new(frames).with_style(style)
}

fn style(template: &str) -> ProgressStyle {
    ProgressStyle::with_template(template).expect("the template is valid")
}
