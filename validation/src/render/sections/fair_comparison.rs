//! Methods against each other: at equal error, at equal time, and when a network pays back.

use crate::render::block::Block;
use crate::render::table::Table;
use crate::studies::fair_comparison::{Comparison, PayBack, best_network, comparisons, pay_back};
use crate::studies::pareto::front;
use crate::studies::sweep::{Case, Family, MEASURES, Measured, Sweep};
use crate::text::{length, number, seconds};

/// The default packings, each network and each setting of the mu(I) law against their rivals.
pub fn comparison_blocks(sweep: &Sweep) -> Vec<Block> {
    let columns = [
        "method",
        "measure",
        "cheapest rival as accurate",
        "speed-up",
        "over the discs",
        "best rival as fast",
        "its error is larger by",
    ];
    let mut table = Table::new("Fair comparisons", columns).note(
        "Rivals of a network: discs of any size, packings and the mu(I) law; of a solver: those of the \
         other kinds. Speed-up: time of the rival over time of the method; below 1 the method loses. \
         Errors within the spread between seeds count as equal.",
    );
    let mut lines = Vec::new();
    for found in comparisons(sweep) {
        table.row([
            found.method.name.clone(),
            found.measure.to_owned(),
            found.accurate.map_or("none measured".to_owned(), |rival| rival.name.clone()),
            found.speed_up.map_or(String::new(), number),
            number(found.over_truth),
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
            "{} times as fast as the cheapest rival that is as accurate ({})",
            number(ratio),
            rival.name
        ),
        (Some(ratio), Some(rival)) => format!(
            "loses to {}, which is as accurate in {} of its time",
            rival.name,
            number(ratio)
        ),
        _ => "more accurate than every measured rival".to_owned(),
    };
    let equal_time = match found.gain {
        Some(gain) if gain > 1.0 => {
            format!("in its time the best rival has {} times its error", number(gain))
        }
        Some(gain) if gain < 1.0 => {
            format!("in its time the best rival has {} of its error", number(gain))
        }
        Some(_) => "in its time the best rival is as accurate".to_owned(),
        None => "no rival is as fast".to_owned(),
    };
    format!("{} (distance of points): {equal_error}; {equal_time}.", found.method.name)
}

/// What the discs, the packings and the best of the others need for a case, in one sentence without terms.
pub fn lead(case: &Case, sweep: &Sweep) -> String {
    let scene = case.scene.description;
    let words = |m: &Measured| {
        let distance = m.error.map_or(f64::NAN, |error| error.distance);
        format!("{} ({} off)", seconds(m.seconds), length(distance))
    };
    let mut text = format!(
        "Where {scene}, every grain as a disc takes {}",
        seconds(sweep.measured[0].seconds)
    );
    if let Some(packings) = sweep.measured.get(1).filter(|m| m.error.is_some()) {
        text += &format!(", packings in points {}", words(packings));
    }
    if let Some(law) = best_of(sweep, Family::Continuum) {
        text += &format!(", the best formula {}", words(law));
    }
    if let Some(best) = best_network(sweep) {
        text += &format!(", the best network {}", words(best.network));
    }
    format!(
        "{text}. Two runs with other grains are {} apart (root mean squares over points and time).",
        length(sweep.floor.distance)
    )
}

/// The most accurate setting of a family.
fn best_of(sweep: &Sweep, family: Family) -> Option<&Measured> {
    let distance = |m: &Measured| m.error.map_or(f64::INFINITY, |error| error.distance);
    let done = sweep.measured.iter().filter(|m| m.family == family && m.error.is_some());
    done.min_by(|a, b| distance(a).total_cmp(&distance(b)))
}

/// What nothing beats in both time and distance, and the most accurate network.
pub fn headline(case: &str, sweep: &Sweep) -> String {
    let costs: Vec<_> = sweep.measured.iter().map(|m| m.cost(MEASURES[0].value)).collect();
    let words = |place: usize| {
        let m = &sweep.measured[place];
        format!("{} ({}, {} m)", m.name, seconds(m.seconds), number(costs[place].error))
    };
    let front: Vec<String> = front(&costs, sweep.floor.distance).into_iter().map(words).collect();
    let pays = best_network(sweep).map_or(String::new(), |best| {
        let network = &best.network.name;
        match (best.rival, best.break_even) {
            (Some(rival), Some(runs)) => format!(
                " The most accurate network ({network}) pays back after {runs:.0} runs, against {}.",
                rival.name
            ),
            (Some(rival), None) => format!(
                " The most accurate network ({network}) never pays back, against {}.",
                rival.name
            ),
            (None, _) => format!(" No rival is as accurate as the network {network}."),
        }
    });
    format!(
        "{case}: no setting beats these in both time and distance from the discs: {}.{pays} Two seeds of \
         the discs are {} m apart.",
        front.join("; "),
        number(sweep.floor.distance)
    )
}

/// After how many runs networks have paid back their data and training.
pub fn pay_back_blocks(sweep: &Sweep) -> Vec<Block> {
    let columns = [
        "network",
        "data and training",
        "a run",
        "against",
        "cheapest rival as accurate",
        "a run of it",
        "pays back after",
    ];
    let mut table = Table::new("Break-even", columns).note(
        "Runs of this scene after which data and training have paid back, against the cheapest rival whose \
         points are as near to the discs.",
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
