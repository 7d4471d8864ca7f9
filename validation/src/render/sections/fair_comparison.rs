//! Methods against each other: at equal error, at equal time, and when a network pays back.

use super::MEASURES;
use crate::block::{Block, Table};
use crate::model_cost::ModelCost;
use crate::pareto::{as_accurate, as_fast, break_even, front};
use crate::sweep::{Family, Measured, Sweep};
use crate::table::{number, seconds};

/// Each network and each continuum setting against the solver, by McGreivy and Hakim's rules.
pub(super) fn comparisons(sweep: &Sweep) -> Vec<Block> {
    let columns = [
        "method",
        "measure",
        "cheapest solver setting as accurate",
        "speed-up",
        "over the reference",
        "best solver setting as fast",
        "its error is larger by",
    ];
    let mut table = Table::new("Fair comparisons", columns).note(
        "Networks are compared with packings and the mu(I) law, the law with packings. Speed-up: \
         time of that setting over time of the method; below 1 the method loses. The speed-up over \
         the reference, which is far more accurate than needed, flatters. Errors within the noise \
         count as equal.",
    );
    let mut lines = Vec::new();
    let all: Vec<_> = sweep.measured.iter().map(|m| m.cost(MEASURES[0].2)).collect();
    let front = front(&all, MEASURES[0].2(&sweep.floor));
    for (place, method) in sweep.measured.iter().enumerate() {
        let compared = matches!(method.family, Family::Continuum | Family::Network);
        if !compared || method.error.is_none() {
            continue;
        }
        let rivals = rivals(sweep, method);
        for (name, _, measure) in MEASURES {
            let floor = measure(&sweep.floor);
            let costs: Vec<_> = rivals.iter().map(|m| m.cost(measure)).collect();
            let cost = method.cost(measure);
            let accurate = as_accurate(cost, &costs, floor);
            let fast = as_fast(cost, &costs);
            let speed_up = accurate.map(|k| costs[k].seconds / cost.seconds);
            let gain = fast.map(|k| costs[k].error.max(floor) / cost.error.max(floor));
            table.row([
                method.name.clone(),
                name.to_owned(),
                accurate.map_or("none measured".to_owned(), |k| rivals[k].name.clone()),
                speed_up.map_or(String::new(), number),
                number(sweep.measured[0].seconds / cost.seconds),
                fast.map_or("none is as fast".to_owned(), |k| rivals[k].name.clone()),
                gain.map_or(String::new(), number),
            ]);
            // What is worth a sentence: what nothing beats in both, and what loses.
            let loses = speed_up.is_some_and(|ratio| ratio < 1.0) || gain.is_some_and(|g| g < 1.0);
            if name == MEASURES[0].0 && (loses || front.contains(&place)) {
                lines.push(sentence(method, speed_up, accurate.map(|k| rivals[k]), gain));
            }
        }
    }
    if table.rows.is_empty() {
        return Vec::new();
    }
    vec![Block::Findings(lines), Block::Table(table)]
}

/// What a method is measured against: everything of the families that solve equations.
fn rivals<'s>(sweep: &'s Sweep, method: &Measured) -> Vec<&'s Measured> {
    let fair = |family| match method.family {
        Family::Network | Family::Ablation => {
            matches!(family, Family::Packings | Family::Continuum)
        }
        Family::Packings | Family::Continuum => family == Family::Packings,
    };
    sweep.measured.iter().filter(|m| fair(m.family)).collect()
}

