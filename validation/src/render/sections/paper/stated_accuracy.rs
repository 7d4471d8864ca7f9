//! The errors that the paper's text states.

use super::cells::ratio;
use crate::context::Context;
use crate::render::block::Block;
use crate::render::section::Section;
use crate::render::table::Table;
use crate::studies::stated_accuracy::{Nearest, Reached, measure, nearest};
use crate::text::{length, number};

/// The errors that the paper's text states.
pub struct StatedAccuracy;

impl Section for StatedAccuracy {
    fn title(&self) -> &'static str {
        "Accuracy stated in the paper's text"
    }

    fn lead(&self) -> &'static str {
        "The errors that the paper gives in numbers, beside those of our networks."
    }

    fn run(&self, context: &mut Context) -> miette::Result<Vec<Block>> {
        let all = measure(context)?;
        let mut blocks = nearest(&all).map_or(Vec::new(), |nearest| leads(&nearest).into());
        blocks.extend([
            Block::Table(table(&all)),
            Block::text(
                "The paper also says that its network fails on tall columns (Col5x4, Col5x5), on \
                 the data set of 30 frames and on penetration.",
            ),
        ]);
        let lacking = all.iter().filter(|reached| reached.error.is_none()).count();
        if lacking > 0 {
            blocks.push(Block::missing(
                format!("Our value of {lacking} of them"),
                "it needs a model, a rollout that does not end early, and the case's trajectory.",
                "See Table 7 for how to make models and data.",
            ));
        }
        Ok(blocks)
    }
}

/// The main result in metres, and in the paper's unit.
fn leads(nearest: &Nearest) -> [Block; 2] {
    let count = nearest.reached.len();
    let [ours, paper] = nearest.worst().unwrap_or([f64::NAN; 2]).map(length);
    let each = |r: &&Reached| {
        let error = r.error.map_or(String::new(), number);
        format!("{} {error} (paper {})", r.paper.words, number(r.paper.mse))
    };
    let all: Vec<String> = nearest.reached.iter().map(each).collect();
    [
        Block::lead(
            "Accuracy",
            format!(
                "In the {count} moments for which the paper states an error, the points that the \
                 network predicts are at most {ours} from the solver's (root mean square), where the \
                 paper's network is {paper} off."
            ),
        ),
        Block::headline(format!(
            "Of {count} errors that the paper's text states, `{}` reaches {}. Mean square distance of \
             points from the solver's, box width 1: {}.",
            nearest.network,
            nearest.met(),
            all.join("; ")
        )),
    ]
}

fn table(all: &[Reached]) -> Table {
    let columns = ["quantity", "paper", "ours", "ratio", "network", "from frame"];
    let mut table = Table::new("Stated accuracy", columns).note(
        "Mean square distance of points from the solver's, box width 1. The paper's values are orders of magnitude; that \
         of Col2x2 is a quarter of Col5x2's. From frame: the first predicted frame; a network with \
         coarser frames is given more of the solver's run, and is judged at the next frame that it has.",
    );
    for Reached { paper, network, error, first_frame, .. } in all {
        table.row([
            paper.words.to_owned(),
            number(paper.mse),
            error.map_or(String::new(), number),
            ratio(Some(paper.mse), *error),
            network.clone(),
            first_frame.clone(),
        ]);
    }
    table
}
