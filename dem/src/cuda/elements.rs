//! Element tests side by side on a GPU: packings of different grains, each driven through a stage of its own.

use std::sync::Arc;

use gpu::Device;
use nalgebra::Matrix2;
use rayon::prelude::*;

use super::abi::{Parameters, State, Tensor};
use super::batch::CudaRveBatch;
use super::error::CudaError;
use super::real::CudaReal;
use crate::batch::RveBatch;
use crate::contact::ContactLaw;
use crate::element::{Drive, Row, Stage, StageError};
use crate::error::Error;
use crate::packing::Packing;
use crate::parameters::RveParameters;
use crate::prepare::{cloud, preparation};
use crate::rve::Rve;
use crate::state::RveState;

/// A packing and the stage that it is driven through.
#[derive(Clone, Debug)]
pub struct ElementTest<R: CudaReal> {
    /// The packing at the start.
    pub packing: Packing<R>,
    /// Its parameters. An RVE of these tests is never stress-free: [`RveParameters::free_solid_fraction`] is not used.
    pub parameters: RveParameters,
    /// The stage.
    pub stage: Stage,
    /// Time between two rows (s).
    pub sampling: f64,
    /// Time between two updates of the servo (s).
    pub macro_step: f64,
}

/// A packing after its stage, and the rows of its path, the first of them before the stage; or why there are none.
type Driven<R> = Result<(Packing<R>, Vec<Row>), StageError>;

/// A packing, or why it cannot be made.
type Made = Result<Packing<f64>, Error>;

/// Runs tests side by side, until `stop` says so: `None` then. The twin of
/// [`Element::run`](crate::element::Element::run), one macro step of all RVEs after the other.
///
/// # Errors
/// The packings have different numbers of discs or do not fit on the GPU, or the GPU fails. What happens to one test
/// alone is its result.
pub fn run_stages<R: CudaReal>(
    device: &Arc<Device>,
    mut tests: Vec<ElementTest<R>>,
    stop: &dyn Fn() -> bool,
) -> Result<Option<Vec<Driven<R>>>, CudaError> {
    let Some(first) = tests.first() else { return Ok(Some(Vec::new())) };
    // The list of neighbours needs the most room that any of them does.
    let mut common = first.parameters.clone();
    for test in &tests {
        let (common, own) = (&mut common.grains, &test.parameters.grains);
        common.rolling_friction = common.rolling_friction.max(own.rolling_friction);
        common.skin = common.skin.max(own.skin);
        common.radius_max = common.radius_max.max(own.radius_max);
        common.radius_min = common.radius_min.min(own.radius_min);
    }
    tests.par_iter_mut().for_each(|test| {
        test.parameters.free_solid_fraction = 0.0;
        // A list holds the dashpots of the parameters it was made with, maybe not these.
        let grains = &test.parameters.grains;
        let law = ContactLaw::new(grains, grains.step());
        test.packing.search(grains.skin * grains.radius_max, |a, b| law.dashpot(a, b));
    });
    let batch = RveBatch {
        parameters: common,
        rves: tests.iter().map(|test| Rve::new(test.packing.clone())).collect(),
        fresh: vec![tests[0].packing.clone()],
    };

    // A macro step at rest of a copy gives the initial stresses.
    let mut each: Vec<Parameters<R>> = tests
        .iter()
        .map(|test| Parameters::new(&test.parameters, test.macro_step, tests.len()))
        .collect();
    let mut gradients = vec![Tensor::default(); tests.len()];
    let states = CudaRveBatch::upload_unequal(device, &batch)?.advance_each(&each, &gradients)?;

    let mut on_gpu = CudaRveBatch::upload_unequal(device, &batch)?;
    let mut courses: Vec<Course> =
        tests.iter().zip(&states).map(|(test, state)| Course::new(test, state)).collect();
    while courses.iter().any(|course| course.result.is_none()) {
        if stop() {
            return Ok(None);
        }
        for (((course, test), order), gradient) in
            courses.iter_mut().zip(&tests).zip(&mut each).zip(&mut gradients)
        {
            match course.result {
                None => *gradient = (&course.next(test)).into(),
                Some(_) => order.substeps = 0,
            }
        }
        let states = on_gpu.advance_each(&each, &gradients)?;
        let failures = on_gpu.failures()?;
        for (((course, test), state), failure) in
            courses.iter_mut().zip(&tests).zip(&states).zip(failures)
        {
            if course.result.is_none() {
                course.after(test, state, failure.map(|failure| failure.to_string()));
            }
        }
    }
    let packings = on_gpu.download()?.rves.into_iter().map(|rve| rve.packing);
    let driven = courses.into_iter().zip(packings).map(|(course, packing)| match course.result {
        Some(Err(error)) => Err(error),
        _ => Ok((packing, course.rows)),
    });
    Ok(Some(driven.collect()))
}

