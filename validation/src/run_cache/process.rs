//! A process of a program of the suite.

use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};

use crate::machine::processor_time;

/// Time an interrupted program may take to save its state.
const GRACE: Duration = Duration::from_secs(5);
/// Time between two looks at a process.
const POLL: Duration = Duration::from_millis(50);
/// Files that hold what a program printed.
const STDOUT: &str = "stdout.txt";
const STDERR: &str = "stderr.txt";

/// The user interrupted the report.
#[derive(Debug, thiserror::Error, miette::Diagnostic)]
#[error("interrupted")]
#[diagnostic(help("the same command continues"))]
pub struct Interrupted;

/// A program was killed, which is no result.
#[derive(Debug, thiserror::Error, miette::Diagnostic)]
#[error("{program} was killed ({status})")]
#[diagnostic(help("run the same command again; if this repeats, memory may be too small"))]
pub(super) struct Killed {
    pub program: String,
    pub status: String,
}

/// A program, and whether it may use a GPU.
pub(super) struct Program {
    pub path: PathBuf,
    pub gpu: bool,
}

/// How a process ended.
pub(super) struct Ended {
    pub status: ExitStatus,
    /// Wall time, s.
    pub seconds: f64,
    /// Processor time over all threads, s.
    pub processor_seconds: Option<f64>,
}

impl Program {
    /// Runs the program, which prints into files of `folder`, and calls `tick` until it ends. It is
    /// killed if it does not end by itself soon after `interrupted` turns true.
    pub fn run(
        &self,
        arguments: &[String],
        folder: &Path,
        interrupted: impl Fn() -> bool,
        tick: impl Fn(Duration),
    ) -> io::Result<Ended> {
        let began = Instant::now();
        let mut child = self.start(arguments, folder)?;
        let mut interrupted_at: Option<Instant> = None;
        let mut processor_seconds = None;
        loop {
            if let Some(status) = child.try_wait()? {
                let seconds = began.elapsed().as_secs_f64();
                return Ok(Ended { status, seconds, processor_seconds });
            }
            tick(began.elapsed());
            processor_seconds = processor_time(child.id()).or(processor_seconds);
            // Ctrl-C reaches the program as well, which saves its state.
            if interrupted() && interrupted_at.get_or_insert_with(Instant::now).elapsed() > GRACE {
                child.kill()?;
            }
            std::thread::sleep(POLL);
        }
    }

    fn start(&self, arguments: &[String], folder: &Path) -> io::Result<Child> {
        let mut command = Command::new(&self.path);
        if !self.gpu {
            command.env("CUDA_VISIBLE_DEVICES", "");
        }
        command
            .args(arguments)
            // Colours are for terminals.
            .env("NO_COLOR", "1")
            .stdin(Stdio::null())
            .stdout(File::create(folder.join(STDOUT))?)
            .stderr(File::create(folder.join(STDERR))?)
            .spawn()
    }
}

/// What a program printed into the files of `folder`: standard output and standard error.
pub(super) fn printed(folder: &Path) -> [String; 2] {
    [STDOUT, STDERR].map(|name| {
        let bytes = fs::read(folder.join(name)).unwrap_or_default();
        String::from_utf8_lossy(&bytes).trim().to_owned()
    })
}
