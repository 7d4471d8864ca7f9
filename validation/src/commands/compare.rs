//! `validation compare`: how far runs are from a reference run or from the truth.

use std::path::PathBuf;
use std::process::ExitCode;

use clap::Args;
use dempm::commands::terminal::note_unfinished;
use miette::bail;

use super::differences::print_differences;
use super::distances::{TIMES, print_distances};

/// Runs of one scene on two devices, with two seeds, models or settings, or a run and a rollout.
#[derive(Args)]
pub struct CompareArgs {
    /// Trajectories of the same material, in points of any size; without --truth the first is the reference
    #[arg(required = true, value_name = "RUN")]
    runs: Vec<PathBuf>,
    /// Runs of the scene as discs, one for each seed
    #[arg(long, num_args = 1.., value_name = "RUN")]
    truth: Vec<PathBuf>,
    /// With --truth: times in the table, s
    #[arg(long, requires = "truth", value_delimiter = ',', default_values_t = TIMES)]
    times: Vec<f64>,
    /// Print the numbers at all times as one JSON object
    #[arg(long)]
    json: bool,
}

/// Prints the comparison as tables in Markdown, or as JSON.
///
/// # Errors
/// If a file cannot be read, starts with other material or has no time in common with the
/// reference.
pub fn compare(args: &CompareArgs) -> miette::Result<ExitCode> {
    for path in args.runs.iter().chain(&args.truth) {
        note_unfinished(path)?;
    }
    match (&args.runs[..], &args.truth[..]) {
        ([reference, runs @ ..], []) if !runs.is_empty() => {
            print_differences(reference, runs, args.json)?
        }
        (_, []) => bail!("a single run: name another to compare it with, or the --truth"),
        (runs, truth) => print_distances(runs, truth, &args.times, args.json)?,
    }
    Ok(ExitCode::SUCCESS)
}
