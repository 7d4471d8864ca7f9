//! Runs the settings of a case and compares them with its reference.

use std::path::Path;

use dempm::scene::Scene;
use dempm::simulation::Simulation;
use dempm::trajectory::Trajectory;
use miette::{Context as _, bail, miette};
use rayon::prelude::*;

use super::cases::Case;
use super::measured::{Error, Family, Measured, Sweep};
use crate::context::{Context, Start};
use crate::difference::kept_difference;
use crate::models::{Model, ablation};
use crate::run_cache::Run;
use crate::suite::Suite;
use crate::wall_time::computing;

/// Kind of the kept values: a setting's result and its run.
const KIND: &str = "setting";

/// Runs shorter than this (s) are timed three times, since single brief times scatter.
const BRIEF: f64 = 0.5;

impl Case {
    /// Estimated time of what is not kept, s.
    pub fn estimate(&self, context: &Context) -> f64 {
        let missing = self.missing(context);
        let settings = missing.iter().map(|scene| context.estimate(scene));
        settings.chain(self.references().iter().map(|scene| context.estimate(scene))).sum()
    }

    /// Runs the reference with both seeds.
    ///
    /// # Errors
    /// If a run fails or the user interrupts.
    pub fn run_references(&self, context: &mut Context) -> miette::Result<[Run; 2]> {
        self.prepare(context);
        let [one, other] = self.references();
        let mut run = |scene: &str| {
            let run = context.run(&format!("{}: reference", self.name), scene)?;
            if run.succeeded {
                Ok(run)
            } else {
                Err(miette!("{}", run.message)).wrap_err("the reference failed")
            }
        };
        Ok([run(&one)?, run(&other)?])
    }

    /// What the result of a setting depends on.
    fn key(&self, context: &Context, scene: &str) -> String {
        let [one, other] = self.references();
        format!("{}\n{scene}\n{one}\n{other}", context.device_name)
    }

    /// Scenes of the settings whose results are not kept.
    pub fn missing(&self, context: &Context) -> Vec<&str> {
        let kept = |scene: &str| context.cache.has_cached(KIND, &self.key(context, scene));
        let scenes = self.settings.iter().map(|(_, _, scene)| scene.as_str());
        scenes.filter(|scene| !kept(scene)).collect()
    }

    /// Prepares the packings of all missing runs in parallel: a run prepares its own on a core or
    /// two while the GPU waits.
    fn prepare(&self, context: &Context) {
        let references = self.references();
        let scenes = self.missing(context).into_iter().chain(references.iter().map(String::as_str));
        let missing: Vec<&str> = scenes.filter(|scene| context.estimate(scene) > 0.0).collect();
        missing.par_iter().for_each(|text| {
            // What fails here fails again in the run, which reports it.
            let _ = Scene::parse(text, "scene.toml").map(Simulation::new);
        });
    }

    /// Runs what is missing and compares all settings with the reference.
    ///
    /// # Errors
    /// If the reference fails, a file cannot be read or the user interrupts.
    pub fn measure(&self, context: &mut Context) -> miette::Result<Sweep> {
        let references = self.run_references(context)?;
        let both: Vec<&Run> = references.iter().collect();
        let compare = |k: usize| {
            compared(Family::Packings, self.reference_name, &references[k], &[&references[1 - k]])
        };
        let [one, other] = [compare(0)?, compare(1)?];
        let reference_seconds = [one.seconds, other.seconds];
        let floor = one.error.unwrap_or_default();
        let mut measured = vec![one];
        for setting in &self.settings {
            measured.push(self.measure_setting(context, setting, &both)?);
        }
        let of_ablation = ablation(&context.models);
        for model in context.models.clone() {
            if of_ablation.iter().any(|other| other.name == model.name) {
                measured.push(self.measure_model(context, Family::Ablation, &model, &both)?);
            } else {
                measured.extend(self.measure_ways(context, model, &both)?);
            }
        }
        let fronts: Vec<f64> =
            both.iter().map(|run| front(&run.output)).collect::<miette::Result<_>>()?;
        let front = 0.5 * (fronts[0] + fronts[1]);
        let [width, height] = self.size;
        Ok(Sweep { measured, floor, reference_seconds, front, runout: front - width, height })
    }

