//! What sections work with: runs, data, models, and how much to compute.

use std::cell::RefCell;
use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use dempm::check::{Needs, Rates};
use dempm::scene::Scene;
use miette::{IntoDiagnostic, WrapErr};
use serde::Serialize;
use serde::de::DeserializeOwned;
use surrogate::network::Precision;

use crate::folder::{files_in, stem};
use crate::models::Model;
use crate::progress::Progress;
use crate::run_cache::{Input, Job, Run, RunCache, hash_of_file};
use crate::suite::Suite;

/// Estimated time of a rollout, s.
const ROLLOUT: f64 = 5.0;
/// Rollouts at a time on a GPU: most of a rollout is starting, reading and writing.
const PARALLEL_ROLLOUTS: usize = 8;
/// Runs at a time on a GPU: columns of discs are prepared on the processor.
const PARALLEL_RUNS: usize = 4;

/// What sections work with.
pub struct Context {
    /// How much to compute.
    pub suite: Suite,
    /// `cpu`, `cuda` or `cuda:N`, as `dempm run` takes it.
    pub device: String,
    /// The device in words, on which times depend: name of the GPU, or of the processor with the
    /// number of threads.
    pub device_name: String,
    /// Runs and values that are kept.
    pub cache: RunCache,
    /// The progress bar.
    pub progress: Progress,
    /// Folder of trajectories, which may have `train/`, `valid/` and `test/`.
    pub data: Option<PathBuf>,
    /// All models, sorted by name.
    pub models: Vec<Model>,
    /// Runs that the sections so far use.
    pub runs: Vec<Run>,
    /// Expected speed of the device, for estimates only.
    pub rates: Rates,
    /// Hashes of files that have been read.
    pub hashes: RefCell<HashMap<PathBuf, String>>,
}

impl Context {
    /// Runs a scene, given as the text of its file, unless its run is kept.
    ///
    /// # Errors
    /// If the program cannot be run or the user interrupts. A scene that is refused or fails is a
    /// [`Run`] that did not succeed, with the program's message.
    pub fn run(&mut self, what: &str, scene: &str) -> miette::Result<Run> {
        let estimate = self.estimate(scene);
        self.job(what, estimate, &self.scene_job(scene))
    }

    /// Runs several scenes, on a GPU several at a time, so that their times cannot be compared.
    ///
    /// # Errors
    /// As [`run`](Self::run).
    pub fn runs_together(&mut self, what: &str, scenes: &[&str]) -> miette::Result<Vec<Run>> {
        let jobs: Vec<Job> = scenes.iter().map(|scene| self.scene_job(scene)).collect();
        let parallel = if self.device == "cpu" { 1 } else { PARALLEL_RUNS };
        let estimate: f64 = scenes.iter().map(|scene| self.estimate(scene)).sum();
        self.progress.begin(what, estimate / parallel as f64);
        let (began, progress) = (Instant::now(), &self.progress);
        let runs = self.cache.run_parallel(&jobs, parallel, |_, _| progress.tick(began.elapsed()));
        self.progress.end();
        runs
    }

    /// Repeats a run to time it; `again` counts the repetitions from 1.
    ///
    /// # Errors
    /// As [`run`](Self::run).
    pub fn run_again(&mut self, what: &str, scene: &str, again: usize) -> miette::Result<Run> {
        let job = self.scene_job(scene);
        let key = job.key.clone() + &repetition(again);
        self.job(what, 1.0, &Job { key, ..job })
    }

    /// Estimated time of [`run`](Self::run), s; 0 if the run is kept.
    pub fn estimate(&self, scene: &str) -> f64 {
        if self.cache.has(&self.scene_job(scene)) {
            return 0.0;
        }
        // An invalid scene is refused at once.
        let needs = Scene::parse(scene, "scene.toml").map(|scene| Needs::of(&scene, &self.rates));
        needs.map_or(0.0, |needs| needs.seconds + 1.0)
    }

    /// Rolls a model out, over all frames of a scene or of a trajectory after its first frames.
    ///
    /// # Errors
    /// As [`run`](Self::run), and if the model or the trajectory cannot be read.
    pub fn rollout(&mut self, model: &Model, start: &Start) -> miette::Result<Run> {
        self.rollout_again(model, start, 0)
    }

    /// Repeats a rollout to time it; `again` counts the repetitions from 1.
    ///
    /// # Errors
    /// As [`rollout`](Self::rollout).
    pub fn rollout_again(
        &mut self,
        model: &Model,
        start: &Start,
        again: usize,
    ) -> miette::Result<Run> {
        let job = self.rollout_job(model, start, again)?;
        self.job(&format!("rollout of {}", model.name), ROLLOUT, &job)
    }

    /// Several rollouts, on a GPU several at a time, so that their times cannot be compared. `done`
    /// is called after each with its index.
    ///
    /// # Errors
    /// As [`rollout`](Self::rollout).
    pub fn rollouts(
        &mut self,
        wanted: &[(&Model, Start)],
        done: impl Fn(usize, &Run) + Sync,
    ) -> miette::Result<Vec<Run>> {
        let jobs = wanted
            .iter()
            .map(|(model, start)| self.rollout_job(model, start, 0))
            .collect::<miette::Result<Vec<Job>>>()?;
        let missing = jobs.iter().filter(|job| !self.cache.has(job)).count();
        let half = (rayon::current_num_threads() / 2).clamp(1, PARALLEL_ROLLOUTS);
        // A rollout on the CPU uses all cores.
        let parallel = if self.device == "cpu" { 1 } else { half };
        self.progress.begin("rollouts", ROLLOUT * missing as f64 / parallel as f64);
        let (began, progress) = (Instant::now(), &self.progress);
        let runs = self.cache.run_parallel(&jobs, parallel, |index, run| {
            done(index, run);
            progress.tick(began.elapsed());
        });
        self.progress.end();
        runs
    }

