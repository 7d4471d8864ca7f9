//! The command line of `surrogate`, for its program and for programs that embed it.

use std::ffi::OsString;
use std::process::ExitCode;

use clap::{CommandFactory, Parser, Subcommand};
use dempm::commands::shell_files::{ShellFilesArgs, shell_files};
use dempm::commands::terminal::{TerminalArgs, exit_code};

use crate::commands::{
    CalibrateErrorArgs, EvalArgs, ExpectArgs, RolloutArgs, StatsArgs, TrainArgs, calibrate_error,
    eval, expect, rollout, stats, train,
};

/// Learned simulator of granular flow, trained on trajectories of `dempm`.
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
    /// Print statistics of a folder of trajectories.
    Stats(StatsArgs),
    /// Train a network.
    Train(TrainArgs),
    /// Predict a trajectory.
    Rollout(RolloutArgs),
    /// Say how far from the discs a prediction of a scene is to be expected.
    Expect(ExpectArgs),
    /// Compare predictions with trajectories.
    Eval(EvalArgs),
    /// Measure the errors that rollouts state of themselves.
    CalibrateError(CalibrateErrorArgs),
    /// Write completions and manual pages.
    #[command(hide = true)]
    ShellFiles(ShellFilesArgs),
}

impl Arguments {
    /// Runs the command.
    ///
    /// # Errors
    /// Those of the command.
    pub fn run(self) -> miette::Result<ExitCode> {
        let done = |()| ExitCode::SUCCESS;
        let Self { command, terminal } = self;
        let verbose = terminal.apply();
        match command {
            Command::Stats(args) => stats(&args).map(done),
            Command::Train(args) => train(&args),
            Command::Rollout(args) => rollout(&args, verbose),
            Command::Expect(args) => expect(&args, verbose).map(done),
            Command::Eval(args) => eval(&args, verbose).map(done),
            Command::CalibrateError(args) => calibrate_error(&args, verbose).map(done),
            Command::ShellFiles(args) => shell_files(&args, Self::command()).map(done),
        }
    }
}

/// The program: runs the command of `arguments`, the first of which is the program's name, and prints
/// its error. `--help` and wrong options end the process.
pub fn main(arguments: impl IntoIterator<Item = OsString>) -> ExitCode {
    exit_code(|| Arguments::parse_from(arguments).run())
}
