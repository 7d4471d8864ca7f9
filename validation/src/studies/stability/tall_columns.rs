//! Tall columns: energy of their collapse, overlaps under their weight.

use dempm::run::Monitor;
use dempm::scene::Scene;
use dempm::simulation::{Simulation, SimulationError};
use rayon::prelude::*;

use super::learned::window;
use super::outcome::Outcome;
use super::scene_messages;
use super::study::{Axis, Chart, Curve, Finding, Map, Picture, Study, StudyError};
use super::threshold::Threshold;
use crate::suite::Suite;

/// A run of a scene, with all messages.
struct Fall {
    said: Vec<String>,
    error: Option<String>,
    /// Largest mechanical energy over that of the start.
    energy: f64,
    /// Largest overlap over the radius; 0 without packings.
    overlap: f64,
    picture: Picture,
}

impl Fall {
    /// Of a scene that is refused with these words.
    fn refused(why: Option<String>) -> Self {
        Self {
            said: Vec::new(),
            error: why,
            energy: f64::NAN,
            overlap: f64::NAN,
            picture: Picture::default(),
        }
    }
}

fn run(name: &str, text: &str) -> Result<Fall, StudyError> {
    let scene = match Scene::parse(text, name) {
        Ok(scene) => scene,
        // Its weight would crush its base: refused, which is an outcome.
        Err(_) => return Ok(Fall::refused(scene_messages::said(text))),
    };
    let failed = |e: SimulationError| StudyError::Scene { name: name.into(), reason: chain(&e) };
    let mut simulation = Simulation::new(scene).map_err(failed)?;
    let mut monitor = Monitor::new(&simulation);
    let mut fall = Fall {
        said: scene_messages::doubts(text).into_iter().filter(|doubt| !meant(doubt)).collect(),
        error: None,
        energy: 1.0,
        overlap: 0.0,
        picture: Picture::default(),
    };
    let energy = |simulation: &Simulation| {
        let budget = simulation.frame().budget;
        budget["kinetic_energy"] + budget["potential_energy"]
    };
    let start = energy(&simulation);
    let per_frame = simulation.scene.steps_per_frame();
    while simulation.step < simulation.scene.steps() {
        if let Err(error) = simulation.advance() {
            fall.error = Some(chain(&error));
            break;
        }
        if simulation.step.is_multiple_of(per_frame) {
            fall.said.extend(monitor.observe(&simulation, &simulation.frame()));
            fall.energy = fall.energy.max(energy(&simulation) / start);
        }
    }
    if let Some(rve) = simulation.packings() {
        fall.overlap = rve.tally.max_overlap;
    }
    let points = &simulation.points;
    let position: Vec<[f64; 2]> = points.position.iter().map(|&x| x.into()).collect();
    fall.picture = Picture {
        title: format!("{name}, at t = {:.2} s", simulation.time()),
        colour: "pressure, kPa".into(),
        window: window(simulation.scene.domain.size, [&position, &[]]),
        position,
        value: points.stress.iter().map(|s| -0.5e-3 * s.trace()).collect(),
        radius: vec![0.5 * simulation.scene.domain.spacing()],
        ..Picture::default()
    };
    Ok(fall)
}

/// Whether a warning is about few discs or a short run, which are intended here.
fn meant(doubt: &str) -> bool {
    doubt.contains("noisy material") || doubt.contains("before a collapse")
}

/// An error with its causes.
fn chain(error: &dyn std::error::Error) -> String {
    let causes = std::iter::successors(error.source(), |e| e.source());
    std::iter::once(error.to_string())
        .chain(causes.map(ToString::to_string))
        .collect::<Vec<_>>()
        .join(": ")
}

fn said(fall: &Fall) -> Option<String> {
    (!fall.said.is_empty()).then(|| fall.said.join("; "))
}

