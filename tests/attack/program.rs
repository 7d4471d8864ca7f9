//! Running a program within limits of time and memory.

use std::fs::{self, File};
use std::io;
use std::os::unix::process::{CommandExt, ExitStatusExt};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

use assert_cmd::cargo::cargo_bin;

use crate::campaign::{Finding, Promise};

/// What an input of some kilobytes may take: some seconds, on a machine with much else to do.
const TIME: Duration = Duration::from_secs(60);
/// Address space of a program, bytes.
const MEMORY: u64 = 4 << 30;
/// The signal that Ctrl-C sends, and the one that limits of time send.
const INTERRUPT: i32 = libc::SIGINT;

/// A program about to be run in a folder.
pub struct Program {
    words: Vec<String>,
    folder: PathBuf,
    launcher: Vec<String>,
    interrupt_after: Option<Duration>,
    largest_file: Option<u64>,
}

/// How a program ended and what it printed.
#[derive(Clone, Debug)]
pub struct Ended {
    line: String,
    status: ExitStatus,
    in_time: bool,
    interrupted: bool,
    pub stdout: String,
    pub stderr: String,
}

/// `dempm`, `surrogate` or `validation` with arguments separated by spaces.
///
/// # Panics
/// If the program has not been built.
pub fn program(line: &str, folder: &Path) -> Program {
    let mut words: Vec<String> = line.split_whitespace().map(str::to_owned).collect();
    let path = cargo_bin(&words[0]);
    assert!(path.exists(), "{} is not built: cargo build --workspace --release", path.display());
    words[0] = path.to_string_lossy().into_owned();
    Program {
        words,
        folder: folder.to_owned(),
        launcher: Vec::new(),
        interrupt_after: None,
        largest_file: None,
    }
}

impl Program {
    /// Starts it with another program, such as `strace`.
    pub fn launched_by(mut self, launcher: Vec<String>) -> Self {
        self.launcher = launcher;
        self
    }

    /// Presses Ctrl-C if it takes longer.
    pub fn interrupted_after(mut self, time: Duration) -> Self {
        self.interrupt_after = Some(time);
        self
    }

    /// Lets no file grow larger, bytes.
    pub fn with_files_up_to(mut self, bytes: u64) -> Self {
        self.largest_file = Some(bytes);
        self
    }

    /// The command, without its limits, for a shell.
    pub fn line(&self) -> String {
        let words: Vec<_> = self.launcher.iter().chain(&self.words).cloned().collect();
        format!("cd {} && DEMPM_CACHE_DIR=cache {}", self.folder.display(), words.join(" "))
    }

    /// The command; both streams are discarded unless they are set.
    pub fn command(&self) -> Command {
        let mut words = self.launcher.iter().chain(&self.words);
        let mut command = Command::new(words.next().expect("a command has a program"));
        command.args(words).current_dir(&self.folder).stdin(Stdio::null());
        command.stdout(Stdio::null()).stderr(Stdio::null());
        command.env("DEMPM_CACHE_DIR", "cache").env("CUDA_VISIBLE_DEVICES", "");
        command.env("RAYON_NUM_THREADS", "2").env("NO_COLOR", "1").env("RUST_BACKTRACE", "0");
        // A group of its own, so that a kill reaches what a launcher started.
        command.process_group(0);
        let largest_file = self.largest_file;
        // SAFETY: setrlimit may be called between fork and exec.
        unsafe { command.pre_exec(move || limit(largest_file)) };
        command
    }

    /// Runs it to its end, or to the end of its time.
    pub fn run(&self) -> Ended {
        let streams = ["stdout.txt", "stderr.txt"].map(|name| self.folder.join(name));
        let [stdout, stderr] =
            streams.each_ref().map(|path| File::create(path).expect("the folder takes files"));
        let mut child = self
            .command()
            .stdout(stdout)
            .stderr(stderr)
            .spawn()
            .unwrap_or_else(|error| panic!("{}: {error}", self.line()));
        let mut status = None;
        let mut interrupted = false;
        if let Some(time) = self.interrupt_after {
            status = wait(&mut child, time);
            if status.is_none() {
                interrupted = true;
                signal(&child, INTERRUPT);
            }
        }
        let status = status.or_else(|| wait(&mut child, TIME));
        let in_time = status.is_some();
        let status = status.unwrap_or_else(|| kill(&mut child));
        let [stdout, stderr] = streams.map(|path| {
            let bytes = fs::read(&path).expect("what was printed can be read");
            fs::remove_file(&path).expect("what was printed can be removed");
            String::from_utf8_lossy(&bytes).into_owned()
        });
        Ended { line: self.line(), status, in_time, interrupted, stdout, stderr }
    }
}