    fn rollout_job<'a>(
        &self,
        model: &Model,
        start: &Start<'a>,
        again: usize,
    ) -> miette::Result<Job<'a>> {
        let mut key = format!("{} {}", self.device_name, self.hash(&model.path)?);
        let mut arguments = vec![model.path.display().to_string(), "--overwrite".to_owned()];
        // By default it takes the first GPU, or the CPU for a network that no GPU can hold.
        if self.device != "cpu" && self.device != "cuda:0" {
            arguments.extend(["--device".to_owned(), self.device.clone()]);
        }
        if model.precision == Precision::Bf16 {
            arguments.extend(["--precision", "bf16"].map(str::to_owned));
            key += "bf16";
        }
        if model.mirror {
            arguments.push("--mirror".to_owned());
            key += "mirror";
        }
        if let Some(frames) = model.frames {
            arguments.extend(["--frames".to_owned(), frames.to_string()]);
            key += &format!("frames {frames}");
        }
        key += &repetition(again);
        let mut input = None;
        match start {
            Start::Scene(text) => {
                key += &self.scene_key(text);
                input = Some(Input { name: "scene.toml", text, option: Some("--scene") });
            }
            Start::Trajectory(path) => {
                key += &self.hash(path)?;
                arguments.extend(["--from".to_owned(), path.display().to_string()]);
            }
        }
        Ok(Job {
            subcommand: "rollout",
            program: "surrogate",
            key,
            input,
            output: "trajectory.h5",
            arguments,
            resumes: false,
        })
    }

    /// Hash of a file's contents, read once: files do not change while the report is made.
    ///
    /// # Errors
    /// If the file cannot be read.
    pub fn hash(&self, path: &Path) -> miette::Result<String> {
        if let Some(known) = self.hashes.borrow().get(path) {
            return Ok(known.clone());
        }
        let hash = hash_of_file(path)
            .into_diagnostic()
            .wrap_err_with(|| format!("cannot read {}", path.display()))?;
        self.hashes.borrow_mut().insert(path.to_owned(), hash.clone());
        Ok(hash)
    }

    /// A kept value; `make` computes it in this process, in about `seconds`, if there is none. `key`
    /// states everything that it depends on.
    ///
    /// # Errors
    /// Those of `make`, and if the value cannot be kept or the user interrupts.
    pub fn cached<T: Serialize + DeserializeOwned>(
        &mut self,
        kind: &str,
        key: &str,
        seconds: f64,
        make: impl FnOnce() -> miette::Result<T>,
    ) -> miette::Result<T> {
        if self.cache.has_cached(kind, key) {
            return self.cache.cached(kind, key, make);
        }
        self.progress.begin(kind, seconds);
        let value = self.cache.cached(kind, key, make);
        self.progress.end();
        value
    }

    /// Adds the runs of a section to those that the report uses.
    pub fn add_runs(&mut self, runs: &[Run]) {
        for run in runs {
            if !self.runs.iter().any(|known| known.id == run.id) {
                self.runs.push(run.clone());
            }
        }
    }

    /// Names and files of the trajectories in a folder of the data: `train`, `valid` or `test`.
    pub fn cases(&self, set: &str) -> Vec<(String, PathBuf)> {
        self.trajectories(set).into_iter().map(|path| (stem(&path), path)).collect()
    }

    /// Files of the trajectories in a folder of the data: `train`, `valid` or `test`.
    pub fn trajectories(&self, set: &str) -> Vec<PathBuf> {
        let folder = self.data.as_ref().map(|data| data.join(set));
        folder.map_or(Vec::new(), |folder| files_in(&folder, "h5"))
    }

    /// What the run of a scene depends on besides the program: the device, and all keys with the defaults of
    /// those that its text leaves out.
    pub fn scene_key(&self, scene: &str) -> String {
        let keys = Scene::parse(scene, "scene.toml").map(|scene| format!("{scene:?}"));
        format!("{}\n{}", self.device_name, keys.unwrap_or_default())
    }

    fn scene_job<'a>(&self, scene: &'a str) -> Job<'a> {
        Job {
            subcommand: "run",
            program: "dempm",
            key: self.scene_key(scene),
            input: Some(Input { name: "scene.toml", text: scene, option: None }),
            output: "trajectory.h5",
            arguments: vec!["--device".to_owned(), self.device.clone()],
            resumes: true,
        }
    }

    fn job(&mut self, what: &str, estimate: f64, job: &Job) -> miette::Result<Run> {
        let known = self.cache.has(job);
        if !known {
            self.progress.begin(what, estimate);
        }
        let progress = &self.progress;
        let run = self.cache.run(job, |elapsed: Duration| progress.tick(elapsed));
        if !known {
            self.progress.end();
        }
        run
    }
}

/// Part of the key of a repeated job.
fn repetition(again: usize) -> String {
    if again == 0 { String::new() } else { format!(" again {again}") }
}

/// What a rollout starts from.
pub enum Start<'a> {
    /// The text of a scene file, whose first frames are simulated.
    Scene(&'a str),
    /// A trajectory, whose first frames are taken.
    Trajectory(&'a Path),
}
