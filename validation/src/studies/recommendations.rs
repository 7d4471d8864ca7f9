//! The cheapest setting that stays within a tolerance.

use crate::studies::sweep::{Error, Measured, Sweep};

/// Tolerances, as fractions of the runout and of the mass.
pub const TOLERANCES: [f64; 3] = [0.2, 0.1, 0.05];

/// What is to be right.
pub struct Goal {
    /// Name of the goal.
    pub name: &'static str,
    /// Its error as a fraction of the runout or the mass.
    pub relative: fn(&Error, &Sweep) -> f64,
}

/// Front and places of mass at the end; the positions of all points over time.
pub const GOALS: [Goal; 2] = [
    Goal {
        name: "shape",
        relative: |error, sweep| (error.front / sweep.runout).max(error.misplaced),
    },
    Goal { name: "every point", relative: |error, sweep| error.distance / sweep.runout },
];

/// The cheapest settings for a goal and a tolerance.
pub struct Recommendation<'s> {
    /// What is to be right.
    pub goal: &'static Goal,
    /// Tolerated relative error.
    pub tolerance: f64,
    /// The cheapest setting of the solver, if any is within the tolerance.
    pub solver: Option<Choice<'s>>,
    /// A network, where one is cheaper than all settings of the solver.
    pub network: Option<Choice<'s>>,
}

/// A setting with its cost.
#[derive(Clone, Copy)]
pub struct Choice<'s> {
    /// The setting.
    pub setting: &'s Measured,
    /// Its relative error.
    pub error: f64,
    /// Its cost, s.
    pub cost: f64,
}

/// Recommendations for all goals and tolerances.
pub fn recommend(sweep: &Sweep) -> Vec<Recommendation<'_>> {
    let all = GOALS.iter().flat_map(|goal| TOLERANCES.map(move |tolerance| (goal, tolerance)));
    all.map(|(goal, tolerance)| {
        let solver = cheapest(sweep, goal.relative, tolerance, is_solver);
        let any = cheapest(sweep, goal.relative, tolerance, |_| true);
        let network = any.filter(|choice| !is_solver(choice.setting));
        Recommendation { goal, tolerance, solver, network }
    })
    .collect()
}

/// Cost of a setting, s: processor time if the whole sweep ran on processors, else wall time.
pub fn cost(sweep: &Sweep) -> fn(&Measured) -> f64 {
    let mut done = sweep.measured.iter().filter(|m| m.error.is_some());
    if done.all(|m| m.device.starts_with("cpu") && m.processor_seconds.is_some()) {
        |m| m.processor_seconds.unwrap_or(m.seconds)
    } else {
        |m| m.seconds
    }
}

fn is_solver(setting: &Measured) -> bool {
    setting.family.is_solver()
}

fn cheapest(
    sweep: &Sweep,
    relative: fn(&Error, &Sweep) -> f64,
    tolerance: f64,
    among: fn(&Measured) -> bool,
) -> Option<Choice<'_>> {
    let cost = cost(sweep);
    let some = sweep.measured.iter().filter(|m| among(m));
    let choices = some.filter_map(|setting| {
        let error = relative(setting.error.as_ref()?, sweep);
        Some(Choice { setting, error, cost: cost(setting) })
    });
    choices.filter(|choice| choice.error <= tolerance).min_by(|a, b| a.cost.total_cmp(&b.cost))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::studies::sweep::Family;

    fn measured(name: &str, seconds: f64, front: f64) -> Measured {
        Measured {
            family: Family::Packings,
            name: name.to_owned(),
            model: None,
            seconds,
            spread: None,
            error: Some(Error { front, ..Error::default() }),
            comparison: None,
            failure: String::new(),
            warnings: String::new(),
            device: String::new(),
            processor_seconds: None,
            load: None,
        }
    }

    fn sweep(measured: Vec<Measured>) -> Sweep {
        Sweep {
            measured,
            outside: Vec::new(),
            seeds: 8,
            floor: Error::default(),
            front: 3.0,
            runout: 2.0,
        }
    }

    #[test]
    fn the_cheapest_within_the_tolerance_is_chosen() {
        let sweep = sweep(vec![
            measured("fine", 10.0, 0.01),
            measured("coarse", 1.0, 0.30),
            measured("middle", 3.0, 0.08),
            Measured { error: None, ..measured("failed", 0.1, 0.0) },
            Measured { family: Family::Network, ..measured("network", 0.1, 0.0) },
        ]);
        let chosen = |tolerance| {
            cheapest(&sweep, GOALS[0].relative, tolerance, is_solver)
                .map(|choice| (choice.setting.name.as_str(), choice.error))
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
        let processors = sweep(vec![on("cpu, 2 threads"), on("cpu, 2 threads")]);
        assert_eq!(cost(&processors)(&processors.measured[0]), 7.0);
        let mixed = sweep(vec![on("cpu, 2 threads"), on("NVIDIA H200")]);
        assert_eq!(cost(&mixed)(&mixed.measured[0]), 1.0);
    }
}
