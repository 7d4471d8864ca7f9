//! What a run whose model was chosen says itself of its distance from the truth.

use std::path::Path;
use std::sync::Arc;

use files::Interrupt;
use miette::IntoDiagnostic;
use serde::Serialize;

use super::after::distance;
use super::choice::Choice;
use super::error_model::{ErrorModel, Expected};
use crate::check::quantity;
use crate::run::{Options, Outcome, checkpoint_interval, run_scene};
use crate::scene::{Chosen, Scene};

/// Time between checkpoints of the coarser run (s), which is short.
const CHECKPOINTS: f64 = 1.0e6;

/// What was chosen, and what the run says of it.
#[derive(Clone, Debug, Serialize)]
pub struct Judgement {
    /// The model with its expected distance.
    #[serde(flatten)]
    pub chosen: Chosen,
    /// Whether its bound is within the distance that was asked for.
    pub met: bool,
    /// The largest distance (m) from the next coarser run of the same kind; `None` if there is none.
    pub change: Option<f64>,
    /// The largest distance from the truth that this suggests.
    pub estimate: Option<Expected>,
    /// Whether estimate and expectation may both be right; `None` without an estimate.
    pub agrees: Option<bool>,
}

impl Judgement {
    /// Runs the next coarser model of the same kind beside the finished run at `output`, and judges from the
    /// difference. A coarser run that fails says nothing.
    ///
    /// # Errors
    /// If the coarser run cannot be written, or the two cannot be compared.
    pub fn of(
        choice: &Choice,
        chosen: Chosen,
        output: &Path,
        device: Option<&Arc<gpu::Device>>,
        interrupt: &Interrupt,
    ) -> miette::Result<Self> {
        let (mut found, mut estimate) = (None, None);
        if let Some((scene, features)) = choice.coarser() {
            found = change(scene, output, device, interrupt)?;
            let family = choice.taken().family;
            let from = |change| ErrorModel::shipped().from_change(family, features, change);
            estimate = found.and_then(from);
        }
        let agrees = chosen.expected.zip(chosen.bound).zip(estimate);
        let agrees = agrees.map(|((median, bound), estimate)| {
            estimate.median <= bound && median <= estimate.bound
        });
        Ok(Self { chosen, met: choice.met, change: found, estimate, agrees })
    }

    /// A warning if the run contradicts what was expected.
    pub fn warning(&self) -> Option<String> {
        let estimate = self.estimate.filter(|_| self.agrees == Some(false))?;
        let (expected, bound) = self.chosen.expected.zip(self.chosen.bound)?;
        let metres = |value: f64| quantity(value, "m");
        Some(format!(
            "THE RUN CONTRADICTS ITS CHOICE: expected were {} from the discs with a bound of {}, the run itself suggests {} \
             with a bound of {}; trust the larger one",
            metres(expected),
            metres(bound),
            metres(estimate.median),
            metres(estimate.bound)
        ))
    }
}

/// The largest distance (m) of the run at `output` from a run of `scene`; `None` if that fails or is interrupted.
fn change(
    scene: &Scene,
    output: &Path,
    device: Option<&Arc<gpu::Device>>,
    interrupt: &Interrupt,
) -> miette::Result<Option<f64>> {
    let folder = tempfile::tempdir().into_diagnostic()?;
    let path = folder.path().join("coarser.h5");
    let options = Options {
        device: device.cloned(),
        checkpoint_interval: checkpoint_interval(CHECKPOINTS)?,
        ..Options::default()
    };
    match run_scene(scene.clone(), path.clone(), &options, &mut (), interrupt) {
        Ok(Outcome::Finished { .. }) => {
            Ok(distance(output, &path)?.map(|distance| distance.largest))
        }
        _ => Ok(None),
    }
}
