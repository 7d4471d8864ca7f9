//! `dempm element`: drives one RVE along a path of strain rates and stresses.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};
use dem::element::{Element, Row, Stage, summary};
use dem::{Cell, Packing, PlainDisc, Real, RveParameters, consolidate};
use files::{check_writable, refuse_input, write_text};
use miette::{IntoDiagnostic, LabeledSpan, NamedSource, Report, WrapErr, miette};
use nalgebra::Matrix2;
use serde::Deserialize;
use toml::Spanned;

use crate::run::default_output;
use crate::scene::parameters::outside;
use crate::watch;

/// Drive one RVE along a path, as an element test in a laboratory.
#[derive(Args, Clone, Debug)]
pub struct ElementArgs {
    /// Test file (TOML): [rve], seed or packing, and the [[stage]]s of the path
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

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Precision {
    F32,
    F64,
}

/// An element test file.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Test {
    #[serde(default)]
    rve: RveParameters,
    /// Seed of the packing, which is consolidated as `[rve.preparation]` says.
    #[serde(default = "first_seed")]
    seed: u64,
    /// Start from this packing (a dumped one) instead, relative to the test file. It has no
    /// contact history, so an isotropic stage should come first.
    packing: Option<PathBuf>,
    /// Time of constant velocity gradient, and between two decisions of the servo (s).
    #[serde(default = "default_macro_step")]
    macro_step: Spanned<f64>,
    /// Time from row to row of the path (s).
    sampling: Spanned<f64>,
    stage: Vec<Spanned<Stage>>,
}

fn first_seed() -> u64 {
    1
}

fn default_macro_step() -> Spanned<f64> {
    Spanned::new(0..0, 1.0e-4)
}

/// Runs the test and writes its path.
///
/// # Errors
/// When a file cannot be read or written, the test is wrong, or a stage fails.
pub fn element(args: &ElementArgs) -> miette::Result<()> {
    let test = read_test(&args.test)?;
    let output = args.output.clone().unwrap_or_else(|| default_output(&args.test, ".csv"));
    // Before the minutes that a path can take.
    for path in [Some(&output), args.dump_packing.as_ref()].into_iter().flatten() {
        refuse_input(path, [&args.test])?;
        check_writable(path)?;
    }
    let mut packing = match &test.packing {
        Some(path) => {
            let path = args.test.parent().unwrap_or(Path::new("")).join(path);
            read_packing(&path, &test.rve)?
        }
        None => consolidate(&test.rve, test.seed).into_diagnostic()?,
    };
    packing.scale_mass(test.rve.mass_scale);
    eprintln!(
        "packing: {} discs, solid fraction {:.4}",
        packing.discs.len(),
        packing.solid_fraction()
    );
    if let Some(path) = &args.dump_packing {
        write_text(path, &packing_csv(&packing))?;
    }
    let rows = match args.precision {
        Precision::F32 => run::<f32>(&test, &packing),
        Precision::F64 => run::<f64>(&test, &packing),
    }?;
    // The first row is from before the first step.
    let least = rows[1..].iter().map(Row::pressure).fold(f64::INFINITY, f64::min);
    let doubt = watch::unresolved("the smallest pressure of the path", least, &test.rve);
    if let Some(doubt) = doubt.filter(|_| args.precision == Precision::F32) {
        eprintln!("{doubt}");
    }
    write_text(&output, &path_csv(&rows))?;
    eprintln!("wrote {}", output.display());
    Ok(())
}

fn run<R: Real>(test: &Test, packing: &Packing<f64>) -> miette::Result<Vec<Row>> {
    let mut element = Element::<R>::new(packing.convert(), &test.rve, *test.macro_step.get_ref())
        .into_diagnostic()?;
    let mut rows = vec![element.row()];
    for (k, stage) in test.stage.iter().enumerate() {
        let stage = stage.get_ref();
        let first = rows.len();
        element
            .run(stage, *test.sampling.get_ref(), |row| rows.push(*row))
            .map_err(|e| miette!("stage {} ({}): {e}", k + 1, stage.name()))?;
        report(k, stage, &rows[first..]);
    }
    if element.free_steps > 0 {
        eprintln!("stress-free in {} macro steps", element.free_steps);
    }
    if element.thin_steps > 0 {
        eprintln!(
            "too thin for its discs in {} macro steps: deformed by volume and spin only",
            element.thin_steps
        );
    }
    Ok(rows)
}

