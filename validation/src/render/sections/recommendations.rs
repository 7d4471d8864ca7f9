//! The cheapest setting that stays within a tolerance, scene by scene.

use crate::block::{Block, Table};
use crate::context::Context;
use crate::section::Section;
use crate::sweep::{Case, Error, Family, Measured, Sweep};
use crate::table::{number, seconds};

/// What a scene needs.
pub struct Needs;

/// Tolerances, parts of the runout and of the column's height.
const TOLERANCES: [f64; 3] = [0.1, 0.05, 0.02];

/// What is to be right: a name, and its relative error.
type Goal = (&'static str, fn(&Error, &Sweep) -> f64);

const GOALS: [Goal; 2] = [
    ("shape", |error, sweep| (error.front / sweep.runout).max(error.height / sweep.height)),
    ("every point", |error, sweep| error.distance / sweep.runout),
];

impl Section for Needs {
    fn title(&self) -> &'static str {
        "What a scene needs"
    }

    fn run(&self, context: &mut Context) -> miette::Result<Vec<Block>> {
        let columns =
            ["scene", "goal", "tolerance", "setting", "error", "cost [s]", "reference cost [s]"];
        let mut table = Table::new("Recommendations", columns).note(
            "Settings of the solver. Errors are parts of the runout. Cost is processor time where all \
             ran on processors, wall time otherwise: of four equal runs at once on two cores, the \
             wall time was 3.6 times that of one alone, the processor time 1.2 times. `dempm check` \
             quotes this table as it was when the program was built.",
        );
        let mut networks = Table::new("Networks that are cheaper", columns)
            .note("Where the cheapest of all is a network; what it learnt from is in Table 6.");
        let mut beyond = Vec::new();
        let mut enough = Vec::new();
        let mut absent = Vec::new();
        for case in Case::of(context.suite) {
            if !case.missing(context).is_empty() {
                absent.push(case.name);
                continue;
            }
            let sweep = case.measure(context)?;
            let cost = cost(&sweep);
            let reference = cost(&sweep.measured[0]);
            for (goal, relative) in GOALS {
                for tolerance in TOLERANCES {
                    let row = |(setting, error): (&Measured, f64)| {
                        let [error, tolerance] = [error, tolerance].map(percent);
                        let costs = [cost(setting), reference].map(number);
                        let words = [case.name, goal].map(str::to_owned).into_iter();
                        words.chain([tolerance, setting.name.clone(), error]).chain(costs)
                    };
                    let solver = cheapest(&sweep, relative, tolerance, cost, is_solver);
                    let any = cheapest(&sweep, relative, tolerance, cost, |_| true);
                    match solver {
                        Some(found) => table.row(row(found)),
                        None => beyond.push(format!(
                            "{}, {goal} within {}: no setting that was tried is so close; two seeds \
                             of the reference differ by {}.",
                            case.name,
                            percent(tolerance),
                            percent(relative(&sweep.floor, &sweep))
                        )),
                    }
                    let network = any.filter(|(setting, _)| !is_solver(setting));
                    if let Some(found) = network {
                        networks.row(row(found));
                    }
                    if tolerance == TOLERANCES[1] && goal == GOALS[0].0 {
                        let words = |found: Option<(&Measured, f64)>| {
                            let (setting, _) = found?;
                            Some(format!("{} ({})", setting.name, seconds(cost(setting))))
                        };
                        let of_solver = words(solver).unwrap_or("no setting of the solver".into());
                        let or =
                            words(network).map_or(String::new(), |words| format!(", or {words}"));
                        let [name, all] = [case.name.to_owned(), seconds(reference)];
                        enough.push(format!("{name}: {of_solver} instead of {all}{or}"));
                    }
                }
            }
        }
        let mut blocks = Vec::new();
        if !enough.is_empty() {
            blocks.push(Block::headline(format!(
                "The cheapest that gets front and height right within {} of the runout and the \
                 height. {}.",
                percent(TOLERANCES[1]),
                enough.join("; ")
            )));
        }
        blocks.extend([
            Block::text(
                "The cheapest of all measured settings that stays within a tolerance of the \
                 reference. Shape: front and height profile at the end, as parts of the runout and \
                 of the column's height, whichever is worse. Every point: the root mean square \
                 distance of points over all frames, as part of the runout.",
            ),
            Block::Table(table),
            Block::List(beyond),
        ]);
        if !networks.rows.is_empty() {
            blocks.push(Block::Table(networks));
        }
        if !absent.is_empty() {
            blocks.push(Block::missing(
                absent.join(", "),
                "not all settings have been measured.",
                "`--only` with the scene's name does it.",
            ));
        }
        Ok(blocks)
    }
}

