//! `surrogate expect`: what `dempm choose --learned` asks of a network.

use std::path::{Path, PathBuf};

use dempm::choose::Learned;
use dempm::commands::terminal::print_json;
use dempm::device::Device;
use dempm::scene::Scene;
use files::out;

use super::prediction::select_device;
use crate::evaluation::candidate;
use crate::simulator::Simulator;

/// Arguments of `surrogate expect`.
#[derive(clap::Args)]
pub struct ExpectArgs {
    /// Model (safetensors)
    model: PathBuf,
    /// Scene file (TOML), whose grains are predicted
    #[arg(long)]
    scene: PathBuf,
    /// Where to compute: auto (a GPU if there is one), cpu, cuda or cuda:N
    #[arg(long, default_value = "auto")]
    device: Device,
    /// Print one JSON object
    #[arg(long)]
    json: bool,
}

/// Predicts a scene, and prints how far from its grains computed one by one that is to be expected.
///
/// # Errors
/// If a file cannot be used, or the first frames cannot be simulated.
pub fn expect(args: &ExpectArgs, verbose: bool) -> miette::Result<()> {
    let scene = Scene::load(&args.scene)?;
    let found = expect_of(&args.model, &scene, args.device, verbose)?;
    if args.json {
        return print_json(&found);
    }
    let name = &found.name;
    match (&found.out, found.error) {
        (None, Some(error)) => out!(
            "{name}: {:.3} m from the discs at the end, below {:.3} m in nine of ten scenes; the largest over time {:.3} m, \
             below {:.3} m",
            error.end.median,
            error.end.bound,
            error.largest.median,
            error.largest.bound
        )?,
        (out, _) => out!("{name}: {}", out.as_deref().unwrap_or_default())?,
    }
    Ok(())
}

/// What the network in a file expects of a scene.
///
/// # Errors
/// If the model or the device cannot be used, or the first frames cannot be simulated.
pub fn expect_of(
    model: &Path,
    scene: &Scene,
    device: Device,
    verbose: bool,
) -> miette::Result<Learned> {
    let mut simulator = Simulator::load(model)?;
    select_device(&mut simulator, device, verbose)?;
    let name = model.file_stem().unwrap_or_default().to_string_lossy();
    Ok(candidate(&simulator, &name, scene)?)
}
