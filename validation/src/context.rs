//! What sections work with: runs, data, models, and how much to compute.

use std::cell::RefCell;
use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::rc::Rc;
use std::time::{Duration, Instant};

use clap::ValueEnum;
use dempm::check::Needs;
use dempm::scene::Scene;
use miette::{IntoDiagnostic, WrapErr};
use serde::Serialize;
use serde::de::DeserializeOwned;
use surrogate::network::Precision;

use crate::computed::Computed;
use crate::progress::Progress;
use crate::sweep::Sweep;
use crate::work::{Input, Job, Run, Work, hash_of_file};

/// About what a rollout takes, s.
const ROLLOUT: f64 = 5.0;
/// Rollouts at a time on a GPU: most of one is starting, reading and writing.
const BESIDE: usize = 8;

/// How much to compute.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Suite {
    /// Small cases: minutes on two cores.
    Quick,
    /// Everything, for a GPU.
    Full,
}

/// A trained model, and how it predicts.
#[derive(Clone, Debug)]
pub struct Model {
    /// Its folder's name for `NAME/best.safetensors`, else the file's; and how it predicts, if not
    /// in f32 from the window alone.
    pub name: String,
    pub path: PathBuf,
    /// Precision of its products.
    pub precision: Precision,
    /// Averages with the prediction of the mirrored window.
    pub mirror: bool,
    /// How far it predicts, in frames of its own; to the end if none.
    pub frames: Option<usize>,
}

impl Model {
    /// A file of weights, in f32.
    pub fn new(name: String, path: PathBuf) -> Self {
        Self { name, path, precision: Precision::F32, mirror: false, frames: None }
    }

    /// The same in bf16, which only a GPU has.
    #[must_use]
    pub fn in_bf16(&self) -> Self {
        let name = format!("{}, bf16", self.name);
        Self { name, precision: Precision::Bf16, ..self.clone() }
    }

    /// The same with mirror images averaged, at twice the price.
    #[must_use]
    pub fn mirrored(&self) -> Self {
        Self { name: format!("{}, mirror", self.name), mirror: true, ..self.clone() }
    }
}

/// Where sections get what they need.
pub struct Context {
    pub suite: Suite,
    /// `cpu`, `cuda` or `cuda:N`, as `dempm run` takes it.
    pub device: String,
    /// The device in words, on which times depend: the name of a GPU, or of the processor with the
    /// number of threads.
    pub device_name: String,
    pub work: Work,
    pub progress: Progress,
    /// Folder of trajectories, which may have `train/`, `valid/` and `test/`.
    pub data: Option<PathBuf>,
    pub models: Vec<Model>,
    /// Runs that the sections so far rest on.
    pub runs: Vec<Run>,
    /// Disc-steps per second expected of the device, for estimates only.
    pub rate: f64,
    /// Hashes of files that have been read.
    pub hashes: RefCell<HashMap<PathBuf, String>>,
    /// Sweeps that have been compared, by the name of the case.
    pub sweeps: HashMap<&'static str, Rc<Sweep>>,
}

impl Context {
    /// Runs a scene, given as the text of its file, if that has not been done.
    ///
    /// # Errors
    /// If the program cannot be run or the user interrupts. A scene that is refused or fails is a
    /// [`Run`] that did not succeed, with what the program said.
    pub fn run(&mut self, what: &str, scene: &str) -> miette::Result<Run> {
        let estimate = self.estimate(scene);
        self.job(what, estimate, &self.scene_job(scene))
    }

    /// The same once more, for its time.
    ///
    /// # Errors
    /// As [`run`](Self::run).
    pub fn run_again(&mut self, what: &str, scene: &str, again: usize) -> miette::Result<Run> {
        let job = self.scene_job(scene);
        let key = job.key.clone() + &repetition(again);
        self.job(what, 1.0, &Job { key, ..job })
    }

    /// Estimated time of [`run`](Self::run), s; 0 if it has been done.
    pub fn estimate(&self, scene: &str) -> f64 {
        if self.work.has(&self.scene_job(scene)) {
            return 0.0;
        }
        // A wrong scene is refused at once.
        let needs = Scene::parse(scene, "scene.toml").map(|scene| Needs::of(&scene, self.rate));
        needs.map_or(0.0, |needs| needs.seconds + 1.0)
    }

