//! Progress of runs, as bars or, off a terminal, as lines; and warnings above them.

use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc::{RecvTimeoutError, Sender, channel};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use files::{Heartbeat, Pace, duration, is_quiet, note};
use indicatif::{MultiProgress, ProgressBar, ProgressDrawTarget, ProgressState, ProgressStyle};

use crate::run::{Observer, SessionError};
use crate::simulation::Simulation;
use crate::trajectory::Frame;

/// Bars, of which `--quiet` shows none.
pub(super) fn bars() -> MultiProgress {
    let bars = MultiProgress::new();
    if is_quiet() {
        bars.set_draw_target(ProgressDrawTarget::hidden());
    }
    bars
}

/// Progress of many scenes together, in steps of material points.
#[derive(Clone)]
pub(super) struct Total {
    pub bar: ProgressBar,
    lines: Arc<Mutex<Heartbeat>>,
    /// Scenes that have ended.
    ended: Arc<AtomicUsize>,
    scenes: usize,
}

impl Total {
    /// Of this many scenes.
    pub(super) fn new(bar: ProgressBar, scenes: usize) -> Self {
        let lines = Arc::new(Mutex::new(Heartbeat::new("point-step", 0)));
        Self { bar, lines, ended: Arc::default(), scenes }
    }

    /// A scene has ended.
    pub(super) fn scene_ended(&self) {
        self.ended.fetch_add(1, Ordering::Relaxed);
    }

    /// Adds point-steps of an earlier session, which do not count for the rate.
    fn skip(&self, point_steps: u64) {
        self.bar.inc(point_steps);
        self.bar.reset_eta();
        if let Ok(mut lines) = self.lines.lock() {
            lines.skip(point_steps);
        }
    }

    /// Adds point-steps, and writes a line if one is due.
    fn add(&self, point_steps: u64) {
        self.bar.inc(point_steps);
        let (done, all) = (self.bar.position(), self.bar.length().unwrap_or(0));
        // A poisoned lock means that another worker panicked, which ends the program.
        let Ok(mut lines) = self.lines.lock() else { return };
        if let Some(Pace { percent, left, .. }) = lines.pace(done, all) {
            let (ended, scenes) = (self.ended.load(Ordering::Relaxed), self.scenes);
            note!("{ended} of {scenes} scenes done, {percent:.0} % of all steps, {left}");
        }
    }
}

/// The progress of one scene.
pub(super) struct SceneProgress {
    bars: MultiProgress,
    /// Shown while packings are prepared, then while steps are made.
    bar: ProgressBar,
    /// Progress of many scenes together.
    total: Option<Total>,
    /// Lines of a single scene; those of many are about all of them.
    lines: Option<Heartbeat>,
    /// Lines while packings are prepared, until it is dropped.
    preparing: Option<Sender<()>>,
}

impl SceneProgress {
    pub(super) fn new(bars: MultiProgress, total: Option<Total>) -> Self {
        Self { bars, bar: ProgressBar::hidden(), total, lines: None, preparing: None }
    }
}

impl Observer for SceneProgress {
    fn preparing(&mut self) {
        self.bar = self.bars.add(ProgressBar::new_spinner());
        self.bar.set_message("preparing grains");
        self.bar.enable_steady_tick(Duration::from_millis(100));
        if self.total.is_none() {
            self.preparing = lines_of_preparation();
        }
    }

    fn ready(&mut self, simulation: &Simulation) {
        self.preparing = None;
        self.bar.finish_and_clear();
        self.bar = self.bars.add(ProgressBar::new(simulation.scene.steps() as u64));
        self.bar.set_style(scene_style());
        let step = simulation.step as u64;
        if let Some(total) = &self.total {
            self.bar.set_prefix(format!("{:<20} ", simulation.scene.title));
            total.skip(step * simulation.points.len() as u64);
        }
        if self.total.is_none() {
            self.lines = Some(Heartbeat::new("step", step));
        }
        self.bar.set_position(step);
        self.bar.reset_eta();
    }

    fn advanced(&mut self, simulation: &Simulation, before: usize, frame: Option<&Frame>) {
        if let Some(frame) = frame {
            self.bar.set_message(front_and_energy(frame));
        }
        let step = simulation.step;
        self.bar.set_position(step as u64);
        if let Some(total) = &self.total {
            total.add(((step - before) * simulation.points.len()) as u64);
        }
        let steps = simulation.scene.steps() as u64;
        if let Some(line) = self.lines.as_mut().and_then(|lines| lines.line(step as u64, steps)) {
            note!("{line}");
        }
    }

    fn warning(&mut self, text: &str) {
        self.bar.suspend(|| note!("{text}"));
    }

    fn write_failed(&mut self, error: SessionError) {
        let report = miette::Report::new(error);
        self.bar.suspend(|| note!("{report:?}"));
    }

    fn finished(&mut self) {
        self.bar.finish_and_clear();
    }
}

/// A line every interval until the sender is dropped; `None` where there are no lines.
fn lines_of_preparation() -> Option<Sender<()>> {
    let interval = Heartbeat::new("packing", 0).interval()?;
    let (sender, end) = channel();
    std::thread::spawn(move || {
        let began = Instant::now();
        while end.recv_timeout(interval) == Err(RecvTimeoutError::Timeout) {
            note!("preparing grains for {} so far", duration(began.elapsed().as_secs_f64()));
        }
    });
    Some(sender)
}

fn scene_style() -> ProgressStyle {
    ProgressStyle::with_template(
        "{prefix}{bar:24} {percent:>3} %  {pos}/{len}  {rate}  {eta} left  {msg}",
    )
    .expect("the template is valid")
    .with_key("rate", |state: &ProgressState, text: &mut dyn std::fmt::Write| {
        // A terminal that cannot be written to is no reason to stop.
        let _ = write!(text, "{:.0} steps/s", state.per_sec());
    })
}

/// Front and kinetic energy of a frame.
fn front_and_energy(frame: &Frame) -> String {
    let scalar = |name: &str| frame.budget.get(name).copied().unwrap_or_default();
    format!("front {:.2} m  kinetic {:.0} J/m", scalar("front"), scalar("kinetic_energy"))
}
