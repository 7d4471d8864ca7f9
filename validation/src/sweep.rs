//! One scene with many methods and settings: what each costs and how wrong it is.

use std::path::Path;

use dempm::trajectory::Trajectory;
use miette::Context as _;
use toml::Value;

use crate::compare::difference;
use crate::context::{Context, Start, Suite};
use crate::pareto::Cost;
use crate::scene::with;
use crate::work::Run;

/// A kind of method.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Family {
    /// A packing in every point.
    Packings,
    /// The mu(I) law.
    Continuum,
    /// A learned simulator.
    Network,
}

/// A scene, its reference and the settings that are tried on it.
pub struct Case {
    /// Name of the scene in the report.
    pub name: &'static str,
    /// What is simulated, in words.
    pub description: &'static str,
    /// Scene with the settings of the reference, which runs with two seeds.
    reference: String,
    /// Names and scenes of the settings.
    settings: Vec<(Family, String, String)>,
    /// How far the column is and how high, m: what errors are relative to.
    start: [f64; 2],
}

/// A method and what came out.
#[derive(Clone, Debug)]
pub struct Measured {
    pub family: Family,
    pub name: String,
    /// Wall time of the computation without preparing packings and writing files, s.
    pub seconds: f64,
    /// Errors; none if it failed.
    pub error: Option<Error>,
    /// Why it failed, in the words of the program.
    pub failure: String,
    pub device: String,
}

/// Errors against the reference, the mean of those against its two seeds.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
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
}

impl Case {
    /// The small column: minutes on two cores.
    pub fn quick() -> Self {
        // Half of the collapse of the demo column: the whole would take twice as long.
        let base = with(
            include_str!("../../scenes/column.toml"),
            &[
                ("duration", 0.6.into()),
                ("rve.discs", 400.into()),
                ("output.fields", Value::Array(vec![])),
            ],
        );
        let packings: Vec<Change> = vec![
            ("200 discs", vec![("rve.discs", 200.into())]),
            ("100 discs", vec![("rve.discs", 100.into())]),
            ("50 discs", vec![("rve.discs", 50.into())]),
            (
                "100 discs + f64",
                vec![("rve.discs", 100.into()), ("material.precision", "f64".into())],
            ),
            (
                "100 discs + long substeps",
                vec![("rve.discs", 100.into()), ("rve.step_factor", 0.4.into())],
            ),
            (
                "50 discs + long substeps",
                vec![("rve.discs", 50.into()), ("rve.step_factor", 0.4.into())],
            ),
            (
                "100 discs + mass x 10",
                vec![("rve.discs", 100.into()), ("rve.mass_scale", 10.0.into())],
            ),
            (
                "100 discs + mass x 100",
                vec![("rve.discs", 100.into()), ("rve.mass_scale", 100.0.into())],
            ),
            (
                "100 discs + cells of 0.25 m",
                vec![("rve.discs", 100.into()), ("domain.cell", 0.25.into())],
            ),
        ];
        Self::new(
            "Column, 1 m",
            "the first 0.6 s of the collapse of a column of 1 m x 1 m (256 points, \
             `scenes/column.toml`)",
            &base,
            packings,
            [1.0, 1.0],
        )
    }

    /// Scenes of the paper, with all settings.
    pub fn full() -> Vec<Self> {
        let scene = |text: &str| with(text, &[("output.fields", Value::Array(vec![]))]);
        let packings = || -> Vec<Change> {
            vec![
                ("800 discs", vec![("rve.discs", 800.into())]),
                ("200 discs", vec![("rve.discs", 200.into())]),
                ("100 discs", vec![("rve.discs", 100.into())]),
                ("f64", vec![("material.precision", "f64".into())]),
                ("long substeps", vec![("rve.step_factor", 0.4.into())]),
                ("short substeps", vec![("rve.step_factor", 0.1.into())]),
                (
                    "100 discs + long substeps",
                    vec![("rve.discs", 100.into()), ("rve.step_factor", 0.4.into())],
                ),
                ("mass x 10", vec![("rve.mass_scale", 10.0.into())]),
                ("mass x 100", vec![("rve.mass_scale", 100.0.into())]),
                (
                    "100 discs + mass x 10",
                    vec![("rve.discs", 100.into()), ("rve.mass_scale", 10.0.into())],
                ),
                ("step 0.05 ms", vec![("step", 5e-5.into())]),
                ("step 0.2 ms", vec![("step", 2e-4.into())]),
                ("step 0.5 ms", vec![("step", 5e-4.into())]),
                ("cells of 0.25 m", vec![("domain.cell", 0.25.into())]),
                ("cells of 0.0625 m", vec![("domain.cell", 0.0625.into())]),
                (
                    "100 discs + cells of 0.25 m",
                    vec![("rve.discs", 100.into()), ("domain.cell", 0.25.into())],
                ),
            ]
        };
        vec![
            Self::new(
                "Col2x2",
                "a column of 2 m x 2 m, 1024 points, 3 s",
                &scene(include_str!("../../scenes/paper/test/col2x2.toml")),
                packings(),
                [2.0, 2.0],
            ),
            Self::new(
                "Col5x3",
                "a column of 5 m x 3 m, 3840 points, 3 s",
                &scene(include_str!("../../scenes/paper/test/col5x3.toml")),
                packings(),
                [5.0, 3.0],
            ),
        ]
    }

