//! The work directory: runs in `runs/`, computed values in `values/`.

use std::fs;
use std::path::{Path, PathBuf};
use std::time::Duration;

use files::{FileLock, INTERRUPTED, Interrupt, note, write_atomically};
use miette::{IntoDiagnostic, WrapErr};
use rayon::ThreadPoolBuilder;
use rayon::prelude::*;
use serde::Serialize;
use serde::de::DeserializeOwned;

use super::hash::{hash, hash_of_file};
use super::job::Job;
use super::json::{read_json, write_json};
use super::process::{Ended, Interrupted, Killed, Program, printed};
use super::run::{About, RECORD, Run, forget_differences};
use crate::machine::load_per_core;

/// Part of all hashes; changes when results of earlier versions become invalid.
const VERSION: u32 = 2;

/// The work directory and the program that makes its runs.
pub struct RunCache {
    root: PathBuf,
    program: Program,
    build: String,
    interrupt: Interrupt,
    /// Runs used since they were last taken, in the order of use.
    used: Vec<Run>,
}

impl RunCache {
    /// Opens or creates the directory. Programs run as subcommands of `program`; without `gpu` no GPU
    /// is visible to them, so that all methods run on the same device.
    ///
    /// # Errors
    /// If the directory cannot be created or `program` cannot be read.
    pub fn open(
        root: &Path,
        program: PathBuf,
        gpu: bool,
        interrupt: Interrupt,
    ) -> miette::Result<Self> {
        let failed = || format!("cannot use the work directory {}", root.display());
        let build = hash_of_file(&program).into_diagnostic().wrap_err_with(failed)?;
        let root = fs::create_dir_all(root)
            .and_then(|()| fs::canonicalize(root))
            .into_diagnostic()
            .wrap_err_with(failed)?;
        let program = Program { path: program, gpu };
        Ok(Self { root, program, build, interrupt, used: Vec::new() })
    }

    /// The directory.
    pub fn root(&self) -> &Path {
        &self.root
    }

    /// The runs used since the last call.
    pub fn take_used(&mut self) -> Vec<Run> {
        std::mem::take(&mut self.used)
    }

    /// The program whose subcommands make the runs.
    pub fn program(&self) -> &Path {
        &self.program.path
    }

    /// Hash of the program.
    pub fn build(&self) -> &str {
        &self.build
    }

    /// Checks for an interruption.
    ///
    /// # Errors
    /// If the user wants to stop.
    pub fn check(&self) -> Result<(), Interrupted> {
        if self.interrupt.requested() { Err(Interrupted) } else { Ok(()) }
    }

    /// Whether a job has been done, successfully or not.
    pub fn has(&self, job: &Job) -> bool {
        self.record(job).is_some()
    }

    /// How a job ended. A job whose trajectory is gone counts as not done.
    fn record(&self, job: &Job) -> Option<Run> {
        let folder = self.folder(job);
        let run: Run = read_json(&folder.join(RECORD))?;
        let output = folder.join(job.output);
        // The directory may have moved.
        (!run.succeeded || output.exists()).then_some(Run { output, ..run })
    }

    /// Counts a run among those used.
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

    /// The results of several jobs, up to `parallel` at a time, so that their times cannot be
    /// compared. `done` is called after each with its index.
    ///
    /// # Errors
    /// As [`run`](Self::run).
    pub fn run_parallel(
        &mut self,
        jobs: &[Job],
        parallel: usize,
        done: impl Fn(usize, &Run) + Sync,
    ) -> miette::Result<Vec<Run>> {
        let pool = ThreadPoolBuilder::new().num_threads(parallel).build().into_diagnostic()?;
        let obtain =
            |(index, job): (usize, &Job)| self.obtain(job, |_| ()).inspect(|run| done(index, run));
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
        let _lock = FileLock::wait(&folder.join(RECORD), |holder| {
            note!("waiting for {holder}, which makes the same run");
        })?;
        // Another report may have made it meanwhile.
        match self.record(job) {
            Some(run) => Ok(run),
            None => self.make(job, &folder, tick),
        }
    }

    /// A kept value; `make` computes it if there is none.
    ///
    /// # Errors
    /// If it cannot be computed or written, or the user interrupts.
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

    /// A kept value; `None` if there is none.
    pub fn value<T: DeserializeOwned>(&self, kind: &str, key: &str) -> Option<T> {
        read_json(&self.value_file(kind, key))
    }

    /// Keeps a value. `key` states everything that it depends on.
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
        // The program that runs has something to save.
        let _guard = self.interrupt.guard();
        let failed = || format!("cannot run {} {}", job.program, job.subcommand);
        forget_differences(folder).into_diagnostic().wrap_err_with(failed)?;
        let output = folder.join(job.output);
        let mut arguments =
            arguments(job, folder, &output).into_diagnostic().wrap_err_with(failed)?;
        // As a user would type it beside the directory, wherever that is.
        let command = format!("{} {}", job.program, arguments.join(" "))
            .replace(&*self.root.to_string_lossy(), "report-work");
        if job.resumes {
            let checkpoint = dempm::run::checkpoint::path_beside(&output);
            let flag = if checkpoint.exists() { "--resume" } else { "--overwrite" };
            arguments.push(flag.to_owned());
        }
        let Ended { status, seconds, processor_seconds } = self
            .program
            .run(&arguments, folder, || self.interrupt.requested(), tick)
            .into_diagnostic()
            .wrap_err_with(failed)?;
        self.check()?;
        if status.code().is_none_or(|code| code == i32::from(INTERRUPTED)) {
            let program = job.program.to_owned();
            return Err(Killed { program, status: status.to_string() }.into());
        }
        let [summary, message] = printed(folder);
        let run = Run {
            id: folder.file_name().unwrap_or_default().to_string_lossy().into_owned(),
            command,
            about: About::of(&output),
            output,
            succeeded: status.success(),
            seconds,
            processor_seconds,
            message,
            summary,
            load: load_per_core(),
            build: self.build.clone(),
        };
        write_json(&folder.join(RECORD), &run)?;
        Ok(run)
    }
}

/// Writes the input file of a job; the arguments of its command.
fn arguments(job: &Job, folder: &Path, output: &Path) -> std::io::Result<Vec<String>> {
    let mut arguments = vec![job.subcommand.to_owned()];
    if let Some(input) = &job.input {
        let path = folder.join(input.name);
        write_atomically(&path, |temporary| fs::write(temporary, input.text))?;
        arguments.extend(input.option.map(str::to_owned));
        arguments.push(path.display().to_string());
    }
    arguments.extend(job.arguments.iter().cloned());
    arguments.extend(["-o".to_owned(), output.display().to_string()]);
    Ok(arguments)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_run_whose_trajectory_is_gone_is_not_done() {
        let root = tempfile::tempdir().unwrap();
        let program = std::env::current_exe().unwrap();
        let cache = RunCache::open(root.path(), program, false, Interrupt::default()).unwrap();
        let job = Job {
            subcommand: "run",
            program: "dempm",
            key: String::new(),
            input: None,
            output: "trajectory.h5",
            arguments: Vec::new(),
            resumes: false,
        };
        assert!(!cache.has(&job));
        let folder = cache.folder(&job);
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
        assert!(cache.has(&job));
        write_json(&folder.join(RECORD), &done(true)).unwrap();
        assert!(!cache.has(&job));
        fs::File::create(folder.join("trajectory.h5")).unwrap();
        assert_eq!(cache.record(&job).unwrap().output, folder.join("trajectory.h5"));
    }
}
