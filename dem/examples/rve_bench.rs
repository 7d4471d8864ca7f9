//! Speed of the RVE kernel on a GPU in steady shear, and its difference from the CPU twin.
//!
//! `rve_bench [RVES] [RATE...]`, by default 2304 RVEs at 0.5, 5 and 50 1/s.
use std::sync::Arc;
use std::time::Instant;

use dem::cuda::{CudaError, CudaReal, CudaRveBatch};
use dem::{Packing, Rve, RveBatch, RveParameters, RveState, prepare};
use gpu::Device;
use nalgebra::Matrix2;

/// Macro step of the paper's scenes (s).
const DT: f64 = 1.0e-4;
/// Vertical stress of the packing (Pa).
const STRESS: f64 = 19.0e3;
const LAUNCHES: usize = 300;

fn batch<R: CudaReal>(packing: &Packing<f64>, p: &RveParameters, rves: usize) -> RveBatch<R> {
    let fresh: Packing<R> = packing.convert();
    RveBatch { parameters: p.clone(), rves: vec![Rve::new(fresh.clone()); rves], fresh }
}

/// Simple shear, at slightly different rates so that RVEs do not search in step.
fn shear(rate: f64, rves: usize) -> Vec<Matrix2<f64>> {
    let spread = |k: usize| 0.9 + 0.2 * k as f64 / rves as f64;
    (0..rves).map(|k| Matrix2::new(0.0, rate * spread(k), 0.0, 0.0)).collect()
}

/// Seconds per launch, searches per RVE and launch, and the mean pressure (Pa) and coordination.
fn measure<R: CudaReal>(
    gpu: &mut CudaRveBatch<R>,
    device: &Device,
    dt: f64,
    rate: f64,
) -> Result<[f64; 4], CudaError> {
    let rves = gpu.len();
    let gradients = shear(rate, rves);
    let mut states = vec![RveState::default(); rves];
    let row_major: Vec<f64> = gradients.iter().flat_map(|l| [l.m11, l.m12, l.m21, l.m22]).collect();
    let stream = device.stream();
    let device_gradients = stream.clone_htod(&row_major)?;
    for _ in 0..30 {
        gpu.launch(stream, dt, &device_gradients)?;
    }
    gpu.check()?;
    let start = Instant::now();
    for _ in 0..LAUNCHES {
        gpu.launch(stream, dt, &device_gradients)?;
    }
    gpu.check()?;
    let seconds = start.elapsed().as_secs_f64() / LAUNCHES as f64;

    let samples = 40;
    let mut searches = 0;
    for _ in 0..samples {
        gpu.advance(dt, &gradients, &mut states)?;
        searches += states.iter().map(|s| s.searches as usize).sum::<usize>();
    }
    let mean = |f: fn(&RveState) -> f64| states.iter().map(f).sum::<f64>() / rves as f64;
    Ok([
        seconds,
        searches as f64 / (samples * rves) as f64,
        mean(|s| 0.5 * s.stress.trace()),
        mean(|s| s.coordination),
    ])
}

fn table<R: CudaReal>(
    device: &Arc<Device>,
    packing: &Packing<f64>,
    p: &RveParameters,
    rves: usize,
    rates: &[f64],
) -> Result<(), CudaError> {
    for &rate in rates {
        for dt in [DT, 20.0 * p.step()] {
            let mut gpu = CudaRveBatch::<R>::upload(device, &batch(packing, p, rves))?;
            let [seconds, searches, pressure, coordination] = measure(&mut gpu, device, dt, rate)?;
            let substeps = p.substeps(dt);
            println!(
                "{} {rate:>6} 1/s {substeps:>3} substeps {:>8.4} ms {:>7.2}e9 disc-steps/s {searches:>7.4} searches  p {pressure:>7.0} Pa  Z {coordination:.2}",
                R::NAME,
                seconds * 1e3,
                (rves * p.discs * substeps) as f64 / seconds / 1e9,
            );
        }
    }
    let gpu = CudaRveBatch::<R>::upload(device, &batch(packing, p, 1))?;
    println!("{} {:?}", R::NAME, gpu.resources()?);
    Ok(())
}

/// Relative difference of the stress from the CPU twin after some macro steps.
fn difference<R: CudaReal>(
    device: &Arc<Device>,
    packing: &Packing<f64>,
    p: &RveParameters,
) -> Result<(), CudaError> {
    let mut cpu = batch::<R>(packing, p, 4);
    let mut gpu = CudaRveBatch::upload(device, &cpu)?;
    let gradients = shear(5.0, 4);
    let mut cpu_states = vec![RveState::default(); 4];
    let mut gpu_states = cpu_states.clone();
    print!("{} stress against the CPU after", R::NAME);
    for step in 1..=100 {
        cpu.advance(DT, &gradients, &mut cpu_states).expect("the CPU twin advances");
        gpu.advance(DT, &gradients, &mut gpu_states)?;
        if [1, 10, 100].contains(&step) {
            let relative = cpu_states
                .iter()
                .zip(&gpu_states)
                .map(|(c, g)| (c.stress - g.stress).norm() / c.stress.norm())
                .fold(0.0, f64::max);
            print!("  {step} steps {relative:.1e}");
        }
    }
    println!();
    Ok(())
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args().skip(1);
    let rves = arguments.next().map_or(Ok(2304), |a| a.parse())?;
    let rates: Vec<f64> = arguments.map(|a| a.parse()).collect::<Result<_, _>>()?;
    let rates = if rates.is_empty() { vec![0.5, 5.0, 50.0] } else { rates };

    let p = RveParameters::default();
    let start = Instant::now();
    let prepared = prepare(&p, 1, &[STRESS])?;
    let packing = &prepared.ladder[0].packing;
    println!(
        "packing of {} discs prepared in {:.1} s, solid fraction {:.4}",
        p.discs,
        start.elapsed().as_secs_f64(),
        packing.solid_fraction()
    );
    let device = Device::new(0)?;
    let start = Instant::now();
    CudaRveBatch::<f32>::upload(&device, &batch(packing, &p, 1))?;
    CudaRveBatch::<f64>::upload(&device, &batch(packing, &p, 1))?;
    println!(
        "{} ({}), kernels ready in {:.2} s",
        device.name(),
        device.architecture(),
        start.elapsed().as_secs_f64()
    );
    difference::<f64>(&device, packing, &p)?;
    difference::<f32>(&device, packing, &p)?;
    println!("{rves} RVEs");
    table::<f32>(&device, packing, &p, rves, &rates)?;
    table::<f64>(&device, packing, &p, rves, &rates)?;
    Ok(())
}
