//! The command line of `validation`, for its program and for programs that embed it.

use std::ffi::OsString;
use std::process::ExitCode;

use clap::{CommandFactory, Parser, Subcommand};
use dempm::commands::shell_files::{ShellFilesArgs, shell_files};
use dempm::commands::terminal::{TerminalArgs, exit_code};

use crate::commands::compare::{CompareArgs, compare};
use crate::commands::fit::{FitArgs, fit};
use crate::commands::library::{LibraryArgs, library};
use crate::commands::page::{PageArgs, page};
use crate::commands::report::{ReportArgs, report};
use crate::commands::suite::SuiteCommand;

/// Measures the solver and the learned simulators, and writes a report.
#[derive(Parser)]
#[command(version, propagate_version = true)]
pub struct Arguments {
    #[command(subcommand)]
    command: Command,
    #[command(flatten)]
    terminal: TerminalArgs,
}

#[derive(Subcommand)]
enum Command {
    /// Run what is missing and write the report
    Report(ReportArgs),
    /// Compare runs with a reference run of the same scene
    Compare(CompareArgs),
    /// Write the page of a report again from its numbers and figures
    Page(PageArgs),
    /// Measure every model on many scenes, for the choice of models
    Library(LibraryArgs),
    /// Fit the errors of models to such measurements
    Fit(FitArgs),
    #[command(flatten)]
    Suite(SuiteCommand),
    /// Write completions and manual pages
    #[command(hide = true)]
    ShellFiles(ShellFilesArgs),
}

impl Arguments {
    /// Runs the command.
    ///
    /// # Errors
    /// Those of the command.
    pub fn run(self) -> miette::Result<ExitCode> {
        let Self { command, terminal } = self;
        let verbose = terminal.apply();
        match command {
            Command::Report(args) => report(&args),
            Command::Compare(args) => compare(&args),
            Command::Page(args) => page(&args),
            Command::Library(args) => library(&args),
            Command::Fit(args) => fit(&args),
            Command::Suite(command) => command.run(verbose),
            Command::ShellFiles(args) => {
                shell_files(&args, Self::command()).map(|()| ExitCode::SUCCESS)
            }
        }
    }
}

/// The program: runs the command of `arguments`, the first of which is the program's name, and prints
/// its error. `--help` and wrong options end the process.
pub fn main(arguments: impl IntoIterator<Item = OsString>) -> ExitCode {
    exit_code(|| Arguments::parse_from(arguments).run())
}
