//! Predicts some scenes together, frame by frame.

use std::path::{Path, PathBuf};
use std::time::Instant;

use dempm::scene::Scene;
use dempm::trajectory::TrajectoryError;
use files::Interrupt;
use miette::{IntoDiagnostic, bail};
use rayon::prelude::*;

use crate::diagnostics::start_checks;
use crate::rollout::{
    InitialFrames, RecordedRollout, Recording, RecordingOptions, Rollout, RolloutObserver,
};
use crate::simulator::Simulator;

/// Most points of scenes that are predicted together: half a GiB of a GPU in bf16, 1 GiB in f32.
const POINTS: usize = 10_000;

/// Where a rollout starts from.
pub(super) enum From {
    /// A scene, whose first frames are simulated.
    Scene(Box<Scene>),
    /// A trajectory, whose first frames are read.
    Trajectory(PathBuf),
}

/// A rollout to make.
pub(super) struct Job {
    pub(super) from: From,
    pub(super) output: PathBuf,
}

/// What has become of it.
pub(super) struct Row {
    pub(super) points: usize,
    pub(super) recorded: RecordedRollout,
    /// All frames that were asked for.
    pub(super) frames: usize,
    pub(super) outside: Option<String>,
    pub(super) warnings: Vec<String>,
}

/// What all scenes have in common.
pub(super) struct Request<'a> {
    /// The model's file.
    pub(super) model: &'a Path,
    /// Frames of each; none for those of scene or trajectory.
    pub(super) frames: Option<usize>,
}

/// What a scene starts from, and the frames to record.
struct Start {
    began: Instant,
    initial: InitialFrames,
    frames: usize,
}

impl Start {
    fn find(
        request: &Request<'_>,
        simulator: &Simulator,
        job: &Job,
        interrupt: &Interrupt,
    ) -> miette::Result<Self> {
        if interrupt.requested() {
            bail!("interrupted");
        }
        let began = Instant::now();
        let initial = match &job.from {
            From::Scene(scene) => {
                // Others simulate theirs at the same time.
                let gpu = simulator.gpu.as_ref().map(|gpu| gpu.with_own_stream()).transpose();
                let own = Simulator { gpu: gpu.into_diagnostic()?, ..simulator.clone() };
                InitialFrames::of_scene(scene, &own)?
            }
            From::Trajectory(path) => InitialFrames::from_trajectory(path, 0, simulator)?,
        };
        let frames = request.frames.unwrap_or(initial.frames);
        if frames < initial.positions.len() {
            bail!("--frames {frames}: the model starts from {} frames", initial.positions.len());
        }
        Ok(Self { began, initial, frames })
    }

    fn points(&self) -> usize {
        self.initial.points.mass.len()
    }
}

/// A scene that is predicted.
struct Prediction<'a> {
    start: &'a Start,
    recording: Recording<'a>,
    warnings: Warnings,
    error: Option<TrajectoryError>,
}

impl<'a> Prediction<'a> {
    fn begin(
        simulator: &'a Simulator,
        start: &'a Start,
        rollout: Rollout<'a>,
        options: &RecordingOptions<'_>,
    ) -> miette::Result<Self> {
        let recording = Recording::new(simulator, &start.initial, options, rollout)?;
        Ok(Self { start, recording, warnings: Warnings(Vec::new()), error: None })
    }

    /// Predicts and records a frame. Returns whether there are more.
    fn advance(&mut self) -> bool {
        self.error.is_none()
            && self.recording.advance(&mut self.warnings).unwrap_or_else(|error| {
                self.error = Some(error);
                false
            })
    }

    fn finish(self, simulator: &Simulator) -> miette::Result<Row> {
        if let Some(error) = self.error {
            return Err(error.into());
        }
        let Start { initial, frames, .. } = self.start;
        Ok(Row {
            points: self.start.points(),
            recorded: self.recording.finish()?,
            frames: *frames,
            outside: start_checks(simulator, initial),
            warnings: self.warnings.0,
        })
    }
}

