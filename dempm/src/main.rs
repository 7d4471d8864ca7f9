//! The `dempm` command.

#![warn(clippy::print_stdout, clippy::print_stderr)]

use std::path::PathBuf;
use std::process::ExitCode;

use clap::{Parser, Subcommand};
use dempm::commands::{bench, check, dataset, element, export, info, plot, run};
use files::{note, report_size_limits_as_errors};

/// Granular flow by MPM x DEM: every material point carries its own packing of discs.
#[derive(Parser)]
#[command(version, propagate_version = true)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
    /// Report the device, and why it is not a GPU.
    #[arg(short, long, global = true)]
    verbose: bool,
}

#[derive(Subcommand)]
enum Command {
    /// Simulate a scene into a trajectory file.
    Run(run::RunArgs),
    /// Simulate many scenes into a data set: the scenes of the paper, or your own list.
    Dataset(dataset::DatasetArgs),
    /// Estimate the cost of a scene and warn about it, without simulating.
    Check {
        /// Scene file (TOML).
        scene: PathBuf,
    },
    /// Drive one packing along a path of strain and stress.
    Element(element::ElementArgs),
    /// Measure the speed of this machine, as tables in Markdown.
    Bench(bench::BenchArgs),
    /// Summarise a trajectory file.
    Info {
        /// Trajectory file (HDF5).
        file: PathBuf,
    },
    /// Draw frames of a trajectory, or animate it.
    Plot(plot::PlotArgs),
    /// Write a trajectory or a data set in another format.
    Export(export::ExportArgs),
}

fn main() -> ExitCode {
    report_size_limits_as_errors();
    let done = |()| ExitCode::SUCCESS;
    let Arguments { command, verbose } = Arguments::parse();
    let result = match command {
        Command::Run(args) => run::run(&args, verbose),
        Command::Dataset(args) => dataset::dataset(&args, verbose),
        Command::Check { scene } => check::check(&scene).map(done),
        Command::Element(args) => element::element(&args).map(done),
        Command::Bench(args) => bench::bench(&args, verbose).map(done),
        Command::Info { file } => info::info(&file).map(done),
        Command::Plot(args) => plot::plot(&args).map(done),
        Command::Export(args) => export::export(&args).map(done),
    };
    result.unwrap_or_else(|report| {
        note!("{report:?}");
        ExitCode::FAILURE
    })
}