/// Collapses tall columns and loads shafts with their own weight.
///
/// # Errors
/// If a study's own scene or packing cannot be made; failures under study are results.
pub fn study(suite: Suite) -> Result<Study, StudyError> {
    let mut study = Study {
        method: "Columns half a metre wide collapse under the continuum law for \
                 3.3 sqrt(H/g): failure is a run that ends early, or mechanical energy more than 5 % \
                 above that of the start. And columns of packings in a shaft, whose gravity is \
                 switched on at once, so that the stress at the base swings to twice the weight: \
                 failure is a run that ends. The stiffness number kappa = kn/(p t) under their weight \
                 is varied with the height and the thickness of the discs."
            .into(),
        ..Study::default()
    };
    falls(suite, &mut study)?;
    shafts(suite, &mut study)?;
    Ok(study)
}

/// The scene of a collapsing column of the mu(I) law.
fn collapse(height: f64, transfer: &str) -> String {
    let frame = 0.02;
    let duration = frame * (3.3 * (height / 9.81_f64).sqrt() / frame).round();
    let width = (4.0 + 3.0 * height).ceil();
    format!(
        "duration = {duration:?}\nframe_interval = {frame}\nstep = 4.0e-4\n[domain]\n\
         size = [{width:?}, {:?}]\ncell = 0.125\n[[column]]\nsize = [0.5, {height:?}]\n[material]\n\
         kind = \"mu-i\"\n[numerics]\n{transfer}\n",
        height + 1.0
    )
}

fn falls(suite: Suite, study: &mut Study) -> Result<(), StudyError> {
    let heights = suite.pick(vec![1.0, 3.0, 6.0, 12.0], vec![1.0, 2.0, 3.0, 6.0, 12.0, 24.0, 48.0]);
    let transfers = [
        ("flip-apic, 500 1/s", "transfer = \"flip-apic\""),
        ("flip, 1 1/s", "transfer = \"flip\"\nrelaxation = 1.0"),
        ("apic", "transfer = \"apic\""),
    ];
    let rows: Vec<Vec<Fall>> = transfers
        .par_iter()
        .map(|(name, transfer)| {
            let of = |&h: &f64| run(&format!("column of {h} m, {name}"), &collapse(h, transfer));
            heights.par_iter().map(of).collect()
        })
        .collect::<Result<_, _>>()?;
    let judge = |fall: &Fall| {
        let ended = fall.error.as_ref().map(|_| "the run ends".to_owned());
        let symptom = ended.or_else(|| {
            let gain = 100.0 * (fall.energy - 1.0);
            (gain > 5.0).then(|| format!("gains {gain:.0} % of its energy"))
        });
        Outcome::of(symptom, fall.error.clone().or(said(fall)))
    };
    let outcomes: Vec<Vec<Outcome>> =
        rows.iter().map(|row| row.iter().map(judge).collect()).collect();
    for ((name, _), row) in transfers.iter().zip(&outcomes) {
        let works = heights.iter().zip(row).map(|(&h, o)| (h, o.works()));
        study.findings.push(Finding {
            case: format!("collapse of the mu(I) law, {name}"),
            parameter: "height, m".into(),
            measured: Threshold::of_sweep(works),
            theory: None,
            beyond: Outcome::first_failure(row),
        });
    }
    study.maps.push(Map {
        title: "Collapse of tall columns (mu(I) law)".into(),
        x: Axis::new("height, m", heights),
        y: Axis::named("transfer", transfers.map(|(name, _)| name.to_owned()).into()),
        numbers: rows.iter().map(|row| row.iter().map(|f| f.energy).collect()).collect(),
        outcomes,
        caption: "Numbers: largest mechanical energy over that of the start.".into(),
    });
    Ok(())
}