/// Predicts some scenes, as many together as there are points for.
pub(super) fn predict(
    request: &Request<'_>,
    simulator: &Simulator,
    jobs: &[Job],
    interrupt: &Interrupt,
) -> Vec<miette::Result<Row>> {
    let starts: Vec<miette::Result<Start>> =
        jobs.par_iter().map(|job| Start::find(request, simulator, job, interrupt)).collect();
    let mut ready: Vec<(&Job, &Start)> = Vec::new();
    for (job, start) in jobs.iter().zip(&starts) {
        ready.extend(start.as_ref().ok().map(|start| (job, start)));
    }
    let mut rows = Vec::new();
    let mut left = &ready[..];
    while !left.is_empty() {
        let (group, others) = left.split_at(together(left));
        rows.extend(predict_together(request, simulator, group, interrupt));
        left = others;
    }
    let mut rows = rows.into_iter();
    let row = |start| match start {
        Ok(_) => rows.next(),
        Err(error) => Some(Err(error)),
    };
    starts.into_iter().filter_map(row).collect()
}

/// How many of the first scenes have no more than [`POINTS`] points; at least one.
fn together(scenes: &[(&Job, &Start)]) -> usize {
    let mut points = 0;
    let fits = |(_, start): &&(&Job, &Start)| {
        points += start.points();
        points <= POINTS
    };
    scenes.iter().take_while(fits).count().max(1)
}

/// Predicts scenes frame by frame.
fn predict_together(
    request: &Request<'_>,
    simulator: &Simulator,
    scenes: &[(&Job, &Start)],
    interrupt: &Interrupt,
) -> Vec<miette::Result<Row>> {
    let initial: Vec<&InitialFrames> = scenes.iter().map(|(_, start)| &start.initial).collect();
    let rollouts = Rollout::several(simulator, &initial);
    let mut predictions: Vec<miette::Result<Prediction<'_>>> = Vec::new();
    for ((job, start), rollout) in scenes.iter().zip(rollouts) {
        let &Start { began, frames, .. } = *start;
        let options = RecordingOptions { model: request.model, output: &job.output, frames, began };
        predictions.push(Prediction::begin(simulator, start, rollout, &options));
    }
    // Each waits for the others.
    let advance = |prediction: &mut miette::Result<Prediction<'_>>| {
        prediction.as_mut().is_ok_and(Prediction::advance)
    };
    while !interrupt.requested()
        && predictions.par_iter_mut().map(advance).reduce(|| false, |a, b| a || b)
    {}
    let finish = |prediction: miette::Result<Prediction<'_>>| prediction?.finish(simulator);
    predictions.into_par_iter().map(finish).collect()
}

/// Keeps the warnings of a rollout.
struct Warnings(Vec<String>);

impl RolloutObserver for Warnings {
    fn recorded(&mut self, _: usize) {}

    fn warning(&mut self, text: &str) {
        self.0.push(text.to_owned());
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;

    fn job(folder: &Path, name: &str, from: From) -> Job {
        Job { from, output: folder.join(name).with_extension("h5") }
    }

    fn column(duration: f64) -> From {
        let text = format!(
            "duration = {duration}\n[domain]\nsize = [1.0, 0.5]\ncell = 0.125\n\
             [[column]]\nsize = [0.25, 0.375]\n[material]\nkind = \"mu-i\"\n"
        );
        From::Scene(Box::new(Scene::parse(&text, "column.toml").unwrap()))
    }

    /// Scenes of other lengths and one that cannot be read, in their order.
    #[test]
    fn each_scene_of_a_group_has_its_own_end() {
        let folder = tempfile::TempDir::new().unwrap();
        let here = folder.path();
        let model = Path::new(env!("CARGO_MANIFEST_DIR")).join("../models/tgnns-tiny.safetensors");
        let simulator = Simulator::load(&model).unwrap();
        let jobs = [
            job(here, "long", column(0.4)),
            job(here, "none", From::Trajectory(here.join("missing.h5"))),
            job(here, "short", column(0.2)),
        ];
        let interrupt = Interrupt::default();
        let request = Request { model: &model, frames: None };
        let rows = predict(&request, &simulator, &jobs, &interrupt);
        let interval = simulator.training.frame_interval;
        let frames = |row: &miette::Result<Row>| row.as_ref().ok().map(|row| row.recorded.frames);
        let expected = [0.4, 0.2].map(|time| (time / interval).round() as usize + 1);
        assert_eq!(
            rows.iter().map(frames).collect::<Vec<_>>(),
            [Some(expected[0]), None, Some(expected[1])]
        );
        let error = rows[1].as_ref().err().unwrap().to_string();
        assert!(error.contains("missing.h5"), "{error}");
        assert!(here.join("short.h5").exists() && !here.join("none.h5").exists());
    }
}
