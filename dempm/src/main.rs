//! The `dempm` command.

use std::path::PathBuf;
use std::process::ExitCode;

use clap::{Parser, Subcommand};
use dempm::{check, dataset, element, export, info, plot, run};

/// Granular flow by MPM x DEM: every material point carries its own packing of discs.
#[derive(Parser)]
#[command(version, propagate_version = true)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Simulate a scene into a trajectory file.
    Run(run::RunArgs),
    /// Simulate many scenes into a data set: those of the paper, or a list of your own.
    Dataset(dataset::DatasetArgs),
    /// Say what a scene needs and costs, without simulating.
    Check {
        /// Scene file (TOML).
        scene: PathBuf,
    },
    /// Drive one packing along a path of strain and stress.
    Element(element::ElementArgs),
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
    let done = |()| ExitCode::SUCCESS;
    let result = match Arguments::parse().command {
        Command::Run(args) => run::run(&args),
        Command::Dataset(args) => dataset::dataset(&args),
        Command::Check { scene } => check::check(&scene).map(done),
        Command::Element(args) => element::element(&args).map(done),
        Command::Info { file } => info::info(&file).map(done),
        Command::Plot(args) => plot::plot(&args).map(done),
        Command::Export(args) => export::export(&args).map(done),
    };
    result.unwrap_or_else(|report| {
        eprintln!("{report:?}");
        ExitCode::FAILURE
    })
}
