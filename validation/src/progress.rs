//! The progress bar, or a line now and then where there is no terminal.

use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use files::{Heartbeat, Pace, note};
use indicatif::{ProgressBar, ProgressStyle};

/// Progress in estimated seconds of computing.
pub struct Progress {
    bar: ProgressBar,
    lines: Mutex<Heartbeat>,
    began: Instant,
    /// Estimated time of everything, s.
    total: f64,
    /// Estimated time of what is done, s.
    done: f64,
    /// Estimated time of what is running, s.
    now: f64,
}

impl Progress {
    /// A bar for `total` estimated seconds.
    pub fn new(total: f64) -> Self {
        let bar = ProgressBar::new((total * 10.0).ceil().max(1.0) as u64);
        let style = ProgressStyle::with_template("{bar:24} {percent:>3} %  {prefix}  {msg}")
            .expect("the template is valid");
        bar.set_style(style);
        bar.enable_steady_tick(Duration::from_millis(500));
        Self::with(bar, total)
    }

    /// No bar, for as long as nothing is planned.
    pub fn hidden() -> Self {
        Self::with(ProgressBar::hidden(), 0.0)
    }

    fn with(bar: ProgressBar, total: f64) -> Self {
        let lines = Mutex::new(Heartbeat::new("second", 0));
        Self { bar, lines, began: Instant::now(), total, done: 0.0, now: 0.0 }
    }

    /// Begins a task of `seconds` estimated seconds.
    pub fn begin(&mut self, what: &str, seconds: f64) {
        self.now = seconds;
        self.bar.set_message(what.to_owned());
        self.show(0.0);
    }

    /// The task has been running for `elapsed`.
    pub fn tick(&self, elapsed: Duration) {
        self.show(elapsed.as_secs_f64().min(self.now));
    }

    /// The task has ended.
    pub fn end(&mut self) {
        self.done = (self.done + self.now).min(self.total);
        self.now = 0.0;
        self.show(0.0);
    }

    /// Prints a message above the bar.
    pub fn say(&self, text: &str) {
        self.bar.suspend(|| note!("{text}"));
    }

    /// Removes the bar.
    pub fn finish(&self) {
        self.bar.finish_and_clear();
    }

    fn show(&self, part: f64) {
        let done = self.done + part;
        self.bar.set_position((done * 10.0) as u64);
        let mut lines = self.lines.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(Pace { percent, left, .. }) =
            lines.pace((done * 10.0) as u64, (self.total * 10.0) as u64)
        {
            note!("{percent:.0} %, {left}: {}", self.bar.message());
        }
        // The remaining time at the pace so far; at first, the estimate.
        let pace = if done > 5.0 { self.began.elapsed().as_secs_f64() / done } else { 1.0 };
        let left = (self.total - done).max(0.0) * pace;
        self.bar.set_prefix(format!("about {} left", crate::text::seconds(left)));
    }
}