/// The scene of a shaft full of packings without initial stress.
fn shaft(height: f64, thickness: f64) -> String {
    // A quarter of the period and a bit: the base is then pressed most. c ~ 80 m/s at 7.5 mm.
    let speed = 80.0 * (7.5e-3 / thickness).sqrt();
    let step = (0.1 * 0.25 / speed).min(2.0e-4);
    let frame = 20.0 * step;
    let duration = frame * (3.0 * height / speed / frame).ceil();
    format!(
        "duration = {duration:?}\nframe_interval = {frame:?}\nstep = {step:?}\n[domain]\n\
         size = [0.25, {:?}]\ncell = 0.25\nwalls = {{ left = \"slip\", right = \"slip\", bottom = \
         \"slip\", top = \"slip\" }}\n[[column]]\nsize = [0.25, {height:?}]\n[material]\n\
         kind = \"rve\"\npackings = 1\ninitial_stress = \"none\"\n[grains]\nstep_factor = 0.201\nthickness = {thickness:?}\n\
         [rve]\ndiscs = 64\n[rve.preparation]\npressure = {:?}\n",
        height + 1.0,
        // Of the same stiffness number whatever the thickness.
        2.0e3 * 7.5e-3 / thickness
    )
}

fn shafts(suite: Suite, study: &mut Study) -> Result<(), StudyError> {
    let heights = suite.pick(vec![1.0, 3.0, 6.0], vec![1.0, 2.0, 3.0, 6.0, 12.0]);
    let thicknesses = [7.5e-3, 7.5e-2, 0.75];
    let rows: Vec<Vec<Fall>> = thicknesses
        .par_iter()
        .map(|&t| {
            let of = |&h: &f64| run(&format!("shaft of {h} m, discs {t} m thick"), &shaft(h, t));
            heights.par_iter().map(of).collect()
        })
        .collect::<Result<_, _>>()?;
    let judge = |fall: &Fall| {
        let ended = fall.error.as_ref().map(|_| "the run ends".to_owned());
        Outcome::of(ended, fall.error.clone().or(said(fall)))
    };
    let outcomes: Vec<Vec<Outcome>> =
        rows.iter().map(|row| row.iter().map(judge).collect()).collect();
    let kappa = |h: f64, t: f64| 1.0e5 / (2200.0 * 9.81 * h * t);
    let theory = |kappa: f64| 2.0 * 2.0 * std::f64::consts::PI / (4.0 * 0.84 * kappa);
    let mut points = Vec::new();
    for ((&t, row), outcomes) in thicknesses.iter().zip(&rows).zip(&outcomes) {
        points.extend(heights.iter().zip(row).map(|(&h, fall)| [kappa(h, t), fall.overlap]));
        let sweep = |good: &dyn Fn(&Outcome) -> bool| {
            Threshold::of_sweep(heights.iter().zip(outcomes).map(|(&h, o)| (h, good(o))))
        };
        let first = |good: &dyn Fn(&Outcome) -> bool| {
            outcomes.iter().find(|o| !good(o)).cloned().unwrap_or(Outcome::Stable)
        };
        let quiet: &dyn Fn(&Outcome) -> bool = &|o| *o == Outcome::Stable;
        let works: &dyn Fn(&Outcome) -> bool = &Outcome::works;
        for (name, good) in [("warned", quiet), ("ended", works)] {
            study.findings.push(Finding {
                case: format!("shaft, discs {t} m thick: {name}"),
                parameter: "height, m".into(),
                measured: sweep(good),
                theory: None,
                beyond: first(good),
            });
        }
    }
    study.charts.push(Chart {
        title: "Overlap under a column's own weight".into(),
        x: "kappa under the weight".into(),
        y: "largest overlap over the radius".into(),
        log: [true, true],
        curves: vec![
            Curve::measured("shafts", points),
            Curve::theory(
                "mean overlap at twice the weight",
                [1.0, 10.0, 100.0, 1000.0].map(|k| [k, theory(k)]).into(),
            ),
        ],
        caption: "Gravity is switched on at once.".into(),
    });
    study.maps.push(Map {
        title: "Shafts of packings".into(),
        x: Axis::new("height, m", heights),
        y: Axis::new("thickness, m", thicknesses.into()),
        numbers: rows.iter().map(|row| row.iter().map(|f| f.overlap).collect()).collect(),
        outcomes,
        caption: "Numbers: largest overlap over the radius.".into(),
    });
    let ran = |fall: &Fall| !fall.picture.position.is_empty();
    let worst = rows.into_iter().next_back().and_then(|row| row.into_iter().rev().find(ran));
    study.pictures.extend(worst.map(|fall| fall.picture));
    Ok(())
}
