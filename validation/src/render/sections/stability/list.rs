//! Each method pushed until it fails.
//!
//! One study per file: what is pushed, what counts as failure, the threshold measured and by theory,
//! and what the program said. Studies give plain data ([`Study`]), kept in the work directory, and
//! [`render`] turns them into blocks.

mod columns;
mod dem_dilute;
mod dem_overlap;
mod dem_precision;
mod dem_shear;
mod dem_size;
mod dem_step;
mod dem_thin;
mod glance;
mod learned;
mod mpm_crossing;
mod mpm_step;
mod mpm_transfer;
mod outcome;
mod packing;
mod render;
mod scene;
mod snapshot;
mod study;
mod threshold;

pub use outcome::Outcome;
pub use study::{Study, StudyError};
pub use threshold::Threshold;

use dempm::device::Device;
use miette::{IntoDiagnostic, miette};
use surrogate::simulator::Simulator;

use crate::block::Block;
use crate::context::{Context, Model, Suite};
use crate::section::Section;
use crate::sections::paper::networks::baseline_and_others;
use crate::work::hash_of_file;

/// The sections of the chapter.
pub fn all() -> Vec<Box<dyn Section>> {
    let mut all: Vec<Box<dyn Section>> = vec![Box::new(glance::Glance)];
    all.extend(studies());
    all
}

fn studies() -> Vec<Box<dyn Section>> {
    vec![
        direct("MPM: the step", mpm_step::study, 5.0),
        direct("MPM: cell crossing", mpm_crossing::study, 10.0),
        direct("MPM: energy and viscosity", mpm_transfer::study, 10.0),
        direct("DEM: the step", dem_step::study, 8.0),
        direct("DEM: damping and mass scaling", dem_shear::study, 15.0),
        direct("DEM: thin cells", dem_thin::study, 8.0),
        direct("DEM: over-compression", dem_overlap::study, 3.0),
        direct("DEM: dilute flow and recompaction", dem_dilute::study, 5.0),
        direct("DEM: size of the RVE", dem_size::study, 5.0),
        direct("DEM: f32 against f64", dem_precision::study, 5.0),
        direct("Tall columns", columns::study, 15.0),
        pushed("Learned: length of the rollout", learned::length::study, 25.0),
        pushed("Learned: height, width, velocity", learned::range::study, 25.0),
        pushed("Learned: noise, mirror images, frames", learned::disturbed::study, 15.0),
        pushed("Learned: walls", learned::walls::study, 5.0),
        pushed("Learned: rest and penetration", learned::at_rest::study, 15.0),
    ]
}

/// A study of the direct solver or its parts.
struct Direct {
    title: &'static str,
    study: fn(Suite) -> Result<Study, StudyError>,
    /// Expected time of the quick size (s).
    seconds: f64,
}

/// The full size takes about this many times as long.
const FULL: f64 = 20.0;

fn direct(
    title: &'static str,
    study: fn(Suite) -> Result<Study, StudyError>,
    seconds: f64,
) -> Box<dyn Section> {
    Box::new(Direct { title, study, seconds })
}

impl Section for Direct {
    fn title(&self) -> &'static str {
        self.title
    }

    fn estimate(&self, context: &Context) -> f64 {
        if context.work.has_cached(self.title, &key(context)) {
            return 0.0;
        }
        self.seconds * study::pick(context.suite, 1.0, FULL)
    }

    fn run(&self, context: &mut Context) -> miette::Result<Vec<Block>> {
        let (suite, estimate) = (context.suite, self.estimate(context));
        let made =
            context.cached(self.title, &key(context), estimate, || Ok((self.study)(suite)?))?;
        Ok(render::blocks(&made)?)
    }
}

/// A study of a learned simulator.
struct Learned {
    title: &'static str,
    study: fn(Suite, &Simulator) -> Result<Study, StudyError>,
    /// Expected time of the quick size with the tiny example (s).
    seconds: f64,
}

fn pushed(
    title: &'static str,
    study: fn(Suite, &Simulator) -> Result<Study, StudyError>,
    seconds: f64,
) -> Box<dyn Section> {
    Box::new(Learned { title, study, seconds })
}

impl Learned {
    /// The models that are pushed; in the quick size the smallest of them.
    fn models(&self, context: &Context) -> Vec<Model> {
        let models = baseline_and_others(&context.models);
        let size = |model: &Model| std::fs::metadata(&model.path).map_or(0, |file| file.len());
        match context.suite {
            Suite::Quick => models.into_iter().min_by_key(size).into_iter().collect(),
            Suite::Full => models,
        }
    }
}

impl Section for Learned {
    fn title(&self) -> &'static str {
        self.title
    }

    fn estimate(&self, context: &Context) -> f64 {
        let missing = |model: &&Model| {
            !model_key(context, model).is_ok_and(|key| context.work.has_cached(self.title, &key))
        };
        let models = self.models(context);
        let each = self.seconds * study::pick(context.suite, 1.0, FULL);
        models.iter().filter(missing).count() as f64 * each
    }

    fn run(&self, context: &mut Context) -> miette::Result<Vec<Block>> {
        let models = self.models(context);
        if models.is_empty() {
            return Ok(vec![Block::missing(
                self.title,
                "there is no model",
                "give a folder with `--models`; `surrogate train` makes one",
            )]);
        }
        let device = context.device.parse::<Device>().map_err(|e| miette!("--device: {e}"))?;
        let mut blocks = Vec::new();
        for model in models {
            let (suite, key) = (context.suite, model_key(context, &model)?);
            let mut made = context.cached(self.title, &key, self.seconds, || {
                Ok((self.study)(suite, &learned::roll::load(&model.path, device)?)?)
            })?;
            made.name_model(&model.name);
            blocks.push(Block::Heading(model.name));
            blocks.extend(render::blocks(&made)?);
        }
        Ok(blocks)
    }
}

/// A study of a model depends on the model too.
fn model_key(context: &Context, model: &Model) -> miette::Result<String> {
    Ok(format!("{} {}", key(context), hash_of_file(&model.path).into_diagnostic()?))
}

/// A study depends on its size and on the program.
fn key(context: &Context) -> String {
    format!("{:?} {}", context.suite, context.work.build())
}