/// What a stage came to.
fn report(k: usize, stage: &Stage, rows: &[Row]) {
    let (Some(s), Some(last)) = (summary(rows), rows.last()) else { return };
    eprintln!("stage {} ({}), to t = {:.4} s", k + 1, stage.name(), last.t);
    eprintln!(
        "  end:        sxx {:.1} Pa, syy {:.1} Pa, sxy {:.1} Pa, solid fraction {:.4}",
        last.stress[(0, 0)],
        last.stress[(1, 1)],
        last.stress[(0, 1)],
        last.solid_fraction
    );
    eprintln!(
        "  peak:       sin phi {:.3} ({:.1} deg) at exx {:.4}, eyy {:.4}, exy {:.4}",
        s.peak_sin_phi,
        s.peak_sin_phi.asin().to_degrees(),
        s.peak_strain[(0, 0)],
        s.peak_strain[(1, 1)],
        s.peak_strain[(0, 1)]
    );
    eprintln!(
        "  last third: sin phi {:.3}, p {:.1} Pa, solid fraction {:.4}, coordination {:.2}, I {:.2e}",
        s.late_sin_phi,
        s.late_pressure,
        s.late_solid_fraction,
        s.late_coordination,
        s.late_inertial_number
    );
}

fn read_test(path: &Path) -> miette::Result<Test> {
    let text = read(path)?;
    let source = || NamedSource::new(path.to_string_lossy(), text.clone()).with_language("TOML");
    let at = |span: std::ops::Range<usize>, label: String, message: String| -> Report {
        miette!(labels = vec![LabeledSpan::new_with_span(Some(label), span)], "{message}")
            .with_source_code(source())
    };
    let test: Test = toml::from_str(&text).map_err(|e| {
        let span = e.span().unwrap_or(0..0);
        at(span, "here".into(), e.message().to_owned())
    })?;
    if let Some(problem) = outside("rve", &test.rve) {
        return Err(miette!("{}: {problem}", path.display()));
    }
    for (key, value) in [("macro_step", &test.macro_step), ("sampling", &test.sampling)] {
        if !(*value.get_ref() > 0.0 && value.get_ref().is_finite()) {
            return Err(at(value.span(), key.into(), format!("{key} must be positive")));
        }
    }
    if *test.sampling.get_ref() < *test.macro_step.get_ref() {
        return Err(at(
            test.sampling.span(),
            "sampling".into(),
            format!("sampling must be at least macro_step, {} s", test.macro_step.get_ref()),
        ));
    }
    for (k, stage) in test.stage.iter().enumerate() {
        if let Err((key, reason)) = stage.get_ref().check() {
            return Err(at(stage.span(), key.into(), format!("stage {}: {key} {reason}", k + 1)));
        }
    }
    Ok(test)
}

fn read(path: &Path) -> miette::Result<String> {
    std::fs::read_to_string(path)
        .into_diagnostic()
        .wrap_err_with(|| format!("cannot read {}", path.display()))
}

/// Header word and cell vectors, then one disc a line. Shortest decimals that read back exactly.
fn packing_csv(packing: &Packing<f64>) -> String {
    let h = packing.cell.h;
    let mut text = format!("H,{},{},{},{}\n", h[(0, 0)], h[(0, 1)], h[(1, 0)], h[(1, 1)]);
    for d in packing.plain_discs() {
        let _ = writeln!(text, "{},{},{}", d.x[0], d.x[1], d.r);
    }
    text
}

fn read_packing(path: &Path, p: &RveParameters) -> miette::Result<Packing<f64>> {
    let text = read(path)?;
    let bad = |line: usize, what: &str| miette!("{}, line {line}: {what}", path.display());
    let numbers = |line: usize, text: &str, count: usize| -> miette::Result<Vec<f64>> {
        let numbers: Vec<f64> = text
            .split(',')
            .filter_map(|x| x.trim().parse().ok().filter(|x: &f64| x.is_finite()))
            .collect();
        if numbers.len() == count && text.split(',').count() == count {
            Ok(numbers)
        } else {
            Err(bad(line, &format!("expected {count} numbers separated by commas")))
        }
    };
    let mut lines = text.lines();
    let header = lines
        .next()
        .and_then(|line| line.strip_prefix("H,"))
        .ok_or_else(|| bad(1, "expected the cell as H,hxx,hxy,hyx,hyy"))?;
    let cell = Cell { h: Matrix2::from_row_slice(&numbers(1, header, 4)?) };
    if cell.area() <= 0.0 || cell.inverse().is_none() {
        return Err(bad(1, "the cell vectors must span a positive area"));
    }
    let mut discs = Vec::new();
    for (k, line) in lines.enumerate() {
        let n = numbers(k + 2, line, 3)?;
        if n[2] <= 0.0 {
            return Err(bad(k + 2, "the radius must be positive"));
        }
        discs.push(PlainDisc { x: [n[0], n[1]], r: n[2] });
    }
    if discs.is_empty() || discs.len() > 1 << 16 {
        return Err(bad(2, "expected 1 to 65536 discs"));
    }
    Ok(Packing::new(cell, &discs, |r| p.disc_mass(r)))
}

fn path_csv(rows: &[Row]) -> String {
    let mut text = Row::COLUMNS.join(",") + "\n";
    for row in rows {
        let values: Vec<String> = row.values().iter().map(|x| format!("{x:.9e}")).collect();
        text += &values.join(",");
        text += "\n";
    }
    text
}
