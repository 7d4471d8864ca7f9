//! Fig. 9 to 14 and 17 to 22: rollouts of the validation and test cases.

use std::cmp::Ordering;
use std::collections::BTreeMap;
use std::path::PathBuf;

use surrogate::network::PAPER_NETWORKS;
use surrogate::simulator::Simulator;

use super::networks::{baseline_and_others, belongs, on_finest_data};
use super::ratio;
use super::times::baseline;
use crate::block::{Block, Table};
use crate::context::{Context, Model};
use crate::rollouts::{Rollout, animation, chart, failures, roll_out, snapshots, table};
use crate::section::Section;
use crate::table::number;

/// The paper's network on some cases, and beside it what is none of the paper's.
pub struct Cases {
    pub title: &'static str,
    /// Folder of the data.
    pub set: &'static str,
    /// Which cases of it; all if none.
    pub only: Option<fn(&str) -> bool>,
}

impl Section for Cases {
    fn title(&self) -> &'static str {
        self.title
    }

    fn run(&self, context: &mut Context) -> miette::Result<Vec<Block>> {
        let mut cases = context.cases(self.set);
        cases.retain(|(name, _)| self.only.is_none_or(|only| only(name)));
        let models = baseline_and_others(&context.models);
        let mut blocks = absent(&cases, &models, self.set);
        if !blocks.is_empty() {
            return Ok(blocks);
        }
        if baseline(&models).is_none() {
            blocks.push(Block::text("There is no model named `baseline`."));
        }
        // The first of them also with mirror images averaged, which the paper did not try.
        let mirrored = models.first().map(Model::mirrored);
        let ways: Vec<Model> = models.iter().cloned().chain(mirrored).collect();
        let rollouts = roll_out(context, &ways, &cases)?;
        blocks.push(Block::Table(table(&rollouts)));
        blocks.extend(failures(&rollouts));
        for (place, model) in drawn(&models, &rollouts).into_iter().enumerate() {
            let of_model: Vec<&Rollout> =
                rollouts.iter().filter(|rollout| rollout.model == model.name).collect();
            let title = format!("Error over time, {}", model.name);
            blocks.push(chart(&title, &of_model, None)?);
            for rollout in of_model {
                blocks.extend(snapshots(rollout)?);
                // Animations of one model are enough for a page.
                if place == 0 {
                    blocks.extend(animation(rollout)?);
                }
            }
        }
        Ok(blocks)
    }
}

/// The first of them, and the most accurate if that is another.
fn drawn<'m>(models: &'m [Model], rollouts: &[Rollout]) -> Vec<&'m Model> {
    let error = |model: &Model| mean_error(rollouts, &model.name);
    let best = models.iter().min_by(|a, b| error(a).total_cmp(&error(b)));
    let mut drawn: Vec<&Model> = models.first().into_iter().chain(best).collect();
    drawn.dedup_by_key(|model| &model.name);
    drawn
}

/// Mean error of a model over its rollouts; infinite if one of them ended early.
pub(super) fn mean_error(rollouts: &[Rollout], model: &str) -> f64 {
    let errors: Vec<f64> = rollouts
        .iter()
        .filter(|rollout| rollout.model == model)
        .map(|rollout| match &rollout.errors.failure {
            None if !rollout.errors.errors.is_empty() => rollout.errors.mean(),
            _ => f64::INFINITY,
        })
        .collect();
    errors.iter().sum::<f64>() / errors.len() as f64
}

/// Fig. 11 to 14: the ten networks on the validation cases.
pub struct Ablation;

impl Section for Ablation {
    fn title(&self) -> &'static str {
        "Fig. 11 to 14: ablation of ten networks"
    }

    fn run(&self, context: &mut Context) -> miette::Result<Vec<Block>> {
        let cases = context.cases("valid");
        // All on the finest data, and a training of its own goes before one that was made to be used.
        let trained = |name: &&str| {
            let of_name = context.models.iter().filter(|model| belongs(&model.name, name));
            let finest = of_name.filter(|model| on_finest_data(model));
            finest.min_by_key(|model| !model.name.ends_with("-data1")).cloned()
        };
        let models: Vec<Model> = PAPER_NETWORKS.iter().filter_map(trained).collect();
        let mut blocks = absent(&cases, &models, "valid");
        if !blocks.is_empty() {
            return Ok(blocks);
        }
        let rollouts = roll_out(context, &models, &cases)?;
        blocks.extend(ranking("Networks", &models, &rollouts)?);
        for (case, _) in &cases {
            let of_case: Vec<&Rollout> = rollouts.iter().filter(|r| r.case == *case).collect();
            blocks.push(chart(case, &of_case, None)?);
        }
        blocks.push(Block::Table(table(&rollouts)));
        // Why others ended early is in the table.
        blocks.extend(failures(rollouts.iter().filter(|rollout| rollout.is_refused())));
        let lacking: Vec<&str> = PAPER_NETWORKS
            .into_iter()
            .filter(|name| !models.iter().any(|model| belongs(&model.name, name)))
            .collect();
        if !lacking.is_empty() {
            blocks.push(Block::missing(
                lacking.join(", "),
                "there is no model of that name.",
                "`surrogate train configs/paper/NAME-data1.toml` trains one.",
            ));
        }
        Ok(blocks)
    }
}

