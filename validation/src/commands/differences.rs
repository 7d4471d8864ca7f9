//! Differences of runs from one reference run.

use std::path::{Path, PathBuf};

use dempm::fronts::mass_front;
use dempm::trajectory::Trajectory;
use files::out;
use miette::{Context, IntoDiagnostic, bail};

use crate::difference::{common_times, difference};
use crate::text::number;

/// Fractions of the common time at which the table has a row.
const FRACTIONS: [f64; 5] = [0.1, 0.25, 0.5, 0.75, 1.0];

/// Prints the differences as a table in Markdown.
///
/// # Errors
/// If a file cannot be read, starts with other material or has no time in common with the reference.
pub(super) fn print_differences(reference: &Path, runs: &[PathBuf]) -> miette::Result<()> {
    let rows = runs.iter().map(|run| rows(run, reference));
    let rows: Vec<Vec<String>> = rows.collect::<miette::Result<Vec<_>>>()?.concat();
    out!("Differences from {}:\n", reference.display())?;
    let columns = [
        "run",
        "time [s]",
        "mean square distance of points [box²]",
        "front [m]",
        "front of 99 % [m]",
        "height profile [m]",
        "centre of mass [m]",
        "kinetic energy",
    ];
    out!("| {} |", columns.join(" | "))?;
    out!("|{}", "---|".repeat(columns.len()))?;
    for row in rows {
        out!("| {} |", row.join(" | "))?;
    }
    out!(
        "\nThe unit \"box\" is the width of the domain. Front: position of the foremost point, and of 99 % of the\n\
         mass. Height profile: root mean square difference. Kinetic energy: difference as a fraction of the\n\
         reference's largest."
    )?;
    Ok(())
}

/// The cells of a run's rows.
fn rows(run: &Path, reference: &Path) -> miette::Result<Vec<Vec<String>>> {
    let found = difference(run, reference)?;
    if found.errors.is_empty() {
        let why = found.failure.as_deref().unwrap_or("they have no time in common");
        bail!("cannot compare {} with {}: {why}", run.display(), reference.display());
    }
    let fronts = fronts(run, reference).wrap_err_with(|| format!("reading {}", run.display()))?;
    let energy = energies(run, reference).wrap_err_with(|| format!("reading {}", run.display()))?;
    let row = |fraction: f64| {
        let k = ((fraction * found.errors.len() as f64).round() as usize).saturating_sub(1);
        let error = &found.errors[k];
        let numbers = [error.time, error.mse, error.front, fronts[k]]
            .into_iter()
            .chain([error.height, error.centre])
            .map(number);
        let energy = energy.get(k).map_or(String::new(), |&difference| number(difference));
        let name = run.display().to_string();
        std::iter::once(name).chain(numbers).chain([energy]).collect()
    };
    Ok(FRACTIONS.map(row).to_vec())
}

/// Differences of the fronts of 99 % of the mass at the common times (m), at the edges of points.
fn fronts(run: &Path, reference: &Path) -> miette::Result<Vec<f64>> {
    let [run, reference] = [Trajectory::open(run)?, Trajectory::open(reference)?];
    let front = |file: &Trajectory, frame: usize| {
        let flat = file.positions(frame..frame + 1)?.into_raw_vec_and_offset().0;
        let (position, spacing) = (flat.as_chunks().0, file.header().point_spacing);
        miette::Result::<_>::Ok(mass_front(position, &file.points().mass) + 0.5 * spacing)
    };
    let pairs = common_times(run.time(), reference.time());
    let difference = |(i, j)| Ok(front(&run, i)? - front(&reference, j)?);
    pairs.into_iter().map(difference).collect()
}

/// Differences of the kinetic energies at the common times, over the reference's largest; none if one
/// of the files does not record them.
fn energies(run: &Path, reference: &Path) -> miette::Result<Vec<f64>> {
    let open = |path| Trajectory::open(path).into_diagnostic();
    let [run, reference] = [open(run)?, open(reference)?];
    let [Some(a), Some(b)] = [&run, &reference].map(|file| file.budget().get("kinetic_energy"))
    else {
        return Ok(Vec::new());
    };
    let largest = b.iter().copied().fold(f64::MIN_POSITIVE, f64::max);
    let pairs = common_times(run.time(), reference.time());
    Ok(pairs.into_iter().map(|(i, j)| (a[i] - b[j]) / largest).collect())
}
