//! The work directory: every run under a hash of what went into it, so that a report reuses what
//! is there and continues what was interrupted.

use std::collections::BTreeMap;
use std::fs::{self, File, TryLockError};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use dempm::trajectory::Trajectory;
use files::{INTERRUPTED, write_atomically};
use miette::{IntoDiagnostic, WrapErr};
use rayon::ThreadPoolBuilder;
use rayon::prelude::*;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

use crate::machine::{load_per_core, processor_time};

/// Changes whenever results of an older version must not be used any more.
const VERSION: u32 = 2;
/// How long an interrupted program may take to save its state.
const GRACE: Duration = Duration::from_secs(5);

/// What a run of a program came to.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Run {
    /// Hash of what went into it; the name of its folder.
    pub id: String,
    /// The command as a person would type it.
    pub command: String,
    /// The trajectory that it wrote.
    pub output: PathBuf,
    /// Whether it ended with exit code 0.
    pub succeeded: bool,
    /// Wall time of the last sitting of the process, s, files and preparation included.
    pub seconds: f64,
    /// Processor time of the same over all threads, s; none where the system does not say.
    pub processor_seconds: Option<f64>,
    /// What it said on standard error, and on standard output.
    pub message: String,
    pub summary: String,
    /// Processes that wanted a core at its end, per core; above 1 its wall time is inflated.
    pub load: Option<f64>,
    /// Hash of the program that ran it.
    pub build: String,
    /// What its trajectory says of itself, if it wrote one.
    pub about: Option<About>,
}

/// What a trajectory says about how it was made.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct About {
    pub seed: u64,
    pub device: String,
    pub precision: String,
    pub versions: BTreeMap<String, String>,
    /// Wall time of each phase, s.
    pub wall_time: BTreeMap<String, f64>,
}

impl About {
    fn of(path: &Path) -> Option<Self> {
        let trajectory = Trajectory::open(path).ok()?;
        let header = trajectory.header();
        Some(Self {
            seed: header.seed,
            device: header.device.clone(),
            precision: header.precision.clone(),
            versions: header.versions.clone(),
            wall_time: trajectory.wall_time().clone(),
        })
    }
}

/// The report was interrupted.
#[derive(Debug, thiserror::Error, miette::Diagnostic)]
#[error("interrupted")]
#[diagnostic(help("the same command continues"))]
pub struct Interrupted;

/// A program that did not end by itself: that says nothing of what it was to compute.
#[derive(Debug, thiserror::Error, miette::Diagnostic)]
#[error("{program} was ended from outside ({status})")]
#[diagnostic(help("the same command tries again; was there too little memory?"))]
struct Killed {
    program: String,
    status: String,
}

/// The directory, and who runs the programs.
pub struct Work {
    root: PathBuf,
    program: PathBuf,
    build: String,
    /// Whether programs may use a GPU.
    gpu: bool,
    interrupted: Arc<AtomicBool>,
    /// Runs used since they were last taken, in the order of use.
    used: Vec<Run>,
}

/// A run to be made.
pub struct Job<'a> {
    /// Subcommand of the suite, and the name of the program that has it.
    pub subcommand: &'a str,
    pub program: &'a str,
    /// What its result depends on, apart from `input`.
    pub key: String,
    /// The input file.
    pub input: Option<Input<'a>>,
    /// Name of the file to be written.
    pub output: &'a str,
    /// Arguments after the input; `-o OUTPUT` is added.
    pub arguments: Vec<String>,
    /// Whether `--resume` continues it, and otherwise `--overwrite` starts again.
    pub resumes: bool,
}

/// An input file that is made for a run.
pub struct Input<'a> {
    /// Name of the file.
    pub name: &'a str,
    pub text: &'a str,
    /// The option that it belongs to; none if it is the command's own argument.
    pub option: Option<&'a str>,
}

impl Work {
    /// Opens or makes the directory. Programs run as subcommands of `program`; without `gpu` they
    /// see none, so that all methods run on the same device.
    ///
    /// # Errors
    /// If it cannot be made or `program` cannot be read.
    pub fn open(
        root: &Path,
        program: PathBuf,
        gpu: bool,
        interrupted: Arc<AtomicBool>,
    ) -> miette::Result<Self> {
        fs::create_dir_all(root)
            .and_then(|()| fs::canonicalize(root))
            .and_then(|root| Ok((root, hash_of_file(&program)?)))
            .map(|(root, build)| Self { root, program, build, gpu, interrupted, used: Vec::new() })
            .into_diagnostic()
            .wrap_err_with(|| format!("cannot use the work directory {}", root.display()))
    }

