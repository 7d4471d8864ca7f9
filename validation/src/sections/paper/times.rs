//! Table 7: wall times of the test set.

use dempm::trajectory::Trajectory;
use miette::Result;

use super::networks::belongs;
use super::ratio;
use crate::block::{Block, Table};
use crate::context::{Context, Model};
use crate::rollouts::roll_out;
use crate::section::Section;
use crate::table::number;

/// Wall times of solver and network.
pub struct Times;

/// Case, points, steps, and seconds: DEMPM on an RTX 4090, TGNNS on an RTX 4090 and on an H800.
const TABLE_7: [(&str, usize, usize, [f64; 3]); 8] = [
    ("col2x2", 1024, 30_000, [325.0, 4.8, 3.2]),
    ("col2x2twins", 2048, 30_000, [639.0, 7.6, 5.1]),
    ("col5x2", 2560, 30_000, [948.0, 9.3, 6.0]),
    ("col10x2", 5120, 30_000, [1718.0, 16.5, 11.0]),
    ("col5x3", 3840, 30_000, [1370.0, 13.3, 8.4]),
    ("col5x4", 5120, 50_000, [1614.0, 28.3, 17.9]),
    ("col5x5", 6400, 50_000, [2299.0, 35.2, 22.2]),
    ("col3x3barriers", 2304, 30_000, [962.0, 10.0, 6.6]),
];

impl Section for Times {
    fn title(&self) -> &'static str {
        "Table 7: wall times of the test set"
    }

    fn run(&self, context: &mut Context) -> Result<Vec<Block>> {
        let mut direct = Table::new(
            "Direct solver",
            ["case", "points", "steps", "paper, RTX 4090 [s]", "ours [s]", "ratio", "ours ran on"],
        )
        .note(
            "Ours: all phases but the preparation of packings, which are kept. The paper does \
                   not state its substeps and barrier sizes, and its GPU is another one.",
        );
        let mut learned = Table::new(
            "Surrogate",
            [
                "case",
                "paper, RTX 4090 [s]",
                "paper, H800 [s]",
                "ours [s]",
                "ratio to H800",
                "network",
                "ours ran on",
            ],
        )
        .note("Time of all predicted frames, graphs included.");
        let trajectories = context.trajectories("test");
        let model = baseline(&context.models);
        let mut absent = Vec::new();
        for (case, points, steps, [dempm, tgnns, h800]) in TABLE_7 {
            let path = trajectories.iter().find(|path| path.file_stem().is_some_and(|s| s == case));
            let ours = path.map(|path| direct_time(path)).transpose()?;
            if ours.is_none() {
                absent.push(case);
            }
            let (time, device) = ours.unzip();
            direct.row([
                case.to_owned(),
                points.to_string(),
                steps.to_string(),
                number(dempm),
                time.map_or(String::new(), number),
                ratio(Some(dempm), time),
                device.unwrap_or_default(),
            ]);
            let rollout = match (&model, path) {
                (Some(model), Some(path)) => {
                    roll_out(context, std::slice::from_ref(model), std::slice::from_ref(path))?
                        .pop()
                }
                _ => None,
            };
            let time = rollout.as_ref().map(|r| r.seconds).filter(|_| {
                // The time of a rollout that ended early says nothing.
                rollout.as_ref().is_some_and(|r| r.message.is_empty())
            });
            learned.row([
                case.to_owned(),
                number(tgnns),
                number(h800),
                time.map_or(String::new(), number),
                ratio(Some(h800), time),
                rollout.as_ref().map_or(String::new(), |r| r.model.clone()),
                rollout.as_ref().map_or(String::new(), |r| r.device.clone()),
            ]);
        }
        let mut blocks = vec![Block::Table(direct), Block::Table(learned)];
        if !absent.is_empty() {
            blocks.push(Block::missing(
                format!("Our time of {}", absent.join(", ")),
                "there is no such trajectory in `test/` of the data.",
                "`dempm run scenes/paper/test/NAME.toml -o DATA/test/NAME.h5`, then `--data DATA`.",
            ));
        }
        if model.is_none() {
            blocks.push(Block::missing(
                "The surrogate's times",
                "no model named `baseline` or `baseline-data1` was found.",
                "`surrogate train configs/paper/baseline-data1.toml` trains it.",
            ));
        }
        Ok(blocks)
    }
}

/// The paper's network, on the finest data there is.
pub fn baseline(models: &[Model]) -> Option<Model> {
    models.iter().find(|model| belongs(&model.name, "baseline")).cloned()
}

/// Seconds of the computation, and the device.
fn direct_time(path: &std::path::Path) -> Result<(f64, String)> {
    let trajectory = Trajectory::open(path)?;
    let phases = trajectory.wall_time().iter().filter(|(phase, _)| *phase != "preparation");
    Ok((phases.map(|(_, seconds)| seconds).sum(), trajectory.header().device.clone()))
}
