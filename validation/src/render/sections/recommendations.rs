//! The cheapest setting within a tolerance, scene by scene.

use crate::context::Context;
use crate::render::block::Block;
use crate::render::section::Section;
use crate::render::table::Table;
use crate::studies::recommendations::{Choice, GOALS, Recommendation, TOLERANCES, cost, recommend};
use crate::studies::sweep::{Case, Sweep};
use crate::text::{number, percent, seconds};

/// The cheapest setting of each scene.
pub struct Recommendations;

impl Section for Recommendations {
    fn title(&self) -> &'static str {
        "The cheapest setting of each scene"
    }

    fn lead(&self) -> &'static str {
        "The cheapest solver, and the cheapest network, for each scene and tolerance."
    }

    fn run(&self, context: &mut Context) -> miette::Result<Vec<Block>> {
        let mut sweeps = Vec::new();
        let mut absent = Vec::new();
        for case in Case::of_speed(context.suite) {
            if case.missing(context).is_empty() {
                sweeps.push((case.scene.name, case.measure_speed(context)?));
            } else {
                absent.push(case.scene.name);
            }
        }
        let mut blocks = blocks(&sweeps);
        if !absent.is_empty() {
            blocks.push(Block::missing(
                absent.join(", "),
                "not all settings have been measured.",
                "`--only` with the scene's name measures them.",
            ));
        }
        Ok(blocks)
    }
}

fn blocks(sweeps: &[(&str, Sweep)]) -> Vec<Block> {
    let columns =
        ["scene", "goal", "tolerance", "setting", "error", "cost [s]", "cost of the discs [s]"];
    let mut table = Table::new("Recommendations", columns).note(
        "Solvers: discs of any size, packings, mu(I) law. Errors are those against the discs, relative to the \
         runout. Cost is processor time where all ran on processors, else wall time: of four equal runs at \
         once on two cores, the wall time was 3.6 times that of one alone, the processor time 1.2 times.",
    );
    let mut networks = Table::new("Networks that are cheaper", columns)
        .note("Where the cheapest of all is a network. Table 6 has its training data.");
    let (mut unmet, mut enough) = (Vec::new(), Vec::new());
    for (scene, sweep) in sweeps {
        let reference = cost(sweep)(&sweep.measured[0]);
        for found in recommend(sweep) {
            let row = |choice: Choice| {
                let [error, tolerance] = [choice.error, found.tolerance].map(percent);
                let words = [scene, found.goal.name].map(str::to_owned).into_iter();
                let costs = [choice.cost, reference].map(number);
                words.chain([tolerance, choice.setting.name.clone(), error]).chain(costs)
            };
            match found.solver {
                Some(choice) => table.row(row(choice)),
                None => unmet.push(beyond(scene, &found, sweep)),
            }
            if let Some(choice) = found.network {
                networks.row(row(choice));
            }
            let stands_for_all =
                found.tolerance == TOLERANCES[1] && found.goal.name == GOALS[0].name;
            if let Some(choice) = found.solver.filter(|_| stands_for_all) {
                enough.push(short(scene, choice, &found, reference));
            }
        }
    }
    let mut blocks = Vec::new();
    if !enough.is_empty() {
        blocks.push(Block::headline(format!(
            "The cheapest solvers with the front within {} of the runout and no more of the mass \
             misplaced. {}.",
            percent(TOLERANCES[1]),
            enough.join("; ")
        )));
    }
    blocks.extend([
        Block::text(
            "The cheapest of all measured settings within a tolerance of the discs. Shape: the larger of \
             the error of the front, relative to the runout, and the share of the mass misplaced, at the \
             end. Every point: root mean square distance of points over all frames, relative to the \
             runout.",
        ),
        Block::Table(table),
        Block::List(unmet),
    ]);
    if !networks.rows.is_empty() {
        blocks.push(Block::Table(networks));
    }
    blocks
}

/// A goal that no setting of the solver meets.
fn beyond(scene: &str, found: &Recommendation, sweep: &Sweep) -> String {
    format!(
        "{scene}, {} within {}: nothing is so close; two seeds of the discs differ by {}.",
        found.goal.name,
        percent(found.tolerance),
        percent((found.goal.relative)(&sweep.floor, sweep))
    )
}

/// The choices for one goal, instead of the cost of the discs (s).
fn short(scene: &str, solver: Choice, found: &Recommendation, discs: f64) -> String {
    let words = |choice: Choice| format!("{} ({})", choice.setting.name, seconds(choice.cost));
    let network = found.network.map_or(String::new(), |choice| format!(", or {}", words(choice)));
    format!("{scene}: {} instead of {}{network}", words(solver), seconds(discs))
}
