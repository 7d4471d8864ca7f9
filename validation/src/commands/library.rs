//! `validation library`: every model on many scenes against the truth, as a table.

use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Duration;

use clap::Args;
use dempm::dataset::{self, Split};
use dempm::device::Device;
use files::{INTERRUPTED, Interrupt, announce, refuse_input};
use miette::{IntoDiagnostic, bail};

use crate::library::{self, Named, Options};

/// Scenes at a time on a GPU.
const JOBS_ON_A_GPU: usize = 8;

/// Arguments of `validation library`.
#[derive(Args)]
pub struct LibraryArgs {
    /// Lists of scenes (TOML), as `dempm dataset` reads them; those of their training sets are measured
    #[arg(required = true, value_name = "LIST")]
    lists: Vec<PathBuf>,
    /// The table (CSV); scenes that it has are kept
    #[arg(short, long)]
    output: PathBuf,
    /// Device to run on: auto (every visible GPU, else the CPU), cpu, cuda (every GPU) or cuda:N
    #[arg(long, default_value = "auto")]
    device: Device,
    /// Scenes at a time on each device [default: 8 on a GPU, 1 on the CPU]
    #[arg(long, value_parser = clap::value_parser!(u16).range(1..=256))]
    jobs: Option<u16>,
    /// Seeds of the discs
    #[arg(long, default_value_t = 3, value_parser = clap::value_parser!(u64).range(2..=100))]
    seeds: u64,
    /// Time after which no further scene is begun, s
    #[arg(long, value_name = "SECONDS")]
    budget: Option<f64>,
}

/// Measures what the table lacks.
///
/// # Errors
/// If a list or the table cannot be read, a device cannot be used or the table cannot be written.
pub fn library(args: &LibraryArgs) -> miette::Result<ExitCode> {
    let interrupt = Interrupt::install()?;
    refuse_input(&args.output, &args.lists)?;
    let scenes = scenes_of(&args.lists)?;
    let selection = args.device.select_all().into_diagnostic()?;
    let usual = if selection.gpus.is_empty() { 1 } else { JOBS_ON_A_GPU };
    let options = Options {
        jobs: args.jobs.map_or(usual, usize::from),
        devices: selection.gpus,
        seeds: args.seeds,
        budget: args.budget.map(|seconds| Duration::from_secs_f64(seconds.max(0.0))),
    };
    let _guard = interrupt.guard();
    let done = library::run(&scenes, &args.output, &options, &interrupt)?;
    announce!("{}: {done} of {} scenes", args.output.display(), scenes.len());
    Ok(if interrupt.requested() { ExitCode::from(INTERRUPTED) } else { ExitCode::SUCCESS })
}

/// The training scenes of the lists, named `LIST/SCENE`.
fn scenes_of(lists: &[PathBuf]) -> miette::Result<Vec<Named>> {
    let mut scenes = Vec::new();
    for (index, list) in lists.iter().enumerate() {
        let stem = list.file_stem().unwrap_or_default().to_string_lossy();
        if lists[..index].iter().any(|other| other.file_stem() == list.file_stem()) {
            bail!(
                help = "scenes are named after their list: rename one",
                "{}: another list is called `{stem}`, too",
                list.display()
            );
        }
        let cases = dataset::cases(list)?.into_iter().filter(|case| case.split == Split::Train);
        let named = |case: dataset::Case| Named {
            name: format!("{stem}/{}", case.name),
            scene: case.scene,
        };
        scenes.extend(cases.map(named));
    }
    Ok(scenes)
}