/// Models by their mean error over the same cases, and whether they were trained for as long.
pub(super) fn ranking(
    title: &str,
    models: &[Model],
    rollouts: &[Rollout],
) -> miette::Result<Vec<Block>> {
    let cases = rollouts.iter().filter(|r| r.model == models[0].name).count();
    let horizon = first_end(rollouts);
    let mut table = Table::new(
        format!("{title} by mean error"),
        [
            "model",
            "parameters",
            "steps",
            "mean MSE",
            "times the best",
            "cases to the end",
            "mean MSE until one ended early",
        ],
    )
    .note(format!(
        "MSE in units of the box, mean over all cases and frames; none where a rollout ended early. {}",
        match horizon {
            Some(time) => format!(
                "The first to do so ended at {time:.2} s: errors until then can be compared."
            ),
            None => "None did.".to_owned(),
        }
    ));
    let mut ranked: Vec<Ranked> =
        models.iter().map(|model| Ranked::of(model, rollouts, horizon)).collect();
    ranked.sort_by(Ranked::compare);
    let mut steps = Vec::new();
    for Ranked { model, ended_well, error, early } in &ranked {
        let Simulator { config, training, .. } = Simulator::load(&model.path)?;
        table.row([
            model.name.clone(),
            config.parameter_count().to_string(),
            training.steps.to_string(),
            number(*error),
            number(error / ranked[0].error),
            format!("{ended_well} of {cases}"),
            early.map_or(String::new(), number),
        ]);
        steps.push(training.steps);
    }
    let budget = match (steps.iter().min(), steps.iter().max()) {
        (Some(least), Some(most)) if least == most => format!("after {most} steps each"),
        (Some(least), Some(most)) => format!("after {least} to {most} steps, which is not equal"),
        _ => return Ok(Vec::new()),
    };
    let all: Vec<&Ranked> = ranked.iter().filter(|ranked| ranked.error.is_finite()).collect();
    let words = match all.as_slice() {
        [best, .., worst] => format!(
            "Of {} trained networks {budget}, {} get through all validation cases: `{}` with the \
             smallest mean error ({} box²), `{}` with the largest ({} box²).",
            ranked.len(),
            all.len(),
            best.model.name,
            number(best.error),
            worst.model.name,
            number(worst.error)
        ),
        [one] => format!(
            "Of {} trained networks {budget}, only `{}` gets through all validation cases (mean \
             error {} box²).",
            ranked.len(),
            one.model.name,
            number(one.error)
        ),
        [] => {
            let most = &ranked[0];
            format!(
                "None of {} trained networks {budget} gets through all {cases} validation cases; \
                 `{}` gets through {}.",
                ranked.len(),
                most.model.name,
                most.ended_well
            )
        }
    };
    Ok(vec![Block::headline(words), Block::Table(table)])
}

/// A model among others.
struct Ranked<'m> {
    model: &'m Model,
    /// Rollouts that did not end early.
    ended_well: usize,
    /// Mean error; infinite if one of them did.
    error: f64,
    /// Mean error until the first of all models' rollouts ended early.
    early: Option<f64>,
}

impl<'m> Ranked<'m> {
    fn of(model: &'m Model, rollouts: &[Rollout], horizon: Option<f64>) -> Self {
        let own: Vec<&Rollout> = rollouts.iter().filter(|r| r.model == model.name).collect();
        let well = |r: &&&Rollout| r.errors.failure.is_none() && !r.is_refused();
        let until = |horizon: f64| {
            let errors = own.iter().flat_map(|r| &r.errors.errors);
            let mse: Vec<f64> = errors.filter(|e| e.time <= horizon).map(|e| e.mse).collect();
            (!mse.is_empty()).then(|| mse.iter().sum::<f64>() / mse.len() as f64)
        };
        Self {
            model,
            ended_well: own.iter().filter(well).count(),
            error: mean_error(rollouts, &model.name),
            early: horizon.and_then(until),
        }
    }

