//! Table 7: wall times of the test set.

use dempm::trajectory::Trajectory;
use miette::Result;

use super::networks::belongs;
use super::ratio;
use crate::block::{Block, Table};
use crate::context::{Context, Model, Start};
use crate::section::Section;
use crate::table::number;
use crate::wall_time::computing;

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
            [
                "case",
                "points: paper",
                "ours",
                "steps: paper",
                "ours",
                "paper, RTX 4090 [s]",
                "ours [s]",
                "ratio",
                "ours ran on",
            ],
        )
        .note(
            "Ours: all phases but the preparation of packings, which are kept. The paper does \
             not state its substeps and barrier sizes, and its GPU is another one. No ratio where \
             points or steps are not those of the paper.",
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
        .note(
            "Time of all predicted frames, graphs included. No ratio where the case is not that of \
             the paper.",
        );
        let cases = context.cases("test");
        let model = baseline(&context.models);
        let mut absent = Vec::new();
        // Ours and the paper's, of solver and network.
        let mut times = [Vec::new(), Vec::new()];
        for (case, points, steps, [dempm, tgnns, h800]) in TABLE_7 {
            let found = cases.iter().find(|(name, _)| name == case);
            let ours = found.map(|(_, path)| Trajectory::open(path)).transpose()?;
            if ours.is_none() {
                absent.push(case);
            }
            let size = ours.as_ref().map(size);
            let same = size == Some((points, steps));
            let time = ours.as_ref().map(computing);
            times[0].extend(time.filter(|_| same).map(|time| (time, dempm)));
            direct.row([
                case.to_owned(),
                points.to_string(),
                size.map_or(String::new(), |(points, _)| points.to_string()),
                steps.to_string(),
                size.map_or(String::new(), |(_, steps)| steps.to_string()),
                number(dempm),
                time.map_or(String::new(), number),
                ratio(Some(dempm), time.filter(|_| same)),
                ours.map_or(String::new(), |ours| ours.header().device.clone()),
            ]);
            let run = match (&model, found) {
                // For its time: others may have been made several at a time.
                (Some(model), Some((_, path))) => {
                    Some(context.rollout_again(model, &Start::Trajectory(path), 1)?)
                }
                _ => None,
            };
            // The time of a rollout that ended early says nothing.
            let ended = run.filter(|run| run.succeeded);
            let rollout = ended.map(|run| Trajectory::open(&run.output)).transpose()?;
            let time = rollout.as_ref().map(computing);
            times[1].extend(time.filter(|_| same).map(|time| (time, h800)));
            learned.row([
                case.to_owned(),
                number(tgnns),
                number(h800),
                time.map_or(String::new(), number),
                ratio(Some(h800), time.filter(|_| same)),
                model.as_ref().map_or(String::new(), |model| model.name.clone()),
                rollout.map_or(String::new(), |r| r.header().device.clone()),
            ]);
        }
        let mut blocks: Vec<Block> = Vec::new();
        let [solver, network] = times.map(|times| compared(&times));
        blocks.extend(solver.map(|words| {
            Block::headline(format!(
                "Direct solver: {words} on an RTX 4090, whose substeps are not stated."
            ))
        }));
        if let (Some(model), Some(words)) = (&model, network) {
            let name = &model.name;
            blocks.push(Block::headline(format!("Network `{name}`: {words} on an H800.")));
        }
        blocks.extend([Block::Table(direct), Block::Table(learned)]);
        if !absent.is_empty() {
            blocks.push(Block::missing(
                format!("Our time of {}", absent.join(", ")),
                "there is no such trajectory in `test/` of the data.",
                "`dempm dataset paper -o DATA` makes it; `--data DATA` takes it.",
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

/// The paper's network: the one that is not named after a data set, or else on the finest data.
pub fn baseline(models: &[Model]) -> Option<Model> {
    let all = models.iter().filter(|model| belongs(&model.name, "baseline"));
    all.min_by_key(|model| model.name.contains("-data")).cloned()
}

/// Our times (s) and how far they are from the paper's, in words.
fn compared(times: &[(f64, f64)]) -> Option<String> {
    let range = |value: fn(&(f64, f64)) -> f64| {
        let values = || times.iter().map(value);
        let least = values().reduce(f64::min)?;
        Some(format!("{} to {}", number(least), number(values().fold(least, f64::max))))
    };
    let (own, ratio) = (range(|(ours, _)| *ours)?, range(|(ours, paper)| paper / ours)?);
    Some(format!("{own} s, {ratio} times as fast as the paper's"))
}

/// Points and steps of a run.
fn size(trajectory: &Trajectory) -> (usize, usize) {
    let duration = trajectory.time().last().copied().unwrap_or_default();
    let steps = (duration / trajectory.header().time_step).round() as usize;
    (trajectory.points().mass.len(), steps)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_are_compared_case_by_case() {
        assert_eq!(compared(&[]), None);
        let words = compared(&[(2.0, 200.0), (4.0, 100.0)]).unwrap();
        assert_eq!(words, "2 to 4 s, 25 to 100 times as fast as the paper's");
    }
}
