//! The command line of `dempm`, for its program and for programs that embed it.

use std::ffi::OsString;
use std::path::PathBuf;
use std::process::ExitCode;

use clap::{Parser, Subcommand};
use files::{note, report_size_limits_as_errors};

use crate::commands::{bench, check, dataset, element, export, info, plot, run};

/// Granular flow by MPM x DEM: every material point carries its own packing of discs.
#[derive(Parser)]
#[command(version, propagate_version = true)]
pub struct Arguments {
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

impl Arguments {
    /// Runs the command.
    ///
    /// # Errors
    /// Those of the command.
    pub fn run(self) -> miette::Result<ExitCode> {
        let done = |()| ExitCode::SUCCESS;
        let Self { command, verbose } = self;
        match command {
            Command::Run(args) => run::run(&args, verbose),
            Command::Dataset(args) => dataset::dataset(&args, verbose),
            Command::Check { scene } => check::check(&scene).map(done),
            Command::Element(args) => element::element(&args).map(done),
            Command::Bench(args) => bench::bench(&args, verbose).map(done),
            Command::Info { file } => info::info(&file).map(done),
            Command::Plot(args) => plot::plot(&args).map(done),
            Command::Export(args) => export::export(&args).map(done),
        }
    }
}

/// The program: runs the command of `arguments`, the first of which is the program's name, and prints
/// its error. `--help` and wrong options end the process.
pub fn main(arguments: impl IntoIterator<Item = OsString>) -> ExitCode {
    report_size_limits_as_errors();
    Arguments::parse_from(arguments).run().unwrap_or_else(|report| {
        note!("{report:?}");
        ExitCode::FAILURE
    })
}
