//! Methods against each other: at equal error, at equal time, and when a network pays back.

use crate::render::block::Block;
use crate::render::table::Table;
use crate::studies::fair_comparison::{Comparison, PayBack, best_network, comparisons, pay_back};
use crate::studies::sweep::{Case, MEASURES, Sweep};
use crate::text::{length, number, seconds};

/// Each network and each setting of the mu(I) law against the solver.
pub fn comparison_blocks(sweep: &Sweep) -> Vec<Block> {
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
         the reference flatters, since the reference is far more accurate than needed. Errors within \
         the noise count as equal.",
    );
    let mut lines = Vec::new();
    for found in comparisons(sweep) {
        table.row([
            found.method.name.clone(),
            found.measure.to_owned(),
            found.accurate.map_or("none measured".to_owned(), |rival| rival.name.clone()),
            found.speed_up.map_or(String::new(), number),
            number(found.over_reference),
            found.fast.map_or("none is as fast".to_owned(), |rival| rival.name.clone()),
            found.gain.map_or(String::new(), number),
        ]);
        let loses =
            found.speed_up.is_some_and(|ratio| ratio < 1.0) || found.gain.is_some_and(|g| g < 1.0);
        if found.measure == MEASURES[0].name && (loses || found.on_front) {
            lines.push(sentence(&found));
        }
    }
    if table.rows.is_empty() {
        return Vec::new();
    }
    vec![Block::Findings(lines), Block::Table(table)]
}

fn sentence(found: &Comparison) -> String {
    let equal_error = match (found.speed_up, found.accurate) {
        (Some(ratio), Some(rival)) if ratio >= 1.0 => format!(
            "{} times as fast as the cheapest setting of the solver that is as accurate ({})",
            number(ratio),
            rival.name
        ),
        (Some(ratio), Some(rival)) => format!(
            "loses to {}, which is as accurate in {} of its time",
            rival.name,
            number(ratio)
        ),
        _ => "more accurate than every measured setting of the solver".to_owned(),
    };
    let equal_time = match found.gain {
        Some(gain) if gain > 1.0 => {
            format!("in its time the solver's best setting has {} times its error", number(gain))
        }
        Some(gain) if gain < 1.0 => {
            format!("in its time the solver's best setting has {} of its error", number(gain))
        }
        Some(_) => "in its time the solver is as accurate".to_owned(),
        None => "no setting of the solver is as fast".to_owned(),
    };
    format!("{} (points): {equal_error}; {equal_time}.", found.method.name)
}

/// What the solver and the most accurate network need for a case, in one sentence without terms.
pub fn lead(case: &Case, sweep: &Sweep) -> String {
    let [width, height] = case.size;
    let scene = format!("A column of grains {width} m wide and {height} m high collapses");
    let reference = seconds(sweep.measured[0].seconds);
    let Some(best) = best_network(sweep) else {
        return format!(
            "{scene}: the solver computes it in {reference}, and two runs that differ only in the \
             random packing of the grains end up {} apart.",
            length(sweep.floor.distance)
        );
    };
    let rival = match best.rival {
        Some(rival) => format!(
            "the solver's cheapest setting that is as accurate takes {}",
            seconds(rival.seconds)
        ),
        None => "no setting of the solver that was measured is as accurate".to_owned(),
    };
    format!(
        "{scene}: the solver computes it in {reference}, the best network in {} with points {} off \
         (root mean square), and {rival}.",
        seconds(best.network.seconds),
        length(best.network.error.map_or(f64::NAN, |error| error.distance))
    )
}

/// The most accurate network against the cheapest setting of the solver that is as accurate.
pub fn headline(case: &str, sweep: &Sweep) -> String {
    let noise = format!(
        "The reference takes {}, and two seeds of it are {} m apart (root mean square over points and \
         frames).",
        seconds(sweep.measured[0].seconds),
        number(sweep.floor.distance)
    );
    let Some(best) = best_network(sweep) else {
        return format!("{case}: no network was compared. {noise}");
    };
    let network = best.network;
    let rival = match best.rival {
        Some(rival) => {
            let ratio = rival.seconds / network.seconds;
            let verdict = if ratio >= 1.0 {
                format!("{} times as long", number(ratio))
            } else {
                "so the network loses".to_owned()
            };
            let (time, name) = (seconds(rival.seconds), &rival.name);
            format!("For as small an error the solver takes {time} ({name}), {verdict}.")
        }
        None => "No measured setting of the solver is as accurate.".to_owned(),
    };
    let break_even = best.break_even.map_or(String::new(), |runs| {
        format!(" Its data and training pay back after {runs:.0} runs.")
    });
    format!(
        "{case}: the most accurate network ({}) takes {} and is {} m off. {rival}{break_even} {noise}",
        network.name,
        seconds(network.seconds),
        number(network.error.map_or(f64::NAN, |error| error.distance)),
    )
}

/// After how many runs networks have paid back their data and training.
pub fn pay_back_blocks(sweep: &Sweep) -> Vec<Block> {
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
        "Runs of this scene after which data and training have paid back, against the cheapest setting \
         of the solver whose points are as accurate.",
    );
    let mut blocks = vec![Block::heading("When a network pays back")];
    for found in pay_back(sweep) {
        match found {
            Ok(all) => all.into_iter().for_each(|found| table.row(row(&found))),
            Err((network, why)) => blocks.push(Block::missing(
                format!("When `{}` pays back", network.name),
                why,
                "It has the keys `data_seconds`, `training_seconds` and `device`.",
            )),
        }
    }
    if !table.rows.is_empty() {
        blocks.push(Block::Table(table));
    }
    if blocks.len() > 1 { blocks } else { Vec::new() }
}

fn row(found: &PayBack) -> [String; 7] {
    [
        found.network.name.clone(),
        seconds(found.invested),
        seconds(found.network.seconds),
        found.against.to_owned(),
        found.rival.map_or("none measured".to_owned(), |rival| rival.name.clone()),
        found.rival.map_or(String::new(), |rival| seconds(rival.seconds)),
        found.runs.map_or("never".to_owned(), |runs| format!("{runs:.0} runs")),
    ]
}
