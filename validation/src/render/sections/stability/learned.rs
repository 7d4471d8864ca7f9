//! Studies of learned simulators.

use dempm::device::Device;
use miette::{IntoDiagnostic, miette};
use surrogate::simulator::Simulator;

use crate::context::Context;
use crate::models::{Model, baseline_and_others};
use crate::render::block::Block;
use crate::render::section::Section;
use crate::render::sections::stability::direct::{FULL, key};
use crate::render::sections::stability::study::blocks;
use crate::run_cache::hash_of_file;
use crate::studies::stability::learned::load;
use crate::studies::stability::{Study, StudyError};
use crate::suite::Suite;

/// A study of learned simulators.
pub(super) struct Learned {
    pub title: &'static str,
    pub lead: &'static str,
    pub study: fn(Suite, &Simulator) -> Result<Study, StudyError>,
    /// Estimated time of the quick suite with the tiny example, s.
    pub seconds: f64,
}

impl Learned {
    /// The models that are tested; in the quick suite the smallest of them.
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

    fn lead(&self) -> &'static str {
        self.lead
    }

    fn estimate(&self, context: &Context) -> f64 {
        let missing = |model: &&Model| {
            !model_key(context, model).is_ok_and(|key| context.cache.has_cached(self.title, &key))
        };
        let each = self.seconds * context.suite.pick(1.0, FULL);
        self.models(context).iter().filter(missing).count() as f64 * each
    }

    fn run(&self, context: &mut Context) -> miette::Result<Vec<Block>> {
        let models = self.models(context);
        if models.is_empty() {
            return Ok(vec![Block::missing(
                self.title,
                "no model was found.",
                "`surrogate train` makes one; `--models` takes its folder.",
            )]);
        }
        let device = context.device.parse::<Device>().map_err(|e| miette!("--device: {e}"))?;
        let mut all = Vec::new();
        for model in models {
            let (suite, key) = (context.suite, model_key(context, &model)?);
            let mut study = context.cached(self.title, &key, self.seconds, || {
                Ok((self.study)(suite, &load(&model.path, device)?)?)
            })?;
            study.name_model(&model.name);
            all.push(Block::Heading(model.name));
            all.extend(blocks(&study)?);
        }
        Ok(all)
    }
}

/// A study of a model depends on the model too.
fn model_key(context: &Context, model: &Model) -> miette::Result<String> {
    Ok(format!("{} {}", key(context), hash_of_file(&model.path).into_diagnostic()?))
}
