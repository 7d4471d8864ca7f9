//! `dempm check`: prints cost and warnings of a scene.

use std::path::PathBuf;

use files::{note, out};
use miette::IntoDiagnostic;

use super::terminal::print_json;
use crate::check::{Needs, Rates};
use crate::scene::Scene;

/// Arguments of `dempm check`.
#[derive(clap::Args)]
pub struct CheckArgs {
    /// Scene file (TOML).
    scene: PathBuf,
    /// Print the estimate as one JSON object.
    #[arg(long)]
    json: bool,
}

/// Prints the warnings and [`Needs`] of a scene.
///
/// # Errors
/// If the scene cannot be read or is invalid.
pub fn check(args: &CheckArgs) -> miette::Result<()> {
    let scene = Scene::load(&args.scene)?;
    if let Some(warnings) = scene.warning_report() {
        note!("{warnings:?}");
    }
    let needs = Needs::of(&scene, &Rates::measure(false).into_diagnostic()?);
    if args.json {
        return print_json(&needs);
    }
    out!("{needs}")?;
    Ok(())
}
