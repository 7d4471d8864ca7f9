//! `validation fit`: the error model of `dempm choose` from a table of measured cases.

use std::path::PathBuf;
use std::process::ExitCode;

use clap::Args;
use dempm::choose::{Case, ErrorModel, Evaluation, FACTOR, Outcome, Trial};
use files::{PrintError, announce, out, refuse_input, write_text};
use miette::{IntoDiagnostic, miette};

use crate::library;
use crate::text::percent;

/// Distances (m) that scenes ask for.
const WITHIN: [f64; 4] = [0.5, 0.2, 0.1, 0.05];

/// Arguments of `validation fit`.
#[derive(Args)]
pub struct FitArgs {
    /// Table of measured cases (CSV), as `validation library` writes it
    table: PathBuf,
    /// Table of other scenes: print how well the model of TABLE predicts them
    #[arg(long, value_name = "TABLE")]
    fresh: Option<PathBuf>,
    /// Write the model here (JSON); `dempm/src/choose/error-model.json` is the one that is built in
    #[arg(short, long)]
    output: Option<PathBuf>,
    /// What the scenes are, in words that follow their number
    #[arg(long, default_value = "scenes")]
    source: String,
}

/// Prints how well scenes are predicted from others, and writes the model of all.
///
/// # Errors
/// If a table cannot be read or has too few scenes, or the model cannot be written.
pub fn fit(args: &FitArgs) -> miette::Result<ExitCode> {
    if let Some(output) = &args.output {
        refuse_input(output, std::iter::once(&args.table).chain(&args.fresh))?;
    }
    let cases = library::read(&args.table)?;
    let fresh = match &args.fresh {
        Some(path) => Some((path, library::read(path)?)),
        None => None,
    };
    let wrong = |why: String| miette!("{}: {why}", args.table.display());
    print_head(&cases, "Each fifth of the scenes predicted from the others")?;
    print_trial(&Trial::left_out(&cases).map_err(wrong)?)?;

    let mut scenes: Vec<&str> = cases.iter().map(|case| case.scene.as_str()).collect();
    scenes.dedup();
    let source = format!("{} {}", scenes.len(), args.source);
    let model = ErrorModel::fit(&cases, source).map_err(wrong)?;
    if let Some(output) = &args.output {
        // A row of features a line.
        let text = serde_json::to_string(&model).into_diagnostic()?.replace("],[", "],\n[");
        write_text(output, &(text + "\n"))?;
        announce!("{}", output.display());
    }
    if let Some((path, fresh)) = &fresh {
        out!("")?;
        let what = format!("Scenes of {}, predicted from all of the above", path.display());
        print_head(fresh, &what)?;
        print_trial(&Trial::fresh(model, fresh))?;
    }
    Ok(ExitCode::SUCCESS)
}

fn print_head(cases: &[Case], what: &str) -> Result<(), PrintError> {
    let failed = cases.iter().filter(|case| case.distance.is_none()).count();
    out!("{} cases, {failed} of them failed. {what}:\n", cases.len())
}

/// Prints how well a trial went, as tables.
fn print_trial(trial: &Trial<'_>) -> Result<(), PrintError> {
    out!(
        "| kind | distance | cases | below the bound | within a factor of {FACTOR} | bound over median |"
    )?;
    out!("|---|---|---|---|---|---|")?;
    for Evaluation { family, what, cases, covered, near, width } in trial.evaluate() {
        let family = family.map_or("all", |family| family.name());
        let [covered, near] = [covered, near].map(percent);
        out!("| {family} | {what} | {cases} | {covered} | {near} | {width:.2} |")?;
    }
    out!("\nThe cheapest candidate whose bound is within a distance, for the same scenes:\n")?;
    out!(
        "| within | scenes | promised | kept | below its bound | time of the promised | of their discs |"
    )?;
    out!("|---|---|---|---|---|---|---|")?;
    for Outcome { within, scenes, promised, kept, below, seconds } in trial.outcomes(&WITHIN) {
        let [own, discs] = seconds;
        out!(
            "| {within} m | {scenes} | {promised} | {kept} | {below} | {own:.0} s | {discs:.0} s |"
        )?;
    }
    Ok(())
}
