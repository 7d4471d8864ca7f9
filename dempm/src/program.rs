//! The command line of `dempm`, for its program and for programs that embed it.

use std::ffi::OsString;
use std::process::ExitCode;

use clap::{CommandFactory, Parser, Subcommand};

use crate::commands::shell_files::{ShellFilesArgs, shell_files};
use crate::commands::terminal::{TerminalArgs, exit_code};
use crate::commands::{
    bench, calibrate, check, choose, dataset, element, export, import, info, plot, run,
};

/// Granular flow by MPM x DEM: every material point carries its own packing of discs.
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
    /// Simulate a scene into a trajectory file.
    Run(run::RunArgs),
    /// Simulate many scenes into a data set: the scenes of the paper, or your own list.
    Dataset(dataset::DatasetArgs),
    /// Estimate the cost of a scene and warn about it, without simulating.
    Check(check::CheckArgs),
    /// Find the cheapest model of a scene that is near enough to its grains computed one by one.
    Choose(choose::ChooseArgs),
    /// Drive one packing along a path of strain and stress.
    Element(element::ElementArgs),
    /// Find grains that behave like a measured material, with their uncertainty.
    Calibrate(calibrate::CalibrateArgs),
    /// Measure the speed of this machine, as tables in Markdown.
    Bench(bench::BenchArgs),
    /// Summarise a trajectory file.
    Info(info::InfoArgs),
    /// Draw or animate trajectories, compare them, or chart element tests.
    Plot(plot::PlotArgs),
    /// Write a trajectory or a data set in another format.
    Export(export::ExportArgs),
    /// Make trajectories of another learned simulator readable here.
    Import(import::ImportArgs),
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
            Command::Run(args) => run::run(&args, verbose),
            Command::Dataset(args) => dataset::dataset(&args, verbose),
            Command::Check(args) => check::check(&args).map(done),
            Command::Choose(args) => choose::choose(&args).map(done),
            Command::Element(args) => element::element(&args).map(done),
            Command::Calibrate(args) => calibrate::calibrate(&args, verbose),
            Command::Bench(args) => bench::bench(&args, verbose).map(done),
            Command::Info(args) => info::info(&args).map(done),
            Command::Plot(args) => plot::plot(&args).map(done),
            Command::Export(args) => export::export(&args).map(done),
            Command::Import(args) => import::import(&args).map(done),
            Command::ShellFiles(args) => shell_files(&args, Self::command()).map(done),
        }
    }
}

/// The program: runs the command of `arguments`, the first of which is the program's name, and prints
/// its error. `--help` and wrong options end the process.
pub fn main(arguments: impl IntoIterator<Item = OsString>) -> ExitCode {
    exit_code(|| Arguments::parse_from(arguments).run())
}
