//! Runs of scenes.

use std::path::PathBuf;

use dempm::device::Device;
use dempm::run::{Observer, Options, SessionError, checkpoint_interval, run_scene};
use dempm::scene::Scene;
use dempm::simulation::Simulation;
use dempm::trajectory::Frame;
use miette::{IntoDiagnostic, Report};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::failure::text;
use crate::supervisor::{Reporter, supervise};

/// Passes progress and warnings on.
struct Told<'a>(&'a Reporter);

impl Observer for Told<'_> {
    fn preparing(&mut self) {
        self.0.progress(0, 0, "preparing grains".to_owned());
    }

    fn ready(&mut self, simulation: &Simulation) {
        self.0.progress(simulation.step, simulation.scene.steps(), String::new());
    }

    fn advanced(&mut self, simulation: &Simulation, _: usize, _: Option<&Frame>) {
        self.0.progress(simulation.step, simulation.scene.steps(), String::new());
    }

    fn warning(&mut self, text: &str) {
        self.0.warning(text);
    }

    fn write_failed(&mut self, error: SessionError) {
        self.0.warning(&text(&Report::new(error)));
    }
}

/// Simulates the text of a scene into a trajectory file. `watcher` has the methods
/// `progress(done, all, remark)` in macro steps and `warning(text)`.
#[pyfunction]
#[expect(clippy::too_many_arguments, reason = "they have names in Python")]
pub fn run(
    py: Python<'_>,
    scene: String,
    name: String,
    output: PathBuf,
    device: &str,
    resume: bool,
    overwrite: bool,
    interval: f64,
    watcher: &Bound<'_, PyAny>,
) -> PyResult<()> {
    let device: Device = device
        .parse()
        .map_err(|error| PyValueError::new_err(format!("device = {device:?}; {error}")))?;
    supervise(py, Some(watcher), move |interrupt, reporter| {
        let scene = Scene::parse(&scene, &name)?;
        if let Some(report) = scene.warning_report() {
            reporter.warning(&text(&report));
        }
        let selection = device.select().into_diagnostic()?;
        if let Some(reason) = selection.fallback.as_ref().filter(|_| selection.is_faulty) {
            reporter.warning(&format!("running on the CPU: {reason}"));
        }
        let options = Options {
            device: selection.first(),
            ranks: None,
            resume,
            overwrite,
            checkpoint_interval: checkpoint_interval(interval)?,
        };
        run_scene(scene, output, &options, &mut Told(reporter), interrupt)?;
        Ok(())
    })
}
