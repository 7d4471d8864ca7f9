//! One scene with many methods and settings: what each costs and how wrong it is.

mod cases;

use std::path::Path;
use std::rc::Rc;

use dempm::scene::Scene;
use dempm::simulation::Simulation;
use dempm::trajectory::Trajectory;
use miette::{Context as _, bail};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

pub use self::cases::Case;
use crate::compare::kept_difference;
use crate::context::{Context, Model, Start, Suite};
use crate::pareto::Cost;
use crate::sections::paper::networks::ablation;
use crate::wall_time::computing;
use crate::work::Run;

/// Kind of the values that are kept: a setting's result, and its run.
const KIND: &str = "setting";

/// What takes less than this (s) is timed three times.
const BRIEF: f64 = 0.5;

/// A kind of method.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Family {
    /// A packing in every point.
    Packings,
    /// The mu(I) law.
    Continuum,
    /// A learned simulator.
    Network,
    /// One of the paper's ablation: trained to be compared with its like.
    Ablation,
}

/// A method and what came out.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Measured {
    pub family: Family,
    pub name: String,
    /// The model, of a network.
    #[serde(skip)]
    pub model: Option<Model>,
    /// Wall time of the computation without preparing packings, kernels and files, s; the median
    /// where it was timed more than once.
    pub seconds: f64,
    /// What repeated times differ by at most, s.
    #[serde(default)]
    pub spread: Option<f64>,
    /// Errors; none if it failed.
    pub error: Option<Error>,
    /// Why it failed, in the words of the program.
    pub failure: String,
    pub device: String,
    /// Processor time of the whole program, s.
    pub processor_seconds: Option<f64>,
    /// Processes that wanted a core, per core.
    pub load: Option<f64>,
}

/// Errors against the reference, the mean of those against its two seeds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Error {
    /// Mean over the frames of the mean square distance of points, box width 1.
    pub mse: f64,
    /// Of the front at the end, m.
    pub front: f64,
    /// Root mean square over the height profile at the end, m.
    pub height: f64,
    /// Root of `mse` times the box, m.
    pub distance: f64,
}

/// A case with its results.
pub struct Sweep {
    pub measured: Vec<Measured>,
    /// Difference between the two seeds of the reference.
    pub floor: Error,
    /// Wall times of the two, s: they differ by what a time is uncertain by.
    pub reference_seconds: [f64; 2],
    /// Where the front of the reference is at the end, m.
    pub front: f64,
    /// What the front moves by, and the height of the column, m.
    pub runout: f64,
    pub height: f64,
}

/// A measure of error.
pub type Measure = fn(&Error) -> f64;

impl Measured {
    /// Time and one measure of the error; infinite if it failed.
    pub fn cost(&self, measure: Measure) -> Cost {
        let error = self.error.as_ref().map_or(f64::INFINITY, measure);
        Cost { seconds: self.seconds, error }
    }

    /// Times a brief run twice more, since single brief times scatter.
    fn time_again(
        &mut self,
        mut again: impl FnMut(usize) -> miette::Result<Run>,
    ) -> miette::Result<()> {
        // Times of what failed are no numbers.
        if self.seconds < BRIEF {
            let mut times = vec![self.seconds];
            for k in 1..=2 {
                times.push(computing(&Trajectory::open(&again(k)?.output)?));
            }
            times.sort_by(f64::total_cmp);
            (self.seconds, self.spread) = (times[1], Some(times[2] - times[0]));
        }
        Ok(())
    }
}

impl Case {
    /// Estimated time of what is not there yet, s.
    pub fn estimate(&self, context: &Context) -> f64 {
        let missing = self.missing(context);
        let settings = missing.iter().map(|scene| context.estimate(scene));
        settings.chain(self.references().iter().map(|scene| context.estimate(scene))).sum()
    }

