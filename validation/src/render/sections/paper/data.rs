//! Tables 2 to 5: data sets and cases.

use surrogate::train::TrainConfig;

use super::absent::MAKE_DATA;
use super::cells::ratio;
use crate::context::Context;
use crate::literature::paper::{DATA_SETS, TRAJECTORIES};
use crate::render::block::Block;
use crate::render::section::Section;
use crate::render::table::Table;
use crate::text::number;

/// What the networks are trained on.
pub struct Data;

/// Our training files for the five data sets.
const CONFIGS: [&str; 5] = [
    include_str!("../../../../../configs/paper/baseline-data1.toml"),
    include_str!("../../../../../configs/paper/baseline-data2.toml"),
    include_str!("../../../../../configs/paper/baseline-data3.toml"),
    include_str!("../../../../../configs/paper/baseline-data4.toml"),
    include_str!("../../../../../configs/paper/baseline-data5.toml"),
];

/// Solver steps between frames of our scenes.
const STEPS_PER_FRAME: f64 = 100.0;
/// Frames of our trajectories.
const FRAMES: f64 = 300.0;

impl Section for Data {
    fn title(&self) -> &'static str {
        "Tables 2 to 5: data"
    }

    fn lead(&self) -> &'static str {
        "The trajectories for training, validation and test, and their five resolutions in time."
    }

    fn run(&self, context: &mut Context) -> miette::Result<Vec<Block>> {
        let (files, complete) = trajectories(context);
        let mut blocks = vec![
            Block::Table(resolutions()?),
            Block::Table(files),
            Block::missing(
                "Other entries of Tables 2 to 5",
                "the project's record of the paper does not have them.",
                "",
            ),
        ];
        if !complete {
            blocks.push(Block::missing(
                "Part of the paper's trajectories",
                "they are not in the folder of the data.",
                MAKE_DATA,
            ));
        }
        Ok(blocks)
    }
}

fn resolutions() -> miette::Result<Table> {
    let mut table = Table::new("Data sets", ["data set", "quantity", "paper", "ours", "ratio"])
        .note("Ours: from `configs/paper/` and the scenes, whose frames are 100 steps apart.");
    for (paper, text) in DATA_SETS.iter().zip(CONFIGS) {
        let config: TrainConfig = toml::from_str(text).map_err(|e| miette::miette!("{e}"))?;
        let stride = config.data.stride as f64;
        for (quantity, paper_value, ours) in [
            ("steps between frames", paper.steps_per_frame, STEPS_PER_FRAME * stride),
            ("frames", paper.frames, FRAMES / stride),
        ] {
            let names = [paper.name, quantity].map(str::to_owned).into_iter();
            let values = [number(paper_value), number(ours), ratio(Some(paper_value), Some(ours))];
            table.row(names.chain(values));
        }
    }
    Ok(table)
}

/// Numbers of trajectories, and whether none is missing.
fn trajectories(context: &Context) -> (Table, bool) {
    let mut table = Table::new("Trajectories", ["set", "paper", "found", "ratio"])
        .note("Nine tests: the eight of Table 7 and the penetration.");
    let mut complete = true;
    for (set, count) in TRAJECTORIES {
        let found = context.trajectories(set).len();
        complete &= found >= count;
        let [count, found] = [count, found].map(|count| count as f64);
        let values = [number(count), number(found), ratio(Some(count), Some(found))];
        table.row(std::iter::once(set.to_owned()).chain(values));
    }
    (table, complete)
}