    /// The best first: by the mean error, or else by how many cases they get through.
    fn compare(&self, other: &Self) -> Ordering {
        let early = |ranked: &Self| ranked.early.unwrap_or(f64::INFINITY);
        self.error
            .total_cmp(&other.error)
            .then(other.ended_well.cmp(&self.ended_well))
            .then(early(self).total_cmp(&early(other)))
    }
}

/// Time (s) of the last frame of the rollout that ended first of those that ended early.
fn first_end(rollouts: &[Rollout]) -> Option<f64> {
    let early = rollouts.iter().filter(|rollout| rollout.errors.failure.is_some());
    let ends = early.filter_map(|rollout| Some(rollout.errors.errors.last()?.time));
    ends.min_by(f64::total_cmp)
}

/// The numbers that the paper's text states.
pub struct Stated;

/// Which error of a rollout.
#[derive(Clone, Copy)]
enum Which {
    Frame(usize),
    Peak,
    Last,
}

/// Frames of the truth that the paper gives its network.
const GIVEN: usize = 6;

/// Set, case, what, in words, and the paper's value, box width 1. For Col2x2 it says a quarter of
/// Col5x2's.
const STATED: [(&str, &str, Which, &str, f64); 4] = [
    ("valid", "case1", Which::Frame(50), "Case 1 at frame 50", 1e-6),
    ("test", "col5x2", Which::Peak, "Col5x2 at its peak", 1e-4),
    ("test", "col2x2", Which::Peak, "Col2x2 at its peak", 2.5e-5),
    ("test", "col3x3barriers", Which::Last, "Col3x3barriers at the end", 5e-5),
];

impl Section for Stated {
    fn title(&self) -> &'static str {
        "Accuracy stated in the paper's text"
    }

    fn run(&self, context: &mut Context) -> miette::Result<Vec<Block>> {
        let columns = ["quantity", "paper", "ours", "ratio", "network", "from frame"];
        let mut rows = Table::new("Stated accuracy", columns).note(
            "Mean square distance of points, box width 1. The paper's values are orders of \
                 magnitude; that of Col2x2 is a quarter of Col5x2's. From frame: the first that is predicted; a network with coarser frames \
                 is given more of the truth, and is judged at the next frame that it has.",
        );
        let models = baseline_and_others(&context.models);
        let mirrored = models.first().map(Model::mirrored);
        let models: Vec<Model> = models.into_iter().chain(mirrored).collect();
        let mut lacking = 0;
        let mut found: BTreeMap<String, Vec<Reached>> = BTreeMap::new();
        for (set, case, which, words, paper) in STATED {
            let mut cases = context.cases(set);
            cases.retain(|(name, _)| name == case);
            let rollouts = roll_out(context, &models, &cases)?;
            let mut row = |ours: Option<f64>, network: &str, from: String| {
                lacking += usize::from(ours.is_none());
                rows.row([
                    words.to_owned(),
                    number(paper),
                    ours.map_or(String::new(), number),
                    ratio(Some(paper), ours),
                    network.to_owned(),
                    from,
                ]);
            };
            if rollouts.is_empty() {
                row(None, "", String::new());
            }
            for rollout in &rollouts {
                let error = value(rollout, which);
                row(error, &rollout.model, rollout.first_frame());
                let given = rollout.errors.frames.first().is_some_and(|first| *first <= GIVEN);
                if let Some(error) = error.filter(|_| given) {
                    let reached = Reached { words, error, paper };
                    found.entry(rollout.model.clone()).or_default().push(reached);
                }
            }
        }
        let mut blocks: Vec<Block> = lead(&found).into_iter().collect();
        blocks.extend([
            Block::Table(rows),
            Block::text(
                "The paper also says that its network fails on tall columns (Col5x4, Col5x5), on \
                 the data set of 30 frames and on penetration.",
            ),
        ]);
        if lacking > 0 {
            blocks.push(Block::missing(
                format!("Our value of {lacking} of them"),
                "that takes a model, a rollout that does not end early, and the case's trajectory.",
                "See Table 7 for how to make a model and data.",
            ));
        }
        Ok(blocks)
    }
}

/// An error that the paper states, and ours.
struct Reached {
    words: &'static str,
    error: f64,
    paper: f64,
}