/// The most accurate network against the cheapest setting of the solver that is as accurate.
pub(super) fn headline(case: &str, sweep: &Sweep) -> String {
    let metres = |m: &Measured| m.error.map_or(f64::NAN, |error| error.distance);
    let noise = format!(
        "The reference needs {}, and two seeds of it are {} m apart (root mean square over points and \
         frames).",
        seconds(sweep.measured[0].seconds),
        number(sweep.floor.distance)
    );
    let networks = sweep.measured.iter().filter(|m| m.family == Family::Network);
    let networks = networks.filter(|m| m.error.is_some());
    let Some(best) = networks.min_by(|a, b| metres(a).total_cmp(&metres(b))) else {
        return format!("{case}: no network was compared. {noise}");
    };
    let rivals = rivals(sweep, best);
    let costs: Vec<_> = rivals.iter().map(|m| m.cost(|e| e.mse)).collect();
    let cost = best.cost(|e| e.mse);
    let rival = as_accurate(cost, &costs, sweep.floor.mse).map(|k| rivals[k]);
    let paid = match (rival, best.model.as_ref().map(|model| ModelCost::beside(&model.path))) {
        (Some(rival), Some(Ok(cost))) => break_even(cost.total(), best.seconds, rival.seconds),
        _ => None,
    };
    let paid = paid.map_or(String::new(), |runs| {
        format!(" Its data and training pay back after {runs:.0} runs.")
    });
    let against = match rival {
        Some(rival) => {
            let (time, ratio) = (seconds(rival.seconds), rival.seconds / best.seconds);
            let verdict = if ratio >= 1.0 {
                format!("{} times as long", number(ratio))
            } else {
                "so the network loses".to_owned()
            };
            format!("For as small an error the solver needs {time} ({}), {verdict}.", rival.name)
        }
        None => "No setting of the solver that was tried is as accurate.".to_owned(),
    };
    format!(
        "{case}: the most accurate network ({}) needs {} and is {} m off. {against}{paid} {noise}",
        best.name,
        seconds(best.seconds),
        number(metres(best)),
    )
}

fn sentence(
    method: &Measured,
    speed_up: Option<f64>,
    rival: Option<&Measured>,
    gain: Option<f64>,
) -> String {
    let name = &method.name;
    let equal_error = match (speed_up, rival) {
        (Some(ratio), Some(rival)) if ratio >= 1.0 => format!(
            "{} times as fast as the cheapest setting of the solver that is as accurate ({})",
            number(ratio),
            rival.name
        ),
        (Some(ratio), Some(rival)) => format!(
            "{} times slower than {}, which is as accurate: it loses",
            number(1.0 / ratio),
            rival.name
        ),
        _ => "more accurate than every setting of the solver that was measured".to_owned(),
    };
    let equal_time = match gain {
        Some(gain) if gain > 1.0 => {
            format!("in its time the solver's best setting has {} times its error", number(gain))
        }
        Some(gain) if gain < 1.0 => format!(
            "in its time the solver can be more accurate ({} of its error): it loses",
            number(gain)
        ),
        Some(_) => "in its time the solver is as accurate".to_owned(),
        None => "no setting of the solver is as fast".to_owned(),
    };
    format!("{name} (points): {equal_error}; {equal_time}.")
}

/// After how many runs a network has paid for its data and its training.
pub(super) fn pay_back(sweep: &Sweep) -> Vec<Block> {
    let networks =
        sweep.measured.iter().filter(|m| m.family == Family::Network && m.error.is_some());
    let columns = [
        "network",
        "data and training",
        "a run",
        "against",
        "cheapest setting as accurate",
        "a run of it",
        "pays back after",
    ];
    let mut table = Table::new("Break-even", columns).note(
        "Number of runs of this scene after which making data and training have paid back, \
               against the cheapest setting of the solver whose points are as accurate.",
    );
    let mut blocks = vec![Block::heading("When a network pays back")];
    for network in networks {
        let cost = match network.model.as_ref().map(|model| ModelCost::beside(&model.path)) {
            Some(Ok(cost)) => cost,
            Some(Err(missing)) => {
                blocks.push(Block::missing(
                    format!("When `{}` pays back", network.name),
                    missing.why,
                    missing.remedy,
                ));
                continue;
            }
            None => continue,
        };
        let all = rivals(sweep, network);
        let packings: Vec<&Measured> =
            all.iter().copied().filter(|m| m.family == Family::Packings).collect();
        for (against, rivals) in [("all solvers", all), ("packings", packings)] {
            let costs: Vec<_> = rivals.iter().map(|m| m.cost(|e| e.mse)).collect();
            let found = as_accurate(network.cost(|e| e.mse), &costs, sweep.floor.mse);
            let runs =
                found.and_then(|k| break_even(cost.total(), network.seconds, costs[k].seconds));
            table.row([
                network.name.clone(),
                seconds(cost.total()),
                seconds(network.seconds),
                against.to_owned(),
                found.map_or("none measured".to_owned(), |k| rivals[k].name.clone()),
                found.map_or(String::new(), |k| seconds(costs[k].seconds)),
                runs.map_or("never".to_owned(), |runs| format!("{runs:.0} runs")),
            ]);
        }
    }
    if !table.rows.is_empty() {
        blocks.push(Block::Table(table));
    }
    if blocks.len() > 1 { blocks } else { Vec::new() }
}
