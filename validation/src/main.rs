//! The `validation` command.

#![warn(clippy::print_stdout, clippy::print_stderr)]

use std::process::ExitCode;

use clap::{Parser, Subcommand};
use files::{note, report_size_limits_as_errors};
use validation::commands::compare::{CompareArgs, compare};
use validation::commands::page::{PageArgs, page};
use validation::commands::report::{ReportArgs, report};
use validation::commands::suite::SuiteCommand;

/// Measures the solver and the learned simulators, and writes a report.
#[derive(Parser)]
#[command(version, propagate_version = true)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Run what is missing and write the report
    Report(ReportArgs),
    /// Compare runs with a reference run of the same scene
    Compare(CompareArgs),
    /// Write the page of a report again from its numbers and figures
    Page(PageArgs),
    #[command(flatten)]
    Suite(SuiteCommand),
}

fn main() -> ExitCode {
    report_size_limits_as_errors();
    let result = match Arguments::parse().command {
        Command::Report(args) => report(&args),
        Command::Compare(args) => compare(&args),
        Command::Page(args) => page(&args),
        Command::Suite(command) => command.run(),
    };
    result.unwrap_or_else(|report| {
        note!("{report:?}");
        ExitCode::FAILURE
    })
}
