//! `dempm bench`: measures the speed of this machine.

use std::sync::Arc;
use std::time::Duration;

use files::{out, print_result, utc_now};
use miette::IntoDiagnostic;

use super::device::report;
use crate::bench::{Extent, discs, kernel, scenes};
use crate::device::Device;

/// Arguments of `dempm bench`.
#[derive(clap::Args)]
pub struct BenchArgs {
    /// More scenes and batch sizes, and longer measurements: several minutes instead of one.
    #[arg(long)]
    full: bool,
    /// Device to measure besides the CPU: auto (the first GPU, if any), cpu, cuda or cuda:N.
    #[arg(long, default_value = "auto")]
    device: Device,
    /// Scene files or names of the paper's scenes, such as col5x5, instead of the usual ones
    /// (may be repeated).
    #[arg(long, value_name = "SCENE")]
    scene: Vec<String>,
}

/// Measures and prints the tables.
///
/// # Errors
/// If a packing cannot be prepared, a scene is invalid, or a GPU that was asked for does not work.
pub fn bench(args: &BenchArgs, verbose: bool) -> miette::Result<()> {
    let time = Duration::from_millis(if args.full { 5000 } else { 1000 });
    let extent = Extent { full: args.full, time };
    let selection = args.device.select().into_diagnostic()?;
    report(&selection, verbose);
    let gpu = selection.first();
    let scenes = scenes::scenes(&args.scene, extent)?;
    out!("{}\n", machine(gpu.as_ref()))?;
    out!("### One macro step of RVEs in steady simple shear\n")?;
    print_result(format_args!("{}", kernel::report(gpu.as_ref(), extent)?))?;
    out!("\n### A column of discs on the CPU\n")?;
    print_result(format_args!("{}", discs::report(extent)?))?;
    out!("\n### Scenes\n")?;
    print_result(format_args!("{}", scenes::report(gpu.as_ref(), scenes, extent)?))?;
    Ok(())
}

/// Version, date, processor and GPU.
fn machine(gpu: Option<&Arc<gpu::Device>>) -> String {
    let build = if cfg!(debug_assertions) { " (debug build: slow)" } else { "" };
    let mut text = format!(
        "dempm {}{build}, {}; {}, {} threads",
        env!("CARGO_PKG_VERSION"),
        &utc_now()[..10],
        processor(),
        rayon::current_num_threads()
    );
    if let Some(device) = gpu {
        let (major, minor) = device.driver();
        text += &format!(
            "; {} ({}), driver of CUDA {major}.{minor}",
            device.name(),
            device.architecture()
        );
    }
    text
}

/// Name of the processor as Linux knows it, else the architecture.
fn processor() -> String {
    let info = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let name = info.lines().find_map(|line| line.strip_prefix("model name")?.split(':').nth(1));
    name.map_or_else(|| std::env::consts::ARCH.to_owned(), |name| name.trim().to_owned())
}
