//! Where packings are tested: on all cores, or all side by side on a GPU.

use std::sync::Arc;

use dem::cuda::{ElementTest, consolidate_all, run_stages};
use dem::element::Element;
use dem::{Packing, RveParameters, consolidate};
use gpu::Device;
use rayon::prelude::*;

use super::column::collapse;
use super::error::CalibrationError;
use super::experiment::{Loading, Observation, Specimen, Tested};
use super::study::Simulator;
use super::targets::Targets;

/// What a calibration tells while it works.
pub trait Progress: Sync {
    /// So many tests of a round are done.
    fn tested(&self, _tests: usize) {}
    /// Whether to stop.
    fn stop(&self) -> bool {
        false
    }
}

impl Progress for () {}

/// Simulates tests on a GPU, or without one on all cores of the processor.
#[derive(Clone)]
pub struct Laboratory<P: Progress> {
    /// The GPU; columns are simulated on the processor even so.
    pub gpu: Option<Arc<Device>>,
    /// Who is told.
    pub progress: P,
}

/// A packing to be made and tested.
pub(super) struct Task {
    pub specimen: Specimen,
    pub loading: Loading,
}

/// What tasks give, or the reasons why they give nothing; `None` if they were told to stop.
type Results<T> = Result<Option<Vec<Result<T, String>>>, CalibrationError>;

/// DEM steps between two decisions of the servo.
const CONTROL_STEPS: f64 = 10.0;
/// Seeds of packings for different tests of a specimen are apart by this: laboratories take fresh material too.
const FRESH: u64 = 1 << 60;

impl<P: Progress> Laboratory<P> {
    /// Makes packings and tests them.
    pub(super) fn test(&self, tasks: &[Task]) -> Results<Tested> {
        match &self.gpu {
            None => Ok(self.on_all_cores(tasks, on_cpu)),
            Some(gpu) => {
                let stop = || self.progress.stop();
                let tested = on_gpu(gpu, tasks, &stop).map_err(Box::new)?;
                self.progress.tested(tasks.len());
                Ok(tested)
            }
        }
    }

    fn on_all_cores<T: Sync, R: Send>(
        &self,
        tasks: &[T],
        run: impl Fn(&T) -> Result<R, String> + Sync,
    ) -> Option<Vec<Result<R, String>>> {
        tasks
            .par_iter()
            .map(|task| {
                if self.progress.stop() {
                    return None;
                }
                let result = run(task);
                self.progress.tested(1);
                Some(result)
            })
            .collect()
    }
}

impl<P: Progress> Simulator for Laboratory<P> {
    fn simulate(&self, targets: &Targets, specimens: &[Specimen]) -> Results<Vec<f64>> {
        let inertial = targets.method.inertial_number;
        let mut packings = Vec::new();
        let mut columns = Vec::new();
        // Tests of one kind follow each other: they take as long.
        for (k, observation) in targets.observations.iter().enumerate() {
            for specimen in specimens {
                let mut specimen = specimen.clone();
                specimen.seed = specimen.seed.wrapping_add(FRESH.wrapping_mul(k as u64));
                match observation.loading(&specimen.rve.grains, inertial) {
                    Some(loading) => packings.push(Task { specimen, loading }),
                    None => columns.push((specimen, observation)),
                }
            }
        }
        let Some(tested) = self.test(&packings)? else { return Ok(None) };
        let pile = |(specimen, observation): &(Specimen, &Observation)| {
            let test = observation.column().ok_or("not a column")?;
            let pile = collapse(&specimen.rve.grains, &test, specimen.seed)?;
            Ok(observation.of_pile(&pile))
        };
        let Some(piles) = self.on_all_cores(&columns, pile) else { return Ok(None) };
        let (mut tested, mut piles) = (tested.into_iter(), piles.into_iter());
        let mut results: Vec<Result<Vec<f64>, String>> = vec![Ok(Vec::new()); specimens.len()];
        for observation in &targets.observations {
            for (specimen, result) in specimens.iter().zip(&mut results) {
                let found = if observation.column().is_some() {
                    piles.next()
                } else {
                    let of = |tested| observation.of_packing(&specimen.rve.grains, &tested);
                    tested.next().map(|tested| tested.map(of))
                };
                match (found, result.as_mut()) {
                    (Some(Ok(values)), Ok(all)) => all.extend(values),
                    (Some(Err(reason)), Ok(_)) => *result = Err(reason),
                    _ => {}
                }
            }
        }
        Ok(Some(results))
    }
}

/// Parameters of a packing that is made for a test.
pub(super) fn parameters(rve: &RveParameters, pressure: f64) -> RveParameters {
    let mut rve = rve.clone();
    rve.preparation.pressure = pressure;
    // The servo of a test compresses a packing that has lost its contacts.
    rve.free_solid_fraction = 0.0;
    rve
}

fn on_cpu(task: &Task) -> Result<Tested, String> {
    let Task { specimen, loading } = task;
    let rve = parameters(&specimen.rve, loading.pressure);
    let mut packing = consolidate(&rve, specimen.seed).map_err(|error| error.to_string())?;
    let solid_fraction = packing.solid_fraction();
    let mut rows = Vec::new();
    if let Some(stage) = &loading.stage {
        packing.scale_mass(rve.grains.mass_scale);
        let macro_step = CONTROL_STEPS * rve.grains.step();
        let mut element = Element::<f32>::new(packing.convert(), &rve, macro_step)
            .map_err(|error| error.to_string())?;
        rows.push(element.row());
        element
            .run(stage, loading.sampling, |row| rows.push(*row))
            .map_err(|error| error.to_string())?;
    }
    Ok(Tested { solid_fraction, rows })
}

/// The same for all tasks side by side.
fn on_gpu(
    gpu: &Arc<Device>,
    tasks: &[Task],
    stop: &dyn Fn() -> bool,
) -> Result<Option<Vec<Result<Tested, String>>>, dem::cuda::CudaError> {
    let wanted: Vec<(RveParameters, u64)> = tasks
        .iter()
        .map(|Task { specimen, loading }| {
            (parameters(&specimen.rve, loading.pressure), specimen.seed)
        })
        .collect();
    let Some(made) = consolidate_all(gpu, &wanted, stop)? else { return Ok(None) };
    let mut results: Vec<Result<Tested, String>> = made
        .iter()
        .map(|packing| match packing {
            Ok(packing) => {
                Ok(Tested { solid_fraction: packing.solid_fraction(), rows: Vec::new() })
            }
            Err(error) => Err(error.to_string()),
        })
        .collect();
    let (places, tests): (Vec<usize>, Vec<ElementTest<f32>>) = made
        .into_iter()
        .zip(tasks.iter().zip(wanted))
        .enumerate()
        .filter_map(|(k, (packing, (task, (parameters, _))))| {
            let stage = task.loading.stage.clone()?;
            let mut packing: Packing<f64> = packing.ok()?;
            packing.scale_mass(parameters.grains.mass_scale);
            let macro_step = CONTROL_STEPS * parameters.grains.step();
            let (packing, sampling) = (packing.convert(), task.loading.sampling);
            Some((k, ElementTest { packing, parameters, stage, sampling, macro_step }))
        })
        .unzip();
    let Some(driven) = run_stages(gpu, tests, stop)? else { return Ok(None) };
    for (k, driven) in places.into_iter().zip(driven) {
        match (driven, &mut results[k]) {
            (Ok((_, rows)), Ok(tested)) => tested.rows = rows,
            (Err(error), result) => *result = Err(error.to_string()),
            _ => {}
        }
    }
    Ok(Some(results))
}
