//! The cheapest setting that stays within a tolerance, scene by scene.

use crate::block::{Block, Table};
use crate::context::Context;
use crate::section::Section;
use crate::sweep::{Case, Error, Measured, Sweep};
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
            ["scene", "goal", "tolerance", "setting", "error", "seconds", "reference seconds"];
        let mut table = Table::new("Recommendations", columns).note(
            "Errors are parts of the runout. `dempm check` quotes this table as it was when the \
             program was built.",
        );
        let mut lines = Vec::new();
        for case in Case::of(context.suite) {
            let sweep = case.measure(context)?;
            let reference = &sweep.measured[0];
            for (goal, relative) in GOALS {
                let floor = relative(&sweep.floor, &sweep);
                for tolerance in TOLERANCES {
                    let found = cheapest(&sweep, relative, tolerance);
                    let Some((setting, error)) = found else {
                        lines.push(format!(
                            "{}, {goal} within {}: nothing measured is so close; two seeds of the \
                             reference differ by {}.",
                            case.name,
                            percent(tolerance),
                            percent(floor)
                        ));
                        continue;
                    };
                    table.row([
                        case.name.to_owned(),
                        goal.to_owned(),
                        percent(tolerance),
                        setting.name.clone(),
                        percent(error),
                        number(setting.seconds),
                        number(reference.seconds),
                    ]);
                    lines.push(format!(
                        "{}, {goal} within {}: {} is enough ({}, {} instead of {}).",
                        case.name,
                        percent(tolerance),
                        setting.name,
                        percent(error),
                        seconds(setting.seconds),
                        seconds(reference.seconds)
                    ));
                }
            }
        }
        Ok(vec![
            Block::text(
                "The cheapest of all measured settings that stays within a tolerance of the \
                 reference. Shape: front and height profile at the end, as parts of the runout and \
                 of the column's height, whichever is worse. Every point: the root mean square \
                 distance of points over all frames, as part of the runout.",
            ),
            Block::Findings(lines),
            Block::Table(table),
        ])
    }
}

/// The cheapest setting within a tolerance, and its error.
fn cheapest(
    sweep: &Sweep,
    relative: fn(&Error, &Sweep) -> f64,
    tolerance: f64,
) -> Option<(&Measured, f64)> {
    let errors =
        sweep.measured.iter().filter_map(|m| Some((m, relative(m.error.as_ref()?, sweep))));
    errors
        .filter(|(_, error)| *error <= tolerance)
        .min_by(|(a, _), (b, _)| a.seconds.total_cmp(&b.seconds))
}

fn percent(part: f64) -> String {
    format!("{} %", number(100.0 * part))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sweep::Family;

    fn measured(name: &str, seconds: f64, front: f64) -> Measured {
        Measured {
            family: Family::Packings,
            name: name.to_owned(),
            model: None,
            seconds,
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
            ],
            floor: Error::default(),
            front: 3.0,
            runout: 2.0,
            height: 1.0,
        };
        let chosen = |tolerance| {
            cheapest(&sweep, GOALS[0].1, tolerance).map(|(m, error)| (m.name.as_str(), error))
        };
        assert_eq!(chosen(0.2), Some(("coarse", 0.15)));
        assert_eq!(chosen(0.05), Some(("middle", 0.04)));
        assert_eq!(chosen(0.001), None);
    }
}