/// One test under way.
struct Course {
    drive: Drive,
    state: RveState,
    t: f64,
    strain: Matrix2<f64>,
    gradient: Matrix2<f64>,
    rows: Vec<Row>,
    result: Option<Result<(), StageError>>,
}

impl Course {
    fn new<R: CudaReal>(test: &ElementTest<R>, state: &State) -> Self {
        let drive = Drive::new(&test.stage, test.sampling, &test.parameters, test.macro_step);
        let result = drive.is_over().then_some(Ok(()));
        let state: RveState = (*state).into();
        let strain = Matrix2::zeros();
        let rows = vec![Row::at(&state, 0.0, strain, &test.parameters)];
        Self { drive, state, t: 0.0, strain, gradient: strain, rows, result }
    }

    /// The velocity gradient (1/s) of the next macro step.
    fn next<R: CudaReal>(&mut self, test: &ElementTest<R>) -> Matrix2<f64> {
        self.gradient = self.drive.velocity_gradient(&self.state, &test.parameters);
        self.gradient
    }

    /// Counts that macro step.
    fn after<R: CudaReal>(
        &mut self,
        test: &ElementTest<R>,
        state: &State,
        failure: Option<String>,
    ) {
        if let Some(failure) = failure {
            self.result = Some(Err(StageError::FailedOnGpu { failure, t: self.t }));
            return;
        }
        self.state = (*state).into();
        self.t += test.macro_step;
        self.strain += self.gradient * test.macro_step;
        let due = self.drive.after(&self.state, &self.gradient, || state.unbalanced);
        if due.row {
            self.rows.push(self.drive.row(self.t, self.strain, &test.parameters));
        }
        if due.end {
            self.result = Some(Ok(()));
        } else if self.drive.is_over() {
            let wanted = self.drive.unreached();
            self.result = Some(match wanted {
                None => Ok(()),
                Some(wanted) => Err(StageError::unreached(wanted, &self.state)),
            });
        }
    }
}

/// Makes packings of parameters and seeds side by side, until `stop` says so: `None` then. The twin of
/// [`consolidate`](crate::consolidate).
///
/// # Errors
/// As of [`run_stages`].
pub fn consolidate_all(
    device: &Arc<Device>,
    packings: &[(RveParameters, u64)],
    stop: &dyn Fn() -> bool,
) -> Result<Option<Vec<Made>>, CudaError> {
    let mut made: Vec<Made> = packings
        .par_iter()
        .map(|(p, seed)| {
            cloud(p, *seed).map_err(|reason| Error::Preparation { seed: *seed, reason })
        })
        .collect();
    for smooth in [true, false] {
        // Those that have failed are left out.
        let (places, tests): (Vec<usize>, Vec<ElementTest<f64>>) = made
            .iter()
            .zip(packings)
            .enumerate()
            .filter_map(|(k, (packing, (p, _)))| {
                let (mut parameters, macro_step) = preparation(p);
                if smooth {
                    parameters.grains.friction = p.grains.preparation_friction;
                }
                let pressure = p.preparation.pressure;
                let stage = Stage::Isotropic { pressure, duration: None };
                let packing = packing.as_ref().ok()?.clone();
                let sampling = f64::INFINITY;
                Some((k, ElementTest { packing, parameters, stage, sampling, macro_step }))
            })
            .unzip();
        let Some(driven) = run_stages(device, tests, stop)? else { return Ok(None) };
        for (k, driven) in places.into_iter().zip(driven) {
            made[k] = driven.map(|(packing, _)| packing).map_err(|error| Error::Preparation {
                seed: packings[k].1,
                reason: error.to_string(),
            });
        }
    }
    Ok(Some(made))
}
