//! Progress bars of runs, and warnings above them.

use std::time::Duration;

use files::note;
use indicatif::{MultiProgress, ProgressBar, ProgressState, ProgressStyle};

use crate::run::{Observer, SessionError};
use crate::simulation::Simulation;
use crate::trajectory::Frame;

/// The progress bar of one scene.
pub(super) struct SceneProgress {
    bars: MultiProgress,
    /// Shown while packings are prepared, then while steps are made.
    bar: ProgressBar,
    /// Progress of many scenes together, in steps of material points.
    total: Option<ProgressBar>,
}

impl SceneProgress {
    pub(super) fn new(bars: MultiProgress, total: Option<ProgressBar>) -> Self {
        Self { bars, bar: ProgressBar::hidden(), total }
    }
}

impl Observer for SceneProgress {
    fn preparing(&mut self) {
        self.bar = self.bars.add(ProgressBar::new_spinner());
        self.bar.set_message("preparing grains");
        self.bar.enable_steady_tick(Duration::from_millis(100));
    }

    fn ready(&mut self, simulation: &Simulation) {
        self.bar.finish_and_clear();
        self.bar = self.bars.add(ProgressBar::new(simulation.scene.steps() as u64));
        self.bar.set_style(scene_style());
        let step = simulation.step as u64;
        if let Some(total) = &self.total {
            self.bar.set_prefix(format!("{:<20} ", simulation.scene.title));
            total.inc(step * simulation.points.len() as u64);
            total.reset_eta();
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
            total.inc(((step - before) * simulation.points.len()) as u64);
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
