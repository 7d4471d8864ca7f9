//! The `validation` command.

use std::process::ExitCode;

use clap::{Parser, Subcommand};
use validation::command::Suite;
use validation::compare_files::{CompareArgs, compare};
use validation::report::{ReportArgs, report};

/// Measures the solver and the learned simulators, and reports what came out.
#[derive(Parser)]
#[command(version, propagate_version = true)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Run what is missing and write the report.
    Report(ReportArgs),
    /// Say how far runs are from another one of the same scene.
    Compare(CompareArgs),
    #[command(flatten)]
    Suite(Suite),
}

fn main() -> ExitCode {
    let result = match Arguments::parse().command {
        Command::Report(args) => report(&args),
        Command::Compare(args) => compare(&args),
        Command::Suite(command) => command.run(),
    };
    result.unwrap_or_else(|report| {
        eprintln!("{report:?}");
        ExitCode::FAILURE
    })
}
