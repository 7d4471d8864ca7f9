//! `dempm element`: drives one RVE along a path of strain rates and stresses.

use std::path::{Path, PathBuf};

use clap::Args;
use dem::element::{Element, Row, Stage, summary};
use dem::{Packing, Real};
use files::{check_writable, note, refuse_input, refuse_same, write_text};
use miette::{IntoDiagnostic, miette};

use super::outputs::default_output;
use crate::element::{ElementTest, packing_csv, path_csv};
use crate::run::monitor;
use crate::scene::Precision;

/// Drive one RVE along a path, as an element test in a laboratory.
#[derive(Args, Clone, Debug)]
pub struct ElementArgs {
    /// Test file (TOML): table rve, seed or packing, and the stages of the path
    pub test: PathBuf,
    /// Where to write the path (CSV, stresses tension positive) [default: the test's name with .csv,
    /// in the current directory]
    #[arg(short, long)]
    pub output: Option<PathBuf>,
    /// Also write the packing at the start of the path (CSV: cell vectors, then x, y, r)
    #[arg(long, value_name = "CSV")]
    pub dump_packing: Option<PathBuf>,
    /// Working precision of the RVE
    #[arg(long, value_enum, default_value_t = Precision::F64)]
    pub precision: Precision,
}

/// Runs an element test and writes its path.
///
/// # Errors
/// If a file cannot be read or written, the test is wrong, or a stage fails.
pub fn element(args: &ElementArgs) -> miette::Result<()> {
    let test = ElementTest::load(&args.test)?;
    let output = args.output.clone().unwrap_or_else(|| default_output(&args.test, ".csv"));
    let folder = args.test.parent().unwrap_or(Path::new(""));
    // Before the test, which may take minutes.
    let inputs: Vec<PathBuf> =
        std::iter::once(args.test.clone()).chain(test.packing_file(folder)).collect();
    let outputs: Vec<&Path> =
        std::iter::once(&output).chain(&args.dump_packing).map(PathBuf::as_path).collect();
    refuse_same(&outputs)?;
    for path in outputs {
        refuse_input(path, &inputs)?;
        check_writable(path)?;
    }
    let packing = test.prepare(folder)?;
    note!("packing: {} discs, solid fraction {:.4}", packing.discs.len(), packing.solid_fraction());
    if let Some(path) = &args.dump_packing {
        write_text(path, &packing_csv(&packing))?;
    }
    let rows = match args.precision {
        Precision::F32 => run::<f32>(&test, &packing),
        Precision::F64 => run::<f64>(&test, &packing),
    }?;
    // The first row is the state before the first step.
    let least = rows[1..].iter().map(Row::pressure).fold(f64::INFINITY, f64::min);
    if args.precision == Precision::F32
        && let Some(warning) =
            monitor::unresolved("the smallest pressure of the path", least, &test.rve.grains)
    {
        note!("{warning}");
    }
    write_text(&output, &path_csv(&rows))?;
    note!("wrote {}", output.display());
    Ok(())
}

/// Drives the packing through all stages and prints a summary of each.
fn run<R: Real>(test: &ElementTest, packing: &Packing<f64>) -> miette::Result<Vec<Row>> {
    let mut element =
        Element::<R>::new(packing.convert(), &test.rve, test.macro_step()).into_diagnostic()?;
    let mut rows = vec![element.row()];
    for (k, stage) in test.stages().enumerate() {
        let first = rows.len();
        element
            .run(stage, test.sampling(), |row| rows.push(*row))
            .map_err(|e| miette!("stage {} ({}): {e}", k + 1, stage.name()))?;
        report(k, stage, &rows[first..]);
    }
    if element.free_steps > 0 {
        note!("stress-free in {} macro steps", element.free_steps);
    }
    if element.thin_steps > 0 {
        note!(
            "too thin for its discs in {} macro steps: deformed by volume and spin only",
            element.thin_steps
        );
    }
    Ok(rows)
}

/// Prints a summary of a stage.
fn report(k: usize, stage: &Stage, rows: &[Row]) {
    let (Some(s), Some(last)) = (summary(rows), rows.last()) else { return };
    note!("stage {} ({}), to t = {:.4} s", k + 1, stage.name(), last.t);
    note!(
        "  end:        sxx {:.1} Pa, syy {:.1} Pa, sxy {:.1} Pa, solid fraction {:.4}",
        last.stress[(0, 0)],
        last.stress[(1, 1)],
        last.stress[(0, 1)],
        last.solid_fraction
    );
    note!(
        "  peak:       sin phi {:.3} ({:.1} deg) at exx {:.4}, eyy {:.4}, exy {:.4}",
        s.peak_sin_phi,
        s.peak_sin_phi.asin().to_degrees(),
        s.peak_strain[(0, 0)],
        s.peak_strain[(1, 1)],
        s.peak_strain[(0, 1)]
    );
    note!(
        "  last third: sin phi {:.3}, p {:.1} Pa, solid fraction {:.4}, coordination {:.2}, I {:.2e}",
        s.late_sin_phi,
        s.late_pressure,
        s.late_solid_fraction,
        s.late_coordination,
        s.late_inertial_number
    );
}
