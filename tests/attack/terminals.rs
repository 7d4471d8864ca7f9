//! Terminals that are closed or full while work goes on.

use std::fs::File;
use std::io::Read;
use std::process::{Child, Stdio};

use rand::RngExt;

use crate::campaign::{Attack, Finding, Promise, campaign};
use crate::fixtures::copy;
use crate::jobs::Job;
use crate::program::{end, program};

#[test]
fn closed_terminals() {
    campaign("closed_terminals", |attack| {
        if attack.rng.random_ratio(1, 4) { text_only(attack) } else { work(attack) }
    });
}

/// Where a stream leads.
#[derive(Clone, Copy, Debug)]
enum Stream {
    Discarded,
    /// `/dev/full`.
    Full,
    /// A pipe that is closed after so many bytes.
    Pipe(usize),
}

impl Stream {
    fn any(attack: &mut Attack) -> Self {
        match attack.rng.random_range(0..4) {
            0 => Self::Discarded,
            1 => Self::Full,
            _ => Self::Pipe(attack.rng.random_range(0..200)),
        }
    }

    fn open(self) -> Stdio {
        match self {
            Self::Discarded => Stdio::null(),
            Self::Full => File::options()
                .write(true)
                .open("/dev/full")
                .map_or_else(|_| Stdio::null(), Stdio::from),
            Self::Pipe(_) => Stdio::piped(),
        }
    }

    /// Reads what it reads, then closes.
    fn close(self, from: Option<impl Read>) {
        if let (Self::Pipe(bytes), Some(from)) = (self, from) {
            let mut read = Vec::new();
            from.take(bytes as u64).read_to_end(&mut read).expect("a pipe can be read");
        }
    }
}

/// Runs a command with these streams.
fn spawn(mut command: std::process::Command, [out, err]: [Stream; 2]) -> Child {
    let mut child = command.stdout(out.open()).stderr(err.open()).spawn().unwrap();
    let (stdout, stderr) = (child.stdout.take(), child.stderr.take());
    std::thread::spawn(move || out.close(stdout));
    err.close(stderr);
    child
}

fn work(attack: &mut Attack) -> Result<(), Finding> {
    let job = Job::ALL[attack.rng.random_range(0..3)];
    job.undisturbed();
    job.prepare(&attack.folder);
    let streams = [Stream::any(attack), Stream::any(attack)];
    let begin = job.begin(&attack.folder);
    let status = end(spawn(begin.command(), streams));
    if !status.success() {
        let how = format!("stdout and stderr {streams:?}: {status}: {}", begin.line());
        return Promise::PrintingIsNoWork.broken(how);
    }
    if job.results(&attack.folder)? != *job.undisturbed() {
        let how = format!("stdout and stderr {streams:?}: another result: {}", begin.line());
        return Promise::PrintingIsNoWork.broken(how);
    }
    Ok(())
}

/// Commands whose only product is text end with an ordinary error, or have said all in time.
fn text_only(attack: &mut Attack) -> Result<(), Finding> {
    copy(&["scene.toml", "whole.h5", "data"], &attack.folder);
    let lines = [
        "dempm check scene.toml",
        "dempm info whole.h5",
        "surrogate stats data",
        "validation compare whole.h5 whole.h5",
    ];
    let line = program(lines[attack.rng.random_range(0..lines.len())], &attack.folder);
    let streams = [Stream::any(attack), Stream::any(attack)];
    let status = end(spawn(line.command(), streams));
    match (streams[0], status.code()) {
        (Stream::Discarded, Some(0)) | (Stream::Full, Some(1)) | (Stream::Pipe(_), Some(0 | 1)) => {
            Ok(())
        }
        _ => {
            let how = format!("stdout and stderr {streams:?}: {status}: {}", line.line());
            Promise::PrintingIsNoWork.broken(how)
        }
    }
}
