//! Tables 2 to 5: data sets and cases.

use surrogate::train::TrainConfig;

use super::{ratio, stated};
use crate::block::{Block, Table};
use crate::context::Context;
use crate::section::Section;

/// What the networks learn from.
pub struct Data;

/// Data sets: name, every n-th step, frames of a trajectory, and our training file.
const DATA_SETS: [(&str, f64, f64, &str); 5] = [
    ("1", 100.0, 300.0, include_str!("../../../../configs/paper/baseline-data1.toml")),
    ("2", 200.0, 150.0, include_str!("../../../../configs/paper/baseline-data2.toml")),
    ("3", 300.0, 100.0, include_str!("../../../../configs/paper/baseline-data3.toml")),
    ("4", 600.0, 50.0, include_str!("../../../../configs/paper/baseline-data4.toml")),
    ("5", 1000.0, 30.0, include_str!("../../../../configs/paper/baseline-data5.toml")),
];

/// Our frames are this many steps apart, and there are this many.
const STEPS_PER_FRAME: f64 = 100.0;
const FRAMES: f64 = 300.0;

/// Files of the sets of data.
const SETS: [(&str, f64); 3] = [("train", 25.0), ("valid", 5.0), ("test", 9.0)];

impl Section for Data {
    fn title(&self) -> &'static str {
        "Tables 2 to 5: data"
    }

    fn run(&self, context: &mut Context) -> miette::Result<Vec<Block>> {
        let mut resolutions =
            Table::new("Data sets", ["data set", "quantity", "paper", "ours", "ratio"]).note(
                "Ours: from `configs/paper/` and the scenes, whose frames are 100 steps apart.",
            );
        for (name, steps, frames, text) in DATA_SETS {
            let config: TrainConfig = toml::from_str(text).map_err(|e| miette::miette!("{e}"))?;
            let stride = config.data.stride as f64;
            for (quantity, paper, ours) in [
                ("steps between frames", steps, STEPS_PER_FRAME * stride),
                ("frames", frames, FRAMES / stride),
            ] {
                let [first, second] = [paper, ours].map(|value| stated(Some(value)));
                let cells = [name.to_owned(), quantity.to_owned(), first, second];
                resolutions.row(cells.into_iter().chain([ratio(Some(paper), Some(ours))]));
            }
        }
        let mut files = Table::new("Trajectories", ["set", "paper", "found", "ratio"])
            .note("Nine tests: the eight of Table 7 and the penetration.");
        let mut absent = false;
        for (set, count) in SETS {
            let found = context.trajectories(set).len() as f64;
            absent |= found < count;
            let cells = [set.to_owned(), stated(Some(count)), stated(Some(found))];
            files.row(cells.into_iter().chain([ratio(Some(count), Some(found))]));
        }
        let mut blocks = vec![
            Block::Table(resolutions),
            Block::Table(files),
            Block::missing(
                "Other entries of Tables 2 to 5",
                "the project's record of the paper does not state them.",
                "",
            ),
        ];
        if absent {
            blocks.push(Block::missing(
                "Part of the paper's trajectories",
                "they are not in the folder of the data.",
                "`dempm dataset paper -o DATA` makes them; `--data DATA` takes them.",
            ));
        }
        Ok(blocks)
    }
}
