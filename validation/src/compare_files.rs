//! `validation compare`: how far runs are from another one.

use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::Args;
use dempm::trajectory::Trajectory;
use miette::{Context, IntoDiagnostic, bail};

use crate::compare::{common_times, difference};
use crate::table::number;

/// Parts of the common time at which a table has a line.
const PARTS: [f64; 5] = [0.1, 0.25, 0.5, 0.75, 1.0];

/// Two runs of a scene on two devices, with two seeds, two settings, or a run and a rollout.
#[derive(Args)]
pub struct CompareArgs {
    /// Trajectory that the others are compared with.
    truth: PathBuf,
    /// Trajectories of the same material, in points of any size.
    #[arg(required = true)]
    runs: Vec<PathBuf>,
}

/// Prints the differences as a table in Markdown.
///
/// # Errors
/// If a file cannot be read, begins with other material or has no time in common.
pub fn compare(args: &CompareArgs) -> miette::Result<ExitCode> {
    for path in args.runs.iter().chain([&args.truth]) {
        let file = Trajectory::open(path)?;
        if file.status() != "finished" {
            eprintln!("{}: {}, {} frames", path.display(), file.status(), file.frames());
        }
    }
    let rows = args.runs.iter().map(|run| rows(run, &args.truth));
    let rows = rows.collect::<miette::Result<String>>()?;
    println!("Differences from {}:\n", args.truth.display());
    println!(
        "| run | time [s] | MSE [box²] | front [m] | height profile [m] | centre of mass [m] | kinetic energy |"
    );
    println!("|---|---|---|---|---|---|---|");
    println!(
        "{rows}\nMSE: mean square distance of points, the width of the box is 1. Front: of the foremost point. Height\n\
         profile: root mean square. Kinetic energy: in parts of its largest value over time."
    );
    Ok(ExitCode::SUCCESS)
}

fn rows(run: &Path, truth: &Path) -> miette::Result<String> {
    let found = difference(run, truth)?;
    if found.errors.is_empty() {
        let why = found.failure.as_deref().unwrap_or("they have no time in common");
        bail!("{} cannot be compared with {}: {why}", run.display(), truth.display());
    }
    let energy = energies(run, truth).wrap_err_with(|| format!("reading {}", run.display()))?;
    let mut text = String::new();
    for part in PARTS {
        let k = ((part * found.errors.len() as f64).round() as usize).saturating_sub(1);
        let error = &found.errors[k];
        // Writing to a string cannot fail.
        let _ = writeln!(
            text,
            "| {} | {} | {} | {} | {} | {} | {} |",
            run.display(),
            number(error.time),
            number(error.mse),
            number(error.front),
            number(error.height),
            number(error.centre),
            energy.get(k).map_or(String::new(), |&part| number(part)),
        );
    }
    Ok(text)
}

/// Differences of the kinetic energies in parts of the truth's largest, at the common times; nothing if
/// one of the files does not have them.
fn energies(run: &Path, truth: &Path) -> miette::Result<Vec<f64>> {
    let open = |path| Trajectory::open(path).into_diagnostic();
    let [run, truth] = [open(run)?, open(truth)?];
    let [Some(a), Some(b)] = [&run, &truth].map(|file| file.budget().get("kinetic_energy")) else {
        return Ok(Vec::new());
    };
    let largest = b.iter().copied().fold(f64::MIN_POSITIVE, f64::max);
    let pairs = common_times(run.time(), truth.time());
    Ok(pairs.into_iter().map(|(i, j)| (a[i] - b[j]) / largest).collect())
}