    /// The directory.
    pub fn root(&self) -> &Path {
        &self.root
    }

    /// The runs used since the last call.
    pub fn take_used(&mut self) -> Vec<Run> {
        std::mem::take(&mut self.used)
    }

    /// The program that has the commands of the suite as subcommands.
    pub fn program(&self) -> &Path {
        &self.program
    }

    /// Hash of the program that runs now.
    pub fn build(&self) -> &str {
        &self.build
    }

    /// Whether the user wants to stop.
    ///
    /// # Errors
    /// If so.
    pub fn check(&self) -> Result<(), Interrupted> {
        if self.interrupted.load(Ordering::Relaxed) { Err(Interrupted) } else { Ok(()) }
    }

    /// Whether a job is done, well or not.
    pub fn has(&self, job: &Job) -> bool {
        self.record(job).is_some()
    }

    /// How a job ended. One whose trajectory is gone counts as not done.
    fn record(&self, job: &Job) -> Option<Run> {
        let folder = self.folder(job);
        let run: Run = read_json(&folder.join(RECORD))?;
        let output = folder.join(job.output);
        // The directory may have moved.
        (!run.succeeded || output.exists()).then_some(Run { output, ..run })
    }

    /// Counts a run among those that were used.
    pub fn note(&mut self, run: &Run) {
        if !self.used.iter().any(|used| used.id == run.id) {
            self.used.push(run.clone());
        }
    }

    /// The result of a job: kept, continued or made. `tick` is called while it runs.
    ///
    /// # Errors
    /// If the program cannot be started, files cannot be written, or the user interrupts. A run
    /// that fails is a [`Run`] that did not succeed.
    pub fn run(&mut self, job: &Job, tick: impl Fn(Duration)) -> miette::Result<Run> {
        let run = self.obtain(job, tick)?;
        self.note(&run);
        Ok(run)
    }

    /// The results of several jobs, up to `beside` of them made at a time: for runs whose times say
    /// nothing. `done` is called after each, with its place.
    ///
    /// # Errors
    /// As [`run`](Self::run).
    pub fn run_beside(
        &mut self,
        jobs: &[Job],
        beside: usize,
        done: impl Fn(usize, &Run) + Sync,
    ) -> miette::Result<Vec<Run>> {
        let pool = ThreadPoolBuilder::new().num_threads(beside).build().into_diagnostic()?;
        let obtain =
            |(place, job): (usize, &Job)| self.obtain(job, |_| ()).inspect(|run| done(place, run));
        let all = || jobs.par_iter().enumerate().map(obtain).collect::<Result<_, _>>();
        let runs: Vec<Run> = pool.install(all)?;
        runs.iter().for_each(|run| self.note(run));
        Ok(runs)
    }

    fn obtain(&self, job: &Job, tick: impl Fn(Duration)) -> miette::Result<Run> {
        if let Some(run) = self.record(job) {
            return Ok(run);
        }
        let folder = self.folder(job);
        let _lock = self.lock(&folder)?;
        // Another report may have made it meanwhile.
        match self.record(job) {
            Some(run) => Ok(run),
            None => self.make(job, &folder, tick),
        }
    }

    /// Waits until no other report makes a run in this folder; lasts as long as the returned file,
    /// also if the process is killed.
    fn lock(&self, folder: &Path) -> miette::Result<File> {
        let failed = || format!("cannot use {}", folder.display());
        let file = fs::create_dir_all(folder)
            .and_then(|()| File::create(folder.join("lock")))
            .into_diagnostic()
            .wrap_err_with(failed)?;
        loop {
            match file.try_lock() {
                Ok(()) => return Ok(file),
                Err(TryLockError::WouldBlock) => {
                    self.check()?;
                    std::thread::sleep(Duration::from_millis(200));
                }
                Err(TryLockError::Error(error)) => {
                    return Err(error).into_diagnostic().wrap_err_with(failed);
                }
            }
        }
    }

