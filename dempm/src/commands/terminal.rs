//! What the programs print besides their results.

use std::path::Path;
use std::process::ExitCode;

use clap::Args;
use files::{PrintError, note, print_result, report_size_limits_as_errors, set_json, set_quiet};
use miette::IntoDiagnostic;
use serde::Serialize;

use crate::trajectory::{Trajectory, TrajectoryError};

/// Options of all commands of a program.
#[derive(Args, Clone, Copy, Debug)]
pub struct TerminalArgs {
    /// Print results, warnings and errors only: no progress, no summary of what was written
    #[arg(short, long, global = true)]
    quiet: bool,
    /// Report the device, and why it is not a GPU
    #[arg(short, long, global = true, conflicts_with = "quiet")]
    verbose: bool,
}

impl TerminalArgs {
    /// Sets the streams up for a command, which may ask for [JSON](files::set_json). Returns whether details are
    /// wanted.
    pub fn apply(self) -> bool {
        set_quiet(self.quiet);
        set_json(false);
        self.verbose
    }
}

/// Runs a program and prints its error, unless that is a reader who has seen enough.
pub fn exit_code(run: impl FnOnce() -> miette::Result<ExitCode>) -> ExitCode {
    report_size_limits_as_errors();
    run().unwrap_or_else(|report| {
        if !report.downcast_ref().is_some_and(PrintError::is_closed) {
            note!("{report:?}");
        }
        ExitCode::FAILURE
    })
}

/// Prints a summary as one JSON object. Numbers that are not finite are null.
///
/// # Errors
/// If the standard output is closed or full.
pub fn print_json(summary: &impl Serialize) -> miette::Result<()> {
    let text = serde_json::to_string_pretty(summary).into_diagnostic()?;
    print_result(format_args!("{text}\n"))?;
    Ok(())
}

/// Prints a note if the run of a trajectory is not finished.
///
/// # Errors
/// If it cannot be read.
pub fn note_unfinished(path: &Path) -> Result<(), TrajectoryError> {
    let file = Trajectory::open(path)?;
    if file.status() != "finished" {
        note!("{}: not finished ({}), {} frames", path.display(), file.status(), file.frames());
    }
    Ok(())
}