/// Whether it solves equations.
fn is_solver(setting: &Measured) -> bool {
    matches!(setting.family, Family::Packings | Family::Continuum)
}

/// What a setting costs, s.
type Cost = fn(&Measured) -> f64;

/// Processor time, if it was only processors that worked; wall time otherwise.
fn cost(sweep: &Sweep) -> Cost {
    let mut done = sweep.measured.iter().filter(|m| m.error.is_some());
    if done.all(|m| m.device.starts_with("cpu") && m.processor_seconds.is_some()) {
        |m| m.processor_seconds.unwrap_or(m.seconds)
    } else {
        |m| m.seconds
    }
}

/// The cheapest of some settings within a tolerance, and its error.
fn cheapest(
    sweep: &Sweep,
    relative: fn(&Error, &Sweep) -> f64,
    tolerance: f64,
    cost: Cost,
    among: fn(&Measured) -> bool,
) -> Option<(&Measured, f64)> {
    let some = sweep.measured.iter().filter(|m| among(m));
    let errors = some.filter_map(|m| Some((m, relative(m.error.as_ref()?, sweep))));
    errors
        .filter(|(_, error)| *error <= tolerance)
        .min_by(|(a, _), (b, _)| cost(a).total_cmp(&cost(b)))
}

fn percent(part: f64) -> String {
    format!("{} %", number(100.0 * part))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn measured(name: &str, seconds: f64, front: f64) -> Measured {
        Measured {
            family: Family::Packings,
            name: name.to_owned(),
            model: None,
            seconds,
            spread: None,
            error: Some(Error { front, ..Error::default() }),
            failure: String::new(),
            device: String::new(),
            processor_seconds: None,
            load: None,
        }
    }

    #[test]
    fn the_cheapest_within_the_tolerance_is_chosen() {
        let sweep = Sweep {
            measured: vec![
                measured("fine", 10.0, 0.01),
                measured("coarse", 1.0, 0.30),
                measured("middle", 3.0, 0.08),
                Measured { error: None, ..measured("failed", 0.1, 0.0) },
                Measured { family: Family::Network, ..measured("network", 0.1, 0.0) },
            ],
            floor: Error::default(),
            reference_seconds: [10.0; 2],
            front: 3.0,
            runout: 2.0,
            height: 1.0,
        };
        let chosen = |tolerance| {
            cheapest(&sweep, GOALS[0].1, tolerance, cost(&sweep), is_solver)
                .map(|(m, error)| (m.name.as_str(), error))
        };
        assert_eq!(chosen(0.2), Some(("coarse", 0.15)));
        assert_eq!(chosen(0.05), Some(("middle", 0.04)));
        assert_eq!(chosen(0.001), None);
    }

    #[test]
    fn processor_time_counts_where_only_processors_worked() {
        let on = |device: &str| Measured {
            device: device.into(),
            processor_seconds: Some(7.0),
            ..measured("setting", 1.0, 0.0)
        };
        let sweep = |measured| Sweep {
            measured,
            floor: Error::default(),
            reference_seconds: [10.0; 2],
            front: 3.0,
            runout: 2.0,
            height: 1.0,
        };
        let processors = sweep(vec![on("cpu, 2 threads"), on("cpu, 2 threads")]);
        assert_eq!(cost(&processors)(&processors.measured[0]), 7.0);
        let mixed = sweep(vec![on("cpu, 2 threads"), on("NVIDIA H200")]);
        assert_eq!(cost(&mixed)(&mixed.measured[0]), 1.0);
    }
}