/// The network that comes nearest to the paper's errors, of those that start from as few frames and
/// have most of them.
fn lead(found: &BTreeMap<String, Vec<Reached>>) -> Option<Block> {
    let most = found.values().map(Vec::len).max()?;
    let excess = |all: &[Reached]| all.iter().map(|r| (r.error / r.paper).ln()).sum::<f64>();
    let (name, best) = found
        .iter()
        .filter(|(_, all)| all.len() == most)
        .min_by(|(_, a), (_, b)| excess(a).total_cmp(&excess(b)))?;
    let met = best.iter().filter(|r| r.error <= r.paper).count();
    let each = |r: &Reached| format!("{} {} (paper {})", r.words, number(r.error), number(r.paper));
    let all: Vec<String> = best.iter().map(each).collect();
    Some(Block::lead(
        "Accuracy",
        format!(
            "Of {most} errors that the paper's text states, `{name}` reaches {met}. Mean square \
             distance of points, box width 1: {}.",
            all.join("; ")
        ),
    ))
}

fn value(rollout: &Rollout, which: Which) -> Option<f64> {
    let errors = &rollout.errors;
    match which {
        Which::Frame(frame) => {
            let place = errors.frames.iter().position(|found| *found >= frame)?;
            Some(errors.errors[place].mse)
        }
        // A rollout that ended early has neither.
        _ if errors.failure.is_some() => None,
        Which::Peak => Some(errors.peak()?.0),
        Which::Last => Some(errors.last()?.mse),
    }
}

/// What to say where data or models are lacking.
fn absent(cases: &[(String, PathBuf)], models: &[Model], set: &str) -> Vec<Block> {
    let mut blocks = Vec::new();
    if cases.is_empty() {
        blocks.push(Block::missing(
            "This comparison",
            format!("there are no such trajectories in `{set}/` of the data."),
            "`dempm dataset paper -o DATA` makes them; `--data DATA` takes them.",
        ));
    }
    if models.is_empty() {
        blocks.push(Block::missing(
            "This comparison",
            "no such model was found.",
            "`surrogate train configs/paper/NAME-data1.toml` trains one; `--models` takes its folder.",
        ));
    }
    blocks
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_ends_early_comes_last_and_can_still_be_compared() {
        let rollouts = [
            Rollout::of_errors("early", &[1.0, 2.0], Some("pressed")),
            Rollout::of_errors("early", &[1.0, 2.0, 3.0], None),
            Rollout::of_errors("good", &[2.0, 2.0, 2.0], None),
            Rollout::of_errors("good", &[2.0, 2.0, 2.0], None),
            Rollout::of_errors("worse", &[3.0, 3.0, 3.0], Some("pressed")),
            Rollout::of_errors("worse", &[3.0, 3.0, 3.0], Some("pressed")),
            Rollout::of_errors("fair", &[1.0, 1.0, 9.0], None),
            Rollout::of_errors("fair", &[1.0, 1.0, 9.0], None),
        ];
        let horizon = first_end(&rollouts);
        assert_eq!(horizon, Some(0.1));
        let models =
            ["worse", "early", "fair", "good"].map(|n| Model::new(n.to_owned(), PathBuf::new()));
        let mut ranked: Vec<Ranked> =
            models.iter().map(|model| Ranked::of(model, &rollouts, horizon)).collect();
        ranked.sort_by(Ranked::compare);
        let found: Vec<_> = ranked
            .iter()
            .map(|r| (r.model.name.as_str(), r.ended_well, r.error, r.early))
            .collect();
        let expected = [
            ("good", 2, 2.0, Some(2.0)),
            ("fair", 2, 11.0 / 3.0, Some(1.0)),
            ("early", 1, f64::INFINITY, Some(1.5)),
            ("worse", 0, f64::INFINITY, Some(3.0)),
        ];
        assert_eq!(found, expected);
    }

    #[test]
    fn the_network_nearest_to_the_paper_leads() {
        let reached = |error| Reached { words: "a case", error, paper: 1e-4 };
        let found = [
            ("near", vec![reached(2e-4), reached(5e-5)]),
            ("far", vec![reached(1e-4), reached(1e-2)]),
            ("incomplete", vec![reached(1e-6)]),
        ];
        let found = found.map(|(name, all)| (name.to_owned(), all)).into();
        let Some(Block::Lead { answer, .. }) = lead(&found) else { panic!("no lead") };
        assert!(answer.contains("Of 2 errors") && answer.contains("`near` reaches 1"), "{answer}");
        assert!(lead(&BTreeMap::new()).is_none());
    }
}