    /// Runs the reference with both seeds, where that has not been done.
    ///
    /// # Errors
    /// If one fails or the user interrupts.
    pub fn run_references(&self, context: &mut Context) -> miette::Result<[Run; 2]> {
        self.prepare(context);
        let [one, other] = self.references();
        let mut run = |scene: &str| {
            let run = context.run(&format!("{}: reference", self.name), scene)?;
            if run.succeeded {
                Ok(run)
            } else {
                Err(miette::miette!("{}", run.message)).wrap_err("the reference failed")
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
        let kept = |scene: &str| context.work.has_cached(KIND, &self.key(context, scene));
        let scenes = self.settings.iter().map(|(_, _, scene)| scene.as_str());
        scenes.filter(|scene| !kept(scene)).collect()
    }

    /// Prepares the packings of all runs that are missing, side by side: a run prepares its own on
    /// a core or two, while the GPU waits.
    fn prepare(&self, context: &Context) {
        let references = self.references();
        let scenes = self.missing(context).into_iter().chain(references.iter().map(String::as_str));
        let missing: Vec<&str> = scenes.filter(|scene| context.estimate(scene) > 0.0).collect();
        missing.par_iter().for_each(|text| {
            // What fails here fails in its run too, which says so.
            let _ = Scene::parse(text, "scene.toml").map(Simulation::new);
        });
    }

    /// Runs what is missing and compares everything with the reference.
    ///
    /// # Errors
    /// If the reference fails, a file cannot be read or the user interrupts.
    pub fn measure(&self, context: &mut Context) -> miette::Result<Rc<Sweep>> {
        if let Some(known) = context.sweeps.get(self.name) {
            return Ok(Rc::clone(known));
        }
        let sweep = Rc::new(self.compare_all(context)?);
        context.sweeps.insert(self.name, Rc::clone(&sweep));
        Ok(sweep)
    }

    fn compare_all(&self, context: &mut Context) -> miette::Result<Sweep> {
        let references = self.run_references(context)?;
        let both: Vec<&Run> = references.iter().collect();
        let compare = |k: usize| {
            compared(Family::Packings, self.reference_name, &references[k], &[&references[1 - k]])
        };
        let [one, other] = [compare(0)?, compare(1)?];
        let reference_seconds = [one.seconds, other.seconds];
        let floor = one.error.unwrap_or_default();
        let mut measured = vec![one];
        for (family, name, scene) in &self.settings {
            // Trajectories are large and may be gone.
            let key = self.key(context, scene);
            let kept: Option<(Measured, Run)> = context.work.value(KIND, &key);
            let (found, run) = match kept {
                Some(kept) => kept,
                None => {
                    let what = format!("{}: {name}", self.name);
                    let run = context.run(&what, scene)?;
                    let mut found = compared(*family, name, &run, &both)?;
                    found.time_again(|again| context.run_again(&what, scene, again))?;
                    context.work.keep(KIND, &key, &(&found, &run))?;
                    (found, run)
                }
            };
            context.work.note(&run);
            measured.push(found);
        }
        let of_ablation = ablation(&context.models);
        let start = Start::Scene(&self.start_of_networks);
        for model in context.models.clone() {
            let predict =
                |context: &mut Context, family, way: &Model| -> miette::Result<Measured> {
                    let run = context.rollout(way, &start)?;
                    let mut found = compared(family, &way.name, &run, &both)?;
                    if family == Family::Network {
                        found.time_again(|again| context.rollout_again(way, &start, again))?;
                    }
                    Ok(Measured { model: Some(way.clone()), ..found })
                };
            if of_ablation.iter().any(|other| other.name == model.name) {
                measured.push(predict(context, Family::Ablation, &model)?);
                continue;
            }
            let plain = predict(context, Family::Network, &model)?;
            // Only a GPU has bf16, and not every network runs there.
            let on_gpu = plain.error.is_some() && !plain.device.starts_with("cpu");
            measured.push(plain);
            let fast = if on_gpu { model.in_bf16() } else { model };
            if on_gpu {
                measured.push(predict(context, Family::Network, &fast)?);
            }
            // Twice the work: too much for minutes on two cores.
            if context.suite == Suite::Full {
                measured.push(predict(context, Family::Network, &fast.mirrored())?);
            }
        }
        let fronts: Vec<f64> =
            both.iter().map(|run| front(&run.output)).collect::<miette::Result<_>>()?;
        let front = 0.5 * (fronts[0] + fronts[1]);
        let [width, height] = self.size;
        Ok(Sweep { measured, floor, reference_seconds, front, runout: front - width, height })
    }
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

/// The foremost point at the end, m.
fn front(path: &Path) -> miette::Result<f64> {
    let trajectory = Trajectory::open(path)?;
    let last = trajectory.frame(trajectory.frames() - 1)?;
    Ok(last.position.iter().map(|x| x[0]).fold(f64::MIN, f64::max))
}
