//! Runs a case and compares every setting with the truth.

use dempm::scene::Scene;
use dempm::simulation::Simulation;
use dempm::trajectory::Trajectory;
use miette::{Context as _, IntoDiagnostic, miette};
use rayon::prelude::*;

use super::cases::{Case, Setting};
use super::measured::{Error, Family, Measured, Sweep, with_truth};
use crate::context::{Context, Start};
use crate::models::{Model, ablation, baseline_and_others};
use crate::run_cache::Run;
use crate::suite::Suite;
use crate::truth::{Comparison, Motion, Reference, compare};
use crate::wall_time::computing;

/// Kind of the kept values: a setting's result and its run.
const KIND: &str = "against-truth";

/// Runs shorter than this (s) are timed three times, since single brief times scatter.
const BRIEF: f64 = 0.5;

/// Name of the truth among the settings.
const TRUTH: &str = "discs";

/// A case on its way.
struct Measurement<'c> {
    case: &'c Case,
    context: &'c mut Context,
    /// Runs of the truth, once they are needed.
    truth: Option<Reference>,
}

impl Case {
    /// Estimated time of what is not kept, s.
    pub fn estimate(&self, context: &Context) -> f64 {
        if self.missing(context).is_empty() {
            return 0.0;
        }
        let texts = self.missing(context).into_iter().chain(self.truth.iter().map(String::as_str));
        texts.map(|text| context.estimate(text)).sum()
    }

    /// Scenes of the settings whose results are not kept, and of the truth.
    pub fn missing(&self, context: &Context) -> Vec<&str> {
        let kept = |text: &str| context.cache.has_cached(KIND, &self.key(context, text));
        let texts = self.settings.iter().map(|setting| &setting.text).chain(self.truth.first());
        texts.map(String::as_str).filter(|text| !kept(text)).collect()
    }

    /// What a result depends on besides the programs.
    fn key(&self, context: &Context, what: &str) -> String {
        let truth: Vec<String> = self.truth.iter().map(|text| context.scene_key(text)).collect();
        format!("{}\n{what}\n{}", context.scene_key(what), truth.join("\n"))
    }

    /// Runs what is missing, with every model in its defaults.
    ///
    /// # Errors
    /// If the truth fails, a file cannot be read or the user interrupts. A model that fails is a result.
    pub fn measure(&self, context: &mut Context) -> miette::Result<Sweep> {
        let models = baseline_and_others(&context.models);
        let mut measurement = Measurement::of(self, context);
        let mut measured = measurement.solvers()?;
        for model in models {
            measured.push(measurement.network(Family::Network, model)?);
        }
        sweep(measured)
    }

    /// As [`measure`](Self::measure), without networks.
    ///
    /// # Errors
    /// As [`measure`](Self::measure).
    pub fn measure_solvers(&self, context: &mut Context) -> miette::Result<Sweep> {
        sweep(Measurement::of(self, context).solvers()?)
    }

    /// The runs of the default packings and of one seed of the truth, to be drawn; `None` if the packings
    /// failed.
    ///
    /// # Errors
    /// If one of them has to be made again and cannot, or the user interrupts.
    pub fn drawn(&self, context: &mut Context) -> miette::Result<Option<[Run; 2]>> {
        let mut run = |text: &str| context.run(self.scene.name, text);
        let [packings, truth] = [run(&self.settings[0].text)?, run(&self.truth[0])?];
        Ok((packings.succeeded && truth.succeeded).then_some([packings, truth]))
    }

    /// As [`measure`](Self::measure), with all ways to predict with a network, and the networks of the ablation.
    ///
    /// # Errors
    /// As [`measure`](Self::measure).
    pub fn measure_speed(&self, context: &mut Context) -> miette::Result<Sweep> {
        let of_ablation = ablation(&context.models);
        let models = context.models.clone();
        let mut measurement = Measurement::of(self, context);
        let mut measured = measurement.solvers()?;
        for model in models {
            if of_ablation.iter().any(|other| other.name == model.name) {
                measured.push(measurement.network(Family::Ablation, model)?);
            } else {
                measured.extend(measurement.ways(model)?);
            }
        }
        sweep(measured)
    }
}

impl<'c> Measurement<'c> {
    fn of(case: &'c Case, context: &'c mut Context) -> Self {
        Self { case, context, truth: None }
    }

    /// The truth and all settings of solvers.
    fn solvers(&mut self) -> miette::Result<Vec<Measured>> {
        self.prepare();
        let mut measured = vec![self.one_of_truth()?];
        for setting in &self.case.settings {
            measured.push(self.setting(setting)?);
        }
        Ok(measured)
    }

    /// Prepares the packings of all missing runs in parallel: a run prepares its own on a core or two
    /// while the GPU waits.
    fn prepare(&self) {
        let missing = self.case.missing(self.context);
        let settings = self.case.settings.iter().filter(|setting| {
            setting.family == Family::Packings && missing.contains(&setting.text.as_str())
        });
        settings.collect::<Vec<_>>().par_iter().for_each(|setting| {
            // What fails here fails again in the run, which reports it.
            let _ = Scene::parse(&setting.text, "scene.toml").map(Simulation::new);
        });
    }

    /// The runs of the truth.
    fn truth(&mut self) -> miette::Result<&Reference> {
        if self.truth.is_none() {
            let texts: Vec<&str> = self.case.truth.iter().map(String::as_str).collect();
            let what = format!("{}: truth", self.case.scene.name);
            let runs = self.context.runs_together(&what, &texts)?;
            let read = |run: &Run| {
                if !run.succeeded {
                    return Err(miette!("{}", run.message)).wrap_err("the truth failed");
                }
                Motion::read(&run.output).into_diagnostic()
            };
            let runs = runs.iter().map(read).collect::<miette::Result<_>>()?;
            self.truth = Some(Reference::of(runs).map_err(|problem| miette!("{problem}"))?);
        }
        self.truth.as_ref().ok_or_else(|| miette!("no truth"))
    }