    /// Predicts with a model: all frames of a scene, or of a trajectory from its first frames on.
    ///
    /// # Errors
    /// As [`run`](Self::run), and if model or trajectory cannot be read.
    pub fn rollout(&mut self, model: &Model, start: &Start) -> miette::Result<Run> {
        self.rollout_again(model, start, 0)
    }

    /// The same once more, for its time.
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

    /// Predicts from several starts: on a GPU several at a time, so that the times say nothing. `done`
    /// is called after each, with its place.
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
        let missing = jobs.iter().filter(|job| !self.work.has(job)).count();
        let half = (rayon::current_num_threads() / 2).clamp(1, BESIDE);
        // On processors, one rollout has them all.
        let beside = if self.device == "cpu" { 1 } else { half };
        self.progress.begin("rollouts", ROLLOUT * missing as f64 / beside as f64);
        let (began, progress) = (Instant::now(), &self.progress);
        let runs = self.work.run_beside(&jobs, beside, |place, run| {
            done(place, run);
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
        // Left alone, it takes the first GPU, or the processor for a network that no GPU can hold.
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

    /// Hash of a file's contents, which stay as they are while the report is made.
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

    /// A value computed in this process, once: `key` says all that it depends on.
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
        if self.work.has_cached(kind, key) {
            return self.work.cached(kind, key, make);
        }
        self.progress.begin(kind, seconds);
        let value = self.work.cached(kind, key, make);
        self.progress.end();
        value
    }

    /// Adds the runs of a section to those that the report rests on.
    pub fn rests_on(&mut self, computed: &Option<Computed>) {
        for run in computed.iter().flat_map(|computed| &computed.runs) {
            if !self.runs.iter().any(|known| known.id == run.id) {
                self.runs.push(run.clone());
            }
        }
    }

    /// Trajectories in a folder of the data (`train`, `valid` or `test`), with their names.
    pub fn cases(&self, set: &str) -> Vec<(String, PathBuf)> {
        let name =
            |path: &PathBuf| path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        self.trajectories(set).into_iter().map(|path| (name(&path), path)).collect()
    }

    /// Trajectories in a folder of the data: `train`, `valid` or `test`.
    pub fn trajectories(&self, set: &str) -> Vec<PathBuf> {
        let Some(folder) = self.data.as_ref().map(|data| data.join(set)) else {
            return Vec::new();
        };
        files_in(&folder, "h5")
    }

    fn scene_job<'a>(&self, scene: &'a str) -> Job<'a> {
        Job {
            subcommand: "run",
            program: "dempm",
            key: self.device_name.clone(),
            input: Some(Input { name: "scene.toml", text: scene, option: None }),
            output: "trajectory.h5",
            arguments: vec!["--device".to_owned(), self.device.clone()],
            resumes: true,
        }
    }

    fn job(&mut self, what: &str, estimate: f64, job: &Job) -> miette::Result<Run> {
        let known = self.work.has(job);
        if !known {
            self.progress.begin(what, estimate);
        }
        let progress = &self.progress;
        let run = self.work.run(job, |elapsed: Duration| progress.tick(elapsed));
        if !known {
            self.progress.end();
        }
        run
    }
}

/// What a job's key says of being made once more.
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

/// Models in a folder: `*.safetensors` in it, and `best.safetensors` of trainings in folders of it.
pub fn models_in(folder: &Path) -> Vec<Model> {
    let name = |path: &Path| {
        path.file_stem().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default()
    };
    let mut models: Vec<Model> = files_in(folder, "safetensors")
        .into_iter()
        .map(|path| Model::new(name(&path), path))
        .collect();
    let folders = std::fs::read_dir(folder).into_iter().flatten().flatten();
    for path in folders.map(|entry| entry.path().join("best.safetensors")) {
        if path.exists() {
            models.push(Model::new(path.parent().map(name).unwrap_or_default(), path));
        }
    }
    models.sort_by(|a, b| a.name.cmp(&b.name));
    models
}

/// Files with a suffix in a folder, by name; none if there is no such folder.
pub fn files_in(folder: &Path, suffix: &str) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let mut files: Vec<PathBuf> = entries
        .map(|entry| entry.path())
        .filter(|path| path.extension().is_some_and(|found| found == suffix))
        .collect();
    files.sort();
    files
}