/// Limits of the calling process.
fn limit(largest_file: Option<u64>) -> io::Result<()> {
    let set = |resource, most: u64| {
        let limit = libc::rlimit { rlim_cur: most, rlim_max: most };
        // SAFETY: the limit outlives the call.
        match unsafe { libc::setrlimit(resource, &raw const limit) } {
            0 => Ok(()),
            _ => Err(io::Error::last_os_error()),
        }
    };
    set(libc::RLIMIT_AS, MEMORY)?;
    set(libc::RLIMIT_CORE, 0)?;
    largest_file.map_or(Ok(()), |bytes| set(libc::RLIMIT_FSIZE, bytes))
}

/// Waits for the end of a child; kills it if that takes too long.
pub fn end(mut child: Child) -> ExitStatus {
    wait(&mut child, TIME).unwrap_or_else(|| kill(&mut child))
}

/// Ends a child and all that it started.
fn kill(child: &mut Child) -> ExitStatus {
    signal(child, libc::SIGKILL);
    child.wait().expect("a child can be waited for")
}

/// Waits for the end of a child, so long at most.
fn wait(child: &mut Child, time: Duration) -> Option<ExitStatus> {
    let start = Instant::now();
    loop {
        let status = child.try_wait().expect("a child can be waited for");
        if status.is_some() || start.elapsed() > time {
            return status;
        }
        sleep(Duration::from_millis(1));
    }
}

/// Sends a signal to a child and to all that it started.
pub fn signal(child: &Child, signal: i32) {
    let group = i32::try_from(child.id()).expect("process numbers are small");
    // SAFETY: the child has not been waited for, so its number is its own.
    unsafe { libc::killpg(group, signal) };
}

/// Whether a text does more to a terminal than to colour it.
fn controls(text: &str) -> bool {
    let is_control = |c: char| c.is_control() && c != '\n' && c != '\t';
    let mut parts = text.split("\x1b[");
    let plain = parts.next().unwrap_or_default();
    let coloured = parts.map(|part| {
        let rest = part.trim_start_matches(|c: char| c.is_ascii_digit() || c == ';');
        rest.strip_prefix('m').unwrap_or("\x1b")
    });
    std::iter::once(plain).chain(coloured).any(|part| part.contains(is_control))
}

impl Ended {
    /// Whether it did what it was asked.
    pub fn succeeded(&self) -> bool {
        self.status.success()
    }

    /// What every end has to be.
    pub fn is_sound(&self) -> Result<(), Finding> {
        if !self.in_time && self.interrupted {
            return Promise::Interruptible.broken(self.report("did not end by Ctrl-C"));
        }
        if !self.in_time {
            return Promise::NoHang.broken(self.report("took too long"));
        }
        if self.stderr.contains("memory allocation of") {
            return Promise::Memory.broken(self.report("ran out of memory"));
        }
        let by_interrupt = self.interrupted && self.status.signal() == Some(INTERRUPT);
        let ordinary = matches!(self.status.code(), Some(0 | 1 | 2 | 130));
        if !ordinary && !by_interrupt || self.stderr.contains("panicked at") {
            return Promise::NoPanic.broken(self.report(&format!("ended with {}", self.status)));
        }
        if self.status.code() == Some(1) && self.stderr.trim().is_empty() {
            return Promise::NamedError.broken(self.report("failed without a word"));
        }
        if [&self.stdout, &self.stderr].into_iter().any(|text| controls(text)) {
            return Promise::CleanText.broken(self.report("printed a control character"));
        }
        Ok(())
    }

    /// Refused with this file's name in the message.
    pub fn refuses(&self, file: &str) -> bool {
        // Messages are wrapped to the width of a terminal.
        let message: String =
            self.stderr.chars().filter(|c| !c.is_whitespace() && *c != '│').collect();
        self.status.code() == Some(1) && message.contains(file)
    }

    /// What happened, with the command and the end of its messages.
    pub fn report(&self, what: &str) -> String {
        let lines: Vec<&str> = self.stderr.lines().collect();
        let last = lines[lines.len().saturating_sub(8)..].join("\n    ");
        format!("{what}\n  {}\n    {last}", self.line)
    }
}
