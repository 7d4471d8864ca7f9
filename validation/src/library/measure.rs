//! Every candidate on one scene.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

use dempm::choose::{Candidate, Case, Distance, Family, candidates, distance, features};
use dempm::run::{Options, Outcome, run_scene};
use dempm::scene::Scene;
use files::Interrupt;

use crate::scene_text::with;
use crate::truth::{Comparison, Motion, Reference, compare};

/// Runs are short: none is continued.
const NO_CHECKPOINT: Duration = Duration::from_secs(1_000_000_000);

/// A finished run.
struct Run {
    path: PathBuf,
    /// Wall time of the run and of its preparation, s.
    seconds: [f64; 2],
}

/// Runs all candidates of a scene into `folder` and compares them with so many seeds of discs. A candidate that fails
/// is a case without a distance.
///
/// # Errors
/// A sentence, if the discs fail or cannot be compared, or the user interrupts.
pub fn measure(
    name: &str,
    scene: &Scene,
    seeds: u64,
    device: Option<&Arc<gpu::Device>>,
    folder: &Path,
    interrupt: &Interrupt,
) -> Result<Vec<Case>, String> {
    let all = candidates(scene);
    let place = |file: String| folder.join(file + ".h5");
    let go = |scene: &Scene, file: String| simulate(scene, place(file), device, interrupt);
    let discs = all.first().ok_or("no candidates")?.scene.as_ref().map_err(Clone::clone)?;
    let mut seconds = [0.0; 2];
    let mut truth = Vec::new();
    for seed in 0..seeds {
        let own = scene.seed + seed;
        let text = with(&discs.text, &[("seed", (own as i64).into())]);
        let run = go(&parse(&text)?, format!("discs-{own}"))?;
        seconds = run.seconds;
        truth.push(Motion::read(&run.path).map_err(|error| error.to_string())?);
    }
    let truth = Reference::of(truth)?;
    let mut runs: BTreeMap<&str, Result<Run, String>> = BTreeMap::new();
    let mut cases = Vec::new();
    for (index, candidate) in all.iter().enumerate() {
        let is_truth = candidate.family == Family::Discs && candidate.size == 1.0;
        let run = match &candidate.scene {
            Err(_) => continue,
            Ok(_) if is_truth => Ok(Run { path: place(format!("discs-{}", scene.seed)), seconds }),
            Ok(own) => go(own, format!("{index}")),
        };
        if interrupt.requested() {
            return Err("interrupted".to_owned());
        }
        let found = match &run {
            Ok(run) if is_truth => between_seeds(run, &truth),
            Ok(run) => against_truth(run, &truth),
            Err(why) => Err(why.clone()),
        };
        cases.push(Case {
            scene: name.to_owned(),
            candidate: candidate.name.clone(),
            family: candidate.family,
            features: features(discs, candidate),
            height: scene.height(),
            distance: found.as_ref().ok().copied(),
            change: None,
            seconds: run.as_ref().map_or([f64::NAN; 2], |run| run.seconds),
            failure: found.err().unwrap_or_default().replace(['\n', '\r'], " "),
        });
        runs.insert(&candidate.name, run);
    }
    add_changes(&mut cases, &all, &runs)?;
    Ok(cases)
}

/// Adds the distances of candidates from the next coarser ones.
fn add_changes(
    cases: &mut [Case],
    all: &[Candidate],
    runs: &BTreeMap<&str, Result<Run, String>>,
) -> Result<(), String> {
    let path = |name: &str| runs.get(name)?.as_ref().ok().map(|run| run.path.as_path());
    for case in cases {
        let candidate = all.iter().find(|candidate| candidate.name == case.candidate);
        let coarser = candidate.and_then(|candidate| candidate.coarser(all));
        let paths = coarser.and_then(|coarser| path(&case.candidate).zip(path(&coarser.name)));
        if let Some((one, other)) = paths {
            case.change = distance(one, other).map_err(|error| error.to_string())?;
        }
    }
    Ok(())
}

fn parse(text: &str) -> Result<Scene, String> {
    Scene::parse(text, "scene.toml").map_err(|error| error.to_string())
}

fn simulate(
    scene: &Scene,
    path: PathBuf,
    device: Option<&Arc<gpu::Device>>,
    interrupt: &Interrupt,
) -> Result<Run, String> {
    let options = Options {
        device: device.cloned(),
        overwrite: true,
        checkpoint_interval: NO_CHECKPOINT,
        ..Options::default()
    };
    match run_scene(scene.clone(), path.clone(), &options, &mut (), interrupt) {
        Ok(Outcome::Finished { simulation, .. }) => {
            let preparation = simulation.wall_time.get("preparation").copied().unwrap_or(0.0);
            let total: f64 = simulation.wall_time.values().sum();
            Ok(Run { path, seconds: [total - preparation, preparation] })
        }
        Ok(Outcome::WasFinished | Outcome::Interrupted { .. }) => Err("interrupted".to_owned()),
        Err(error) => Err(error.to_string()),
    }
}

/// The distance between two seeds of the truth.
fn between_seeds(run: &Run, truth: &Reference) -> Result<Distance, String> {
    let found = compared(run, truth)?;
    let spreads: Option<Vec<f64>> = found.rows.iter().map(|row| row.spread).collect();
    over_time(&spreads.ok_or("a single seed has no spread")?)
}

fn against_truth(run: &Run, truth: &Reference) -> Result<Distance, String> {
    let found = compared(run, truth)?;
    if let Some(failure) = found.failure {
        return Err(failure);
    }
    over_time(&found.rows.iter().map(|row| row.distance).collect::<Vec<f64>>())
}

fn compared(run: &Run, truth: &Reference) -> Result<Comparison, String> {
    let motion = Motion::read(&run.path).map_err(|error| error.to_string())?;
    compare(&motion, truth)
}

fn over_time(distances: &[f64]) -> Result<Distance, String> {
    let end = *distances.last().ok_or("no frames")?;
    let largest = distances.iter().copied().fold(0.0, f64::max);
    let finite = end.is_finite() && largest.is_finite();
    finite.then_some(Distance { end, largest }).ok_or_else(|| "a position is not finite".to_owned())
}
