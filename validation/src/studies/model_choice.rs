//! What `dempm choose` takes for scenes that its errors were not fitted to, and how far that is from the truth.

use std::collections::BTreeMap;

use dempm::choose::{Choice, ErrorModel, Within};
use dempm::dataset::{self, Split};
use dempm::scene::Scene;
use dempm::trajectory::Trajectory;
use files::write_text;
use miette::{IntoDiagnostic, miette};

use crate::context::Context;
use crate::run_cache::Run;
use crate::scene_text::with;
use crate::suite::Suite;
use crate::truth::{Motion, Reference, compare};
use crate::wall_time::computing;

/// The list of scenes, whose tests are no part of the library, and its base.
const LIST: &str = include_str!("../../../scenes/dataset/library.toml");
const BASE: &str = include_str!("../../../scenes/discs.toml");
/// Distances (m) that are asked for.
pub const WITHIN: [f64; 4] = [0.5, 0.2, 0.1, 0.05];
/// Seeds of the discs.
const SEEDS: u64 = 3;
/// Scenes of the quick suite.
const QUICK: usize = 3;

/// A scene with what is chosen.
pub struct OfScene {
    /// Its name.
    pub name: String,
    /// The largest distance (m) between two seeds of the discs.
    pub spread: f64,
    /// Wall time of the discs, s.
    pub seconds: f64,
    /// What is chosen for each of [`WITHIN`].
    pub chosen: Vec<Chosen>,
}

/// A choice, run and compared.
pub struct Chosen {
    /// The distance (m) that was asked for.
    pub within: f64,
    /// The model.
    pub model: String,
    /// Whether its bound was within.
    pub met: bool,
    /// Median and bound (m) of what was expected.
    pub expected: Option<[f64; 2]>,
    /// The largest distance (m) from the truth, or why there is none.
    pub distance: Result<f64, String>,
    /// Wall time, s.
    pub seconds: f64,
}

impl Chosen {
    /// Whether it is nearer to the truth than this distance (m).
    pub fn is_below(&self, distance: f64) -> bool {
        self.distance.as_ref().is_ok_and(|found| *found <= distance)
    }
}

/// The scenes; of the quick suite the cheapest.
///
/// # Errors
/// If they cannot be written for the reader of lists.
fn scenes(suite: Suite) -> miette::Result<Vec<(String, Scene)>> {
    let folder = tempfile::tempdir().into_diagnostic()?;
    let lists = folder.path().join("dataset");
    std::fs::create_dir(&lists).into_diagnostic()?;
    let [list, base] = [lists.join("library.toml"), folder.path().join("discs.toml")];
    write_text(&list, LIST)?;
    write_text(&base, BASE)?;
    let mut cases = dataset::cases(&list)?;
    cases.retain(|case| case.split == Split::Test);
    if suite == Suite::Quick {
        cases.sort_by_key(dataset::Case::work);
        cases.truncate(QUICK);
    }
    Ok(cases.into_iter().map(|case| (case.name, case.scene)).collect())
}

/// Estimated time of what is not kept, s.
pub fn estimate(context: &Context) -> f64 {
    let truth = |(_, scene): &(String, Scene)| {
        let seeds = texts(scene);
        seeds.iter().map(|text| context.estimate(text)).sum::<f64>()
    };
    scenes(context.suite).map_or(0.0, |scenes| scenes.iter().map(truth).sum())
}

/// The scene as discs, one text for each seed.
fn texts(scene: &Scene) -> Vec<String> {
    let seed = |k: u64| with(&scene.text, &[("seed", ((scene.seed + k) as i64).into())]);
    (0..SEEDS).map(seed).collect()
}

/// Runs what is chosen for every scene and distance.
///
/// # Errors
/// If the discs fail, a file cannot be read or the user interrupts.
pub fn measure(context: &mut Context) -> miette::Result<Vec<OfScene>> {
    scenes(context.suite)?.iter().map(|(name, scene)| of_scene(context, name, scene)).collect()
}

fn of_scene(context: &mut Context, name: &str, scene: &Scene) -> miette::Result<OfScene> {
    let discs = Discs::run(context, name, scene)?;
    let model = ErrorModel::shipped();
    // One run for each model, however often it is chosen.
    let mut known: BTreeMap<String, (Result<f64, String>, f64)> = BTreeMap::new();
    let mut chosen = Vec::new();
    for within in WITHIN {
        let (allowed, rates) = (Within::Metres(within), &context.rates);
        let choice = Choice::of(scene, allowed, &model, rates, None, None)?;
        let entry = choice.taken();
        if !known.contains_key(&entry.name) {
            let found = if choice.taken == 0 {
                (Ok(discs.spread), discs.seconds)
            } else {
                let text = &entry.scene().map_err(|why| miette!("{why}"))?.text;
                let run = context.run(&format!("{name}: {}", entry.name), text)?;
                (discs.distance(&run)?, seconds(&run)?)
            };
            known.insert(entry.name.clone(), found);
        }
        let (distance, seconds) = known[&entry.name].clone();
        chosen.push(Chosen {
            within,
            model: entry.name.clone(),
            met: choice.met,
            expected: entry.expected().map(|expected| [expected.median, expected.bound]),
            distance,
            seconds,
        });
    }
    Ok(OfScene { name: name.to_owned(), spread: discs.spread, seconds: discs.seconds, chosen })
}

/// The discs of a scene.
struct Discs {
    truth: Reference,
    /// The largest distance (m) between two seeds.
    spread: f64,
    /// Wall time of one, s.
    seconds: f64,
}

impl Discs {
    /// Runs all seeds.
    fn run(context: &mut Context, name: &str, scene: &Scene) -> miette::Result<Self> {
        let texts = texts(scene);
        let first = context.run(&format!("{name}: discs"), &texts[0])?;
        let others: Vec<&str> = texts[1..].iter().map(String::as_str).collect();
        let others = context.runs_together(&format!("{name}: seeds of the discs"), &others)?;
        let read = |run: &Run| match run.succeeded {
            true => Motion::read(&run.output).into_diagnostic(),
            false => Err(miette!("{}", run.message)),
        };
        let truth: Vec<Motion> =
            std::iter::once(&first).chain(&others).map(read).collect::<miette::Result<_>>()?;
        let truth = Reference::of(truth).map_err(|problem| miette!("{problem}"))?;
        let found = compare(&read(&first)?, &truth).map_err(|why| miette!("{why}"))?;
        let spread = found.rows.iter().filter_map(|row| row.spread).fold(0.0, f64::max);
        Ok(Self { truth, spread, seconds: seconds(&first)? })
    }

    /// The largest distance (m) of a run from them over time, or why there is none.
    fn distance(&self, run: &Run) -> miette::Result<Result<f64, String>> {
        if !run.succeeded {
            return Ok(Err(run.message.clone()));
        }
        let found = compare(&Motion::read(&run.output)?, &self.truth);
        Ok(found.map(|found| found.rows.iter().map(|row| row.distance).fold(0.0, f64::max)))
    }
}

/// Wall time of a run, s; not a number if it failed.
fn seconds(run: &Run) -> miette::Result<f64> {
    let finished = run.succeeded.then(|| Trajectory::open(&run.output)).transpose()?;
    Ok(finished.map_or(f64::NAN, |trajectory| computing(&trajectory)))
}