    fn new(
        name: &'static str,
        description: &'static str,
        base: &str,
        packings: Vec<Change>,
        start: [f64; 2],
    ) -> Self {
        // Another seed than those of the reference: no setting shares its packing.
        let base_of_settings = with(base, &[("seed", SEEDS[2].into())]);
        let mut settings: Vec<(Family, String, String)> = packings
            .into_iter()
            .map(|(name, changes)| {
                (Family::Packings, name.to_owned(), with(&base_of_settings, &changes))
            })
            .collect();
        for cell in [0.25, 0.125, 0.0625] {
            let changes = [("material.kind", "mu-i".into()), ("domain.cell", cell.into())];
            let name = format!("mu(I) + cells of {cell} m");
            settings.push((Family::Continuum, name, with(&base_of_settings, &changes)));
        }
        let reference = base.to_owned();
        Self { name, description, reference, settings, start }
    }

    /// The cases of a suite.
    pub fn of(suite: Suite) -> Vec<Self> {
        let mut cases = vec![Self::quick()];
        if suite == Suite::Full {
            cases.extend(Self::full());
        }
        cases
    }

    /// What the reference is computed with, in words.
    pub fn reference_name(&self) -> &'static str {
        "400 discs, f32, step 0.1 ms, cells of 0.125 m"
    }

    fn references(&self) -> [String; 2] {
        [SEEDS[0], SEEDS[1]].map(|seed| with(&self.reference, &[("seed", seed.into())]))
    }

    /// Estimated time of what is not there yet, s.
    pub fn estimate(&self, context: &Context) -> f64 {
        let settings = self.settings.iter().map(|(_, _, scene)| context.estimate(scene));
        settings.chain(self.references().iter().map(|scene| context.estimate(scene))).sum()
    }

    /// Runs the reference with both seeds, where that has not been done.
    ///
    /// # Errors
    /// If one fails or the user interrupts.
    pub fn run_references(&self, context: &mut Context) -> miette::Result<[Run; 2]> {
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

    /// Runs what is missing and compares everything with the reference.
    ///
    /// # Errors
    /// If the reference fails, a file cannot be read or the user interrupts.
    pub fn measure(&self, context: &mut Context) -> miette::Result<Sweep> {
        let references = self.run_references(context)?;
        let paths: Vec<&Path> = references.iter().map(|run| run.output.as_path()).collect();
        let floor = error(paths[0], &paths[1..])?;
        let mut measured = vec![Measured {
            family: Family::Packings,
            name: "400 discs (reference)".to_owned(),
            error: Some(floor),
            ..measured(Family::Packings, "", &references[0])?
        }];
        for (family, name, scene) in &self.settings {
            let run = context.run(&format!("{}: {name}", self.name), scene)?;
            measured.push(self.compared(*family, name, &run, &paths)?);
        }
        let scene = with(&self.reference, &[("seed", SEEDS[2].into())]);
        for model in context.models.clone() {
            let run = context.rollout(&model, &Start::Scene(&scene))?;
            measured.push(self.compared(Family::Network, &model.name, &run, &paths)?);
        }
        let fronts: Vec<f64> =
            paths.iter().map(|path| front(path)).collect::<miette::Result<_>>()?;
        let front = 0.5 * (fronts[0] + fronts[1]);
        let [width, height] = self.start;
        Ok(Sweep { measured, floor, front, runout: front - width, height })
    }

    fn compared(
        &self,
        family: Family,
        name: &str,
        run: &Run,
        references: &[&Path],
    ) -> miette::Result<Measured> {
        if !run.succeeded {
            return Ok(Measured {
                family,
                name: name.to_owned(),
                seconds: f64::NAN,
                error: None,
                failure: run.message.clone(),
                device: String::new(),
            });
        }
        let error = error(&run.output, references)?;
        Ok(Measured { error: Some(error), ..measured(family, name, run)? })
    }
}

/// A setting: its name, and keys of the scene with their values.
type Change = (&'static str, Vec<(&'static str, Value)>);

/// Seeds of the two references and of everything else.
const SEEDS: [i64; 3] = [1, 2, 3];

/// The time of a run and where it ran.
fn measured(family: Family, name: &str, run: &Run) -> miette::Result<Measured> {
    let trajectory = Trajectory::open(&run.output)?;
    // Packings are prepared once and kept; the first frames of a rollout are simulated each time.
    let counts = |phase: &str| family == Family::Network || phase != "preparation";
    let phases = trajectory.wall_time().iter().filter(|(phase, _)| counts(phase));
    Ok(Measured {
        family,
        name: name.to_owned(),
        seconds: phases.map(|(_, seconds)| seconds).sum(),
        error: None,
        failure: String::new(),
        device: trajectory.header().device.clone(),
    })
}

/// Mean errors against some references.
fn error(path: &Path, references: &[&Path]) -> miette::Result<Error> {
    let mut mean = Error::default();
    let part = 1.0 / references.len() as f64;
    for reference in references {
        let errors = difference(path, reference)?;
        let width = Trajectory::open(reference)?.header().domain[0];
        let last = errors.last();
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
