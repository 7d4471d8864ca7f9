//! Table 7: wall times of the test set.

use super::absent::MAKE_DATA;
use super::cells::ratio;
use crate::context::Context;
use crate::render::block::Block;
use crate::render::section::Section;
use crate::render::table::Table;
use crate::studies::statistics::range;
use crate::studies::wall_times::{CaseTimes, WallTimes as Measurement, measure};
use crate::text::number;

/// Wall times of the solver and the network.
pub struct WallTimes;

impl Section for WallTimes {
    fn title(&self) -> &'static str {
        "Table 7: wall times of the test set"
    }

    fn lead(&self) -> &'static str {
        "How long solver and network take on eight test scenes, beside the paper's times."
    }

    fn run(&self, context: &mut Context) -> miette::Result<Vec<Block>> {
        let times = measure(context)?;
        let mut blocks = headlines(&times);
        blocks.extend([Block::Table(solver(&times.cases)), Block::Table(network(&times))]);
        let absent: Vec<&str> =
            times.cases.iter().filter(|c| c.solver.is_none()).map(|c| c.paper.case).collect();
        if !absent.is_empty() {
            blocks.push(Block::missing(
                format!("Our time of {}", absent.join(", ")),
                "there is no such trajectory in `test/` of the data.",
                MAKE_DATA,
            ));
        }
        if times.model.is_none() {
            blocks.push(Block::missing(
                "The network's times",
                "no model named `baseline` or `baseline-data1` was found.",
                "`surrogate train configs/paper/baseline-data1.toml` trains it.",
            ));
        }
        Ok(blocks)
    }
}

fn headlines(times: &Measurement) -> Vec<Block> {
    let comparable = || times.cases.iter().filter(|case| case.is_comparable());
    let solver: Vec<(f64, f64)> = comparable()
        .filter_map(|case| Some((case.solver.as_ref()?.timed.seconds, case.paper.solver)))
        .collect();
    let network: Vec<(f64, f64)> = comparable()
        .filter_map(|case| Some((case.network.as_ref()?.seconds, case.paper.network_h800)))
        .collect();
    let mut blocks = Vec::new();
    if let Some(words) = compared(&solver) {
        blocks.push(Block::headline(format!(
            "Direct solver: {words} on an RTX 4090, whose substeps are not stated."
        )));
    }
    if let (Some(model), Some(words)) = (&times.model, compared(&network)) {
        blocks.push(Block::headline(format!("Network `{}`: {words} on an H800.", model.name)));
    }
    blocks
}

/// Our times (s) and their ratios to the paper's, in words; `None` of nothing.
fn compared(times: &[(f64, f64)]) -> Option<String> {
    let own = range(times.iter().map(|(ours, _)| *ours))?.map(number);
    let ratio = range(times.iter().map(|(ours, paper)| paper / ours))?.map(number);
    Some(format!(
        "{} to {} s, {} to {} times as fast as the paper's",
        own[0], own[1], ratio[0], ratio[1]
    ))
}

fn solver(cases: &[CaseTimes]) -> Table {
    let columns = [
        "case",
        "points: paper",
        "ours",
        "steps: paper",
        "ours",
        "paper, RTX 4090 [s]",
        "ours [s]",
        "ratio",
        "ours ran on",
    ];
    let mut table = Table::new("Direct solver", columns).note(
        "Ours: all phases but the preparation of packings, which are kept. The paper does not state \
         its substeps and barrier sizes, and its GPU is another one. No ratio where points or steps \
         differ from the paper's.",
    );
    for case in cases {
        let (paper, ours) = (case.paper, case.solver.as_ref());
        let seconds = ours.map(|ours| ours.timed.seconds);
        table.row([
            paper.case.to_owned(),
            paper.points.to_string(),
            ours.map_or(String::new(), |ours| ours.points.to_string()),
            paper.steps.to_string(),
            ours.map_or(String::new(), |ours| ours.steps.to_string()),
            number(paper.solver),
            seconds.map_or(String::new(), number),
            ratio(Some(paper.solver), seconds.filter(|_| case.is_comparable())),
            ours.map_or(String::new(), |ours| ours.timed.device.clone()),
        ]);
    }
    table
}

fn network(times: &Measurement) -> Table {
    let columns = [
        "case",
        "paper, RTX 4090 [s]",
        "paper, H800 [s]",
        "ours [s]",
        "ratio to H800",
        "network",
        "ours ran on",
    ];
    let mut table = Table::new("Surrogate", columns).note(
        "Time of all predicted frames, graphs included. No ratio where the case differs from the \
         paper's.",
    );
    for case in &times.cases {
        let seconds = case.network.as_ref().map(|ours| ours.seconds);
        table.row([
            case.paper.case.to_owned(),
            number(case.paper.network_rtx_4090),
            number(case.paper.network_h800),
            seconds.map_or(String::new(), number),
            ratio(Some(case.paper.network_h800), seconds.filter(|_| case.is_comparable())),
            times.model.as_ref().map_or(String::new(), |model| model.name.clone()),
            case.network.as_ref().map_or(String::new(), |ours| ours.device.clone()),
        ]);
    }
    table
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