    /// A value that was computed before, or is now and is then kept.
    ///
    /// # Errors
    /// If it cannot be computed or kept, or the user interrupts.
    pub fn cached<T: Serialize + DeserializeOwned>(
        &self,
        kind: &str,
        key: &str,
        make: impl FnOnce() -> miette::Result<T>,
    ) -> miette::Result<T> {
        if let Some(value) = self.value(kind, key) {
            return Ok(value);
        }
        self.check()?;
        let value = make()?;
        self.keep(kind, key, &value)?;
        Ok(value)
    }

    /// A value that was kept.
    pub fn value<T: DeserializeOwned>(&self, kind: &str, key: &str) -> Option<T> {
        read_json(&self.value_file(kind, key))
    }

    /// Keeps a value; `key` says all that it depends on.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn keep(&self, kind: &str, key: &str, value: &impl Serialize) -> miette::Result<()> {
        write_json(&self.value_file(kind, key), value)
    }

    /// Whether [`cached`](Self::cached) would find a value.
    pub fn has_cached(&self, kind: &str, key: &str) -> bool {
        self.value_file(kind, key).exists()
    }

    fn value_file(&self, kind: &str, key: &str) -> PathBuf {
        let hash = hash(&[&VERSION.to_string(), env!("CARGO_PKG_VERSION"), kind, key]);
        self.root.join("values").join(format!("{kind}-{hash}.json"))
    }

    fn folder(&self, job: &Job) -> PathBuf {
        let input = job.input.as_ref().map_or("", |input| input.text);
        let parts =
            [&VERSION.to_string(), env!("CARGO_PKG_VERSION"), job.subcommand, &job.key, input];
        self.root.join("runs").join(hash(&parts))
    }

    fn make(&self, job: &Job, folder: &Path, tick: impl Fn(Duration)) -> miette::Result<Run> {
        self.check()?;
        let failed = || format!("cannot run {} {}", job.program, job.subcommand);
        forget_differences(folder).into_diagnostic().wrap_err_with(failed)?;
        let mut arguments = vec![job.subcommand.to_owned()];
        if let Some(input) = &job.input {
            let path = folder.join(input.name);
            write_atomically(&path, |temporary| fs::write(temporary, input.text))
                .into_diagnostic()
                .wrap_err_with(failed)?;
            arguments.extend(input.option.map(str::to_owned));
            arguments.push(path.display().to_string());
        }
        let output = folder.join(job.output);
        arguments.extend(job.arguments.iter().cloned());
        arguments.extend(["-o".to_owned(), output.display().to_string()]);
        // As it would be typed beside the directory, wherever that is.
        let command = format!("{} {}", job.program, arguments.join(" "))
            .replace(&*self.root.to_string_lossy(), "report-work");
        let checkpoint = dempm::run::checkpoint::path_beside(&output);
        if job.resumes {
            let flag = if checkpoint.exists() { "--resume" } else { "--overwrite" };
            arguments.push(flag.to_owned());
        }

        let began = Instant::now();
        let said = |name: &str| File::create(folder.join(name));
        let mut child = said("stdout.txt")
            .and_then(|out| Ok((out, said("stderr.txt")?)))
            .and_then(|(out, err)| {
                let mut command = Command::new(&self.program);
                if !self.gpu {
                    command.env("CUDA_VISIBLE_DEVICES", "");
                }
                command
                    .args(&arguments)
                    // Colours are for terminals.
                    .env("NO_COLOR", "1")
                    .stdin(Stdio::null())
                    .stdout(out)
                    .stderr(err)
                    .spawn()
            })
            .into_diagnostic()
            .wrap_err_with(failed)?;
        let mut asked: Option<Instant> = None;
        let mut processor_seconds = None;
        let status = loop {
            if let Some(status) = child.try_wait().into_diagnostic().wrap_err_with(failed)? {
                break status;
            }
            tick(began.elapsed());
            processor_seconds = processor_time(child.id()).or(processor_seconds);
            // Ctrl-C reaches the program as well, which saves its state.
            if self.check().is_err() && asked.get_or_insert_with(Instant::now).elapsed() > GRACE {
                child.kill().into_diagnostic().wrap_err_with(failed)?;
            }
            std::thread::sleep(Duration::from_millis(50));
        };
        self.check()?;
        if status.code().is_none_or(|code| code == i32::from(INTERRUPTED)) {
            return Err(
                Killed { program: job.program.to_owned(), status: status.to_string() }.into()
            );
        }
        let text = |name: &str| {
            let bytes = fs::read(folder.join(name)).unwrap_or_default();
            String::from_utf8_lossy(&bytes).trim().to_owned()
        };
        let id = folder.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let run = Run {
            id,
            command,
            about: About::of(&output),
            output,
            succeeded: status.success(),
            seconds: began.elapsed().as_secs_f64(),
            processor_seconds,
            message: text("stderr.txt"),
            summary: text("stdout.txt"),
            load: load_per_core(),
            build: self.build.clone(),
        };
        write_json(&folder.join(RECORD), &run)?;
        Ok(run)
    }
}