    /// One seed of the truth against the others.
    fn one_of_truth(&mut self) -> miette::Result<Measured> {
        let text = &self.case.truth[0];
        self.kept(text, |this| {
            let what = format!("{}: {TRUTH}", this.case.scene.name);
            // On its own, for its time.
            let run = this.context.run(&what, text)?;
            let mut others = this.truth()?.runs.clone();
            let first = others.remove(0);
            let truth = Reference::of(others).map_err(|problem| miette!("{problem}"))?;
            let found = compare(&first, &truth);
            Ok((measured(Family::Discs, TRUTH, &run, found)?, run))
        })
    }

    fn setting(&mut self, setting: &Setting) -> miette::Result<Measured> {
        let Setting { family, name, text } = setting;
        self.kept(text, |this| {
            let what = format!("{}: {name}", this.case.scene.name);
            let run = this.context.run(&what, text)?;
            let mut found = this.compared(*family, name, &run)?;
            time_again(&mut found, |again| this.context.run_again(&what, text, again))?;
            Ok((found, run))
        })
    }

    /// A network with all its prediction settings: f32; on a GPU bf16; in the full suite also with
    /// mirror images averaged.
    fn ways(&mut self, model: Model) -> miette::Result<Vec<Measured>> {
        let plain = self.network(Family::Network, model.clone())?;
        if plain.is_outside_of_training() {
            return Ok(vec![plain]);
        }
        // Only a GPU has bf16, and not every network fits on one.
        let on_gpu = plain.error.is_some() && !plain.device.starts_with("cpu");
        let mut measured = vec![plain];
        let fast = if on_gpu { model.in_bf16() } else { model };
        if on_gpu {
            measured.push(self.network(Family::Network, fast.clone())?);
        }
        // Twice the work: too much for minutes on two cores.
        if self.context.suite == Suite::Full {
            measured.push(self.network(Family::Network, fast.mirrored())?);
        }
        Ok(measured)
    }

    fn network(&mut self, family: Family, model: Model) -> miette::Result<Measured> {
        let starts = &self.case.starts;
        let text = if model.of_discs { &starts.discs } else { &starts.packings };
        let start = Start::Scene(text);
        let hash = self.context.hash(&model.path)?;
        let key = format!("{}\n{text}\n{}\n{hash}", self.context.scene_key(text), model.name);
        let found = self.kept(&key, |this| {
            let run = this.context.rollout(&model, &start)?;
            let mut found = this.compared(family, &model.name, &run)?;
            if family == Family::Network {
                time_again(&mut found, |again| this.context.rollout_again(&model, &start, again))?;
            }
            Ok((found, run))
        })?;
        Ok(Measured { model: Some(model), ..found })
    }

    /// The kept result, or a new one. It is kept by itself: trajectories are large and may have been deleted.
    fn kept(
        &mut self,
        what: &str,
        make: impl FnOnce(&mut Self) -> miette::Result<(Measured, Run)>,
    ) -> miette::Result<Measured> {
        let key = self.case.key(self.context, what);
        let (found, run) = match self.context.cache.value(KIND, &key) {
            Some(kept) => kept,
            None => {
                let made = make(self)?;
                self.context.cache.keep(KIND, &key, &made)?;
                made
            }
        };
        self.context.cache.note(&run);
        Ok(found)
    }

    fn compared(&mut self, family: Family, name: &str, run: &Run) -> miette::Result<Measured> {
        let found = if run.output.exists() {
            compare(&Motion::read(&run.output)?, self.truth()?)
        } else {
            Err(run.message.clone())
        };
        measured(family, name, run, found)
    }
}

/// Time and errors of a run.
fn measured(
    family: Family,
    name: &str,
    run: &Run,
    found: Result<Comparison, String>,
) -> miette::Result<Measured> {
    let (comparison, problem) = match found {
        Ok(comparison) => (Some(comparison), String::new()),
        Err(problem) => (None, problem),
    };
    let mut measured = Measured {
        family,
        name: name.to_owned(),
        model: None,
        seconds: f64::NAN,
        spread: None,
        error: None,
        comparison,
        failure: if run.succeeded { problem } else { run.message.clone() },
        warnings: if run.succeeded { run.message.clone() } else { String::new() },
        device: String::new(),
        processor_seconds: run.processor_seconds,
        load: run.load,
    };
    if measured.failure.is_empty() {
        let trajectory = Trajectory::open(&run.output)?;
        measured.seconds = computing(&trajectory);
        measured.device.clone_from(&trajectory.header().device);
        measured.error = measured.comparison.as_ref().and_then(Error::of);
    }
    Ok(measured)
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

/// The results of a case.
fn sweep(all: Vec<Measured>) -> miette::Result<Sweep> {
    let (outside, measured): (Vec<Measured>, _) =
        all.into_iter().partition(Measured::is_outside_of_training);
    let outside = outside.into_iter().map(|m| m.name).collect();
    let finest =
        with_truth(&measured).ok_or_else(|| miette!("nothing could be compared with the truth"))?;
    let fronts = [finest.rows.first(), finest.rows.last()];
    let [start, front] = fronts.map(|row| row.map_or(f64::NAN, |row| row.true_front.mean));
    let floor = Error::between_seeds(finest).unwrap_or_default();
    Ok(Sweep { seeds: finest.seeds, floor, front, runout: front - start, outside, measured })
}
