//! The `surrogate` command.

#![warn(clippy::print_stdout, clippy::print_stderr)]

use std::process::ExitCode;

use clap::{Parser, Subcommand};
use files::{note, report_size_limits_as_errors};
use surrogate::commands::{
    EvalArgs, RolloutArgs, StatsArgs, TrainArgs, eval, rollout, stats, train,
};

/// Learned simulator of granular flow, trained on trajectories of `dempm`.
#[derive(Parser)]
#[command(version, propagate_version = true)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Print statistics of a folder of trajectories.
    Stats(StatsArgs),
    /// Train a network.
    Train(TrainArgs),
    /// Predict a trajectory.
    Rollout(RolloutArgs),
    /// Compare predictions with trajectories.
    Eval(EvalArgs),
}

fn main() -> ExitCode {
    report_size_limits_as_errors();
    let done = |()| ExitCode::SUCCESS;
    let result = match Arguments::parse().command {
        Command::Stats(args) => stats(&args).map(done),
        Command::Train(args) => train(&args),
        Command::Rollout(args) => rollout(&args),
        Command::Eval(args) => eval(&args).map(done),
    };
    result.unwrap_or_else(|report| {
        note!("{report:?}");
        ExitCode::FAILURE
    })
}
