//! `dempm check`: prints cost and warnings of a scene.

use std::path::Path;

use files::{note, out};
use miette::IntoDiagnostic;

use crate::check::{Needs, disc_steps_per_second};
use crate::scene::Scene;

/// Prints the warnings and [`Needs`] of a scene.
///
/// # Errors
/// If the scene cannot be read or is invalid.
pub fn check(path: &Path) -> miette::Result<()> {
    let scene = Scene::load(path)?;
    if let Some(warnings) = scene.warning_report() {
        note!("{warnings:?}");
    }
    out!("{}", Needs::of(&scene, disc_steps_per_second().into_diagnostic()?))?;
    Ok(())
}
