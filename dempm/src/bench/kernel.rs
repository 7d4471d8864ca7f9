//! Disc-steps per second of RVEs in simple shear, without the MPM.

use std::sync::Arc;
use std::time::{Duration, Instant};

use dem::cuda::{CudaReal, CudaRveBatch};
use dem::{Packing, Real, Rve, RveBatch, RveParameters, RveState};
use miette::IntoDiagnostic;
use nalgebra::Matrix2;

use super::extent::Extent;
use super::markdown::table;
use crate::packings;

/// Macro step of the paper's scenes (s).
const DT: f64 = 1.0e-4;
/// Depth below a free surface that the packing comes from (m): a vertical stress of 22 kPa.
const DEPTH: f64 = 1.0;
/// Shear rates (1/s): creep, flow, and the fastest that a collapse has.
const RATES: [f64; 3] = [0.5, 5.0, 50.0];
/// Macro steps before the measurement: past the start of shear.
const WARM_UP: usize = 50;
/// Macro steps over which neighbour searches are counted.
const COUNTED: usize = 40;
/// RVEs per thread of the CPU.
const PER_THREAD: usize = 16;
/// RVEs on a GPU: the points of the paper's 3 m column.
const ON_GPU: usize = 2304;

/// A table of all devices, precisions and shear rates.
///
/// # Errors
/// If a packing cannot be prepared or a device fails.
pub fn report(gpu: Option<&Arc<gpu::Device>>, extent: Extent) -> miette::Result<String> {
    let p = RveParameters::default();
    // As the first packing of a scene with seed 1 (scenes shift their seed by 16 bits).
    let ladder = packings::ladders(&p, &[1 << 16], &[DEPTH], 9.81).into_diagnostic()?;
    let packing = &ladder[0].rungs[0].packing;
    let mut rows = Vec::new();
    on_cpu::<f32>(&p, packing, extent, &mut rows)?;
    on_cpu::<f64>(&p, packing, extent, &mut rows)?;
    let mut notes = String::new();
    if let Some(device) = gpu {
        on_gpu::<f32>(device, &p, packing, extent, &mut rows, &mut notes)?;
        on_gpu::<f64>(device, &p, packing, extent, &mut rows, &mut notes)?;
    }
    let head = [
        "device",
        "precision",
        "RVEs",
        "discs",
        "rate [1/s]",
        "substeps",
        "ms",
        "1e6 disc-steps/s",
        "searches",
    ];
    Ok(format!(
        "{}\nPacking from {DEPTH} m below the surface, macro steps of {DT:.0e} s; `searches` are \
         those of neighbours, per RVE and macro step.\n{notes}",
        table(&head, &rows)
    ))
}

/// Simple shear, at slightly different rates so that RVEs do not search in step.
fn shear(rate: f64, rves: usize) -> Vec<Matrix2<f64>> {
    let spread = |k: usize| 0.9 + 0.2 * k as f64 / rves as f64;
    (0..rves).map(|k| Matrix2::new(0.0, rate * spread(k), 0.0, 0.0)).collect()
}

fn batch<R: CudaReal>(p: &RveParameters, packing: &Packing<f64>, rves: usize) -> RveBatch<R> {
    let fresh: Packing<R> = packing.convert();
    RveBatch {
        parameters: p.clone(),
        rves: vec![Rve::new(fresh.clone()); rves],
        fresh: vec![fresh],
    }
}

fn searches(states: &[RveState]) -> usize {
    states.iter().map(|state| state.searches as usize).sum()
}

fn on_cpu<R: CudaReal>(
    p: &RveParameters,
    packing: &Packing<f64>,
    extent: Extent,
    rows: &mut Vec<Vec<String>>,
) -> miette::Result<()> {
    let rves = PER_THREAD * rayon::current_num_threads();
    for rate in RATES {
        let mut batch = batch::<R>(p, packing, rves);
        let gradients = shear(rate, rves);
        let mut states = vec![RveState::default(); rves];
        for _ in 0..WARM_UP {
            batch.advance(DT, &gradients, &mut states).into_diagnostic()?;
        }
        let (start, mut steps, mut found) = (Instant::now(), 0, 0);
        while start.elapsed() < extent.time {
            batch.advance(DT, &gradients, &mut states).into_diagnostic()?;
            found += searches(&states);
            steps += 1;
        }
        let step = start.elapsed() / steps;
        let searches = found as f64 / (rves * steps as usize) as f64;
        rows.push(row("CPU", <R as Real>::NAME, p, rves, rate, step, searches));
    }
    Ok(())
}

fn on_gpu<R: CudaReal>(
    device: &Arc<gpu::Device>,
    p: &RveParameters,
    packing: &Packing<f64>,
    extent: Extent,
    rows: &mut Vec<Vec<String>>,
    notes: &mut String,
) -> miette::Result<()> {
    let sizes: &[usize] = if extent.full { &[256, 1024, ON_GPU, 16_384] } else { &[ON_GPU] };
    let stream = device.stream();
    for &rves in sizes {
        for rate in RATES {
            let host = batch::<R>(p, packing, rves);
            let mut batch = CudaRveBatch::upload(device, &host).into_diagnostic()?;
            let gradients = shear(rate, rves);
            let flat: Vec<f64> =
                gradients.iter().flat_map(|l| [l.m11, l.m12, l.m21, l.m22]).collect();
            let on_device = device.upload(&flat).into_diagnostic()?;
            let mut launch = |times: usize| -> miette::Result<Duration> {
                let start = Instant::now();
                for _ in 0..times {
                    batch.launch(stream, DT, &on_device).into_diagnostic()?;
                }
                batch.check().into_diagnostic()?;
                Ok(start.elapsed())
            };
            launch(WARM_UP)?;
            // As many launches as fill the time, judged by a few.
            let few = launch(10)?.as_secs_f64() / 10.0;
            let times = (extent.time.as_secs_f64() / few).clamp(10.0, 5000.0) as usize;
            let step = launch(times)? / times as u32;
            let mut states = vec![RveState::default(); rves];
            let mut found = 0;
            for _ in 0..COUNTED {
                batch.advance(DT, &gradients, &mut states).into_diagnostic()?;
                found += searches(&states);
            }
            let searches = found as f64 / (rves * COUNTED) as f64;
            rows.push(row(device.name(), <R as Real>::NAME, p, rves, rate, step, searches));
        }
    }
    let one = CudaRveBatch::<R>::upload(device, &batch(p, packing, 1)).into_diagnostic()?;
    let taken = one.resources().into_diagnostic()?;
    *notes += &format!(
        "\n{} kernel: {} threads and {} bytes of shared memory a block, {} registers and {} bytes \
         of local memory a thread, {} blocks a multiprocessor.\n",
        <R as Real>::NAME,
        taken.threads,
        taken.shared_bytes,
        taken.registers,
        taken.local_bytes,
        taken.blocks
    );
    Ok(())
}

fn row(
    device: &str,
    precision: &str,
    p: &RveParameters,
    rves: usize,
    rate: f64,
    step: Duration,
    searches: f64,
) -> Vec<String> {
    let substeps = p.grains.substeps(DT);
    let disc_steps = (rves * p.discs * substeps) as f64;
    vec![
        device.to_owned(),
        precision.to_owned(),
        rves.to_string(),
        p.discs.to_string(),
        rate.to_string(),
        substeps.to_string(),
        format!("{:.3}", 1e3 * step.as_secs_f64()),
        format!("{:.1}", 1e-6 * disc_steps / step.as_secs_f64()),
        format!("{searches:.3}"),
    ]
}
