//! `dempm choose`: the cheapest model of a scene that is near enough to its grains computed one by one.

use std::path::PathBuf;

use files::{note, out};
use miette::IntoDiagnostic;

use super::learned::Network;
use super::terminal::print_json;
use crate::check::Rates;
use crate::choose::{Choice, ChoiceError, ErrorModel, Learned, Within};
use crate::device::Device;
use crate::memory;
use crate::scene::Scene;

/// Arguments of `dempm choose`.
#[derive(clap::Args)]
pub struct ChooseArgs {
    /// Scene file (TOML).
    scene: PathBuf,
    /// Largest distance from the grains computed one by one: metres (root mean square), or 5% of the run-out.
    #[arg(long, value_name = "DISTANCE")]
    within: Within,
    /// A network (safetensors) that is a candidate too, with the error that it expects of itself.
    #[arg(long, value_name = "MODEL")]
    learned: Option<PathBuf>,
    /// Device that it is to run on: auto (the first GPU, else the CPU), cpu, cuda or cuda:N.
    #[arg(long, default_value = "auto")]
    device: Device,
    /// Print the choice as one JSON object.
    #[arg(long)]
    json: bool,
}

/// Prints all candidates of a scene and the one to take.
///
/// # Errors
/// If the scene cannot be read, is invalid or has no candidates, or the device cannot be used.
pub fn choose(args: &ChooseArgs) -> miette::Result<()> {
    let scene = Scene::load(&args.scene)?;
    if let Some(warnings) = scene.warning_report() {
        note!("{warnings:?}");
    }
    let on_gpu = args.device.open().into_diagnostic()?.is_some();
    let learned =
        args.learned.as_deref().map(|model| Network::new(model, args.device)?.expect(&scene));
    let choice =
        Chooser::new(on_gpu)?.choice(&scene, args.within, learned.transpose()?.as_ref())?;
    if args.json {
        return print_json(&choice);
    }
    out!("{choice}")?;
    Ok(())
}

/// Chooses models on this machine.
pub struct Chooser {
    model: ErrorModel,
    rates: Rates,
    available: Option<f64>,
}

impl Chooser {
    /// For runs on a GPU or on the processor.
    ///
    /// # Errors
    /// If the speed of the machine cannot be measured.
    pub fn new(on_gpu: bool) -> miette::Result<Self> {
        Ok(Self {
            model: ErrorModel::shipped(),
            rates: Rates::measure(on_gpu).into_diagnostic()?,
            // A GPU refuses by itself what it cannot hold.
            available: memory::available().filter(|_| !on_gpu),
        })
    }

    /// The choice for a scene, also among a learned model if there is one.
    ///
    /// # Errors
    /// If nothing can be chosen.
    pub fn choice(
        &self,
        scene: &Scene,
        within: Within,
        learned: Option<&Learned>,
    ) -> Result<Choice, ChoiceError> {
        Choice::of(scene, within, &self.model, &self.rates, self.available, learned)
    }
}
