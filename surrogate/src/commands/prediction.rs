//! How the commands that predict use a model.

use std::path::Path;

use dempm::device::Device;
use files::note;
use miette::{Context, IntoDiagnostic};

use crate::cuda::CudaError;
use crate::network::Precision;
use crate::simulator::Simulator;

/// Options of predictions.
#[derive(clap::Args, Clone, Copy)]
pub struct PredictionArgs {
    /// Average each prediction with that of the mirrored window
    #[arg(long)]
    pub mirror: bool,
    /// Where to compute: auto (a GPU if there is one), cpu, cuda or cuda:N
    #[arg(long, default_value = "auto")]
    pub device: Device,
    /// Precision of matrix products on a GPU; bf16 is faster and less exact
    #[arg(long, value_enum, default_value_t = Precision::F32)]
    pub precision: Precision,
}

impl PredictionArgs {
    /// Loads a model onto the device.
    ///
    /// # Errors
    /// If the model or the device cannot be used.
    pub fn load(&self, model: &Path, verbose: bool) -> miette::Result<Simulator> {
        let &Self { mirror, device, precision } = self;
        let mut simulator = Simulator { mirror, precision, ..Simulator::load(model)? };
        select_device(&mut simulator, device, verbose)?;
        Ok(simulator)
    }
}

/// Selects the device of a model, and reports a GPU that is there but cannot be used; with `verbose` also the one
/// that is used.
pub(super) fn select_device(
    simulator: &mut Simulator,
    device: Device,
    verbose: bool,
) -> miette::Result<()> {
    let unused = simulator.select_device(device);
    let unused: Option<CudaError> = unused.into_diagnostic().wrap_err("--device, --precision")?;
    if let Some(reason) = unused {
        note!("running on the CPU: {reason}");
    }
    if verbose {
        let name = simulator.gpu.as_ref().map_or("the CPU", |gpu| gpu.name());
        note!("running on {name}");
    }
    Ok(())
}
