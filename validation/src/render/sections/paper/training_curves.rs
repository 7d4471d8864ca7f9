//! Fig. 8: training curves.

use plot::{Axis, Chart, Mark, Series};

use crate::context::Context;
use crate::models::{Model, is_of_paper, is_on_finest_data};
use crate::render::block::Block;
use crate::render::figure::{Figure, Picture};
use crate::render::section::Section;
use crate::studies::training_curves::{TrainingCurves as Curves, measure};

/// Loss and validation error over the steps of trainings.
pub struct TrainingCurves;

/// A quantity over training steps.
struct Quantity {
    title: &'static str,
    axis: &'static str,
    points: fn(&Curves) -> &Vec<(f64, f64)>,
    caption: &'static str,
    remedy: &'static str,
}

const QUANTITIES: [Quantity; 2] = [
    Quantity {
        title: "Validation error",
        axis: "mean MSE of validation rollouts [box²]",
        points: |curves| &curves.validation,
        caption: "Rollouts of all validation cases from their first frames; of intermediate weights, \
                  their first 1.5 s. Box width 1. A rollout that ended early counts as if it had stayed \
                  in place from then on.",
        remedy: "`surrogate train` validates where the data have `valid/`; intermediate weights in \
                 `NAME.stages/` beside `NAME.safetensors` are rolled out by the report.",
    },
    Quantity {
        title: "Loss",
        axis: "loss",
        points: |curves| &curves.loss,
        caption: "Losses of networks with different noise cannot be compared; rollouts can. The loss \
                  rises where a training begins to predict the frames of its windows itself \
                  (pushforward).",
        remedy: "`surrogate train` writes `log.csv`; beside `NAME.safetensors` it is `NAME.log.csv`.",
    },
];

/// The models that share a chart, and its title.
type Group = (&'static str, fn(&Model) -> bool);

const GROUPS: [Group; 2] = [
    ("the paper's networks", |model| is_of_paper(model) && is_on_finest_data(model)),
    ("other data and models", |model| !is_of_paper(model) || !is_on_finest_data(model)),
];

impl Section for TrainingCurves {
    fn title(&self) -> &'static str {
        "Fig. 8: training curves"
    }

    fn lead(&self) -> &'static str {
        "Loss and validation error of each network during its training."
    }

    fn run(&self, context: &mut Context) -> miette::Result<Vec<Block>> {
        let curves = measure(context)?;
        let mut blocks = Vec::new();
        for quantity in &QUANTITIES {
            // One point is no curve.
            let shown = |curves: &&Curves| (quantity.points)(curves).len() > 1;
            if !curves.iter().any(|curves| shown(&curves)) {
                let why = "no model came with it.";
                blocks.push(Block::missing(quantity.title, why, quantity.remedy));
            }
            for (group, belongs) in GROUPS {
                let of_group = curves.iter().filter(|curves| belongs(&curves.model)).filter(shown);
                let series: Vec<Series> = of_group
                    .map(|curves| {
                        let points = (quantity.points)(curves).clone();
                        Series::new(&curves.model.name, Mark::Line, points)
                    })
                    .collect();
                if !series.is_empty() {
                    blocks.push(Block::Figure(figure(quantity, group, series)?));
                }
            }
        }
        Ok(blocks)
    }
}

fn figure(quantity: &Quantity, group: &str, series: Vec<Series>) -> miette::Result<Figure> {
    let (x, y) = (Axis::linear("step"), Axis::log(quantity.axis));
    let svg = Chart { x, y, series, floor: None }.svg()?;
    let title = format!("{} over training steps: {group}", quantity.title);
    Ok(Figure::new(title, Picture::Svg(svg), quantity.caption))
}
