//! Differences of runs from one reference run.

use std::path::{Path, PathBuf};

use dempm::commands::terminal::print_json;
use dempm::comparison::Parts;
use dempm::fronts::mass_front;
use dempm::trajectory::Trajectory;
use files::{is_quiet, out};
use miette::{Context, IntoDiagnostic, miette};
use serde::Serialize;
use surrogate::evaluation::FrameError;

use crate::difference::{common_times, difference};
use crate::text::number;

/// Fractions of the common time at which the table has a row.
const FRACTIONS: [f64; 5] = [0.1, 0.25, 0.5, 0.75, 1.0];

/// Runs beside a reference.
#[derive(Serialize)]
struct Differences<'a> {
    /// File of the reference.
    reference: &'a Path,
    /// The runs.
    runs: Vec<Compared>,
}

/// How far a run is from the reference.
#[derive(Serialize)]
struct Compared {
    /// File of the run.
    run: String,
    /// Number of the parts of the material that are compared.
    parts: usize,
    /// Side of a part, m.
    side: f64,
    /// Whether each is one point in both runs.
    one_by_one: bool,
    /// The differences at the common times.
    rows: Vec<Row>,
}

/// Differences at one time.
#[derive(Serialize)]
struct Row {
    /// Distances between points, fronts, depths and centres of mass.
    #[serde(flatten)]
    error: FrameError,
    /// Difference of the fronts of 99 % of the mass, m.
    mass_front: f64,
    /// Difference of the kinetic energies over the reference's largest; `None` where a file lacks them.
    kinetic_energy: Option<f64>,
}

/// Prints the differences at five times as a table in Markdown, or at all as one JSON object.
///
/// # Errors
/// If a file cannot be read, starts with other material or has no time in common with the reference.
pub(super) fn print_differences(
    reference: &Path,
    runs: &[PathBuf],
    json: bool,
) -> miette::Result<()> {
    let compared: Vec<Compared> =
        runs.iter().map(|run| compared(run, reference)).collect::<miette::Result<_>>()?;
    if json {
        return print_json(&Differences { reference, runs: compared });
    }
    out!("Differences from {}:\n", reference.display())?;
    let columns = [
        "run",
        "time [s]",
        "distance [m]",
        "front [m]",
        "front of 99 % [m]",
        "height profile [m]",
        "centre of mass [m]",
        "kinetic energy",
    ];
    out!("| {} |", columns.join(" | "))?;
    out!("|{}", "---|".repeat(columns.len()))?;
    for found in &compared {
        for row in FRACTIONS.map(|fraction| found.at(fraction)) {
            out!("| {} | {} |", found.run, row.cells().join(" | "))?;
        }
    }
    if is_quiet() {
        return Ok(());
    }
    out!("")?;
    for Compared { run, parts, side, one_by_one, .. } in &compared {
        match one_by_one {
            true => out!("{run}: {parts} points, one by one.")?,
            false => {
                let side = number(1e3 * side);
                out!("{run}: {parts} squares of {side} mm, each the mean of its points.")?;
            }
        }
    }
    out!(
        "Distance: root mean square over the points. Front: position of the foremost point, and of 99 % of the\n\
         mass. Height profile: root mean square difference of the depths in columns two points wide. Kinetic energy:\n\
         difference as a fraction of the reference's largest."
    )?;
    Ok(())
}

impl Compared {
    /// The row at a fraction of the common time.
    fn at(&self, fraction: f64) -> &Row {
        let place = (fraction * self.rows.len() as f64).round() as usize;
        &self.rows[place.saturating_sub(1)]
    }
}

impl Row {
    fn cells(&self) -> [String; 7] {
        let e = &self.error;
        let numbers = [e.time, e.distance, e.front, self.mass_front, e.height, e.centre];
        let [time, distance, front, mass_front, height, centre] = numbers.map(number);
        let energy = self.kinetic_energy.map_or(String::new(), number);
        [time, distance, front, mass_front, height, centre, energy]
    }
}

fn compared(run: &Path, reference: &Path) -> miette::Result<Compared> {
    let reading = || format!("reading {}", run.display());
    let [one, truth] = [Trajectory::open(run)?, Trajectory::open(reference)?];
    let cannot =
        |why: &str| miette!("cannot compare {} with {}: {why}", run.display(), reference.display());
    let parts = Parts::of(&one, &truth).into_diagnostic().wrap_err_with(reading)?;
    let parts = parts.ok_or_else(|| cannot("the two do not start with the same material"))?;
    let found = difference(&one, &truth, &parts).into_diagnostic().wrap_err_with(reading)?;
    if found.errors.is_empty() {
        return Err(cannot(found.failure.as_deref().unwrap_or("they have no time in common")));
    }
    let fronts = fronts(&one, &truth).wrap_err_with(reading)?;
    let energies = energies(&one, &truth);
    let rows = found.errors.into_iter().zip(fronts).enumerate();
    let row = |(k, (error, mass_front))| Row {
        error,
        mass_front,
        kinetic_energy: energies.get(k).copied(),
    };
    Ok(Compared {
        run: run.display().to_string(),
        parts: parts.count(),
        side: parts.side,
        one_by_one: parts.are_points(),
        rows: rows.map(row).collect(),
    })
}

/// Differences of the fronts of 99 % of the mass at the common times (m), at the edges of points.
fn fronts(run: &Trajectory, reference: &Trajectory) -> miette::Result<Vec<f64>> {
    let front = |file: &Trajectory, frame: usize| {
        let flat = file.positions(frame..frame + 1)?.into_raw_vec_and_offset().0;
        let (position, spacing) = (flat.as_chunks().0, file.header().point_spacing);
        miette::Result::<_>::Ok(mass_front(position, &file.points().mass) + 0.5 * spacing)
    };
    let pairs = common_times(run.time(), reference.time());
    let difference = |(i, j)| Ok(front(run, i)? - front(reference, j)?);
    pairs.into_iter().map(difference).collect()
}

/// Differences of the kinetic energies at the common times, over the reference's largest; none if one
/// of the files does not record them.
fn energies(run: &Trajectory, reference: &Trajectory) -> Vec<f64> {
    let [Some(a), Some(b)] = [run, reference].map(|file| file.budget().get("kinetic_energy"))
    else {
        return Vec::new();
    };
    let largest = b.iter().copied().fold(f64::MIN_POSITIVE, f64::max);
    let pairs = common_times(run.time(), reference.time());
    pairs.into_iter().map(|(i, j)| (a[i] - b[j]) / largest).collect()
}