    fn measure_setting(
        &self,
        context: &mut Context,
        (family, name, scene): &(Family, String, String),
        references: &[&Run],
    ) -> miette::Result<Measured> {
        // The result is kept by itself: trajectories are large and may have been deleted.
        let key = self.key(context, scene);
        let kept: Option<(Measured, Run)> = context.cache.value(KIND, &key);
        let (found, run) = match kept {
            Some(kept) => kept,
            None => {
                let what = format!("{}: {name}", self.name);
                let run = context.run(&what, scene)?;
                let mut found = compared(*family, name, &run, references)?;
                time_again(&mut found, |again| context.run_again(&what, scene, again))?;
                context.cache.keep(KIND, &key, &(&found, &run))?;
                (found, run)
            }
        };
        context.cache.note(&run);
        Ok(found)
    }

    /// A network with all its prediction settings: f32; on a GPU bf16; in the full suite also with
    /// mirror images averaged.
    fn measure_ways(
        &self,
        context: &mut Context,
        model: Model,
        references: &[&Run],
    ) -> miette::Result<Vec<Measured>> {
        let plain = self.measure_model(context, Family::Network, &model, references)?;
        // Only a GPU has bf16, and not every network fits on one.
        let on_gpu = plain.error.is_some() && !plain.device.starts_with("cpu");
        let mut measured = vec![plain];
        let fast = if on_gpu { model.in_bf16() } else { model };
        if on_gpu {
            measured.push(self.measure_model(context, Family::Network, &fast, references)?);
        }
        // Twice the work: too much for minutes on two cores.
        if context.suite == Suite::Full {
            let mirrored = fast.mirrored();
            measured.push(self.measure_model(context, Family::Network, &mirrored, references)?);
        }
        Ok(measured)
    }

    fn measure_model(
        &self,
        context: &mut Context,
        family: Family,
        model: &Model,
        references: &[&Run],
    ) -> miette::Result<Measured> {
        let start = Start::Scene(&self.start_of_networks);
        let run = context.rollout(model, &start)?;
        let mut found = compared(family, &model.name, &run, references)?;
        if family == Family::Network {
            time_again(&mut found, |again| context.rollout_again(model, &start, again))?;
        }
        Ok(Measured { model: Some(model.clone()), ..found })
    }
}

/// Times a brief run twice more. Failed runs have no time (NaN).
fn time_again(
    measured: &mut Measured,
    mut again: impl FnMut(usize) -> miette::Result<Run>,
) -> miette::Result<()> {
    if measured.seconds < BRIEF {
        let mut times = vec![measured.seconds];
        for k in 1..=2 {
            times.push(computing(&Trajectory::open(&again(k)?.output)?));
        }
        times.sort_by(f64::total_cmp);
        (measured.seconds, measured.spread) = (times[1], Some(times[2] - times[0]));
    }
    Ok(())
}

/// Time and errors of a run.
fn compared(
    family: Family,
    name: &str,
    run: &Run,
    references: &[&Run],
) -> miette::Result<Measured> {
    let mut measured = Measured {
        family,
        name: name.to_owned(),
        model: None,
        seconds: f64::NAN,
        spread: None,
        error: None,
        failure: run.message.clone(),
        device: String::new(),
        processor_seconds: run.processor_seconds,
        load: run.load,
    };
    if run.succeeded {
        let trajectory = Trajectory::open(&run.output)?;
        measured.seconds = computing(&trajectory);
        measured.error = Some(error(run, references)?);
        measured.failure.clear();
        measured.device.clone_from(&trajectory.header().device);
    }
    Ok(measured)
}

/// Mean errors against some references.
fn error(run: &Run, references: &[&Run]) -> miette::Result<Error> {
    let mut mean = Error::default();
    let part = 1.0 / references.len() as f64;
    for reference in references {
        let errors = kept_difference(run, &reference.output, &reference.id)?;
        let width = Trajectory::open(&reference.output)?.header().domain[0];
        let Some(last) = errors.last() else {
            bail!("{} has no time in common with its reference", run.output.display());
        };
        mean.mse += part * errors.mean();
        mean.front += part * last.front.abs();
        mean.height += part * last.height;
        mean.distance += part * errors.mean().sqrt() * width;
    }
    Ok(mean)
}

/// Position of the foremost point at the end, m.
fn front(path: &Path) -> miette::Result<f64> {
    let trajectory = Trajectory::open(path)?;
    let last = trajectory.frame(trajectory.frames() - 1)?;
    Ok(last.position.iter().map(|x| x[0]).fold(f64::MIN, f64::max))
}
