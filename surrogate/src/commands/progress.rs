//! Progress, as bars or, off a terminal, as lines.

use std::cell::RefCell;
use std::fmt::Write;

use files::{Heartbeat, is_quiet, note};
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressState, ProgressStyle};

/// Progress of a training or a rollout.
pub struct Progress {
    bar: ProgressBar,
    lines: RefCell<Heartbeat>,
}

impl Progress {
    /// Over all steps of a training, `done` of which were made before.
    pub fn of_training(steps: u64, done: u64) -> Self {
        Self::new(training_bar(steps, done), "step", done)
    }

    /// Over the frames of a rollout.
    pub fn of_rollout(frames: u64) -> Self {
        Self::new(rollout_bar(frames), "frame", 0)
    }

    /// Over many rollouts.
    pub fn of_scenes(scenes: u64) -> Self {
        let style = style("{bar:24} {percent:>3} %  scene {pos}/{len}  {eta} left");
        Self::new(ProgressBar::new(scenes).with_style(style), "scene", 0)
    }

    fn new(bar: ProgressBar, unit: &'static str, done: u64) -> Self {
        if is_quiet() {
            bar.set_draw_target(ProgressDrawTarget::hidden());
        }
        Self { bar, lines: RefCell::new(Heartbeat::new(unit, done)) }
    }

    /// So much is done.
    pub fn set(&self, done: u64) {
        self.bar.set_position(done);
        let line = self.lines.borrow_mut().line(done, self.bar.length().unwrap_or(0));
        if let Some(line) = line {
            let more = self.bar.message();
            note!("{line}{}{more}", if more.is_empty() { "" } else { ", " });
        }
    }

    /// What is written behind the numbers.
    pub fn set_message(&self, text: String) {
        self.bar.set_message(text);
    }

    /// Writes a warning above the bar.
    pub fn warn(&self, text: &str) {
        self.bar.suspend(|| note!("{text}"));
    }

    /// Removes the bar.
    pub fn finish(&self) {
        self.bar.finish_and_clear();
    }
}

fn training_bar(steps: u64, done: u64) -> ProgressBar {
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

fn rollout_bar(frames: u64) -> ProgressBar {
    let style = style("{bar:24} {percent:>3} %  frame {pos}/{len}  {eta} left");
    ProgressBar::new(frames).with_style(style)
}

fn style(template: &str) -> ProgressStyle {
    ProgressStyle::with_template(template).expect("the template is valid")
}
