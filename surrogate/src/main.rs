//! The `surrogate` command.

use std::process::ExitCode;

use clap::{Parser, Subcommand};
use surrogate::{eval, rollout, stats, train};

/// A learned simulator of granular flow: trains on trajectories of `dempm` and continues them.
#[derive(Parser)]
#[command(version, propagate_version = true)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Say what a folder of trajectories holds.
    Stats(stats::StatsArgs),
    /// Train a network.
    Train(train::TrainArgs),
    /// Predict a trajectory.
    Rollout(rollout::RolloutArgs),
    /// Compare predictions with trajectories.
    Eval(eval::EvalArgs),
}

fn main() -> ExitCode {
    let done = |()| ExitCode::SUCCESS;
    let result = match Arguments::parse().command {
        Command::Stats(args) => stats::stats(&args).map(done),
        Command::Train(args) => train::train(&args),
        Command::Rollout(args) => rollout::rollout(&args),
        Command::Eval(args) => eval::eval(&args).map(done),
    };
    result.unwrap_or_else(|report| {
        eprintln!("{report:?}");
        ExitCode::FAILURE
    })
}