/// The file that says how a run ended.
const RECORD: &str = "run.json";

/// Beginning of the names of files that hold how far the run of a folder is from others.
pub const DIFFERENCE: &str = "difference-";

/// Removes what was computed from an earlier run in this folder.
fn forget_differences(folder: &Path) -> std::io::Result<()> {
    for entry in fs::read_dir(folder)? {
        let path = entry?.path();
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        if name.starts_with(DIFFERENCE) {
            fs::remove_file(&path)?;
        }
    }
    Ok(())
}

/// A short hash of texts and of where one ends and the next begins.
pub fn hash(parts: &[&str]) -> String {
    let mut hasher = blake3::Hasher::new();
    for part in parts {
        hasher.update(&(part.len() as u64).to_le_bytes());
        hasher.update(part.as_bytes());
    }
    hasher.finalize().to_hex()[..20].to_owned()
}

/// A short hash of the contents of a file.
///
/// # Errors
/// If it cannot be read.
pub fn hash_of_file(path: &Path) -> std::io::Result<String> {
    let mut hasher = blake3::Hasher::new();
    std::io::copy(&mut File::open(path)?, &mut hasher)?;
    Ok(hasher.finalize().to_hex()[..20].to_owned())
}

/// A record; one that is missing or damaged is simply made again.
pub fn read_json<T: DeserializeOwned>(path: &Path) -> Option<T> {
    serde_json::from_slice(&fs::read(path).ok()?).ok()
}

/// Writes a record, whole or not at all.
///
/// # Errors
/// If that is not possible.
pub fn write_json(path: &Path, value: &impl Serialize) -> miette::Result<()> {
    let text = serde_json::to_vec_pretty(value).into_diagnostic()?;
    write_atomically(path, |temporary| fs::write(temporary, text)).into_diagnostic()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_run_whose_trajectory_is_gone_is_not_done() {
        let root = tempfile::tempdir().unwrap();
        let program = std::env::current_exe().unwrap();
        let work = Work::open(root.path(), program, false, Arc::default()).unwrap();
        let job = Job {
            subcommand: "run",
            program: "dempm",
            key: String::new(),
            input: None,
            output: "trajectory.h5",
            arguments: Vec::new(),
            resumes: false,
        };
        assert!(!work.has(&job));
        let folder = work.folder(&job);
        let done = |succeeded| Run {
            id: String::new(),
            command: String::new(),
            output: "elsewhere/trajectory.h5".into(),
            succeeded,
            seconds: 1.0,
            processor_seconds: None,
            message: String::new(),
            summary: String::new(),
            load: None,
            build: String::new(),
            about: None,
        };
        // One that failed need not have written any.
        write_json(&folder.join(RECORD), &done(false)).unwrap();
        assert!(work.has(&job));
        write_json(&folder.join(RECORD), &done(true)).unwrap();
        assert!(!work.has(&job));
        File::create(folder.join("trajectory.h5")).unwrap();
        assert_eq!(work.record(&job).unwrap().output, folder.join("trajectory.h5"));
    }

    #[test]
    fn what_was_computed_from_an_earlier_run_is_forgotten() {
        let folder = tempfile::tempdir().unwrap();
        let [old, kept] = ["difference-1.json", "stderr.txt"].map(|name| folder.path().join(name));
        for path in [&old, &kept] {
            fs::write(path, "").unwrap();
        }
        forget_differences(folder.path()).unwrap();
        assert!(!old.exists() && kept.exists());
    }
}
